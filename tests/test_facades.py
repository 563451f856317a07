"""Facades from sparse points, against the buildings that the points were scattered on."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from si3fp.camera2d.facades import find_facades, walls_seen_from_above
from si3fp.camera2d.wall_support import best_labels
from si3fp.config import PlaneConfig
from si3fp.errors import InputError, ReconstructionError
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Footprint, Photo, SparsePoints

CONFIG = PlaneConfig()
CAMERA = Pinhole(1000.0, 1000.0, 800.0, 600.0, 1600, 1200)
NOISE_M = 0.03


class Scene:
    """Points on walls seen from photos; every group of points has its own photos."""

    def __init__(self, seed=0):
        self.rng = np.random.default_rng(seed)
        self.centres, self.points, self.tracks = [], [], []

    def camera_row(self, start, end, count, height_m=1.6):
        """Photos on a line seen from above; their indices."""
        first = len(self.centres)
        for t in np.linspace(0, 1, count):
            place = np.array(start) + t * (np.array(end) - np.array(start))
            self.centres.append([*place, height_m])
        return range(first, first + count)

    def add(self, points, cameras, views=5, noise_m=NOISE_M):
        points = points + self.rng.normal(0, noise_m, points.shape)
        centres = np.array([self.centres[c] for c in cameras])
        for point in points:
            nearest = np.argsort(np.linalg.norm(centres - point, axis=1), kind="stable")
            self.points.append(point)
            self.tracks.append(tuple(f"p{cameras[c]:02d}" for c in nearest[:views]))

    def wall(self, left, right, bottom_m, top_m, cameras, per_m2=5.0, frames=True):
        """A wall from left to right seen from outside, with a layer of window frames behind."""
        left, right = np.array(left, float), np.array(right, float)
        width_m = float(np.hypot(*(right - left)))
        along = (right - left) / width_m
        behind = np.array([-along[1], along[0]])

        def sheet(count, depth_m):
            x = self.rng.uniform(0, width_m, count)
            z = self.rng.uniform(bottom_m, top_m, count)
            plan = left + x[:, None] * along + depth_m * behind
            return np.column_stack([plan, z])

        count = int(per_m2 * width_m * (top_m - bottom_m))
        self.add(sheet(count, 0.0), cameras)
        if frames:
            self.add(sheet(count // 6, 0.2), cameras)

    def blob(self, middle, size, count, cameras):
        self.add(self.rng.normal(middle, size, (count, 3)), cameras)

    def ground(self, x, y, count, cameras, z=0.0):
        rng = self.rng
        plan = [rng.uniform(*x, count), rng.uniform(*y, count), np.full(count, z)]
        self.add(np.column_stack(plan), cameras)

    def outliers(self, count):
        cameras = range(len(self.centres))
        low, high = np.min(self.points, axis=0) - 5, np.max(self.points, axis=0) + 5
        self.add(self.rng.uniform(low, high, (count, 3)), cameras)

    def find(self, footprints=(), world_from_scene=None):
        pose = world_from_scene or Rigid3(np.eye(3), np.zeros(3))
        photos = []
        for number, centre in enumerate(self.centres):
            cam_from_scene = Rigid3(np.eye(3), -np.array(centre))
            photos.append(Photo(f"p{number:02d}", CAMERA, cam_from_scene @ pose.inverse()))
        sparse = SparsePoints(
            pose.apply(np.array(self.points)),
            np.zeros((len(self.points), 3), np.uint8),
            np.full(len(self.points), 0.5),
            tuple(self.tracks),
        )
        return find_facades(photos, sparse, footprints, CONFIG)


def south_front(seed=0):
    """Wings of 10 m at y = 0 and 0.4 beside a bay of 6 m at y = -1, an east wall, roof and trees.

    The eaves are 9 m high. Cameras stand 14 m south of it and east of it.
    """
    scene = Scene(seed)
    south = scene.camera_row((-3, -14), (29, -14), 17)
    east = scene.camera_row((40, -8), (40, 14), 8)
    scene.wall((0, 0), (10, 0), 1.0, 9.0, south)
    scene.wall((10, -1), (16, -1), 0.0, 9.0, south)
    scene.wall((16, 0.4), (26, 0.4), 0.3, 9.0, south)
    scene.wall((10, 0), (10, -1), 1.0, 9.0, south[:6], 15, frames=False)
    scene.wall((16, -1), (16, 0.4), 1.0, 9.0, south[-6:], 15, frames=False)
    scene.wall((26, 0.4), (26, 10), 0.5, 9.0, east)
    roof = scene.rng.uniform((0, 0), (26, 5), (300, 2))
    scene.add(np.column_stack([roof[:, 0], 0.5 + roof[:, 1], 9.3 + 0.7 * roof[:, 1]]), south)
    scene.blob((5.0, -4.0, 2.0), (0.9, 0.9, 1.2), 500, south)  # a tree
    scene.blob((20.0, -2.0, 0.8), (2.5, 0.3, 0.3), 400, south)  # a hedge
    scene.ground((-2, 28), (-10, -1), 400, south)
    scene.outliers(150)
    return scene


def by_offset(found, axis, sign):
    """Facades that look along an axis, from left to right seen from outside."""
    planes = [p for p in found.planes if sign * p.world_from_facade.rotation[axis, 2] > 0.99]
    return sorted(planes, key=lambda p: p.corners_in_world[0] @ p.world_from_facade.rotation[:, 0])


@pytest.fixture(scope="module")
def front():
    return south_front().find()


def test_a_bay_and_set_back_wings_are_three_planes(front):
    planes = by_offset(front, 1, -1)
    assert len(planes) == 3
    depths = [plane.world_from_facade.translation[1] for plane in planes]
    np.testing.assert_allclose(depths, [0.0, -1.0, 0.4], atol=0.02)
    for plane in planes:  # a tenth of a degree over 10 m is 2 cm
        assert abs(np.rad2deg(plane.world_from_facade.rotation[1, 0])) < 0.15


def test_planes_share_no_place_along_the_wall(front):
    planes = by_offset(front, 1, -1)
    ends = [(p.corners_in_world[0, 0], p.corners_in_world[1, 0]) for p in planes]
    np.testing.assert_allclose(ends, [(0, 10), (10, 16), (16, 26)], atol=0.15)
    for (_, right), (left, _) in itertools.pairwise(ends):
        assert abs(right - left) < 0.1


def test_walls_that_meet_share_a_corner(front):
    south, east = by_offset(front, 1, -1)[-1], by_offset(front, 0, 1)[0]
    np.testing.assert_allclose(south.corners_in_world[1, :2], (26, 0.4), atol=0.05)
    np.testing.assert_allclose(east.corners_in_world[0, :2], (26, 0.4), atol=0.05)
    assert any("right end: the corner" in note for note in south.notes)
    assert any("left end: the corner" in note for note in east.notes)


def test_ground_and_eaves(front):
    for plane in front.planes:
        bottom = plane.corners_in_world[0, 2]
        assert bottom == pytest.approx(0.0, abs=0.15)
        assert bottom + plane.height_m == pytest.approx(9.0, abs=0.15)


def test_photos_that_look_at_a_facade(front):
    for plane in by_offset(front, 1, -1):
        assert len(plane.photo_ids) >= 5
        assert all(int(name[1:]) < 17 for name in plane.photo_ids)
    # Photos 15 and 16 of the southern row stand before the east wall and saw its corner.
    assert set(by_offset(front, 0, 1)[0].photo_ids) >= {f"p{n}" for n in range(18, 25)}
    assert all(int(name[1:]) >= 15 for name in by_offset(front, 0, 1)[0].photo_ids)


def test_trees_hedges_roofs_and_window_frames_are_no_walls(front):
    assert len(front.planes) == 4
    assert front.missing == ()


def test_returns_are_left_out_with_a_reason(front):
    assert any("narrower than 2.5 m" in line and "1.4 x" in line for line in front.left_out)


def test_ids_follow_the_compass(front):
    assert [plane.facade_id for plane in front.planes] == ["wall-1", "wall-2", "wall-3", "wall-4"]
    bearings = [
        np.rad2deg(np.arctan2(*plane.world_from_facade.rotation[:2, 2])) % 360
        for plane in front.planes
    ]
    np.testing.assert_allclose(bearings, [90, 180, 180, 180], atol=0.5)
    lefts = [plane.corners_in_world[0, 0] for plane in front.planes[1:]]
    assert lefts == sorted(lefts)


def test_walls_seen_from_above(front):
    ends, outward = walls_seen_from_above(front.planes)
    assert ends.shape == (4, 2, 2)
    assert outward.shape == (4, 2)
    along = ends[:, 1] - ends[:, 0]
    right = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    np.testing.assert_allclose(right, outward, atol=1e-9)


def test_the_same_points_give_the_same_facades(front):
    again = south_front().find()
    for one, other in zip(front.planes, again.planes, strict=True):
        np.testing.assert_array_equal(one.corners_in_world, other.corners_in_world)
        assert one.notes == other.notes


@settings(max_examples=2, deadline=None)
@given(st.floats(0, 359), st.floats(-500, 500), st.floats(-80, 80))
def test_facades_turn_and_move_with_the_world(turn_deg, east_m, up_m):
    c, s = np.cos(np.deg2rad(turn_deg)), np.sin(np.deg2rad(turn_deg))
    pose = Rigid3(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]), np.array([east_m, 7.0, up_m]))
    found = south_front().find(world_from_scene=pose)
    corners = [pose.inverse().apply(plane.corners_in_world[0]) for plane in found.planes]
    truth = np.array([(0, 0), (10, -1), (16, 0.4), (26, 0.4)])
    assert len(corners) == 4
    for corner in truth:
        assert min(np.linalg.norm(one[:2] - corner) for one in corners) < 0.25


def test_a_step_of_a_brick_and_a_half_behind_deep_windows():
    """The frames in the front plane stand as deep as the plane beside it."""
    scene = Scene(1)
    cameras = scene.camera_row((-4, -12), (24, -12), 15)
    scene.wall((0, 0), (10, 0), 0.2, 8.0, cameras, frames=False)
    scene.wall((0, 0.3), (10, 0.3), 0.2, 8.0, cameras, per_m2=2.0, frames=False)
    scene.wall((10, 0.3), (20, 0.3), 0.2, 8.0, cameras)
    planes = by_offset(scene.find(), 1, -1)
    assert len(planes) == 2
    np.testing.assert_allclose(
        [p.world_from_facade.translation[1] for p in planes], [0.0, 0.3], atol=0.02
    )
    np.testing.assert_allclose(planes[0].corners_in_world[1, 0], 10.0, atol=0.3)
    np.testing.assert_allclose(planes[1].corners_in_world[0, 0], 10.0, atol=0.3)


def test_plain_plaster_is_no_gap_but_an_alley_is():
    for gap_m, count in ((3.0, 1), (6.0, 2)):
        scene = Scene(2)
        cameras = scene.camera_row((-4, -12), (24, -12), 15)
        scene.wall((0, 0), (8, 0), 0.2, 8.0, cameras)
        scene.wall((8 + gap_m, 0), (20, 0), 0.2, 8.0, cameras)
        planes = by_offset(scene.find(), 1, -1)
        assert len(planes) == count
        assert planes[0].corners_in_world[0, 0] == pytest.approx(0, abs=0.2)
        assert planes[-1].corners_in_world[1, 0] == pytest.approx(20, abs=0.2)


def test_eaves_lie_under_the_gutter_and_not_on_the_gable():
    scene = Scene(3)
    cameras = scene.camera_row((-4, -14), (16, -14), 11)
    scene.wall((0, 0), (12, 0), 0.2, 6.0, cameras)
    x, z = scene.rng.uniform(0, 12, 600), scene.rng.uniform(6.3, 9.5, 600)
    gable = np.abs(x - 6) < 6 * (9.5 - z) / 3.2
    scene.add(np.column_stack([x, 0 * x, z])[gable], cameras)
    gutter = scene.rng.uniform(0, 12, 100)
    scene.add(np.column_stack([gutter, 0 * gutter - 0.4, 0 * gutter + 6.1]), cameras)
    (plane,) = scene.find().planes
    assert plane.corners_in_world[2, 2] == pytest.approx(6.0, abs=0.15)
    assert "eaves: the cornice or gutter" in plane.notes


def test_ground_below_the_cameras_where_the_foot_of_the_wall_is_hidden():
    scene = Scene(4)
    cameras = scene.camera_row((-4, -14), (16, -14), 11, height_m=21.6)
    scene.wall((0, 0), (12, 0), 22.0, 28.0, cameras)
    (plane,) = scene.find().planes
    assert plane.corners_in_world[0, 2] == pytest.approx(20.0, abs=0.01)
    assert "ground: the cameras, 1.6 m above the ground" in plane.notes


def test_neighbours_behind_and_far_away_are_left_out():
    scene = Scene(5)
    cameras = scene.camera_row((-4, -14), (16, -14), 11)
    scene.wall((0, 0), (12, 0), 0.2, 6.0, cameras)
    scene.wall((-2, 12), (14, 12), 8.0, 14.0, cameras)
    wide = scene.camera_row((-40, -70), (60, -70), 11)
    scene.wall((30, 5), (50, 5), 0.2, 9.0, wide)
    found = scene.find()
    assert [plane.facade_id for plane in found.planes] == ["wall-1"]
    assert any("above the ground or higher is seen of it" in line for line in found.left_out)
    assert any("the limit is 60 m" in line for line in found.left_out)


HOUSE = Footprint(
    "house",
    np.array([[0, 0], [10, 0], [10, -1], [16, -1], [16, 0.4], [26, 0.4], [26, 10], [0, 10.0]]),
    ground_m=0.0,
    height_m=9.5,
)


def test_facades_are_named_after_footprint_edges():
    found = south_front().find([HOUSE])
    assert {plane.facade_id for plane in found.planes} == {
        "house-0",
        "house-2",
        "house-4",
        "house-5",
    }
    assert {row.facade_id for row in found.missing} == {"house-6", "house-7"}
    assert all(row.step == "coverage" for row in found.missing)
    for plane in found.planes:
        start, end = HOUSE.edges()[plane.edge_index]
        np.testing.assert_allclose(plane.corners_in_world[:2, :2], [start, end], atol=0.1)
        assert plane.building_id == "house"
        assert any(note.startswith("footprint: 0.0") for note in plane.notes)


@pytest.mark.parametrize(("seen_to_m", "found"), [(11.8, True), (11.1, False)])
def test_a_strip_of_a_wall_is_enough_where_the_map_has_an_edge(seen_to_m, found):
    scene = Scene(2)
    cameras = scene.camera_row((-3, -14), (29, -14), 17)
    scene.wall((0, -2), (10, -2), 0.2, 9.0, cameras)
    scene.wall((10.1, 0), (seen_to_m, 0), 0.2, 9.0, cameras, per_m2=15)
    scene.wall((14, -2), (26, -2), 0.2, 9.0, cameras)
    scene.wall((18, -2.9), (19.8, -2.9), 0.2, 9.0, cameras, per_m2=15)  # a pier
    outline = [[0, -2], [10, -2], [10, 0], [14, 0], [14, -2], [26, -2], [26, 9], [0, 9.0]]
    result = scene.find([Footprint("h", np.array(outline), 0.0, 9.0)])
    at_strip = [plane for plane in result.planes if plane.edge_index == 2]
    assert [plane.width_m for plane in at_strip] == [pytest.approx(4.0, abs=0.3)] * found
    others = [plane for plane in result.planes if plane.edge_index != 2]
    assert all(plane.corners_in_world[0, 1] == pytest.approx(-2, abs=0.1) for plane in others)
    assert all(line.endswith("narrower than 2.5 m.") for line in result.left_out)


def test_planes_of_one_edge_of_a_coarse_map():
    coarse = Footprint("block", np.array([[0, -0.2], [26, -0.2], [26, 10], [0, 10.0]]))
    found = south_front().find([coarse])
    ids = sorted(plane.facade_id for plane in found.planes)
    assert ids == ["block-0", "block-0.2", "block-0.3", "block-1"]
    widths = {p.facade_id: p.width_m for p in found.planes}
    assert widths["block-0"] >= widths["block-0.2"] >= widths["block-0.3"]
    total = sum(width for name, width in widths.items() if name.startswith("block-0"))
    assert total == pytest.approx(26.0, abs=0.2)


def test_a_row_of_houses_is_cut_where_the_map_cuts_it():
    scene = Scene(6)
    cameras = scene.camera_row((-4, -12), (24, -12), 15)
    scene.wall((0, 0), (20, 0), 0.2, 8.0, cameras)
    left = Footprint("left", np.array([[0, 0.3], [8, 0.3], [8, 9], [0, 9.0]]))
    right = Footprint("right", np.array([[8, 0.3], [20, 0.3], [20, 9], [8, 9.0]]))
    behind = Footprint("behind", np.array([[0, 30], [20, 30], [20, 39], [0, 39.0]]))
    found = scene.find([left, right, behind])
    ends = {p.facade_id: p.corners_in_world[:2, 0] for p in found.planes}
    np.testing.assert_allclose(ends["left-0"], (0, 8), atol=0.05)
    np.testing.assert_allclose(ends["right-0"], (8, 20), atol=0.05)
    assert any(line.startswith("Building behind: no wall") for line in found.left_out)
    assert not any(row.facade_id.startswith("behind") for row in found.missing)


def test_the_map_gives_the_eaves_of_a_plain_upper_storey():
    scene = Scene(7)
    cameras = scene.camera_row((-4, -12), (14, -12), 10)
    scene.wall((0, 0), (10, 0), 0.2, 7.0, cameras)
    outline = np.array([[0, 0], [10, 0], [10, 9], [0, 9.0]])
    (plane,) = scene.find([Footprint("h", outline, 0.1, 9.0)]).planes
    assert plane.corners_in_world[0, 2] == pytest.approx(0.1)
    assert plane.corners_in_world[2, 2] == pytest.approx(9.1)
    assert any(note.startswith("eaves: the map, 2.") for note in plane.notes)


@pytest.mark.parametrize(
    ("few_up_to_m", "mapped_m", "top_m"),
    [(10.1, 10.3, 10.3), (7.0, 10.3, 7.0), (18.1, 18.3, 18.3), (13.0, 18.3, 7.0)],
)
def test_few_points_of_high_storeys_are_enough_where_the_map_goes_on(few_up_to_m, mapped_m, top_m):
    scene = thin_above(7.0, few_up_to_m)
    outline = np.array([[0, 0], [10, 0], [10, 9], [0, 9.0]])
    (plane,) = scene.find([Footprint("h", outline, 0.0, mapped_m)]).planes
    assert plane.corners_in_world[2, 2] == pytest.approx(top_m, abs=0.15)


@pytest.mark.parametrize(("few_up_to_m", "top_m"), [(18.1, 18.2), (13.0, 7.0)])
def test_few_points_of_high_storeys_are_enough_where_the_wall_beside_goes_on(few_up_to_m, top_m):
    scene = thin_above(7.0, few_up_to_m)
    scene.wall((10, 0), (10, 12), 0.2, 18.2, scene.camera_row((22, -3), (22, 14), 10), per_m2=60)
    planes = by_offset(scene.find(), 1, -1)
    assert planes[0].corners_in_world[2, 2] == pytest.approx(top_m, abs=0.2)


def thin_above(dense_up_to_m, few_up_to_m):
    """A wall of 10 m with many points below and few above, seen by a row of photos before it."""
    scene = Scene(7)
    cameras = scene.camera_row((-4, -12), (14, -12), 10)
    scene.wall((0, 0), (10, 0), 0.2, dense_up_to_m, cameras, per_m2=60)
    if few_up_to_m > dense_up_to_m:
        scene.wall((0, 0), (10, 0), dense_up_to_m, few_up_to_m, cameras, per_m2=1.2, frames=False)
    return scene


def test_a_map_that_gives_the_ridge_is_not_believed():
    scene = Scene(7)
    cameras = scene.camera_row((-4, -12), (14, -12), 10)
    scene.wall((0, 0), (10, 0), 0.2, 7.0, cameras)
    outline = np.array([[0, 0], [10, 0], [10, 9], [0, 9.0]])
    (plane,) = scene.find([Footprint("h", outline, 0.0, 11.0)]).planes
    assert plane.corners_in_world[2, 2] == pytest.approx(7.0, abs=0.15)


def test_balconies_neither_split_a_wall_nor_end_it():
    scene = Scene(11)
    cameras = scene.camera_row((-4, -14), (19, -14), 12)
    scene.wall((0, 0), (15, 0), 0.2, 12.0, cameras)
    for left in (2.0, 8.0):
        for sill in (3.0, 6.0, 9.0):
            scene.wall((left, -1.5), (left + 4, -1.5), sill, sill + 1.1, cameras, per_m2=20)
    scene.wall((0, -0.6), (15, -0.6), 8.9, 9.1, cameras, per_m2=20, frames=False)  # a slab
    (plane,) = scene.find().planes
    assert plane.world_from_facade.translation[1] == pytest.approx(0, abs=0.02)
    assert plane.width_m == pytest.approx(15, abs=0.3)
    assert plane.corners_in_world[2, 2] == pytest.approx(12.0, abs=0.15)


def test_walls_off_the_map_are_an_error():
    elsewhere = Footprint("far", np.array([[100, 0], [120, 0], [120, 10], [100, 10.0]]))
    with pytest.raises(ReconstructionError, match="lies on a footprint edge"):
        south_front().find([elsewhere])


def test_too_few_points_are_an_error():
    scene = Scene(8)
    cameras = scene.camera_row((-4, -12), (14, -12), 10)
    scene.ground((0, 10), (-10, 0), 20, cameras)
    with pytest.raises(ReconstructionError, match="Only 20 of 20 sparse points"):
        scene.find()


def test_ground_alone_is_an_error():
    scene = Scene(9)
    cameras = scene.camera_row((-4, -12), (14, -12), 10)
    scene.ground((0, 30), (-30, 0), 3000, cameras)
    with pytest.raises(ReconstructionError, match="No wall of"):
        scene.find()


def test_points_that_are_not_finite_are_an_error():
    scene = Scene(10)
    cameras = scene.camera_row((-4, -12), (14, -12), 10)
    scene.wall((0, 0), (10, 0), 0.2, 8.0, cameras)
    scene.points[3] = np.array([np.nan, 0, 0])
    with pytest.raises(InputError, match=r"1 of .* sparse points are NaN"):
        scene.find()


@settings(max_examples=20, deadline=None)
@given(arrays.arrays(float, (3, 5), elements=st.floats(0, 20)), st.floats(0.1, 20))
def test_best_labels_are_the_best_of_all(support, change_cost):
    def worth(labels):
        changes = np.count_nonzero(np.diff([2, *labels, 2]))
        return support[labels, np.arange(5)].sum() - change_cost * changes

    every = np.stack(np.meshgrid(*[range(3)] * 5, indexing="ij"), axis=-1).reshape(-1, 5)
    best = max(worth(labels) for labels in every)
    assert worth(best_labels(support, change_cost)) == pytest.approx(best)
