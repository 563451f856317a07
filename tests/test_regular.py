"""Windows on painted lattices: rows and columns draw noisy sides, and complete what was hidden."""

from dataclasses import replace

import numpy as np
import pytest

from si3fp.config import MeasureConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Window
from si3fp.windows.regular import correct_windows, edges_of

GRID = FacadeGrid(Rigid3(np.eye(3), np.zeros(3)), 1000, 600, 0.02)
SEEN = np.ones((600, 1000), np.float32)
CONFIG = MeasureConfig()
SIGMA = 0.04
SHIFT = np.array([0.7, 0.7, 0.4, 0.4])


def window(left, bottom, width=1.2, height=1.5, sigma=SIGMA, **more):
    return Window(left, bottom, width, height, edge_sigma_m=(sigma,) * 4, **more)


def lattice(rows=3, columns=5):
    return [window(1 + 3.5 * c, 1.2 + 3.4 * r) for r in range(rows) for c in range(columns)]


def with_edges(windows, edges):
    return [
        replace(w, x_m=e[0], width_m=e[1] - e[0], y_m=e[2], height_m=e[3] - e[2])
        for w, e in zip(windows, edges, strict=True)
    ]


def corrected(windows, seen=SEEN):
    return correct_windows(windows, seen, GRID, CONFIG)


def hide(*boxes_m):
    """The map of what was seen with rectangles left, right, bottom, top taken out."""
    seen = SEEN.copy()
    for left, right, bottom, top in boxes_m:
        (x0, y0), (x1, y1) = GRID.pixels_from_facade([[left, top], [right, bottom]]).astype(int)
        seen[y0:y1, x0:x1] = 0
    return seen


def test_noise_shrinks_as_the_average_over_row_and_column():
    rng = np.random.default_rng(2)
    truth = lattice()
    before, after, claimed = [], [], []
    for _ in range(20):
        noisy = edges_of(truth) + rng.normal(0, SIGMA, (15, 4))
        result = corrected(with_edges(truth, noisy))
        before.append(noisy - edges_of(truth))
        after.append(edges_of(result) - edges_of(truth))
        claimed.append([w.edge_sigma_m for w in result])
    across, up = (np.concatenate(after)[:, part].std() for part in (slice(0, 2), slice(2, 4)))
    assert np.std(before) == pytest.approx(SIGMA, rel=0.1)
    # Of 3 in a column and 5 in a row; the sizes of the others help, the assumed spread costs.
    assert across < SIGMA * np.sqrt(1 / 3) * 1.1
    assert up < SIGMA * np.sqrt(1 / 5) * 1.2
    assert np.std(after) == pytest.approx(np.mean(claimed), rel=0.25)


def test_perfect_windows_stay():
    windows = lattice()
    assert edges_of(corrected(windows)) == pytest.approx(edges_of(windows), abs=1e-9)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_windows_are_left_alone(count):
    windows = tuple(lattice()[:count])
    assert corrected(windows, hide((0, 20, 0, 12))) == windows


def test_a_stairwell_window_half_a_storey_off_is_unaffected():
    stairs = window(16.3, 2.9, 0.8, 1.1)
    result = corrected([*lattice(columns=4), stairs])[-1]
    assert edges_of([result])[0] == pytest.approx(edges_of([stairs])[0], abs=0.002)
    assert result.edge_sigma_m == pytest.approx(stairs.edge_sigma_m, rel=0.02)


def test_a_taller_window_keeps_its_sill_and_shares_only_its_top():
    tall = window(1, 0.8, 1.2, 1.9)
    others = [window(1 + 3.5 * c, 1.2 + 0.03 * (-1) ** c) for c in range(1, 5)]
    result = corrected([tall, *others])[0]
    assert result.y_m == pytest.approx(0.8, abs=0.005)


