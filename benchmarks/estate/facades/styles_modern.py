"""Facades since 1950: offices, curtain walls, apartments of today, blank gables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from benchmarks.estate.facades.styles_draft import Draft, FacadePlan, axes, behind, choose, near
from benchmarks.estate.facades.styles_parts import (
    DARK,
    FRAMES,
    IRON,
    WHITE,
    decoys,
    entrance,
    home_window,
    pipes,
)
from benchmarks.estate.plan import Finish, WindowStyle


def ribbon(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Office with ribbon windows between bands, in long strips or in bays."""
    storey = rng.uniform(3.2, 3.8)
    floors = int(np.clip((height_m - 0.3) // storey, 2, 5))
    draft = Draft(rng, width_m, floors * storey + rng.uniform(0.3, 0.9))
    high, sill = rng.uniform(1.3, 2.0), rng.uniform(0.8, 1.0)
    frame = near(rng, choose(rng, [DARK, WHITE, (0.55, 0.56, 0.57), (0.4, 0.2, 0.15)]))
    bay = rng.uniform(2.4, 7.5)
    count = max(1, int(width_m / bay))
    bay, pier = width_m / count, float(choose(rng, [0.15, 0.4, 0.9]))
    light = rng.uniform(0.9, 1.6)
    recess = rng.uniform(0.02, 0.2)
    parts = max(1, int((bay - pier) / light))
    style = WindowStyle(
        lights=(1.0 / parts,) * parts,
        frame_m=round(rng.uniform(0.04, 0.08), 3),
        frame_rgb=frame,
        transom=choose(rng, [None, None, 0.25, 0.75]),
        sill_m=0.02,
    )
    for floor in range(floors):
        blind = behind(rng, home=False)
        for index in range(count):
            inside = blind if rng.random() < 0.6 else behind(rng, home=False)
            draft.opening(
                "window",
                index * bay + pier / 2,
                floor * storey + sill,
                bay - pier,
                high,
                recess,
                style,
                inside,
            )
        if rng.random() < 0.3:
            draft.box(
                0.0,
                floor * storey + sill + high + 0.08,
                draft.width_m,
                0.1,
                rng.uniform(0.1, 0.5),
                frame,
            )
    decoys(draft, int(rng.integers(0, 3)))
    wall = near(
        rng,
        choose(
            rng,
            [
                (0.72, 0.71, 0.68),
                (0.5, 0.5, 0.5),
                (0.55, 0.3, 0.22),
                (0.85, 0.84, 0.82),
                (0.3, 0.36, 0.42),
            ],
        ),
    )
    finish = Finish(
        choose(rng, ["metal", "panel", "brick", "tiles", "stone"]),
        wall,
        near(rng, wall, 0.1),
        round(rng.uniform(0, 0.6), 2),
        (round(bay, 3), round(storey, 3)),
    )
    return draft.plan("ribbon windows", finish)


def curtain(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Curtain wall: a lattice of glass; opaque panels of glass or colour below each window."""
    storey, pitch = rng.uniform(3.2, 3.8), rng.uniform(1.2, 3.0)
    floors = int(np.clip((height_m - 0.2) // storey, 2, 5))
    draft = Draft(rng, width_m, floors * storey + 0.3)
    count = int(width_m / pitch)
    pitch = (width_m - 0.1) / count
    spandrel, bar = rng.uniform(0.6, 1.2), rng.uniform(0.05, 0.12)
    frame = near(rng, choose(rng, [DARK, (0.6, 0.61, 0.62), WHITE]))
    panel = near(
        rng,
        choose(
            rng,
            [
                (0.1, 0.13, 0.15),
                (0.3, 0.42, 0.5),
                (0.55, 0.56, 0.55),
                (0.75, 0.3, 0.2),
                (0.2, 0.35, 0.28),
            ],
        ),
    )
    style = WindowStyle(
        frame_m=round(rng.uniform(0.03, 0.06), 3),
        frame_rgb=frame,
        sill_m=0.0,
        transom=choose(rng, [None, None, 0.3, 0.8]),
    )
    opaque = rng.uniform(0.0, 0.25)
    for floor in range(floors):
        for index in range(count):
            x, y = 0.05 + index * pitch, floor * storey + 0.1
            wide = pitch - bar
            draft.box(x, y, wide, spandrel - bar, 0.012, near(rng, panel, 0.01))
            if rng.random() < opaque:
                draft.box(
                    x, y + spandrel, wide, storey - spandrel - bar, 0.012, near(rng, panel, 0.01)
                )
                continue
            draft.opening(
                "window",
                x,
                y + spandrel,
                wide,
                storey - spandrel - bar,
                0.03,
                style,
                behind(rng, home=False),
                gap_m=0.02,
            )
    if rng.random() < 0.5:
        for index in range(count + 1):
            draft.box(
                0.05 + index * pitch - bar + 0.005,
                0.0,
                bar - 0.01,
                draft.height_m,
                rng.uniform(0.05, 0.2),
                frame,
                over=False,
            )
    return draft.plan(
        "curtain wall",
        Finish("metal", frame, weathering=0.1, module_m=(round(pitch, 3), round(storey, 3))),
    )


def contemporary(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Apartments of today: tall windows out of step, loggias, panels beside the glass."""
    storey = rng.uniform(2.8, 3.1)
    floors = int(np.clip((height_m - 0.4) // storey, 2, 6))
    draft = Draft(rng, width_m, floors * storey + rng.uniform(0.4, 0.9))
    frame = near(rng, choose(rng, [DARK, DARK, (0.4, 0.3, 0.2), WHITE, (0.35, 0.36, 0.36)]))
    panel = near(
        rng,
        choose(rng, [(0.55, 0.38, 0.2), (0.3, 0.3, 0.3), (0.7, 0.6, 0.3), (0.25, 0.4, 0.4), frame]),
    )
    recess = rng.uniform(0.05, 0.3)
    style = WindowStyle(frame_m=round(rng.uniform(0.05, 0.09), 3), frame_rgb=frame, sill_m=0.02)
    columns = axes(rng, width_m, rng.uniform(2.2, 3.6), "even")
    loggia = [rng.random() < 0.2 for _ in columns]
    stacked = rng.random() < 0.4
    guard = near(rng, choose(rng, [(0.5, 0.52, 0.53), IRON, WHITE, panel]))
    pitch = width_m / len(columns)
    for floor in range(floors):
        y = floor * storey + 0.2
        for centre, open_air in zip(columns, loggia, strict=True):
            move = 0.0 if stacked else rng.uniform(-0.25, 0.25) * (pitch - 1.2)
            if open_air:
                kind = choose(rng, ["loggia", "railing", "solid"], (3, 2, 1))
                span, deep = pitch - 0.3, rng.uniform(1.2, 1.8)
                inset = deep if kind == "loggia" else 0.0
                draft.balcony(
                    kind,
                    centre - span / 2,
                    y,
                    span,
                    deep,
                    guard,
                    clear_m=round(storey - 0.3, 3),
                    things=bool(rng.random() < 0.5),
                )
                wide = span - 0.5
                draft.opening(
                    "balcony_door",
                    centre - wide / 2,
                    y + 0.06,
                    wide,
                    2.2,
                    recess,
                    replace(style, lights=(0.4, 0.6), sill_m=0.0),
                    behind(rng),
                    inset,
                )
                continue
            wide = float(choose(rng, [0.7, 0.95, 1.2, 1.8], (2, 3, 2, 1)))
            high = float(choose(rng, [1.4, 1.9, 2.25], (1, 2, 2)))
            x, low = centre + move, y + 2.35 - high
            shown = replace(
                style,
                lights=(0.5, 0.5) if wide > 1.5 else (1.0,),
                transom=choose(rng, [None, None, 0.35]),
            )
            if not home_window(draft, x, low, wide, high, recess, shown):
                continue
            if high > 2 and rng.random() < 0.6:
                draft.balcony(
                    "french", x - wide / 2 - 0.03, low, wide + 0.06, 0.1, guard, clear_m=high
                )
            if rng.random() < 0.35:
                draft.box(x + wide / 2, low, rng.uniform(0.3, 0.7), high, 0.012, panel)
    if rng.random() < 0.4:
        entrance(draft, width_m * rng.uniform(0.2, 0.8), 0.03, 1.3, 2.3, frame)
    decoys(draft, int(rng.integers(0, 3)))
    wall = near(
        rng,
        choose(
            rng,
            [
                (0.86, 0.85, 0.82),
                (0.35, 0.33, 0.32),
                (0.62, 0.5, 0.4),
                (0.5, 0.32, 0.25),
                (0.68, 0.68, 0.66),
                (0.45, 0.3, 0.18),
            ],
        ),
    )
    finish = Finish(
        choose(rng, ["plaster", "brick", "panel", "metal", "boards"], (4, 4, 2, 1, 1)),
        wall,
        near(rng, wall, 0.1),
        round(rng.uniform(0, 0.5), 2),
        (1.2, round(storey, 3)),
    )
    return draft.plan("contemporary", finish)


def gable(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """A wall with few windows or none, and many things that are none."""
    draft = Draft(rng, min(width_m, rng.uniform(8, 14)), height_m - rng.uniform(0.0, 1.5))
    style = WindowStyle(
        lights=choose(rng, [(1.0,), (0.5, 0.5)]), frame_rgb=near(rng, choose(rng, FRAMES))
    )
    storey = rng.uniform(2.7, 3.1)
    if rng.random() < 0.75:
        centre = draft.width_m * rng.uniform(0.2, 0.8)
        for floor in range(int(draft.height_m / storey)):
            if rng.random() < 0.8:
                home_window(
                    draft,
                    centre,
                    0.4 + floor * storey + 0.9,
                    rng.uniform(0.6, 1.2),
                    rng.uniform(0.6, 1.4),
                    rng.uniform(0.04, 0.2),
                    style,
                )
    pipes(draft, 1, near(rng, (0.5, 0.5, 0.5)))
    decoys(draft, int(rng.integers(2, 10)))
    wall = near(
        rng,
        choose(
            rng,
            [
                (0.72, 0.68, 0.6),
                (0.5, 0.26, 0.18),
                (0.8, 0.75, 0.62),
                (0.6, 0.6, 0.58),
                (0.66, 0.5, 0.4),
            ],
        ),
    )
    finish = Finish(
        choose(rng, ["plaster", "brick", "panel", "boards"]),
        wall,
        weathering=round(rng.uniform(0.2, 1.0), 2),
    )
    return draft.plan("blank gable", finish, float(rng.choice([0.0, 0.4])))
