"""What stands on roofs: stair heads, fans, vents and chimneys.

In the world: x east, y north, z up.
"""

from __future__ import annotations

import numpy as np
from benchmarks.estate.meshes.roof_meshes import UPSTAND_M, Slope, slopes_of
from benchmarks.estate.meshes.solids import cylinder, prism
from benchmarks.estate.painting.house_materials import fixed, matt, paint
from benchmarks.estate.parts import Mesh, Parts
from benchmarks.estate.plan import Building
from shapely import Point, Polygon, affinity
from shapely.geometry import box as rectangle

_CLEAR_M = 1.2


def roof_things(building: Building, rng: np.random.Generator) -> Parts:
    """Boxes and pipes on the roof, turned like the building's longest wall."""
    parts = Parts()
    plan = Polygon(building.outline)
    longest = max(building.walls, key=lambda wall: wall.width_m)
    along = longest.world_from_facade.rotation[:2, 0]
    turn = float(np.degrees(np.arctan2(along[1], along[0])))
    slopes = slopes_of(building)
    if slopes:
        for _ in range(1 + int(plan.area / 250)):
            parts.meshes += _chimney(parts, building, slopes, turn, rng)
        return parts
    deck = building.height_m + max(building.roof.rise_m, 0.05) - UPSTAND_M
    free = plan.buffer(-_CLEAR_M)
    if free.is_empty:
        return parts
    render, steel = matt(parts, (0.55, 0.54, 0.52)), fixed(parts, "zinc")
    dark = paint(parts, (0.20, 0.21, 0.22))
    if building.storeys >= 5:
        for _ in range(1 + int(plan.area / 350)):
            free = _stand(parts, render, free, (4.2, 3.2, 2.3), deck, turn, rng, cap=dark)
    for _ in range(1 + int(plan.area / 180)):
        size = (rng.uniform(0.6, 1.4), rng.uniform(0.6, 1.1), rng.uniform(0.5, 1.1))
        free = _stand(parts, steel, free, size, deck, turn, rng, cap=steel)
    for _ in range(2 + int(plan.area / 120)):
        x, y = _place(free, rng)
        if free.contains(Point(x, y)):
            top = deck + rng.uniform(0.4, 0.9)
            parts.meshes.append(cylinder(dark, (x, y, deck), (x, y, top), 0.08, sides=8))
            parts.meshes.append(cylinder(dark, (x, y, top), (x, y, top + 0.1), 0.14, sides=8))
    return parts


def _place(free: Polygon, rng: np.random.Generator) -> tuple[float, float]:
    x0, y0, x1, y1 = free.bounds
    for _ in range(20):
        x, y = rng.uniform(x0, x1), rng.uniform(y0, y1)
        if free.contains(Point(x, y)):
            return x, y
    return x0 - 9.0, y0 - 9.0


def _stand(
    parts: Parts,
    material: str,
    free: Polygon,
    size: tuple[float, float, float],
    deck: float,
    turn_deg: float,
    rng: np.random.Generator,
    *,
    cap: str,
) -> Polygon:
    """Adds a box with a cap on free roof; returns what is left free."""
    x, y = _place(free, rng)
    shape = rectangle(x - size[0] / 2, y - size[1] / 2, x + size[0] / 2, y + size[1] / 2)
    shape = affinity.rotate(shape, turn_deg)
    if not free.contains(shape):
        return free
    top = deck + size[2]
    parts.meshes += prism(material, shape, deck, top)
    parts.meshes += prism(
        cap, shape.buffer(0.05, join_style="mitre"), top, top + 0.06, with_back=True
    )
    return free.difference(shape.buffer(0.4))


def _chimney(
    parts: Parts, building: Building, slopes: list[Slope], turn_deg: float, rng: np.random.Generator
) -> list[Mesh]:
    """A chimney in sheet metal, on one slope near the ridge."""
    slope = slopes[int(rng.integers(len(slopes)))]
    free = slope.plan.buffer(-1.2)
    if free.is_empty:
        return []
    places = [_place(free, rng) for _ in range(4)]
    x, y = max(places, key=lambda place: float(slope.z(np.array([place]))[0]))
    if not free.contains(Point(x, y)):
        return []
    dark = paint(parts, (0.16, 0.16, 0.17))
    width, depth = rng.uniform(0.7, 1.3), rng.uniform(0.5, 0.7)
    shape = affinity.rotate(
        rectangle(x - width / 2, y - depth / 2, x + width / 2, y + depth / 2), turn_deg
    )
    top = building.height_m + building.roof.rise_m + rng.uniform(0.6, 1.0)
    foot = float(slope.z(np.array([[x, y]]))[0]) - 0.5
    cap = shape.buffer(0.06, join_style="mitre")
    return prism(dark, shape, foot, top) + prism(dark, cap, top, top + 0.07, with_back=True)
