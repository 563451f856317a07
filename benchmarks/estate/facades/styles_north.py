"""Facades of the north: Million Programme, plaster of the 1930s to 1950s."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from benchmarks.estate.facades.styles_draft import Draft, FacadePlan, axes, behind, choose, near
from benchmarks.estate.facades.styles_parts import (
    FRAMES,
    WHITE,
    decoys,
    entrance,
    home_window,
    pipes,
)
from benchmarks.estate.plan import Finish, Rgb, WindowStyle

MILLION: tuple[Rgb, ...] = (
    (0.72, 0.70, 0.66),
    (0.78, 0.71, 0.55),
    (0.62, 0.36, 0.26),
    (0.66, 0.60, 0.52),
    (0.80, 0.79, 0.75),
    (0.47, 0.30, 0.23),
    (0.83, 0.76, 0.60),
)


PLASTER: tuple[Rgb, ...] = (
    (0.82, 0.70, 0.46),
    (0.76, 0.55, 0.38),
    (0.80, 0.76, 0.66),
    (0.66, 0.68, 0.58),
    (0.72, 0.47, 0.36),
    (0.85, 0.83, 0.78),
    (0.60, 0.66, 0.70),
)


def _casements(rng: np.random.Generator, width: float, frame: Rgb) -> WindowStyle:
    shapes = [(1.0,), (0.5, 0.5), (0.65, 0.35), (0.3, 0.7), (1 / 3, 1 / 3, 1 / 3)]
    first = 0 if width < 1.0 else 1
    lights = choose(rng, shapes[first : first + 1] if width < 1.0 else shapes[1:4])
    if width > 2.0:
        lights = choose(rng, [shapes[4], (0.25, 0.5, 0.25), (0.5, 0.5)])
    return WindowStyle(lights=lights, frame_m=round(rng.uniform(0.07, 0.11), 3), frame_rgb=frame)


def slab(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Slab of the 1960s and 1970s: stairwells, balconies in columns, wide casements, a cellar."""
    storey = rng.uniform(2.6, 2.9)
    cellar = float(choose(rng, [0.3, 0.9, 1.3]))
    floors = int(np.clip((height_m - cellar - 0.4) // storey, 2, 9))
    draft = Draft(rng, width_m, cellar + floors * storey + rng.uniform(0.2, 0.7))
    frame = near(rng, choose(rng, FRAMES, (5, 2, 3, 1, 2, 1, 2)))
    recess, sill = rng.uniform(0.04, 0.2), rng.uniform(0.75, 0.95)
    guard = near(
        rng, choose(rng, [(0.7, 0.7, 0.68), (0.2, 0.4, 0.5), (0.75, 0.5, 0.2), (0.5, 0.2, 0.15)])
    )
    balcony_kind = choose(rng, ["solid", "railing", "loggia"], (5, 2, 3))
    bays = [
        choose(rng, ["balcony", "wide", "pair", "stair", "single"], (4, 4, 3, 1.6, 2))
        for _ in range(max(2, int(width_m / rng.uniform(2.9, 4.2))))
    ]
    pitch = width_m / len(bays)
    wide, single = rng.uniform(1.7, min(2.5, pitch - 0.6)), rng.uniform(0.9, 1.4)
    high = rng.uniform(1.2, 1.5)
    styles = {w: _casements(rng, w, frame) for w in (wide, single, 0.7, 1.2)}
    door = WindowStyle(
        panel=choose(rng, [0.0, 0.35, 0.5]), frame_m=0.1, frame_rgb=frame, sill_m=0.0
    )
    for bay, kind in enumerate(bays):
        centre = (bay + 0.5) * pitch
        for floor in range(floors):
            y = cellar + floor * storey
            if kind == "wide":
                home_window(draft, centre, y + sill, wide, high, recess, styles[wide])
            elif kind == "single":
                home_window(draft, centre, y + sill, single, high, recess, styles[single])
            elif kind == "pair":
                home_window(draft, centre - pitch / 4, y + sill, 0.7, high, recess, styles[0.7])
                home_window(draft, centre + pitch / 5, y + sill, 1.2, high, recess, styles[1.2])
            elif kind == "stair":
                if floor == 0:
                    entrance(draft, centre, max(0.02, cellar - 0.9), 1.2, 2.2, frame)
                else:
                    home_window(draft, centre, y - storey * 0.25, 1.0, 1.3, recess, styles[0.7])
            else:
                _balcony_bay(
                    draft,
                    (centre, y, pitch, storey),
                    balcony_kind,
                    guard,
                    (recess, high, sill),
                    door,
                )
        if cellar > 0.8 and kind != "stair" and rng.random() < 0.7:
            home_window(draft, centre, 0.3, 0.8, min(0.5, cellar - 0.45), 0.08, styles[0.7])
    finish = Finish(
        choose(rng, ["panel", "brick", "plaster"], (4, 3, 3)),
        near(rng, choose(rng, MILLION)),
        near(rng, (0.58, 0.56, 0.53)),
        round(rng.uniform(0.1, 0.9), 2),
        (round(pitch, 3), round(storey, 3)),
    )
    if rng.random() < 0.35:
        _coloured_panels(
            draft, near(rng, choose(rng, [guard, (0.25, 0.27, 0.3), (0.8, 0.8, 0.78)]))
        )
    pipes(draft, int(rng.integers(0, 3)), near(rng, (0.5, 0.5, 0.5)))
    decoys(draft, int(rng.integers(0, 4)))
    return draft.plan("million slab", finish, cellar if cellar > 0.8 else 0.25)


def _balcony_bay(
    draft: Draft,
    bay: tuple[float, float, float, float],
    kind: str,
    guard: Rgb,
    numbers: tuple[float, float, float],
    door: WindowStyle,
) -> None:
    """A balcony door with a window beside it, behind a balcony or in a loggia."""
    rng = draft.rng
    centre, y, pitch, storey = bay
    recess, high, sill = numbers
    width, deep = pitch - 0.3, rng.uniform(1.1, 1.6)
    inset = deep if kind == "loggia" else 0.0
    draft.balcony(
        kind,
        centre - width / 2,
        y,
        width,
        deep,
        guard,
        clear_m=round(storey - 0.25, 3),
        things=bool(rng.random() < 0.4),
        side_walls=bool(kind == "solid" and rng.random() < 0.2),
    )
    left = centre - width / 2 + 0.25
    draft.opening(
        "balcony_door", left, y + 0.08, 0.9, sill + high - 0.08, recess, door, behind(rng), inset
    )
    beside = min(width - 1.5, rng.uniform(1.0, 1.6))
    if beside > 0.6:
        style = replace(door, panel=0.0, sill_m=0.03, lights=(1.0,) if beside < 1.1 else (0.5, 0.5))
        draft.opening(
            "window", left + 0.96, y + sill, beside, high, recess, style, behind(rng), inset, 0.03
        )


def _coloured_panels(draft: Draft, rgb: Rgb) -> None:
    """Sheets between neighbours of one row, and below windows: they make a band, not a window."""
    row = sorted(draft.openings, key=lambda o: (o.y_m, o.x_m))
    for one, other in pairwise(row):
        start, end = one.x_m + one.width_m, other.x_m
        if one.depth_m == other.depth_m == 0 and one.y_m == other.y_m and 0.1 < end - start < 1.8:
            draft.box(start, one.y_m, end - start, min(one.height_m, other.height_m), 0.015, rgb)


def functionalist(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Plaster of the 1930s to 1950s: flush two-light windows, small balconies, quiet walls."""
    storey = rng.uniform(2.8, 3.1)
    base = rng.uniform(0.4, 1.2)
    floors = int(np.clip((height_m - base - 0.3) // storey, 2, 5))
    draft = Draft(rng, width_m, base + floors * storey + rng.uniform(0.2, 0.5))
    frame = near(rng, choose(rng, FRAMES, (6, 3, 2, 0.5, 1, 2, 0.5)))
    band = rng.choice([0.0, 0.0, 0.08, 0.14])
    recess = rng.uniform(0.02, 0.08)
    centres = axes(rng, width_m, rng.uniform(2.2, 3.6), choose(rng, ["even", "pairs", "uneven"]))
    sizes = [choose(rng, [1.0, 1.3, 1.5, 0.75], (2, 3, 2, 1)) for _ in centres]
    balconies = [rng.random() < 0.22 for _ in centres]
    high = rng.uniform(1.25, 1.6)
    style = WindowStyle(
        lights=(0.5, 0.5),
        frame_m=0.09,
        frame_rgb=frame,
        surround_m=float(band),
        bars=choose(rng, [(1, 1), (1, 2), (1, 3)], (6, 1, 1)),
        surround_rgb=near(rng, WHITE),
        transom=0.72 if rng.random() < 0.15 else None,
    )
    guard = near(rng, choose(rng, [(0.2, 0.2, 0.2), (0.7, 0.66, 0.55), (0.3, 0.4, 0.35)]))
    for floor in range(floors):
        y = base + floor * storey
        for centre, size, has in zip(centres, sizes, balconies, strict=True):
            if has and floor > 0:
                wide = rng.uniform(1.7, 2.2)
                kind = choose(rng, ["railing", "solid"])
                draft.balcony(kind, centre - wide / 2, y, wide, 1.0, guard, clear_m=2.5)
                door = replace(style, lights=(1.0,), panel=0.35, sill_m=0.0, surround_m=0.0)
                draft.opening(
                    "balcony_door",
                    centre - 0.42,
                    y + 0.06,
                    0.84,
                    0.85 + high,
                    recess,
                    door,
                    behind(rng),
                )
                continue
            shown = replace(style, lights=(1.0,)) if size < 0.9 else style
            home_window(draft, centre, y + 0.85, size, high, recess, shown)
    if rng.random() < 0.5:
        entrance(draft, (centres[0] + centres[-1]) / 2 + 0.9, 0.05, 1.1, 2.2, frame)
    finish = Finish(
        "plaster", near(rng, choose(rng, PLASTER)), weathering=round(rng.uniform(0.1, 0.8), 2)
    )
    pipes(draft, int(rng.integers(0, 3)), near(rng, (0.45, 0.45, 0.44)))
    decoys(draft, int(rng.integers(0, 4)))
    return draft.plan("functionalist plaster", finish, base - 0.1)
