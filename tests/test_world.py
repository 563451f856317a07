"""A reconstruction placed in the world, against the street of houses that it was made from."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from si3fp.camera2d.map_fit import fit_to_map
from si3fp.camera2d.on_map import place_on_map
from si3fp.camera2d.undistort import undistorted_camera
from si3fp.camera2d.world import known_cameras, level_and_scale
from si3fp.config import WorldConfig
from si3fp.errors import InputError, ReconstructionError
from si3fp.geometry.enu import GeoOrigin, geodetic_from_world
from si3fp.geometry.equirect import world_from_pano_rotation
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import Rigid3
from si3fp.geometry.similarity import Similarity3, fit_similarity
from si3fp.model import Footprint, KnownDistance, Photo, SparsePoints

CAMERA = Pinhole(700.0, 700.0, 480.0, 360.0, 960, 720)
ORIGIN = GeoOrigin(59.33, 18.06, 12.0)
M_PER_UNIT = 4.3
# The frame of the reconstruction has nothing to do with the world's.
RECONSTRUCTION_FROM_WORLD = Similarity3(
    1 / M_PER_UNIT, world_from_pano_rotation(130, 40, -70), np.array([3.0, -1.0, 2.0])
)
L_SHAPE = Footprint(
    "l", np.array([[-9.0, -7], [9.0, -7], [9.0, 1.0], [1.0, 1.0], [1.0, 7.0], [-9.0, 7.0]])
)
OBLONG = Footprint("oblong", np.array([[-9.0, -6], [9.0, -6], [9.0, 6.0], [-9.0, 6.0]]))


@dataclass(frozen=True)
class Scene:
    """Photos and points in the world; `in_reconstruction` hides scale, place and direction."""

    photos: tuple[Photo, ...]
    points: SparsePoints

    def in_reconstruction(self, distortion=(0.0, 0.0, 0.0, 0.0)):
        frame = RECONSTRUCTION_FROM_WORLD
        photos = tuple(
            replace(p, cam_from_world=frame.cam_from_b(p.cam_from_world)) for p in self.photos
        )
        points = replace(self.points, points_in_world=frame.apply(self.points.points_in_world))
        return photos, {p.id: np.array(distortion) for p in photos}, points

    def distances(self, *pairs, noise=None):
        centres = {p.id: p.centre_in_world for p in self.photos}
        noise = np.zeros(len(pairs)) if noise is None else noise
        return [
            KnownDistance(a, b, float(np.linalg.norm(centres[a] - centres[b]) + n))
            for (a, b), n in zip(pairs, noise, strict=True)
        ]

    def gps(self, sigma_m=0.0, rng=None, shift_m=(0.0, 0.0, 0.0), height=True):
        rng = rng or np.random.default_rng(0)
        found = {}
        for photo in self.photos:
            place = photo.centre_in_world + shift_m + rng.normal(0, sigma_m or 1e-9, 3)
            lat, lon, height_m = geodetic_from_world(place, ORIGIN)
            found[photo.id] = (float(lat), float(lon), float(height_m) if height else None)
        return found


def camera_pose(centre, heading_deg, pitch_deg, roll_deg) -> Rigid3:
    return Rigid3(world_from_pano_rotation(heading_deg, pitch_deg, roll_deg), centre).inverse()


def scene(
    footprint=L_SHAPE, count=24, points_per_wall=150, slant_deg=0.0, seed=0, height_m=1.6,
    around_deg=360.0,
) -> Scene:  # fmt: skip
    """Walls 9 m high with points, seen by cameras on a round of 20 m radius; ground at z = 0."""
    rng = np.random.default_rng(seed)
    photos = []
    for n in range(count):
        bearing = np.deg2rad(180 - around_deg / 2 + around_deg * n / count)
        radius = rng.uniform(18, 22)
        centre = np.array([radius * np.sin(bearing), radius * np.cos(bearing), height_m])
        centre[2] += rng.normal(0, 0.05)
        heading_deg = np.rad2deg(bearing) + 180 + rng.uniform(-10, 10)
        pitch_deg = 8.0 if height_m < 5 else -30.0
        roll_deg = slant_deg + rng.normal(0, 0.5)
        pose = camera_pose(centre, heading_deg, pitch_deg, roll_deg)
        photos.append(Photo(f"{n:02}.jpg", CAMERA, pose))
    places, tracks = [], []
    for start, end in footprint.edges():
        along = end - start
        outward = np.array([along[1], -along[0]]) / np.linalg.norm(along)
        at = start + rng.uniform(0, 1, (points_per_wall, 1)) * along
        at = at + rng.normal(0, 0.02, (points_per_wall, 1)) * outward
        wall = np.column_stack([at, rng.uniform(0.2, 9, points_per_wall)])
        before = [p for p in photos if (p.centre_in_world[:2] - start) @ outward > 1]
        add(places, tracks, wall, before)
    ground = np.column_stack([rng.uniform(-20, 20, (200, 2)), rng.normal(0, 0.03, 200)])
    tree = rng.normal([14.0, -12.0, 4.0], [1.0, 1.0, 1.5], (150, 3))
    wrong = rng.uniform([-30, -30, -2], [30, 30, 20], (60, 3))
    for cloud in (ground, tree, wrong):
        add(places, tracks, cloud, photos)
    count = len(places)
    points = SparsePoints(
        np.array(places), np.zeros((count, 3), np.uint8), np.full(count, 0.5), tuple(tracks)
    )
    return Scene(tuple(photos), points)


def add(places, tracks, cloud, photos):
    """The points that two photos see, with those photos."""
    seen = []
    for photo in photos:
        x, y = photo.camera.project(photo.cam_from_world.apply(cloud)).T
        seen.append((x > 0) & (x < photo.camera.width_px) & (y > 0) & (y < photo.camera.height_px))
    for n in range(len(cloud)):
        ids = tuple(photo.id for photo, one in zip(photos, seen, strict=True) if one[n])
        if len(ids) >= 2:
            places.append(cloud[n])
            tracks.append(ids)


TRIANGLE = [("00.jpg", "08.jpg"), ("08.jpg", "16.jpg"), ("16.jpg", "00.jpg")]


@pytest.fixture(scope="module")
def street():
    return scene(slant_deg=1.0)


@pytest.fixture(scope="module")
def placed(street):
    return level_and_scale(*street.in_reconstruction(), distances=street.distances(*TRIANGLE))


def against(result, truth):
    """Scale, lean of z in degrees, heading in degrees and shift of a result against the truth."""
    centres = {photo.id: photo.centre_in_world for photo in truth.photos}
    fit = fit_similarity(
        [photo.centre_in_world for photo in result.photos],
        [centres[photo.id] for photo in result.photos],
    )
    assert fit.distances.max() < 1e-6
    rotation = fit.b_from_a.rotation
    lean_deg = np.rad2deg(np.arccos(np.clip(rotation[2, 2], -1, 1)))
    heading_deg = np.rad2deg(np.arctan2(rotation[0, 1], rotation[1, 1]))
    return fit.b_from_a.scale, lean_deg, heading_deg, fit.b_from_a.apply(np.zeros(3))


# Scale and vertical


def test_a_triangle_gives_metres_and_the_walls_the_vertical(placed, street):
    scale, lean_deg, _, _ = against(placed, street)
    assert scale == pytest.approx(1.0, rel=1e-9)
    assert placed.m_per_unit == pytest.approx(M_PER_UNIT)
    assert lean_deg < 0.2  # all cameras are held at a slant of 1 degree
    assert [photo.centre_in_world[2] for photo in placed.photos] == pytest.approx(
        np.full(24, 1.6), abs=0.3
    )
    assert np.mean([photo.centre_in_world for photo in placed.photos], axis=0)[:2] == pytest.approx(
        [0, 0], abs=1e-9
    )
    assert (placed.metric, placed.scaled_by) == (True, "distances")
    assert (placed.north_known, placed.origin) == (False, None)
    assert placed.ground_z_m == 0.0


def test_points_move_with_their_photos(placed, street):
    truth = {photo.id: photo for photo in street.photos}
    for photo in placed.photos[::6]:
        was, now = truth[photo.id], photo.camera.project
        expected = was.camera.project(was.cam_from_world.apply(street.points.points_in_world))
        found = now(photo.cam_from_world.apply(placed.points.points_in_world))
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_walls_correct_the_slant_at_which_all_cameras_are_held():
    leans_deg, facts = {}, {}
    for points_per_wall in (0, 150):
        arc = scene(points_per_wall=points_per_wall, slant_deg=1.0, around_deg=100.0)
        result = level_and_scale(*arc.in_reconstruction(), unscaled=True)
        leans_deg[points_per_wall] = against(result, arc)[1]
        facts[points_per_wall] = " ".join(result.facts)
    assert leans_deg[0] > 0.7
    assert "and 0 walls" in facts[0]
    assert leans_deg[150] < 0.3


def test_a_wall_fixes_the_pitch_of_cameras_that_all_look_one_way():
    rng = np.random.default_rng(3)
    at = np.column_stack([rng.uniform(-9, 9, 400), np.zeros(400), rng.uniform(0.2, 9, 400)])
    photos = tuple(
        Photo(
            f"{n}.jpg", CAMERA,
            camera_pose([n - 6.0, -14.0, 1.6], 0.0, 12.0 + rng.normal(0, 1), rng.normal(0, 0.3)),
        )
        for n in range(12)
    )  # fmt: skip
    places, tracks = [], []
    add(places, tracks, at + rng.normal(0, 0.02, at.shape), photos)
    count = len(places)
    points = SparsePoints(
        np.array(places), np.zeros((count, 3), np.uint8), np.zeros(count), tuple(tracks)
    )
    one_way = Scene(photos, points)
    result = level_and_scale(*one_way.in_reconstruction(), unscaled=True)
    assert against_line(result, one_way) < 0.4
    with pytest.raises(ReconstructionError, match="all cameras look the same way"):
        few = replace(points, points_in_world=np.array(places)[::20],
                      photo_ids=tuple(tracks[::20]))  # fmt: skip
        level_and_scale(*Scene(photos, few).in_reconstruction(), unscaled=True)


def against_line(result, truth):
    """Lean of z in degrees, by a photo's rotation: centres on a line do not tell it."""
    photo, was = result.photos[0], truth.photos[0]
    up = was.cam_from_world.inverse().rotation @ photo.cam_from_world.rotation[:, 2]
    return np.rad2deg(np.arccos(np.clip(up[2], -1, 1)))


