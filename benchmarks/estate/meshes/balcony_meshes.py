"""Balconies: slabs, fronts of concrete, sheet metal, board or bars, side walls and furniture.

Everything is in the wall's frame: x right, y up, z out of the wall.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from benchmarks.estate.meshes.solids import box, boxes, cylinder, leaves, sheet
from benchmarks.estate.painting.house_materials import covered_with, fixed, matt, paint
from benchmarks.estate.parts import Mesh, Parts
from benchmarks.estate.plan import Balcony, Rgb

FrontKind = Literal["concrete", "sheet", "board"]
_BAR_EVERY_M = 0.11
_POST_EVERY_M = 1.3


@dataclass(frozen=True)
class _Run:
    """A straight piece of guard from a to b (x, z), with its outside towards +z for x growing."""

    a: tuple[float, float]
    b: tuple[float, float]

    @property
    def length_m(self) -> float:
        return float(np.hypot(self.b[0] - self.a[0], self.b[1] - self.a[1]))

    def at(self, along: np.ndarray, y: np.ndarray, out: np.ndarray) -> np.ndarray:
        """Points (..., 3) from metres along the run, height, and metres outwards."""
        direction = (np.asarray(self.b) - self.a) / self.length_m
        x = self.a[0] + along * direction[0] - out * direction[1]
        z = self.a[1] + along * direction[1] + out * direction[0]
        return np.stack(np.broadcast_arrays(x, y, z), axis=-1)


def front_kind_of(balcony: Balcony, rng: np.random.Generator) -> FrontKind:
    """What the solid fronts of a house are made of."""
    kinds: tuple[FrontKind, ...] = ("sheet", "board", "concrete")
    grey = max(balcony.rgb) - min(balcony.rgb) < 0.06
    weights = (0.25, 0.25, 0.5) if grey else (0.5, 0.45, 0.05)
    return kinds[int(np.searchsorted(np.cumsum(weights), rng.uniform(0, 0.999)))]


def balcony_parts(balcony: Balcony, front: FrontKind, rng: np.random.Generator) -> Parts:
    """Slab, guard, side walls and things of one balcony."""
    parts = Parts()
    x0, x1 = balcony.x_m, balcony.x_m + balcony.width_m
    y, depth = balcony.y_m, balcony.depth_m
    if balcony.kind == "loggia":
        parts.add(_guard(balcony, front, [((x0, -0.06), (x1, -0.06))], solid=True))
    elif balcony.kind == "french":
        parts.add(_guard(balcony, front, [((x0, 0.08), (x1, 0.08))], solid=False))
    else:
        concrete = fixed(parts, "concrete")
        parts.meshes.append(box(concrete, (x0, y - balcony.slab_m, -0.02), (x1, y, depth)))
        parts.add(_sides(balcony))
        lines = [((x0, depth), (x1, depth))]
        if not balcony.side_walls:
            lines = [((x0, 0.02), (x0, depth)), *lines, ((x1, depth), (x1, 0.02))]
        parts.add(_guard(balcony, front, lines, solid=balcony.kind == "solid"))
    if balcony.things and balcony.kind != "french":
        parts.add(_furniture(balcony, rng))
    return parts


def _sides(balcony: Balcony) -> Parts:
    """Walls of full height at both ends."""
    parts = Parts()
    if balcony.side_walls:
        concrete = fixed(parts, "concrete")
        low, high = balcony.y_m, balcony.y_m + balcony.clear_m
        for x in (balcony.x_m, balcony.x_m + balcony.width_m - 0.14):
            parts.meshes.append(
                box(concrete, (x, low, -0.02), (x + 0.14, high, balcony.depth_m - 0.01))
            )
    return parts


def _bars(
    material: str, run: _Run, places: np.ndarray, low: float, high: float, half: float
) -> Mesh:
    """Upright square bars at metres along a run."""
    foot = run.at(places, np.full(len(places), low), np.full(len(places), -0.03))
    head = foot + np.array([0.0, high - low, 0.0])
    thick = np.array([half, 0.0, half])
    return boxes(material, foot - thick, head + thick, without="top bottom")


def _bar_between(
    material: str, run: _Run, low: float, high: float, inner: float, outer: float
) -> Mesh:
    """A level bar along a whole run; ``inner`` and ``outer`` are metres outwards."""
    corners = run.at(np.array([0.0, run.length_m]), np.array([low, high]), np.array([inner, outer]))
    ends = run.at(np.array([0.0, run.length_m]), np.array([low, high]), np.array([outer, inner]))
    every = np.concatenate([corners, ends])
    return box(material, every.min(0), every.max(0))


def _guard(
    balcony: Balcony,
    front: FrontKind,
    lines: list[tuple[tuple[float, float], tuple[float, float]]],
    *,
    solid: bool,
) -> Parts:
    """The guard along lines (x, z)."""
    parts = Parts()
    y = balcony.y_m
    top = y + balcony.guard_m
    metal = fixed(parts, "zinc") if solid else paint(parts, balcony.rgb)
    for line in lines:
        run = _Run(*line)
        if run.length_m < 0.1:
            continue
        posts = np.linspace(0.03, run.length_m - 0.03, 2 + int(run.length_m / _POST_EVERY_M))
        if not solid:
            count = max(2, round(run.length_m / _BAR_EVERY_M))
            places = run.length_m * (np.arange(count) + 0.5) / count
            parts.meshes.append(_bars(metal, run, places, y + 0.08, top - 0.02, 0.006))
            parts.meshes.append(_bars(metal, run, posts, y - 0.05, top, 0.018))
            for low, high in ((y + 0.07, y + 0.10), (top - 0.03, top)):
                parts.meshes.append(_bar_between(metal, run, low, high, -0.05, -0.01))
            continue
        if front == "concrete":
            material = fixed(parts, "concrete")
            if max(balcony.rgb) - min(balcony.rgb) > 0.06:
                material = matt(parts, balcony.rgb)
            low = y - balcony.slab_m if balcony.kind != "loggia" else y
            parts.meshes.append(_bar_between(material, run, low - 0.02, top - 0.08, -0.07, 0.03))
            parts.meshes.append(_bars(metal, run, posts, top - 0.08, top - 0.03, 0.015))
            parts.meshes.append(_bar_between(metal, run, top - 0.035, top, -0.05, -0.01))
            continue
        material = covered_with(parts, "weathered_coat", balcony.rgb)
        parts.meshes.append(_bars(metal, run, posts, y - 0.10, top, 0.02))
        parts.meshes.append(_bar_between(metal, run, top - 0.005, top + 0.035, -0.05, 0.035))
        low = y - 0.12 if balcony.kind != "loggia" else y + 0.05
        if front == "sheet":
            parts.meshes.append(_corrugated(material, run, low, top - 0.02))
        else:
            parts.add(_boards(material, run, posts, low, top - 0.03))
    return parts


def _corrugated(material: str, run: _Run, low: float, high: float) -> Mesh:
    """Trapezoidal sheet metal with upright ribs of 0.11 m."""
    ribs = max(2, round(run.length_m / 0.11))
    profile = np.array([[0.0, 0.0], [0.40, 0.0], [0.52, 1.0], [0.88, 1.0]])
    steps = (np.arange(ribs)[:, None] + profile[None, :, 0]).ravel()
    along = np.append(steps, ribs) / ribs * run.length_m
    out = 0.008 + 0.02 * np.append(np.tile(profile[:, 1], ribs), 0.0)
    heights = np.array([low, high])[:, None]
    return sheet(material, run.at(along[None], heights, out[None]))


def _boards(material: str, run: _Run, posts: np.ndarray, low: float, high: float) -> Parts:
    """Flat boards with an open joint at every post."""
    parts = Parts()
    for start, end in pairwise(posts):
        a, b = run.at(np.array([start + 0.005, end - 0.005]), np.zeros(2), np.zeros(2))
        piece = _Run((a[0], a[2]), (b[0], b[2]))
        parts.meshes.append(_bar_between(material, piece, low, high, 0.0, 0.012))
    return parts


def _furniture(balcony: Balcony, rng: np.random.Generator) -> Parts:
    """A table with chairs, pots, sometimes a flower box on the rail or a parasol."""
    parts = Parts()
    y = balcony.y_m
    near = -balcony.depth_m if balcony.kind == "loggia" else 0.0
    x0, x1 = balcony.x_m + 0.3, balcony.x_m + balcony.width_m - 0.3
    z0, z1 = near + 0.3, near + balcony.depth_m - 0.35
    if x1 - x0 < 0.6 or z1 <= z0:
        return parts
    woods: tuple[Rgb, ...] = ((0.42, 0.28, 0.17), (0.85, 0.85, 0.84), (0.12, 0.13, 0.13))
    wood = paint(parts, woods[int(rng.integers(3))])
    x, z = rng.uniform(x0 + 0.2, x1 - 0.2), (z0 + z1) / 2
    parts.meshes.append(box(wood, (x - 0.3, y + 0.70, z - 0.28), (x + 0.3, y + 0.73, z + 0.28)))
    parts.meshes.append(cylinder(wood, (x, y, z), (x, y + 0.7, z), 0.03, sides=6))
    for side in (-1, 1):
        centre = x + side * 0.62
        if x0 <= centre <= x1:
            parts.add(_chair(wood, centre, y, z, side))
    for _ in range(int(rng.integers(0, 4))):
        parts.add(_plant(rng.uniform(x0, x1), y, z1 - 0.02, rng.uniform(0.8, 1.5), rng))
    if rng.random() < 0.35 and balcony.kind != "loggia":
        parts.add(_flower_box(balcony, rng))
    if rng.random() < 0.2 and balcony.clear_m > 2.2:
        cloths: tuple[Rgb, ...] = ((0.80, 0.76, 0.66), (0.55, 0.12, 0.10), (0.16, 0.28, 0.22))
        cloth = matt(parts, cloths[int(rng.integers(3))])
        x = rng.uniform(x0, x1)
        parts.meshes.append(cylinder(wood, (x, y, z1), (x, y + 2.0, z1), 0.018, sides=6))
        parts.meshes.append(
            cylinder(cloth, (x, y + 0.95, z1), (x, y + 1.95, z1), 0.10, end_radius_m=0.04, sides=8)
        )
    return parts


def _chair(material: str, x: float, y: float, z: float, side: int) -> Parts:
    """A plain chair that looks back towards a table on its other side."""
    parts = Parts()
    half = 0.21
    parts.meshes.append(
        box(material, (x - half, y + 0.43, z - half), (x + half, y + 0.46, z + half))
    )
    back_x = x + side * half
    parts.meshes.append(
        box(material, (back_x - 0.015, y + 0.5, z - half), (back_x + 0.015, y + 0.88, z + half))
    )
    feet = [(x + dx, y, z + dz) for dx in (-0.19, 0.19) for dz in (-0.19, 0.19)]
    thick = np.array([0.015, 0.0, 0.015])
    parts.meshes.append(boxes(material, feet - thick, feet + thick + np.array([0, 0.45, 0])))
    return parts


def _plant(x: float, y: float, z: float, size: float, rng: np.random.Generator) -> Parts:
    """A pot with something green in it."""
    parts = Parts()
    pots: tuple[Rgb, ...] = ((0.58, 0.30, 0.20), (0.30, 0.31, 0.33), (0.78, 0.76, 0.72))
    pot = paint(parts, pots[int(rng.integers(3))])
    parts.meshes.append(
        cylinder(pot, (x, y, z), (x, y + 0.25, z), 0.11, end_radius_m=0.14, sides=9)
    )
    green = fixed(parts, ("leaf_hedge", "leaf_linden", "leaf_maple")[int(rng.integers(3))])
    radii = size * rng.uniform(0.16, 0.24, 3) * (1.0, 1.0, 0.8)
    middle = (x, y + 0.25 + 0.9 * radii[1], z)
    parts.meshes.append(leaves(green, middle, radii, int(110 * size), 0.075, rng))
    if size > 1.1:  # a small tree
        crown = (x, y + 0.55 + 0.9 * radii[1], z)
        parts.meshes.append(leaves(green, crown, radii * 1.2, int(110 * size), 0.075, rng))
    return parts


def _flower_box(balcony: Balcony, rng: np.random.Generator) -> Parts:
    """Flowers outside the rail."""
    parts = Parts()
    case = paint(parts, ((0.85, 0.85, 0.82), (0.24, 0.18, 0.14))[int(rng.integers(2))])
    green = fixed(parts, "leaf_hedge")
    petals: tuple[Rgb, ...] = ((0.72, 0.10, 0.13), (0.80, 0.35, 0.52), (0.90, 0.88, 0.84))
    bloom = matt(parts, petals[int(rng.integers(3))])
    top, z = balcony.y_m + balcony.guard_m - 0.05, balcony.depth_m + 0.13
    x = balcony.x_m + rng.uniform(0.1, 0.3) * balcony.width_m
    count = int(rng.integers(1, 3))
    for i in range(count):
        left = x + 0.85 * i
        if left + 0.8 > balcony.x_m + balcony.width_m:
            break
        parts.meshes.append(box(case, (left, top - 0.16, z - 0.08), (left + 0.8, top, z + 0.08)))
        middle = (left + 0.4, top + 0.03, z + 0.02)
        parts.meshes.append(leaves(green, middle, (0.42, 0.12, 0.11), 150, 0.06, rng))
        parts.meshes.append(leaves(bloom, middle, (0.42, 0.15, 0.13), 45, 0.05, rng))
    return parts
