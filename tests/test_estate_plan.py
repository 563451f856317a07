"""The plans of estates: the paper's numbers, and what holds for every spec and seed."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import shapely
from benchmarks.estate import specs
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.plan import Building, Estate, Opening, Wall
from benchmarks.estate.plans.buildings import neighbour_slab
from benchmarks.estate.plans.sight import seen_shares
from benchmarks.estate.site.neighbours import NeighbourPlace
from benchmarks.estate.specs import SPECS, estate_of
from shapely import LineString, Polygon, box

from si3fp.errors import InputError

SEEDS = range(1, 11)
DIGESTS = {
    "b1": "7e81614bbad0536fcbcadd1be8c11297616b94e825384e293f78edfe5d98519f",
    "b2": "8db2a57531f77296d271881a62d2ba76174e1930ab1a969974a90f2a2d1bff20",
    "b3": "7adbbd4faebd696853f0b36cdb8d18e689d6991741e25bfbc895b8550183e5be",
    "slab": "ed3e99ac012400396b1d049fb10e1382da288e36b9e9c9f41d9b624f05064f41",
    "high-slab": "1fb4a0ece65fe4336a0f1e9dad86f7ab3945c1e910b026eca1963ee8fbd3142e",
    "point": "e4c3001410f6099dff6cca23705c1edc806c99b4551d11fb43321ed2da16284f",
    "small": "a82e6033220d64db970d8de568f2b60f81323703427dd05dbbde236bfcf6836e",
    "street": "7b1277b9813ade2c20329de5d5540f2d871f5aa3b93fcd3cc722201396388c07",
}
MICROMETRE = 2e-6
NO_AREA_M2 = 1e-6


@pytest.fixture(scope="module")
def estates() -> dict[tuple[str, int], Estate]:
    """Every spec with every seed, without what stands around: that has tests of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(specs, "with_surroundings", _bare)
        return {(spec, seed): estate_of(spec, seed) for spec in SPECS for seed in SEEDS}


def _bare(name, seed, origin, buildings, streets, panorama_lines, *, light, **_):
    return Estate(
        name,
        seed,
        origin,
        buildings,
        streets=streets,
        light=light,
        panorama_lines=panorama_lines,
    )


def _houses(estates: dict[tuple[str, int], Estate]) -> list[Building]:
    return [building for estate in estates.values() for building in estate.buildings]


def _walls(estates: dict[tuple[str, int], Estate]) -> list[Wall]:
    return [wall for house in _houses(estates) for wall in house.walls]


def _box(opening: Opening) -> Polygon:
    x, y = opening.x_m, opening.y_m
    return box(x, y, x + opening.width_m, y + opening.height_m)


def _overlap_m2(shapes: list[Polygon]) -> float:
    return sum(shape.area for shape in shapes) - shapely.union_all(shapes).area


def _glazed(wall: Wall) -> list[Opening]:
    return [opening for opening in wall.openings if opening.kind != "door"]


def _wwr(wall: Wall) -> float:
    return sum(o.width_m * o.height_m for o in _glazed(wall)) / (wall.width_m * wall.height_m)


@pytest.mark.parametrize(
    ("spec", "height_m", "longest_m", "facades", "unseen"),
    [("b1", 23.2, 14.9, 8, 3), ("b2", 22.7, 35.2, 4, 1), ("b3", 11.0, 71.6, 6, 2)],
)
def test_the_papers_buildings_have_its_numbers(estates, spec, height_m, longest_m, facades, unseen):
    for seed in SEEDS:
        estate = estates[spec, seed]
        (building,) = estate.buildings
        assert building.height_m == height_m
        assert {wall.height_m for wall in building.walls} == {height_m}
        assert max(wall.width_m for wall in building.walls) == pytest.approx(
            longest_m, abs=MICROMETRE
        )
        assert len(building.walls) == facades
        shares = seen_shares(estate.buildings, estate.panorama_lines)
        assert sorted(shares.values()) == [0.0] * unseen + [1.0] * (facades - unseen)


@pytest.mark.parametrize("spec", ["b1", "b2", "b3"])
def test_the_papers_buildings_have_facades_with_and_without_balconies(estates, spec):
    for seed in SEEDS:
        estate = estates[spec, seed]
        shares = seen_shares(estate.buildings, estate.panorama_lines)
        seen = [w for w in estate.buildings[0].walls if shares[w.id] and _glazed(w)]
        assert {wall.has_balconies for wall in seen} == {True, False}


def test_b3_has_a_gable_without_windows(estates):
    for seed in SEEDS:
        blind = [w for w in estates["b3", seed].buildings[0].walls if not _glazed(w)]
        assert max(wall.width_m for wall in blind) > 10