def test_two_centimetres_on_the_sides_are_covered_by_the_stated_sigma():
    small = scene(count=24, points_per_wall=25)
    rng = np.random.default_rng(1)
    inputs = small.in_reconstruction()
    hits = []
    for _ in range(40):
        result = level_and_scale(
            *inputs, distances=small.distances(*TRIANGLE, noise=rng.normal(0, 0.02, 3))
        )
        hits.append(abs(result.m_per_unit - M_PER_UNIT) <= 1.96 * result.sigma_m_per_unit)
    assert np.mean(hits) > 0.84  # 95 % expected; 3.4 % is the standard deviation of 40 draws
    assert result.sigma_m_per_unit / M_PER_UNIT == pytest.approx(0.02 / 60, rel=0.2)


def test_residuals_and_doubts_are_told(street):
    sides = street.distances(*TRIANGLE, ("00.jpg", "04.jpg"), noise=[0.0, 0.01, 0.0, 0.4])
    sides.append(KnownDistance("00.jpg", "lost.jpg", 3.0))
    result = level_and_scale(*street.in_reconstruction(), distances=sides)
    assert [side.residual_m for side in result.sides][3] == pytest.approx(-0.37, abs=0.05)
    notes = " ".join(result.notes)
    assert "00.jpg - 04.jpg" in notes
    assert "shorter in the model. Measure it again" in notes
    assert "not used: 00.jpg - lost.jpg (3 m)" in notes


