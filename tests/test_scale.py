"""Metric scale: the formula, its uncertainty, and what it says about bad distances."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from si3fp.camera2d.scale import scale_from_distances
from si3fp.errors import InputError
from si3fp.geometry.equirect import world_from_pano_rotation
from si3fp.geometry.similarity import Similarity3
from si3fp.model import KnownDistance
from si3fp.sources.triangle import read_known_distances

M_PER_UNIT = 3.7
CORNERS = {"a": [0.0, 0.0, 0.0], "b": [2.0, 0.2, 0.1], "c": [0.7, 1.6, -0.1], "d": [2.5, 2.1, 0.3]}
TRIANGLE = [("a", "b"), ("b", "c"), ("c", "a")]


def metres(start: str, end: str) -> float:
    return M_PER_UNIT * float(np.linalg.norm(np.subtract(CORNERS[start], CORNERS[end])))


def sides(noise=(0.0, 0.0, 0.0), pairs=TRIANGLE):
    return [KnownDistance(s, e, metres(s, e) + n) for (s, e), n in zip(pairs, noise, strict=True)]


def test_exact_sides_give_the_exact_scale():
    scale = scale_from_distances(CORNERS, sides())
    assert scale.m_per_unit == pytest.approx(M_PER_UNIT, rel=1e-12)
    assert [side.residual_m for side in scale.sides] == pytest.approx([0, 0, 0], abs=1e-12)
    assert scale.outlier is None
    assert scale.unused == ()


def test_the_scale_is_the_formula_computed_by_hand():
    points = {"a": [0, 0, 0], "b": [3, 0, 0], "c": [0, 4, 0]}
    distances = [
        KnownDistance("a", "b", 6.03),
        KnownDistance("a", "c", 7.98),
        KnownDistance("b", "c", 10.01),
    ]
    scale = scale_from_distances(points, distances, sigma_m=0.02)
    assert scale.m_per_unit == pytest.approx((6.03 * 3 + 7.98 * 4 + 10.01 * 5) / 50)
    assert scale.sigma_m_per_unit == pytest.approx(0.02 / np.sqrt(50))
    assert scale.sides[0].residual_m == pytest.approx(scale.m_per_unit * 3 - 6.03)


@pytest.mark.parametrize("count", [1, 3, 6])
def test_the_uncertainty_covers_two_centimetres_of_noise(count):
    pairs = [*TRIANGLE, ("a", "d"), ("b", "d"), ("c", "d")][:count]
    rng = np.random.default_rng(count)
    hits = []
    for _ in range(2000):
        scale = scale_from_distances(CORNERS, sides(rng.normal(0, 0.02, count), pairs))
        hits.append(abs(scale.m_per_unit - M_PER_UNIT) <= 1.96 * scale.sigma_m_per_unit)
    # 95 % expected; the standard deviation of the share of 2000 draws is 0.5 %.
    assert 0.93 < np.mean(hits) < 0.97


@given(st.floats(1e-3, 1e3), st.floats(0.01, 100))
def test_a_larger_reconstruction_has_a_smaller_scale(factor, sigma_m):
    points = {name: factor * np.array(place) for name, place in CORNERS.items()}
    scale = scale_from_distances(points, sides(), sigma_m)
    assert scale.m_per_unit * factor == pytest.approx(M_PER_UNIT)
    assert scale.sigma_m_per_unit / scale.m_per_unit == pytest.approx(
        sigma_m / np.linalg.norm([metres(*pair) for pair in TRIANGLE])
    )


def test_the_side_that_does_not_fit_is_named():
    scale = scale_from_distances(CORNERS, sides((0.005, 0.3, -0.01)))
    assert scale.outlier is not None
    assert (scale.outlier.distance.start, scale.outlier.distance.end) == ("b", "c")
    assert scale.outlier.residual_m < -0.1
    assert abs(scale.m_per_unit - M_PER_UNIT) < 2 * scale.sigma_m_per_unit


def test_two_sides_that_contradict_blame_nobody_but_widen_the_uncertainty():
    scale = scale_from_distances(CORNERS, sides((0.2, -0.1), TRIANGLE[:2]))
    assert scale.outlier is None
    assert scale.sigma_m_per_unit > 3 * 0.02 / np.hypot(*[metres(*p) for p in TRIANGLE[:2]])


def test_a_slipped_digit_is_an_error_that_names_the_side():
    with pytest.raises(InputError, match=r"b - c \(\S+ m\) fits worst.*Check its photo names"):
        scale_from_distances(CORNERS, sides((0.0, 9 * metres("b", "c"), 0.0)))


def test_distances_without_a_reconstructed_point_are_listed():
    points = {name: CORNERS[name] for name in "ab"}
    scale = scale_from_distances(points, sides())
    assert scale.m_per_unit == pytest.approx(M_PER_UNIT)
    assert [str(distance)[:5] for distance in scale.unused] == ["b - c", "c - a"]


def test_no_usable_distance_says_what_to_do():
    with pytest.raises(InputError, match=r"no scale \(no distance given\).*--triangle"):
        scale_from_distances(CORNERS, [])
    with pytest.raises(InputError, match=r"\(b, c not reconstructed\).*check the names"):
        scale_from_distances({"a": CORNERS["a"]}, sides())


def test_impossible_distances_and_points_say_what_to_do():
    for length in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match=r"from a to b is .* give the length measured"):
            KnownDistance("a", "b", length)
    with pytest.raises(InputError, match="between two different points"):
        KnownDistance("a", "a", 1.0)
    with pytest.raises(InputError, match=r"a - b .*same place.*different places"):
        scale_from_distances(CORNERS | {"b": CORNERS["a"]}, sides())
    with pytest.raises(InputError, match="three finite coordinates"):
        scale_from_distances(CORNERS | {"b": [np.nan, 0.0, 0.0]}, sides())
    with pytest.raises(InputError, match="must be positive, got 0"):
        scale_from_distances(CORNERS, sides(), sigma_m=0.0)


# Known centres

MOVED = Similarity3(M_PER_UNIT, world_from_pano_rotation(40, 70, 10), np.array([9.0, -5.0, 2.0]))


@pytest.mark.slow
@pytest.mark.skipif("SI3FP_TEST_DATA" not in os.environ, reason="needs SI3FP_TEST_DATA")
def test_the_triangle_of_the_castle_agrees_with_its_published_cameras():
    from si3fp.sources.colmap_text import read_colmap_text

    castle = Path(os.environ["SI3FP_TEST_DATA"]) / "castle"
    photos = read_colmap_text(castle / "cameras").photos
    centres = {photo.id: photo.centre_in_world / 4.2 for photo in photos}
    scale = scale_from_distances(centres, read_known_distances(castle / "reference_triangle.json"))
    assert scale.m_per_unit == pytest.approx(4.2, rel=1e-4)
    assert max(abs(side.residual_m) for side in scale.sides) < 2e-3
