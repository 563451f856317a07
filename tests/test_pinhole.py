"""Pinhole cameras: pixels, points, and cameras that cannot be."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from si3fp.errors import InputError
from si3fp.geometry.pinhole import Pinhole

CAMERA = Pinhole(1200.0, 1180.0, 801.5, 598.25, 1600, 1200)


@given(st.floats(0, 1600), st.floats(0, 1200), st.floats(0.1, 1000))
def test_pixels_to_points_and_back(x, y, depth):
    point = CAMERA.unproject([x, y]) * depth
    assert point[2] == depth
    np.testing.assert_allclose(CAMERA.project(point), [x, y], atol=1e-8)


def test_points_behind_the_camera_have_no_pixel():
    pixels = CAMERA.project([[0.0, 0.0, -1.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    assert np.isnan(pixels[:2]).all()
    np.testing.assert_allclose(pixels[2], [801.5, 598.25])


def test_impossible_cameras_are_refused():
    with pytest.raises(InputError, match="positive focal lengths"):
        Pinhole(0.0, 1.0, 1.0, 1.0, 10, 10)
    with pytest.raises(InputError, match="finite principal point"):
        Pinhole(1.0, 1.0, float("nan"), 1.0, 10, 10)
    with pytest.raises(InputError, match="no image"):
        Pinhole(1.0, 1.0, 1.0, 1.0, 0, 10)