def test_without_scale_the_message_names_every_way_out(street):
    with pytest.raises(ReconstructionError) as caught:
        level_and_scale(*street.in_reconstruction())
    for way in ("--triangle", "photos with GPS", "--cameras", "--unscaled", "have no GPS"):
        assert way in str(caught.value)


def test_unscaled_units_are_arbitrary_and_said_to_be(street):
    result = level_and_scale(*street.in_reconstruction(), unscaled=True)
    assert (result.metric, result.scaled_by, result.sigma_m_per_unit) == (False, "nothing", 0.0)
    depths = [
        (photo.cam_from_world.apply(point))[2]
        for photo in result.photos
        for point, ids in zip(result.points.points_in_world, result.points.photo_ids, strict=True)
        if photo.id in ids
    ]
    assert np.median(depths) == pytest.approx(15.0)
    assert any("size of the building is not known" in note for note in result.notes)
    with pytest.raises(ReconstructionError, match="cannot be laid on footprints"):
        place_on_map(result, np.zeros((1, 2, 2)), np.zeros((1, 2)), np.zeros((1, 2, 2)), ORIGIN)


def test_from_the_air_the_ground_is_where_the_points_are(street):
    drone = scene(height_m=30.0)
    result = level_and_scale(*drone.in_reconstruction(), distances=drone.distances(*TRIANGLE))
    heights = [photo.centre_in_world[2] for photo in result.photos]
    assert np.mean(heights) == pytest.approx(30.0, abs=1.5)
    assert any("below the cameras" in note for note in result.notes)


