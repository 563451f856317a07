"""What is seen through the glass: curtains, blinds, things on the inner sill, and a room.

In the wall's frame: x right, y up, z out of the wall.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
from benchmarks.estate.meshes.solids import ball, box, cylinder, leaves, quad, sheet
from benchmarks.estate.meshes.wall_meshes import FRAME_BACK_M
from benchmarks.estate.painting.house_materials import covered_with, fixed, glow, matt, paint
from benchmarks.estate.parts import Mesh, Parts
from benchmarks.estate.plan import Opening, Rgb
from shapely.geometry import Polygon
from shapely.geometry import box as rectangle

_CURTAIN_BEHIND_M = 0.12
_FOLD_M = 0.11
_DEPTHS_M = (3.2, 2.2, 1.4, 0.8, 0.4)
_SIDES_M = (0.8, 0.4, 0.1, 0.0, *(-0.1 * step for step in range(1, 30)))  # beyond the opening
_PLACES = (0.5, 0.8, 0.2)  # of the opening's width: one of them lies in the room
_NARROWEST_M = 0.3
_SPLAY_M = 0.15  # a room narrower than its opening widens over so much towards it
SHALLOWEST_M = 0.12  # where there is no space for a room
_WALLPAPERS: tuple[Rgb, ...] = (
    (0.72, 0.70, 0.65),
    (0.66, 0.60, 0.50),
    (0.60, 0.63, 0.60),
    (0.70, 0.66, 0.58),
    (0.55, 0.58, 0.62),
)


@dataclass(frozen=True)
class Room:
    """The free space behind an opening: (x0, x1) and (y0, y1) on the wall, z from near to far.

    ``front`` is its (x0, x1) at the opening; it has its own width a little farther in.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    near_z: float
    far_z: float
    front: tuple[float, float]


def room_of(opening: Opening, free: Polygon) -> Room:
    """The deepest of a few usual rooms that fits behind the opening, as wide as it can be.

    ``free`` is the plan of the building (x along the wall, depth behind its plane), without what
    other loggias take of it. In a corner a room may be narrower than its opening.
    """
    x0, x1 = opening.x_m, opening.x_m + opening.width_m
    near = opening.depth_m + opening.recess_m + FRAME_BACK_M
    bottom = opening.y_m - 0.02
    if opening.kind == "window" and opening.style.panel == 0:
        bottom = opening.y_m - 0.85
    y = (bottom, opening.y_m + opening.height_m + 0.25)
    for place, deep in product(_PLACES, _DEPTHS_M):
        within = x0 + place * opening.width_m
        left, right = (_reach(within, edge, (near, near + deep), free) for edge in (x0, x1))
        if left is not None and right is not None and right - left > _NARROWEST_M:
            front = min(left, x0 - 0.02), max(right, x1 + 0.02)
            return Room((left, right), y, -near, -near - deep, front)
    x = (x0 - 0.05, x1 + 0.05)
    return Room(x, y, -near, -near - SHALLOWEST_M, x)


def _reach(within: float, edge: float, depths: tuple[float, float], free: Polygon) -> float | None:
    """How far (x) a room between two depths goes from within an opening past or up to its edge."""
    towards, inside = np.sign(edge - within), abs(edge - within)
    for side in _SIDES_M:
        x = float(edge + towards * side)
        if inside + side > 0 and free.contains(
            rectangle(min(x, within), depths[0], max(x, within), depths[1])
        ):
            return x
    return None


