"""Walls of 1961-1975 from their bays: rooms, stairwells and balconies repeated storey by storey."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from benchmarks.estate.fenestration import (
    Use,
    WindowType,
    balcony_openings,
    behind,
    entrance,
    window,
)
from benchmarks.estate.looks import Look
from benchmarks.estate.plan import (
    Balcony,
    Opening,
    Ornament,
    Wall,
    millimetres,
    rng_of,
)

Point = tuple[float, float]
CANOPY_Y_M = 2.32
CONCRETE = (0.55, 0.54, 0.51)
PIPE_M = 0.10


@dataclass(frozen=True)
class Levels:
    """Heights of one house: floor of the ground storey, storeys, top of its walls, metres."""

    ground_m: float
    storey_m: float
    storeys: int
    height_m: float

    def floor_m(self, storey: float) -> float:
        """Floor of a storey (0 = ground storey; halves are landings) above the ground."""
        return millimetres(self.ground_m + storey * self.storey_m)

    @property
    def plinth_m(self) -> float:
        """Top of the plinth."""
        return millimetres(max(0.25, self.ground_m - 0.05))

    @property
    def attic_m(self) -> float:
        """Height of the wall above the ceiling of the top storey."""
        return millimetres(self.height_m - self.floor_m(self.storeys))


@dataclass(frozen=True)
class Bay:
    """One room's width of a wall; ``mirrored`` in the second flat of a landing."""

    use: Use
    mirrored: bool = False


@dataclass(frozen=True)
class Side:
    """One side of a house: from ``start`` to ``end``, divided evenly into bays."""

    start: Point
    end: Point
    bays: tuple[Bay, ...]
    gable: bool = False


def bays_of(*units: str) -> tuple[Bay, ...]:
    """Bays from letters: b bed, k kitchen, l living, t bath, B balcony, S stair, s store, - none.

    Every unit is one landing with two flats; the second half is mirrored.

    >>> [bay.use for bay in bays_of("bSb")]
    ['bed', 'stair', 'bed']
    """
    uses: dict[str, Use] = {
        "b": "bed",
        "k": "kitchen",
        "l": "living",
        "t": "bath",
        "B": "balcony",
        "S": "stair",
        "s": "store",
        "-": "blank",
    }
    return tuple(
        Bay(uses[letter], 2 * index >= len(unit))
        for unit in units
        for index, letter in enumerate(unit)
    )


def wall_of(name: str, side: Side, levels: Levels, look: Look, seed: int) -> Wall:
    """The wall of one side with all that it carries.

    The drawing of every window's inside depends on ``seed``, the wall's name, storey and bay only.
    """
    width = float(np.hypot(side.end[0] - side.start[0], side.end[1] - side.start[1]))
    gabled = side.gable and look.roof.kind == "gable"
    rise = look.roof.rise_m if gabled else 0.0
    bay_m = width / max(1, len(side.bays))
    openings: list[Opening] = []
    balconies: list[Balcony] = []
    ornaments: list[Ornament] = []
    for index, bay in enumerate(side.bays):
        centre = (index + 0.5) * bay_m
        if bay.use == "stair":
            openings += _stair(centre, levels, look, rng_of(seed, name, index))
            ornaments += _porch(centre, look)
            continue
        for storey in range(levels.storeys):
            rng = rng_of(seed, name, index, storey)
            if bay.use == "balcony":
                found, balcony = _balcony_bay(bay, centre, bay_m, storey, levels, look, rng)
                openings += found
                balconies += balcony
            else:
                openings += _room(bay, centre, bay_m, storey, levels, look, rng)
        openings += _low_windows(bay, centre, levels, look, rng_of(seed, name, index, "low"))
    if gabled:
        openings.append(
            window(
                look.windows,
                look.windows.low,
                width / 2,
                levels.height_m + 0.15,
                behind(rng_of(seed, name, "attic"), "store"),
            )
        )
    ornaments += _extras(width, bay_m, side, levels, look, openings, balconies)
    return Wall(
        name,
        side.start,
        side.end,
        millimetres(levels.height_m + rise),
        look.gable_finish if side.gable else look.finish,
        tuple(openings),
        tuple(balconies),
        tuple(ornaments),
        levels.plinth_m,
        look.plinth_rgb,
        _gable_outline(width, levels.height_m, rise) if gabled else None,
    )