def test_outlines_are_simple_and_counter_clockwise_with_right_angles(estates):
    for house in _houses(estates):
        outline = Polygon(house.outline)
        assert outline.is_valid
        assert outline.exterior.is_ccw
        for one, two in pairwise((*house.walls, house.walls[0])):
            assert one.end == two.start
            turn = one.world_from_facade.rotation[:, 0] @ two.world_from_facade.rotation[:, 0]
            assert abs(turn) < 1e-5
        assert [wall.id for wall in house.walls] == [
            f"{house.id}-{index}" for index in range(len(house.walls))
        ]


def test_openings_lie_inside_their_walls_and_apart(estates):
    for wall in _walls(estates):
        outline = Polygon(wall.outline) if wall.outline else box(0, 0, wall.width_m, wall.height_m)
        assert outline.bounds == pytest.approx((0, 0, wall.width_m, wall.height_m), abs=MICROMETRE)
        boxes = [_box(opening) for opening in wall.openings]
        assert all(outline.buffer(-0.04).covers(each) for each in boxes), wall.id
        assert _overlap_m2(boxes) < NO_AREA_M2, wall.id


def test_loggias_hold_their_openings_and_balconies_leave_them_whole(estates):
    for wall in _walls(estates):
        for balcony in wall.balconies:
            x, y, width = balcony.x_m, balcony.y_m, balcony.width_m
            assert x >= 0 and x + width <= wall.width_m
            held = box(x, y, x + width, y + balcony.clear_m)
            slab = box(x, y - balcony.slab_m, x + width, y)
            doors = 0
            for opening in wall.openings:
                shape = _box(opening)
                assert shape.intersection(slab).area < NO_AREA_M2, wall.id
                if not shape.intersects(held):
                    continue
                assert held.covers(shape), wall.id
                doors += opening.kind == "balcony_door"
                expected = balcony.depth_m if balcony.kind == "loggia" else 0.0
                assert opening.depth_m == expected
            assert doors == 1
        deep = [opening for opening in wall.openings if opening.depth_m]
        assert not deep or {balcony.kind for balcony in wall.balconies} == {"loggia"}


def test_no_room_with_a_window_lies_where_a_neighbouring_wall_has_its_loggia(estates):
    """Rooms are at least as wide as their windows, and go in as far as the loggias do."""
    loggias = 0
    for estate in estates.values():
        for house in estate.buildings:
            every = [(w, each) for w in house.walls for each in w.balconies]
            cut = [(w, each) for w, each in every if each.kind == "loggia"]
            taken = [_behind(w, each.x_m, each.width_m, each.depth_m) for w, each in cut]
            top_m = max((each.y_m + each.clear_m for _, each in cut), default=0.0)
            loggias += len(taken)
            for wall in house.walls:
                for each in wall.openings:
                    if each.depth_m == 0 and wall.plinth_m < each.y_m < top_m:
                        room = _behind(wall, each.x_m, each.width_m, 1.0)
                        assert all(room.intersection(part).area < NO_AREA_M2 for part in taken)
    assert loggias > 20


def _behind(wall: Wall, x_m: float, width_m: float, depth_m: float) -> Polygon:
    """The part of the house behind a stretch of a wall, seen from above."""
    place, turn = wall.world_from_facade.translation, wall.world_from_facade.rotation
    corners = [(x_m, 0), (x_m + width_m, 0), (x_m + width_m, -depth_m), (x_m, -depth_m)]
    return Polygon([(place + turn @ (x, 0.0, z))[:2] for x, z in corners])


def test_balconies_and_ornaments_keep_clear_of_each_other_and_of_openings(estates):
    for wall in _walls(estates):
        balconies = [
            box(b.x_m, b.y_m - b.slab_m, b.x_m + b.width_m, b.y_m + b.clear_m)
            for b in wall.balconies
        ]
        assert _overlap_m2(balconies) < NO_AREA_M2, wall.id
        loggias = [
            shape for shape, b in zip(balconies, wall.balconies, strict=True) if b.kind == "loggia"
        ]
        taken = shapely.union_all([*loggias, *(_box(opening) for opening in wall.openings)])
        for thing in wall.ornaments:
            x, y = thing.x_m, thing.y_m
            shape = box(x, y, x + thing.width_m, y + thing.height_m)
            assert box(0, 0, wall.width_m, wall.height_m).covers(shape), (wall.id, thing)
            assert shape.intersection(taken).area < NO_AREA_M2, (wall.id, thing)


def test_windows_have_the_sizes_and_depths_of_their_time(estates):
    for wall in _walls(estates):
        for opening in wall.openings:
            assert 0.05 <= opening.recess_m <= 0.36
            assert sum(opening.style.lights) == pytest.approx(1)
            assert 0.4 <= opening.width_m <= 2.4
            assert 0.39 <= opening.height_m <= 2.45
            assert opening.kind != "balcony_door" or 0.2 < opening.style.panel < 0.5


