"""The estate's cameras: points that are known appear where they must, rays lead back to them."""

from __future__ import annotations

from dataclasses import astuple

import cv2
import numpy as np
import pytest
from benchmarks.estate.capture.cameras import Equirect, LensCamera, Orthographic, Pose
from benchmarks.estate.capture.lens import Distortion
from benchmarks.estate.rays import distances_to_line

from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import Rigid3

LENS = Distortion(-0.06, 0.03, 0.0006, -0.0004)
PINHOLE = Pinhole(578.0, 578.0, 402.0, 297.0, 800, 600)


def some_points(rng: np.random.Generator, pose: Pose, half_angle: float) -> np.ndarray:
    """Points (50, 3) in the world in front of a camera."""
    in_cam = np.column_stack([rng.uniform(-half_angle, half_angle, (50, 2)), np.ones(50)])
    return pose.world_from_cam.apply(in_cam * rng.uniform(3, 30, (50, 1)))


@pytest.mark.parametrize("kind", ["panorama", "photo"])
def test_rays_through_the_pixels_of_points_meet_them(kind: str) -> None:
    rng = np.random.default_rng(1)
    pose = Pose((3.0, -20.0, 2.5), 40.0, 12.0, -1.5)
    camera = (
        Equirect(pose.world_from_cam, 1024)
        if kind == "panorama"
        else LensCamera(pose.world_from_cam, PINHOLE, LENS)
    )
    points = some_points(rng, pose, 0.4)
    origins, directions = camera.rays(camera.pixels(points))
    assert origins == pytest.approx(np.tile(pose.place, (50, 1)))
    assert np.linalg.norm(directions, axis=1) == pytest.approx(np.ones(50))
    expected = points - origins
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert directions == pytest.approx(expected, abs=1e-8)


def test_the_lens_is_that_of_opencv() -> None:
    pose = Pose((3.0, -20.0, 1.6), 200.0, 20.0, 1.0)
    camera = LensCamera(pose.world_from_cam, PINHOLE, LENS)
    points = some_points(np.random.default_rng(2), pose, 0.45)
    cam_from_world = pose.world_from_cam.inverse()
    matrix = np.array([[578.0, 0, 402.0], [0, 578.0, 297.0], [0, 0, 1]])
    turn, _ = cv2.Rodrigues(cam_from_world.rotation)
    expected, _ = cv2.projectPoints(
        points, turn, cam_from_world.translation, matrix, np.array(astuple(LENS))
    )
    assert camera.pixels(points) == pytest.approx(expected[:, 0], abs=1e-6)


def test_photos_do_not_show_what_is_behind_or_beside_them() -> None:
    pose = Pose((0.0, 0.0, 1.6), 0.0, 0.0, 0.0)
    camera = LensCamera(pose.world_from_cam, PINHOLE, LENS)
    points = np.array([[0.0, -5.0, 1.6], [50.0, 5.0, 1.6], [0.0, 5.0, 1.6]])
    assert np.isfinite(camera.pixels(points)).all(axis=1).tolist() == [False, False, True]
    assert camera.pixels(points)[2] == pytest.approx([402.0, 297.0])


def test_headings_are_compass_bearings() -> None:
    east = Pose((0.0, 0.0, 0.0), 90.0, 0.0, 0.0).world_from_cam
    assert east.rotate([0.0, 0.0, 1.0]) == pytest.approx([1.0, 0.0, 0.0])
    camera = Equirect(east, 360)
    assert camera.pixels(np.array([[0.0, 5.0, 0.0]]))[0] == pytest.approx([90.0, 90.0])


def test_an_orthographic_ray_is_a_pixel_of_the_facade() -> None:
    axes = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # faces south
    grid = FacadeGrid(Rigid3(axes, np.array([2.0, 3.0, 0.0])), 40, 30, 0.1)
    camera = Orthographic(grid, standoff_m=2.0)
    origins, directions = camera.rays(np.array([[0.5, 29.5], [39.5, 0.5]]))
    assert origins == pytest.approx(np.array([[2.05, 1.0, 0.05], [5.95, 1.0, 2.95]]))
    assert directions == pytest.approx(np.array([[0.0, 1.0, 0.0]] * 2))


def test_rays_meet_an_upright_plane_over_a_line_and_miss_it_beside_its_ends() -> None:
    rays = np.array(
        [
            [1.0, 0.0, 0.0],  # straight at it, 5 m away
            [0.6, 0.0, 0.8],  # upwards: 5 m away on the ground, 25 / 3 m along the ray
            [1.0, 0.3, 0.0],  # past its end, 1.5 m aside
            [-1.0, 0.0, 0.0],  # away from it
            [0.0, 1.0, 0.0],  # along it
        ]
    )
    for start, end in (((7.0, 1.0), (7.0, 3.0)), ((7.0, 3.0), (7.0, 1.0))):
        found = distances_to_line(np.array([2.0, 2.0, 1.5]), rays, start, end)
        assert found == pytest.approx([5.0, 25 / 3, np.inf, np.inf, np.inf])
