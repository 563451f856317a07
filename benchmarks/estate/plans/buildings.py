"""Buildings of the Swedish Million Programme, and the paper's three by their published numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from benchmarks.estate.drawing import between, millimetres, pick, rng_of
from benchmarks.estate.plan import BalconyKind, Building, FinishKind
from benchmarks.estate.plans.bays import Bay, Levels, Point, Side, bays_of
from benchmarks.estate.plans.looks import Look, look_of
from benchmarks.estate.plans.wall_plans import wall_of
from benchmarks.estate.site.neighbours import NeighbourPlace

# Per number of bays: the sides of one landing with the stairs and with the balconies.
STAIR_UNITS = {
    3: ("bSk",),
    4: ("bSkb", "bkSb"),
    5: ("bkSkb", "kbSbk"),
    6: ("bkStkb", "btSkbb", "bbSkkb"),
    7: ("bbkSkbb", "bktStkb"),
}
BALCONY_UNITS = {
    3: ("bBb",),
    4: ("BbbB", "bBBb"),
    5: ("bBbBb", "BbbbB", "BblbB"),
    6: ("bBbbBb", "BblbbB"),
    7: ("bbBbBbb", "bBbbbBb"),
}

CORNER_WALL_M = 0.25  # between a loggia and the room beside it


@dataclass(frozen=True)
class Slab:
    """What a slab block is: lengths in metres, bays per landing from the start of its front.

    ``front`` is the side that edge 0 of the footprint gets. ``gables`` are the bays of the gables,
    right one first; empty ones have no windows.
    """

    length_m: float
    depth_m: float
    units: tuple[int, ...]
    levels: Levels
    front: Literal["stairs", "balconies"] = "stairs"
    gables: tuple[str, str] = ("", "")
    roof: Literal["flat", "gable", "any"] = "any"
    finishes: tuple[FinishKind, ...] = ("brick", "plaster", "panel")
    balconies: tuple[BalconyKind, ...] = ("solid", "railing", "loggia")


@dataclass(frozen=True)
class HalfSize:
    """One half of a point block, and how far the other one is shifted along it, metres."""

    width_m: float
    depth_m: float
    shift_m: float


def slab_block(name: str, slab: Slab, seed: int) -> Building:
    """A slab with stairs on one long side and balconies on the other.

    Its front, edge 0 of the footprint, lies on the x axis, centred on x = 0, and faces -y.
    """
    rng = rng_of(seed, name)
    look = _look(rng, slab.length_m / sum(slab.units), slab.levels, slab)
    plans = {
        unit: (pick(rng, STAIR_UNITS[unit]), pick(rng, BALCONY_UNITS[unit]))
        for unit in sorted(set(slab.units))
    }
    stairs = bays_of(*(plans[unit][0] for unit in slab.units))
    balconies = bays_of(*(plans[unit][1] for unit in slab.units))
    front, back = (stairs, balconies) if slab.front == "stairs" else (balconies, stairs)
    left, right, depth = -slab.length_m / 2, slab.length_m / 2, slab.depth_m
    sides = (
        Side((left, 0.0), (right, 0.0), front),
        Side((right, 0.0), (right, depth), bays_of(slab.gables[0]), gable=True),
        Side((right, depth), (left, depth), tuple(bay for bay in back[::-1])),
        Side((left, depth), (left, 0.0), bays_of(slab.gables[1]), gable=True),
    )
    return _house(name, sides, slab.levels, look, seed)


def neighbour_slab(name: str, place: NeighbourPlace, rng: np.random.Generator) -> Building:
    """A slab on its place in the world; more than half have the skin of the building it is like."""
    bays = max(3, round(place.length_m / between(rng, 2.8, 3.4, 0.1)))
    storey, ground = 2.75, pick(rng, (0.5, 0.7, 1.0))
    levels = Levels(
        ground, storey, place.storeys, millimetres(ground + place.storeys * storey + 0.35)
    )
    slab = Slab(
        place.length_m,
        place.depth_m,
        _units(bays),
        levels,
        pick(rng, ("stairs", "balconies")),
        (pick(rng, ("", "-b-")), pick(rng, ("", "-b-"))),
        "any" if place.storeys < 5 else "flat",
    )
    building = slab_block(name, slab, int(rng.integers(1 << 31)))
    if rng.random() < 0.6:
        skin = place.like.walls[0].finish
        walls = tuple(replace(wall, finish=skin) for wall in building.walls)
        building = replace(building, walls=walls)
    turn_deg = 90.0 - place.along_deg
    back = turned((0.0, place.depth_m / 2), turn_deg, (0.0, 0.0))
    return moved(building, turn_deg, (place.centre[0] - back[0], place.centre[1] - back[1]))


def _units(bays: int) -> tuple[int, ...]:
    """Landings of about 5 bays that make up so many."""
    count = max(1, round(bays / 5))
    return tuple(bays // count + (index < bays % count) for index in range(count))


def point_block(name: str, seed: int) -> Building:
    """An indented point block of 8 storeys: two halves that are shifted against each other."""
    rng = rng_of(seed, name, "size")
    width, half, shift = (
        between(rng, 13.6, 16.0, 0.4),
        between(rng, 8.0, 9.6, 0.4),
        between(rng, 3.2, 4.4, 0.4),
    )
    storey = between(rng, 2.70, 2.80, 0.1)
    ground = between(rng, 0.45, 0.75)
    levels = Levels(ground, storey, 8, millimetres(ground + 8 * storey + 0.30))
    return _shifted_halves(name, HalfSize(width, half, shift), levels, seed)


def b1(seed: int) -> Building:
    """The paper's B1: 23.2 m high, longest side 14.9 m, 8 facades; an indented point block."""
    return _shifted_halves("b1", HalfSize(14.9, 9.0, 4.0), Levels(0.5, 2.8, 8, 23.2), seed)


