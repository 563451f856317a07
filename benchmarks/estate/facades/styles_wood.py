"""Wooden houses of the north and of America."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from benchmarks.estate.facades.styles_draft import Draft, FacadePlan, axes, choose, near
from benchmarks.estate.facades.styles_parts import (
    WHITE,
    decoys,
    entrance,
    home_window,
    sashes,
)
from benchmarks.estate.plan import Finish, WindowStyle


def timber(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Wooden houses of the north: boards, white trim, small panes."""
    storey = rng.uniform(2.6, 3.0)
    floors = int(np.clip((height_m - 0.9) // storey, 1, 3))
    draft = Draft(rng, min(width_m, rng.uniform(8, 16)), 0.6 + floors * storey)
    walls = [
        (0.48, 0.13, 0.09),
        (0.83, 0.72, 0.42),
        (0.80, 0.80, 0.77),
        (0.35, 0.38, 0.40),
        (0.24, 0.30, 0.24),
        (0.68, 0.74, 0.78),
    ]
    trim = near(rng, choose(rng, [WHITE, WHITE, (0.15, 0.25, 0.2), (0.7, 0.6, 0.4)]))
    style = WindowStyle(
        lights=choose(rng, [(0.5, 0.5), (1.0,), (1 / 3, 1 / 3, 1 / 3)], (5, 2, 1)),
        bars=choose(rng, [(1, 1), (1, 2), (1, 3), (2, 2), (2, 3)]),
        frame_m=round(rng.uniform(0.06, 0.09), 3),
        frame_rgb=trim,
        surround_m=round(rng.uniform(0.08, 0.16), 3),
        surround_rgb=near(rng, trim, 0.02),
    )
    wide, high = rng.uniform(0.9, 1.5), rng.uniform(1.0, 1.5)
    centres = axes(rng, draft.width_m, rng.uniform(2.2, 3.4), choose(rng, ["even", "uneven"]))
    door = int(rng.integers(len(centres)))
    for floor in range(floors):
        for index, centre in enumerate(centres):
            if floor == 0 and index == door:
                entrance(draft, centre, 0.45, 1.0, 2.1, trim)
                continue
            home_window(
                draft,
                centre,
                0.45 + floor * storey + 0.85,
                wide,
                high,
                rng.uniform(0.01, 0.04),
                style,
            )
    for x in (0.0, draft.width_m - 0.16):
        draft.box(x, 0.4, 0.16, draft.height_m - 0.4, 0.03, trim)
    if floors > 1 and rng.random() < 0.5:
        draft.box(0.0, 0.45 + storey - 0.12, draft.width_m, 0.14, 0.03, trim)
    decoys(draft, int(rng.integers(0, 2)))
    finish = Finish(
        "boards", near(rng, choose(rng, walls)), weathering=round(rng.uniform(0.1, 0.9), 2)
    )
    return draft.plan("timber house", finish, 0.45, near(rng, (0.5, 0.5, 0.48)))


def clapboard(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """American frame houses: boards, double-hung windows in trim, fixed shutters."""
    storey = rng.uniform(2.6, 2.9)
    floors = int(np.clip((height_m - 0.9) // storey, 1, 3))
    draft = Draft(rng, min(width_m, rng.uniform(8, 18)), 0.6 + floors * storey + 0.2)
    trim = near(rng, choose(rng, [WHITE, WHITE, (0.3, 0.3, 0.32)]))
    style = sashes(
        rng,
        trim,
        choose(rng, [(1, 1), (2, 1), (2, 2), (3, 2)]),
        surround_m=round(rng.uniform(0.08, 0.13), 3),
    )
    style = replace(
        style,
        surround_rgb=trim,
        shutters=bool(rng.random() < 0.35),
        shutter_rgb=near(rng, choose(rng, [(0.1, 0.15, 0.2), (0.1, 0.25, 0.15), (0.35, 0.1, 0.1)])),
    )
    wide, high = rng.uniform(0.75, 1.0), rng.uniform(1.3, 1.6)
    centres = axes(
        rng, draft.width_m, rng.uniform(2.2, 3.3), choose(rng, ["even", "pairs", "uneven"])
    )
    door = int(rng.integers(len(centres)))
    for floor in range(floors):
        y = 0.5 + floor * storey
        for index, centre in enumerate(centres):
            if floor == 0 and index == door:
                entrance(draft, centre, 0.45, 1.0, 2.1, trim)
            elif rng.random() < 0.15:
                double = replace(style, lights=(0.5, 0.5), shutters=False)
                home_window(draft, centre, y + 0.8, 1.75, high, 0.02, double)
            else:
                home_window(draft, centre, y + 0.8, wide, high, 0.02, style)
    for x in (0.0, draft.width_m - 0.14):
        draft.box(x, 0.4, 0.14, draft.height_m - 0.4, 0.02, trim)
    decoys(draft, int(rng.integers(0, 2)))
    walls = [
        (0.80, 0.80, 0.78),
        (0.62, 0.66, 0.70),
        (0.78, 0.72, 0.56),
        (0.45, 0.52, 0.48),
        (0.55, 0.25, 0.2),
        (0.35, 0.4, 0.46),
    ]
    finish = Finish(
        "boards", near(rng, choose(rng, walls)), weathering=round(rng.uniform(0.0, 0.7), 2)
    )
    return draft.plan("clapboard", finish, 0.4, near(rng, (0.5, 0.46, 0.42)))