def behind_parts(opening: Opening, room: Room, rng: np.random.Generator) -> Parts:
    """Everything behind the glass of one opening."""
    parts = Parts()
    parts.add(_room(opening, room, rng))
    behind, deep = opening.behind, room.near_z - room.far_z
    if opening.kind == "door" or deep < 0.3:
        return parts
    left = max(opening.x_m, room.x[0] + 0.05)
    right = min(opening.x_m + opening.width_m, room.x[1] - 0.05)
    opening = replace(opening, x_m=left, width_m=right - left)  # no more than the room
    if opening.kind == "window" and opening.style.panel == 0:
        board = paint(parts, (0.88, 0.87, 0.84))
        low = (opening.x_m - 0.04, opening.y_m - 0.02, room.near_z - 0.2)
        high = (opening.x_m + opening.width_m + 0.04, opening.y_m + 0.01, room.near_z)
        parts.meshes.append(box(board, low, high, without="back"))
    glass_z = -opening.recess_m - opening.depth_m
    if behind.curtain > 0.02:
        parts.add(_curtains(opening, glass_z - _CURTAIN_BEHIND_M, rng))
    if behind.blind > 0.02:
        parts.add(_blind(opening, glass_z, rng))
    if behind.things and behind.curtain < 0.7 and opening.kind == "window":
        parts.add(_things(opening, glass_z - 0.17, rng))
    return parts


def _room(opening: Opening, room: Room, rng: np.random.Generator) -> Parts:
    """Faces that look inwards, and a lamp where the room is lit."""
    parts = Parts()
    light = opening.behind.light
    rgb = _WALLPAPERS[int(rng.integers(len(_WALLPAPERS)))]
    if opening.kind == "door":
        rgb = (0.50, 0.47, 0.42)
    paper, ceiling = matt(parts, rgb), matt(parts, (0.80, 0.79, 0.76))
    floor = matt(parts, (0.35, 0.25, 0.17))
    (x0, x1), (y0, y1), near, far = room.x, room.y, room.near_z, room.far_z
    sides = [(*room.front, near), (x0, x1, far)]
    if room.front != room.x:
        sides.insert(1, (x0, x1, near - _SPLAY_M))
    parts.meshes.append(quad(paper, [(x0, y0, far), (x1, y0, far), (x1, y1, far), (x0, y1, far)]))
    for (a0, a1, a), (b0, b1, b) in pairwise(sides):
        parts.meshes += [
            quad(paper, [(a0, y0, a), (b0, y0, b), (b0, y1, b), (a0, y1, a)]),
            quad(paper, [(b1, y0, b), (a1, y0, a), (a1, y1, a), (b1, y1, b)]),
            quad(floor, [(a0, y0, a), (a1, y0, a), (b1, y0, b), (b0, y0, b)]),
            quad(ceiling, [(b0, y1, b), (b1, y1, b), (a1, y1, a), (a0, y1, a)]),
        ]
    if near - far > 1.5 and opening.kind != "door":  # a cupboard or a picture on the back wall
        wood = matt(parts, ((0.30, 0.22, 0.15), (0.62, 0.58, 0.50))[int(rng.integers(2))])
        x = x0 + (x1 - x0) * rng.uniform(0.0, 0.6)
        top = y0 + rng.uniform(0.9, 2.0)
        wide = rng.uniform(0.6, 1.2)
        high = (min(x + wide, x1), min(top, y1), far + 0.45)
        parts.meshes.append(box(wood, (x, y0, far), high, without="back bottom"))
    if light > 0:
        lamp = glow(parts, (1.0, 0.80, 0.52), light)
        x, z = (x0 + x1) / 2, (near + far) / 2
        parts.meshes.append(ball(lamp, (x, y1 - 0.32, z), (0.2, 0.13, 0.2), rings=5))
    return parts


def _hanging(
    material: str, x0: float, x1: float, y0: float, y1: float, z: float, rng: np.random.Generator
) -> Mesh:
    """A cloth in soft folds."""
    width = x1 - x0
    depth = min(1.0, (y1 - y0) / 0.8)
    folds = max(1, min(12, round(width / _FOLD_M)))
    across = np.linspace(0, 1, 3 * folds + 1)
    phase = 2 * np.pi * folds * across + rng.uniform(0, 6.28)
    wave = depth * (0.022 * np.sin(phase) + 0.008 * np.sin(0.37 * phase))
    points = np.zeros((2, len(across), 3))
    points[:, :, 0] = x0 + width * across
    points[:, :, 1] = np.array([y0, y1])[:, None]
    points[:, :, 2] = z + np.array([1.0, 0.6])[:, None] * wave
    return sheet(material, points, smooth=True)


