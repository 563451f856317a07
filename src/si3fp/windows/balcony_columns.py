"""M.1: columns of balconies, how far they stand out, and where their slabs lie, without depth.

On the wall plane, a slab that stands out by d appears higher than it is: it hides the wall from
where it meets it up to where its edge appears. Storeys repeat, so the edges of a column appear
farther apart than the heads of the storeys' windows, by the factor D / (D - d) for cameras at
distance D: this tells d (docs/decisions/0019-what-slabs-hide.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections
from si3fp.windows.levels import shared_levels

SAME_SPAN = 0.6
"""Balconies of one column span the same part of the facade: intersection over union."""
LEAST_STOREYS = 3
"""Storeys of a column whose balconies tell how far they stand out."""
STANDS_OUT_M = np.arange(0.0, 2.21, 0.1)
"""How far balconies may stand out."""
BELOW_HEAD_M = np.arange(1.9, 2.91, 0.1)
"""How far a slab's underside may lie below the heads of its storey."""
EDGE_SIGMA_M = 0.25
"""Standard deviation of the lower edges of the detector's balconies."""
SLAB_M, SLAB_SIGMA_M = 0.2, 0.15
"""Thickness of a slab, and how well its place on the wall is known."""
HEAD_SIGMA_M = 0.05
LEAST_STOREY_M = 2.0
"""Storeys are higher; openings whose heads differ by less share one."""
LEAST_ROW = 2
"""Openings that tell the head of a storey."""


@dataclass(frozen=True, slots=True, eq=False)
class BalconyColumn:
    """Balconies one above the other.

    Attributes
    ----------
    left_m, right_m
        The part of the facade that they span, as it appears.
    slabs_m
        (K,) where the undersides of the slabs meet the wall, from below.
    edges_m
        (K,) where their outer edges appear on the wall plane.
    ahead_m
        How far they stand out.
    """

    left_m: float
    right_m: float
    slabs_m: FloatArray
    edges_m: FloatArray
    ahead_m: float


def balcony_columns(
    balconies: Detections,
    openings_px: FloatArray,
    sure_score: float,
    cameras: Sequence[FloatArray],
    grid: FacadeGrid,
) -> tuple[BalconyColumn, ...]:
    """Columns of balconies, from left to right; none where less than three storeys tell them.

    Parameters
    ----------
    balconies
        All of the detector, however weak.
    openings_px
        (N, 4) boxes of windows and doors, whose heads tell the storeys.
    sure_score
        Score from which a balcony needs no other.
    cameras
        Optical centres (3,) in the facade frame.
    grid
        Grid of the facade.

    Notes
    -----
    All columns of a facade stand out alike, and their slabs lie alike below the heads of the
    storeys: as the most balconies say, by their scores. A storey between two with a balcony has
    one too, and so has the next one above whose slab's edge would lie above the picture.
    """
    heads_m = _storey_heads(openings_px, grid)
    groups = _groups(balconies, sure_score)
    if len(heads_m) < LEAST_STOREYS or not groups or not cameras:
        return ()
    lower_m = grid.facade_from_pixels(balconies.boxes_px[:, [0, 3]])[:, 1]

    def off_sigma(edges_m: FloatArray, group: NDArray[np.intp]) -> FloatArray:
        """(storeys, balconies) how far lower edges lie off, in standard deviations."""
        return np.asarray((edges_m[:, None] - lower_m[None, group]) / EDGE_SIGMA_M)

    def agreement(ahead_m: float, below_m: float) -> float:
        edges_m = _appear(heads_m - below_m, ahead_m, cameras)
        return sum(
            float(
                (balconies.scores[g] * np.exp(-0.5 * off_sigma(edges_m, g) ** 2)).max(axis=1).sum()
            )
            for g in groups
        )

    tried = [(a, b) for a in STANDS_OUT_M.tolist() for b in BELOW_HEAD_M.tolist()]
    ahead_m, below_m = max(tried, key=lambda each: agreement(*each))
    slabs_m = heads_m - below_m
    edges_m = _appear(slabs_m, ahead_m, cameras)
    columns = []
    for group in groups:
        has = np.flatnonzero((np.abs(off_sigma(edges_m, group)) < 2).any(axis=1)).tolist()
        if len(has) < LEAST_STOREYS:
            continue
        cut_off = has[-1] + 1 < len(heads_m) and edges_m[has[-1] + 1] > grid.height_m - EDGE_SIGMA_M
        storeys = slice(has[0], has[-1] + (2 if cut_off else 1))
        sure = balconies.boxes_px[group[balconies.scores[group] >= sure_score]]
        left, _, right, _ = np.median(sure, axis=0)
        (left_m, _), (right_m, _) = grid.facade_from_pixels(np.array([[left, 0], [right, 0]]))
        columns.append(BalconyColumn(left_m, right_m, slabs_m[storeys], edges_m[storeys], ahead_m))
    return tuple(sorted(columns, key=lambda column: column.left_m))


