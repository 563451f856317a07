"""Windows from one render with depth, against a wall whose every line of sight is computed."""

from dataclasses import replace

import numpy as np
import pytest
from tests.scenes.recessed import WALL, ToldDetector, rendered

from si3fp.config import FusionConfig, MeasureConfig
from si3fp.errors import InputError
from si3fp.model import OrthoImage
from si3fp.windows.bias import hidden_lever
from si3fp.windows.parse_rendered import parse_rendered, without_specks
from si3fp.windows.recess_estimate import RecessEstimate, score_by_depth

WINDOW = (3.4, 4.6, 2.5, 4.0)
BELOW = {"a": (2.0, 1.0, 4.0), "b": (4.0, 1.0, 4.0), "c": (6.0, 1.0, 4.0)}
LEVEL = {"a": (2.0, 3.2, 4.0), "b": (4.0, 3.2, 4.0), "c": (6.0, 3.3, 4.0)}
ABOVE = {"a": (2.0, 7.0, 4.0), "b": (4.0, 7.0, 4.0), "c": (6.0, 7.0, 4.0)}
LEFT = {"a": (0.0, 3.2, 4.0), "b": (0.4, 3.2, 4.0), "c": (-1.0, 3.2, 4.0)}
RIGHT = {"a": (8.0, 3.2, 4.0), "b": (7.6, 3.2, 4.0), "c": (9.0, 3.2, 4.0)}
BELOW_LEFT = {"a": (0.0, 0.5, 4.0), "b": (0.4, 1.0, 4.0), "c": (-1.0, 0.5, 4.0)}
EXACT = MeasureConfig(refine=False)


def arrays(cameras):
    return {name: np.array(camera) for name, camera in cameras.items()}


def parsed(render, detector=None, measure=EXACT, fusion=None):
    return parse_rendered(
        render.ortho,
        render.cameras,
        render.seen_from,
        detector or ToldDetector(render.shown_px),
        fusion or FusionConfig(),
        measure,
        render.grid,
    )


def edges(window):
    return (window.x_m, window.x_m + window.width_m, window.y_m, window.y_m + window.height_m)


@pytest.mark.parametrize(
    ("cameras", "moved"),
    [
        (BELOW, ["bottom"]),
        (LEVEL, []),
        (ABOVE, ["top"]),
        (LEFT, ["left"]),
        (RIGHT, ["right"]),
        (BELOW_LEFT, ["left", "bottom"]),
    ],
    ids=["below", "level", "above", "left", "right", "below left"],
)
@pytest.mark.parametrize("recess_m", [0.1, 0.25])
def test_the_edges_that_no_camera_saw_are_put_back(cameras, moved, recess_m):
    render = rendered([WINDOW], recess_m, arrays(cameras))
    (window,) = parsed(render).windows
    # The render has pixels of 0.01 m.
    assert edges(window) == pytest.approx(WINDOW, abs=0.012)
    assert window.recess_m == pytest.approx(recess_m, abs=0.005)
    sides = ["left", "right", "bottom", "top"]
    told = [side for side, by in zip(sides, window.correction_m, strict=True) if abs(by) > 0.005]
    assert told == moved
    outwards = np.array(window.correction_m) * [-1, 1, -1, 1]
    assert (outwards >= 0).all()


def test_the_correction_is_the_recess_times_the_tangent_of_the_smallest_elevation():
    cameras = arrays({"low": (4.0, 0.5, 4.0), "near": (4.0, 1.0, 3.0), "far": (4.0, 1.0, 6.0)})
    (window,) = parsed(rendered([WINDOW], 0.2, cameras)).windows
    # A pixel is shown if two photos saw it, so the second smallest counts: 1.5 / 3 from "near" and
    # 2.0 / 4 from "low" are alike, "far" with 1.5 / 6 is alone.
    assert window.correction_m[2] == pytest.approx(-0.2 * 0.5, abs=0.012)