def _gable_outline(width: float, eaves_m: float, rise_m: float) -> tuple[Point, ...]:
    top = millimetres(eaves_m + rise_m)
    return ((0.0, 0.0), (width, 0.0), (width, eaves_m), (width / 2, top), (0.0, eaves_m))


def _room(
    bay: Bay,
    centre: float,
    bay_m: float,
    storey: int,
    levels: Levels,
    look: Look,
    rng: np.random.Generator,
) -> list[Opening]:
    windows = look.windows
    kinds = {
        "bed": windows.bed,
        "kitchen": windows.kitchen,
        "living": windows.living,
        "bath": windows.bath,
    }
    if bay.use not in kinds:
        return []
    kind = _fitted(kinds[bay.use].mirrored if bay.mirrored else kinds[bay.use], bay_m)
    sill = levels.floor_m(storey) + windows.head_m - kind.height_m
    return [window(windows, kind, centre, sill, behind(rng, bay.use))]


def _fitted(kind: WindowType, bay_m: float) -> WindowType:
    """The type, narrower where the bay is narrow."""
    width = min(kind.width_m, millimetres(round((bay_m - 0.7) / 0.05) * 0.05))
    return WindowType(width, kind.height_m, kind.lights, kind.transom)


def _balcony_bay(
    bay: Bay,
    centre: float,
    bay_m: float,
    storey: int,
    levels: Levels,
    look: Look,
    rng: np.random.Generator,
) -> tuple[list[Opening], list[Balcony]]:
    """Door and window, and the balcony or loggia that they open to; a terrace has no balcony."""
    style = look.balcony
    floor = levels.floor_m(storey)
    depth = style.depth_m if style.kind == "loggia" else 0.0
    openings = list(balcony_openings(look.windows, centre, floor, depth, bay.mirrored, rng))
    slab = 0.18
    clear = levels.storey_m - (0.24 if style.kind == "loggia" else slab)
    width = bay_m - 0.30 if style.kind == "loggia" else min(bay_m - 0.12, 4.2)
    if storey == 0 and levels.ground_m < 0.55 and style.kind != "loggia":
        return openings, []
    return openings, [
        Balcony(
            style.kind,
            millimetres(centre - width / 2),
            floor,
            millimetres(width),
            style.depth_m,
            millimetres(clear),
            style.guard_m,
            slab,
            style.rgb,
            style.side_walls,
            bool(rng.random() < 0.6),
        )
    ]


def _low_windows(
    bay: Bay, centre: float, levels: Levels, look: Look, rng: np.random.Generator
) -> list[Opening]:
    """Basement windows in a high plinth and attic windows in a high strip below the eaves."""
    kind = look.windows.low
    found = []
    if levels.plinth_m >= 0.9 and bay.use in {"bed", "kitchen", "store"}:
        lower = levels.plinth_m - 0.12 - kind.height_m
        found.append(window(look.windows, kind, centre, lower, behind(rng, "store"), sill=False))
    if levels.attic_m >= 1.0 and bay.use in {"bed", "kitchen", "living", "balcony"}:
        lower = levels.floor_m(levels.storeys) + 0.40
        found.append(window(look.windows, kind, centre, lower, behind(rng, "store")))
    return found


def _stair(centre: float, levels: Levels, look: Look, rng: np.random.Generator) -> list[Opening]:
    """The entrance and the windows of the landings above it."""
    windows = look.windows
    kind = windows.stair_window
    found = [entrance(windows, centre)]
    for storey in range(levels.storeys - 1):
        if windows.stair == "strip":
            lower = levels.floor_m(storey + 1) + 0.20
        else:
            lower = levels.floor_m(storey + 0.5) + 0.90
        found.append(window(windows, kind, centre, lower, behind(rng, "stair")))
    return found


