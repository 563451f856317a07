"""Where the estate's pictures are taken, and what is reported of them."""

from __future__ import annotations

import json
from dataclasses import astuple, replace

import numpy as np
import pytest
import shapely
from benchmarks.estate.capture.cameras import Equirect, Pose
from benchmarks.estate.capture.drive import facades_seen_from, panorama_poses, towards_buildings
from benchmarks.estate.capture.reported import exact_planes, panorama_feature, reported
from benchmarks.estate.capture.walk import (
    LENS,
    TAPE_SIGMA_M,
    colmap_text,
    flight_around,
    lens_camera,
    photo_lens,
    positions,
    triangle_record,
    walk_around,
)
from benchmarks.estate.plan import Building, Car, Estate, Finish, Tree, Wall
from benchmarks.estate.site.placing import obstacles
from shapely import LineString, Point, Polygon

from si3fp.geometry.enu import GeoOrigin, world_from_geodetic
from si3fp.sources.colmap_text import read_colmap_text
from si3fp.sources.plane_map import decode_plane_map, encode_plane_map
from si3fp.sources.triangle import read_known_distances

ORIGIN = GeoOrigin(57.7, 11.97, 14.0)
STREET = ((-40.0, -14.0), (60.0, -14.0))


def a_block(name: str, west_m: float, height_m: float) -> Building:
    """20 x 10 m, its front on y = 0 looking south."""
    corners = [(west_m, 0.0), (west_m + 20, 0.0), (west_m + 20, 10.0), (west_m, 10.0)]
    finish = Finish("brick", (0.6, 0.3, 0.2))
    walls = tuple(
        Wall(f"{name}-{i}", corners[i], corners[(i + 1) % 4], height_m, finish) for i in range(4)
    )
    return Building(name, walls, height_m, round(height_m / 3), 3.0, 1968)


def an_estate(height_m: float = 9.0, **changes) -> Estate:
    blocks = (a_block("block", 0.0, height_m),)
    return replace(Estate("test", 3, ORIGIN, blocks, panorama_lines=(STREET,)), **changes)


def test_panoramas_stand_on_the_street_and_look_along_it() -> None:
    poses = panorama_poses(an_estate(), 12)
    places = np.array([pose.place for pose in poses.values()])
    assert np.abs(places[:, 1] + 14.0).max() < 1.2
    assert np.abs(places[:, 2] - 2.5).max() < 0.15
    assert all(abs(pose.heading_deg - 90.0) < 12 for pose in poses.values())
    assert np.diff(places[:, 0]).min() > 5.0 and np.diff(places[:, 0]).max() < 11.0
    counts = [facades_seen_from(an_estate(), pose.place[:2]) for pose in poses.values()]
    assert all(counts)
    assert sum("block-0" in names for names in counts) <= 12
    assert not any("block-2" in names for names in counts)  # the back


def test_fewer_panoramas_per_facade_stand_farther_apart() -> None:
    seen = [
        facades_seen_from(an_estate(), p.place[:2]) for p in panorama_poses(an_estate(), 4).values()
    ]
    assert 2 <= sum("block-0" in names for names in seen) <= 4


def test_a_building_between_hides_a_facade() -> None:
    assert "block-0" in facades_seen_from(an_estate(), (10.0, -14.0))
    corners = [(-5.0, -8.0), (25.0, -8.0), (25.0, -4.0), (-5.0, -4.0)]
    fence = a_block("fence", 0.0, 3.0)
    fence = replace(
        fence,
        walls=tuple(
            replace(wall, start=corners[i], end=corners[(i + 1) % 4])
            for i, wall in enumerate(fence.walls)
        ),
    )
    assert facades_seen_from(an_estate(neighbours=(fence,)), (10.0, -14.0)) == []


def test_the_part_of_a_panorama_that_is_rendered_holds_the_building_with_its_margin() -> None:
    estate, width_px = an_estate(), 512
    pose = Pose((4.0, -12.0, 2.5), 77.0, 1.5, -2.0)
    seen = towards_buildings(estate, pose, width_px)
    assert seen.shape == (256, 512)
    assert 0.03 < seen.mean() < 0.5
    camera = Equirect(pose.world_from_cam, width_px)
    wall = np.array([[x, 0.0, z] for x in np.linspace(0, 20, 9) for z in np.linspace(0, 9, 7)])
    column, row = camera.pixels(wall).astype(int).T
    assert seen[row, column].all()
    above = np.array([[4.0, 0.0, 9.0 + 6.0], [4.0, -11.0, 0.0], [4.0, -30.0, 5.0]])
    column, row = camera.pixels(above).astype(int).T
    assert not seen[row, column].any()


