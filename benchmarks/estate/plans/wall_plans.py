"""Walls of 1961-1975 from their bays: rooms, stairwells and balconies repeated storey by storey."""

from __future__ import annotations

import numpy as np
from benchmarks.estate.drawing import millimetres, rng_of
from benchmarks.estate.plan import Balcony, Opening, Wall
from benchmarks.estate.plans.bays import Bay, Levels, Point, Side
from benchmarks.estate.plans.fenestration import (
    WindowType,
    balcony_openings,
    behind,
    entrance,
    store_door,
    window,
)
from benchmarks.estate.plans.looks import Look
from benchmarks.estate.plans.trimmings import trimmings


def wall_of(
    name: str,
    side: Side,
    levels: Levels,
    look: Look,
    seed: int,
    taken_m: tuple[float, float] = (0.0, 0.0),
) -> Wall:
    """The wall of one side with all that it carries.

    Behind the first and the last ``taken_m`` of it lie the loggias of its neighbours, not rooms.
    The drawing of every window's inside depends on ``seed``, the wall's name, storey and bay only.
    """
    width = float(np.hypot(side.end[0] - side.start[0], side.end[1] - side.start[1]))
    gabled = side.gable and look.roof.kind == "gable"
    rise = look.roof.rise_m if gabled else 0.0
    bay_m = width / max(1, len(side.bays))
    rooms = (taken_m[0], width - taken_m[1])
    openings: list[Opening] = []
    balconies: list[Balcony] = []
    for index, bay in enumerate(side.bays):
        centre = (index + 0.5) * bay_m
        if bay.use == "stair":
            openings += _stair(centre, levels, look, rng_of(seed, name, index))
            continue
        if bay.use == "store":
            openings.append(store_door(look.windows, centre))
            continue
        for storey in range(levels.storeys):
            rng = rng_of(seed, name, index, storey)
            if bay.use == "balcony":
                found, balcony = _balcony_bay(bay, centre, bay_m, storey, levels, look, rng)
                openings += found
                balconies += balcony
            else:
                openings += _room(bay, centre, bay_m, rooms, storey, levels, look, rng)
        openings += _low_windows(bay, centre, levels, look, rng_of(seed, name, index, "low"))
    return Wall(
        name,
        side.start,
        side.end,
        millimetres(levels.height_m + rise),
        look.gable_finish if side.gable else look.finish,
        tuple(openings),
        tuple(balconies),
        tuple(trimmings(side, width, levels, look, openings, balconies)),
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
    rooms: tuple[float, float],
    storey: int,
    levels: Levels,
    look: Look,
    rng: np.random.Generator,
) -> list[Opening]:
    """The window, moved to where ``rooms`` begin or end; none where its bay has no place for it."""
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
    moved = float(np.clip(centre, rooms[0] + kind.width_m / 2, rooms[1] - kind.width_m / 2))
    if abs(moved - centre) > (bay_m - kind.width_m) / 2:
        return []
    return [window(windows, kind, moved, sill, behind(rng, bay.use))]


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
    """Door and window, and the balcony or loggia that they open to."""
    style = look.balcony
    floor = levels.floor_m(storey)
    depth = style.depth_m if style.kind == "loggia" else 0.0
    openings = list(balcony_openings(look.windows, centre, floor, depth, bay.mirrored, rng))
    slab = 0.18
    clear = levels.storey_m - (0.24 if style.kind == "loggia" else slab)
    width = bay_m - 0.30 if style.kind == "loggia" else min(bay_m - 0.12, 4.2)
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