def test_photos_in_portrait_are_named(street):
    photos, distortion, points = street.in_reconstruction()
    turn = Rigid3(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.zeros(3))
    photos = (replace(photos[0], cam_from_world=turn @ photos[0].cam_from_world), *photos[1:])
    result = level_and_scale(photos, distortion, points, unscaled=True)
    assert any("not held level" in note and "00.jpg" in note for note in result.notes)


# GPS


def test_gps_gives_scale_place_and_north(street):
    result = level_and_scale(*street.in_reconstruction(), gps=street.gps(), origin=ORIGIN)
    scale, lean_deg, heading_deg, shift = against(result, street)
    assert scale == pytest.approx(1.0, abs=2e-3)  # seen from above, the vertical off by 0.1 degrees
    assert lean_deg < 0.2
    assert heading_deg == pytest.approx(0.0, abs=0.2)
    assert shift[:2] == pytest.approx([0, 0], abs=0.05)
    assert (result.placed_by, result.origin) == ("GPS", ORIGIN)
    assert result.north_known


def test_noise_of_gps_is_covered_by_the_stated_sigmas():
    small = scene(points_per_wall=25)
    inputs = small.in_reconstruction()
    rng = np.random.default_rng(4)
    hits = {"scale": [], "heading": [], "place": []}
    for _ in range(25):
        result = level_and_scale(*inputs, gps=small.gps(3.0, rng), origin=ORIGIN)
        scale, _, heading_deg, _ = against(result, small)
        hits["scale"].append(abs(1 / scale - 1) * M_PER_UNIT <= 1.96 * result.sigma_m_per_unit)
        hits["heading"].append(abs(heading_deg) <= 1.96 * result.heading_sigma_deg)
        off = (
            np.mean([p.centre_in_world for p in result.photos], axis=0)[:2]
            - np.mean([p.centre_in_world for p in small.photos], axis=0)[:2]
        )
        hits["place"] += (np.abs(off) <= 1.96 * result.position_sigma_m).tolist()
    for what, inside in hits.items():
        assert np.mean(inside) > 0.82, what  # 95 % expected, 4.4 % the deviation of 25 draws