def b2(seed: int) -> Building:
    """The paper's B2: 22.7 m high, longest side 35.2 m, 4 facades; a high slab."""
    rng = rng_of(seed, "b2", "gables")
    return slab_block(
        "b2",
        Slab(
            35.2,
            12.4,
            (5, 5),
            Levels(0.7, 2.7, 8, 22.7),
            "balconies",
            (pick(rng, ("b--b", "bkb", "l-b")), pick(rng, ("-b-", "b--", "-k-"))),
            "flat",
            ("panel", "brick", "panel"),
        ),
        seed,
    )


def b3(seed: int) -> Building:
    """The paper's B3: 11.0 m high, longest side 71.6 m, 6 facades; three storeys, one step.

    Edge 0 is the deeper part's front, edge 1 the step; balconies face -y, entrances the long back.
    """
    rng = rng_of(seed, "b3")
    levels = Levels(1.2, 2.8, 3, 11.0)
    module = 71.6 / 25
    look = _look(rng, module, levels, Slab(71.6, 12.6, (5,) * 5, levels, roof="flat"))
    stairs, front = pick(rng, STAIR_UNITS[5]), pick(rng, BALCONY_UNITS[5])
    short, depth, step = int(rng.integers(2, 4)), 11.2, between(rng, 1.8, 2.6, 0.2)
    split = millimetres(5 * short * module)
    sides = (
        Side((0.0, -step), (split, -step), bays_of(*[front] * short)),
        Side((split, -step), (split, 0.0), ()),
        Side((split, 0.0), (71.6, 0.0), bays_of(*[front] * (5 - short))),
        Side((71.6, 0.0), (71.6, depth), bays_of("-b-" if rng.integers(2) else "b-b"), gable=True),
        Side((71.6, depth), (0.0, depth), bays_of(*[stairs] * 5)),
        Side((0.0, depth), (0.0, -step), bays_of(pick(rng, ("", "---s"))), gable=True),
    )
    return _house("b3", sides, levels, look, seed)


def moved(building: Building, turn_deg: float, to: Point) -> Building:
    """The building turned counter-clockwise about the origin and moved there."""
    walls = tuple(
        replace(wall, start=turned(wall.start, turn_deg, to), end=turned(wall.end, turn_deg, to))
        for wall in building.walls
    )
    return replace(building, walls=walls)


def turned(point: Point, turn_deg: float, to: Point) -> Point:
    """A point turned counter-clockwise about the origin and moved by ``to``, to a micrometre."""
    angle = np.deg2rad(turn_deg)
    x, y = point
    return (
        round(float(np.cos(angle) * x - np.sin(angle) * y + to[0]), 6),
        round(float(np.sin(angle) * x + np.cos(angle) * y + to[1]), 6),
    )


def _look(rng: np.random.Generator, module_m: float, levels: Levels, slab: Slab) -> Look:
    return look_of(
        rng,
        (millimetres(module_m), levels.storey_m),
        kinds=slab.finishes,
        roof=slab.roof,
        balconies=slab.balconies,
    )


def _shifted_halves(name: str, size: HalfSize, levels: Levels, seed: int) -> Building:
    """A point block of two halves; its entrance is in the indent at the right."""
    rng = rng_of(seed, name)
    width, half, shift = size.width_m, size.depth_m, size.shift_m
    look = look_of(rng, (millimetres(width / 5), levels.storey_m), roof="flat")
    long_side = pick(rng, ("bBkBb", "BbkbB", "BbbkB"))
    flank = pick(rng, ("b-b", "btb", "k-b"))
    back = 2 * half
    sides = (
        Side((0.0, 0.0), (width, 0.0), bays_of(long_side)),
        Side((width, 0.0), (width, half), bays_of(flank)),
        Side((width, half), (width + shift, half), bays_of("S")),
        Side((width + shift, half), (width + shift, back), bays_of(flank)),
        Side((width + shift, back), (shift, back), bays_of(long_side)),
        Side((shift, back), (shift, half), bays_of(flank)),
        Side((shift, half), (0.0, half), bays_of("k")),
        Side((0.0, half), (0.0, 0.0), bays_of(flank)),
    )
    return _house(name, sides, levels, look, seed)


def _house(name: str, sides: Sequence[Side], levels: Levels, look: Look, seed: int) -> Building:
    walls = []
    for index, side in enumerate(sides):
        before, after = sides[index - 1], sides[(index + 1) % len(sides)]
        taken_m = (
            _loggia_m(before, side, before.bays[-1:], look),
            _loggia_m(side, after, after.bays[:1], look),
        )
        walls.append(wall_of(f"{name}-{index}", side, levels, look, seed, taken_m))
    return Building(
        name, tuple(walls), levels.height_m, levels.storeys, levels.storey_m, look.year, look.roof
    )


def _loggia_m(first: Side, second: Side, at_corner: Sequence[Bay], look: Look) -> float:
    """How far a bay at the corner of two sides reaches behind the other one: a loggia's depth."""
    (ax, ay), (bx, by), (cx, cy) = first.start, first.end, second.end
    outward = (bx - ax) * (cy - by) - (by - ay) * (cx - bx) > 0
    loggia = look.balcony.kind == "loggia" and any(bay.use == "balcony" for bay in at_corner)
    return look.balcony.depth_m + CORNER_WALL_M if outward and loggia else 0.0