def test_plane_maps_show_the_wall_that_a_ray_meets() -> None:
    pose = Pose((4.0, -12.0, 2.5), 77.0, 1.5, -2.0)
    planes, index = exact_planes(an_estate(), pose)
    assert index.shape == (256, 512)
    camera = Equirect(pose.world_from_cam, 512)
    points = np.array([[3.0, 0.0, 4.0], [15.0, 0.0, 8.5], [3.0, 0.0, 9.5], [3.0, -6.0, 0.0]])
    column, row = camera.pixels(points).astype(int).T
    front, also_front, sky, ground = index[row, column]
    assert front == also_front >= 0
    assert sky == -1
    assert ground not in (-1, front)
    in_pano = pose.world_from_cam.inverse().apply(points)
    for number, point in ((front, 0), (ground, 3)):
        distance = planes.normals[number] @ in_pano[point] - planes.offsets_m[number]
        assert distance == pytest.approx(0.0, abs=1e-9)
    assert (planes.offsets_m >= 0).all()


@pytest.mark.parametrize(
    "thing",
    [
        {"trees": (Tree((4.0, -6.0), 8.0, 5.0),)},
        {"cars": (Car((4.0, -6.0), 90.0, "van", (0.5, 0.5, 0.5)),)},
    ],
)
def test_trees_and_cars_hide_walls_in_plane_maps(thing: dict) -> None:
    pose = Pose((4.0, -12.0, 2.5), 0.0, 0.0, 0.0)
    point = np.array([[4.0, 0.0, 4.0]]) if "trees" in thing else np.array([[4.0, 0.0, 0.8]])
    column, row = Equirect(pose.world_from_cam, 512).pixels(point).astype(int)[0]
    assert exact_planes(an_estate(), pose)[1][row, column] >= 0
    assert exact_planes(an_estate(**thing), pose)[1][row, column] == -1


def test_reported_poses_and_planes_are_off_by_what_is_stated() -> None:
    estate = an_estate()
    for name, pose in list(panorama_poses(estate, 12).items())[:3]:
        noisy, planes, index = reported(estate, name, pose)
        shift = np.linalg.norm(np.subtract(noisy.place, pose.place))
        assert 0.099 < shift < 0.151
        angles = np.array([noisy.heading_deg, noisy.pitch_deg, noisy.roll_deg])
        angles -= [pose.heading_deg, pose.pitch_deg, pose.roll_deg]
        assert 0.199 < np.linalg.norm((angles + 180) % 360 - 180) < 0.301
        exact, exact_index = exact_planes(estate, pose)
        assert np.abs(planes.offsets_m - exact.offsets_m).max() < 5 * 0.05
        cosines = (planes.normals * exact.normals).sum(axis=1)
        assert np.rad2deg(np.arccos(cosines)).max() < 5 * 0.3
        gaps = (index == -1) & (exact_index >= 0)
        assert 0 < gaps.sum() < 0.2 * index.size
        assert (index[~gaps] == exact_index[~gaps]).all()
        decoded, decoded_index = decode_plane_map(encode_plane_map(planes, index), name)
        assert (decoded_index == index).all()
        assert decoded.normals == pytest.approx(planes.normals, abs=1e-6)
        assert reported(estate, name, pose)[0] == noisy
        feature = panorama_feature(name, noisy, estate, [])
        lon, lat, height = feature["geometry"]["coordinates"]
        place = world_from_geodetic([lat, lon, height], ORIGIN)
        assert place == pytest.approx(noisy.place, abs=2e-3)


@pytest.mark.parametrize("height_m", [6.0, 9.0, 24.0])
def test_a_walk_closes_overlaps_and_shows_every_wall_up_to_its_top(height_m: float) -> None:
    estate = an_estate(height_m)
    walk = walk_around(estate, 100)
    assert len(walk.poses) == 100
    places = np.unique([pose.place[:2] for pose in walk.poses.values()], axis=0)
    assert not obstacles(estate).dwithin([Point(place) for place in places], 0.5).any()
    pinhole = photo_lens(1600)
    level = [pose for pose in walk.poses.values() if pose.pitch_deg < 16.5]
    half_width = pinhole.width_px / 2 / pinhole.fx_px
    outline = Polygon(estate.buildings[0].outline)
    overlaps = []
    for pose, following in zip(level, level[1:] + level[:1], strict=True):
        distance = Point(pose.place[:2]).distance(outline)
        moved = np.linalg.norm(np.subtract(pose.place[:2], following.place[:2]))
        overlaps.append(1 - moved / (2 * half_width * distance))
    assert min(overlaps) > 0.6 and np.mean(overlaps) > 0.7
    cameras = [lens_camera(pose, pinhole) for pose in walk.poses.values()]
    for wall in estate.buildings[0].walls:
        frame = wall.world_from_facade
        x, y = np.meshgrid(np.linspace(0.2, wall.width_m - 0.2, 9), np.linspace(0.2, height_m, 9))
        points = frame.apply(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3))
        views = np.zeros(len(points))
        for camera in cameras:
            before = (camera.world_from_cam.translation - points) @ frame.rotation[:, 2] > 1
            views += before & np.isfinite(camera.pixels(points)).all(axis=1)
        assert views.min() >= 5


