"""Leaves and needles as triangles, hedges, and the colours of foliage by season."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

import numpy as np
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.parts import Material, Mesh, Parts
from benchmarks.estate.plan import FloatArray, Hedge, Rgb

Season = Literal["spring", "summer", "autumn", "bare"]
PALETTE = 16
"""Colours of one kind of foliage; every leaf takes one."""
LEAVES_PER_M2 = 260
TWIGS_PER_M3 = 1500
LEAF_RGB: dict[str, dict[str, tuple[Rgb, Rgb]]] = {
    "round": {
        "spring": ((0.41, 0.48, 0.26), (0.52, 0.58, 0.34)),
        "summer": ((0.28, 0.35, 0.20), (0.44, 0.50, 0.30)),
        "autumn": ((0.57, 0.42, 0.21), (0.71, 0.59, 0.31)),
    },
    "birch": {
        "spring": ((0.46, 0.52, 0.29), (0.56, 0.61, 0.37)),
        "summer": ((0.33, 0.40, 0.23), (0.49, 0.54, 0.35)),
        "autumn": ((0.67, 0.55, 0.25), (0.77, 0.68, 0.36)),
    },
    "shrub": {
        "spring": ((0.40, 0.48, 0.27), (0.49, 0.55, 0.32)),
        "summer": ((0.33, 0.40, 0.23), (0.45, 0.50, 0.30)),
        "autumn": ((0.52, 0.30, 0.21), (0.60, 0.45, 0.25)),
    },
    "grass": {
        "spring": ((0.38, 0.44, 0.26), (0.47, 0.52, 0.33)),
        "summer": ((0.37, 0.42, 0.25), (0.48, 0.51, 0.33)),
        "autumn": ((0.34, 0.37, 0.22), (0.46, 0.45, 0.30)),
        "bare": ((0.37, 0.37, 0.25), (0.50, 0.47, 0.34)),
    },
    "needles": {"summer": ((0.21, 0.27, 0.18), (0.34, 0.40, 0.27))},
}


def season_of(date: str) -> Season:
    """What trees look like in Sweden on a day (ISO 8601)."""
    month, day = int(date[5:7]), int(date[8:10])
    if (month, day) < (5, 5) or month >= 11:
        return "bare"
    if (month, day) < (5, 28):
        return "spring"
    return "summer" if month < 10 else "autumn"


def leaf_material(kind: str, season: Season) -> tuple[str, Material]:
    """Name and material of a kind's leaves; its texture is a row of ``PALETTE`` colours."""
    seasons = LEAF_RGB[kind]
    name = season if season in seasons else "summer"
    dark, light = (np.array(rgb) for rgb in seasons[name])
    rng = rng_of(0, "leaves", kind, name)
    share = np.linspace(0, 1, PALETTE)[:, None]
    colours = dark * (1 - share) + light * share + rng.normal(0, 0.015, (PALETTE, 3))
    texture = np.repeat(np.clip(colours * 255, 0, 255).astype(np.uint8)[None], 4, axis=0)
    # Every colour is four texels wide: filters never mix two of them in the middle.
    return f"leaf-{kind}-{name}", Material("leaf", texture=np.repeat(texture, 4, axis=1))


def leaves(
    material: str,
    places: FloatArray,
    length_m: FloatArray,
    normals: FloatArray,
    rng: np.random.Generator,
    *,
    width: float = 0.7,
    droop: float = 0.35,
) -> Mesh:
    """Folded rhombs, two triangles each, at places (N, 3) that face about along normals (N, 3)."""
    count = len(places)
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    along = rng.normal(0, 1, (count, 3)) - [0, 0, droop]
    along -= np.sum(along * normals, axis=1, keepdims=True) * normals
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    side = np.cross(normals, along) * (width / 2 * length_m[:, None])
    along = along * length_m[:, None]
    fold = normals * (0.12 * length_m[:, None]) * rng.uniform(-0.3, 1.0, (count, 1))
    corners = np.stack(
        [
            places,
            places + 0.45 * along + side + fold,
            places + along,
            places + 0.45 * along - side + fold,
        ],
        axis=1,
    )
    starts = 4 * np.arange(count)[:, None, None]
    faces = (starts + np.array([[0, 2, 1], [0, 3, 2]])).reshape(-1, 3)
    return Mesh(
        material,
        corners.reshape(-1, 3).astype(np.float32),
        faces.astype(np.int32),
        palette_uv(count, 4, rng),
    )


def needles(
    material: str,
    places: FloatArray,
    directions: FloatArray,
    rng: np.random.Generator,
    each: int = 9,
    size: float = 1.0,
) -> Mesh:
    """Tufts of long thin triangles around directions (N, 3) at places (N, 3)."""
    count = len(places) * each
    base = np.repeat(places, each, axis=0) + rng.normal(0, 0.03, (count, 3))
    ahead = np.repeat(directions, each, axis=0) + rng.normal(0, 0.75, (count, 3)) + [0, 0, 0.25]
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    side = np.cross(ahead, rng.normal(0, 1, (count, 3)))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    length = rng.uniform(0.12, 0.24, (count, 1)) * size
    thick = 0.022 * size
    corners = np.stack([base - side * thick, base + side * thick, base + ahead * length], axis=1)
    return Mesh(
        material,
        corners.reshape(-1, 3).astype(np.float32),
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        palette_uv(count, 3, rng),
    )


