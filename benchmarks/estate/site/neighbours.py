"""Buildings around the targets: where they stand, and plain ones of the same time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from benchmarks.estate.drawing import millimetres, rng_of
from benchmarks.estate.plan import (
    Behind,
    Building,
    Finish,
    FloatArray,
    Opening,
    Rgb,
    Roof,
    Street,
    Wall,
    WindowStyle,
)
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

CLEAR_OF_TARGETS_M = 26.0
"""Photos are taken up to 25 m from the walls of a target."""
GAP_M = 10.0
BRICKS: tuple[Rgb, ...] = ((0.55, 0.30, 0.22), (0.72, 0.60, 0.42), (0.48, 0.26, 0.20))
PLASTERS: tuple[Rgb, ...] = ((0.80, 0.74, 0.60), (0.78, 0.78, 0.75), (0.74, 0.62, 0.48))


@dataclass(frozen=True)
class NeighbourPlace:
    """Room for a building: its front runs towards ``along_deg`` with the outside on the right."""

    centre: tuple[float, float]
    along_deg: float
    length_m: float
    depth_m: float
    storeys: int
    like: Building

    @property
    def outline(self) -> FloatArray:
        """Corners (4, 2), counter-clockwise from the front's start."""
        along = direction(self.along_deg)
        back = np.array([-along[1], along[0]])
        steps = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
        return (
            np.array(self.centre)
            + steps[:, :1] * self.length_m * along
            + steps[:, 1:] * self.depth_m * back
        )


NeighbourMaker = Callable[[str, NeighbourPlace, np.random.Generator], Building]


def direction(bearing_deg: float) -> FloatArray:
    """Unit vector (2,) east, north of a compass bearing."""
    return np.array([np.sin(np.deg2rad(bearing_deg)), np.cos(np.deg2rad(bearing_deg))])


def main_bearing_deg(buildings: Sequence[Building], streets: Sequence[Street]) -> float:
    """Bearing of the longest piece of the first street, or of the longest wall without streets."""
    if streets:
        line = np.array(streets[0].line, np.float64)
        pieces = np.diff(line, axis=0)
    else:
        outlines = [building.outline for building in buildings]
        pieces = np.concatenate([np.roll(line, -1, axis=0) - line for line in outlines])
    longest = pieces[np.argmax(np.linalg.norm(pieces, axis=1))]
    return float(np.rad2deg(np.arctan2(longest[0], longest[1])) % 360)


def neighbour_places(
    buildings: Sequence[Building], streets: Sequence[Street], reach_m: float, seed: int
) -> list[NeighbourPlace]:
    """Places in rows along the main street and in columns beside the targets."""
    rng = rng_of(seed, "neighbours")
    bearing = main_bearing_deg(buildings, streets)
    along = direction(bearing)
    axes = np.stack([along, [-along[1], along[0]]])  # rows u, v
    corners = np.concatenate([building.outline for building in buildings]) @ axes.T
    (u0, v0), (u1, v1) = corners.min(0), corners.max(0)
    targets = shapely.union_all([Polygon(building.outline) for building in buildings])
    near = targets.buffer(reach_m)
    taken = targets.buffer(CLEAR_OF_TARGETS_M)
    for street in streets:
        width = street.road_m / 2 + street.pavement_m + 5.0
        taken = taken.union(LineString(street.line).buffer(width, cap_style="flat"))
    found: list[NeighbourPlace] = []

    def settle(u: float, v: float, step: tuple[float, float], facing_deg: float) -> bool:
        """Put a building at u, v or further out; whether there was room."""
        nonlocal taken
        like = buildings[int(rng.integers(len(buildings)))]
        length, depth = rng.uniform(26, 52), rng.uniform(10.5, 13.0)
        tall = rng.uniform() < 0.2
        storeys = int(rng.integers(7, 9)) if tall else int(rng.integers(3, 5))
        if tall:
            length = rng.uniform(20, 26)
        for move in np.arange(0.0, 34.0, 2.0):
            centre = axes.T @ np.array([u + step[0] * move, v + step[1] * move])
            place = NeighbourPlace(
                (millimetres(centre[0]), millimetres(centre[1])),
                round(facing_deg, 3),
                millimetres(length),
                millimetres(depth),
                storeys,
                like,
            )
            outline = Polygon(place.outline)
            if not outline.intersects(near):
                return False
            if not outline.intersects(taken):
                found.append(place)
                taken = taken.union(outline.buffer(GAP_M))
                return True
        return False

    # Fronts look at the targets: the outside is on the right of the front's bearing.
    for ring in (0.0, 46.0):
        for side in (-1, 1):
            edge = (v1 + 32 + ring) if side > 0 else (v0 - 32 - ring)
            facing = bearing if side > 0 else bearing + 180
            cursor = u0 - 60
            while cursor < u1 + 60:
                room = settle(cursor + rng.uniform(0, 6), edge, (0, side), facing % 360)
                cursor += rng.uniform(38, 52) if room else 12.0
        for side in (-1, 1):
            edge = (u1 + 32 + ring) if side > 0 else (u0 - 32 - ring)
            facing = bearing + 270 if side > 0 else bearing + 90
            cursor = v0 - 30
            while cursor < v1 + 30:
                room = settle(edge, cursor + rng.uniform(0, 6), (side, 0), facing % 360)
                cursor += rng.uniform(38, 52) if room else 12.0
    return found