def test_without_footprints_the_origin_is_the_middle_of_the_photos_on_the_ground(street):
    result = level_and_scale(
        *street.in_reconstruction(),
        gps=street.gps(),
        distances=street.distances(*TRIANGLE),
    )
    origin = result.origin
    assert origin is not None
    assert (round(origin.lat_deg, 5), round(origin.lon_deg, 5)) == (origin.lat_deg, origin.lon_deg)
    assert (origin.lat_deg, origin.lon_deg) == pytest.approx((59.33, 18.06), abs=2e-5)
    assert origin.height_m == pytest.approx(12.0, abs=0.3)
    photo, was = result.photos[5], street.photos[5]
    found = geodetic_from_world(photo.centre_in_world, origin)
    expected = geodetic_from_world(was.centre_in_world, ORIGIN)
    assert np.abs(found[:2] - expected[:2]).max() < 2e-6  # 0.2 m
    no_height = level_and_scale(*street.in_reconstruction(), gps=street.gps(height=False))
    assert no_height.origin is not None
    assert no_height.origin.height_m == 0.0


def test_distances_beat_gps_and_the_difference_is_told(street):
    rng = np.random.default_rng(5)
    inputs = street.in_reconstruction()
    sides = street.distances(*TRIANGLE)
    result = level_and_scale(*inputs, distances=sides, gps=street.gps(3.0, rng), origin=ORIGIN)
    assert result.m_per_unit == pytest.approx(M_PER_UNIT)
    assert result.placed_by == "GPS"
    assert any("By GPS the building would be" in note for note in result.notes)
    yards = [replace(side, distance_m=2 * side.distance_m) for side in sides]
    with pytest.raises(InputError, match=r"by GPS the building is 0\.[45]\d .*Check the unit"):
        level_and_scale(*inputs, distances=yards, gps=street.gps(3.0, rng))


def test_gps_over_a_short_way_tells_neither_scale_nor_north(street):
    few = {name: place for name, place in street.gps(0.5).items() if name < "03.jpg"}
    inputs = street.in_reconstruction()
    with pytest.raises(ReconstructionError, match=r"spans too little.*--triangle"):
        level_and_scale(*inputs, gps=few)
    result = level_and_scale(*inputs, gps=few, distances=street.distances(*TRIANGLE))
    assert (result.north_known, result.origin) == (False, None)
    assert any("north only within" in note for note in result.notes)
    two = dict(list(few.items())[:2])
    with pytest.raises(ReconstructionError, match=r"need 3 photos with a known position, got 2"):
        level_and_scale(*inputs, gps=two)


def test_one_wrong_fix_counts_little(street):
    gps = street.gps(1.0, np.random.default_rng(6))
    lat, lon, height = gps["03.jpg"]
    gps["03.jpg"] = (lat + 0.002, lon, height)  # 220 m
    result = level_and_scale(*street.in_reconstruction(), gps=gps, origin=ORIGIN)
    scale, _, heading_deg, _ = against(result, street)
    assert scale == pytest.approx(1.0, abs=0.15)
    assert abs(heading_deg) < 8


def test_gps_of_photos_that_were_not_reconstructed_is_ignored(street):
    gps = street.gps() | {"elsewhere.jpg": (0.0, 0.0, 0.0)}
    result = level_and_scale(*street.in_reconstruction(), gps=gps, origin=ORIGIN)
    assert abs(against(result, street)[2]) < 0.2


