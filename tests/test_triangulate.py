"""Points from their pixels in several photos, against points that are known."""

from __future__ import annotations

import numpy as np
import pytest

from si3fp.errors import InputError, ReconstructionError
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import Rigid3
from si3fp.geometry.triangulate import triangulate

CAMERA = Pinhole(1500.0, 1500.0, 1000.0, 750.0, 2000, 1500)
POINT = np.array([1.0, -0.5, 12.0])


def looking_ahead(*centre: float) -> Rigid3:
    return Rigid3(np.eye(3), -np.array(centre))


POSES = [looking_ahead(x, 0.1 * x, 0.0) for x in (-3.0, -1.0, 1.0, 3.0)]


def marks(poses=POSES):
    return np.stack([CAMERA.project(pose.apply(POINT)) for pose in poses])


def found(pixels, poses=POSES, sigma_px=1.0):
    return triangulate([CAMERA] * len(poses), poses, pixels, sigma_px)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_exact_marks_give_the_exact_point(count):
    point = found(marks()[:count], POSES[:count])
    np.testing.assert_allclose(point.point_in_world, POINT, atol=1e-9)
    np.testing.assert_allclose(point.residuals_px, 0, atol=1e-7)


def test_the_covariance_is_the_spread_of_noisy_marks():
    rng = np.random.default_rng(0)
    drawn = [found(marks() + rng.normal(0, 1, (4, 2))) for _ in range(300)]
    errors = np.stack([point.point_in_world - POINT for point in drawn])
    covariance = found(marks()).covariance
    # Squared errors in units of the covariance are chi-squared with 3 degrees of freedom: mean 3,
    # standard deviation of the mean of 300 sqrt(6 / 300) = 0.14.
    distances = np.einsum("ni,ij,nj->n", errors, np.linalg.inv(covariance), errors)
    assert distances.mean() == pytest.approx(3.0, abs=0.45)


def test_a_wrong_mark_is_named_and_left_out():
    pixels = marks()
    pixels[2] += [60.0, -20.0]
    point = found(pixels)
    assert point.used.tolist() == [True, True, False, True]
    np.testing.assert_allclose(point.point_in_world, POINT, atol=1e-8)
    np.testing.assert_allclose(point.residuals_px[2], [-60.0, 20.0], atol=1e-5)


def test_marks_of_different_points_are_refused():
    pixels = marks()[:2] + np.array([[0.0, 80.0], [0.0, -80.0]])
    with pytest.raises(ReconstructionError, match="do not belong to one point"):
        found(pixels, POSES[:2])


def test_rays_that_do_not_meet_are_refused():
    near = [looking_ahead(0.0, 0.0, 0.0), looking_ahead(0.1, 0.0, 0.0)]
    with pytest.raises(ReconstructionError, match="marked rays meet at 1 degree"):
        found(marks(near), near)
    behind = 2 * np.array([1000.0, 750.0]) - marks()[:2]
    with pytest.raises(ReconstructionError, match="in front of their cameras"):
        found(behind, POSES[:2])


def test_broken_marks_are_refused():
    with pytest.raises(InputError, match="at least 2 photos, got 1"):
        found(marks()[:1], POSES[:1])
    with pytest.raises(InputError, match="finite pixels"):
        found([[np.nan, 1.0], [1.0, 2.0]], POSES[:2])
    with pytest.raises(InputError, match="one camera, pose and pixel per photo"):
        found(marks(), POSES[:2])
