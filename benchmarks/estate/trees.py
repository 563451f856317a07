"""Trees: a few of every kind grown branch by branch, then set up turned and scaled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from benchmarks.estate.bark import bark_materials
from benchmarks.estate.foliage import Season, leaf_material, leaves, needles
from benchmarks.estate.parts import Mesh, Parts, joined
from benchmarks.estate.plan import FloatArray, Tree, rng_of

PROTOTYPES = 3
"""Different trees of every kind; turning and scaling does the rest."""
GOLDEN_DEG = 137.508


@dataclass(frozen=True)
class Habit:
    """How a kind grows; lengths are shares of its height, angles are from the parent's direction.

    ``clear`` is where branches begin, ``spread`` half the crown's width, ``limbs`` the number of
    branches from the trunk, ``low_deg`` and ``high_deg`` their angles from the vertical at the
    crown's foot and top, ``hang`` how much outer twigs turn down.
    """

    height_m: float
    clear: float
    spread: float
    limbs: int
    low_deg: float
    high_deg: float
    hang: float
    trunk: float
    leaf_m: float
    leaves: int
    bark: str
    top: float = 0.5


HABITS = {
    "round": Habit(10.0, 0.22, 0.32, 24, 68, 22, 0.1, 0.016, 0.125, 8, "bark"),
    "birch": Habit(12.0, 0.20, 0.22, 26, 50, 24, 0.75, 0.0105, 0.085, 11, "birch-bark", 0.35),
    "pine": Habit(12.0, 0.45, 0.22, 18, 85, 42, -0.15, 0.013, 0.0, 0, "pine-bark", 0.6),
    "shrub": Habit(1.6, 0.0, 0.5, 14, 60, 15, 0.0, 0.008, 0.07, 9, "bark"),
}


def tree_parts(trees: Sequence[Tree], season: Season, seed: int, *, coarse: bool = False) -> Parts:
    """The meshes of trees; ``coarse`` has a quarter of the triangles, for far ones."""
    parts = Parts(materials=bark_materials())
    grown: dict[tuple[str, int], list[Mesh]] = {}
    placed: list[Mesh] = []
    for number, tree in enumerate(trees):
        rng = rng_of(seed, "tree", *tree.place)
        key = (tree.kind, int(rng.integers(PROTOTYPES)))
        if key not in grown:
            meshes, materials = _prototype(*key, season, coarse)
            grown[key] = meshes
            parts.materials.update(materials)
        del number
        habit = HABITS[tree.kind]
        wide = tree.crown_m / (2 * habit.spread * habit.height_m)
        tall = tree.height_m / habit.height_m
        turn = rng.uniform(0, 2 * np.pi)
        lean = rng.normal(0, 0.015, 2)
        placed += [_set_up(mesh, tree, wide, tall, turn, lean) for mesh in grown[key]]
    parts.meshes = joined(placed)
    return parts


def _set_up(
    mesh: Mesh, tree: Tree, wide: float, tall: float, turn: float, lean: FloatArray
) -> Mesh:
    cosine, sine = np.cos(turn), np.sin(turn)
    x, y, z = mesh.vertices.astype(np.float64).T
    height = z * tall
    moved = np.stack(
        [
            (cosine * x - sine * y) * wide + tree.place[0] + lean[0] * height,
            (sine * x + cosine * y) * wide + tree.place[1] + lean[1] * height,
            height,
        ],
        axis=1,
    )
    normals = mesh.normals
    if normals is not None:
        a, b, c = normals.T
        normals = np.stack([cosine * a - sine * b, sine * a + cosine * b, c], 1)
    return Mesh(mesh.material, moved.astype(np.float32), mesh.faces, mesh.uv, normals)


def _prototype(
    kind: str, number: int, season: Season, coarse: bool
) -> tuple[list[Mesh], dict[str, object]]:
    """One tree with its foot at the origin, in its habit's own size."""
    habit = HABITS[kind]
    rng = rng_of(number, "prototype", kind)
    trunk, limbs = _trunk(habit, rng)
    boughs = _children(limbs, 5 if coarse else 7, 0.25, (30, 60), 0.5, habit.hang * 0.4, rng)
    bare = season == "bare" and kind != "pine"
    twigs = _children(boughs, 3 if coarse else 6, 0.15, (25, 60), 0.5, habit.hang, rng)
    meshes = [] if kind == "shrub" else [tubes(habit.bark, *trunk, 12)]
    dark = habit.bark if habit.bark != "birch-bark" else "birch-twig"
    meshes.append(tubes(dark, *limbs, 5 if coarse else 6))
    meshes.append(tubes(dark, *boughs, 3 if coarse else 4))
    meshes.append(tubes(dark, *_thinned(twigs, 2 if not bare else 3), 3))
    if bare:
        if not coarse:
            fine = _children(twigs, 4, 0.2, (20, 55), 0.55, habit.hang, rng)
            meshes.append(tubes(dark, *_thinned(fine, 2), 3))
        return joined(meshes), {}
    name, material = leaf_material("needles" if kind == "pine" else kind, season)
    lines = twigs[0]
    if kind == "pine":
        shares = rng.uniform(0.3, 1.0, (3, len(lines)))
        places = np.concatenate([_point(lines, share) for share in shares])
        ahead = np.tile(lines[:, -1] - lines[:, 0], (3, 1))
        ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
        meshes.append(needles(name, places, ahead, rng, 4 if coarse else 8))
    else:
        meshes.append(_leafage(name, habit, lines, season, coarse, rng))
    return joined(meshes), {name: material}


