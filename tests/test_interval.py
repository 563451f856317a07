"""The interval of the window-to-wall ratio, by hand and against facades drawn from its model."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from si3fp.config import FusionConfig, MeasureConfig
from si3fp.errors import InputError
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Detections, Facade, FacadeViews, OrthoImage, Window
from si3fp.windows.interval import NORMAL_90, WwrErrors, joint_interval, window_area, wwr_interval
from si3fp.windows.parse import parse_facade

NONE = WwrErrors(0.0, 0.0, 0.0, 0.0, 0.0)
SOME = WwrErrors(correlation=0.04, missed_mean=0.01, missed_sd=0.02, common_sd=0.08, part_sd=0.09)


def box(x_m, score=1.0, width_m=1.0, height_m=1.0, sigma_m=(0.0, 0.0, 0.0, 0.0)):
    return Window(x_m, 1.0, width_m, height_m, score=score, edge_sigma_m=sigma_m)


def row(count, score=1.0, sigma_m=(0.0, 0.0, 0.0, 0.0)):
    return [box(2.0 * k, score, sigma_m=sigma_m) for k in range(count)]


def test_real_or_not_has_the_variance_of_a_poisson_binomial():
    # 1 m2 with 0.5: mean 0.5, variance 0.25; 2 m2 with 0.8: mean 1.6, variance 0.16 * 4.
    mean, variance = window_area([box(0, 0.5), box(3, 0.8, width_m=2.0)], NONE)
    assert mean == pytest.approx(2.1)
    assert variance == pytest.approx(0.25 + 0.64)


def test_wholly_correlated_boxes_add_their_standard_deviations():
    boxes = [box(0, 0.5), box(3, 0.8, width_m=2.0)]
    assert window_area(boxes, replace(NONE, correlation=1.0))[1] == pytest.approx((0.5 + 0.8) ** 2)


def test_sides_that_are_uncertain_make_the_area_uncertain():
    # 2 m wide, 3 m high; the width off by hypot(0.03, 0.04) = 0.05 m, the height by 0.1 m.
    window = box(0, width_m=2.0, height_m=3.0, sigma_m=(0.03, 0.04, 0.1, 0.0))
    assert window_area([window], NONE)[1] == pytest.approx((0.05 * 3) ** 2 + (0.1 * 2) ** 2)
    half = replace(window, score=0.5)
    expected = 0.25 * 36 + 0.5 * (0.15**2 + 0.2**2)
    assert window_area([half], NONE)[1] == pytest.approx(expected)


def test_an_error_that_all_share_does_not_shrink_with_their_number():
    errors = replace(NONE, common_sd=0.1)
    for count in (1, 100):
        mean, variance = window_area(row(count), errors)
        assert variance**0.5 == pytest.approx(0.1 * mean)


def test_certain_windows_leave_nothing_but_the_point():
    assert wwr_interval(row(10), [], 100.0, 1.0, NONE) == pytest.approx((0.1, 0.1))


def test_certain_windows_leave_the_error_that_they_share():
    low, high = wwr_interval(row(10), [], 100.0, 1.0, replace(NONE, common_sd=0.1))
    assert (low, high) == pytest.approx((0.1 - 0.01 * NORMAL_90, 0.1 + 0.01 * NORMAL_90))


def test_a_wall_without_windows_may_have_some_that_nothing_found():
    low, high = wwr_interval([], [], 100.0, 1.0, SOME)
    assert low == 0
    assert high == pytest.approx(0.01 + 0.02 * NORMAL_90)


def test_boxes_under_the_threshold_raise_the_upper_end():
    alone = wwr_interval(row(10), [], 100.0, 1.0, SOME)
    doubtful = [box(100.0 + 2 * k, 0.3) for k in range(10)]
    assert wwr_interval(row(10), doubtful, 100.0, 1.0, SOME)[1] > alone[1] + 0.03


def test_a_candidate_that_is_a_window_again_does_not_count_twice():
    alone = wwr_interval(row(10), [], 100.0, 1.0, SOME)
    again, apart = box(2.1, 0.3), box(2.5, 0.3)  # IoU 0.82 and 0.33 with the second window
    assert wwr_interval(row(10), [again], 100.0, 1.0, SOME) == alone
    assert wwr_interval(row(10), [apart], 100.0, 1.0, SOME)[1] > alone[1]


def test_windows_inferred_beyond_what_was_seen_do_not_count_twice():
    # Half the facade unseen, its ten windows inferred: the unseen half is like the seen one.
    errors = replace(NONE, part_sd=0.09)
    both = wwr_interval(row(10), [], 100.0, 0.5, errors, beyond=row(10, 0.8))
    assert both == pytest.approx((0.2 - 0.045 * NORMAL_90, 0.2 + 0.045 * NORMAL_90))
    # The ratio that the facade will state is always inside.
    assert wwr_interval([], [], 100.0, 0.5, NONE, beyond=row(10, 0.8)) == pytest.approx((0, 0.1))


def test_less_seen_is_less_known():
    widths, uppers = [], []
    for share in (1.0, 0.9, 0.7, 0.5, 0.3):
        low, high = wwr_interval(row(10, 0.9), [], 100.0, share, SOME)
        widths.append(high - low)
        uppers.append(high)
    assert widths == sorted(widths)
    assert uppers == sorted(uppers)
    assert wwr_interval([], [], 100.0, 0.0, SOME) == (0.0, 1.0)


def test_the_part_that_nobody_saw_is_like_the_rest():
    # 8 m2 in the 80 m2 that were seen is 10 % of them; the unseen fifth is off by 0.09 / 5.
    errors = replace(NONE, part_sd=0.09)
    interval = wwr_interval(row(8), [], 100.0, 0.8, errors)
    assert interval == pytest.approx((0.1 - 0.018 * NORMAL_90, 0.1 + 0.018 * NORMAL_90))
    # Where the unseen part is surely like the rest, the ratio of what was found is the lower end.
    assert wwr_interval(row(8), [], 100.0, 0.8, NONE) == pytest.approx((0.08, 0.1))


@settings(deadline=None)
@given(
    scores=st.lists(st.floats(0.0, 1.0), max_size=12),
    doubtful=st.lists(st.floats(0.0, 1.0), max_size=12),
    share=st.floats(0.0, 1.0),
    area_m2=st.floats(13.0, 500.0),
)
def test_the_interval_holds_the_ratio_and_stays_within_0_and_1(scores, doubtful, share, area_m2):
    windows = [box(2.0 * k, score) for k, score in enumerate(scores)]
    others = [box(2.0 * k + 100, score) for k, score in enumerate(doubtful)]
    low, high = wwr_interval(windows, others, area_m2, share, SOME)
    assert 0 <= low <= len(windows) / area_m2 <= high <= 1


@pytest.mark.parametrize("score", [0.6, 0.95])
def test_nine_of_ten_facades_drawn_from_the_model_are_covered(score):
    rng = np.random.default_rng(5)
    count, wall_m2, sigma_m, runs = 30, 150.0, 0.05, 4000
    errors = replace(SOME, correlation=0.09)
    windows = row(count, score, (sigma_m, sigma_m, sigma_m, sigma_m))
    interval = wwr_interval(windows, [], wall_m2, 0.8, errors)
    # Each window follows a draw of the facade with probability 0.3: correlation 0.3^2.
    shared = np.where(
        rng.random((runs, count)) < 0.3, rng.random((runs, 1)), rng.random((runs, count))
    )
    sides = 1 + sigma_m * 2**0.5 * rng.standard_normal((2, runs, count))
    area_m2 = ((shared < score) * sides[0] * sides[1]).sum(axis=1)
    area_m2 *= 1 + errors.common_sd * rng.standard_normal(runs)
    ratio = area_m2 / (0.8 * wall_m2)
    ratio += errors.missed_mean + errors.missed_sd * rng.standard_normal(runs)
    ratio += 0.2 * errors.part_sd * rng.standard_normal(runs)
    # The shared draws make steps, not a normal distribution.
    assert ((interval[0] <= ratio) & (ratio <= interval[1])).mean() == pytest.approx(0.9, abs=0.03)


@pytest.mark.parametrize(("area_m2", "share"), [(0.0, 1.0), (float("nan"), 1.0), (10.0, 1.2)])
def test_impossible_facades_are_refused(area_m2, share):
    with pytest.raises(InputError, match="positive facade area"):
        wwr_interval([], [], area_m2, share, SOME)


def test_several_facades_err_alike():
    def facade(width_m, interval):
        pose = Rigid3(np.eye(3), np.zeros(3))
        return Facade("house-0", pose, width_m, 5.0, wwr_interval=interval)

    both = joint_interval([facade(30.0, (0.1, 0.2)), facade(10.0, (0.3, 0.4))])
    assert both == pytest.approx((0.15, 0.25))
    assert joint_interval([facade(30.0, (0.1, 0.2)), facade(10.0, None)]) is None
    assert joint_interval([]) is None


class KnownDetector:
    """Finds four windows of 25 x 40 px, and one that is doubtful, on every image."""

    def __init__(self, wwr_errors):
        self.thresholds = {"window": 0.5, "balcony": 0.5}
        self.wwr_errors = wwr_errors

    def detect(self, image, m_per_px):
        boxes = np.array([[30 + 60 * k, 60, 55 + 60 * k, 100] for k in range(5)], float)
        scores = np.array([0.95, 0.95, 0.95, 0.95, 0.3])
        return Detections(boxes, scores, np.full(5, "window"), np.full((5, 4), 0.5))


def parsed(wwr_errors, valid):
    grid = FacadeGrid(Rigid3(np.eye(3), np.zeros(3)), valid.shape[1], valid.shape[0], 0.04)
    view = OrthoImage("a", np.full((*valid.shape, 3), 128, np.uint8), valid)
    return parse_facade(
        FacadeViews("house-0", grid, (view,)),
        view,
        {"a": np.array([6.0, 2.0, 10.0])},
        KnownDetector(wwr_errors),
        FusionConfig(),
        MeasureConfig(refine=False, correct_recess=False),
    )


def test_a_facade_carries_the_interval_of_its_detector():
    valid = np.ones((200, 340), bool)
    facade = parsed(SOME, valid)
    ratio = sum(window.area_m2 for window in facade.windows) / (340 * 200 * 0.04**2)
    assert len(facade.windows) == 4
    low, high = facade.wwr_interval
    # Four of 0.95 and one of 0.3 make 4.1 windows, and 1 % of the wall are missed.
    assert (low + high) / 2 == pytest.approx(ratio / 4 * 4.1 + 0.01, rel=0.02)
    assert low < ratio < high
    valid[:, 310:] = False
    less_seen = parsed(SOME, valid)
    assert less_seen.wwr_interval[1] > high
    assert parsed(None, valid).wwr_interval is None