def test_jambs_stay_where_cameras_look_from_both_sides():
    cameras = arrays({"a": (0.0, 3.2, 4.0), "b": (0.5, 3.2, 4.0),
                      "c": (7.5, 3.2, 4.0), "d": (8.0, 3.2, 4.0)})  # fmt: skip
    render = rendered([WINDOW], 0.25, cameras)
    (window,) = parsed(render).windows
    assert edges(window) == pytest.approx(WINDOW, abs=0.012)
    assert window.correction_m == pytest.approx((0, 0, 0, 0), abs=1e-9)


def test_only_photos_that_see_the_window_count():
    cameras = arrays(BELOW) | arrays({f"up{i}": (4.0, 3.2, 4.0 + i) for i in range(2)})
    render = rendered([WINDOW], 0.25, cameras)
    assert parsed(render).windows[0].correction_m[2] == pytest.approx(0, abs=1e-9)
    blind = np.zeros_like(render.seen_from["a"])
    hidden = rendered([WINDOW], 0.25, arrays(BELOW))
    hidden.cameras |= render.cameras
    hidden.seen_from |= {"up0": blind, "up1": blind}
    (window,) = parsed(hidden).windows
    assert window.views == ("a", "b", "c")
    assert edges(window) == pytest.approx(WINDOW, abs=0.012)


@pytest.mark.parametrize("lattice", [1, 5, 10])
def test_views_are_the_photos_that_see_half_of_a_window_on_a_lattice_of_any_step(lattice):
    render = rendered([WINDOW], 0.2, arrays(BELOW), lattice=lattice)
    for name, last in (("a", 0.35), ("b", 0.65)):
        seen = render.seen_from[name].copy()
        rows = seen.shape[0]
        middle = 1 - (2.5 + 1.5 * last) / 6.0
        seen[int(middle * rows) :] = False  # what lies below is hidden
        render.seen_from[name] = seen
    (window,) = parsed(render).windows
    assert window.views == ("a", "c")


def test_where_the_render_goes_on_with_the_glass_the_edge_is_right_already():
    render = rendered([WINDOW], 0.25, arrays(BELOW), hidden="glass")
    (window,) = parsed(render).windows
    assert edges(window) == pytest.approx(WINDOW, abs=0.012)
    assert window.correction_m[2] == 0


def test_a_strip_that_the_render_fills_with_a_slope_is_put_back_as_photos_did_not_see_it():
    render = rendered([WINDOW], 0.25, arrays(BELOW), hidden="slope")
    (window,) = parsed(render).windows
    assert edges(window) == pytest.approx(WINDOW, abs=0.015)
    # Without the count of photos only what lies deep enough speaks for the opening.
    render.ortho = replace(render.ortho, seen_by=None)
    (window,) = parsed(render).windows
    assert 0.02 < window.y_m - WINDOW[2] <= 0.5 * 0.25 * 1.5 / 4.0 + 0.012


def test_the_correction_can_be_switched_off():
    render = rendered([WINDOW], 0.25, arrays(BELOW))
    off = MeasureConfig(refine=False, correct_recess=False)
    (window,) = parsed(render, measure=off).windows
    strip_m = 0.25 * 1.5 / 4.0
    assert window.correction_m == (0, 0, 0, 0)
    assert window.y_m == pytest.approx(WINDOW[2] + strip_m, abs=0.012)
    assert window.recess_m == pytest.approx(0.25, abs=0.005)
    assert "not corrected" in window.evidence


def test_a_corrected_edge_is_less_certain_than_one_that_shows():
    (below,) = parsed(rendered([WINDOW], 0.25, arrays(BELOW))).windows
    (level,) = parsed(rendered([WINDOW], 0.25, arrays(LEVEL))).windows
    assert below.edge_sigma_m[2] > level.edge_sigma_m[2]
    assert below.edge_sigma_m[3] == pytest.approx(level.edge_sigma_m[3])


