"""Looks of surveyed buildings, which have none: plaster, frames, surrounds, pipes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from benchmarks.estate.drawing import millimetres, pick
from benchmarks.estate.plan import Behind, Finish, Opening, OpeningKind, Ornament, Rgb, WindowStyle
from benchmarks.estate.plans.citygml_walls import FoundOpening

PLASTERS: tuple[Rgb, ...] = (
    (0.86, 0.82, 0.72),
    (0.84, 0.75, 0.58),
    (0.80, 0.71, 0.62),
    (0.88, 0.86, 0.82),
    (0.72, 0.76, 0.70),
    (0.78, 0.66, 0.55),
    (0.70, 0.74, 0.78),
    (0.83, 0.72, 0.68),
)
BRICKS: tuple[Rgb, ...] = ((0.55, 0.30, 0.22), (0.62, 0.42, 0.30))
STONES: tuple[Rgb, ...] = ((0.68, 0.64, 0.56), (0.60, 0.58, 0.54))
FRAMES: tuple[Rgb, ...] = ((0.90, 0.90, 0.88), (0.36, 0.24, 0.16), (0.30, 0.32, 0.33))
TILES: tuple[Rgb, ...] = ((0.45, 0.22, 0.15), (0.38, 0.20, 0.15), (0.30, 0.27, 0.26))
PIPE_M = 0.1


@dataclass(frozen=True)
class Look:
    """What the walls and windows of one building share."""

    finish: Finish
    year: int
    plinth_m: float
    plinth_rgb: Rgb
    roof_rgb: Rgb
    frame_rgb: Rgb
    frame_m: float
    bars: tuple[int, int]
    transom: float | None
    sill_m: float
    surround_m: float
    surround_rgb: Rgb
    shutters: bool
    shutter_rgb: Rgb
    cornice: bool
    recess_m: float
    door_rgb: Rgb


def drawn_look(rng: np.random.Generator, openings: Sequence[FoundOpening]) -> Look:
    """A look for a building; bands and shutters only where they leave the openings free."""

    kind = rng.choice(["plaster", "brick", "stone"], p=[0.84, 0.1, 0.06])
    rgb = pick(rng, {"plaster": PLASTERS, "brick": BRICKS, "stone": STONES}[str(kind)])
    shade = rng.uniform(0.94, 1.04)
    tuned = tuple(round(float(min(value * shade, 1.0)), 3) for value in rgb)
    lowest = min((o.y_m for o in openings if o.kind == "window"), default=1.0)
    plinth = rng.uniform(0.3, 0.7)
    surround = rng.uniform() < 0.45 and kind == "plaster"
    shutters = rng.uniform() < 0.2 and _room_m(openings) > 0.9
    return Look(
        finish=Finish(str(kind), tuned, weathering=round(float(rng.uniform(0.1, 0.6)), 2)),
        year=int(rng.integers(1880, 1990)),
        plinth_m=millimetres(plinth) if plinth < lowest - 0.05 else 0.0,
        plinth_rgb=(0.42, 0.40, 0.38),
        roof_rgb=pick(rng, TILES),
        frame_rgb=FRAMES[int(rng.choice(3, p=[0.72, 0.2, 0.08]))],
        frame_m=millimetres(rng.uniform(0.07, 0.11)),
        bars=((1, 1), (1, 2), (1, 3))[int(rng.choice(3, p=[0.7, 0.15, 0.15]))],
        transom=0.72 if rng.uniform() < 0.2 else None,
        sill_m=millimetres(rng.uniform(0.03, 0.08)),
        surround_m=millimetres(rng.uniform(0.08, 0.14))
        if surround and _room_m(openings) > 0.4
        else 0.0,
        surround_rgb=(0.88, 0.86, 0.80),
        shutters=bool(shutters),
        shutter_rgb=((0.22, 0.33, 0.26), (0.35, 0.22, 0.15))[int(rng.integers(2))],
        cornice=bool(rng.uniform() < 0.5),
        recess_m=millimetres(rng.uniform(0.08, 0.2)),
        door_rgb=FRAMES[int(rng.integers(1, 3))],
    )


def finished_opening(found: FoundOpening, look: Look, rng: np.random.Generator) -> Opening:
    """The opening with frame, panes and what is behind them."""
    door = found.kind == "door"
    on_ground = found.y_m < 1.0
    kind: OpeningKind = "window" if not door else "door" if on_ground else "balcony_door"
    count = 1 if found.width_m < 0.8 else 2 if found.width_m < 1.9 else round(found.width_m / 0.9)
    if door:
        count = 1 if found.width_m < 1.5 else 2
    tall = found.height_m > 1.1 * min(found.width_m, 1.2)
    small = min(found.width_m, found.height_m) < 0.7
    style = WindowStyle(
        lights=(1 / count,) * count,
        transom=look.transom if tall and not small and not door else None,
        panel=0.6 if kind == "door" else 0.0,
        bars=(1, 1) if door or small else look.bars,
        frame_m=min(look.frame_m, millimetres(found.width_m / count / 5)),
        frame_rgb=look.door_rgb if kind == "door" else look.frame_rgb,
        sill_m=0.0 if found.y_m < 0.3 else look.sill_m,
        surround_m=0.0 if small or found.y_m < look.surround_m + 0.1 else look.surround_m,
        surround_rgb=look.surround_rgb,
        shutters=look.shutters and not door and not small and 0.7 < found.width_m < 1.6,
        shutter_rgb=look.shutter_rgb,
        arch=found.arch,
    )
    bare = rng.uniform() < 0.25
    behind = Behind(
        curtain=0.0 if bare else round(float(rng.uniform(0.15, 0.7)), 2),
        curtain_rgb=(0.86, 0.85, 0.81),
        blind=round(float(rng.uniform(0.1, 0.6)), 2) if rng.uniform() < 0.25 else 0.0,
        light=round(float(rng.uniform(0.2, 0.8)), 2) if rng.uniform() < 0.1 else 0.0,
        things=bool(rng.uniform() < 0.35),
    )
    return Opening(
        kind,
        millimetres(found.x_m),
        millimetres(found.y_m),
        millimetres(found.width_m),
        millimetres(found.height_m),
        millimetres(look.recess_m if found.recess_m is None else found.recess_m),
        style,
        behind,
    )


def wall_extras(
    width_m: float, eaves_m: float, openings: Sequence[Opening], look: Look
) -> tuple[Ornament, ...]:
    """A cornice below the eaves and a downpipe near an end, where no opening is in the way."""
    extras = []
    top_m = max((o.y_m + o.height_m for o in openings), default=0.0)
    if look.cornice and width_m > 3 and top_m < eaves_m - 0.45:
        extras.append(
            Ornament("box", 0.0, millimetres(eaves_m - 0.25), width_m, 0.2, 0.1,
                     material="painted", rgb=look.surround_rgb)
        )  # fmt: skip
    for x_m in (0.2, width_m - 0.2 - PIPE_M):
        free = all(x_m + PIPE_M + 0.1 < o.x_m or o.x_m + o.width_m < x_m - 0.1 for o in openings)
        if width_m > 5 and openings and free:
            extras.append(
                Ornament("pipe", millimetres(x_m), 0.0, PIPE_M, millimetres(eaves_m - 0.3), PIPE_M,
                         0.03, material="zinc", rgb=(0.45, 0.46, 0.46))
            )  # fmt: skip
            break
    return tuple(extras)


def _room_m(openings: Sequence[FoundOpening]) -> float:
    """Least clear width between two openings side by side."""
    gaps = [
        b.x_m - a.x_m - a.width_m
        for a in openings
        for b in openings
        if a.x_m + a.width_m <= b.x_m and a.y_m < b.y_m + b.height_m and b.y_m < a.y_m + a.height_m
    ]
    return min(gaps, default=10.0)
