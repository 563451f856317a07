"""Blades of grass near the targets: they break the flat lawn and the edges of what stands in it."""

from __future__ import annotations

import numpy as np
import shapely
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.parts import Mesh, Parts
from benchmarks.estate.plan import Estate, FloatArray
from benchmarks.estate.site.foliage import leaf_material, palette_uv, season_of
from benchmarks.estate.site.layout import Layout
from shapely import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

REACH_M = 20.0
"""Lawn within this distance of a target has blades."""
BLADES_PER_M2 = 34
EDGE_BLADES_PER_M = 60
MOST_BLADES = 170_000


def grass_parts(estate: Estate, layout: Layout) -> Parts:
    """Blades as single triangles: short ones all over the lawn, longer ones at walls and beds."""
    targets = shapely.union_all([Polygon(building.outline) for building in estate.buildings])
    near = targets.buffer(REACH_M)
    paved = shapely.union_all(
        [layout.built, layout.road, layout.pavement, layout.paths, layout.apron]
    )
    lawn = near.difference(paved.buffer(0.04))
    edges = shapely.union_all(
        [
            layout.apron.boundary,
            *(
                LineString(hedge.line).buffer(hedge.width_m / 2 + 0.05).boundary
                for hedge in estate.hedges
            ),
            *(Point(tree.place).buffer(0.25).boundary for tree in estate.trees),
            *(Point(lamp.place).buffer(0.12).boundary for lamp in estate.lamps),
        ]
    ).intersection(near)
    rng = rng_of(estate.seed, "grass")
    short = _within(lawn, min(int(BLADES_PER_M2 * lawn.area), MOST_BLADES), rng)
    long = _along(edges, int(EDGE_BLADES_PER_M * edges.length), rng)
    long = long[~shapely.contains_xy(paved, *long.T)]
    places = np.concatenate([short, long])
    height = np.concatenate(
        [rng.gamma(6.0, 0.007, len(short)), rng.gamma(5.0, 0.018, len(long))]
    ).clip(0.015, 0.25)
    name, material = leaf_material("grass", season_of(estate.light.date))
    parts = Parts(materials={name: material})
    if len(places):
        parts.meshes.append(_blades(name, places, height, rng))
    return parts


def _within(area: BaseGeometry, count: int, rng: np.random.Generator) -> FloatArray:
    """About ``count`` points (N, 2) in an area, in loose clumps."""
    if area.is_empty or count == 0:
        return np.zeros((0, 2))
    x0, y0, x1, y1 = area.bounds
    clumps = int(count / 6 * (x1 - x0) * (y1 - y0) / area.area)
    middles = rng.uniform([x0, y0], [x1, y1], (clumps, 2))
    points = np.repeat(middles, 6, axis=0) + rng.normal(0, 0.035, (6 * clumps, 2))
    shapely.prepare(area)
    return points[shapely.contains_xy(area, *points.T)]


def _along(edges: BaseGeometry, count: int, rng: np.random.Generator) -> FloatArray:
    """About ``count`` points (N, 2) on and beside lines."""
    lines = [line for line in shapely.get_parts(edges) if line.length > 0]
    if not lines or count == 0:
        return np.zeros((0, 2))
    found = []
    for line in lines:
        number = rng.poisson(count * line.length / edges.length)
        places = shapely.line_interpolate_point(line, rng.uniform(0, line.length, number))
        found.append(shapely.get_coordinates(places) + rng.normal(0, 0.05, (number, 2)))
    return np.concatenate(found)


def _blades(
    material: str, places: FloatArray, height_m: FloatArray, rng: np.random.Generator
) -> Mesh:
    count = len(places)
    turn = rng.uniform(0, 2 * np.pi, count)
    across = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(count)])
    foot = np.column_stack([places, np.full(count, -0.005)])
    lean = np.column_stack([rng.normal(0, 0.5, (count, 2)), np.ones(count)]) * height_m[:, None]
    wide = (0.004 + 0.06 * height_m)[:, None] * across
    corners = np.stack([foot - wide, foot + wide, foot + lean], axis=1)
    return Mesh(
        material,
        corners.reshape(-1, 3).astype(np.float32),
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        palette_uv(count, 3, rng),
    )
