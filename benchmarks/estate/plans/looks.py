"""How one house of 1961-1975 looks: skin, windows, balconies and roof drawn from its time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from benchmarks.estate.drawing import between, millimetres, pick
from benchmarks.estate.plan import BalconyKind, Finish, FinishKind, Rgb, Roof
from benchmarks.estate.plans.fenestration import WindowSet, window_set

BRICKS: tuple[tuple[Rgb, Rgb], ...] = (  # bricks, mortar
    ((0.73, 0.60, 0.40), (0.66, 0.62, 0.55)),  # yellow
    ((0.76, 0.66, 0.49), (0.68, 0.65, 0.58)),
    ((0.52, 0.27, 0.20), (0.58, 0.54, 0.49)),  # red
    ((0.46, 0.24, 0.18), (0.42, 0.39, 0.36)),
    ((0.34, 0.23, 0.18), (0.40, 0.37, 0.34)),  # brown
    ((0.78, 0.76, 0.71), (0.70, 0.68, 0.64)),  # sand-lime
)
PLASTERS: tuple[Rgb, ...] = (
    (0.80, 0.72, 0.55),
    (0.78, 0.65, 0.46),
    (0.76, 0.74, 0.68),
    (0.72, 0.62, 0.54),
    (0.66, 0.68, 0.60),
    (0.82, 0.79, 0.72),
)
PANELS: tuple[Rgb, ...] = (
    (0.62, 0.60, 0.56),
    (0.68, 0.65, 0.59),
    (0.66, 0.58, 0.51),
    (0.58, 0.57, 0.54),
    (0.73, 0.71, 0.66),
)
METALS: tuple[Rgb, ...] = ((0.70, 0.71, 0.68), (0.62, 0.56, 0.44), (0.52, 0.57, 0.60))
FRONTS: tuple[Rgb, ...] = (
    (0.24, 0.36, 0.48),  # blue
    (0.28, 0.40, 0.31),  # green
    (0.72, 0.38, 0.17),  # orange
    (0.40, 0.25, 0.17),  # brown
    (0.74, 0.73, 0.69),  # concrete
    (0.80, 0.79, 0.74),
    (0.62, 0.24, 0.18),
    (0.76, 0.64, 0.30),
)


@dataclass(frozen=True)
class BalconyStyle:
    """All balconies of one house."""

    kind: BalconyKind
    depth_m: float
    guard_m: float
    rgb: Rgb
    side_walls: bool


@dataclass(frozen=True)
class Look:
    """Skin, windows, balconies and roof of one house.

    ``boards`` are thin boards below the windows, or between them so that the windows of a storey
    make one band.
    """

    year: int
    finish: Finish
    gable_finish: Finish
    plinth_rgb: Rgb
    windows: WindowSet
    balcony: BalconyStyle
    roof: Roof
    downpipes: bool
    boards: Literal["none", "below", "between"]
    board_rgb: Rgb
    metal_rgb: Rgb


def _finish(rng: np.random.Generator, kind: FinishKind, module_m: tuple[float, float]) -> Finish:
    weathering = millimetres(rng.uniform(0.2, 0.75))
    shade = rng.uniform(0.94, 1.04)

    def shaded(rgb: Rgb) -> Rgb:
        red, green, blue = (millimetres(min(1.0, shade * part)) for part in rgb)
        return red, green, blue

    if kind == "brick":
        brick, mortar = pick(rng, BRICKS)
        return Finish("brick", shaded(brick), mortar, weathering, module_m)
    palette = {"plaster": PLASTERS, "metal": METALS}.get(kind, PANELS)
    rgb = shaded(pick(rng, palette))
    joint = (0.40, 0.39, 0.37) if kind == "panel" else (0.60, 0.58, 0.55)
    return Finish(kind, rgb, joint, weathering, module_m)


def look_of(
    rng: np.random.Generator,
    module_m: tuple[float, float],
    *,
    kinds: tuple[FinishKind, ...] = ("brick", "plaster", "panel"),
    roof: Literal["flat", "gable", "any"] = "any",
    balconies: tuple[BalconyKind, ...] = ("solid", "railing", "loggia"),
) -> Look:
    """A look drawn from what was built; ``module_m`` is the width of a room and a storey's height.

    ``kinds`` and ``balconies`` limit skin and balconies to what suits the type of the house.
    """
    kind = pick(rng, kinds)
    finish = _finish(rng, kind, module_m)
    gable = finish
    if rng.random() < 0.25:
        other: FinishKind = "brick" if kind != "brick" else "plaster"
        gable = _finish(rng, other, module_m)
    gabled = roof == "gable" or (roof == "any" and bool(rng.integers(2)))
    front = pick(rng, FRONTS)
    grey = between(rng, 0.36, 0.50, 0.02)
    balcony_kind = pick(rng, balconies)
    return Look(
        year=int(rng.integers(1961, 1976)),
        finish=finish,
        gable_finish=gable,
        plinth_rgb=(grey, millimetres(grey * 0.98), millimetres(grey * 0.95)),
        windows=window_set(rng, kind, module_m),
        balcony=BalconyStyle(
            balcony_kind,
            between(rng, 1.2, 1.5) if balcony_kind == "loggia" else between(rng, 1.3, 1.8),
            between(rng, 0.95, 1.10),
            front,
            side_walls=bool(balcony_kind == "solid" and rng.random() < 0.3),
        ),
        roof=(
            Roof(
                "gable",
                between(rng, 1.2, 1.8, 0.1),
                0.40,
                pick(rng, ((0.24, 0.23, 0.23), (0.45, 0.25, 0.19))),
            )
            if gabled
            else Roof("flat", 0.10, 0.0, (0.22, 0.22, 0.23), between(rng, 0.12, 0.30, 0.02))
        ),
        downpipes=gabled or rng.random() < 0.3,
        boards="none" if kind == "brick" else pick(rng, ("none", "none", "below", "between")),
        board_rgb=pick(rng, (front, front, (0.22, 0.20, 0.19), (0.34, 0.24, 0.18))),
        metal_rgb=pick(rng, ((0.30, 0.24, 0.20), (0.62, 0.63, 0.63), (0.20, 0.21, 0.22))),
    )
