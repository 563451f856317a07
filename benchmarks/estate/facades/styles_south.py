"""Facades of the south and of Asia: shutters and iron, frames of concrete, towers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from benchmarks.estate.facades.styles_draft import Draft, FacadePlan, axes, behind, choose, near
from benchmarks.estate.facades.styles_parts import (
    FRAMES,
    IRON,
    WARM,
    WHITE,
    conditioner,
    cornice,
    decoys,
    entrance,
    home_window,
    pipes,
    shop_floor,
    shutters,
)
from benchmarks.estate.plan import Finish, WindowStyle


def mediterranean(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Southern plaster: shutters open and shut, iron balconies, tiles, conditioners."""
    storey, ground = rng.uniform(2.9, 3.4), rng.uniform(3.0, 3.8)
    floors = int(np.clip((height_m - ground - 0.3) // storey, 1, 5))
    draft = Draft(rng, width_m, ground + floors * storey + 0.4)
    slats = near(
        rng,
        choose(
            rng,
            [
                (0.15, 0.3, 0.22),
                (0.3, 0.2, 0.12),
                (0.5, 0.55, 0.58),
                (0.2, 0.3, 0.42),
                (0.75, 0.72, 0.66),
            ],
        ),
    )
    wide = rng.uniform(0.8, 1.15)
    style = WindowStyle(
        lights=(0.5, 0.5),
        bars=choose(rng, [(1, 1), (1, 2), (1, 3)]),
        frame_m=0.08,
        frame_rgb=near(rng, choose(rng, FRAMES)),
        shutters=bool(rng.random() < 0.65),
        shutter_rgb=slats,
        surround_m=float(rng.choice([0.0, 0.0, 0.12])),
        surround_rgb=near(rng, choose(rng, [WHITE, (0.7, 0.66, 0.58)])),
    )
    centres = axes(rng, width_m, rng.uniform(2.4, 3.3), choose(rng, ["even", "uneven"]))
    doors = [rng.random() < 0.4 for _ in centres]
    if rng.random() < 0.4:
        shop_floor(draft, ground, near(rng, choose(rng, FRAMES)))
    else:
        for index, centre in enumerate(centres):
            if index % 3 == 1:
                entrance(draft, centre, 0.05, rng.uniform(1.0, 1.8), 2.5, choose(rng, FRAMES))
            elif (
                home_window(draft, centre, 1.1, wide * 0.9, 1.3, 0.15, style) and rng.random() < 0.5
            ):
                box = (centre - wide * 0.45, 1.1, centre + wide * 0.45, 2.4)
                draft.extra("lines", box, IRON, z_m=0.01, out_m=0.02, count=7)
    for floor in range(floors):
        y = ground + floor * storey
        for index, centre in enumerate(centres):
            recess = rng.uniform(0.1, 0.25)
            if doors[index]:
                kind = choose(rng, ["railing", "french"], (3, 1))
                draft.balcony(
                    kind,
                    centre - wide / 2 - 0.35,
                    y,
                    wide + 0.7,
                    rng.uniform(0.4, 1.0),
                    IRON,
                    clear_m=2.6,
                    slab_m=0.12,
                    things=bool(rng.random() < 0.4),
                )
                draft.opening(
                    "balcony_door",
                    centre - wide / 2,
                    y + 0.05,
                    wide,
                    2.25,
                    recess,
                    replace(style, sill_m=0.0, panel=0.0),
                    behind(rng),
                )
            else:
                home_window(draft, centre, y + 0.9, wide, rng.uniform(1.3, 1.55), recess, style)
            if rng.random() < 0.12:
                conditioner(draft, centre + wide / 2 + 0.25 + 0.5 * style.shutters, y + 0.4)
    shutters(draft, slats, 0.3)
    cornice(draft, draft.height_m - 0.3, 0.3, 0.3, near(rng, (0.7, 0.62, 0.5)))
    pipes(draft, int(rng.integers(0, 3)), near(rng, (0.5, 0.48, 0.44)))
    decoys(draft, int(rng.integers(0, 4)))
    finish = Finish(
        choose(rng, ["plaster", "tiles"], (6, 1)),
        near(rng, choose(rng, WARM)),
        weathering=round(rng.uniform(0.2, 1.0), 2),
    )
    return draft.plan(
        "mediterranean", finish, float(rng.choice([0.0, 0.8])), near(rng, (0.5, 0.45, 0.4))
    )


def concrete_frame(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Latin and Middle Eastern blocks: painted frames of concrete, sun shades, sliding glass."""
    storey = rng.uniform(2.8, 3.1)
    floors = int(np.clip((height_m - 0.4) // storey, 2, 7))
    draft = Draft(rng, width_m, floors * storey + 0.5)
    pitch = rng.uniform(2.8, 4.2)
    centres = axes(rng, width_m, pitch, "even")
    pitch = width_m / len(centres)
    frame_rgb = near(rng, choose(rng, [(0.75, 0.72, 0.66), (0.85, 0.84, 0.8), (0.55, 0.53, 0.5)]))
    fill = near(
        rng,
        choose(rng, [(0.7, 0.45, 0.32), (0.6, 0.7, 0.68), (0.85, 0.78, 0.55), (0.8, 0.78, 0.74)]),
    )
    metal = near(rng, choose(rng, [(0.6, 0.6, 0.6), (0.25, 0.18, 0.12), WHITE]))
    shade, wide, high = rng.random() < 0.4, rng.uniform(1.4, pitch - 0.7), rng.uniform(1.1, 1.6)
    for floor in range(floors):
        y = floor * storey + 0.25
        for centre in centres:
            style = WindowStyle(
                lights=choose(rng, [(0.5, 0.5), (1 / 3, 1 / 3, 1 / 3)]),
                frame_m=0.05,
                frame_rgb=metal,
                sill_m=0.03,
            )
            if rng.random() < 0.18:
                draft.balcony(
                    "solid", centre - wide / 2 - 0.2, y, wide + 0.4, 1.0, fill, clear_m=2.4
                )
                draft.opening(
                    "balcony_door", centre - wide / 2, y + 0.05, wide, 2.1, 0.1, style, behind(rng)
                )
                continue
            if home_window(draft, centre, y + 0.9, wide, high, rng.uniform(0.08, 0.2), style):
                if shade:
                    draft.box(
                        centre - wide / 2 - 0.15,
                        y + 0.9 + high + 0.03,
                        wide + 0.3,
                        0.08,
                        0.5,
                        frame_rgb,
                    )
                if rng.random() < 0.2:
                    conditioner(draft, centre - 0.4, y + 0.2)
                if rng.random() < 0.2:
                    box = (centre - wide / 2, y + 0.9, centre + wide / 2, y + 0.9 + high)
                    draft.extra("lines", box, metal, z_m=0.02, out_m=0.02, count=int(wide / 0.13))
        draft.box(0.0, floor * storey, draft.width_m, 0.24, 0.06, frame_rgb)
    for index in range(len(centres) + 1):
        draft.box(index * pitch - 0.15, 0.0, 0.3, draft.height_m, 0.05, frame_rgb)
    decoys(draft, int(rng.integers(1, 5)))
    return draft.plan(
        "concrete frame", Finish("plaster", fill, weathering=round(rng.uniform(0.3, 1.0), 2))
    )


def tower(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Asian high-rise: small tiles, conditioners on ledges, balconies closed with glass, cages."""
    storey = rng.uniform(2.75, 3.0)
    floors = int(np.clip((height_m - 0.4) // storey, 3, 9))
    draft = Draft(rng, width_m, floors * storey + 0.4)
    kinds = [
        choose(rng, ["window", "bay", "closed", "open", "small"], (4, 2, 3, 2, 2))
        for _ in axes(rng, width_m, rng.uniform(2.5, 3.4), "even")
    ]
    pitch = width_m / len(kinds)
    frame = near(rng, choose(rng, [(0.6, 0.62, 0.62), (0.25, 0.2, 0.17), WHITE, (0.2, 0.3, 0.28)]))
    wall = near(
        rng,
        choose(
            rng,
            [
                (0.78, 0.74, 0.68),
                (0.7, 0.55, 0.5),
                (0.62, 0.6, 0.58),
                (0.82, 0.8, 0.77),
                (0.5, 0.58, 0.6),
            ],
        ),
    )
    band = near(rng, choose(rng, [wall, (0.5, 0.35, 0.3), WHITE]))
    recess, caged = rng.uniform(0.03, 0.12), rng.random() < 0.35
    for floor in range(floors):
        y = floor * storey + 0.2
        for bay, kind in enumerate(kinds):
            centre = (bay + 0.5) * pitch
            count = int(rng.integers(2, 5))
            style = WindowStyle(
                lights=(1.0 / count,) * count,
                transom=choose(rng, [None, 0.72, 0.3]),
                frame_m=round(rng.uniform(0.04, 0.07), 3),
                frame_rgb=near(rng, frame),
                sill_m=0.02,
            )
            if kind in ("window", "bay", "small"):
                wide = {
                    "window": min(1.8, pitch - 0.9),
                    "bay": min(2.1, pitch - 0.5),
                    "small": 0.7,
                }[kind]
                shown = style if wide > 1 else replace(style, lights=(0.5, 0.5))
                low = y + (0.5 if kind == "bay" else 0.9)
                if not home_window(
                    draft, centre, low, wide, 1.45 if wide > 1 else 1.0, recess, shown
                ):
                    continue
                if kind == "bay":
                    draft.box(centre - wide / 2 - 0.1, low - 0.12, wide + 0.2, 0.12, 0.45, band)
                    draft.box(centre - wide / 2 - 0.1, low + 1.45, wide + 0.2, 0.12, 0.45, band)
                if caged and rng.random() < 0.5:
                    box = (
                        centre - wide / 2 - 0.05,
                        low - 0.05,
                        centre + wide / 2 + 0.05,
                        low + 1.0,
                    )
                    draft.extra(
                        "lines",
                        box,
                        near(rng, (0.7, 0.7, 0.7)),
                        z_m=0.12,
                        out_m=0.02,
                        count=int(wide / 0.1),
                    )
                if rng.random() < 0.5:
                    conditioner(draft, centre - 0.41, low - 0.75)
            elif kind == "closed":
                span = pitch - 0.3
                draft.box(centre - span / 2, y - 0.1, span, 1.0, 0.05, near(rng, band))
                draft.opening(
                    "window",
                    centre - span / 2,
                    y + 0.94,
                    span,
                    storey - 1.25,
                    0.02,
                    replace(style, lights=(0.25,) * 4),
                    behind(rng),
                )
            else:
                span = pitch - 0.3
                deep = rng.uniform(1.0, 1.5)
                draft.balcony(
                    "loggia",
                    centre - span / 2,
                    y,
                    span,
                    deep,
                    near(rng, band),
                    clear_m=round(storey - 0.3, 3),
                    things=True,
                )
                wide = min(1.6, span - 0.4)
                door = replace(style, lights=(0.5, 0.5), transom=None, sill_m=0.0)
                draft.opening(
                    "balcony_door",
                    centre - wide / 2,
                    y + 0.05,
                    wide,
                    2.1,
                    0.05,
                    door,
                    behind(rng),
                    deep,
                )
        if rng.random() < 0.3:
            draft.box(0.0, floor * storey - 0.05, draft.width_m, 0.12, 0.06, band)
    pipes(draft, int(rng.integers(0, 4)), near(rng, (0.75, 0.75, 0.72)))
    decoys(draft, int(rng.integers(0, 4)))
    finish = Finish(
        choose(rng, ["tiles", "plaster"], (3, 2)),
        wall,
        near(rng, wall, 0.06),
        round(rng.uniform(0.2, 1.0), 2),
    )
    return draft.plan("tower", finish)