def covers(fronts: Detections, columns: Sequence[BalconyColumn], grid: FacadeGrid) -> Detections:
    """What balconies hide, as boxes from where the slab meets the wall up to what ends in front.

    Parameters
    ----------
    fronts
        Solid fronts as they appear, slab and all.
    columns
        From `balcony_columns`.
    grid
        Grid of the facade.

    Notes
    -----
    A slab alone hides from the wall up to where its edge appears; bars above it hide nothing.
    In a column of solid fronts, one that was not found is like the others.
    """
    boxes, scores = fronts.boxes_px.copy(), list(fronts.scores)
    sigma = fronts.edge_sigma_px.copy()
    added = []
    for column in columns:
        (left, _), (right, _) = grid.pixels_from_facade(
            np.array([[column.left_m, 0.0], [column.right_m, 0.0]])
        )
        slabs = grid.pixels_from_facade(np.stack([column.slabs_m] * 2, axis=1))[:, 1]
        edges = grid.pixels_from_facade(np.stack([column.edges_m] * 2, axis=1))[:, 1]
        middle = (boxes[: len(fronts), 0] + boxes[: len(fronts), 2]) / 2
        mine = (middle > left) & (middle < right)
        near = np.abs(boxes[: len(fronts), None, 3] - edges) * grid.m_per_px < 2 * EDGE_SIGMA_M
        solid = near & mine[:, None]
        heights = (edges - boxes[: len(fronts), None, 1])[solid]
        above = np.median(heights) if len(heights) else SLAB_M / grid.m_per_px
        for storey, (slab, edge) in enumerate(zip(slabs, edges, strict=True)):
            its = np.flatnonzero(solid[:, storey])
            boxes[its, 3] = np.maximum(slab, edge)
            sigma[its, 3] = SLAB_SIGMA_M / grid.m_per_px
            if not len(its) and (edge < slab or len(heights)):
                added.append([left, edge - above, right, max(slab, edge)])
    extra = np.array(added).reshape(-1, 4)
    extra_sigma = np.tile([0.0, 0.0, 0.0, SLAB_SIGMA_M / grid.m_per_px], (len(extra), 1))
    return Detections(
        np.concatenate([boxes, extra]),
        np.concatenate([scores, np.ones(len(extra))]),
        np.full(len(boxes) + len(extra), "balcony"),
        np.concatenate([sigma, extra_sigma]),
    )


def _appear(heights_m: FloatArray, ahead_m: float, cameras: Sequence[FloatArray]) -> FloatArray:
    """Heights (K,) at which places ``ahead_m`` before the wall appear on it."""
    _, camera_m, distance_m = np.median(np.array(cameras), axis=0)
    rise: FloatArray = (heights_m - camera_m) * ahead_m / max(distance_m - ahead_m, 1.0)
    return heights_m + rise


def _storey_heads(openings_px: FloatArray, grid: FacadeGrid) -> FloatArray:
    """Heads (K,) of the storeys, from below: what most openings share, at least two."""
    tops_m = grid.facade_from_pixels(openings_px[:, [0, 1]])[:, 1]
    count = len(tops_m)
    index = shared_levels(tops_m, np.full(count, HEAD_SIGMA_M), np.ones(count, bool)).index
    rows = [tops_m[index == row] for row in range(index.max(initial=-1) + 1)]
    heads_m: list[float] = []
    for row in sorted(rows, key=len, reverse=True):
        head = float(np.median(row))
        if len(row) >= LEAST_ROW and all(abs(head - h) > LEAST_STOREY_M for h in heads_m):
            heads_m.append(head)
    return np.sort(heads_m)


def _groups(balconies: Detections, sure_score: float) -> list[NDArray[np.intp]]:
    """Indices of the balconies of each column that a sure one stands in, best first."""
    spans = balconies.boxes_px[:, [0, 2]]
    free = np.ones(len(spans), bool)
    groups = []
    for best in np.argsort(-balconies.scores, kind="stable"):
        if not free[best] or balconies.scores[best] < sure_score:
            continue
        low = np.maximum(spans[:, 0], spans[best, 0])
        high = np.minimum(spans[:, 1], spans[best, 1])
        union = np.maximum(spans[:, 1], spans[best, 1]) - np.minimum(spans[:, 0], spans[best, 0])
        members = np.flatnonzero(free & (high - low > SAME_SPAN * union))
        free[members] = False
        groups.append(members)
    return groups
