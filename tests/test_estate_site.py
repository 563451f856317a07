"""Surroundings of estates: nothing in the way, the same for a seed, meshes that render."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.parts import Parts
from benchmarks.estate.plan import Car, Estate, Hedge, Light, Street, Tree
from benchmarks.estate.site import ground, surroundings
from benchmarks.estate.site.car_shapes import CAR_SIZES_M, car_outline
from benchmarks.estate.site.cars import car_parts
from benchmarks.estate.site.foliage import hedge_parts, season_of
from benchmarks.estate.site.layout import doors_of, layout_of
from benchmarks.estate.site.neighbours import NeighbourPlace, plain_neighbour
from benchmarks.estate.site.placing import obstacles, with_surroundings
from benchmarks.estate.site.planting import Sight, _wall_samples
from benchmarks.estate.site.trees import DETAILS, HABITS, prototype, tree_parts
from shapely import LineString, Point, Polygon

from si3fp.geometry.enu import GeoOrigin

ORIGIN = GeoOrigin(59.3, 18.0, 20.0)
TURNS_DEG = (90.0, 17.0, 250.0)


def estate_with(seed: int, turn_deg: float, trees: float = 1.0) -> Estate:
    """One slab of 48 m, a street 9 m in front of it."""
    place = NeighbourPlace((0.0, 0.0), turn_deg, 48.0, 11.0, 3, None)  # type: ignore[arg-type]
    target = plain_neighbour("T", place, rng_of(seed, "target"))
    frame = target.walls[0].world_from_facade
    along, outward = frame.rotation[:2, 0], frame.rotation[:2, 2]
    middle = outward * (5.5 + 9 + 2 + 3.5)
    street = [tuple(np.round(middle + along * s, 3).tolist()) for s in (-100, 100)]
    driven = [tuple(np.round(middle + along * s, 3).tolist()) for s in (-40, 40)]
    return with_surroundings(
        "test",
        seed,
        ORIGIN,
        (target,),
        (Street(tuple(street), 7.0, 2.0),),
        (tuple(driven),),
        trees=trees,
    )


@pytest.fixture(scope="module")
def estates() -> list[Estate]:
    return [estate_with(seed, turn) for seed, turn in enumerate(TURNS_DEG)]


def things(estate: Estate) -> list[shapely.Geometry]:
    return [
        *(LineString(hedge.line).buffer(hedge.width_m / 2) for hedge in estate.hedges),
        *(Polygon(car_outline(car)) for car in estate.cars),
        *(Point(lamp.place) for lamp in estate.lamps),
        *(Point(tree.place).buffer(0.25) for tree in estate.trees),
    ]


def test_an_estate_has_some_of_everything(estates: list[Estate]) -> None:
    for estate in estates:
        assert len(estate.neighbours) >= 6
        assert len(estate.trees) >= 60
        assert len(estate.cars) >= 10
        assert len(estate.lamps) >= 5
    assert {tree.kind for estate in estates for tree in estate.trees} == set(HABITS)
    assert {car.kind for estate in estates for car in estate.cars} == set(CAR_SIZES_M)
    assert sum(len(estate.hedges) for estate in estates) >= 2


def test_nothing_stands_in_walls_or_one_another(estates: list[Estate]) -> None:
    for estate in estates:
        built = [Polygon(b.outline) for b in (*estate.buildings, *estate.neighbours)]
        whole = shapely.union_all(built)
        assert whole.area == pytest.approx(sum(b.area for b in built))
        placed = things(estate)
        assert not any(thing.intersects(whole) for thing in placed)
        together = shapely.union_all(placed).area
        assert together == pytest.approx(sum(t.area for t in placed), rel=1e-6)


def test_only_cars_stand_on_roads_and_they_leave_the_lane(estates: list[Estate]) -> None:
    for estate in estates:
        street = estate.streets[0]
        line = LineString(street.line)
        road, lane = line.buffer(street.road_m / 2, cap_style="flat"), line.buffer(1.4)
        cars = [Polygon(car_outline(car)) for car in estate.cars]
        others = dataclasses.replace(estate, cars=())
        assert not any(thing.intersects(road) for thing in things(others))
        assert all(car.within(road) and not car.intersects(lane) for car in cars)
        assert not any(Polygon(b.outline).intersects(road) for b in estate.neighbours)


def test_panorama_lines_and_walks_stay_free(estates: list[Estate]) -> None:
    for estate in estates:
        taken = obstacles(estate)
        for line in estate.panorama_lines:
            assert LineString(line).distance(taken) > 1.45
        for ring in walks_around(estate):
            assert ring.distance(taken) > 1.0


def walks_around(estate: Estate) -> list[shapely.LinearRing]:
    """The loops 8 and 17 m from the only target."""
    outline = Polygon(estate.buildings[0].outline)
    return [outline.buffer(away_m, quad_segs=4).exterior for away_m in (8.0, 17.0)]


def test_walls_cars_trunks_and_shrubs_are_obstacles_and_crowns_are_none(
    estates: list[Estate],
) -> None:
    estate = estates[0]
    taken = obstacles(estate)
    shrub = next(tree for tree in estate.trees if tree.kind == "shrub")
    tree = max(estate.trees, key=lambda tree: tree.crown_m)
    for inside in (
        estate.buildings[0].outline.mean(axis=0),
        estate.cars[0].place,
        (shrub.place[0] + 0.4 * shrub.crown_m, shrub.place[1]),
        tree.place,
    ):
        assert taken.contains(Point(inside))
    alone = dataclasses.replace(
        estate, buildings=(), neighbours=(), trees=(tree,), hedges=(), cars=(), lamps=()
    )
    assert obstacles(alone).area == pytest.approx(np.pi * 0.25**2, rel=0.02)


def test_entrances_stay_free(estates: list[Estate]) -> None:
    for estate in estates:
        doors = [door for b in estate.buildings for door in doors_of(b)]
        assert doors
        taken = obstacles(estate)
        for foot, outward, _ in doors:
            ahead = LineString([foot + outward, foot + 3.0 * outward])
            assert ahead.distance(taken) > 0.8


def test_crowns_leave_half_of_the_views_of_every_wall() -> None:
    estate = estate_with(3, 40.0, trees=2.0)
    points, outward = _wall_samples(estate.buildings)
    walls = Polygon(estate.buildings[0].outline).buffer(-0.05)
    lines = [*(LineString(line) for line in estate.panorama_lines), *walks_around(estate)]
    places = np.concatenate(
        [shapely.get_coordinates(shapely.segmentize(line, 4.0)) for line in lines]
    )
    crowns = shapely.union_all(
        [Point(t.place).buffer(t.crown_m * 0.44) for t in estate.trees if t.kind != "shrub"]
    )
    hidden = 0
    for point, normal in zip(points, outward, strict=True):
        way = places - point
        away = np.linalg.norm(way, axis=1)
        looking = places[(away < 40) & (way @ normal > away * 0.5)]
        rays = shapely.linestrings([[point + 0.1 * normal, place] for place in looking])
        rays = rays[~shapely.intersects(rays, walls)]
        blocked = shapely.intersects(rays, crowns)
        hidden += int(blocked.sum())
        assert blocked.mean() <= 0.5
    assert hidden > 20  # trees do stand in the way of some views


def test_a_crown_that_would_hide_a_wall_is_not_allowed() -> None:
    building = estate_with(0, 90.0).buildings
    along = np.linspace(-20, 20, 9)
    street = np.column_stack([along, np.full(9, -20.0)])
    sight = Sight(building, street)
    assert not sight.allows(np.array([0.0, -7.0]), 8.0)
    assert sight.allows(np.array([0.0, -12.0]), 1.0)
    assert sight.allows(np.array([0.0, 30.0]), 8.0)


def test_the_same_seed_gives_the_same_estate(estates: list[Estate]) -> None:
    assert estate_with(0, TURNS_DEG[0]) == estates[0]
    assert estates[1].trees != estates[0].trees


def test_without_trees_there_are_none() -> None:
    assert estate_with(0, 90.0, trees=0.0).trees == ()


def test_seasons_follow_the_date() -> None:
    dates = {"04-12": "bare", "05-14": "spring", "06-12": "summer", "10-10": "autumn"}
    dates["11-20"] = "bare"
    assert {day: season_of(f"2024-{day}") for day in dates} == dates


def sound(parts: Parts) -> None:
    """Fails where a renderer would."""
    assert parts.meshes
    for mesh in parts.meshes:
        assert mesh.material in parts.materials
        assert np.isfinite(mesh.vertices).all()
        assert mesh.faces.min() >= 0
        assert mesh.faces.max() < len(mesh.vertices)
        if mesh.uv is not None:
            assert mesh.uv.shape == (len(mesh.vertices), 2)
            assert np.isfinite(mesh.uv).all()
        if mesh.normals is not None:
            np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-3)


@pytest.mark.parametrize("kind", HABITS)
def test_a_tree_has_its_height_crown_and_place(kind: str) -> None:
    tree = Tree((30.0, -20.0), 9.0, 5.0, kind)  # type: ignore[arg-type]
    parts = tree_parts([tree], "summer", 1)
    sound(parts)
    points = np.concatenate([mesh.vertices for mesh in parts.meshes])
    wide = np.ptp(np.percentile(points[:, :2], [2, 98], axis=0), axis=0)
    assert points[:, 2].min() > -0.15
    assert points[:, 2].max() == pytest.approx(9.0, rel=0.15)
    assert (abs(wide - 5.0) < 1.6).all()
    assert np.hypot(*(points[:, :2].mean(axis=0) - tree.place)) < 1.0


@pytest.mark.parametrize("kind", HABITS)
def test_trees_keep_to_their_triangles(kind: str) -> None:
    most = {"fine": 42_000, "medium": 11_000, "far": 1_600}
    for detail in DETAILS:
        for season in ("summer", "bare"):
            meshes, _ = prototype(kind, 0, season, detail)  # type: ignore[arg-type]
            assert 100 < sum(len(mesh.faces) for mesh in meshes) < most[detail]


def test_bare_trees_have_no_leaves_but_pines_keep_their_needles() -> None:
    trees = [Tree((8.0 * i, 0.0), 9.0, 5.0, kind) for i, kind in enumerate(HABITS)]  # type: ignore[arg-type]
    names = {mesh.material for mesh in tree_parts(trees, "bare", 1).meshes}
    assert [name for name in names if name.startswith("leaf")] == ["leaf-needles-summer"]


@pytest.mark.parametrize("season", ["summer", "bare"])
def test_a_hedge_fills_its_line(season: str) -> None:
    parts = hedge_parts([Hedge(((0, 0), (6, 0)), 0.8, 1.2)], season, 1)  # type: ignore[arg-type]
    sound(parts)
    points = np.concatenate([mesh.vertices for mesh in parts.meshes])
    np.testing.assert_allclose(points.min(axis=0), [0, -0.4, 0], atol=0.25)
    np.testing.assert_allclose(points.max(axis=0), [6, 0.4, 1.2], atol=0.25)


@pytest.mark.parametrize("kind", CAR_SIZES_M)
@pytest.mark.parametrize("coarse", [False, True])
def test_a_car_fills_its_outline_and_stands_on_the_road(kind: str, coarse: bool) -> None:
    car = Car((12.0, 7.0), 63.0, kind, (0.4, 0.1, 0.1))  # type: ignore[arg-type]
    parts = car_parts([car], -0.1, 1, coarse=coarse)
    sound(parts)
    points = np.concatenate([mesh.vertices for mesh in parts.meshes])
    corners = car_outline(car)
    length, width, height = CAR_SIZES_M[kind]
    # Mirrors stand out of the sides, plates a little out of the ends.
    hull = Polygon(corners).buffer(0.18)
    assert shapely.contains_xy(hull, points[:, 0], points[:, 1]).all()
    covered = shapely.MultiPoint(points[:, :2]).convex_hull
    assert covered.intersection(Polygon(corners)).area > 0.9 * length * width
    assert points[:, 2].min() == pytest.approx(-0.1, abs=0.03)
    assert points[:, 2].max() == pytest.approx(height - 0.1, abs=0.05)


@pytest.mark.parametrize("kind", CAR_SIZES_M)
def test_a_car_looks_outwards(kind: str) -> None:
    parts = car_parts([Car((0, 0), 0.0, kind, (0.5, 0.5, 0.5))], 0.0, 1)  # type: ignore[arg-type]
    centre = np.array([0.0, 0.0, 0.65])
    for mesh in parts.meshes:
        if (
            mesh.material not in ("car_glass", "car-tail", "car-plate")
            and "paint" not in mesh.material
        ):
            continue
        corners = mesh.vertices[mesh.faces].astype(np.float64)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        outward = corners.mean(axis=1) - centre
        area = np.linalg.norm(normal, axis=1)
        share = area[np.sum(normal * outward, axis=1) > 0].sum() / area.sum()
        assert share > 0.93
        if mesh.normals is not None:
            smooth = mesh.normals[mesh.faces].mean(axis=1)
            same = np.sum(smooth * normal, axis=1) > 0
            assert area[same].sum() / area.sum() > 0.97


def test_the_ground_is_labelled_by_use(estates: list[Estate]) -> None:
    estate = estates[0]  # its street runs along x at y = -20
    layout = layout_of((*estate.buildings, *estate.neighbours), estate.streets)
    bounds = (-24.0, -40.0, 24.0, 10.0)
    labels = ground.label_image(estate, layout, bounds, 0.1)
    assert labels.shape == (500, 480)
    assert (labels[300, 100:380] == ground.ASPHALT).all()  # y = -20
    assert np.mean(labels[300 - 45, :] == ground.PAVING) == 1.0  # y = -15.5
    assert (labels[300 - 32, :] == ground.PARKING).all()  # y = -16.8
    assert np.mean(labels[120:180] == ground.GRASS) > 0.5  # lawn before the building


def test_all_surroundings_are_sound(estates: list[Estate], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ground, "NEAR_TEXEL_M", 0.4)
    monkeypatch.setattr(ground, "FAR_TEXEL_M", 2.0)
    monkeypatch.setattr(surroundings, "building_parts", lambda *_, **__: Parts())
    estate = dataclasses.replace(estates[1], light=Light("2024-04-10"))
    parts = surroundings.surroundings_parts(estate)
    sound(parts)
    flat = next(mesh for mesh in parts.meshes if mesh.material == "ground-near")
    np.testing.assert_allclose(np.unique(flat.vertices[:, 2]), [-0.1, 0.0], atol=1e-6)
    assert flat.uv is not None
    assert flat.uv.min() > -0.01
    assert flat.uv.max() < 1.01
    corners = flat.vertices[flat.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normal[:, 2] >= 0).all()
    assert sum(len(mesh.faces) for mesh in parts.meshes) < 3_500_000
