"""Openings, balconies and obstacles of the two synthetic facades."""

from __future__ import annotations

import numpy as np
from benchmarks.accuracy.radiance.solids import GLASS_SETBACK_M, Ball, Box, Opening
from benchmarks.accuracy.radiance.textures import Look

BRICK = Look(
    split_m=6.0,
    course_m=0.077,
    block_m=0.25,
    joint_m=0.012,
    masonry_rgb=(142.0, 82.0, 62.0),
    masonry_spread=15.0,
    joint_rgb=(168.0, 160.0, 148.0),
    plaster_rgb=(214.0, 202.0, 176.0),
    frame_below_rgb=(232.0, 230.0, 224.0),
    frame_above_rgb=(74.0, 64.0, 56.0),
    balcony_rgb=(118.0, 132.0, 128.0),
    leaf_rgb=(72.0, 104.0, 48.0),
    car_rgb=(150.0, 34.0, 30.0),
    reflectance=0.28,
)
STONE = Look(
    split_m=4.1,
    course_m=0.38,
    block_m=0.83,
    joint_m=0.016,
    masonry_rgb=(158.0, 152.0, 138.0),
    masonry_spread=9.0,
    joint_rgb=(108.0, 104.0, 96.0),
    plaster_rgb=(176.0, 118.0, 92.0),
    frame_below_rgb=(62.0, 88.0, 72.0),
    frame_above_rgb=(240.0, 238.0, 232.0),
    balcony_rgb=(206.0, 200.0, 188.0),
    leaf_rgb=(104.0, 112.0, 40.0),
    car_rgb=(196.0, 200.0, 204.0),
    reflectance=0.2,
)


def _opening(
    rng: np.random.Generator,
    look: Look,
    middle: float,
    bottom: float,
    size: tuple[float, float],
    recess: tuple[float, float],
    panes: tuple[int, int],
) -> Opening:
    middle, bottom = middle + rng.uniform(-0.03, 0.03), bottom + rng.uniform(-0.02, 0.02)
    return Opening(
        middle - size[0] / 2,
        middle + size[0] / 2,
        bottom,
        bottom + size[1],
        rng.uniform(*recess) - GLASS_SETBACK_M,
        0.07,
        *panes,
        look.frame_below_rgb if bottom < look.split_m else look.frame_above_rgb,
        rng.uniform(30, 75),
        rng.uniform(0.0, 0.35) if rng.random() < 0.6 else 0.0,
        (rng.normal(0, 0.01), rng.normal(0, 0.01)),
    )


def _balcony(
    look: Look, left: float, right: float, floor: float, size: tuple[float, float]
) -> list[Box]:
    """A slab with a parapet of thickness 6 cm; size is (depth, height of the parapet)."""
    depth, parapet = size
    concrete = (168.0, 164.0, 156.0)
    return [
        Box((left, floor - 0.18, 0.0), (right, floor, depth), concrete, True),
        Box((left, floor, depth - 0.06), (right, floor + parapet, depth), look.balcony_rgb, True),
        Box((left, floor, 0.001), (left + 0.06, floor + parapet, depth), look.balcony_rgb, True),
        Box((right - 0.06, floor, 0.001), (right, floor + parapet, depth), look.balcony_rgb, True),
    ]


def five_storeys(rng: np.random.Generator, look: Look) -> tuple[list[Opening], list[Box]]:
    """39 openings and 8 balconies on 20 x 15 m."""
    openings, balconies = [], []
    recess = (0.15, 0.30)
    for storey in range(5):
        floor = 3.0 * storey
        for column in range(8):
            middle = 1.6 + 2.4 * column
            if storey == 0 and column in (3, 4):
                if column == 3:
                    openings.append(
                        _opening(rng, look, middle + 1.2, 0.03, (2.6, 2.45), recess, (2, 2))
                    )
            elif storey and column in (2, 5):
                openings.append(
                    _opening(rng, look, middle, floor + 0.04, (1.1, 2.2), recess, (2, 1))
                )
                balconies += _balcony(look, middle - 1.1, middle + 1.1, floor, (1.2, 1.0))
            else:
                openings.append(
                    _opening(rng, look, middle, floor + 0.9, (1.2, 1.5), recess, (2, 1))
                )
    return openings, balconies