def _curtains(opening: Opening, z: float, rng: np.random.Generator) -> Parts:
    """Curtains from the sides; often a short one along the head."""
    parts = Parts()
    cloth = matt(parts, opening.behind.curtain_rgb)
    x0, x1 = opening.x_m, opening.x_m + opening.width_m
    y0, y1 = opening.y_m + 0.012, opening.y_m + opening.height_m + 0.05
    if opening.style.panel > 0:
        y0 = opening.y_m + 0.03
    covered = min(opening.behind.curtain, 1.0) * opening.width_m
    left = covered * rng.uniform(0.35, 0.65)
    if covered > 0.95 * opening.width_m:
        parts.meshes.append(_hanging(cloth, x0 - 0.05, x1 + 0.05, y0, y1, z, rng))
        return parts
    if left > 0.05:
        parts.meshes.append(_hanging(cloth, x0 - 0.05, x0 + left, y0, y1, z, rng))
    if covered - left > 0.05:
        parts.meshes.append(_hanging(cloth, x1 - covered + left, x1 + 0.05, y0, y1, z, rng))
    if opening.kind == "window" and rng.random() < 0.3:
        drop = y1 - rng.uniform(0.25, 0.4)
        parts.meshes.append(_hanging(cloth, x0 - 0.05, x1 + 0.05, drop, y1, z + 0.03, rng))
    return parts


def _blind(opening: Opening, glass_z: float, rng: np.random.Generator) -> Parts:
    """A venetian blind between the panes, or a roller blind behind them."""
    parts = Parts()
    behind = opening.behind
    x0, x1 = opening.x_m + 0.02, opening.x_m + opening.width_m - 0.02
    top = opening.y_m + opening.height_m - 0.02
    low = top - min(behind.blind, 1.0) * (opening.height_m - 0.04)
    venetian = rng.random() < 0.65
    z = glass_z - (0.022 if venetian else 0.075)
    material = (
        covered_with(parts, "slats", behind.blind_rgb)
        if venetian
        else matt(parts, behind.blind_rgb)
    )
    parts.meshes.append(quad(material, [(x0, low, z), (x1, low, z), (x1, top, z), (x0, top, z)]))
    bar = paint(parts, behind.blind_rgb)
    parts.meshes.append(box(bar, (x0, low - 0.02, z - 0.01), (x1, low, z + 0.008)))
    return parts


def _things(opening: Opening, z: float, rng: np.random.Generator) -> Parts:
    """Pot plants and a lamp on the inner sill, clear of the curtains."""
    parts = Parts()
    clear = 0.5 * min(opening.behind.curtain, 0.7) + 0.08
    y = opening.y_m + 0.01
    for _ in range(int(rng.integers(1, 4))):
        x = opening.x_m + opening.width_m * rng.uniform(clear, 1 - clear)
        if rng.random() < 0.25:
            shade = matt(parts, (0.85, 0.80, 0.68))
            foot = paint(parts, (0.4, 0.38, 0.35))
            parts.meshes.append(cylinder(foot, (x, y, z), (x, y + 0.2, z), 0.012, sides=5))
            parts.meshes.append(
                cylinder(shade, (x, y + 0.18, z), (x, y + 0.34, z), 0.11, end_radius_m=0.07)
            )
            continue
        pot_rgb = ((0.60, 0.32, 0.22), (0.85, 0.84, 0.80), (0.25, 0.27, 0.30))
        pot = paint(parts, pot_rgb[int(rng.integers(3))])
        parts.meshes.append(
            cylinder(pot, (x, y, z), (x, y + 0.11, z), 0.05, end_radius_m=0.065, sides=6)
        )
        green = fixed(parts, ("leaf_hedge", "leaf_linden", "leaf_maple")[int(rng.integers(3))])
        radii = rng.uniform(0.08, 0.15, 3) * (1.0, 1.2, 0.5)
        middle = (x, y + 0.10 + 0.8 * radii[1], z)
        parts.meshes.append(leaves(green, middle, radii, 14, 0.12, rng))
    return parts
