"""Windows and doors of 1961-1975: their types, sizes, frames and what hangs behind the glass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from benchmarks.estate.drawing import between, millimetres, pick
from benchmarks.estate.plan import Behind, FinishKind, Opening, Rgb, WindowStyle

Use = Literal["bed", "kitchen", "living", "bath", "balcony", "stair", "store", "blank"]

WHITE, CREAM, BROWN, GREEN, GREY, RED = (
    (0.87, 0.87, 0.84),
    (0.80, 0.77, 0.68),
    (0.26, 0.17, 0.11),
    (0.20, 0.31, 0.26),
    (0.52, 0.54, 0.55),
    (0.42, 0.16, 0.12),
)
CURTAINS: tuple[Rgb, ...] = (
    (0.88, 0.87, 0.83),
    (0.82, 0.78, 0.68),
    (0.90, 0.90, 0.90),
    (0.70, 0.62, 0.50),
    (0.55, 0.60, 0.64),
    (0.72, 0.42, 0.30),
    (0.50, 0.56, 0.40),
    (0.33, 0.31, 0.35),
)
# Glazed two times or three, and how deep the pane sits from the face of the wall.
RECESSES_M: dict[FinishKind, tuple[float, float]] = {
    "panel": (0.08, 0.12),
    "brick": (0.10, 0.20),
    "plaster": (0.10, 0.16),
    "boards": (0.06, 0.10),
    "metal": (0.20, 0.30),
    "tiles": (0.08, 0.14),
    "stone": (0.10, 0.20),
}
THRESHOLD_M = 0.08


@dataclass(frozen=True)
class WindowType:
    """One size of window and how it is divided, from the left."""

    width_m: float
    height_m: float
    lights: tuple[float, ...] = (1.0,)
    transom: float | None = None

    @property
    def mirrored(self) -> WindowType:
        """The same window with its lights the other way round."""
        return WindowType(self.width_m, self.height_m, self.lights[::-1], self.transom)


@dataclass(frozen=True)
class WindowSet:
    """All windows and doors of one house.

    ``head_m`` is their common upper edge above the floor. ``stair`` is ``landing`` for one window
    per landing, half a storey off the floors, or ``strip`` for glass from floor to floor.
    """

    bed: WindowType
    kitchen: WindowType
    living: WindowType
    bath: WindowType
    low: WindowType  # basement and attic
    stair_window: WindowType
    beside_door: WindowType
    door_first: bool
    door_width_m: float
    door_panel: float
    door_gap_m: float
    entrance_width_m: float
    entrance_lights: tuple[float, ...]
    stair: Literal["landing", "strip"]
    head_m: float
    recess_m: float
    frame_m: float
    frame_rgb: Rgb
    sill_m: float
    entrance_rgb: Rgb


def window_set(
    rng: np.random.Generator, finish: FinishKind, module_m: tuple[float, float]
) -> WindowSet:
    """The windows of one house: one firm made them, so they share height, frames and division.

    They suit rooms of a width and a storey of a height, ``module_m``.
    """
    room_m, storey_m = module_m
    height = between(rng, 1.20, 1.40)
    head = millimetres(between(rng, 0.85, 0.95) + height)
    family = pick(rng, ("wide-narrow", "wide-narrow", "halves", "picture", "ribbon"))
    two: tuple[float, ...] = {
        "wide-narrow": (0.66, 0.34),
        "halves": (0.5, 0.5),
        "picture": (0.75, 0.25),
        "ribbon": (0.5, 0.5),
    }[family]
    three: tuple[float, ...] = {
        "wide-narrow": (0.27, 0.46, 0.27),
        "halves": (1 / 3, 1 / 3, 1 / 3),
        "picture": (0.7, 0.3),
        "ribbon": (0.25, 0.25, 0.25, 0.25),
    }[family]
    bed = WindowType(between(rng, *_shares(room_m, 0.42, 0.52)), height, two)
    if family == "ribbon":
        bed = WindowType(between(rng, *_shares(room_m, 0.54, 0.66)), height, (1 / 3, 1 / 3, 1 / 3))
    kitchen_height = pick(rng, (height, height, millimetres(height - 0.15)))
    kitchen = WindowType(between(rng, *_shares(room_m, 0.36, 0.46)), kitchen_height, two)
    living = WindowType(between(rng, 1.9, 2.4), height, three)
    beside = WindowType(between(rng, 1.0, 1.4), height, pick(rng, ((1.0,), two)))
    low_recess, high_recess = RECESSES_M[finish]
    if finish == "plaster" and rng.random() < 0.3:  # insulated from outside since
        low_recess, high_recess = RECESSES_M["metal"]
    stair = pick(rng, ("landing", "landing", "strip"))
    if stair == "strip":
        stair_type = WindowType(
            between(rng, 0.8, 1.6, 0.2), millimetres(storey_m - 0.45), (1.0,), 0.5
        )
    else:
        stair_type = WindowType(between(rng, 0.8, 1.3), between(rng, 1.0, 1.3), (1.0,))
    small = between(rng, 0.5, 0.6)
    return WindowSet(
        bed=bed,
        kitchen=kitchen,
        living=living,
        bath=WindowType(small, pick(rng, (small, 0.6, 0.9))),
        low=WindowType(between(rng, 0.6, 1.0, 0.1), between(rng, 0.40, 0.50)),
        stair_window=stair_type,
        beside_door=beside,
        door_first=bool(rng.integers(2)),
        door_width_m=between(rng, 0.80, 0.90),
        door_panel=pick(rng, (0.28, 0.36, 0.42)),
        door_gap_m=pick(rng, (0.0, 0.0, 0.20)),
        entrance_width_m=between(rng, 1.3, 1.9, 0.1),
        entrance_lights=pick(rng, ((0.6, 0.4), (0.5, 0.5), (0.35, 0.65))),
        stair=stair,
        head_m=head,
        recess_m=between(rng, low_recess, high_recess, 0.01),
        frame_m=between(rng, 0.08, 0.11, 0.01),
        frame_rgb=pick(rng, (WHITE, WHITE, WHITE, CREAM, BROWN, BROWN, GREEN, GREY, RED)),
        sill_m=between(rng, 0.03, 0.05, 0.01),
        entrance_rgb=pick(rng, (BROWN, BROWN, (0.45, 0.30, 0.18), GREEN, GREY, RED)),
    )


def _shares(length_m: float, low: float, high: float) -> tuple[float, float]:
    """Two shares of a length on steps of 0.05 m."""
    return round(length_m * low / 0.05) * 0.05, round(length_m * high / 0.05) * 0.05


def behind(rng: np.random.Generator, use: Use) -> Behind:
    """What is seen behind the glass of one window, by the use of its room."""
    if use == "bath":
        return Behind(curtain=0.0, blind=1.0, blind_rgb=(0.74, 0.76, 0.77))
    if use in {"stair", "store"}:
        return Behind(curtain=0.0, light=0.4 if rng.random() < 0.05 else 0.0)
    drawn = rng.random()
    curtain = rng.uniform(0.12, 0.42)
    if use == "bed" and drawn < 0.12:
        curtain = rng.uniform(0.7, 1.0)
    if use == "kitchen":
        curtain = rng.uniform(0.0, 0.3)
    blind = rng.uniform(0.15, 1.0) if rng.random() < (0.35 if use == "bed" else 0.2) else 0.0
    grey = rng.uniform(0.66, 0.86)
    return Behind(
        curtain=millimetres(curtain),
        curtain_rgb=pick(rng, CURTAINS),
        blind=millimetres(blind),
        blind_rgb=(millimetres(grey), millimetres(grey * 0.99), millimetres(grey * 0.96)),
        light=millimetres(rng.uniform(0.3, 0.8)) if rng.random() < 0.03 else 0.0,
        things=bool(rng.random() < 0.45),
    )


def window(
    windows: WindowSet,
    kind: WindowType,
    centre_m: float,
    lower_m: float,
    seen_behind: Behind,
    depth_m: float = 0.0,
    sill: bool = True,
) -> Opening:
    """A window of this type around ``centre_m`` along the wall, from ``lower_m`` above ground."""
    style = WindowStyle(
        lights=kind.lights,
        transom=kind.transom,
        frame_m=windows.frame_m,
        frame_rgb=windows.frame_rgb,
        sill_m=windows.sill_m if sill else 0.0,
    )
    return Opening(
        "window",
        millimetres(centre_m - kind.width_m / 2),
        millimetres(lower_m),
        kind.width_m,
        kind.height_m,
        windows.recess_m,
        style,
        seen_behind,
        depth_m,
    )


def balcony_openings(
    windows: WindowSet,
    centre_m: float,
    floor_m: float,
    depth_m: float,
    mirrored: bool,
    rng: np.random.Generator,
) -> tuple[Opening, Opening]:
    """Balcony door and the window beside it, as one group around ``centre_m``."""
    beside = windows.beside_door.mirrored if mirrored else windows.beside_door
    group_m = windows.door_width_m + windows.door_gap_m + beside.width_m
    left = millimetres(centre_m - group_m / 2)
    door_left = windows.door_first != mirrored
    door_x = left if door_left else millimetres(left + beside.width_m + windows.door_gap_m)
    window_x = millimetres(left + windows.door_width_m + windows.door_gap_m) if door_left else left
    seen_behind = behind(rng, "living")
    door = Opening(
        "balcony_door",
        door_x,
        millimetres(floor_m + THRESHOLD_M),
        windows.door_width_m,
        millimetres(windows.head_m - THRESHOLD_M),
        windows.recess_m,
        WindowStyle(
            panel=windows.door_panel,
            frame_m=windows.frame_m,
            frame_rgb=windows.frame_rgb,
            sill_m=0.0,
        ),
        seen_behind,
        depth_m,
    )
    pane = window(
        windows,
        beside,
        window_x + beside.width_m / 2,
        floor_m + windows.head_m - beside.height_m,
        seen_behind,
        depth_m,
    )
    return door, pane


def entrance(windows: WindowSet, centre_m: float) -> Opening:
    """The house door: glass in a frame with a side light."""
    return Opening(
        "door",
        millimetres(centre_m - windows.entrance_width_m / 2),
        0.12,
        windows.entrance_width_m,
        2.10,
        millimetres(windows.recess_m + 0.05),
        WindowStyle(
            lights=windows.entrance_lights,
            panel=0.15,
            frame_m=0.10,
            frame_rgb=windows.entrance_rgb,
            sill_m=0.0,
        ),
        Behind(curtain=0.0, light=0.2),
    )


def store_door(windows: WindowSet, centre_m: float) -> Opening:
    """A steel door to bicycles or refuse, without glass."""
    return Opening(
        "door",
        millimetres(centre_m - 0.5),
        0.08,
        1.0,
        2.05,
        millimetres(windows.recess_m + 0.05),
        WindowStyle(panel=1.0, frame_m=0.08, frame_rgb=windows.entrance_rgb, sill_m=0.0),
    )
