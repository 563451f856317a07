"""The roof of a surveyed building, and which openings lie below it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from benchmarks.estate.drawing import millimetres
from benchmarks.estate.plan import Roof
from benchmarks.estate.plans.citygml_walls import MARGIN_M, FoundOpening, FoundWall
from numpy.typing import NDArray

LEAST_OPENING_M = 0.3
GABLE_M = 1.0  # a gable rises this far above the ends of its wall
ABOVE_M = 0.35  # of wall above the highest window of a flat roof
OVERHANG_M = 0.3


def roof_of(
    walls: Sequence[FoundWall], openings: Sequence[Sequence[FoundOpening]]
) -> tuple[float, Roof, frozenset[int]]:
    """Height of the eaves, the roof, and the numbers of the gable walls.

    A gable roof where two opposite walls of four end in gables; elsewhere a flat one, above the
    windows of the survey's gables.
    """
    tops = [wall.tops_m for wall in walls]
    gabled = [top[3:8].max() > max(top[0], top[-1]) + GABLE_M and top.min() > 0 for top in tops]
    for i in (0, 1) if len(walls) == 4 else ():
        eaves = [float(np.median(tops[j])) for j in (1 - i, 3 - i)]
        even = abs(eaves[0] - eaves[1]) < GABLE_M and not (gabled[1 - i] or gabled[3 - i])
        if gabled[i] and gabled[i + 2] and even:
            eaves_m = millimetres(sum(eaves) / 2)
            rise_m = millimetres((tops[i].max() + tops[i + 2].max()) / 2 - eaves_m)
            return eaves_m, Roof("gable", rise_m, OVERHANG_M), frozenset({i, i + 2})
    known = [
        (float(min(top[0], top[-1]) if gable else np.median(top)), wall.width_m * (1 + len(found)))
        for top, gable, wall, found in zip(tops, gabled, walls, openings, strict=True)
        if top.max() > 0
    ]
    if not known:
        highest = max((o.y_m + o.height_m for found in openings for o in found), default=2.5)
        return millimetres(highest + ABOVE_M), Roof(), frozenset()
    eaves_m = _weighted_median(np.array(known))
    for wall, found in zip(walls, openings, strict=True):
        for opening in found:
            top_m = opening.y_m + opening.height_m + ABOVE_M
            if top_m <= wall.peak_m:
                eaves_m = max(eaves_m, top_m)
    return millimetres(eaves_m), Roof(), frozenset()


def _weighted_median(values: NDArray[np.float64]) -> float:
    """Median of rows (value, weight)."""
    ordered = values[np.argsort(values[:, 0])]
    shares = np.cumsum(ordered[:, 1]) / ordered[:, 1].sum()
    return float(ordered[np.searchsorted(shares, 0.5), 0])


def fitting(
    wall: FoundWall,
    eaves_m: float,
    rise_m: float,
    openings: Sequence[FoundOpening],
    gone: Counter[str],
) -> list[FoundOpening]:
    """The openings below eaves or gable that are large enough."""
    kept = []
    for opening in openings:
        ends = (opening.x_m, opening.x_m + opening.width_m)
        slope = 2 * rise_m / wall.width_m
        roof_m = eaves_m + min(slope * min(x, wall.width_m - x) for x in ends)
        if opening.y_m + opening.height_m > roof_m - MARGIN_M:
            gone["above the eaves (dormers)"] += 1
        elif min(opening.width_m, opening.height_m) < LEAST_OPENING_M:
            gone["smaller than 0.3 m"] += 1
        else:
            kept.append(opening)
    return kept
