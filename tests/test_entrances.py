"""Doors at the ground are left out; windows and terrace doors at the ground stay."""

import pytest

from si3fp.config import MeasureConfig
from si3fp.model import Window
from si3fp.windows.entrances import without_entrances

ROW = [Window(1.0 + 3 * k, 1.4, 1.4, 1.4) for k in range(4)]  # sills 1.4 m, heads 2.8 m
CONFIG = MeasureConfig()


def left(*openings, row=ROW, storey=None):
    openings = [*openings, *row] if storey is None else list(openings)
    kept, _ = without_entrances(openings, storey or openings, CONFIG)
    return [window for window in kept if window not in row]


@pytest.mark.parametrize("foot_m", [0.0, 0.45, 0.8], ids=["bare", "hedge", "high hedge"])
def test_an_entrance_is_no_window_however_much_of_its_foot_is_hidden(foot_m):
    door = Window(13.5, foot_m, 1.5, 2.2 - foot_m)
    kept, gone = without_entrances([door, *ROW], [door, *ROW], CONFIG)
    assert kept == tuple(ROW)
    assert gone.tolist() == [pytest.approx([13.5, 15.0, foot_m, 2.2])]


def test_two_entrances_do_not_speak_for_one_another():
    assert left(Window(13.5, 0.45, 1.5, 1.75), Window(16.0, 0.45, 1.5, 1.75)) == []


def test_weak_openings_are_measured_by_the_sure_windows_of_their_storey():
    assert left(Window(13.5, 0.6, 1.5, 1.6), storey=ROW) == []


@pytest.mark.parametrize(
    "window",
    [
        Window(13.5, 0.2, 1.0, 0.5),  # lights a basement
        Window(13.5, 1.2, 1.4, 1.6),  # a little lower sill
        Window(13.5, 0.9, 1.4, 3.4),  # lights a staircase
        Window(13.5, 3.6, 1.4, 1.4),  # stands on the storey above
        Window(13.5, 0.7, 0.9, 2.1, label="balcony_door"),  # of a balcony
    ],
    ids=["basement", "sill", "staircase", "upper", "balcony"],
)
def test_what_is_no_entrance_stays(window):
    assert left(window) == [window]


def test_a_row_of_shop_windows_stays():
    shop = [Window(1.0 + 3 * k, 0.5, 2.4, 2.1) for k in range(4)]
    assert left(*shop[:1], row=shop[1:]) == shop[:1]


def test_without_a_row_only_what_stands_on_the_ground_goes():
    low, hidden = Window(1.0, 0.1, 1.5, 2.1), Window(4.0, 0.6, 1.5, 1.6)
    assert left(low, hidden, row=[]) == [hidden]


@pytest.mark.parametrize("gap_m", [0.1, 0.3])
def test_a_terrace_door_beside_a_window_with_its_head_is_one(gap_m):
    (door,) = left(Window(2.4 + gap_m, 0.1, 0.9, 2.7))
    assert door.label == "balcony_door"
    assert "no entrance" in door.evidence


@pytest.mark.parametrize(
    "door",
    [Window(2.6, 0.1, 0.9, 2.1), Window(12.0, 0.1, 0.9, 2.7), Window(2.6, 0.1, 1.3, 2.7)],
    ids=["lower head", "apart", "wide"],
)
def test_a_door_near_a_window_is_an_entrance_if_head_gap_or_width_are_others(door):
    assert left(door) == []