def _leafage(
    name: str,
    habit: Habit,
    lines: FloatArray,
    season: Season,
    coarse: bool,
    rng: np.random.Generator,
) -> Mesh:
    """Leaves along twigs, facing up and out."""
    each = habit.leaves if season != "autumn" else max(habit.leaves // 2, 2)
    if coarse:
        each = max(each // 2, 2)
    shares = rng.uniform(0.1, 1.05, (each, len(lines)))
    places = np.concatenate([_point(lines, share) for share in shares])
    places += rng.normal(0, habit.leaf_m * 0.8, places.shape)
    centre = np.array([0, 0, habit.height_m * (0.5 + habit.clear / 2)])
    outward = places - centre
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    facing = outward * 0.5 + [0, 0, 0.6] + rng.normal(0, 0.6, places.shape)
    size = habit.leaf_m * rng.uniform(0.7, 1.25, len(places)) * (1.9 if coarse else 1.0)
    keep = places[:, 2] > 0.05
    return leaves(name, places[keep], size[keep], facing[keep], rng)


Branches = tuple[FloatArray, FloatArray]
"""Lines (N, K, 3) and their radii (N, K)."""


def _trunk(habit: Habit, rng: np.random.Generator) -> tuple[Branches, Branches]:
    """The trunk, and the limbs whose ends lie on the crown's hull."""
    height = habit.height_m
    levels = np.linspace(0, 0.93, 10) * height
    sway = np.cumsum(rng.normal(0, 0.006 * height, (10, 2)), axis=0)
    sway -= sway[:1]
    line = np.column_stack([sway, levels])[None]
    radius = habit.trunk * height
    radii = radius * (1 - 0.9 * levels / height)
    radii[0] *= 1.35
    trunk = (line, radii[None])
    count = habit.limbs
    share = np.clip((np.arange(count) + rng.uniform(0, 0.9, count)) / count, 0, 1)
    level = habit.clear + (0.9 - habit.clear) * share
    azimuth = np.deg2rad(GOLDEN_DEG * np.arange(count) + rng.normal(0, 16, count))
    angle = np.deg2rad(habit.low_deg + (habit.high_deg - habit.low_deg) * share)
    # The hull is an egg: widest at ``top`` of the crown's height.
    rise = np.where(share < habit.top, share / habit.top, (1 - share) / (1 - habit.top))
    hull = habit.spread * height * np.sqrt(np.clip(1 - (1 - rise) ** 2, 0.08, 1))
    length = hull / np.maximum(np.sin(angle), 0.42) * rng.uniform(0.8, 1.08, count)
    length = np.minimum(length, (1.03 - level) * height / np.maximum(np.cos(angle), 0.15))
    start = np.column_stack([np.interp(level * height, levels, sway[:, k]) for k in (0, 1)])
    if habit.clear == 0:  # a shrub: many stems from the ground
        level, angle = np.zeros(count), np.abs(rng.normal(0, 0.5, count))
        length = height * rng.uniform(0.7, 1.0, count)
        start = rng.normal(0, 0.08 * height, (count, 2))
    ahead = np.column_stack(
        [np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), np.cos(angle)]
    )
    starts = np.column_stack([start, level * height])
    thick = np.interp(level * height, levels, radii) * 0.5
    limbs = _grown(starts, ahead, length, np.maximum(thick, 0.012), 6, 0.12, 0.25, rng)
    return trunk, limbs


def _grown(
    starts: FloatArray,
    ahead: FloatArray,
    length: FloatArray,
    radius: FloatArray,
    points: int,
    wobble: float,
    lift: float,
    rng: np.random.Generator,
) -> Branches:
    """Branches from starts (N, 3) that wobble and turn up by ``lift`` (down if negative)."""
    lines = [starts]
    direction = ahead
    for _ in range(points - 1):
        direction = direction + rng.normal(0, wobble, direction.shape)
        direction[:, 2] += lift / (points - 1)
        direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
        lines.append(lines[-1] + direction * (length / (points - 1))[:, None])
    taper = np.linspace(1, 0.25, points)
    return np.stack(lines, axis=1), radius[:, None] * taper


def _children(
    parents: Branches,
    each: int,
    first: float,
    angles_deg: tuple[float, float],
    share: float,
    hang: float,
    rng: np.random.Generator,
) -> Branches:
    """Side branches of every parent and one that carries its end on."""
    lines, radii = parents
    count = len(lines)
    parent = np.repeat(np.arange(count), each)
    at = (
        first
        + (1 - first) * (np.tile(np.arange(each), count) + rng.uniform(0, 1, count * each)) / each
    )
    starts = _point(lines[parent], at)
    axis = lines[parent, -1] - lines[parent, 0]
    length = np.linalg.norm(axis, axis=1)
    axis /= length[:, None]
    angle = np.deg2rad(rng.uniform(*angles_deg, count * each))
    side = np.cross(axis, rng.normal(0, 1, axis.shape))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    ahead = axis * np.cos(angle)[:, None] + side * np.sin(angle)[:, None]
    size = np.maximum(length * share * (1.15 - 0.55 * at), 0.15) * rng.uniform(
        0.7, 1.2, count * each
    )
    thick = np.maximum(radii[parent, 0] * 0.45 * (1.1 - 0.6 * at), 0.004)
    return _grown(starts, ahead, size, thick, 4, 0.16, -hang * 1.6 + 0.1, rng)


def _point(lines: FloatArray, share: FloatArray) -> FloatArray:
    """The point (N, 3) of every line (N, K, 3) at its share (N,) of the way."""
    place = np.clip(share, 0, 1) * (lines.shape[1] - 1)
    low = np.minimum(place.astype(int), lines.shape[1] - 2)
    rows = np.arange(len(lines))
    rest = (place - low)[:, None]
    return lines[rows, low] * (1 - rest) + lines[rows, low + 1] * rest


def _thinned(branches: Branches, points: int) -> Branches:
    """The branches with fewer points."""
    lines, radii = branches
    chosen = np.linspace(0, lines.shape[1] - 1, points).round().astype(int)
    return lines[:, chosen], radii[:, chosen]


def tubes(material: str, lines: FloatArray, radii: FloatArray, sides: int) -> Mesh:
    """Round bars along lines (N, K, 3) with radii (N, K); ``uv`` is in metres around and along."""
    count, points = radii.shape
    tangent = np.gradient(lines, axis=1)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=2, keepdims=True), 1e-9)
    helper = np.where(np.abs(tangent[:, :1, 2:]) > 0.9, [[[1.0, 0, 0]]], [[[0, 0, 1.0]]])
    first = np.cross(helper, tangent)
    first /= np.maximum(np.linalg.norm(first, axis=2, keepdims=True), 1e-9)
    second = np.cross(tangent, first)
    turn = 2 * np.pi * np.arange(sides + 1) / sides
    round_ = (
        first[:, :, None] * np.cos(turn)[None, None, :, None]
        + second[:, :, None] * np.sin(turn)[None, None, :, None]
    )
    vertices = lines[:, :, None] + round_ * radii[:, :, None, None]
    steps = np.linalg.norm(np.diff(lines, axis=1), axis=2)
    along = np.concatenate([np.zeros((count, 1)), np.cumsum(steps, axis=1)], axis=1)
    uv = np.stack(
        np.broadcast_arrays(turn[None, None] * radii[:, :1, None], along[:, :, None]), axis=-1
    )
    index = np.arange(count * points * (sides + 1)).reshape(count, points, sides + 1)
    a, b = index[:, :-1, :-1], index[:, :-1, 1:]
    c, d = index[:, 1:, 1:], index[:, 1:, :-1]
    faces = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], -2).reshape(-1, 3)
    return Mesh(
        material,
        vertices.reshape(-1, 3).astype(np.float32),
        faces.astype(np.int32),
        uv.reshape(-1, 2).astype(np.float32),
        round_.reshape(-1, 3).astype(np.float32),
    )
