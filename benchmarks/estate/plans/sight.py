"""Which walls a vehicle sees from its lines, in plan: what is in sight stays so at any height."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from benchmarks.estate.plan import Building, FloatArray
from shapely import LineString, Polygon

STEP_M = 2.0
PLACES = 8


def seen_shares(
    buildings: Sequence[Building],
    lines: Sequence[Sequence[tuple[float, float]]],
    *,
    least_deg: float = 15.0,
    most_m: float = 60.0,
) -> dict[str, float]:
    """Share of each wall's length, by the wall's id, that is in sight from somewhere on the lines.

    A place of a wall is in sight where the line to it meets the wall at ``least_deg`` or more, is
    ``most_m`` long at most and crosses none of the buildings.
    """
    stands = np.concatenate([_stands(line) for line in lines])
    built = shapely.union_all([Polygon(building.outline).buffer(-0.01) for building in buildings])
    shapely.prepare(built)
    shares = {}
    for building in buildings:
        for wall in building.walls:
            start, end = np.array(wall.start), np.array(wall.end)
            outward = wall.world_from_facade.rotation[:2, 2]
            places = start + (np.arange(PLACES)[:, None] + 0.5) / PLACES * (end - start)
            places = places + 0.02 * outward
            rays = stands[None] - places[:, None]
            lengths = np.linalg.norm(rays, axis=2)
            facing = rays @ outward / lengths >= np.sin(np.deg2rad(least_deg))
            near = facing & (lengths <= most_m)
            index, stand = np.nonzero(near)
            sights = shapely.linestrings(np.stack([places[index], stands[stand]], axis=1))
            free = ~shapely.intersects(built, sights)
            shares[wall.id] = len(np.unique(index[free])) / PLACES
    return shares


def _stands(line: Sequence[tuple[float, float]]) -> FloatArray:
    path = LineString(line)
    count = max(2, round(path.length / STEP_M) + 1)
    return shapely.get_coordinates(path.interpolate(np.linspace(0, path.length, count)))
