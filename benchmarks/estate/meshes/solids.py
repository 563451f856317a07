"""Meshes of plain shapes: plates, boxes, prisms, pipes, balls, folded sheets.

Shapes are made in any right-handed frame, mostly a wall's: x right, y up, z out of the wall.
Without other instruction ``uv`` is in metres over `TILE_M`, so a texture keeps its scale.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from benchmarks.estate.painting.textures import TILE_M
from benchmarks.estate.parts import Mesh
from numpy.typing import ArrayLike, NDArray
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from si3fp.geometry.rigid import Rigid3

FloatArray = NDArray[np.float64]
GRID_M = 1e-5
# A box's corners by (x, y, z) bit, and its faces counter-clockwise from outside.
_CORNERS = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)], bool)
_SIDES = {
    "left": (0, 4, 6, 2),
    "right": (1, 3, 7, 5),
    "bottom": (0, 1, 5, 4),
    "top": (2, 6, 7, 3),
    "back": (0, 2, 3, 1),
    "front": (4, 5, 7, 6),
}
_FLAT_AXES = {"left": (2, 1), "right": (2, 1), "bottom": (0, 2), "top": (0, 2)}


def _quads(material: str, corners: FloatArray, uv: FloatArray) -> Mesh:
    """A mesh of N quads from corners (N, 4, 3) and uv (N, 4, 2)."""
    starts = 4 * np.arange(len(corners))[:, None, None]
    faces = starts + np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(
        material,
        corners.reshape(-1, 3).astype(np.float32),
        faces.reshape(-1, 3).astype(np.int32),
        uv.reshape(-1, 2).astype(np.float32),
    )


def quad(material: str, corners: ArrayLike, uv: ArrayLike | None = None) -> Mesh:
    """A plate with four corners (4, 3), counter-clockwise from outside."""
    points = np.asarray(corners, np.float64)
    if uv is None:
        along, up = points[1] - points[0], points[3] - points[0]
        a, b = np.linalg.norm(along), np.linalg.norm(up)
        uv = np.array([[0, 0], [a, 0], [a, b], [0, b]]) / TILE_M
    return _quads(material, points[None], np.asarray(uv, np.float64)[None])


def boxes(material: str, lows: ArrayLike, highs: ArrayLike, *, without: str = "") -> Mesh:
    """Boxes between lower and upper corners (N, 3); ``without`` names sides to leave away."""
    bounds = np.stack([np.atleast_2d(lows), np.atleast_2d(highs)], axis=1).astype(np.float64)
    corners, uv = [], []
    for side, order in _SIDES.items():
        if side in without.split():
            continue
        chosen = _CORNERS[list(order)].astype(int)
        points = np.stack([bounds[:, chosen[:, axis], axis] for axis in range(3)], axis=-1)
        corners.append(points)
        uv.append(points[:, :, list(_FLAT_AXES.get(side, (0, 1)))] / TILE_M)
    return _quads(material, np.concatenate(corners), np.concatenate(uv))


def box(material: str, low: ArrayLike, high: ArrayLike, *, without: str = "") -> Mesh:
    """The box between a lower and an upper corner (3,)."""
    return boxes(material, np.asarray(low)[None], np.asarray(high)[None], without=without)


def triangles_of(shape: Polygon) -> FloatArray:
    """Triangles (T, 3, 2) that fill a polygon with holes, counter-clockwise."""
    try:
        triangulated = shapely.constrained_delaunay_triangles(shape)
    except shapely.errors.GEOSException:  # corners a rounding error apart from being in line
        triangulated = shapely.constrained_delaunay_triangles(shapely.set_precision(shape, GRID_M))
    coordinates = shapely.get_coordinates(triangulated)
    triangles: FloatArray = coordinates.reshape(-1, 4, 2)[:, :3]
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    turn = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    triangles = triangles[np.abs(turn) > 1e-10]
    turn = turn[np.abs(turn) > 1e-10]
    triangles[turn < 0] = triangles[turn < 0, ::-1]
    return triangles


def plane(
    material: str, shape: Polygon, z: float, *, uv_box: ArrayLike | None = None, down: bool = False
) -> Mesh:
    """A plate of any outline at height z, seen from +z (from -z with ``down``).

    ``uv_box`` (x0, y0, x1, y1) is where a texture's 0 and 1 lie.
    """
    points = triangles_of(shape)
    if down:
        points = points[:, ::-1]
    flat = points.reshape(-1, 2)
    if uv_box is None:
        uv = flat / TILE_M
    else:
        bounds = np.asarray(uv_box, np.float64)
        uv = (flat - bounds[:2]) / (bounds[2:] - bounds[:2])
    vertices = np.column_stack([flat, np.full(len(flat), z)])
    return Mesh(
        material,
        vertices.astype(np.float32),
        np.arange(len(flat), dtype=np.int32).reshape(-1, 3),
        uv.astype(np.float32),
    )


def band(material: str, shape: Polygon, back: float, front: float, *, inward: bool = False) -> Mesh:
    """The sides of a prism: what stands between an outline at z = back and at z = front.

    They face out of the shape (its holes too), or into it with ``inward``.
    """
    solid = orient(shape)
    lines = [np.asarray(ring.coords)[:, :2] for ring in (solid.exterior, *solid.interiors)]
    a, b = (np.concatenate([line[cut] for line in lines]) for cut in (slice(-1), slice(1, None)))
    corners, uv = np.empty((len(a), 4, 3)), np.empty((len(a), 4, 2))
    corners[:, (0, 3), :2], corners[:, (1, 2), :2] = a[:, None], b[:, None]
    corners[:, :2, 2], corners[:, 2:, 2] = back, front
    length = np.hypot(*(b - a).T)
    end = np.cumsum(length)
    uv[:, (0, 3), 0], uv[:, (1, 2), 0] = (end - length)[:, None], end[:, None]
    uv[:, :, 1] = corners[:, :, 2]
    if inward:
        corners, uv = corners[:, ::-1], uv[:, ::-1]
    return _quads(material, corners, uv / TILE_M)


def prism(
    material: str, shape: Any, back: float, front: float, *, with_back: bool = False
) -> list[Mesh]:
    """A plate of any outline (polygon or several) with thickness; its back only if asked for."""
    found = []
    for polygon in getattr(shape, "geoms", [shape]):
        if polygon.is_empty:
            continue
        found += [plane(material, polygon, front), band(material, polygon, back, front)]
        if with_back:
            found.append(plane(material, polygon, back, down=True))
    return found


def _across(direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors that make a right-handed frame with a unit direction as the third."""
    helper = np.eye(3)[np.argmin(np.abs(direction))]
    first = np.cross(helper, direction)
    first /= np.linalg.norm(first)
    return first, np.cross(direction, first)


