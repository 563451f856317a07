"""Pieces of the estate's own houses, the Million Programme, as facades of one picture's size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from benchmarks.estate.drawing import millimetres
from benchmarks.estate.facades.styles_draft import FacadePlan, choose
from benchmarks.estate.plan import Balcony, Opening, Ornament, Wall
from benchmarks.estate.plans.buildings import b1, b2, b3, point_block

_LEAST_SHARE = 0.5  # of a cut band or plinth course that is worth keeping


def estate_house(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """A stretch of a wall of a house of the estate, from the ground to the eaves."""
    seed = int(rng.integers(1 << 30))
    drawn = choose(rng, [b1, b2, b3, lambda number: point_block("point", number)])
    walls = [wall for wall in drawn(seed).walls if wall.width_m > 6.0 and wall.openings]
    wall = choose(rng, walls, [wall.width_m for wall in walls])
    width = min(width_m, wall.width_m)
    left = millimetres(rng.uniform(0.0, wall.width_m - width))
    return FacadePlan("estate house", stretch(wall, left, millimetres(width)))


def stretch(wall: Wall, left_m: float, width_m: float) -> Wall:
    """The part of a wall from ``left_m`` on; what its ends would cut in two is left out.

    Ornaments that run along the wall are shortened.
    """
    right_m = left_m + width_m

    def inside(thing: Opening | Balcony) -> bool:
        return left_m + 0.05 <= thing.x_m and thing.x_m + thing.width_m <= right_m - 0.05

    def shortened(thing: Ornament) -> Ornament:
        start = max(thing.x_m, left_m)
        end = min(thing.x_m + thing.width_m, right_m)
        return replace(
            thing, x_m=millimetres(start - left_m), width_m=millimetres(max(end - start, 0.0))
        )

    balconies = [b for b in wall.balconies if inside(b)]
    openings = [
        replace(o, x_m=millimetres(o.x_m - left_m))
        for o in wall.openings
        if inside(o) and (o.depth_m == 0 or any(_within(o, b) for b in balconies))
    ]
    ornaments = [shortened(o) for o in wall.ornaments]
    long_enough = [
        after
        for before, after in zip(wall.ornaments, ornaments, strict=True)
        if after.width_m > (0.05 if before.width_m > 1.0 else _LEAST_SHARE * before.width_m)
        and (before.kind == "box" or after.width_m == before.width_m)
    ]
    return replace(
        wall,
        id="facade",
        start=(0.0, 0.0),
        end=(width_m, 0.0),
        openings=tuple(openings),
        balconies=tuple(replace(b, x_m=millimetres(b.x_m - left_m)) for b in balconies),
        ornaments=tuple(long_enough),
        outline=None,
    )


def _within(opening: Opening, loggia: Balcony) -> bool:
    middle = opening.x_m + opening.width_m / 2
    height = opening.y_m + opening.height_m / 2
    return (
        loggia.kind == "loggia"
        and loggia.x_m <= middle <= loggia.x_m + loggia.width_m
        and loggia.y_m <= height <= loggia.y_m + loggia.clear_m
    )