def four_storeys(rng: np.random.Generator, look: Look) -> tuple[list[Opening], list[Box]]:
    """32 openings and 6 balconies of two depths on 22 x 13.2 m."""
    openings, balconies = [], []
    middles = (1.7, 4.3, 6.2, 9.3, 12.7, 15.8, 17.7, 20.3)
    recess = (0.10, 0.24)
    for storey, floor in enumerate((0.0, 3.5, 6.7, 9.9)):
        for column, middle in enumerate(middles):
            if storey == 0 and column == 5:
                openings.append(_opening(rng, look, middle, 0.03, (1.3, 2.5), recess, (1, 2)))
            elif storey == 0 and column in (0, 3, 4):
                openings.append(_opening(rng, look, middle, 0.7, (2.2, 1.9), recess, (3, 1)))
            elif storey and column in (3, 4):
                openings.append(
                    _opening(rng, look, middle, floor + 0.05, (1.7, 2.15), recess, (3, 1))
                )
                depth = 0.95 if column == 3 else 1.35
                balconies += _balcony(look, middle - 1.5, middle + 1.5, floor, (depth, 0.9))
            else:
                openings.append(
                    _opening(rng, look, middle, floor + 0.85, (1.0, 1.75), recess, (2, 2))
                )
    return openings, balconies


def _leaves(
    rng: np.random.Generator,
    look: Look,
    middle: tuple[float, float, float],
    reach: tuple[float, float, float],
    count: int,
) -> list[Ball]:
    """Clumps spread through an ellipsoid, denser towards its rim."""
    leaves = []
    for _ in range(count):
        direction = rng.standard_normal(3)
        direction *= rng.random() ** 0.25 / np.linalg.norm(direction)
        place = np.array(middle) + direction * np.array(reach)
        shade = rng.uniform(0.7, 1.3) * (0.85 + 0.25 * direction[1])
        tint = tuple(float(shade * c) for c in np.array(look.leaf_rgb) * rng.uniform(0.9, 1.1, 3))
        leaves.append(Ball(tuple(place.tolist()), float(rng.uniform(0.1, 0.24)), tint))
    return leaves


def round_tree_and_car(rng: np.random.Generator, look: Look) -> tuple[list[Box], list[Ball]]:
    """What hides parts of the first facade."""
    x = 13.3 + rng.uniform(-0.4, 0.4)
    trunk = Box((x - 0.14, 0.0, 4.2), (x + 0.14, 3.6, 4.48), (84.0, 68.0, 54.0))
    leaves = _leaves(rng, look, (x, 4.6, 4.3), (1.5, 1.6, 1.4), 330)
    left = 4.2 + rng.uniform(-0.4, 0.4)
    return [trunk, *_vehicle(look, left, 4.6, (4.3, 1.75, 0.85, 1.42))], leaves


def slim_tree_and_van(rng: np.random.Generator, look: Look) -> tuple[list[Box], list[Ball]]:
    """What hides parts of the second facade, a bush included."""
    x = 6.9 + rng.uniform(-0.4, 0.4)
    trunk = Box((x - 0.1, 0.0, 3.5), (x + 0.1, 6.0, 3.7), (120.0, 112.0, 100.0))
    leaves = _leaves(rng, look, (x, 5.2, 3.6), (0.75, 3.4, 0.7), 240)
    leaves += _leaves(rng, look, (19.0, 0.5, 3.0), (0.9, 0.7, 0.6), 90)
    left = 13.2 + rng.uniform(-0.4, 0.4)
    return [trunk, *_vehicle(look, left, 5.0, (4.9, 1.9, 1.05, 2.05))], leaves


def _vehicle(
    look: Look, left: float, back: float, size: tuple[float, float, float, float]
) -> list[Box]:
    """Body, cabin and wheels; size is (length, width, height of the body, height)."""
    length, width, body, height = size
    front = back + width
    wheels = [
        Box((left + at, 0.0, side), (left + at + 0.62, 0.62, side + 0.2), (30.0, 30.0, 32.0))
        for at in (0.5, length - 1.1)
        for side in (back - 0.01, front - 0.19)
    ]
    return [
        Box((left, 0.25, back), (left + length, body, front), look.car_rgb),
        Box(
            (left + 0.9, body, back + 0.12),
            (left + length - 0.7, height, front - 0.12),
            (46.0, 54.0, 62.0),
        ),
        Box(
            (left + 1.1, height, back + 0.16),
            (left + length - 0.9, height + 0.05, front - 0.16),
            look.car_rgb,
        ),
        *wheels,
    ]