@pytest.mark.parametrize(("height_m", "count"), [(9.0, 60), (24.0, 100)])
def test_a_walk_turns_around_corners_in_steps_that_features_survive(height_m, count) -> None:
    estate = an_estate(height_m)
    outline = Polygon(estate.buildings[0].outline)
    level = [p for p in walk_around(estate, count).poses.values() if p.pitch_deg < 16.5]
    places = np.array([pose.place[:2] for pose in level])
    lines = shapely.shortest_line(shapely.points(places), outline.exterior)
    away = places - shapely.get_coordinates(lines)[1::2]
    bearing = np.unwrap(np.arctan2(away[:, 1], away[:, 0]))
    turns_deg = np.rad2deg(np.diff(bearing))
    assert turns_deg.min() >= 0 and turns_deg.max() < 16
    looked_deg = np.array([pose.heading_deg for pose in level])
    change_deg = (np.diff(looked_deg) + 180) % 360 - 180
    assert np.abs(change_deg).max() < 25  # by hand: 2 degrees of error each


def test_a_walk_keeps_off_what_stands_in_its_way() -> None:
    tree = Tree((10.0, -17.0), 8.0, 3.0, "shrub")
    near = a_block("near", 30.0, 9.0)
    tall = Tree((-9.0, 5.0), 9.0, 4.0)
    walk = walk_around(an_estate(trees=(tree, tall), neighbours=(near,)), 60)
    for pose in walk.poses.values():
        assert Point(pose.place[:2]).distance(Point(tall.place)) > 2.5  # not among its leaves
        assert Point(pose.place[:2]).distance(Point(tree.place)) > 1.5
        assert Point(pose.place[:2]).distance(Polygon(near.outline)) > 0.45


def test_the_triangle_is_measured_where_nothing_stands_between() -> None:
    estate = an_estate()
    walk = walk_around(estate, 60)
    (a, b), (b2, c), (a2, c2) = walk.sides
    assert (a, b, c) == (a2, b2, c2) and len({a, b, c}) == 3
    outline = Polygon(estate.buildings[0].outline)
    errors = []
    for start, end, length_m in triangle_record(walk, estate.seed)["sides_m"]:
        ends = [walk.poses[start].place, walk.poses[end].place]
        assert not LineString([place[:2] for place in ends]).intersects(outline)
        errors.append(length_m - np.linalg.norm(np.subtract(*ends)))
    assert 0 < np.abs(errors).max() < 4 * TAPE_SIGMA_M


def test_the_readers_read_poses_and_triangle(tmp_path) -> None:
    walk, pinhole = walk_around(an_estate(), 24), photo_lens(800)
    for name, text in colmap_text(walk.poses, pinhole).items():
        (tmp_path / name).write_text(text)
    model = read_colmap_text(tmp_path)
    assert {photo.id for photo in model.photos} == set(walk.poses)
    for photo in model.photos:
        assert photo.camera.cx_px == pytest.approx(pinhole.cx_px)
        assert photo.camera.fy_px == pytest.approx(pinhole.fy_px)
        assert model.distortion[photo.id] == pytest.approx(np.array(astuple(LENS)))
        assert photo.centre_in_world == pytest.approx(walk.poses[photo.id].place, abs=1e-9)
        forward = walk.poses[photo.id].world_from_cam.rotation[:, 2]
        assert photo.cam_from_world.rotation[2] == pytest.approx(forward, abs=1e-9)
    file = tmp_path / "reference_triangle.json"
    file.write_text(json.dumps(triangle_record(walk, 3)))
    assert len(read_known_distances(file)) == 3


def test_a_flight_looks_down_at_the_walls_from_above() -> None:
    poses = flight_around(an_estate(), 10)
    assert {round(pose.place[2] / 12.5) for pose in poses.values()} == {1, 2}
    assert len(poses) == 10
    for pose in poses.values():
        pixels = lens_camera(pose, photo_lens(800)).pixels(np.array([[10.0, 5.0, 4.5]]))
        assert np.isfinite(pixels).all()


def test_no_photo_is_taken_from_inside_a_high_tree() -> None:
    estate = an_estate()
    place = next(iter(flight_around(estate, 10).values())).place
    trees = [Tree(place[:2], height_m, 6.0) for height_m in (11.0, 16.0)]
    counts = [len(flight_around(replace(estate, trees=(tree,)), 10)) for tree in trees]
    assert counts == [10, 9]


def test_positions_are_metres_off() -> None:
    estate = an_estate()
    poses = walk_around(estate, 60).poses
    found = world_from_geodetic(list(positions(poses, estate).values()), ORIGIN)
    errors = np.linalg.norm((found - [pose.place for pose in poses.values()])[:, :2], axis=1)
    assert 0.5 < errors.mean() < 8.0
    assert errors.std() > 0.3