def _porch(centre: float, look: Look) -> list[Ornament]:
    """Canopy, step, lamp and house number of an entrance."""
    half = look.windows.entrance_width_m / 2

    def box(
        x: float, y: float, width: float, height: float, out: float, rgb: tuple[float, float, float]
    ) -> Ornament:
        return Ornament(
            "box",
            millimetres(x),
            millimetres(y),
            millimetres(width),
            millimetres(height),
            millimetres(out),
            rgb=rgb,
        )

    return [
        box(centre - half - 0.35, CANOPY_Y_M, 2 * half + 0.70, 0.14, 1.20, look.metal_rgb),
        box(centre - half - 0.25, 0.0, 2 * half + 0.50, 0.12, 1.25, CONCRETE),
        box(centre + half + 0.18, 1.85, 0.16, 0.22, 0.14, (0.90, 0.89, 0.85)),
        box(centre + half + 0.15, 1.50, 0.22, 0.20, 0.02, (0.12, 0.16, 0.30)),
    ]


def _extras(
    width: float,
    bay_m: float,
    side: Side,
    levels: Levels,
    look: Look,
    openings: Sequence[Opening],
    balconies: Sequence[Balcony],
) -> list[Ornament]:
    """Downpipes, aprons, vents and a meter cabinet, where nothing is in their way."""
    found: list[Ornament] = []
    blocked = [(o.x_m - 0.06, o.x_m + o.width_m + 0.06) for o in openings] + [
        (b.x_m - 0.02, b.x_m + b.width_m + 0.02) for b in balconies
    ]

    def free(left: float, right: float) -> bool:
        return (
            left > 0.02
            and right < width - 0.02
            and all(right < low or left > high for low, high in blocked)
        )

    if look.downpipes and not side.gable and len(side.bays) > 1:
        for place in (
            0.35,
            *(bay_m * index for index in range(6, len(side.bays) - 3, 6)),
            width - 0.35,
        ):
            left = millimetres(place - PIPE_M / 2)
            if free(left - 0.02, left + PIPE_M + 0.02):
                height = millimetres(levels.height_m - 0.10)
                found.append(
                    Ornament("pipe", left, 0.05, PIPE_M, height, PIPE_M, 0.04, rgb=look.metal_rgb)
                )
    for index, bay in enumerate(side.bays):
        centre = (index + 0.5) * bay_m
        if bay.use == "stair":
            left = millimetres(centre - look.windows.entrance_width_m / 2 - 0.95)
            if free(left, left + 0.5):
                found.append(Ornament("box", left, 0.55, 0.50, 0.75, 0.12, rgb=(0.58, 0.59, 0.57)))
        if bay.use not in {"kitchen", "bath"}:
            continue
        left = millimetres(centre + (-1 if bay.mirrored else 1) * (bay_m / 2 - 0.35) - 0.10)
        if free(left, left + 0.20):
            found += [
                Ornament(
                    "box",
                    left,
                    millimetres(levels.floor_m(storey) + 2.25),
                    0.20,
                    0.15,
                    0.02,
                    rgb=(0.66, 0.66, 0.64),
                )
                for storey in range(levels.storeys)
            ]
    if look.apron_rgb is not None and not side.gable:
        found += _aprons(levels, look, openings)
    return found


def _aprons(levels: Levels, look: Look, openings: Sequence[Opening]) -> list[Ornament]:
    """Coloured boards between the floor and the windows of beds and kitchens."""
    assert look.apron_rgb is not None
    found = []
    for opening in openings:
        storey = int((opening.y_m - levels.ground_m) // levels.storey_m)
        if opening.kind != "window" or opening.depth_m or not 0 <= storey < levels.storeys:
            continue
        lower = levels.floor_m(storey) + 0.08
        height = millimetres(opening.y_m - 0.06 - lower)
        if opening.width_m < 1.0 or not 0.5 < height < 1.1:
            continue
        found.append(
            Ornament(
                "box",
                opening.x_m,
                millimetres(lower),
                opening.width_m,
                height,
                0.015,
                rgb=look.apron_rgb,
            )
        )
    return found
