"""COLMAP's text files: what is read, and what is refused."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from si3fp.errors import InputError
from si3fp.sources.colmap_text import read_colmap_text

CAMERAS = "# comment\n1 PINHOLE 200 100 150.0 151.0 100.5 50.5\n"
# Image 8 has turned by 90 degrees about y (to the right): forward is x of the world.
IMAGES = (
    "# comment\n"
    "7 1 0 0 0 0.5 0 2 1 left wing.jpg\n"
    "10.5 20.5 3 11.5 21.5 -1\n"
    "8 0.70710678 0 -0.70710678 0 0 0 0 1 b.jpg\n"
    "\n"
)
POINTS = "3 1.0 2.0 3.0 255 128 0 0.7 7 0 8 4 8 5\n"


def model(tmp_path, cameras=CAMERAS, images=IMAGES, points: str | None = POINTS):
    (tmp_path / "cameras.txt").write_text(cameras)
    (tmp_path / "images.txt").write_text(images)
    if points is not None:
        (tmp_path / "points3D.txt").write_text(points)
    return read_colmap_text(tmp_path)


def test_photos_and_points_are_read(tmp_path):
    read = model(tmp_path)
    left, right = read.photos
    assert (left.id, right.id) == ("left wing.jpg", "b.jpg")
    assert (left.camera.fx_px, left.camera.fy_px) == (150.0, 151.0)
    assert (left.camera.width_px, left.camera.height_px) == (200, 100)
    np.testing.assert_allclose(left.centre_in_world, [-0.5, 0.0, -2.0])
    forward_in_world = right.cam_from_world.inverse().rotate([0.0, 0.0, 1.0])
    np.testing.assert_allclose(forward_in_world, [1.0, 0.0, 0.0], atol=1e-7)
    np.testing.assert_allclose(read.distortion["b.jpg"], 0)
    np.testing.assert_allclose(read.points.points_in_world, [[1.0, 2.0, 3.0]])
    assert read.points.rgb.tolist() == [[255, 128, 0]]
    assert read.points.error_px.tolist() == [0.7]
    assert read.points.photo_ids == (("left wing.jpg", "b.jpg"),)


def test_points_are_optional_and_so_is_the_last_empty_line(tmp_path):
    read = model(tmp_path, images=IMAGES.rstrip("\n"), points=None)
    assert len(read.photos) == 2
    assert len(read.points) == 0
    assert read.points.points_in_world.shape == (0, 3)


@pytest.mark.parametrize(
    ("line", "pinhole", "lens"),
    [
        ("SIMPLE_PINHOLE 200 100 150 99 49", (150, 150, 99, 49), (0, 0, 0, 0)),
        ("SIMPLE_RADIAL 200 100 150 99 49 .1", (150, 150, 99, 49), (0.1, 0, 0, 0)),
        ("RADIAL 200 100 150 99 49 .1 .2", (150, 150, 99, 49), (0.1, 0.2, 0, 0)),
        ("OPENCV 200 100 150 151 99 49 .1 .2 .3 .4", (150, 151, 99, 49), (0.1, 0.2, 0.3, 0.4)),
    ],
)
def test_camera_models(tmp_path, line, pinhole, lens):
    read = model(tmp_path, cameras=f"1 {line}\n")
    camera = read.photos[0].camera
    assert (camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px) == pinhole
    np.testing.assert_allclose(read.distortion["b.jpg"], lens)


@pytest.mark.parametrize(
    ("cameras", "message"),
    [
        ("1 OPENCV_FISHEYE 9 9 1 1 1 1 0 0 0 0", "OPENCV_FISHEYE is not supported.*undistorter"),
        ("1 PINHOLE 200 100 150 151 99", "line 1: a PINHOLE camera has 4 parameters, got 3"),
        ("1 PINHOLE", "line 1: a camera is CAMERA_ID"),
        ("1 PINHOLE 200 100 nan 151 99 49", "line 1: .* is not finite"),
        ("1 PINHOLE 200 100 x 151 99 49", "line 1: .* is not a number"),
        ("1 PINHOLE 200 100 -150 151 99 49", "line 1: .*positive focal lengths"),
        ("1 PINHOLE 200.5 100 150 151 99 49", "whole pixels"),
        (CAMERAS + CAMERAS, "line 4: camera 1 occurs twice"),
        ("2 PINHOLE 200 100 150 151 99 49", "has camera 1, not in cameras.txt"),
    ],
)
def test_broken_cameras_are_refused(tmp_path, cameras, message):
    with pytest.raises(InputError, match=message):
        model(tmp_path, cameras=cameras)


@pytest.mark.parametrize(
    ("images", "message"),
    [
        ("", "has no image"),
        ("7 1 0 0 0 0.5 0 2 1\n\n", "line 1: an image is .* cut off"),
        ("7 1 0 0 0 nan 0 2 1 a.jpg\n\n", "pose of a.jpg is not finite"),
        ("7 1 0 0 0 0.5 0 q 1 a.jpg\n\n", "pose of a.jpg is not a number"),
        ("7 0 0 0 0 0.5 0 2 1 a.jpg\n\n", "rotation of a.jpg is no unit quaternion"),
        ("7 1 0 0 0 0 0 0 1 a.jpg\n1.5 2.5\n", "line 2: after the line of a.jpg"),
        ("7 1 0 0 0 0 0 0 1 a.jpg\n8 1 0 0 0 0 0 0 1 b.jpg\n", "cut off or missing"),
        ("7 1 0 0 0 0 0 0 1 a.jpg\n\n8 1 0 0 0 0 0 0 1 a.jpg\n\n", "occurs twice"),
        ("7 1 0 0 0 0 0 0 1 a.jpg\n\n7 1 0 0 0 0 0 0 1 b.jpg\n\n", "occurs twice"),
    ],
)
def test_broken_images_are_refused(tmp_path, images, message):
    with pytest.raises(InputError, match=message):
        model(tmp_path, images=images)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ("3 1 2 3 255 128 0", "line 1: a point is .* got 7 values"),
        ("3 1 2 3 255 128 0 0.7 7", "got 9 values; the line is cut off"),
        ("3 1 2 inf 255 128 0 0.7", "is not finite"),
        ("3 1 2 3 256 128 0 0.7", "colours are 0 to 255"),
        ("3 1 2 3 255 128 0 0.7 99 0", "image 99, which is not in images.txt"),
    ],
)
def test_broken_points_are_refused(tmp_path, points, message):
    with pytest.raises(InputError, match=message):
        model(tmp_path, points=points)


def test_missing_and_binary_files_are_named(tmp_path):
    with pytest.raises(InputError, match=r"no file .*cameras.txt.*model_converter"):
        read_colmap_text(tmp_path)
    (tmp_path / "cameras.txt").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(InputError, match="not a readable text file"):
        read_colmap_text(tmp_path)


@pytest.mark.slow
@pytest.mark.skipif("SI3FP_TEST_DATA" not in os.environ, reason="needs SI3FP_TEST_DATA")
def test_the_cameras_of_the_castle_stand_level_around_the_court():
    read = read_colmap_text(Path(os.environ["SI3FP_TEST_DATA"]) / "castle" / "cameras")
    assert len(read.photos) == 30
    down = np.stack([p.cam_from_world.inverse().rotate([0.0, 1.0, 0.0]) for p in read.photos])
    assert (down[:, 2] < -0.8).all()  # the world is z up
    heights_m = np.array([photo.centre_in_world[2] for photo in read.photos])
    assert np.ptp(heights_m) < 3.0
