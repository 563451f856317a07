"""Lens distortion taken out of photos: the same point in the photo as taken and as undistorted."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from si3fp.camera2d.undistort import Lens, undistort, undistorted_camera
from si3fp.errors import InputError
from si3fp.geometry.pinhole import Pinhole

CAMERA = Pinhole(500.0, 505.0, 322.3, 236.8, 640, 480)
lenses = st.builds(
    lambda k1, k2, p1, p2: Lens(CAMERA, np.array([k1, k2, p1, p2])),
    st.floats(-0.15, 0.3),
    st.floats(-0.05, 0.05),
    st.floats(-0.005, 0.005),
    st.floats(-0.005, 0.005),
)


def sampled_at(lens: Lens, target: Pinhole, pixels: np.ndarray) -> np.ndarray:
    """Where in the photo as taken the pixels of the undistorted one are."""
    return lens.project(target.unproject(pixels))


@settings(max_examples=60, deadline=None)
@given(lenses)
def test_every_undistorted_pixel_lies_inside_the_photo(lens):
    target = undistorted_camera(lens)
    x, y = np.meshgrid(np.linspace(0, target.width_px, 41), np.linspace(0, target.height_px, 41))
    taken = sampled_at(lens, target, np.stack([x, y], axis=-1))
    assert taken.min() > -0.05  # the border is followed in 200 steps
    assert (taken < [CAMERA.width_px + 0.05, CAMERA.height_px + 0.05]).all()
    assert (target.fx_px, target.fy_px) == (CAMERA.fx_px, CAMERA.fy_px)


@settings(max_examples=60, deadline=None)
@given(lenses)
def test_the_image_could_not_be_larger(lens):
    target = undistorted_camera(lens)
    w, h = target.width_px, target.height_px
    beyond = []  # three pixels farther out on each side: some pixel there lies outside the photo
    for side in ([[-3, y] for y in range(h)], [[w + 3, y] for y in range(h)],
                 [[x, -3] for x in range(w)], [[x, h + 3] for x in range(w)]):  # fmt: skip
        taken = sampled_at(lens, target, np.array(side, float))
        size = [CAMERA.width_px, CAMERA.height_px]
        beyond.append(bool(((taken < 0) | (taken > size)).any()))
    assert all(beyond)


@settings(max_examples=60, deadline=None)
@given(lenses, st.floats(-0.4, 0.4), st.floats(-0.3, 0.3), st.floats(0.1, 100))
def test_the_formula_is_that_of_opencv(lens, x, y, depth_m):
    point = np.array([x * depth_m, y * depth_m, depth_m])
    camera = np.array([[500, 0, 322.3], [0, 505, 236.8], [0, 0, 1.0]])
    theirs, _ = cv2.projectPoints(point[None], np.zeros(3), np.zeros(3), camera, lens.distortion)
    np.testing.assert_allclose(lens.project(point), theirs.ravel(), atol=1e-9)


def test_behind_the_camera_there_is_no_pixel():
    assert np.isnan(Lens(CAMERA, np.zeros(4)).project([0.1, 0.1, -1.0])).all()


def test_without_distortion_camera_and_photo_stay_as_they_are():
    lens = Lens(CAMERA, np.zeros(4))
    photo = np.random.default_rng(0).integers(0, 255, (480, 640, 3)).astype(np.uint8)
    assert undistorted_camera(lens) == CAMERA
    assert undistort(photo, lens, CAMERA) is photo


@pytest.mark.parametrize("distortion", [(-0.1, 0.02, 0.002, -0.003), (0.2, 0.0, 0.0, 0.0)])
def test_a_blob_moves_to_where_the_undistorted_camera_sees_it(distortion):
    lens = Lens(CAMERA, np.array(distortion))
    target = undistorted_camera(lens)
    x, y = np.meshgrid(np.arange(640) + 0.5, np.arange(480) + 0.5)
    for point in ([-0.45, -0.3, 1.0], [0.5, 0.38, 1.0], [0.0, 0.3, 1.0]):
        u, v = lens.project(point)
        blob = np.exp(-((x - u) ** 2 + (y - v) ** 2) / 18)
        photo = np.repeat(np.rint(250 * blob)[..., None], 3, axis=2).astype(np.uint8)
        result = undistort(photo, lens, target)[..., 0].astype(float)
        assert result.shape == (target.height_px, target.width_px)
        columns, rows = np.arange(target.width_px) + 0.5, np.arange(target.height_px) + 0.5
        found = [(result.sum(0) @ columns) / result.sum(), (result.sum(1) @ rows) / result.sum()]
        # The stretching of the blob itself moves its centre a little; half a pixel would show.
        np.testing.assert_allclose(found, target.project(point), atol=0.1)


def test_bands_do_not_show():
    camera = Pinhole(400.0, 400.0, 60.0, 620.0, 120, 1240)
    lens = Lens(camera, np.array([0.01, 0.0, 0.0, 0.0]))
    target = undistorted_camera(lens)
    ramp = np.tile(np.linspace(0, 255, 1240)[:, None, None], (1, 120, 3)).astype(np.uint8)
    steps = np.diff(undistort(ramp, lens, target)[:, 60, 0].astype(int))
    assert len(steps) > 1024
    assert steps.min() >= 0
    assert steps.max() <= 1


def test_impossible_lenses_and_photos_of_another_size_say_what_to_do():
    with pytest.raises(InputError, match="four finite numbers"):
        Lens(CAMERA, np.array([0.1, np.nan, 0, 0]))
    with pytest.raises(InputError, match="four finite numbers"):
        Lens(CAMERA, np.zeros(5))
    for distortion in ([-0.9, 0, 0, 0], [-0.5, 0.0, 0, 0], [0, 0, 0.5, 0]):
        with pytest.raises(InputError, match="leave its photos out"):
            undistorted_camera(Lens(CAMERA, np.array(distortion)))
    with pytest.raises(InputError, match="640 x 480 px; give the photos"):
        undistort(np.zeros((640, 480, 3), np.uint8), Lens(CAMERA, np.zeros(4)), CAMERA)
