"""Blocks of flats since 1960 beyond Sweden: panels, roller shutters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from benchmarks.estate.facades.styles_draft import Draft, FacadePlan, axes, behind, choose, near
from benchmarks.estate.facades.styles_parts import (
    FRAMES,
    TOWN,
    decoys,
    entrance,
    home_window,
    pipes,
    shutters,
)
from benchmarks.estate.plan import Finish, WindowStyle


def panel_block(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Eastern panel block: mixed frames, balconies glazed by their owners, seams, conditioners."""
    storey = rng.uniform(2.65, 2.85)
    floors = int(np.clip((height_m - 0.8) // storey, 3, 9))
    draft = Draft(rng, width_m, 0.5 + floors * storey + 0.3)
    pitch = rng.uniform(2.9, 3.6)
    centres = axes(rng, width_m, pitch, "even")
    kinds = [choose(rng, ["window", "balcony", "narrow"], (4, 3, 1)) for _ in centres]
    wide, high = rng.uniform(1.3, 2.0), rng.uniform(1.35, 1.55)
    recess = rng.uniform(0.05, 0.15)
    guard = near(rng, choose(rng, [(0.65, 0.63, 0.58), (0.35, 0.5, 0.55), (0.6, 0.4, 0.3)]))
    pitch = width_m / len(centres)
    for floor in range(floors):
        for centre, kind in zip(centres, kinds, strict=True):
            y = 0.5 + floor * storey
            frame = near(rng, choose(rng, FRAMES, (6, 1, 3, 0.5, 1, 0.5, 0.5)))
            style = WindowStyle(
                lights=choose(rng, [(0.5, 0.5), (0.35, 0.65), (1 / 3, 1 / 3, 1 / 3)]),
                frame_m=round(rng.uniform(0.06, 0.11), 3),
                frame_rgb=frame,
                transom=0.75 if rng.random() < 0.2 else None,
            )
            if kind == "balcony" and floor > 0:
                span = pitch - 0.35
                if rng.random() < 0.5:
                    glazing = replace(style, lights=(0.25,) * 4, sill_m=0.0)
                    draft.box(centre - span / 2, y - 0.15, span, 1.08, 0.06, near(rng, guard, 0.12))
                    draft.opening(
                        "window",
                        centre - span / 2,
                        y + 0.95,
                        span,
                        storey - 1.25,
                        0.02,
                        glazing,
                        behind(rng),
                    )
                else:
                    door = replace(style, lights=(1.0,), panel=0.35, sill_m=0.0)
                    draft.balcony(
                        choose(rng, ["solid", "railing"]),
                        centre - span / 2,
                        y,
                        span,
                        0.95,
                        near(rng, guard, 0.1),
                        clear_m=2.4,
                        things=bool(rng.random() < 0.5),
                    )
                    draft.opening(
                        "balcony_door",
                        centre - 1.05,
                        y + 0.08,
                        0.75,
                        0.82 + high,
                        recess,
                        door,
                        behind(rng),
                    )
                    draft.opening(
                        "window",
                        centre - 0.25,
                        y + 0.9,
                        1.2,
                        high,
                        recess,
                        style,
                        behind(rng),
                        gap_m=0.02,
                    )
            else:
                size = 0.9 if kind == "narrow" else wide
                home_window(draft, centre, y + 0.9, size, high, recess, style)
    finish = Finish(
        choose(rng, ["panel", "tiles", "plaster"], (5, 2, 1)),
        near(
            rng,
            choose(
                rng, [(0.7, 0.68, 0.63), (0.78, 0.76, 0.72), (0.62, 0.66, 0.68), (0.74, 0.66, 0.55)]
            ),
        ),
        near(rng, (0.4, 0.39, 0.37)),
        round(rng.uniform(0.4, 1.0), 2),
        (round(pitch, 3), round(storey, 3)),
    )
    decoys(draft, int(rng.integers(1, 5)))
    return draft.plan("panel block", finish, 0.45)


def roller_block(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Swiss and German apartment block: roller shutters at any height, awnings, balconies."""
    storey = rng.uniform(2.65, 2.9)
    base = rng.uniform(0.4, 1.1)
    floors = int(np.clip((height_m - base - 0.3) // storey, 2, 6))
    draft = Draft(rng, width_m, base + floors * storey + 0.35)
    frame = near(rng, choose(rng, FRAMES, (7, 1, 2, 1, 1, 0.5, 1)))
    cloth = near(
        rng,
        choose(rng, [(0.8, 0.45, 0.15), (0.75, 0.7, 0.55), (0.3, 0.45, 0.35), (0.6, 0.2, 0.15)]),
    )
    bays = [
        choose(rng, ["single", "pair", "balcony", "small"], (4, 3, 3, 1))
        for _ in range(max(2, int(width_m / rng.uniform(2.7, 3.8))))
    ]
    pitch = width_m / len(bays)
    recess, high = rng.uniform(0.08, 0.22), rng.uniform(1.2, 1.5)
    kind = choose(rng, ["solid", "railing", "loggia"])
    guard = near(
        rng, choose(rng, [(0.75, 0.74, 0.7), (0.3, 0.3, 0.3), (0.4, 0.5, 0.55), (0.45, 0.35, 0.25)])
    )
    style = WindowStyle(
        lights=(0.5, 0.5),
        frame_m=0.09,
        frame_rgb=frame,
        surround_m=float(rng.choice([0.0, 0.0, 0.1])),
    )
    for floor in range(floors):
        y = base + floor * storey
        for bay, what in enumerate(bays):
            centre = (bay + 0.5) * pitch
            if what == "balcony":
                deep, span = rng.uniform(1.2, 1.7), pitch - 0.25
                inset = deep if kind == "loggia" else 0.0
                draft.balcony(
                    kind,
                    centre - span / 2,
                    y,
                    span,
                    deep,
                    guard,
                    clear_m=round(storey - 0.22, 3),
                    things=bool(rng.random() < 0.5),
                )
                door = replace(style, lights=(1.0,), sill_m=0.0, surround_m=0.0)
                draft.opening(
                    "balcony_door",
                    centre - 0.95,
                    y + 0.05,
                    0.85,
                    2.15,
                    recess,
                    door,
                    behind(rng),
                    inset,
                )
                draft.opening("window", centre, y + 0.9, 1.0, 1.3, recess, door, behind(rng), inset)
                if kind != "loggia" and rng.random() < 0.35:
                    draft.extra(
                        "awning",
                        (centre - span / 2, y + 1.55, centre + span / 2, y + 2.3),
                        cloth,
                        out_m=1.2,
                    )
            elif what == "pair":
                for move in (-0.23 * pitch, 0.23 * pitch):
                    home_window(
                        draft,
                        centre + move,
                        y + 0.9,
                        0.95,
                        high,
                        recess,
                        replace(style, lights=(1.0,)),
                    )
            else:
                size = 0.65 if what == "small" else min(1.8, pitch - 0.6)
                home_window(
                    draft,
                    centre,
                    y + 0.9,
                    size,
                    high,
                    recess,
                    replace(style, lights=(1.0,) if size < 0.9 else (0.5, 0.5)),
                )
    shutters(
        draft,
        near(
            rng,
            choose(rng, [(0.75, 0.74, 0.72), (0.5, 0.5, 0.5), (0.35, 0.28, 0.2), (0.55, 0.5, 0.4)]),
        ),
        rng.uniform(0.1, 0.7),
        roller=True,
    )
    if rng.random() < 0.5:
        entrance(draft, 0.5 * pitch + pitch * int(rng.integers(len(bays))), 0.03, 1.1, 2.1, frame)
    pipes(draft, int(rng.integers(0, 3)), near(rng, (0.45, 0.4, 0.35)))
    decoys(draft, int(rng.integers(0, 4)))
    finish = Finish(
        "plaster", near(rng, choose(rng, TOWN)), weathering=round(rng.uniform(0.0, 0.7), 2)
    )
    return draft.plan("roller block", finish, base - 0.1)