@settings(max_examples=50, deadline=None)
@given(
    st.floats(0, 359), st.floats(0.1, 10), st.floats(-1e4, 1e4), st.integers(3, 20),
    st.booleans(),
)  # fmt: skip
def test_points_on_the_map_come_back(heading_deg, scale, east, count, given_scale):
    points = np.random.default_rng(count).uniform(-20, 20, (count, 2))
    c, s = np.cos(np.deg2rad(heading_deg)), np.sin(np.deg2rad(heading_deg))
    places = scale * points @ np.array([[c, s], [-s, c]]).T + [east, 5.0]  # y points to the heading
    fit = fit_to_map(points, places, 1.0, scale if given_scale else None)
    assert fit.scale == pytest.approx(scale)
    assert (fit.heading_deg - heading_deg + 180) % 360 - 180 == pytest.approx(0, abs=1e-6)
    assert fit.offset_m == pytest.approx([east, 5.0], abs=1e-5)
    assert fit.distances_m.max() < 1e-5
    assert (fit.sigma_scale == 0) == given_scale


# Footprints


def walls_in(result, footprint, truth):
    """What the facade finder would find: the walls of the footprint in the result's frame."""
    centres = {photo.id: photo.centre_in_world for photo in result.photos}
    fit = fit_similarity(
        [photo.centre_in_world for photo in truth.photos],
        [centres[photo.id] for photo in truth.photos],
    )
    edges = np.array(footprint.edges())
    ends = fit.b_from_a.apply(np.concatenate([edges, np.zeros((len(edges), 2, 1))], axis=2))[
        ..., :2
    ]
    along = ends[:, 1] - ends[:, 0]
    return ends, np.stack([along[:, 1], -along[:, 0]], axis=1), edges


def test_walls_lie_down_on_their_footprint(placed, street):
    result = place_on_map(placed, *walls_in(placed, L_SHAPE, street), ORIGIN)
    _, lean_deg, heading_deg, shift = against(result, street)
    assert lean_deg < 0.2
    assert heading_deg == pytest.approx(0, abs=0.1)
    assert shift[:2] == pytest.approx([0, 0], abs=0.1)
    assert (result.placed_by, result.origin, result.ground_z_m) == ("footprints", ORIGIN, 0.0)
    assert "6 of 6 walls lie on edges" in result.facts[-1]


def test_gps_decides_between_the_ways_to_lay_an_oblong():
    house = scene(OBLONG)
    inputs = house.in_reconstruction()
    sides = house.distances(*TRIANGLE)
    level = level_and_scale(*inputs, distances=sides)
    with pytest.raises(ReconstructionError, match="in 2 ways"):
        place_on_map(level, *walls_in(level, OBLONG, house), ORIGIN)
    gps = house.gps(3.0, np.random.default_rng(7), shift_m=(3.0, -2.0, 8.0))
    level = level_and_scale(*inputs, distances=sides, gps=gps, origin=ORIGIN)
    assert np.linalg.norm(against(level, house)[3][:2]) > 1.0
    result = place_on_map(level, *walls_in(level, OBLONG, house), ORIGIN)
    _, _, heading_deg, shift = against(result, house)
    assert heading_deg == pytest.approx(0, abs=0.1)
    assert shift[:2] == pytest.approx([0, 0], abs=0.1)
    assert result.placed_by == "footprints"


def test_footprints_far_from_gps_leave_it_in_charge():
    house = scene(OBLONG)
    far = house.gps(1.0, shift_m=(60.0, 0.0, 0.0))
    level = level_and_scale(
        *house.in_reconstruction(), distances=house.distances(*TRIANGLE), gps=far, origin=ORIGIN
    )
    result = place_on_map(level, *walls_in(level, OBLONG, house), ORIGIN)
    assert result.placed_by == "GPS"
    assert "agrees with GPS" in result.notes[-1]
    assert result.photos[0].centre_in_world == pytest.approx(level.photos[0].centre_in_world)


