"""The estates that can be asked for by name: buildings, the street before them, and the light."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.estate.drawing import between, millimetres, pick, rng_of
from benchmarks.estate.plan import Building, Estate, Street
from benchmarks.estate.plans.bays import Levels, Point
from benchmarks.estate.plans.buildings import (
    Slab,
    b1,
    b2,
    b3,
    moved,
    neighbour_slab,
    point_block,
    slab_block,
    turned,
)
from benchmarks.estate.plans.citygml import Survey, ingolstadt_estate, ingolstadt_survey
from benchmarks.estate.plans.daylight import light_on
from benchmarks.estate.site.placing import with_surroundings
from shapely import MultiPolygon, Polygon

from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin

Line = tuple[Point, ...]
ROAD_M = 7.0
AWAY_M = 95.0
"""How far a road goes on beyond the part that the vehicle drove."""


@dataclass(frozen=True)
class _Draft:
    """Buildings and roads in a frame of their own; ``driven`` is the panoramas' part of a road."""

    buildings: tuple[Building, ...]
    roads: tuple[Line, ...]
    driven: tuple[Line, ...]
    reach_m: float = 95.0


def _b1(seed: int) -> _Draft:
    return _around_point_block(b1(seed))


def _point(seed: int) -> _Draft:
    return _around_point_block(point_block("point", seed))


def _around_point_block(building: Building) -> _Draft:
    """A road that turns round the front, the right side with the entrance, and the back's half."""
    width, half = building.walls[0].width_m, building.walls[1].width_m
    shift = building.walls[2].width_m
    right, back = width + shift + 12.0, 2 * half + 12.5
    driven = (
        (1.5, -17.0),
        (3.5, -13.8),
        (8.0, -12.5),
        (right - 6, -12.5),
        (right - 1.5, -10.5),
        (right, -6.0),
        (right, back - 6.0),
        (right - 1.5, back - 1.5),
        (right - 6.0, back),
        (shift + 9.0, back),
    )
    road = ((1.5, -AWAY_M), *driven, (shift + 4.5, back + 1.5), (shift + 3.0, back + 6.0))
    return _Draft((building,), ((*road, (shift + 3.0, back + AWAY_M)),), (driven,))


def _b2(seed: int) -> _Draft:
    """The balconies' side and both gables lie at the road; nobody drives behind the house."""
    right = ((22.5, -13.5), (27.5, -12.0), (30.0, -8.0), (30.5, -3.0), (30.5, 9.0))
    driven = (*((-x, y) for x, y in right[::-1]), *right)
    road = ((-30.5, AWAY_M), *driven, (30.5, AWAY_M))
    return _Draft((b2(seed),), (road,), (driven,))


def _b3(seed: int) -> _Draft:
    """The stepped side with balconies and the right gable lie at the road."""
    driven = (
        (3.0, -20.0),
        (4.5, -16.5),
        (9.0, -15.0),
        (76.0, -15.0),
        (82.0, -13.5),
        (85.0, -9.5),
        (85.6, -4.0),
        (85.6, 8.0),
    )
    road = ((3.0, -AWAY_M), *driven, (85.6, AWAY_M))
    return _Draft((b3(seed),), (road,), (driven,))


def _slab(seed: int) -> _Draft:
    """A slab block of 3-4 storeys, stairs or balconies at the road."""
    rng = rng_of(seed, "slab", "size")
    storeys = int(rng.integers(3, 5))
    units = pick(rng, ((5, 5, 5), (4, 4, 4), (6, 6, 6), (5, 5, 5, 5), (7, 7)))
    module = between(rng, 2.8, 3.4, 0.1)
    ground = pick(rng, (0.45, 0.7, 1.2, 1.3))
    attic = 1.3 if rng.random() < 0.25 else between(rng, 0.25, 0.4)
    levels = Levels(ground, 2.75, storeys, millimetres(ground + storeys * 2.75 + attic))
    slab = Slab(
        millimetres(sum(units) * module),
        between(rng, 11.0, 12.0, 0.2),
        units,
        levels,
        pick(rng, ("stairs", "balconies")),
        (pick(rng, ("", "-b-", "b-b")), pick(rng, ("", "-b-"))),
    )
    return _along_front((slab_block("slab", slab, seed),), 13.0)


def _high_slab(seed: int) -> _Draft:
    """A slab of 8-9 storeys."""
    rng = rng_of(seed, "high-slab", "size")
    storeys = int(rng.integers(8, 10))
    units = pick(rng, ((5, 5, 5), (4, 4, 4, 4), (6, 6, 6)))
    module = between(rng, 3.0, 3.6, 0.1)
    ground = between(rng, 0.6, 0.8, 0.1)
    slab = Slab(
        millimetres(sum(units) * module),
        between(rng, 11.6, 13.0, 0.2),
        units,
        Levels(ground, 2.7, storeys, millimetres(ground + storeys * 2.7 + 0.4)),
        pick(rng, ("stairs", "balconies")),
        (pick(rng, ("", "-b-", "bkb")), pick(rng, ("", "-b-"))),
        "flat",
        ("panel", "panel", "brick", "metal"),
    )
    return _along_front((slab_block("high-slab", slab, seed),), 15.5)


