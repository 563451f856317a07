"""Distortion and exposure of the estate's cameras."""

import numpy as np
import pytest
from benchmarks.estate.capture.lens import Distortion, distort, exposure, photographed, undistort
from hypothesis import given
from hypothesis import strategies as st

coefficient = st.floats(-0.12, 0.12)
small = st.floats(-0.003, 0.003)
place = st.floats(-0.7, 0.7)


@given(coefficient, st.floats(-0.04, 0.04), small, small, place, place)
def test_undistort_undoes_distort(k1, k2, p1, p2, x, y):
    lens, points = Distortion(k1, k2, p1, p2), np.array([[x, y]])
    assert np.allclose(undistort(distort(points, lens), lens), points, atol=1e-10)


def test_distortion_is_that_of_opencv():
    cv2 = pytest.importorskip("cv2")
    lens = Distortion(-0.11, 0.03, 0.0012, -0.0008)
    points = np.random.default_rng(0).uniform(-0.6, 0.6, (50, 2))
    wanted, _ = cv2.projectPoints(
        np.column_stack([points, np.ones(50)]),
        np.zeros(3),
        np.zeros(3),
        np.eye(3),
        np.array([lens.k1, lens.k2, lens.p1, lens.p2]),
    )
    assert np.allclose(distort(points, lens), wanted[:, 0], atol=1e-12)


def scene(height=120, width=160):
    rng = np.random.default_rng(1)
    light = np.exp(rng.normal(-2.5, 0.5, (height // 8, width // 8, 1)))
    light = light.repeat(8, axis=0).repeat(8, axis=1) * np.array([1.0, 0.95, 0.9])
    return light.astype(np.float32), np.ones((height, width), bool)


def test_exposure_follows_the_light():
    """Ten times the light gives the same picture, but for rounding."""
    light, seen = scene()
    assert exposure(10 * light, seen) == pytest.approx(exposure(light, seen) / 10)
    dim = photographed(light, seen, np.random.default_rng(3))
    bright = photographed(10 * light, seen, np.random.default_rng(3))
    assert np.abs(dim.astype(int) - bright).max() <= 1


def test_a_picture_has_middle_tones_and_is_black_where_nothing_was_seen():
    light, seen = scene()
    seen[:, 100:] = False
    light[:, 100:] = 50.0  # must not count
    picture = photographed(light, seen, np.random.default_rng(0))
    assert 70 < picture[:, :96].mean() < 160
    assert (picture[:, 100:] == 0).all()


def test_corners_are_darker_by_the_vignetting_only_where_asked():
    light, seen = np.full((90, 120, 3), 0.1, np.float32), np.ones((90, 120), bool)
    for vignetting, least, most in ((0.5, 0.5, 0.95), (0.0, 0.99, 1.01)):
        picture = photographed(
            light, seen, np.random.default_rng(0), vignetting=vignetting, noise=0.0
        )
        assert least < picture[:4, :4].mean() / picture[43:47, 58:62].mean() < most


def test_noise_can_be_left_out_and_depends_on_the_seed():
    light, seen = np.full((40, 60, 3), 0.1, np.float32), np.ones((40, 60), bool)
    clean = photographed(light, seen, np.random.default_rng(0), vignetting=0.0, noise=0.0)
    assert np.ptp(clean.reshape(-1, 3), axis=0).max() == 0
    first, again, other = (
        photographed(light, seen, np.random.default_rng(seed)) for seed in (0, 0, 1)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_nothing_seen_gives_a_black_picture():
    light = np.zeros((8, 8, 3), np.float32)
    picture = photographed(light, np.zeros((8, 8), bool), np.random.default_rng(0))
    assert not picture.any()
