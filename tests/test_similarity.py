"""Similarity transforms and Umeyama's fit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from si3fp.errors import InputError
from si3fp.geometry.equirect import world_from_pano_rotation
from si3fp.geometry.rigid import Rigid3
from si3fp.geometry.similarity import Similarity3, fit_similarity

angles_deg = st.floats(-180, 180)
metres = st.floats(-1000, 1000)
points = st.tuples(metres, metres, metres)
TRIANGLE = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 1.0], [1.0, 3.0, 0.5]])


@st.composite
def similarities(draw) -> Similarity3:
    rotation = world_from_pano_rotation(draw(angles_deg), draw(angles_deg), draw(angles_deg))
    return Similarity3(draw(st.floats(0.01, 100)), rotation, np.array(draw(points)))


def poses():
    return similarities().map(lambda similar: Rigid3(similar.rotation, similar.translation))


@given(similarities(), points)
def test_there_and_back(b_from_a, point):
    np.testing.assert_allclose(b_from_a.inverse().apply(b_from_a.apply(point)), point, atol=1e-6)


@given(similarities(), similarities(), points)
def test_composition_applies_one_after_the_other(c_from_b, b_from_a, point):
    expected = c_from_b.apply(b_from_a.apply(point))
    np.testing.assert_allclose((c_from_b @ b_from_a).apply(point), expected, rtol=1e-9, atol=1e-5)


@given(similarities(), poses(), points)
def test_a_moved_camera_sees_the_same_direction_at_scaled_depth(b_from_a, cam_from_a, point):
    in_cam = b_from_a.cam_from_b(cam_from_a).apply(b_from_a.apply(point))
    expected = b_from_a.scale * cam_from_a.apply(point)
    np.testing.assert_allclose(in_cam, expected, rtol=1e-7, atol=1e-5)


@given(similarities(), poses())
def test_camera_poses_go_there_and_back(b_from_a, cam_from_a):
    back = b_from_a.inverse().cam_from_b(b_from_a.cam_from_b(cam_from_a))
    np.testing.assert_allclose(back.rotation, cam_from_a.rotation, atol=1e-9)
    np.testing.assert_allclose(back.translation, cam_from_a.translation, atol=1e-5)


@given(similarities(), st.sampled_from(["three", "coplanar", "general"]))
def test_the_fit_finds_the_transform(b_from_a, kind):
    rng = np.random.default_rng(7)
    source = {
        "three": TRIANGLE,
        "coplanar": rng.normal(size=(9, 3)) * [5.0, 5.0, 0.0],
        "general": rng.normal(size=(9, 3)),
    }[kind]
    fit = fit_similarity(source, b_from_a.apply(source))
    assert fit.b_from_a.scale == pytest.approx(b_from_a.scale, rel=1e-7)
    np.testing.assert_allclose(fit.b_from_a.rotation, b_from_a.rotation, atol=1e-6)
    np.testing.assert_allclose(fit.distances, 0, atol=1e-6 * max(1.0, b_from_a.scale))


def test_a_mirrored_set_gives_a_rotation_all_the_same():
    source = np.random.default_rng(3).normal(size=(12, 3))
    fit = fit_similarity(source, source * [1.0, 1.0, -0.2])
    assert np.linalg.det(fit.b_from_a.rotation) == pytest.approx(1.0)


def test_weights_leave_out_a_wrong_point():
    target = np.vstack([2 * TRIANGLE, [[2.0, 2.0, 8.0]]])
    source = np.vstack([TRIANGLE, [[1.0, 1.0, 4.0]]])
    target[3] += 5.0
    fit = fit_similarity(source, target, [1.0, 1.0, 1.0, 0.0])
    assert fit.b_from_a.scale == pytest.approx(2.0)
    np.testing.assert_allclose(fit.distances, [0, 0, 0, np.sqrt(75)], atol=1e-9)


def test_residuals_are_fitted_minus_target():
    target = TRIANGLE.copy()
    target[0] += [0.1, 0.0, 0.0]
    fit = fit_similarity(TRIANGLE, target)
    np.testing.assert_allclose(fit.residuals, fit.b_from_a.apply(TRIANGLE) - target)
    np.testing.assert_allclose(fit.residuals.sum(axis=0), 0, atol=1e-12)


@pytest.mark.parametrize("offsets", [[0.0, 0.0, 0.0], [0.0, 1e-4, 0.0]])
def test_points_on_a_line_are_refused(offsets):
    line = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [3.0, 3.0, 0.0]])
    line[:, 2] += offsets
    with pytest.raises(InputError, match=r"lie on one line.*add a point off the line"):
        fit_similarity(line, TRIANGLE)
    with pytest.raises(InputError, match="lie on one line"):
        fit_similarity(TRIANGLE, line)


def test_too_few_or_broken_points_are_refused():
    with pytest.raises(InputError, match="at least 3 pairs of points, got 2"):
        fit_similarity(TRIANGLE[:2], TRIANGLE[:2])
    with pytest.raises(InputError, match="at least 3 pairs of points, got 2"):
        fit_similarity(TRIANGLE, TRIANGLE, [1.0, 1.0, 0.0])
    with pytest.raises(InputError, match="got 3 and 2 points"):
        fit_similarity(TRIANGLE, TRIANGLE[:2])
    with pytest.raises(InputError, match=r"Points \[1\].*NaN"):
        fit_similarity(TRIANGLE, [[0, 0, 0], [np.nan, 1, 1], [1, 2, 3]])
    with pytest.raises(InputError, match="positive, finite scale, got 0"):
        Similarity3(0.0, np.eye(3), np.zeros(3))
