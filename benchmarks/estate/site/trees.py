"""Trees: a few of every kind grown branch by branch, then set up turned and scaled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.parts import Material, Mesh, Parts, joined
from benchmarks.estate.plan import FloatArray, Tree
from benchmarks.estate.site.bark import bark_materials
from benchmarks.estate.site.branches import Branches, children, grown, point_at, thinned, tubes
from benchmarks.estate.site.foliage import Season, leaf_material, leaves, needles

DetailName = Literal["fine", "medium", "far"]
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
    "round": Habit(10.0, 0.22, 0.32, 30, 76, 20, 0.1, 0.016, 0.16, 10, "bark"),
    "birch": Habit(12.0, 0.20, 0.22, 30, 54, 24, 0.75, 0.0105, 0.098, 11, "birch-bark", 0.35),
    "pine": Habit(12.0, 0.45, 0.22, 18, 85, 42, -0.15, 0.013, 0.0, 0, "pine-bark", 0.6),
    "shrub": Habit(1.6, 0.0, 0.5, 10, 60, 15, 0.0, 0.008, 0.08, 6, "bark"),
}


@dataclass(frozen=True)
class Detail:
    """How finely a tree is made: branches of a branch, share and size of the leaves, twigs shown.

    ``sides`` are those of trunk, limbs and boughs.
    """

    boughs: int
    twigs: int
    leaf_share: float
    leaf_size: float
    sides: tuple[int, int, int]
    show_twigs: float


DETAILS = {
    "fine": Detail(8, 6, 1.0, 1.0, (12, 5, 3), 0.5),
    "medium": Detail(6, 4, 0.45, 1.85, (8, 4, 3), 0.0),
    "far": Detail(3, 3, 0.2, 4.4, (5, 3, 3), 0.0),
}


def tree_parts(
    trees: Sequence[Tree], season: Season, seed: int, detail: DetailName = "fine"
) -> Parts:
    """The meshes of trees; ``medium`` has about a quarter, ``far`` a thirtieth of the triangles."""
    parts = Parts(materials=bark_materials())
    known: dict[tuple[str, int], list[Mesh]] = {}
    placed: list[Mesh] = []
    for tree in trees:
        rng = rng_of(seed, "tree", *tree.place)
        key = (tree.kind, int(rng.integers(PROTOTYPES)))
        if key not in known:
            meshes, materials = prototype(*key, season, detail)
            known[key] = meshes
            parts.materials.update(materials)
        habit = HABITS[tree.kind]
        wide = tree.crown_m / (2 * habit.spread * habit.height_m)
        tall = tree.height_m / habit.height_m
        turn = rng.uniform(0, 2 * np.pi)
        lean = rng.normal(0, 0.015, 2)
        placed += [_set_up(mesh, tree, wide, tall, turn, lean) for mesh in known[key]]
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


def prototype(
    kind: str, number: int, season: Season, detail: DetailName
) -> tuple[list[Mesh], dict[str, Material]]:
    """One tree with its foot at the origin, in its habit's own size."""
    habit, fine = HABITS[kind], DETAILS[detail]
    rng = rng_of(number, "prototype", kind)
    trunk, limbs = _trunk(habit, rng)
    boughs = children(limbs, fine.boughs, 0.2, (30, 65), 0.5, habit.hang * 0.4, rng)
    twigs = children(boughs, fine.twigs, 0.15, (25, 60), 0.5, habit.hang, rng)
    bare = season == "bare" and kind != "pine"
    dark = habit.bark if habit.bark != "birch-bark" else "birch-twig"
    far = detail == "far"
    meshes = [] if kind == "shrub" else [tubes(habit.bark, *trunk, fine.sides[0])]
    meshes.append(tubes(dark, *thinned(limbs, 2 if far else 6), fine.sides[1]))
    if bare or not far:
        meshes.append(tubes(dark, *thinned(boughs, 2 if far else 3), fine.sides[2]))
    if bare:
        if not far:
            meshes.append(tubes(dark, *thinned(twigs, 2), 3))
        if detail == "fine":
            last = children(twigs, 2, 0.2, (20, 55), 0.55, habit.hang, rng)
            meshes.append(tubes(dark, *thinned(last, 2), 3))
        return _fitted(joined(meshes), habit), {}
    shown = int(fine.show_twigs * len(twigs[0]))
    if shown:
        chosen = rng.permutation(len(twigs[0]))[:shown]
        meshes.append(tubes(dark, *thinned((twigs[0][chosen], twigs[1][chosen]), 2), 3))
    name, material = leaf_material("needles" if kind == "pine" else kind, season)
    meshes.append(_leafage(name, habit, twigs[0], season, fine, rng))
    return _fitted(joined(meshes), habit), {name: material}


def _fitted(meshes: list[Mesh], habit: Habit) -> list[Mesh]:
    """The tree stretched to its height and width; a few ends stand out of them."""
    points = np.concatenate([mesh.vertices for mesh in meshes])
    tall = habit.height_m / np.percentile(points[:, 2], 99.7)
    wide = habit.spread * habit.height_m / np.percentile(np.hypot(*points.T[:2]), 97)
    scale = np.array([wide, wide, tall], np.float32)
    return [replace(mesh, vertices=mesh.vertices * scale) for mesh in meshes]


def _leafage(
    name: str,
    habit: Habit,
    lines: FloatArray,
    season: Season,
    fine: Detail,
    rng: np.random.Generator,
) -> Mesh:
    """Leaves along twigs, facing up and out, or tufts of needles."""
    if habit.leaves == 0:
        each = 3 if fine.leaf_share == 1 else 1
        shares = rng.uniform(0.3, 1.0, (each, len(lines)))
        places = np.concatenate([point_at(lines, share) for share in shares])
        ahead = np.tile(lines[:, -1] - lines[:, 0], (each, 1))
        ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
        return needles(name, places, ahead, rng, 9 if each == 3 else 6, fine.leaf_size)
    share = fine.leaf_share * (0.5 if season == "autumn" else 1.0)
    each = max(round(habit.leaves * share), 1)
    shares = rng.uniform(0.05, 1.05, (each, len(lines)))
    places = np.concatenate([point_at(lines, share) for share in shares])
    places += rng.normal(0, habit.leaf_m * 0.9, places.shape)
    centre = np.array([0, 0, habit.height_m * (0.5 + habit.clear / 2)])
    outward = places - centre
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    facing = outward * 0.5 + [0, 0, 0.6] + rng.normal(0, 0.6, places.shape)
    size = habit.leaf_m * rng.uniform(0.7, 1.25, len(places)) * fine.leaf_size
    keep = places[:, 2] > 0.05
    return leaves(name, places[keep], size[keep], facing[keep], rng)


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
    limbs = grown(starts, ahead, length, np.maximum(thick, 0.012), 6, 0.12, 0.25, rng)
    return trunk, limbs