def _small(seed: int) -> _Draft:
    """One house of 3 storeys."""
    levels = Levels(0.6, 2.7, 3, 9.0)
    slab = Slab(14.0, 10.4, (4,), levels, "stairs", ("-b-", ""))
    return _along_front((slab_block("small", slab, seed),), 12.0, reach_m=60.0)


def _street(seed: int) -> _Draft:
    """Three houses at both sides of 49 m of road; the one in the south turns balconies to it."""
    rng = rng_of(seed, "street", "finishes")
    first = int(rng.integers(3))
    skins = (("brick",), ("plaster",), ("panel",))

    def house(
        name: str, units: tuple[int, ...], length: float, storeys: int, roof: str, index: int
    ) -> Building:
        levels = Levels(0.65, 2.8, storeys, milletop(storeys))
        front = "balconies" if name == "south-1" else "stairs"
        slab = Slab(
            length,
            11.0,
            units,
            levels,
            front,
            ("-b-", ""),
            "gable" if roof == "gable" else "flat",
            skins[(first + index) % 3],
            ("railing", "solid"),
        )
        return slab_block(name, slab, seed)

    def milletop(storeys: int) -> float:
        return millimetres(0.65 + storeys * 2.8 + 0.35)

    houses = (
        moved(house("north-1", (4, 4), 24.0, 4, "flat", 0), 0.0, (12.0, 11.0)),
        moved(house("north-2", (6,), 19.0, 3, "gable", 1), 0.0, (38.5, 11.6)),
        moved(house("south-1", (5, 4), 26.0, 4, "flat", 2), 180.0, (23.0, -11.0)),
    )
    driven = ((-0.5, 0.0), (48.5, 0.0))
    road = ((-AWAY_M, 0.0), *driven, (48.0 + AWAY_M, 0.0))
    return _Draft(houses, (road,), (driven,))


def _along_front(
    buildings: tuple[Building, ...], distance_m: float, reach_m: float = 95.0
) -> _Draft:
    """A straight road along the front of the first building, some metres longer than that."""
    half = buildings[0].walls[0].width_m / 2
    driven = ((-half - 8.0, -distance_m), (half + 8.0, -distance_m))
    road = ((-half - AWAY_M, -distance_m), *driven, (half + AWAY_M, -distance_m))
    return _Draft(buildings, (road,), (driven,), reach_m)


_DRAFTS: dict[str, Callable[[int], _Draft]] = {
    "b1": _b1,
    "b2": _b2,
    "b3": _b3,
    "slab": _slab,
    "high-slab": _high_slab,
    "point": _point,
    "small": _small,
    "street": _street,
}
SPECS: tuple[str, ...] = tuple(_DRAFTS)
SURVEYED = "ingolstadt:"
"""Before the name of a surveyed building's file."""


def estate_of(spec: str, seed: int, data: Path | None = None) -> Estate:
    """The estate of one of ``SPECS``; equal arguments give equal estates everywhere.

    The world's origin is the centroid of the target buildings; the estate lies near Gothenburg and
    is turned by an angle of the seed. ``ingolstadt:<file stem>`` is a real building from a CityGML
    file in the folder ``data`` (by default ``lod3-ingolstadt`` in that of ``SI3FP_TEST_DATA``).
    """
    if spec.startswith(SURVEYED):
        return ingolstadt_estate(spec.removeprefix(SURVEYED), seed, data)
    if spec not in _DRAFTS:
        raise InputError(
            f"No estate is called {spec!r}; there are: {', '.join(SPECS)}, {SURVEYED}<file stem>."
        )
    draft = _DRAFTS[spec](seed)
    rng = rng_of(seed, spec, "place")
    turn_deg = float(rng.integers(3600)) / 10
    centre = MultiPolygon([Polygon(building.outline) for building in draft.buildings]).centroid
    middle = turned((centre.x, centre.y), turn_deg, (0.0, 0.0))
    shift = (-middle[0], -middle[1])

    def placed(line: Line) -> Line:
        return tuple(
            (millimetres(x), millimetres(y))
            for x, y in (turned(point, turn_deg, shift) for point in line)
        )

    index = SPECS.index(spec)
    origin = GeoOrigin(round(57.69 + 0.0041 * index, 5), round(11.98 + 0.0063 * index, 5), 14.0)
    buildings = tuple(moved(building, turn_deg, shift) for building in draft.buildings)
    driven = tuple(placed(line) for line in draft.driven)
    return with_surroundings(
        spec,
        seed,
        origin,
        buildings,
        tuple(Street(placed(road), ROAD_M) for road in draft.roads),
        driven,
        light=light_on(buildings, driven, origin, rng_of(seed, spec, "light")),
        reach_m=draft.reach_m,
        neighbour=neighbour_slab,
    )


def survey_of(spec: str, data: Path | None = None) -> Survey | None:
    """What became of the openings of a surveyed building; None for an estate that is drawn."""
    if not spec.startswith(SURVEYED):
        return None
    return ingolstadt_survey(spec.removeprefix(SURVEYED), data)
