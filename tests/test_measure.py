"""Boxes become metres; the recess correction against a ray-traced opening."""

import numpy as np
import pytest

from si3fp.config import MeasureConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Detections
from si3fp.windows.fuse import FusedDetections
from si3fp.windows.measure import edges_from_box, measure_windows, recess_lever

GRID = FacadeGrid(Rigid3(np.eye(3), np.zeros(3)), 1000, 500, 0.02)
NO_BALCONY = Detections(np.zeros((0, 4)), np.zeros(0), np.zeros(0, str))


def one(box, views=("a",), score=0.8, sigma=0.5):
    found = Detections([box], [score], ["window"], np.full((1, 4), sigma))
    return FusedDetections(found, (views,))


def test_pixels_to_metres_from_the_lower_left_corner():
    plain = MeasureConfig(correct_recess=False)
    (window,) = measure_windows(one([100, 50, 160, 150]), NO_BALCONY, GRID, {}, plain)
    assert (window.x_m, window.y_m) == pytest.approx((2.0, 7.0))
    assert (window.width_m, window.height_m) == pytest.approx((1.2, 2.0))
    assert window.correction_m == (0, 0, 0, 0)


def apparent_edges(true, recess_m, camera):
    """Edges (left, right, bottom, top) on the wall plane of glass seen through its opening.

    The opening in the wall plane is as large as the glass; of every line of sight through the
    opening's edge, the nearer limit is what shows.
    """
    left, right, bottom, top = true
    x, y, z = camera

    def on_wall(value, eye):
        return value + (eye - value) * recess_m / (z + recess_m)

    return (
        max(left, on_wall(left, x)), min(right, on_wall(right, x)),
        max(bottom, on_wall(bottom, y)), min(top, on_wall(top, y)),
    )  # fmt: skip


@pytest.mark.parametrize(
    "camera", [(3.0, 1.6, 9.0), (3.0, 6.0, 9.0), (3.0, 15.0, 9.0), (-4.0, 1.6, 6.0), (12.0, 2, 7)]
)
def test_correction_restores_a_recessed_window_from_below_level_and_above(camera):
    true, recess_m = (2.0, 3.2, 5.0, 6.8), 0.12
    left, right, bottom, top = apparent_edges(true, recess_m, camera)
    box = [left / 0.02, 500 - top / 0.02, right / 0.02, 500 - bottom / 0.02]
    config = MeasureConfig(assumed_recess_m=recess_m)
    (window,) = measure_windows(one(box), NO_BALCONY, GRID, {"a": np.array(camera)}, config)
    got = (
        window.x_m, window.x_m + window.width_m, window.y_m, window.y_m + window.height_m,
    )  # fmt: skip
    # The lever is taken at the apparent edge, which is second order in the recess.
    assert got == pytest.approx(true, abs=0.004)


def test_seen_from_below_only_the_top_moves():
    lever = recess_lever(np.array([2.0, 3.0, 5.0, 6.5]), [np.array([2.5, 1.5, 10.0])])
    assert lever == pytest.approx([0.05, 0.05, 0.0, 0.5])


def test_views_from_both_sides_share_the_correction_of_the_jambs():
    cameras = [np.array([-5.0, 1.5, 10.0]), np.array([10.0, 1.5, 10.0])]
    lever = recess_lever(np.array([2.0, 3.0, 5.0, 6.5]), cameras)
    assert lever[:2] == pytest.approx([0.5 * 0.8, 0.5 * 0.8])


def test_the_uncertain_recess_widens_the_edges_that_it_moves():
    (window,) = measure_windows(
        one([100, 50, 160, 150]),
        NO_BALCONY,
        GRID,
        {"a": np.array([2.6, 1.5, 8.0])},
        MeasureConfig(),
    )
    left, _, bottom, top = window.edge_sigma_m
    assert bottom == pytest.approx(0.01)
    assert top > left > bottom


def test_windows_stay_on_the_facade():
    camera = {"a": np.array([10.0, -20.0, 5.0])}
    (window,) = measure_windows(one([0, 0, 60, 90]), NO_BALCONY, GRID, camera, MeasureConfig())
    assert window.y_m + window.height_m <= GRID.height_m + 1e-9
    assert window.x_m >= 0


def test_vents_are_no_windows():
    assert measure_windows(one([0, 0, 10, 100]), NO_BALCONY, GRID, {}, MeasureConfig()) == ()


def test_a_tall_opening_behind_a_balcony_is_a_balcony_door():
    balcony = Detections(np.array([[80.0, 130, 200, 170]]), np.array([0.9]), np.array(["balcony"]))
    plain = MeasureConfig(correct_recess=False)
    (door,) = measure_windows(one([100, 50, 150, 155]), balcony, GRID, {}, plain)
    (window,) = measure_windows(one([300, 50, 350, 155]), balcony, GRID, {}, plain)
    (small,) = measure_windows(one([100, 80, 150, 155]), balcony, GRID, {}, plain)
    assert [door.label, window.label, small.label] == ["balcony_door", "window", "window"]


def test_edges_from_box_by_hand():
    assert edges_from_box(np.array([0.0, 400, 50, 500]), GRID) == pytest.approx([0, 1, 0, 2])


def test_a_side_that_the_network_does_not_know_gets_the_assumed_uncertainty():
    plain = MeasureConfig(correct_recess=False, recess_sigma_m=0.0)
    (told,) = measure_windows(one([100, 50, 160, 150], sigma=3), NO_BALCONY, GRID, {}, plain)
    (untold,) = measure_windows(one([100, 50, 160, 150], sigma=0), NO_BALCONY, GRID, {}, plain)
    assert told.edge_sigma_m == pytest.approx((0.06,) * 4)
    assert untold.edge_sigma_m == pytest.approx((plain.box_sigma_m,) * 4)


def test_notes_become_evidence():
    box = one([100, 50, 160, 150])
    noted = FusedDetections(box.detections, box.views, ("lights joined",))
    (window,) = measure_windows(noted, NO_BALCONY, GRID, {}, MeasureConfig())
    assert "; lights joined; " in window.evidence
