"""The fused orthophoto: what most views agree on, from the sharpest of them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from si3fp.blend import AGREEMENT, blend
from si3fp.errors import FacadeError
from si3fp.model import OrthoImage

HEIGHT, WIDTH = 150, 200  # more than two bands
OCCLUDER = (slice(40, 110), slice(60, 120))


def wall(seed=0, grey=150.0) -> NDArray[np.uint8]:
    """A smooth coloured wall."""
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 6, 3)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    waves = np.sin(x[..., None] / 23 + phase) + np.cos(y[..., None] / 17 + 2 * phase)
    return np.clip(grey + 20 * waves + 0.5, 0, 255).astype(np.uint8)


def view(rgb, valid=None, source="v") -> OrthoImage:
    return OrthoImage(source, rgb, np.ones(rgb.shape[:2], bool) if valid is None else valid)


def with_occluder(rgb, colour=(20, 90, 20)) -> NDArray[np.uint8]:
    changed = rgb.copy()
    changed[OCCLUDER] = colour
    return changed


def same_weights(count: int) -> list[NDArray[np.float32]]:
    return [np.full((HEIGHT, WIDTH), 0.01, np.float32)] * count


def error(fused: OrthoImage, truth: NDArray[np.uint8]) -> NDArray[np.int_]:
    return np.abs(fused.rgb.astype(int) - truth)


def test_an_occluder_in_one_of_three_views_vanishes():
    truth = wall()
    fused = blend([view(truth), view(with_occluder(truth)), view(truth)], same_weights(3))
    assert error(fused, truth).max() <= 2


def test_two_different_occluders_in_five_views_vanish():
    truth = wall()
    views = [view(truth)] * 3 + [
        view(with_occluder(truth, (20, 90, 20))),
        view(with_occluder(truth, (240, 240, 250))),
    ]
    assert error(blend(views, same_weights(5)), truth).max() <= 2


def test_the_same_occluder_in_two_of_five_views_vanishes():
    truth = wall()
    views = [view(truth)] * 3 + [view(with_occluder(truth))] * 2
    assert error(blend(views, same_weights(5)), truth).max() <= 2


def test_the_occluded_view_cannot_win_by_its_weight():
    """The occluder stands in the sharpest view: 4 times the resolution, 16 times the weight."""
    truth = wall()
    weights = same_weights(3)
    weights[0] = weights[0] * np.float32(4)
    fused = blend([view(with_occluder(truth)), view(truth), view(truth)], weights)
    assert error(fused, truth).max() <= 8


def test_exposure_is_compensated():
    """Three views with gains of 0.7, 1 and 1.4; where each is missing, no step remains."""
    truth = wall(grey=110.0)
    views = []
    for index, gain in enumerate((0.7, 1.0, 1.4)):
        valid = np.ones((HEIGHT, WIDTH), bool)
        valid[:, 70 * index : 70 * index + 50] = False
        exposed = np.clip(truth * gain + 0.5, 0, 255).astype(np.uint8)
        views.append(view(np.where(valid[..., None], exposed, 0).astype(np.uint8), valid))
    fused = blend(views, same_weights(3))
    ratio = fused.rgb.astype(float) / truth
    # The common exposure is the geometric mean of the gains, 0.993; 4 is added before the
    # logarithm so that black stays finite, which costs a few percent in the dark.
    assert np.abs(ratio - (0.7 * 1.4) ** (1 / 3)).max() < 0.06


def test_a_cast_of_colour_is_compensated():
    truth = wall(grey=110.0)
    warm = np.clip(truth * [1.2, 1.0, 0.8] + 0.5, 0, 255).astype(np.uint8)
    half = np.ones((HEIGHT, WIDTH), bool)
    half[:, 140:] = False
    fused = blend([view(truth), view(warm, half)], same_weights(2))
    left, right = fused.rgb[:, 120:140] / truth[:, 120:140], fused.rgb[:, 140:] / truth[:, 140:]
    np.testing.assert_allclose(left.mean(axis=(0, 1)), right.mean(axis=(0, 1)), atol=0.015)


def test_views_without_overlap_keep_their_exposure():
    truth = wall()
    left = np.zeros((HEIGHT, WIDTH), bool)
    left[:, :100] = True
    fused = blend([view(truth, left), view(truth, ~left)], same_weights(2))
    np.testing.assert_array_equal(fused.rgb, truth)


def test_seen_by_counts_the_views():
    valid = np.zeros((3, HEIGHT, WIDTH), bool)
    valid[0, :, :120] = valid[1, 30:, :] = valid[2, :, 150:] = True
    fused = blend([view(wall(), mask) for mask in valid], same_weights(3))
    assert fused.source == "fused"
    np.testing.assert_array_equal(fused.seen_by, valid.sum(axis=0))
    np.testing.assert_array_equal(fused.valid, valid.any(axis=0))
    assert not fused.rgb[~fused.valid].any()


def test_nothing_seen_is_black_and_not_valid():
    nothing = np.zeros((HEIGHT, WIDTH), bool)
    fused = blend([view(wall(), nothing), view(wall(), nothing)], same_weights(2))
    assert not fused.valid.any()
    assert not fused.rgb.any()
    assert fused.seen_by is not None
    assert not fused.seen_by.any()


def test_a_single_view_is_itself():
    truth = wall()
    np.testing.assert_array_equal(blend([view(truth)], same_weights(1)).rgb, truth)


def test_the_sharpest_view_dominates_where_all_agree():
    """Fine lines that only the near view resolves survive at more than two thirds contrast."""
    lines = np.full((HEIGHT, WIDTH, 3), 140, np.uint8)
    lines[:, ::4] = 152
    flat = np.full_like(lines, 143)
    weights = same_weights(3)
    weights[1] = weights[1] * np.float32(3)
    fused = blend([view(flat), view(lines), view(flat)], weights).rgb.astype(int)
    assert AGREEMENT > 12
    assert fused[:, ::4].mean() - fused[:, 2::4].mean() > 0.66 * 12


def test_more_than_255_views_do_not_overflow():
    rgb = np.full((4, 5, 3), 90, np.uint8)
    weights = [np.ones((4, 5), np.float32)] * 300
    fused = blend([view(rgb)] * 300, weights)
    assert (fused.seen_by == 255).all()
    assert (fused.rgb == 90).all()


def test_blending_twice_gives_the_same_bits():
    views = [view(with_occluder(wall(seed), (seed, 9, 99))) for seed in range(4)]
    weights = same_weights(4)
    first, second = blend(views, weights), blend(views, weights)
    np.testing.assert_array_equal(first.rgb, second.rgb)
    assert first.seen_by is not None
    np.testing.assert_array_equal(first.seen_by, second.seen_by)


def test_blending_changes_no_input():
    rgb, weights = wall(), same_weights(2)
    before = rgb.copy()
    blend([view(rgb), view(with_occluder(rgb))], weights)
    np.testing.assert_array_equal(rgb, before)
    assert (weights[0] == np.float32(0.01)).all()


def test_no_view_is_an_error():
    with pytest.raises(FacadeError, match="No view of the facade"):
        blend([], [])
