"""What stands around the buildings: an estate with neighbours, trees, hedges, cars and lamps.

Everything keeps clear of walls, roads' lanes, entrances, the lines that panoramas are taken on and
two loops around every building on which photos are taken.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from benchmarks.estate.drawing import millimetres, rng_of
from benchmarks.estate.plan import Building, Car, Estate, FloatArray, Lamp, Light, Rgb, Street
from benchmarks.estate.site.car_shapes import CAR_SIZES_M, car_outline
from benchmarks.estate.site.layout import doors_of, layout_of
from benchmarks.estate.site.neighbours import (
    NeighbourMaker,
    corridor_of,
    neighbour_places,
    plain_neighbour,
)
from benchmarks.estate.site.planting import planted
from shapely import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from si3fp.geometry.enu import GeoOrigin

Line = tuple[tuple[float, float], ...]

CLEAR_OF_PANORAMAS_M = 1.5
CORRIDOR_M = 1.2
"""Half the width of the loops that photos are taken on."""
CAR_COLOURS: tuple[Rgb, ...] = (
    (0.78, 0.79, 0.80),
    (0.62, 0.64, 0.66),
    (0.30, 0.31, 0.33),
    (0.08, 0.08, 0.09),
    (0.88, 0.88, 0.87),
    (0.42, 0.06, 0.06),
    (0.10, 0.17, 0.32),
    (0.16, 0.24, 0.19),
)
CAR_SHARES = (0.2, 0.16, 0.14, 0.15, 0.14, 0.08, 0.08, 0.05)


def with_surroundings(
    name: str,
    seed: int,
    origin: GeoOrigin,
    buildings: tuple[Building, ...],
    streets: tuple[Street, ...],
    panorama_lines: tuple[Line, ...],
    *,
    light: Light | None = None,
    trees: float = 1.0,
    hedges: float = 1.0,
    cars: float = 1.0,
    reach_m: float = 95.0,
    neighbour: NeighbourMaker | None = None,
) -> Estate:
    """The estate of target buildings: all that stands around them is placed by the seed.

    Parameters
    ----------
    trees
        0 none, 1 usual, 2 dense. However many there are, every stretch of a target's walls stays
        in sight from half of the places that look at it.
    hedges, cars
        Share of the places for them that are taken, 0..1.
    reach_m
        Neighbours stand within this distance of the targets.
    neighbour
        Makes a building for a place; plain slabs without it.
    """
    maker = neighbour or plain_neighbour
    around = tuple(
        maker(f"neighbour-{index}", place, rng_of(seed, "neighbour", index))
        for index, place in enumerate(neighbour_places(buildings, streets, reach_m, seed))
    )
    layout = layout_of((*buildings, *around), streets)
    rings = _rings_of(buildings)
    walks = corridor_of(rings, CORRIDOR_M)
    views = corridor_of(panorama_lines, CLEAR_OF_PANORAMAS_M)
    built = layout.built.buffer(1.0)
    parked = _parked(streets, shapely.union_all([walks, views, layout.paths, built]), cars, seed)
    lamps = _lamps(streets, shapely.union_all([walks, built, layout.paths]), seed)
    reserved = shapely.union_all(
        [
            walks,
            views,
            layout.road.buffer(0.3),
            layout.paths.buffer(0.4),
            layout.built.buffer(0.4),
            _forecourts(buildings + around),
            *(Point(lamp.place).buffer(1.0) for lamp in lamps),
        ]
    )
    grown, clipped = planted(
        buildings,
        around,
        streets,
        panorama_lines,
        rings,
        reserved,
        layout.pavement,
        (trees, hedges),
        seed,
    )
    return Estate(
        name,
        seed,
        origin,
        buildings,
        around,
        streets,
        grown,
        clipped,
        parked,
        lamps,
        light or Light(),
        panorama_lines,
    )


def obstacles(estate: Estate) -> BaseGeometry:
    """The area that is taken where a person walks, in world metres.

    Walls, trunks, shrubs, hedges, cars and lamps count; crowns above head height do not.
    """
    return shapely.union_all(
        [
            *(Polygon(building.outline) for building in (*estate.buildings, *estate.neighbours)),
            *(LineString(hedge.line).buffer(hedge.width_m / 2) for hedge in estate.hedges),
            *(Polygon(car_outline(car)) for car in estate.cars),
            *(Point(lamp.place).buffer(0.1) for lamp in estate.lamps),
            *(
                Point(tree.place).buffer(tree.crown_m / 2 if tree.kind == "shrub" else 0.25)
                for tree in estate.trees
            ),
        ]
    )


def _rings_of(buildings: Sequence[Building]) -> tuple[Line, ...]:
    built = [Polygon(building.outline) for building in buildings]
    rings = []
    for index, outline in enumerate(built):
        others = shapely.union_all(built[:index] + built[index + 1 :])
        for distance in (8.0, 17.0):
            around = outline.buffer(distance, quad_segs=4)
            line = np.round(np.array(around.exterior.coords), 3)
            if not others.is_empty and LineString(line).distance(others) < 2.0:
                continue
            rings.append(tuple((float(x), float(y)) for x, y in line))
    return tuple(rings)


def _parked(
    streets: Sequence[Street], taken: BaseGeometry, share: float, seed: int
) -> tuple[Car, ...]:
    """Cars at the kerbs, in loose rows, most of them in the direction of their lane."""
    found = []
    for number, street in enumerate(streets):
        rng = rng_of(seed, "cars", number)
        others = [LineString(s.line).buffer(s.road_m / 2 + 4) for s in streets if s is not street]
        blocked = shapely.union_all([taken, *others])
        line = LineString(street.line)
        for side in (-1, 1):
            cursor = rng.uniform(2, 6)
            while cursor < line.length - 6:
                here, along = _along(line, cursor + 2.5)
                right = np.array([along[1], -along[0]])
                kind = ("saloon", "estate", "hatchback", "van")[
                    int(rng.choice(4, p=[0.3, 0.32, 0.3, 0.08]))
                ]
                length, width, _ = CAR_SIZES_M[kind]
                offset = street.road_m / 2 - width / 2 - rng.uniform(0.08, 0.2)
                place = here + right * side * offset
                heading = np.rad2deg(np.arctan2(along[0], along[1])) + (0 if side > 0 else 180)
                heading += rng.uniform(-1.2, 1.2) + (180 if rng.uniform() < 0.12 else 0)
                car = Car(
                    (millimetres(place[0]), millimetres(place[1])),
                    round(float(heading % 360), 2),
                    kind,
                    CAR_COLOURS[int(rng.choice(8, p=CAR_SHARES))],
                )
                there = rng.uniform() < 0.62 * share
                if there and not Polygon(car_outline(car)).intersects(blocked):
                    found.append(car)
                cursor += length + rng.uniform(0.7, 1.8)
    return tuple(found)


def _lamps(streets: Sequence[Street], blocked: BaseGeometry, seed: int) -> tuple[Lamp, ...]:
    """Lamps along one side of every street, at the kerb."""
    found = []
    roads = shapely.union_all([LineString(s.line).buffer(s.road_m / 2) for s in streets])
    for number, street in enumerate(streets):
        rng = rng_of(seed, "lamps", number)
        line = LineString(street.line)
        side = 1 if rng.uniform() < 0.5 else -1
        height = round(rng.uniform(4.5, 6.5), 1)
        cursor = rng.uniform(4, 14)
        while cursor < line.length:
            here, along = _along(line, cursor)
            place = here + np.array([along[1], -along[0]]) * side * (street.road_m / 2 + 0.45)
            point = Point(place)
            if not point.intersects(blocked) and roads.distance(point) > 0.3:
                found.append(Lamp((millimetres(place[0]), millimetres(place[1])), height))
            cursor += rng.uniform(26, 30)
    return tuple(found)


def _along(line: LineString, distance_m: float) -> tuple[FloatArray, FloatArray]:
    """The point at a distance along a line and the unit direction there."""
    before, after = (
        np.array(line.interpolate(min(max(d, 0.0), line.length)).coords[0])
        for d in (distance_m - 0.5, distance_m + 0.5)
    )
    ahead = after - before
    return (before + after) / 2, ahead / np.linalg.norm(ahead)


def _forecourts(buildings: Sequence[Building]) -> BaseGeometry:
    """The area in front of entrances that stays clear."""
    areas = []
    for building in buildings:
        for foot, outward, width in doors_of(building):
            middle = LineString([foot, foot + outward * 3.5])
            areas.append(middle.buffer(width / 2 + 1.0, cap_style="flat"))
    return shapely.union_all(areas)