def test_footprints_of_another_place_are_refused():
    house = scene(OBLONG)
    level = level_and_scale(*house.in_reconstruction(), gps=house.gps(1.0), origin=ORIGIN)
    walls, outward, edges = walls_in(level, OBLONG, house)
    with pytest.raises(InputError, match=r"were taken 9\d\d m from .* of the same building"):
        place_on_map(level, walls, outward, edges + np.array([1000.0, 0.0]), ORIGIN)


def test_ways_that_gps_cannot_tell_apart_are_told():
    terrace = np.array(OBLONG.edges())
    house = scene(OBLONG)
    level = level_and_scale(*house.in_reconstruction(), gps=house.gps(3.0), origin=ORIGIN)
    walls, outward, edges = walls_in(level, OBLONG, house)
    edges = np.concatenate([edges, terrace + np.array([3.0, 0.0])])
    result = place_on_map(level, walls, outward, edges, ORIGIN)
    assert any("GPS cannot tell" in note for note in result.notes)


# Known cameras


def test_known_cameras_stay_where_they_are(street):
    distortion = {photo.id: np.zeros(4) for photo in street.photos}
    result = known_cameras(street.photos, distortion, street.points)
    assert (result.scaled_by, result.north_known, result.origin) == ("cameras", False, None)
    assert result.ground_z_m == pytest.approx(0.0, abs=0.1)
    for photo, was in zip(result.photos, street.photos, strict=True):
        np.testing.assert_array_equal(photo.centre_in_world, was.centre_in_world)
    on_map = known_cameras(street.photos, distortion, street.points, origin=ORIGIN)
    assert (on_map.placed_by, on_map.origin, on_map.north_known) == ("cameras", ORIGIN, True)
    assert place_on_map(on_map, *walls_in(on_map, L_SHAPE, street), ORIGIN) is on_map


def test_known_cameras_in_another_frame_or_unit_are_refused(street):
    with pytest.raises(InputError, match=r"no z axis that points up.*leans by \d+ degrees"):
        known_cameras(*street.in_reconstruction())
    distortion = {photo.id: np.zeros(4) for photo in street.photos}
    feet = [
        replace(side, distance_m=side.distance_m / 0.3048) for side in street.distances(*TRIANGLE)
    ]
    with pytest.raises(InputError, match=r"one unit of the cameras is 3\.28 m"):
        known_cameras(street.photos, distortion, street.points, distances=feet)
    result = known_cameras(
        street.photos, distortion, street.points, distances=street.distances(*TRIANGLE)
    )
    assert max(abs(side.residual_m) for side in result.sides) < 1e-9


# What comes in


def test_the_lens_is_taken_out_of_the_cameras(street):
    distortion = (-0.05, 0.0, 0.0, 0.001)
    result = level_and_scale(*street.in_reconstruction(distortion), unscaled=True)
    lens = result.lenses["00.jpg"]
    assert lens.camera == CAMERA
    assert result.photos[0].camera == undistorted_camera(lens) != CAMERA
    image = np.zeros((720, 960, 3), np.uint8)
    camera = result.photos[0].camera
    assert result.undistort("00.jpg", image).shape == (camera.height_px, camera.width_px, 3)
    with pytest.raises(InputError, match=r"00\.jpg: The photo is 720 x 960 px but its camera"):
        result.undistort("00.jpg", image.transpose(1, 0, 2))
    with pytest.raises(InputError, match="none is not among the 24 photos"):
        result.undistort("none", image)


def test_a_photo_whose_lens_folds_is_left_out(street):
    photos, distortion, points = street.in_reconstruction()
    distortion["05.jpg"] = np.array([-3.0, 0, 0, 0])
    result = level_and_scale(photos, distortion, points, unscaled=True)
    assert "05.jpg" not in {photo.id for photo in result.photos}
    assert "folds the image" in result.left_out["05.jpg"]
    assert len(result.photos) == 23


