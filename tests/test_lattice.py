"""Empty places of a lattice: hidden ones are filled, blank walls that were seen never."""

import numpy as np
import pytest
from tests.test_regular import CONFIG, GRID, SEEN, hide, lattice, window

from si3fp.config import MeasureConfig
from si3fp.windows.lattice import complete_windows
from si3fp.windows.regular import edges_of

NOTHING = np.zeros((0, 4))


def completed(windows, seen=SEEN, weak=(), doors=NOTHING, config=CONFIG):
    return complete_windows(windows, weak, doors, seen, GRID, 0.4, config)


def around(box, margin=0.3):
    return edges_of([box])[0] + [-margin, margin, -margin, margin]


def without(index):
    windows = lattice()
    return windows.pop(index), windows


def test_a_hidden_place_is_inferred_with_its_evidence():
    gone, windows = without(7)
    result = completed(windows, hide(around(gone)))
    (added,) = (w for w in result if w.origin == "inferred")
    assert len(result) == 15
    assert edges_of([added])[0] == pytest.approx(edges_of([gone])[0])
    assert added.score == pytest.approx(0.9)
    assert added.views == ()
    assert "4 of 4 places of its row and 2 of 2 of its column are windows" in added.evidence
    assert "0% of the place was seen" in added.evidence
    assert [(w.y_m, w.x_m) for w in result] == [
        (w.y_m, w.x_m) for w in sorted(result, key=lambda w: (-round(w.y_m, 1), w.x_m))
    ]


@pytest.mark.parametrize("index", range(15))
def test_a_blank_wall_that_was_seen_stays_blank(index):
    windows = without(index)[1]
    assert len(completed(windows)) == 14


def test_half_a_place_seen_blank_is_worth_less_than_none_seen():
    gone, windows = without(7)
    left, right, bottom, top = around(gone)
    half = hide((left, (left + right) / 2, bottom, top))
    most = hide((left, left + 0.8 * (right - left), bottom, top))
    scores = [
        [w.score for w in completed(windows, s) if w.origin == "inferred"] for s in (half, most)
    ]
    assert scores[0] < scores[1]
    assert scores[1][0] < 0.9


def test_it_can_be_switched_off():
    gone, windows = without(7)
    off = MeasureConfig(infer=False)
    assert len(completed(windows, hide(around(gone)), config=off)) == 14


def test_a_weak_detection_that_fits_is_raised_and_stays_detected():
    gone, windows = without(7)
    weak = window(gone.x_m + 0.05, gone.y_m, score=0.3)
    result = completed(windows, weak=[weak])
    (added,) = (w for w in result if "raised" in w.evidence)
    assert added.origin == "detected"
    # Odds 9 of the lattice times odds 3/7 of the detector.
    assert added.score == pytest.approx(27 / 34)
    assert added.x_m == weak.x_m
    off = MeasureConfig(infer=False)
    assert len(completed(windows, weak=[weak], config=off)) == 15


def test_a_hint_of_a_detection_is_not_raised_and_one_that_fits_nothing_neither():
    gone, windows = without(7)
    hint = window(gone.x_m, gone.y_m, score=0.1)
    astray = window(gone.x_m + 1.7, gone.y_m + 1.6, score=0.35)
    assert len(completed(windows, weak=[hint, astray])) == 14


def test_isolated_windows_are_neither_changed_nor_removed():
    alone = window(18.5, 10.2, 0.8, 1.0, score=0.5)
    windows = [*lattice(columns=4), alone]
    assert alone in completed(windows)


def test_no_window_where_a_door_was_found_or_in_the_lowest_row_on_weak_grounds():
    gone, windows = without(2)
    door = edges_of([window(gone.x_m, 0.0, 1.4, 2.4)])
    assert len(completed(windows, hide(around(gone)), doors=door)) == 14
    # An entrance may be there.
    assert len(completed(windows, weak=[window(gone.x_m, gone.y_m, score=0.39)])) == 14
    (added,) = (w for w in completed(windows, hide(around(gone))) if w.origin == "inferred")
    assert added.score == pytest.approx(0.75)


def test_rows_with_gaps_of_their_own_do_not_ask_for_more():
    windows = [w for i, w in enumerate(lattice()) if i not in (5, 6, 7, 9)]
    gone = lattice()[7]
    assert len(completed(windows, hide(around(gone)))) == 11


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_windows_show_no_lattice(count):
    windows = tuple(lattice()[:count])
    assert completed(windows, np.zeros_like(SEEN)) == windows


def test_order_and_place_on_the_facade_do_not_matter():
    rng = np.random.default_rng(5)
    gone, windows = without(7)
    seen = hide(around(gone))
    plain = completed(windows, seen)
    assert completed([windows[i] for i in rng.permutation(14)], seen) == plain


def test_where_a_place_is_hidden_a_hint_says_no_less_than_silence():
    gone, windows = without(7)
    hint = window(gone.x_m, gone.y_m, score=0.1)
    (added,) = (w for w in completed(windows, hide(around(gone)), [hint]) if w.origin == "inferred")
    assert added.score == pytest.approx(0.9)
    assert len(completed(windows, weak=[hint])) == 14