def test_without_a_measured_recess_the_assumed_one_is_corrected():
    render = rendered([WINDOW], 0.12, arrays(BELOW))
    assumed = MeasureConfig(refine=False, measure_recess=False)
    (window,) = parsed(render, measure=assumed).windows
    assert window.recess_m is None
    assert "assumed recess of 0.12 m corrected" in window.evidence
    assert edges(window) == pytest.approx(WINDOW, abs=0.012)
    # 0.06 m of the recess are unknown, times the tangent of 1.5 m over 4 m.
    assert window.edge_sigma_m[2] == pytest.approx(0.06 * 1.5 / 4.12, rel=0.15)


def test_a_wall_off_the_facade_plane_is_still_the_wall():
    render = rendered([WINDOW], 0.2, arrays(BELOW), wall_m=-0.12, noise_m=0.02)
    (window,) = parsed(render).windows
    assert window.recess_m == pytest.approx(0.2, abs=0.01)
    assert edges(window) == pytest.approx(WINDOW, abs=0.015)


def test_a_hedge_in_front_hides_no_more_than_the_sill_could():
    render = rendered([WINDOW], 0.2, arrays(LEVEL))
    valid = render.ortho.valid.copy()
    valid[-270:] = False  # everything below 2.7 m, which is within the window
    render.ortho = OrthoImage("radiance", render.ortho.rgb, valid, render.ortho.depth_m)
    (window,) = parsed(render).windows
    assert window.correction_m[2] == pytest.approx(0, abs=1e-9)


ROW = [(0.6 + 1.6 * k, 1.5 + 1.6 * k, 3.0, 4.4) for k in range(4)]


def test_scores_below_the_filter_tell_nothing_and_those_above_may_be_raised():
    cameras = arrays({"a": (2.0, 3.7, 6.0), "b": (4.0, 3.7, 6.0), "c": (6.0, 3.7, 6.0)})
    rows = [(*w[:2], w[2] - 2.2, w[3] - 2.2) for w in ROW] + ROW
    render = rendered(rows, 0.1, cameras)

    def found(score, **fusion):
        scores = [0.95] * 6 + [score, 0.95]
        detector = ToldDetector(render.shown_px, scores)
        return parsed(render, detector, fusion=FusionConfig(**fusion)).windows

    assert len(found(0.5)) == 8
    raised = found(0.35)
    assert len(raised) == 8
    assert any("raised" in window.evidence for window in raised)
    assert len(found(0.1)) == 7
    assert len(found(0.1, min_score=0.05)) >= 7
    # One image is searched, so nothing has to be found in two.
    assert len(found(0.5, min_views=5)) == 8


def test_a_box_on_what_stands_in_front_of_the_wall_is_no_window():
    front = (1.0, 3.0, 1.0, 2.2)
    render = rendered([WINDOW], 0.2, arrays(LEVEL), balconies=[front])
    on_front = [140, 400, 260, 490]
    detector = ToldDetector([*render.shown_px, on_front], [0.9, 0.8])
    result = parsed(render, detector)
    assert len(result.windows) == 1
    (note,) = result.notes
    assert "left out" in note
    assert "in front of the wall" in note


def test_a_door_behind_a_balcony_is_labelled_by_the_depth():
    door, front = (3.4, 4.4, 2.0, 4.2), (2.6, 5.2, 1.8, 2.9)
    cameras = arrays({"a": (2.0, 3.6, 6.0), "b": (4.0, 3.6, 6.0)})
    render = rendered([door, (6.2, 7.2, 2.9, 4.2)], 0.15, cameras, balconies=[front])
    detector = ToldDetector([[340, 180, 440, 395], [620, 180, 720, 310]])
    result = parsed(render, detector)
    assert [window.label for window in result.windows] == ["window", "balcony_door"]
    balconies = result.on_fused.select(result.on_fused.labels == "balcony")
    assert balconies.boxes_px == pytest.approx(np.array([[260, 310, 520, 420]]), abs=1)
    assert "1.2 m in front of the wall" in result.notes[0]


