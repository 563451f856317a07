"""The vertical from cameras with roll noise and from walls, against the one they were made with."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from si3fp.camera2d.gravity import find_gravity
from si3fp.errors import InputError, ReconstructionError
from si3fp.geometry.equirect import world_from_pano_rotation
from si3fp.geometry.rigid import Rigid3

# The frame of the reconstruction: turned against the world, so that no axis is vertical.
RECONSTRUCTION_FROM_WORLD = Rigid3(world_from_pano_rotation(35, -50, 20), np.array([4.0, 1.0, 2.0]))
UP = RECONSTRUCTION_FROM_WORLD.rotate([0.0, 0.0, 1.0])
NORTH_WALL, EAST_WALL, ROOF = np.eye(3)[1], np.eye(3)[0], np.array([0.0, 0.6, 0.8])


def camera(heading_deg: float, pitch_deg: float, roll_deg: float) -> Rigid3:
    rotation = world_from_pano_rotation(heading_deg, pitch_deg, roll_deg).T
    return Rigid3(rotation, np.zeros(3)) @ RECONSTRUCTION_FROM_WORLD.inverse()


def cameras(rng, count=30, roll_deg=2.0, headings_deg=(0.0, 360.0)):
    return [
        camera(rng.uniform(*headings_deg), rng.uniform(0, 25), rng.normal(0, roll_deg))
        for _ in range(count)
    ]


def walls(*normals_in_world):
    return RECONSTRUCTION_FROM_WORLD.rotate(np.array(normals_in_world))


def error_deg(gravity) -> float:
    return float(np.rad2deg(np.linalg.norm(np.cross(gravity.up_in_reconstruction, UP))))


def test_level_cameras_give_the_exact_vertical_and_z_points_up():
    gravity = find_gravity(cameras(np.random.default_rng(0), 5, 0.0))
    np.testing.assert_allclose(gravity.up_in_reconstruction, UP, atol=1e-9)
    np.testing.assert_allclose(gravity.level_from_reconstruction.rotate(UP), [0, 0, 1], atol=1e-9)
    assert gravity.tilted_cameras == ()


def test_the_spread_covers_the_error_of_cameras_with_roll_noise():
    rng = np.random.default_rng(1)
    found = [find_gravity(cameras(rng)) for _ in range(200)]
    errors = np.array([error_deg(gravity) for gravity in found])
    sigma = np.array([gravity.sigma_deg for gravity in found])
    # Two directions: 1 - exp(-2.45^2 / 2) = 95 % lie within 2.45 standard deviations, or more, as
    # sigma_deg is that of the worse direction; 1.5 % is the standard deviation of 200 draws.
    assert np.mean(errors <= 2.45 * sigma) > 0.92
    assert 0.3 < np.median(sigma) < 0.8  # 2 degrees / sqrt(30 / 2)
    assert np.median([gravity.roll_sigma_deg for gravity in found]) == pytest.approx(2.0, abs=0.3)


def test_portrait_and_careless_photos_are_left_out_and_named():
    rng = np.random.default_rng(2)
    poses = cameras(rng, 20, 1.0)
    poses[3], poses[8], poses[15] = camera(70, 5, 90), camera(160, 5, -90), camera(10, 0, 25)
    gravity = find_gravity(poses)
    assert gravity.tilted_cameras == (3, 8, 15)
    assert error_deg(gravity) < 1.0


def test_walls_make_the_vertical_sharper():
    poses = cameras(np.random.default_rng(3), 6, 3.0)
    alone = find_gravity(poses)
    together = find_gravity(poses, walls(NORTH_WALL, EAST_WALL, -NORTH_WALL))
    assert together.sigma_deg < 0.8 * alone.sigma_deg
    assert error_deg(together) < error_deg(alone)


def test_cameras_that_look_one_way_need_a_wall_for_their_pitch():
    rng = np.random.default_rng(4)
    poses = cameras(rng, 12, 0.5, (-2.0, 2.0))  # look north, at a wall that faces south
    with pytest.raises(ReconstructionError, match="all cameras look the same way"):
        find_gravity(poses)
    gravity = find_gravity(poses, walls(-NORTH_WALL))
    assert error_deg(gravity) < 1.0


def test_a_tripod_that_only_moves_sideways_is_upright_by_its_wall():
    poses = [*cameras(np.random.default_rng(9), 12, 2.0, (0.0, 0.0)), camera(0.0, 5.0, 90.0)]
    gravity = find_gravity(poses, walls(-NORTH_WALL))
    assert gravity.tilted_cameras == (12,)
    assert error_deg(gravity) < 2.45


def test_a_roof_among_the_walls_is_left_out_and_named():
    poses = cameras(np.random.default_rng(5), 20, 1.0)
    gravity = find_gravity(poses, walls(NORTH_WALL, ROOF, EAST_WALL))
    assert gravity.tilted_walls == (1,)
    assert error_deg(gravity) < 0.7


def test_disagreement_of_cameras_and_walls_is_an_error():
    poses = cameras(np.random.default_rng(6), 20, 1.0)
    with pytest.raises(ReconstructionError, match=r"disagree about the vertical: 1 of 1 walls"):
        find_gravity(poses, walls(ROOF))
    leaning = world_from_pano_rotation(0, 0, 0).T @ world_from_pano_rotation(0, 10, 10)
    with pytest.raises(ReconstructionError, match="2 of 2 walls lean by"):
        find_gravity(poses, walls(NORTH_WALL, EAST_WALL) @ leaning)


def test_walls_that_contradict_one_another_are_an_error():
    one_way = cameras(np.random.default_rng(7), 12, 0.5, (0.0, 0.0))
    with pytest.raises(ReconstructionError, match="disagree about the vertical"):
        find_gravity(one_way, walls(NORTH_WALL, ROOF))


def test_cameras_without_a_common_vertical_are_an_error():
    rng = np.random.default_rng(8)
    poses = [camera(*rng.uniform(-180, 180, 3)) for _ in range(20)]
    with pytest.raises(ReconstructionError, match="do not agree on a vertical"):
        find_gravity(poses)


def test_photos_that_all_lie_on_their_sides_are_an_error():
    poses = [camera(heading, 0, 90) for heading in (0, 40, 80)]
    with pytest.raises(ReconstructionError, match="lie on their sides"):
        find_gravity(poses, walls(NORTH_WALL))


def test_a_reconstruction_upside_down_is_turned():
    poses = [camera(heading, 0, 0) for heading in (0, 50, 120)]
    upside_down = Rigid3(np.diag([1.0, -1.0, -1.0]), np.zeros(3)) @ RECONSTRUCTION_FROM_WORLD
    poses = [pose @ RECONSTRUCTION_FROM_WORLD @ upside_down.inverse() for pose in poses]
    gravity = find_gravity(poses)
    np.testing.assert_allclose(
        gravity.up_in_reconstruction, upside_down.rotate([0.0, 0.0, 1.0]), atol=1e-9
    )


def test_a_vertical_along_minus_z_is_turned():
    flip = Rigid3(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    level = [camera(heading, 0, 0) @ RECONSTRUCTION_FROM_WORLD @ flip for heading in (0, 50, 120)]
    gravity = find_gravity(level)
    np.testing.assert_allclose(gravity.up_in_reconstruction, [0, 0, -1], atol=1e-9)
    np.testing.assert_allclose(
        gravity.level_from_reconstruction.rotate([0.0, 0.0, -1.0]), [0, 0, 1], atol=1e-9
    )


def test_too_few_cameras_and_broken_normals_are_refused():
    with pytest.raises(InputError, match="at least 3 cameras, got 2"):
        find_gravity([camera(0, 0, 0), camera(90, 0, 0)])
    with pytest.raises(InputError, match="unit vectors"):
        find_gravity([camera(h, 0, 0) for h in (0, 50, 99)], [[0.0, 0.0, 3.0]])


@pytest.mark.slow
@pytest.mark.skipif("SI3FP_TEST_DATA" not in os.environ, reason="needs SI3FP_TEST_DATA")
def test_the_vertical_of_the_castle_is_the_published_one():
    from si3fp.sources.colmap_text import read_colmap_text

    photos = read_colmap_text(Path(os.environ["SI3FP_TEST_DATA"]) / "castle" / "cameras").photos
    gravity = find_gravity([photo.cam_from_world for photo in photos])
    z = gravity.up_in_reconstruction[2]
    error = np.rad2deg(np.arccos(min(z, 1.0)))
    assert error < 1.0  # the rolls show that the published z itself leans by half a degree
