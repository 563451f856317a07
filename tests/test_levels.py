"""Values that share levels: noise averages out as theory says, outliers stay alone."""

import numpy as np
import pytest

from si3fp.windows.levels import LEAST_SPREAD_M, prior_from_others, shared_levels


def grouped(values, sigma=0.03, known=None):
    values = np.array(values, float)
    sigmas = np.full(len(values), sigma)
    known = np.ones(len(values), bool) if known is None else np.array(known)
    return values, sigmas, shared_levels(values, sigmas, known)


def test_two_rows_and_a_stairwell_window():
    _, _, levels = grouped([1.0, 1.02, 0.99, 1.01, 4.0, 4.02, 3.98, 2.5])
    first, second = levels.index[0], levels.index[4]
    assert levels.index.tolist() == [first] * 4 + [second] * 3 + [-1]
    assert first != second
    assert levels.belongs[7] == 0
    assert (levels.belongs[:7] > 0.8).all()


def test_unknown_values_belong_to_nothing_and_count_for_nothing():
    values, sigmas, levels = grouped([1.0, 1.0, 1.0, 1.04], known=[True, True, True, False])
    assert levels.index[3] == -1
    assert prior_from_others(values, sigmas, levels).mean[:3] == pytest.approx([1.0] * 3)


def test_order_and_place_do_not_matter():
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.normal(c, 0.03, 5) for c in (1, 4, 7)])
    order = rng.permutation(15)
    one, sigma, levels = grouped(values)
    other, _, mixed = grouped(values[order] + 10)
    same = levels.index[:, None] == levels.index[None]
    assert np.array_equal(same[np.ix_(order, order)], mixed.index[:, None] == mixed.index[None])
    prior, moved = (prior_from_others(v, sigma, s) for v, s in ((one, levels), (other, mixed)))
    assert moved.mean == pytest.approx(prior.mean[order] + 10)
    assert moved.variance == pytest.approx(prior.variance[order])


def test_prior_of_equal_values_is_the_mean_of_the_others():
    values, sigmas, levels = grouped([1.0, 1.02, 0.98, 1.01], sigma=0.04)
    prior = prior_from_others(values, sigmas, levels)
    assert prior.mean[0] == pytest.approx(np.mean([1.02, 0.98, 1.01]), abs=1e-4)
    variance = LEAST_SPREAD_M**2 + (0.04**2 + LEAST_SPREAD_M**2) / 3
    # The doubt whether a value belongs, about 3 %, comes on top.
    assert prior.variance[0] == pytest.approx(variance, rel=0.06)


def test_those_met_already_are_not_heard_again():
    values, sigmas, levels = grouped([1.0, 1.02, 0.98, 1.01])
    related = np.zeros((4, 4), bool)
    related[0, 1] = True
    prior = prior_from_others(values, sigmas, levels, related)
    assert prior.mean[0] == pytest.approx(np.mean([0.98, 1.01]), abs=1e-4)


def test_the_spread_within_a_level_is_learnt():
    rng = np.random.default_rng(1)
    truth = np.repeat(np.arange(10.0), 8) * 3 + rng.normal(0, 0.05, 80)
    values, sigmas, levels = grouped(truth + rng.normal(0, 0.01, 80), sigma=0.01)
    variance = prior_from_others(values, sigmas, levels).variance
    # Of 80 values, and those far off are left alone.
    assert np.sqrt(np.median(variance[np.isfinite(variance)])) == pytest.approx(0.05, abs=0.012)


@pytest.mark.parametrize("values", [[], [1.0], [1.0, 3.0]])
def test_few_or_unlike_values_share_nothing(values):
    values, sigmas, levels = grouped(values)
    assert (levels.index == -1).all()
    assert np.isinf(prior_from_others(values, sigmas, levels).variance).all()