def test_balconies_by_depth_and_of_the_detector_are_one():
    door, front = (3.4, 4.4, 2.0, 4.2), (2.6, 5.2, 1.8, 2.9)
    cameras = arrays({"a": (2.0, 3.6, 6.0), "b": (4.0, 3.6, 6.0)})
    render = rendered([door], 0.15, cameras, balconies=[front])
    boxes = [[340, 180, 440, 395], [250, 300, 530, 430], [20, 300, 120, 400], [600, 300, 700, 400]]
    labels = ["window", "balcony", "balcony", "balcony"]
    result = parsed(render, ToldDetector(boxes, [0.9, 0.8, 0.5, 0.1], labels))
    balconies = result.on_fused.select(result.on_fused.labels == "balcony")
    assert len(balconies) == 3  # one by both, two by the detector alone
    assert balconies.boxes_px[0] == pytest.approx([260, 310, 520, 420], abs=1)


def test_specks_are_painted_over_and_wide_gaps_stay_unseen():
    render = rendered([WINDOW], 0.2, arrays(LEVEL))
    valid, rgb = render.ortho.valid.copy(), render.ortho.rgb.copy()
    valid[300:306, 100:300] = valid[50:150, 600:700] = valid[:4, 10:20] = False
    rgb[~valid] = 0
    ortho = OrthoImage("radiance", rgb, valid, render.ortho.depth_m)
    painted = without_specks(ortho, 0.01)
    assert painted.valid[300:306, 100:300].all()
    assert painted.rgb[303, 200].astype(int) == pytest.approx(WALL, abs=3)
    assert not painted.valid[60:140, 610:690].any()
    assert (painted.rgb[100, 650] == 0).all()
    assert (painted.rgb[valid] == rgb[valid]).all()
    whole = OrthoImage("radiance", rgb, np.ones_like(valid), render.ortho.depth_m)
    assert without_specks(whole, 0.01) is whole


def test_an_image_without_depth_is_refused():
    render = rendered([WINDOW], 0.2, arrays(LEVEL))
    render.ortho = OrthoImage("mosaic", render.ortho.rgb, render.ortho.valid)
    with pytest.raises(InputError, match="mosaic has no depth"):
        parsed(render)


def test_an_empty_wall_has_no_windows():
    render = rendered([WINDOW], 0.2, arrays(LEVEL))
    result = parsed(render, ToldDetector(np.zeros((0, 4))))
    assert result.windows == ()
    assert result.notes == ()
    assert result.picture is render.ortho


def test_the_lever_by_hand():
    shown = np.array([2.0, 3.0, 5.0, 6.5])
    below = [np.array([2.5, 1.0, 9.8]), np.array([2.5, 1.0, 7.8])]
    assert hidden_lever(shown, 0.2, below[:1]) == pytest.approx([0, 0, 0.4, 0])
    assert hidden_lever(shown, 0.2, below) == pytest.approx([0, 0, 0.5, 0])  # two must see
    assert hidden_lever(shown, 0.2, []) == pytest.approx([0, 0, 0, 0])
    assert hidden_lever(shown, 0.2, [np.array([2.5, 1.0, -4.0])]) == pytest.approx([0, 0, 0, 0])


@pytest.mark.parametrize(
    ("score", "recess_m", "lowest", "highest"),
    [
        (0.5, None, 0.5, 0.5),  # nothing is known
        (0.5, 0.20, 0.5, 0.5),  # deep: a window, a door or a niche
        (0.5, -0.02, 0.0, 0.2),  # a panel
        (0.98, 0.02, 0.9, 0.98),  # a window flush with its wall
    ],
)
def test_depth_speaks_against_what_lies_in_the_wall_and_for_nothing(
    score, recess_m, lowest, highest
):
    recess = RecessEstimate(recess_m, 0.0 if recess_m is None else 0.03, 0.0, 3)
    assert lowest <= score_by_depth(score, recess) <= highest