def test_window_to_wall_ratios_are_those_of_such_houses(estates):
    for (spec, _), estate in estates.items():
        for house in estate.buildings:
            longest = max(wall.width_m for wall in house.walls)
            ratios = [_wwr(wall) for wall in house.walls if wall.width_m > 0.8 * longest]
            assert all(0.10 <= ratio <= 0.36 for ratio in ratios), (spec, ratios)
            assert (
                0.08
                < sum(_wwr(wall) * wall.width_m * wall.height_m for wall in house.walls)
                / sum(wall.width_m * wall.height_m for wall in house.walls)
                < 0.26
            )


def test_seeds_give_different_houses(estates):
    for spec in SPECS:
        assert len({repr(estates[spec, seed].buildings) for seed in SEEDS}) == len(SEEDS)
        skins = {estates[spec, seed].buildings[0].walls[0].finish.rgb for seed in SEEDS}
        assert len(skins) >= 5


def test_vehicles_drive_on_roads_that_keep_off_the_houses(estates):
    for estate in estates.values():
        built = shapely.union_all([Polygon(house.outline) for house in estate.buildings])
        roads = shapely.union_all([LineString(street.line) for street in estate.streets])
        assert not built.is_empty
        for street in estate.streets:
            kerb = LineString(street.line).buffer(street.road_m / 2 + street.pavement_m)
            assert kerb.distance(built) > 3.0
        for line in estate.panorama_lines:
            assert LineString(line).distance(built) < 16
            assert roads.buffer(0.01).covers(LineString(line))


def test_neighbours_fill_their_places(estates):
    like = estates["small", 1].buildings[0]
    for index, (length, storeys) in enumerate([(26.2, 3), (51.9, 4), (20.4, 8), (43.0, 3)]):
        place = NeighbourPlace((12.0, -30.0), 77.7, length, 11.3, storeys, like)
        house = neighbour_slab("n", place, rng_of(index, "neighbour"))
        assert house.outline == pytest.approx(place.outline, abs=MICROMETRE)
        assert house.storeys == storeys
        assert len(house.walls[0].openings) >= 6 * storeys
        assert any(opening.kind == "door" for wall in house.walls for opening in wall.openings)


def test_the_street_has_its_three_houses_on_both_sides(estates):
    for seed in SEEDS:
        estate = estates["street", seed]
        assert [house.id for house in estate.buildings] == ["north-1", "north-2", "south-1"]
        line = np.array(estate.panorama_lines[0])
        assert np.hypot(*(line[1] - line[0])) == pytest.approx(49, abs=0.002)
        assert max(house.storeys for house in estate.buildings) <= 4
        shares = seen_shares(estate.buildings, estate.panorama_lines)
        assert all(shares[f"{house.id}-0"] == 1 for house in estate.buildings)


def test_the_world_begins_between_the_houses(estates):
    for estate in estates.values():
        built = shapely.union_all([Polygon(house.outline) for house in estate.buildings])
        assert np.hypot(built.centroid.x, built.centroid.y) < 0.001


def test_a_bright_sun_lights_a_wall_that_is_seen(estates):
    for estate in estates.values():
        hour = estate.light.hour_utc
        assert 7 <= hour <= 14.5
        assert 0 <= estate.light.cloud <= 1
        if estate.light.cloud > 0.35:
            continue
        azimuth = np.deg2rad(180 + 15 * (hour - 12) + estate.origin.lon_deg)
        sun = np.array([np.sin(azimuth), np.cos(azimuth)])
        shares = seen_shares(estate.buildings, estate.panorama_lines)
        walls = [w for house in estate.buildings for w in house.walls if shares[w.id] == 1]
        assert max(wall.world_from_facade.rotation[:2, 2] @ sun for wall in walls) > 0.3


def test_a_plan_is_the_same_in_another_process():
    spec, seed = "b1", 1
    program = (
        "import hashlib; from benchmarks.estate.specs import estate_of;"
        f"print(hashlib.sha256(repr(estate_of({spec!r}, {seed})).encode()).hexdigest())"
    )
    root = Path(__file__).parents[1]
    other = subprocess.run(
        [sys.executable, "-c", program], cwd=root, capture_output=True, text=True, check=True
    )
    estate = estate_of(spec, seed)
    assert other.stdout.strip() == hashlib.sha256(repr(estate).encode()).hexdigest()


@pytest.mark.parametrize("spec", sorted(DIGESTS))
def test_plans_are_the_same_on_every_machine(estates, spec):
    """Buildings, streets and light; a change here makes every rendered set another one."""
    plans = [estates[spec, seed] for seed in SEEDS]
    text = repr([(e.buildings, e.streets, e.panorama_lines, e.light) for e in plans])
    assert hashlib.sha256(text.encode()).hexdigest() == DIGESTS[spec]


def test_an_unknown_name_is_an_error_with_the_known_ones():
    with pytest.raises(InputError, match=r"no-such.*b1, b2, b3"):
        estate_of("no-such", 1)