def palette_uv(count: int, corners: int, rng: np.random.Generator) -> FloatArray:
    """Texture coordinates that give each of ``count`` leaves one colour for all its corners."""
    colour = np.clip(rng.normal(PALETTE / 2, PALETTE / 5, count), 0, PALETTE - 1).astype(int)
    uv = np.stack([(colour + 0.5) / PALETTE, np.full(count, 0.5)], axis=1)
    return np.repeat(uv, corners, axis=0).astype(np.float32)


def hedge_parts(hedges: Sequence[Hedge], season: Season, seed: int) -> Parts:
    """Clipped hedges: a dark core within a skin of small leaves, or twigs alone where bare."""
    parts = Parts()
    if not hedges:
        return parts
    parts.materials["hedge-core"] = Material("diffuse", (0.21, 0.25, 0.15))
    if season == "bare":
        name, material = "hedge-twigs", Material("diffuse", (0.30, 0.24, 0.18))
    else:
        name, material = leaf_material("shrub", season)
    parts.materials[name] = material
    for number, hedge in enumerate(hedges):
        rng = rng_of(seed, "hedge leaves", number)
        points = np.array(hedge.line, np.float64)
        for start, end in pairwise(points):
            parts.meshes += _hedge_piece(name, start, end, hedge, season, rng)
    return parts


def _hedge_piece(
    material: str,
    start: FloatArray,
    end: FloatArray,
    hedge: Hedge,
    season: Season,
    rng: np.random.Generator,
) -> list[Mesh]:
    length = float(np.linalg.norm(end - start))
    along = np.append((end - start) / length, 0.0)
    side, up = np.array([-along[1], along[0], 0.0]), np.array([0, 0, 1.0])
    size = np.array([length, hedge.width_m, hedge.height_m])
    origin = np.append(start, 0.0) - side * hedge.width_m / 2
    frame = np.stack([along, side, up])
    if season == "bare":
        return [_twigs(material, origin, frame, size, rng)]
    meshes = [_box("hedge-core", origin, frame, size, inset=0.09)]
    for axis, upper in ((1, 0), (1, 1), (2, 1), (0, 0), (0, 1)):  # the faces but the foot
        others = [k for k in range(3) if k != axis]
        count = int(LEAVES_PER_M2 * size[others[0]] * size[others[1]])
        local = rng.uniform(0, 1, (count, 3)) * size
        wave = 0.03 * np.sin(local[:, others[0]] * 2.1 + axis) + rng.normal(0, 0.022, count)
        depth = np.abs(rng.normal(0, 0.045, count))
        local[:, axis] = size[axis] + wave - depth if upper else -wave + depth
        normal = np.zeros(3)
        normal[axis] = 1.0 if upper else -1.0
        facing = (normal @ frame) * 0.7 + rng.normal(0, 0.55, (count, 3)) + [0, 0, 0.3]
        length_m = rng.uniform(0.06, 0.095, count)
        meshes.append(leaves(material, origin + local @ frame, length_m, facing, rng, width=0.75))
    return meshes


def _twigs(
    material: str,
    origin: FloatArray,
    frame: FloatArray,
    size: FloatArray,
    rng: np.random.Generator,
) -> Mesh:
    """Twigs that fill the hedge, upright with a lean, ends clipped to its shape."""
    count = int(TWIGS_PER_M3 * np.prod(size))
    foot = rng.uniform(0, 1, (count, 3)) * size
    foot[:, 2] *= 0.8
    ahead = np.column_stack([rng.normal(0, 0.35, (count, 2)), np.ones(count)])
    tip = foot + ahead * rng.uniform(0.15, 0.5, (count, 1))
    tip = np.clip(tip, 0, size + rng.normal(0, 0.03, (count, 3)))
    side = np.cross(ahead, rng.normal(0, 1, (count, 3)))
    side *= 0.006 / np.linalg.norm(side, axis=1, keepdims=True)
    corners = np.stack([foot - side, foot + side, tip], axis=1)
    return Mesh(
        material,
        (origin + corners.reshape(-1, 3) @ frame).astype(np.float32),
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
    )


def _box(
    material: str, origin: FloatArray, frame: FloatArray, size: FloatArray, inset: float
) -> Mesh:
    bits = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)], np.float64)
    low, high = np.array([inset, inset, 0.0]), size - inset
    vertices = origin + (low + bits * (high - low)) @ frame
    quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (4, 5, 7, 6)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return Mesh(material, vertices.astype(np.float32), np.array(faces, np.int32))