def test_three_photos_are_enough_and_two_are_not(street):
    photos, distortion, points = street.in_reconstruction()
    some = (photos[0], photos[3], photos[6])
    result = level_and_scale(some, distortion, points, unscaled=True)
    assert len(result.photos) == 3
    with pytest.raises(ReconstructionError, match=r"2 of the reconstructed photos.*--check"):
        level_and_scale(some[:2], distortion, points, unscaled=True)


def test_broken_reconstructions_say_what_is_wrong(street):
    photos, distortion, points = street.in_reconstruction()
    with pytest.raises(InputError, match="A pose contains NaN"):
        replace(photos[0], cam_from_world=Rigid3(np.eye(3), np.array([0.0, np.nan, 0.0])))
    with pytest.raises(InputError, match=r"occur twice in the reconstruction: 00\.jpg"):
        level_and_scale((photos[0], *photos), distortion, points)
    with pytest.raises(InputError, match=r"No lens distortion is given for 00\.jpg"):
        level_and_scale(photos[:3], {"01.jpg": np.zeros(4), "02.jpg": np.zeros(4)}, points)
    with pytest.raises(InputError, match="1 sparse points contain NaN"):
        bad = points.points_in_world.copy()
        bad[7, 1] = np.inf
        level_and_scale(photos, distortion, replace(points, points_in_world=bad))
    none = SparsePoints(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0), ())
    with pytest.raises(ReconstructionError, match="no point that lies before the photos"):
        level_and_scale(photos, distortion, none)


def test_the_same_input_gives_the_same_bits(placed, street):
    again = level_and_scale(*street.in_reconstruction(), distances=street.distances(*TRIANGLE))
    np.testing.assert_array_equal(again.points.points_in_world, placed.points.points_in_world)


def test_the_record_is_plain_json(street):
    result = level_and_scale(
        *street.in_reconstruction(), distances=street.distances(*TRIANGLE), gps=street.gps(1.0)
    )
    record = json.loads(json.dumps(result.record))
    assert record["scaled_by"] == "distances"
    assert record["placed_by"] == "GPS"
    assert record["origin"]["lat_deg"] == pytest.approx(59.33, abs=1e-4)
    assert [side["start"] for side in record["sides"]] == ["00.jpg", "08.jpg", "16.jpg"]
    assert record["m_per_unit"] == result.m_per_unit


@pytest.mark.slow
@pytest.mark.skipif("SI3FP_TEST_DATA" not in os.environ, reason="needs SI3FP_TEST_DATA")
def test_the_castle_stands_upright_in_metres():
    from si3fp.sources.colmap_text import read_colmap_text
    from si3fp.sources.triangle import read_known_distances

    castle = Path(os.environ["SI3FP_TEST_DATA"]) / "castle"
    published = read_colmap_text(castle / "cameras").photos
    # Real cameras; the points are those of a court 36 x 30 m around them.
    centres = np.stack([photo.centre_in_world for photo in published])
    assert WorldConfig().camera_height_m == 1.6
    rng = np.random.default_rng(0)
    low, high = centres.min(axis=0) - 6, centres.max(axis=0) + 6
    along = rng.uniform(low, high, (4000, 3))
    side = rng.integers(0, 4, 4000)
    along[np.arange(4000), side % 2] = np.where(side < 2, low[side % 2], high[side % 2])
    along[:, 2] = rng.uniform(centres[:, 2].mean() - 1.6, centres[:, 2].mean() + 13, 4000)
    places, tracks = [], []
    add(places, tracks, along + rng.normal(0, 0.03, along.shape), published)
    points = SparsePoints(
        np.array(places), np.zeros((len(places), 3), np.uint8), np.zeros(len(places)), tuple(tracks)
    )
    real = Scene(tuple(published), points)
    result = level_and_scale(
        *real.in_reconstruction(),
        distances=read_known_distances(castle / "reference_triangle.json"),
    )
    scale, lean_deg, _, _ = against(result, real)
    assert scale == pytest.approx(1.0, rel=1e-4)
    assert lean_deg < 0.3