def test_order_and_place_on_the_facade_do_not_matter():
    rng = np.random.default_rng(4)
    windows = with_edges(lattice(), edges_of(lattice()) + rng.normal(0, SIGMA, (15, 4)))
    order = rng.permutation(15)
    plain = edges_of(corrected(windows))
    mixed = edges_of(corrected([windows[i] for i in order]))
    assert mixed == pytest.approx(plain[order])
    moved = corrected(with_edges(windows, edges_of(windows) + SHIFT))
    assert edges_of(moved) == pytest.approx(plain + SHIFT)


def test_the_error_of_the_assumed_recess_does_not_average_out():
    common = 0.05
    shifted = [
        replace(w, correction_m=(0.0, 0.0, 0.0, 0.1), edge_sigma_m=(0.04, 0.04, 0.04, 0.064))
        for w in lattice()
    ]
    for result in corrected(shifted):
        assert result.edge_sigma_m[3] > common
        assert result.edge_sigma_m[2] < 0.04


@pytest.mark.parametrize("side", range(4))
def test_a_window_cut_by_what_hides_it_is_completed(side):
    windows = lattice()
    full = edges_of(windows)[7]
    cut, blind = full.copy(), full + np.array([-0.1, 0.1, -0.1, 0.1])
    middle = full[2 * (side // 2) : 2 * (side // 2) + 2].mean()
    cut[side] = middle
    blind[[1, 0, 3, 2][side]] = middle
    windows[7] = with_edges([windows[7]], [cut])[0]
    result = corrected(windows, hide(blind))[7]
    assert edges_of([result])[0] == pytest.approx(full, abs=0.03)
    assert result.origin == "detected"
    assert "hidden, completed to the size of" in result.evidence
    assert result.edge_sigma_m[side] > SIGMA


def test_a_small_window_in_full_view_is_not_completed():
    windows = lattice()
    windows[7] = window(windows[7].x_m, windows[7].y_m + 0.75, height=0.75)
    result = corrected(windows)[7]
    assert result.height_m == pytest.approx(0.75, abs=0.01)


def test_without_agreement_on_the_size_nothing_is_completed():
    windows = [window(1 + 3.5 * c, 1.2, height=0.9 + 0.4 * c) for c in range(5)]
    windows[2] = window(8.0, 2.2, height=0.7)
    result = corrected(windows, hide((7.5, 9.7, 0.5, 2.2)))[2]
    assert result.y_m == pytest.approx(2.2, abs=0.02)


def test_a_window_does_not_go_on_into_another():
    windows = lattice()
    cut = replace(windows[7], width_m=0.7)
    _, right, bottom, top = edges_of([cut])[0]
    seen = hide((right, right + 1.0, bottom - 0.2, top + 0.2))
    alone = [*windows[:7], cut, *windows[8:]]
    assert corrected(alone, seen)[7].width_m == pytest.approx(1.2, abs=0.05)
    beside = window(right + 0.1, bottom, 0.6, 1.5)
    assert corrected([*alone, beside], seen)[7].width_m == pytest.approx(0.7, abs=0.1)


def test_the_height_of_doors_does_not_complete_a_window():
    doors = [window(1 + 2 * c, 0.5, 0.9, 2.2, label="balcony_door") for c in range(4)]
    plain = window(12.0, 1.4, 1.2, 1.3)
    seen = hide((11.5, 13.8, 0.0, 1.3))
    result = corrected([*doors, plain], seen)
    assert result[-1].y_m == pytest.approx(1.4, abs=0.02)
    tall = corrected([*(replace(door, label="window") for door in doors), plain], seen)
    assert tall[-1].y_m == pytest.approx(0.5, abs=0.02)


def test_the_width_of_windows_does_not_complete_a_door():
    plain = [window(1 + 2 * c, 1.4, 1.4, 1.2) for c in range(4)]
    door = window(12.0, 0.4, 0.9, 2.2, label="balcony_door")
    seen = hide((12.9, 14.0, 0.0, 3.0))
    assert corrected([*plain, door], seen)[-1].width_m == pytest.approx(0.9, abs=0.02)
    narrow = corrected([*plain, replace(door, label="window")], seen)[-1]
    assert narrow.width_m == pytest.approx(1.4, abs=0.03)
