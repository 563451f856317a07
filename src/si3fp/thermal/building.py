"""A footprint and the facades found on it become one `Building`: ground, height, storeys."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from si3fp.config import ThermalConfig
from si3fp.model import Building, Facade, Footprint, GeoOrigin, Missing

ROW_GAP_M = 1.2
"""Window centres farther apart than this are rows of their own."""

MIN_STOREY_M = 2.0
"""Lower storeys are an error of the map, which would multiply the floor area."""


def make_building(
    footprint: Footprint,
    facades: Sequence[Facade],
    missing: Sequence[Missing],
    origin: GeoOrigin,
    default_height_m: float,
    config: ThermalConfig,
) -> tuple[Building, tuple[str, ...]]:
    """The building, and notes on what its ground, height and storeys rest on.

    The eaves of the facades found decide the height: their median, weighted by width, so that a
    blank gable whose eaves no line shows does not pull it. Without facades the footprint's height
    does, and without that the default.
    """
    notes = []
    widths = [facade.width_m for facade in facades]
    bottoms = [float(facade.world_from_facade.translation[2]) for facade in facades]
    if footprint.ground_m is not None:
        base_z_m = footprint.ground_m
    elif facades:
        base_z_m = float(np.average(bottoms, weights=widths))
        notes.append("ground from the facades")
    else:
        base_z_m = 0.0
        notes.append("ground assumed at the origin's height")
    if facades:
        tops = [z + facade.height_m for z, facade in zip(bottoms, facades, strict=True)]
        height_m = _weighted_median(tops, widths) - base_z_m
        notes.append(f"height {height_m:.2f} m from the eaves of {len(facades)} facades")
    elif footprint.height_m is not None:
        height_m = footprint.height_m
        notes.append("height from the footprint")
    else:
        height_m = default_height_m
        notes.append(f"height assumed {height_m:g} m: neither facade nor footprint gives it")
    mapped = footprint.storeys
    if mapped is not None and height_m >= mapped * MIN_STOREY_M:
        storeys = mapped
    else:
        if mapped is not None:
            notes.append(
                f"{mapped} storeys of the map would be {height_m / mapped:.2f} m high: not used"
            )
        storeys, note = storeys_from_rows(height_m, facades, config.storey_height_m)
        notes.append(note)
    building = Building(
        id=footprint.id,
        origin=origin,
        footprint_in_world=footprint.outline_in_world,
        base_z_m=base_z_m,
        height_m=height_m,
        storeys=storeys,
        facades=tuple(facades),
        missing=tuple(missing),
        year=footprint.year,
        use=footprint.use,
    )
    return building, tuple(notes)


def _weighted_median(values: Sequence[float], weights: Sequence[float]) -> float:
    order = np.argsort(values, kind="stable")
    share = np.cumsum(np.asarray(weights)[order]) / np.sum(weights)
    return float(np.asarray(values)[order][np.searchsorted(share, 0.5)])


def storeys_from_rows(
    height_m: float, facades: Sequence[Facade], storey_height_m: float
) -> tuple[int, str]:
    """Storeys from the rows of windows where they agree with the height to one, else from it."""
    by_height = max(1, round(height_m / storey_height_m))
    rows = max((_rows(facade) for facade in facades), default=0)
    if rows and abs(rows - by_height) <= 1:
        return rows, f"{rows} storeys from the rows of windows"
    return by_height, f"{by_height} storeys from the height at {storey_height_m:g} m each"


def _rows(facade: Facade) -> int:
    centres = sorted(window.y_m + window.height_m / 2 for window in facade.windows)
    if not centres:
        return 0
    return 1 + int(np.sum(np.diff(centres) > ROW_GAP_M))
