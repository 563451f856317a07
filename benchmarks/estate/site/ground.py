"""The ground as meshes: lawns, streets with kerbs, paths, and land that closes the horizon."""

from __future__ import annotations

import cv2
import numpy as np
import shapely
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.meshes.solids import plane, prism
from benchmarks.estate.painting.ground_painting import paint_ground
from benchmarks.estate.parts import Material, Mesh, Parts
from benchmarks.estate.plan import Estate, FloatArray
from benchmarks.estate.site.foliage import season_of
from benchmarks.estate.site.layout import KERB_M, Layout, layout_of
from benchmarks.estate.site.neighbours import main_bearing_deg
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from shapely import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

ROAD_Z_M = -0.10
"""The road lies a kerb's height below lawns, pavements and the walls' feet, which are at 0."""
NEAR_M = 45.0
FAR_M = 150.0
NEAR_TEXEL_M = 0.025
FAR_TEXEL_M = 0.15
LARGEST_PX = 6400
GRASS, ASPHALT, PAVING, GRAVEL, MARKING, SOIL, SETTS, PARKING = range(8)

Bounds = tuple[float, float, float, float]


def ground_parts(estate: Estate) -> Parts:
    """Meshes of everything that lies on the ground; targets and neighbours stand in holes."""
    layout = layout_of((*estate.buildings, *estate.neighbours), estate.streets)
    targets = shapely.union_all([Polygon(building.outline) for building in estate.buildings])
    near = shapely.box(*targets.buffer(NEAR_M).bounds)
    far = shapely.box(*targets.buffer(FAR_M).bounds)
    parts = Parts()
    for name, area, finest_m in (
        ("ground-near", near, NEAR_TEXEL_M),
        ("ground-far", far.difference(near), FAR_TEXEL_M),
    ):
        bounds = area.bounds
        size = max(bounds[2] - bounds[0], bounds[3] - bounds[1])
        texel_m = max(finest_m, size / LARGEST_PX)
        labels = label_image(estate, layout, bounds, texel_m)
        rng = rng_of(estate.seed, name)
        bearing = main_bearing_deg(estate.buildings, estate.streets)
        parts.materials[name] = Material(texture=paint_ground(labels, texel_m, bearing, rng))
        height, width = labels.shape
        uv_box = (bounds[0], bounds[3] - height * texel_m, bounds[0] + width * texel_m, bounds[3])
        level = area.difference(shapely.union_all([layout.road, layout.built.buffer(-0.3)]))
        parts.meshes += [plane(name, piece, 0.0, uv_box=uv_box) for piece in _pieces(level)]
        road = layout.road.intersection(area)
        parts.meshes += [plane(name, piece, ROAD_Z_M, uv_box=uv_box) for piece in _pieces(road)]
    kerbs = layout.road.buffer(KERB_M, join_style="round").difference(layout.road)
    for piece in _pieces(kerbs.difference(layout.built)):
        parts.meshes += prism("kerb", piece, ROAD_Z_M - 0.02, 0.006)
    parts.materials["kerb"] = Material(texture=_granite())
    parts.add(_horizon(estate, far))
    return parts


def label_image(
    estate: Estate, layout: Layout, bounds: Bounds, m_per_texel: float
) -> NDArray[np.uint8]:
    """Kinds of ground (H, W), row 0 in the north; lawn where nothing else is."""
    x0, y0, x1, y1 = bounds
    shape = (int(np.ceil((y1 - y0) / m_per_texel)), int(np.ceil((x1 - x0) / m_per_texel)))
    labels = np.full(shape, GRASS, np.uint8)
    kerb = [LineString(street.line) for street in estate.streets]
    edge = layout.road.difference(
        shapely.union_all(
            [
                line.buffer(street.road_m / 2 - 2.0, cap_style="flat")
                for line, street in zip(kerb, estate.streets, strict=True)
            ]
        )
    )
    beds = [LineString(hedge.line).buffer(hedge.width_m / 2 + 0.25) for hedge in estate.hedges]
    beds += [
        Point(tree.place).buffer(tree.crown_m * 0.36 if tree.kind == "shrub" else 0.28)
        for tree in estate.trees
    ]
    for kind, area in (
        (SOIL, shapely.union_all(beds)),
        (GRAVEL, layout.apron),
        (PAVING, shapely.union_all([layout.pavement, layout.paths])),
        (ASPHALT, layout.road),
        (PARKING, edge),
    ):
        for piece in _pieces(area):
            rings = [
                np.round((np.array(ring.coords) - [x0, y1]) * [1, -1] / m_per_texel * 16 - 8)
                for ring in (piece.exterior, *piece.interiors)
            ]
            cv2.fillPoly(labels, [ring.astype(np.int32) for ring in rings], int(kind), shift=4)
    return labels


