"""Facades of many countries and times as plans; a seed and a number give one of them.

The styles are drawn from memory of what such streets look like: they vary what a window detector
sees, and claim nothing about any real building.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.facades.styles_blocks import panel_block, roller_block
from benchmarks.estate.facades.styles_brick import canal_house, terrace, walk_up, works
from benchmarks.estate.facades.styles_draft import FacadePlan
from benchmarks.estate.facades.styles_estate import estate_house
from benchmarks.estate.facades.styles_modern import contemporary, curtain, gable, ribbon
from benchmarks.estate.facades.styles_north import functionalist, slab
from benchmarks.estate.facades.styles_south import concrete_frame, mediterranean, tower
from benchmarks.estate.facades.styles_stone import gruenderzeit, haussmann
from benchmarks.estate.facades.styles_wood import clapboard, timber

Style = Callable[[np.random.Generator, float, float], FacadePlan]

STYLES: dict[str, tuple[Style, float]] = {
    "estate": (estate_house, 3.0),
    "slab": (slab, 2.0),
    "functionalist": (functionalist, 2.0),
    "timber": (timber, 1.0),
    "panel_block": (panel_block, 1.5),
    "haussmann": (haussmann, 1.5),
    "gruenderzeit": (gruenderzeit, 2.5),
    "terrace": (terrace, 1.2),
    "mediterranean": (mediterranean, 1.5),
    "roller_block": (roller_block, 2.0),
    "canal_house": (canal_house, 0.8),
    "walk_up": (walk_up, 1.2),
    "clapboard": (clapboard, 0.7),
    "tower": (tower, 1.2),
    "concrete_frame": (concrete_frame, 1.0),
    "ribbon": (ribbon, 1.0),
    "curtain": (curtain, 0.8),
    "contemporary": (contemporary, 2.0),
    "works": (works, 0.8),
    "gable": (gable, 0.8),
}
"""What draws a style from (rng, width budget m, height budget m), and how often it comes."""


def facade_plan(seed: int, number: int, style: str | None = None) -> FacadePlan:
    """The facade of a number: the same whatever else is drawn. ``style`` names one of ``STYLES``.

    Walls are about 8 to 20 m wide and 7 to 18 m high (the estate's houses up to 23 m): one
    picture's worth, or a little more.
    """
    rng = rng_of(seed, "facade", number)
    names = list(STYLES)
    weights = np.array([STYLES[name][1] for name in names])
    drawn = names[int(rng.choice(len(names), p=weights / weights.sum()))]
    draw, _ = STYLES[style or drawn]
    return draw(rng, round(rng.uniform(9.0, 19.0), 2), round(rng.uniform(8.0, 17.5), 2))