def cylinder(
    material: str,
    start: ArrayLike,
    end: ArrayLike,
    radius_m: float,
    *,
    end_radius_m: float | None = None,
    sides: int = 10,
    caps: bool = True,
) -> Mesh:
    """A round bar between two points (3,), or a cone's part; with smooth normals."""
    low, high = np.asarray(start, np.float64), np.asarray(end, np.float64)
    direction = (high - low) / np.linalg.norm(high - low)
    first, second = _across(direction)
    angles = 2 * np.pi * np.arange(sides) / sides
    round_ = np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * second
    top_radius = radius_m if end_radius_m is None else end_radius_m
    rings = [low + radius_m * round_, high + top_radius * round_]
    index = np.arange(sides)
    after = (index + 1) % sides
    faces = [np.column_stack([index, after, after + sides])]
    faces.append(np.column_stack([index, after + sides, index + sides]))
    vertices, normals = [*rings], [round_, round_]
    around = radius_m * angles
    uv = [np.column_stack([around, np.full(sides, z)]) for z in (0.0, np.linalg.norm(high - low))]
    if caps:
        for ring, sign in ((rings[0], -1.0), (rings[1], 1.0)):
            begin = sum(len(v) for v in vertices)
            vertices.append(ring)
            uv.append(np.zeros((sides, 2)))
            normals.append(np.tile(sign * direction, (sides, 1)))
            fan = begin + np.column_stack([np.zeros(sides - 2, int), index[1:-1], index[1:-1] + 1])
            faces.append(fan if sign > 0 else fan[:, ::-1])
    return Mesh(
        material,
        np.concatenate(vertices).astype(np.float32),
        np.concatenate(faces).astype(np.int32),
        (np.concatenate(uv) / TILE_M).astype(np.float32),
        np.concatenate(normals).astype(np.float32),
    )


