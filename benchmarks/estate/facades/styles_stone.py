"""Facades of masonry streets before 1914: the stone of Paris, the stucco of the Gründerzeit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from benchmarks.estate.facades.styles_draft import Draft, FacadePlan, axes, behind, choose, near
from benchmarks.estate.facades.styles_parts import (
    FRAMES,
    IRON,
    STONE,
    TOWN,
    WHITE,
    cornice,
    decoys,
    entrance,
    head,
    home_window,
    pipes,
    shop_floor,
    shutters,
)
from benchmarks.estate.plan import Finish, Rgb, WindowStyle


def haussmann(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Ashlar with tall casements to the floor, iron guards, long balconies, mouldings, shops."""
    storey, ground = rng.uniform(2.9, 3.4), rng.uniform(3.4, 4.4)
    floors = int(np.clip((height_m - ground - 0.5) // storey, 1, 6))
    draft = Draft(rng, width_m, ground + floors * storey + 0.6)
    stone = near(rng, choose(rng, STONE))
    trim = near(rng, stone, 0.03)
    wide, recess = rng.uniform(1.0, 1.3), rng.uniform(0.15, 0.35)
    style = WindowStyle(
        lights=(0.5, 0.5),
        bars=choose(rng, [(1, 3), (1, 4), (1, 1)]),
        frame_m=0.08,
        frame_rgb=near(rng, choose(rng, [WHITE, (0.75, 0.73, 0.68), (0.3, 0.3, 0.3)])),
        sill_m=0.0,
        surround_m=float(rng.choice([0.0, 0.15, 0.2])),
        surround_depth_m=0.05,
        surround_rgb=trim,
        transom=0.78 if rng.random() < 0.3 else None,
        panel=float(rng.choice([0.0, 0.15, 0.25])),
    )
    centres = axes(rng, width_m, rng.uniform(2.1, 2.9), choose(rng, ["even", "pairs"], (3, 1)))
    if rng.random() < 0.7:
        shop_floor(draft, ground, near(rng, choose(rng, FRAMES)))
    else:
        for index, centre in enumerate(centres):
            if index == len(centres) // 2:
                entrance(draft, centre, 0.02, 1.6, 2.9, choose(rng, FRAMES))
            else:
                home_window(draft, centre, 0.9, wide, 2.0, recess, replace(style, panel=0.0))
    heads = choose(rng, ["none", "straight", "keystone", "triangle"])
    tall_door = rng.random() < 0.5
    for floor in range(floors):
        y = ground + floor * storey
        long_balcony = floor in (1, 4) and rng.random() < 0.7
        if long_balcony:
            draft.balcony(
                "railing", 0.1, y, width_m - 0.2, rng.uniform(0.5, 0.8), IRON, clear_m=2.5
            )
        high = min(storey - 0.75, 2.3 if tall_door or long_balcony else 1.8)
        for centre in centres:
            low = y + (0.06 if long_balcony or tall_door else 0.5)
            kind = "balcony_door" if long_balcony else "window"
            crown = 0.0 if high > 2.1 else float(rng.choice([0.0, 0.0, 0.12]))
            shown = replace(style, arch=crown)
            if not draft.opening(
                kind, centre - wide / 2, low, wide, high, recess, shown, behind(rng)
            ):
                continue
            if not long_balcony:
                draft.balcony(
                    "french",
                    centre - wide / 2 - 0.02,
                    low,
                    wide + 0.04,
                    0.1,
                    IRON,
                    clear_m=high,
                    guard_m=round(rng.uniform(0.75, 0.95), 3),
                )
            top = low + high + style.surround_m
            if floor < 3:
                head(
                    draft,
                    heads,
                    centre - wide / 2 - style.surround_m,
                    top,
                    wide + 2 * style.surround_m,
                    trim,
                )
        cornice(draft, y - 0.32, 0.2, 0.12, trim)
    cornice(draft, draft.height_m - 0.5, 0.5, 0.45, trim)
    if rng.random() < 0.5:
        shutters(draft, near(rng, choose(rng, [WHITE, (0.6, 0.6, 0.58)])), 0.25)
    finish = Finish("stone", stone, near(rng, stone, 0.08), round(rng.uniform(0.1, 0.7), 2))
    return draft.plan("haussmann", finish, 0.0)


def gruenderzeit(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Stucco of 1870 to 1914: surrounds, pediments, bands, a rusticated ground floor."""
    storey, ground = rng.uniform(3.3, 4.0), rng.uniform(3.4, 4.3)
    floors = int(np.clip((height_m - ground - 0.5) // storey, 1, 4))
    draft = Draft(rng, width_m, ground + floors * storey + 0.7)
    wall = near(rng, choose(rng, TOWN))
    trim = near(rng, choose(rng, [wall, WHITE, (0.78, 0.72, 0.60), (0.60, 0.52, 0.42)]))
    wide, recess = rng.uniform(1.0, 1.35), rng.uniform(0.05, 0.25)
    frame = near(rng, choose(rng, FRAMES, (6, 2, 4, 1, 2, 1, 0.3)))
    band = round(rng.uniform(0.12, 0.28), 3)
    style = WindowStyle(
        lights=(0.5, 0.5),
        transom=choose(rng, [0.68, 0.72, 0.75, None]),
        frame_m=0.09,
        bars=choose(rng, [(1, 1), (1, 2), (2, 1)], (5, 1, 1)),
        frame_rgb=frame,
        surround_m=band,
        surround_depth_m=round(rng.uniform(0.03, 0.1), 3),
        surround_rgb=trim,
        sill_m=round(rng.uniform(0.05, 0.14), 3),
    )
    heads = [choose(rng, ["none", "straight", "triangle", "segment", "keystone"]) for _ in range(5)]
    centres = axes(rng, width_m, rng.uniform(2.3, 3.1), choose(rng, ["even", "even", "pairs"]))
    arched = rng.random() < 0.3
    if rng.random() < 0.45:
        shop_floor(draft, ground, frame)
    else:
        door = int(rng.integers(len(centres)))
        for index, centre in enumerate(centres):
            if index == door:
                entrance(draft, centre, 0.05, rng.uniform(1.3, 2.0), 2.8, frame)
            else:
                shown = replace(style, surround_m=0.0, arch=0.25 if arched else 0.0)
                home_window(draft, centre, 1.1, wide, 1.8, recess, shown)
        _rusticated(draft, ground, near(rng, trim, 0.01))
    axis = int(rng.integers(len(centres))) if rng.random() < 0.35 else -1
    for floor in range(floors):
        y = ground + floor * storey
        high = rng.uniform(1.9, 2.2) - 0.15 * floor
        crown = (
            choose(rng, [0.0, 0.15, 0.5], (5, 1, 1))
            if heads[floor] in ("none", "keystone")
            else 0.0
        )
        for index, centre in enumerate(centres):
            if index == axis and floor > 0:
                draft.balcony(
                    "railing", centre - 1.0, y + 0.05, 2.0, 0.9, IRON, clear_m=2.6, guard_m=0.95
                )
                shown = replace(style, sill_m=0.0, panel=0.3)
                draft.opening(
                    "balcony_door",
                    centre - wide / 2,
                    y + 0.12,
                    wide,
                    0.7 + high,
                    recess,
                    shown,
                    behind(rng),
                )
                continue
            shown = replace(style, arch=crown)
            if home_window(draft, centre, y + 0.85, wide, high, recess, shown) and crown == 0:
                left = centre - wide / 2 - band
                if rng.random() < 0.95:
                    head(draft, heads[floor], left, y + 0.85 + high + band, wide + 2 * band, trim)
                draft.box(left, y + 0.35, wide + 2 * band, 0.36, 0.03, trim)
        if rng.random() < 0.7:
            cornice(draft, y - 0.12, 0.24, 0.14, trim)
    cornice(draft, draft.height_m - 0.55, 0.55, 0.5, trim)
    pipes(draft, int(rng.integers(0, 3)), near(rng, (0.4, 0.42, 0.4)))
    decoys(draft, int(rng.integers(0, 3)))
    finish = Finish("plaster", wall, weathering=round(rng.uniform(0.1, 0.9), 2))
    return draft.plan("gruenderzeit", finish, 0.6, near(rng, (0.5, 0.48, 0.45)))


def _rusticated(draft: Draft, height_m: float, rgb: Rgb) -> None:
    """Courses of blocks on the ground floor, between its openings."""
    for y in np.arange(0.7, height_m - 0.5, draft.rng.uniform(0.32, 0.5)):
        start = 0.0
        for left, right in sorted(
            (o.x_m - 0.05, o.x_m + o.width_m + 0.05)
            for o in draft.openings
            if o.y_m - 0.05 < y + 0.25 and y < o.y_m + o.height_m + 0.05
        ):
            draft.box(start, y, left - start, 0.26, 0.035, rgb)
            start = right
        draft.box(start, y, draft.width_m - start, 0.26, 0.035, rgb)
