"""Facades of older European streets: stone of Paris, Gründerzeit, brick terraces, the south."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from benchmarks.estate.plan import Finish, Rgb, WindowStyle
from benchmarks.estate.styles_draft import Draft, FacadePlan, axes, behind, choose, near
from benchmarks.estate.styles_parts import (
    FRAMES,
    IRON,
    WHITE,
    conditioner,
    cornice,
    decoys,
    entrance,
    head,
    home_window,
    pipes,
    sashes,
    shop_floor,
    shutters,
)

STONE: tuple[Rgb, ...] = (
    (0.80, 0.75, 0.65),
    (0.74, 0.69, 0.60),
    (0.84, 0.80, 0.72),
    (0.66, 0.62, 0.55),
)
WARM: tuple[Rgb, ...] = (
    (0.84, 0.70, 0.44),
    (0.78, 0.52, 0.34),
    (0.82, 0.62, 0.52),
    (0.85, 0.80, 0.68),
    (0.72, 0.36, 0.26),
    (0.86, 0.84, 0.80),
    (0.72, 0.70, 0.52),
)
TOWN: tuple[Rgb, ...] = (*WARM, (0.62, 0.70, 0.56), (0.62, 0.66, 0.72), (0.74, 0.72, 0.70))
BRICKS: tuple[Rgb, ...] = (
    (0.50, 0.24, 0.17),
    (0.60, 0.45, 0.30),
    (0.42, 0.20, 0.15),
    (0.66, 0.56, 0.40),
    (0.36, 0.24, 0.20),
)


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
        for y in np.arange(0.7, ground - 0.5, rng.uniform(0.32, 0.5)):
            start = 0.0
            for left, right in sorted(
                (o.x_m - 0.05, o.x_m + o.width_m + 0.05)
                for o in draft.openings
                if o.y_m - 0.05 < y + 0.25 and y < o.y_m + o.height_m + 0.05
            ):
                draft.box(start, y, left - start, 0.26, 0.035, near(rng, trim, 0.01))
                start = right
            draft.box(start, y, draft.width_m - start, 0.26, 0.035, near(rng, trim, 0.01))
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


def terrace(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """British brick terrace: sash windows with bars, stone lintels and sills, painted doors."""
    storey = rng.uniform(2.7, 3.3)
    floors = int(np.clip((height_m - 0.9) // storey, 2, 4))
    draft = Draft(rng, width_m, 0.4 + floors * storey + 0.5)
    bars = choose(rng, [(1, 1), (2, 1), (2, 2), (3, 2), (4, 3)])
    stone = near(rng, choose(rng, [WHITE, (0.72, 0.66, 0.52), (0.6, 0.58, 0.54)]))
    house = rng.uniform(4.2, 5.8)
    wide, recess = rng.uniform(0.85, 1.2), rng.uniform(0.04, 0.15)
    arch = choose(rng, [0.0, 0.0, 0.12])
    count = max(1, int(width_m / house))
    house = width_m / count
    lintel = rng.random() < 0.6 and arch == 0
    for index in range(count):
        left, flip = index * house, rng.random() < 0.15
        style = sashes(
            rng, choose(rng, [WHITE, WHITE, (0.8, 0.78, 0.7), (0.2, 0.2, 0.2)]), bars, arch=arch
        )
        places = (0.27, 0.73) if (index % 2 == 0) != flip else (0.73, 0.27)
        for floor in range(floors):
            y = 0.4 + floor * storey
            high = rng.uniform(1.5, 1.6) if floor < 2 else 1.2
            if floor == 0:
                entrance(draft, left + places[0] * house, 0.15, 0.95, 2.5, WHITE)
            spots = places[1:] if floor == 0 else places
            for place in spots:
                centre = left + place * house
                broad = wide * (1.5 if floor == 0 and wide < 1.0 else 1.0)
                shown = replace(style, lights=(0.25, 0.5, 0.25)) if broad > 1.3 else style
                if home_window(draft, centre, y + 0.75, broad, high, recess, shown) and lintel:
                    draft.box(
                        centre - broad / 2 - 0.12, y + 0.75 + high, broad + 0.24, 0.2, 0.02, stone
                    )
        draft.box(left - 0.05, 0.1, 0.08, draft.height_m, 0.09, IRON, gap_m=0.02, kind="pipe")
    cornice(draft, draft.height_m - 0.3, 0.2, 0.15, stone)
    decoys(draft, int(rng.integers(0, 3)))
    finish = Finish(
        choose(rng, ["brick", "plaster"], (5, 1)),
        near(rng, choose(rng, BRICKS)),
        near(rng, (0.62, 0.58, 0.5)),
        round(rng.uniform(0.2, 0.9), 2),
    )
    return draft.plan("brick terrace", finish, 0.0)


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


def roller_block(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Swiss and German apartment block: roller shutters part of the way down, awnings, balconies."""
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


def canal_house(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Narrow brick houses of the Low Countries: large white windows with many panes."""
    storey = rng.uniform(2.8, 3.4)
    floors = int(np.clip((height_m - 0.5) // storey, 2, 4))
    draft = Draft(rng, width_m, 0.3 + floors * storey + 0.6)
    wide, recess = rng.uniform(1.1, 1.5), rng.uniform(0.02, 0.08)
    style = sashes(
        rng,
        choose(rng, [WHITE, WHITE, (0.16, 0.25, 0.2)]),
        choose(rng, [(3, 2), (2, 2), (3, 3), (1, 1)]),
    )
    centres = axes(rng, width_m, wide + rng.uniform(0.4, 0.9), "even")
    for floor in range(floors):
        for index, centre in enumerate(centres):
            if floor == 0 and index % 3 == 0:
                entrance(draft, centre, 0.3, 1.05, 2.6, WHITE)
                continue
            home_window(
                draft,
                centre,
                0.3 + floor * storey + 0.7,
                wide,
                storey - rng.uniform(1.15, 1.2),
                recess,
                style,
            )
    cornice(draft, draft.height_m - 0.45, 0.45, 0.35, WHITE)
    if rng.random() < 0.4:
        shutters(draft, near(rng, (0.15, 0.3, 0.2)), 0.1)
    finish = Finish(
        "brick",
        near(rng, choose(rng, BRICKS)),
        near(rng, (0.6, 0.57, 0.5)),
        round(rng.uniform(0.1, 0.8), 2),
    )
    return draft.plan("canal house", finish, 0.5, near(rng, (0.3, 0.3, 0.3)))
