"""What stands out of a wall: canopies, lamps, downpipes, vents, cabinets and coloured boards."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from benchmarks.estate.drawing import millimetres
from benchmarks.estate.plan import Balcony, Opening, Ornament, Rgb
from benchmarks.estate.plans.bays import Levels, Side
from benchmarks.estate.plans.looks import Look

CANOPY_Y_M = 2.32
PIPE_M = 0.10
LAMP_RGB, NUMBER_RGB = (0.90, 0.89, 0.85), (0.12, 0.16, 0.30)
CABINET_RGB, VENT_RGB = (0.58, 0.59, 0.57), (0.66, 0.66, 0.64)
BOARD_M = 0.015


def trimmings(
    side: Side,
    width_m: float,
    levels: Levels,
    look: Look,
    openings: Sequence[Opening],
    balconies: Sequence[Balcony],
) -> list[Ornament]:
    """All that one wall carries beside openings and balconies, where nothing is in its way."""
    taken = [(o.x_m - 0.06, o.x_m + o.width_m + 0.06) for o in openings]
    taken += [(b.x_m - 0.02, b.x_m + b.width_m + 0.02) for b in balconies]

    def free(left: float, right: float) -> bool:
        inside = left > 0.02 and right < width_m - 0.02
        return inside and all(right < low or left > high for low, high in taken)

    bay_m = width_m / max(1, len(side.bays))
    found: list[Ornament] = []
    if look.downpipes and not side.gable and len(side.bays) > 1:
        between = [bay_m * index for index in range(6, len(side.bays) - 3, 6)]
        found += [
            _pipe(place, levels, look.metal_rgb)
            for place in (0.35, *between, width_m - 0.35)
            if free(place - 0.08, place + 0.08)
        ]
    for index, bay in enumerate(side.bays):
        centre = (index + 0.5) * bay_m
        if bay.use == "stair":
            found += _porch(centre, look)
            left = centre - look.windows.entrance_width_m / 2 - 0.95
            if free(left, left + 0.5):
                found.append(_box(left, 0.55, 0.50, 0.75, 0.12, CABINET_RGB))
        if bay.use in {"kitchen", "bath"}:
            left = centre + (-1 if bay.mirrored else 1) * (bay_m / 2 - 0.35) - 0.10
            if free(left, left + 0.20):
                heights = [levels.floor_m(storey) + 2.25 for storey in range(levels.storeys)]
                found += [_box(left, height, 0.20, 0.15, 0.02, VENT_RGB) for height in heights]
    if look.boards == "below" and not side.gable:
        found += _boards_below(levels, look.board_rgb, openings)
    if look.boards == "between" and not side.gable:
        found += _boards_between(bay_m, look.board_rgb, openings)
    return found


def _box(x: float, y: float, width: float, height: float, out: float, rgb: Rgb) -> Ornament:
    x, y, width, height = (millimetres(value) for value in (x, y, width, height))
    return Ornament("box", x, y, width, height, out, rgb=rgb)


def _pipe(centre: float, levels: Levels, rgb: Rgb) -> Ornament:
    left, height = millimetres(centre - PIPE_M / 2), millimetres(levels.height_m - 0.10)
    return Ornament("pipe", left, 0.05, PIPE_M, height, PIPE_M, 0.04, rgb=rgb)


def _porch(centre: float, look: Look) -> list[Ornament]:
    """Canopy, lamp and house number of an entrance."""
    half = look.windows.entrance_width_m / 2
    return [
        _box(centre - half - 0.35, CANOPY_Y_M, 2 * half + 0.70, 0.14, 1.20, look.metal_rgb),
        _box(centre + half + 0.18, 1.85, 0.16, 0.22, 0.14, LAMP_RGB),
        _box(centre + half + 0.15, 1.50, 0.22, 0.20, 0.02, NUMBER_RGB),
    ]


def _rooms(openings: Sequence[Opening]) -> list[Opening]:
    """Windows of rooms in the plane of the wall, from the lowest row to the highest."""
    rooms = [
        o for o in openings if o.kind == "window" and not o.depth_m and o.height_m * o.width_m > 1.2
    ]
    return sorted(rooms, key=lambda opening: (opening.y_m, opening.x_m))


def _boards_below(levels: Levels, rgb: Rgb, openings: Sequence[Opening]) -> list[Ornament]:
    """Boards from the floor to the sill, as wide as the window."""
    found = []
    for opening in _rooms(openings):
        storey = int((opening.y_m - levels.ground_m) // levels.storey_m)
        lower = levels.floor_m(storey) + 0.08
        height = opening.y_m - 0.06 - lower
        if 0.5 < height < 1.1:
            found.append(_box(opening.x_m, lower, opening.width_m, height, BOARD_M, rgb))
    return found


def _boards_between(bay_m: float, rgb: Rgb, openings: Sequence[Opening]) -> list[Ornament]:
    """Boards between two windows of equal height that are next to each other on a storey."""
    found = []
    doors = [o for o in openings if o.kind == "balcony_door"]
    for one, two in pairwise(_rooms(openings)):
        left, right = one.x_m + one.width_m, two.x_m
        level = one.y_m == two.y_m and one.height_m == two.height_m
        blocked = any(
            d.x_m < right and d.x_m + d.width_m > left and d.y_m < one.y_m < d.y_m + d.height_m
            for d in doors
        )
        if level and not blocked and 0.3 < right - left < bay_m:
            found.append(_box(left, one.y_m, right - left, one.height_m, BOARD_M, rgb))
    return found