def plain_neighbour(identity: str, place: NeighbourPlace, rng: np.random.Generator) -> Building:
    """A slab with regular windows, entrances on its front, in brick or plaster."""
    storey = 2.8
    height = millimetres(place.storeys * storey + 0.9)
    kind = "brick" if rng.uniform() < 0.5 else "plaster"
    palette = BRICKS if kind == "brick" else PLASTERS
    finish = Finish(
        kind, palette[int(rng.integers(len(palette)))], weathering=round(rng.uniform(0.2, 0.7), 2)
    )
    gable = bool(rng.uniform() < 0.4)
    white = (0.88, 0.88, 0.86)
    frame: Rgb = white if rng.uniform() < 0.7 else (0.35, 0.24, 0.16)
    walls = []
    corners = place.outline
    for index in range(4):
        start, end = corners[index], corners[(index + 1) % 4]
        openings: tuple[Opening, ...] = ()
        if index in (0, 2):
            openings = _openings(place.length_m, place.storeys, storey, frame, index == 0, rng)
        walls.append(
            Wall(
                f"{identity}-{index}",
                (millimetres(start[0]), millimetres(start[1])),
                (millimetres(end[0]), millimetres(end[1])),
                height,
                finish,
                openings,
                plinth_m=0.5,
            )
        )
    roof = Roof("hip", 2.4, 0.4, (0.36, 0.22, 0.17)) if gable else Roof("flat", 0.3)
    return Building(identity, tuple(walls), height, place.storeys, storey, 1965, roof)


def _openings(
    length_m: float,
    storeys: int,
    storey_m: float,
    frame: Rgb,
    front: bool,
    rng: np.random.Generator,
) -> tuple[Opening, ...]:
    columns = int((length_m - 2.0) // 3.4)
    pitch = length_m / columns
    found = []
    for column in range(columns):
        middle = (column + 0.5) * pitch
        stairs = front and column % 5 == 2
        width = 1.1 if stairs else (1.9 if column % 2 else 1.2)
        lights = (0.5, 0.5) if width > 1.5 else (1.0,)
        for floor in range(storeys):
            foot = 0.9 + floor * storey_m + (0.9 - 0.4)
            if stairs and floor == 0:
                style = WindowStyle(panel=0.25, frame_rgb=(0.30, 0.22, 0.15), sill_m=0.0)
                found.append(Opening("door", millimetres(middle - 0.6), 0.02, 1.2, 2.1, 0.2, style))
                continue
            behind = Behind(
                curtain=round(rng.uniform(0, 0.6), 2),
                blind=round(rng.uniform(0.2, 0.8), 2) if rng.uniform() < 0.2 else 0.0,
            )
            found.append(
                Opening(
                    "window",
                    millimetres(middle - width / 2),
                    millimetres(foot),
                    width,
                    1.3,
                    0.1,
                    WindowStyle(lights, frame_rgb=frame),
                    behind,
                )
            )
    return tuple(found)


def corridor_of(lines: Sequence[Sequence[tuple[float, float]]], width_m: float) -> BaseGeometry:
    """The area within ``width_m`` of lines."""
    return shapely.union_all([LineString(line).buffer(width_m) for line in lines])