def _granite() -> NDArray[np.uint8]:
    """Two metres square, joints every metre."""
    rng = rng_of(0, "granite")
    grey = (
        132
        + 14 * rng.normal(0, 1, (256, 256))
        + 60 * gaussian_filter(rng.normal(0, 1, (256, 256)), 6, mode="wrap")
    )
    grey[::128] = grey[:, ::128] = 70
    return np.clip(grey[..., None] * [1.0, 0.985, 0.96], 0, 255).astype(np.uint8)


def _horizon(estate: Estate, far: BaseGeometry) -> Parts:
    """Land from beyond the estate to hills 0.3-1 km away."""
    rng = rng_of(estate.seed, "horizon")
    x0, y0, x1, y1 = far.bounds
    centre = np.array([(x0 + x1) / 2, (y0 + y1) / 2])
    radii = np.array([0.0, 140, 180, 230, 300, 400, 520, 700, 1000])
    turn = np.linspace(0, 2 * np.pi, 97)
    waves = sum(np.cos(k * turn + rng.uniform(0, 2 * np.pi)) / k for k in (2, 3, 5, 8, 13))
    hills = np.interp(radii, [0, 180, 1000], [0, 0, 1]) ** 1.3
    height = hills[:, None] * (14 + 9 * waves[None])
    height[:3] = -0.4
    points = np.stack(
        [
            centre[0] + radii[:, None] * np.cos(turn),
            centre[1] + radii[:, None] * np.sin(turn),
            height,
        ],
        axis=-1,
    )
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )
    parts = Parts(
        [Mesh("far-land", points.reshape(-1, 3).astype(np.float32), faces.astype(np.int32))]
    )
    bare = season_of(estate.light.date) == "bare"
    parts.materials["far-land"] = Material(rgb=(0.30, 0.33, 0.22))
    for number, (radius, low, high) in enumerate(((285.0, 7, 15), (370.0, 14, 24))):
        name = f"far-wood-{number}"
        green = np.array([0.20, 0.20, 0.15]) if bare else np.array([0.17, 0.23, 0.13])
        haze = 0.25 * (number + 1) * (np.array([0.50, 0.56, 0.60]) - green)
        parts.materials[name] = Material(rgb=tuple(float(v) for v in green + haze))  # type: ignore[arg-type]
        parts.meshes.append(_wood_edge(name, centre, radius, (low, high), rng))
    return parts


def _wood_edge(
    material: str,
    centre: FloatArray,
    radius_m: float,
    height_m: tuple[float, float],
    rng: np.random.Generator,
) -> Mesh:
    """A closed wall of treetops, seen from within: what is left of a wood at that distance."""
    columns = 2600
    turn = np.linspace(0, 2 * np.pi, columns, endpoint=False)
    tops = gaussian_filter(rng.uniform(0, 1, columns), 40, mode="wrap")
    tops = (tops - tops.min()) / np.ptp(tops) * 0.6
    crowns = gaussian_filter(rng.uniform(0, 1, columns), 3, mode="wrap")
    tops += (crowns - crowns.min()) / np.ptp(crowns) * 0.3 + 0.1 * rng.uniform(0, 1, columns)
    height = height_m[0] + (height_m[1] - height_m[0]) * tops
    away = radius_m + rng.uniform(-4, 4, columns)
    foot = np.column_stack(
        [centre[0] + away * np.cos(turn), centre[1] + away * np.sin(turn), np.full(columns, -1.0)]
    )
    top = np.column_stack([foot[:, :2], height])
    index = np.arange(columns)
    after = (index + 1) % columns
    faces = np.concatenate(
        [
            np.column_stack([after, index, index + columns]),
            np.column_stack([after, index + columns, after + columns]),
        ]
    )
    return Mesh(material, np.concatenate([foot, top]).astype(np.float32), faces.astype(np.int32))


def _pieces(area: BaseGeometry) -> list[Polygon]:
    """The polygons of an area that are worth a mesh."""
    return [
        piece
        for piece in shapely.get_parts(area)
        if piece.geom_type == "Polygon" and piece.area > 1e-3
    ]
