"""A wall on the drawing board: what is put on it may not overlap nor leave it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from benchmarks.estate.drawing import millimetres
from benchmarks.estate.plan import (
    Balcony,
    BalconyKind,
    Behind,
    Finish,
    Opening,
    OpeningKind,
    Ornament,
    Rgb,
    Wall,
    WindowStyle,
)

Box = tuple[float, float, float, float]
"""Left, bottom, right, top on the wall, in metres."""
ExtraKind = Literal["triangle", "segment", "roller", "leaf", "fan", "lines", "awning", "text"]


@dataclass(frozen=True)
class Extra:
    """A detail of a facade that a wall's plan has no word for.

    ``z_m`` is the place of its back before the wall's plane (negative inside a recess) and
    ``out_m`` its depth. Kinds: ``triangle`` and ``segment`` (pediments), ``roller`` (shutter of
    slats), ``leaf`` (closed shutter with louvres), ``fan`` (air conditioner), ``lines`` (guard
    of ``count`` upright bars), ``awning`` (slanting cloth), ``text`` (sign with letters).
    """

    kind: ExtraKind
    x_m: float
    y_m: float
    width_m: float
    height_m: float
    z_m: float = 0.0
    out_m: float = 0.1
    rgb: Rgb = (0.8, 0.8, 0.8)
    count: int = 0


@dataclass(frozen=True)
class FacadePlan:
    """A wall to be pictured: its style, its plan, what the plan cannot say, and its shop fronts."""

    style: str
    wall: Wall
    extras: tuple[Extra, ...] = ()
    shops: tuple[Box, ...] = ()


def _overlaps(one: Box, other: Box, gap_m: float) -> bool:
    return (
        one[0] < other[2] + gap_m
        and other[0] < one[2] + gap_m
        and one[1] < other[3] + gap_m
        and other[1] < one[3] + gap_m
    )


class Draft:
    """Openings that keep apart and inside the wall, and ornaments that keep off the openings.

    What does not fit is left out: every method says whether it put something on the wall.
    """

    def __init__(self, rng: np.random.Generator, width_m: float, height_m: float) -> None:
        self.rng = rng
        self.width_m = millimetres(width_m)
        self.height_m = millimetres(height_m)
        self.openings: list[Opening] = []
        self.balconies: list[Balcony] = []
        self.ornaments: list[Ornament] = []
        self.extras: list[Extra] = []
        self.shops: list[Box] = []

    def fits(self, box: Box, gap_m: float = 0.04) -> bool:
        """Whether a box lies on the wall, off its edges, and away from all openings."""
        inside = (
            box[0] >= 0.05
            and box[1] >= 0.0
            and box[2] <= self.width_m - 0.05
            and box[3] <= self.height_m - 0.05
        )
        return inside and not any(_overlaps(box, reach_of(o), gap_m) for o in self.openings)

    def opening(
        self,
        kind: OpeningKind,
        x_m: float,
        y_m: float,
        width_m: float,
        height_m: float,
        recess_m: float,
        style: WindowStyle,
        behind: Behind,
        depth_m: float = 0.0,
        gap_m: float = 0.04,
    ) -> bool:
        """Put a window or door; ``gap_m`` is the least wall between it and the next.

        Where there is no room for its shutters it goes without.
        """
        numbers = [millimetres(v) for v in (x_m, y_m, width_m, height_m, recess_m)]
        for with_shutters in (style.shutters, False):
            drawn = replace(style, shutters=with_shutters)
            opening = Opening(kind, *numbers, drawn, behind, millimetres(depth_m))
            if self.fits(reach_of(opening), gap_m):
                self.openings.append(opening)
                return True
        return False

    def box(
        self,
        x_m: float,
        y_m: float,
        width_m: float,
        height_m: float,
        out_m: float,
        rgb: Rgb,
        *,
        material: str = "painted",
        gap_m: float = 0.0,
        over: bool = False,
        kind: Literal["box", "pipe"] = "box",
    ) -> bool:
        """Put a box or pipe on the wall; ``over`` lets it pass in front of openings."""
        left, right = max(x_m, 0.0), min(x_m + width_m, self.width_m)
        low, high = max(y_m, 0.0), min(y_m + height_m, self.height_m)
        if right - left < 0.01 or high - low < 0.01:
            return False
        area = (left, low, right, high)
        if not over and any(_overlaps(area, box_of(o), 0.0) for o in self.openings):
            return False
        numbers = [millimetres(v) for v in (left, low, right - left, high - low, out_m, gap_m)]
        self.ornaments.append(Ornament(kind, *numbers, material, rgb))
        return True

    def balcony(
        self,
        kind: BalconyKind,
        x_m: float,
        y_m: float,
        width_m: float,
        depth_m: float,
        rgb: Rgb,
        **more: float | bool,
    ) -> bool:
        """Put a balcony or loggia; a loggia keeps clear of other openings in the plane."""
        right = x_m + width_m
        if x_m < 0.05 or right > self.width_m - 0.05 or y_m < 0.15:
            return False
        clear = float(more.get("clear_m", 2.5))
        if y_m + clear > self.height_m - 0.05:
            return False
        area = (x_m, y_m, right, y_m + clear)
        if kind == "loggia" and not self.fits(area):
            return False
        if any(_overlaps(area, balcony_box(b), -0.02) for b in self.balconies):
            return False
        numbers = [millimetres(v) for v in (x_m, y_m, width_m, depth_m)]
        self.balconies.append(Balcony(kind, *numbers, rgb=rgb, **more))
        return True

    def extra(
        self,
        kind: ExtraKind,
        box: Box,
        rgb: Rgb,
        *,
        z_m: float = 0.0,
        out_m: float = 0.1,
        count: int = 0,
    ) -> bool:
        """Put a detail over the box, whatever is behind it."""
        if box[0] < 0 or box[1] < 0 or box[2] > self.width_m or box[3] > self.height_m:
            return False
        numbers = [millimetres(v) for v in (box[0], box[1], box[2] - box[0], box[3] - box[1])]
        self.extras.append(Extra(kind, *numbers, millimetres(z_m), millimetres(out_m), rgb, count))
        return True

    def plan(
        self, style: str, finish: Finish, plinth_m: float = 0.0, plinth_rgb: Rgb = (0.45,) * 3
    ) -> FacadePlan:
        """The finished facade; the wall runs from the origin eastward and looks south."""
        balconies = [
            b
            for b in self.balconies
            if b.kind == "loggia" or any(_leads_to(o, b) for o in self.openings)
        ]
        loggias = [balcony_box(b) for b in self.balconies if b.kind == "loggia"]
        openings = [
            o
            for o in self.openings
            if o.depth_m > 0 or not any(_overlaps(box_of(o), area, 0.0) for area in loggias)
        ]
        wall = Wall(
            "facade",
            (0.0, 0.0),
            (self.width_m, 0.0),
            self.height_m,
            finish,
            tuple(openings),
            tuple(balconies),
            tuple(self.ornaments),
            millimetres(plinth_m),
            plinth_rgb,
        )
        return FacadePlan(style, wall, tuple(self.extras), tuple(self.shops))


def _leads_to(opening: Opening, balcony: Balcony) -> bool:
    """Whether one steps through the opening onto the balcony."""
    return (
        balcony.x_m < opening.x_m + opening.width_m / 2 < balcony.x_m + balcony.width_m
        and balcony.y_m - 0.1 < opening.y_m < balcony.y_m + 0.3
    )


def box_of(opening: Opening) -> Box:
    """The box of an opening on the wall."""
    return (
        opening.x_m,
        opening.y_m,
        opening.x_m + opening.width_m,
        opening.y_m + opening.height_m,
    )


def reach_of(opening: Opening) -> Box:
    """The box of an opening with its surround and its open shutters."""
    left, low, right, high = box_of(opening)
    band = opening.style.surround_m
    side = opening.width_m / 2 + 0.04 if opening.style.shutters else band
    return left - side, max(low - band, 0.0) if low > 0 else low, right + side, high + band


def balcony_box(balcony: Balcony) -> Box:
    """What a balcony takes of the wall: from its slab to the ceiling above it."""
    return (
        balcony.x_m,
        balcony.y_m,
        balcony.x_m + balcony.width_m,
        balcony.y_m + balcony.clear_m,
    )


def choose(rng: np.random.Generator, values: Sequence, weights: Sequence[float] | None = None):
    """One of the values, equally likely or by weight."""
    shares = None if weights is None else np.asarray(weights, float) / np.sum(weights)
    return values[int(rng.choice(len(values), p=shares))]


def near(rng: np.random.Generator, rgb: Rgb, spread: float = 0.04) -> Rgb:
    """A colour close to the given one: shifted as a whole and a little per channel."""
    shift = rng.uniform(-spread, spread) + rng.uniform(-spread / 3, spread / 3, 3)
    return tuple(round(float(v), 3) for v in np.clip(np.asarray(rgb) + shift, 0.03, 0.95))


def axes(rng: np.random.Generator, width_m: float, pitch_m: float, rhythm: str) -> list[float]:
    """Centres of the columns of openings: ``even``, ``pairs`` or ``uneven`` along the wall."""
    count = max(1, int((width_m - 0.4) / pitch_m))
    pitch = width_m / count
    centres = [(index + 0.5) * pitch for index in range(count)]
    if rhythm == "pairs":
        move = rng.uniform(0.08, 0.16) * pitch
        centres = [c + (move if i % 2 == 0 else -move) for i, c in enumerate(centres)]
    elif rhythm == "uneven":
        centres = [c + rng.uniform(-0.18, 0.18) * pitch for c in centres]
    return [millimetres(c) for c in centres]


def behind(rng: np.random.Generator, home: bool = True) -> Behind:
    """What is behind one window; offices have blinds and lamps, homes curtains and plants."""
    curtains = [(0.88, 0.87, 0.84), (0.80, 0.76, 0.68), (0.62, 0.30, 0.26), (0.40, 0.46, 0.55)]
    blinds = [(0.85, 0.84, 0.80), (0.74, 0.72, 0.66), (0.50, 0.52, 0.54), (0.93, 0.92, 0.90)]
    has_curtain = home and rng.random() < 0.6
    has_blind = rng.random() < (0.25 if home else 0.4)
    return Behind(
        curtain=round(float(rng.beta(1.6, 2.2)), 2) if has_curtain else 0.0,
        curtain_rgb=near(rng, choose(rng, curtains, (6, 2, 1, 1))),
        blind=round(float(rng.choice([rng.uniform(0.1, 0.7), 1.0])), 2) if has_blind else 0.0,
        blind_rgb=near(rng, choose(rng, blinds)),
        light=round(float(rng.uniform(0.3, 1.0)), 2) if rng.random() < 0.08 else 0.0,
        things=bool(home and rng.random() < 0.35),
    )