def ball(material: str, centre: ArrayLike, radii: ArrayLike, *, rings: int = 4) -> Mesh:
    """An ellipsoid with smooth normals."""
    sides = 2 * rings
    polar = np.pi * np.arange(rings + 1) / rings
    turn = 2 * np.pi * np.arange(sides + 1) / sides
    unit = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(turn)[None],
            np.repeat(np.cos(polar)[:, None], sides + 1, axis=1),
            -np.sin(polar)[:, None] * np.sin(turn)[None],
        ],
        axis=-1,
    )
    size = np.broadcast_to(np.asarray(radii, np.float64), 3)
    mesh = sheet(material, np.asarray(centre) + unit * size)
    normals = (unit / size).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(material, mesh.vertices, mesh.faces[:, ::-1], None, normals.astype(np.float32))


def leaves(
    material: str,
    centre: ArrayLike,
    radii: ArrayLike,
    count: int,
    size_m: float,
    rng: np.random.Generator,
) -> Mesh:
    """Leaves of four corners each, in any position, in an ellipsoid."""
    place = rng.uniform(-1, 1, (count, 3))
    place *= np.cbrt(rng.uniform(0.3, 1, (count, 1))) / np.linalg.norm(place, axis=1, keepdims=True)
    middle = np.asarray(centre) + place * np.asarray(radii)
    along = place + rng.normal(0, 0.7, (count, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, rng.normal(0, 1, (count, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    size = size_m * rng.uniform(0.7, 1.3, (count, 1))
    tip, side = 0.5 * size * along, 0.28 * size * across
    corners = np.stack([middle - tip, middle + side, middle + tip, middle - side], axis=1)
    return _quads(material, corners, np.zeros((count, 4, 2)))


def sheet(material: str, points: FloatArray, *, smooth: bool = False) -> Mesh:
    """A curved sheet through a grid of points (R, C, 3).

    It is seen from the side where rows go up when columns go right.
    """
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b = index[:-1, :-1].ravel(), index[:-1, 1:].ravel()
    c, d = index[1:, 1:].ravel(), index[1:, :-1].ravel()
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    normals = None
    if smooth:
        across = np.gradient(points, axis=1)
        upward = np.gradient(points, axis=0)
        normals = np.cross(across, upward).reshape(-1, 3)
        normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)
    steps = [np.linalg.norm(np.diff(points[0], axis=0), axis=1)]
    steps.append(np.linalg.norm(np.diff(points[:, 0], axis=0), axis=1))
    u, v = (np.concatenate([[0.0], np.cumsum(step)]) / TILE_M for step in steps)
    uv = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2).astype(np.float32)
    vertices = points.reshape(-1, 3).astype(np.float32)
    return Mesh(material, vertices, faces.astype(np.int32), uv, normals)


def placed(mesh: Mesh, to_from_mesh: Rigid3) -> Mesh:
    """The mesh in another frame."""
    return Mesh(
        mesh.material,
        to_from_mesh.apply(mesh.vertices).astype(np.float32),
        mesh.faces,
        mesh.uv,
        None if mesh.normals is None else to_from_mesh.rotate(mesh.normals).astype(np.float32),
    )


def moved(mesh: Mesh, by: ArrayLike) -> Mesh:
    """The mesh shifted by (3,)."""
    return replace(mesh, vertices=mesh.vertices + np.asarray(by, np.float32))
