"""Facades of brick: British terraces, houses of the Low Countries, American walk-ups, works."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from benchmarks.estate.facades.styles_draft import Draft, FacadePlan, axes, behind, choose, near
from benchmarks.estate.facades.styles_parts import (
    BRICKS,
    FRAMES,
    IRON,
    WHITE,
    cornice,
    decoys,
    entrance,
    home_window,
    pipes,
    sashes,
    shop_floor,
    shutters,
)
from benchmarks.estate.plan import Behind, Finish, WindowStyle


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


def walk_up(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """American brick walk-up: double-hung windows, stone heads, fire stairs, a cornice."""
    storey, ground = rng.uniform(3.0, 3.5), rng.uniform(3.0, 4.0)
    floors = int(np.clip((height_m - ground - 0.6) // storey, 1, 6))
    draft = Draft(rng, width_m, ground + floors * storey + 0.8)
    trim = near(rng, choose(rng, [(0.72, 0.66, 0.55), (0.5, 0.45, 0.4), WHITE, (0.35, 0.22, 0.17)]))
    style = sashes(
        rng,
        choose(rng, [WHITE, (0.2, 0.2, 0.2), (0.3, 0.2, 0.14), (0.55, 0.56, 0.55)]),
        choose(rng, [(1, 1), (2, 1), (3, 2)], (4, 1, 1)),
        arch=choose(rng, [0.0, 0.0, 0.12, 0.5]),
    )
    wide, high = rng.uniform(0.85, 1.15), rng.uniform(1.6, 1.95)
    recess = rng.uniform(0.06, 0.15)
    centres = axes(rng, width_m, rng.uniform(1.9, 2.9), choose(rng, ["even", "pairs"]))
    if rng.random() < 0.6:
        shop_floor(draft, ground, near(rng, choose(rng, FRAMES)))
    else:
        for index, centre in enumerate(centres):
            if index == len(centres) // 3:
                entrance(draft, centre, 0.1, 1.2, 2.5, choose(rng, FRAMES))
            else:
                home_window(draft, centre, 1.0, wide, high, recess, style)
    stair = int(rng.integers(len(centres))) if rng.random() < 0.4 else -1
    for floor in range(floors):
        y = ground + floor * storey
        for index, centre in enumerate(centres):
            if not home_window(draft, centre, y + 0.75, wide, high, recess, style):
                continue
            if style.arch == 0:
                draft.box(centre - wide / 2 - 0.12, y + 0.75 + high, wide + 0.24, 0.22, 0.04, trim)
            if rng.random() < 0.1:
                draft.box(
                    centre - 0.31,
                    y + 0.78,
                    0.62,
                    0.42,
                    0.25,
                    near(rng, (0.75, 0.73, 0.68)),
                    over=True,
                )
            if index in (stair, stair + 1) and stair >= 0:
                draft.box(centre - wide * 0.9, y + 0.55, wide * 1.8, 0.06, 0.9, IRON, over=True)
                box = (centre - wide * 0.9, y + 0.6, centre + wide * 0.9, y + 1.5)
                draft.extra("lines", box, IRON, z_m=0.88, out_m=0.03, count=12)
        if rng.random() < 0.4:
            draft.box(0.0, y - 0.05, draft.width_m, 0.16, 0.05, trim)
    cornice(draft, draft.height_m - 0.6, 0.6, 0.5, trim)
    decoys(draft, int(rng.integers(0, 3)))
    finish = Finish(
        "brick",
        near(rng, choose(rng, BRICKS)),
        near(rng, (0.55, 0.52, 0.47)),
        round(rng.uniform(0.2, 0.9), 2),
    )
    return draft.plan("walk-up", finish)


def works(rng: np.random.Generator, width_m: float, height_m: float) -> FacadePlan:
    """Works and warehouses: large windows of many panes between piers, gates."""
    storey = rng.uniform(3.6, 5.0)
    floors = int(np.clip((height_m - 0.6) // storey, 1, 4))
    draft = Draft(rng, width_m, floors * storey + 0.8)
    centres = axes(rng, width_m, rng.uniform(2.6, 5.0), "even")
    pitch = width_m / len(centres)
    wide, high = pitch - rng.uniform(0.7, 1.3), storey - rng.uniform(1.5, 2.0)
    columns = int(np.clip(round(wide / rng.uniform(0.35, 0.6)), 2, 8))
    style = WindowStyle(
        lights=choose(rng, [(1.0,), (0.5, 0.5), (1 / 3, 1 / 3, 1 / 3)]),
        transom=choose(rng, [None, 0.5, 0.65]),
        frame_m=0.05,
        frame_rgb=near(rng, choose(rng, FRAMES)),
        arch=choose(rng, [0.0, 0.0, 0.1, 0.16]),
    )
    bars = max(1, columns // len(style.lights))
    style = replace(style, bars=(bars, max(1, round(high / 0.45 / (2 if style.transom else 1)))))
    recess = rng.uniform(0.08, 0.25)
    gate = int(rng.integers(len(centres))) if rng.random() < 0.5 else -1
    for floor in range(floors):
        for index, centre in enumerate(centres):
            if floor == 0 and index == gate:
                draft.opening(
                    "door",
                    centre - wide / 2,
                    0.02,
                    wide,
                    min(3.2, storey - 0.6),
                    0.15,
                    WindowStyle(
                        (0.5, 0.5),
                        panel=0.98,
                        frame_m=0.08,
                        frame_rgb=near(rng, (0.3, 0.38, 0.36)),
                        sill_m=0.0,
                    ),
                    Behind(0.0),
                )
                continue
            draft.opening(
                "window",
                centre - wide / 2,
                floor * storey + 1.1,
                wide,
                high,
                recess,
                style,
                behind(rng, home=False),
            )
    pier = near(rng, (0.5, 0.35, 0.28))
    if rng.random() < 0.5:
        for index in range(len(centres) + 1):
            draft.box(index * pitch - 0.2, 0.0, 0.4, draft.height_m, 0.12, pier)
    pipes(draft, int(rng.integers(0, 3)), near(rng, (0.4, 0.4, 0.4)))
    decoys(draft, int(rng.integers(0, 4)))
    wall = near(
        rng,
        choose(rng, [(0.48, 0.25, 0.18), (0.62, 0.5, 0.33), (0.62, 0.61, 0.58), (0.72, 0.7, 0.64)]),
    )
    finish = Finish(
        choose(rng, ["brick", "panel", "plaster", "metal"], (5, 2, 1, 1)),
        wall,
        near(rng, (0.55, 0.53, 0.5)),
        round(rng.uniform(0.3, 1.0), 2),
        (round(pitch, 3), round(storey, 3)),
    )
    return draft.plan("works", finish, float(rng.choice([0.0, 0.8])))
