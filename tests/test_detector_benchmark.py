"""The benchmark of detectors: matching, areas, CMP's blinds, the castle's shift, the baseline."""

from __future__ import annotations

import json
import subprocess
import sys

import cv2
import numpy as np
import pytest
from benchmarks.accuracy import classical
from benchmarks.accuracy.detectors import (
    Detector,
    Picture,
    common_shift,
    header,
    measure,
    other,
    pictures_of,
    row,
    shipped,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from training.data import IGNORE, WINDOW, bounds, read_set
from training.matching import best_threshold, describe, join, match
from training.targets import iou

NOTHING = np.zeros((0, 4))
TRUTH = np.array([[10.0, 10, 30, 40], [50, 10, 70, 40], [90, 10, 110, 40], [10, 60, 30, 90]])


def described(boxes, scores, truth=TRUTH, ignored=NOTHING, threshold=0.5):
    at50, at75 = (match(boxes, scores, truth, ignored, limit) for limit in (0.5, 0.75))
    return describe(at50, at75, threshold)


def test_perfect_boxes_have_no_error():
    result = described(TRUTH, np.full(4, 0.9))
    assert result["f1_50"] == result["f1_75"] == result["best_f1"] == result["ap50"] == 1.0
    assert result["mean_iou"] == pytest.approx(1.0)
    assert result["area_mean"] == result["area_bias"] == result["area_bias_hits"] == 0.0


def test_known_errors_give_known_figures():
    # One exact, one 20 % too wide, one with half its height: IoU 0.5, and one far away.
    boxes = np.array([TRUTH[0], [50, 10, 74, 40], [90, 10, 110, 25], [200, 200, 210, 230]])
    result = described(boxes, np.array([0.9, 0.8, 0.7, 0.6]))
    assert result["precision"] == result["recall"] == result["f1_50"] == 0.75
    assert result["f1_75"] == 0.5
    assert result["mean_iou"] == pytest.approx((1 + 600 / 720 + 0.5) / 3)
    assert result["area_median"] == pytest.approx(0.2)
    assert result["area_mean"] == pytest.approx((0 + 0.2 + 0.5) / 3)
    assert result["area_bias_hits"] == pytest.approx((600 + 720 + 300) / 1800 - 1)
    assert result["area_bias"] == pytest.approx((600 + 720 + 300 + 300) / 2400 - 1)


def test_a_fixed_threshold_is_never_better_than_the_best():
    boxes = np.concatenate([TRUTH, TRUTH + 300])
    scores = np.array([0.9, 0.8, 0.3, 0.2, 0.7, 0.1, 0.1, 0.1])
    result = described(boxes, scores)
    assert result["recall"] == 0.5 and result["f1_50"] == pytest.approx(4 / 7)
    assert result["best_f1"] == pytest.approx(8 / 9)


def test_ignored_areas_count_on_neither_side():
    boxes = np.concatenate([TRUTH, [[200.0, 0, 240, 40]]])
    scores = np.full(5, 0.9)
    wrong = described(boxes, scores)
    ignored = described(boxes, scores, ignored=np.array([[195.0, 0, 230, 60]]))
    assert wrong["precision"] == 0.8 and wrong["area_bias"] > 0.5
    assert ignored["precision"] == 1.0 and ignored["area_bias"] == 0.0


def test_each_window_is_found_once():
    result = described(np.concatenate([TRUTH, TRUTH]), np.linspace(0.9, 0.6, 8))
    assert result["precision"] == 0.5 and result["recall"] == 1.0
    assert result["area_bias"] == pytest.approx(1.0) and result["area_bias_hits"] == 0.0


def test_nothing_found_and_nothing_there():
    nothing = described(NOTHING, np.zeros(0))
    assert nothing["f1_50"] == nothing["ap50"] == nothing["mean_iou"] == 0.0
    assert nothing["area_bias"] == -1.0 and np.isnan(nothing["area_mean"])
    assert np.isnan(described(TRUTH, np.full(4, 0.9), NOTHING)["area_bias"])


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 0.95))
def test_boxes_below_the_threshold_do_not_change_the_matching(seed, threshold):
    rng = np.random.default_rng(seed)
    boxes = TRUTH[rng.integers(4, size=12)] + rng.normal(0, 4, (12, 4))
    scores = rng.random(12)
    kept = scores >= threshold
    alone = match(boxes[kept], scores[kept], TRUTH, NOTHING, 0.5)
    cut = match(boxes, scores, TRUTH, NOTHING, 0.5).at_least(threshold)
    assert np.array_equal(alone.outcome, cut.outcome)
    assert np.array_equal(alone.overlap, cut.overlap)


def test_pictures_are_joined_before_their_best_threshold_is_sought():
    good = match(TRUTH, np.full(4, 0.4), TRUTH, NOTHING, 0.5)
    bad = match(TRUTH + 300, np.full(4, 0.3), TRUTH, NOTHING, 0.5)
    both = join([good, bad])
    assert both.true_count == 8 and both.true_sum == 2 * good.true_sum
    assert best_threshold(both) == 0.4


@pytest.fixture
def cmp_folder(tmp_path):
    """One picture: windows with a blind inside, below, beside, and a blind without a window."""
    folder = tmp_path / "cmp-facades"
    (folder / "images").mkdir(parents=True)
    cv2.imwrite(str(folder / "images" / "one.png"), np.full((200, 400, 3), 90, np.uint8))
    kinds = ["window", "door", "balcony", "blind", "shop"]
    boxes = [
        ("window", 20, 20, 30, 40),
        ("blind", 20, 20, 30, 15),
        ("window", 100, 20, 30, 40),
        ("blind", 98, 10, 34, 30),
        ("window", 200, 20, 30, 40),
        ("blind", 228, 20, 15, 40),
        ("blind", 300, 20, 30, 40),
        ("shop", 20, 120, 200, 60),
        ("door", 300, 120, 30, 60),
        ("balcony", 100, 60, 30, 10),
    ]
    annotations = [
        {"image_id": 7, "category_id": kinds.index(kind), "bbox": box} for kind, *box in boxes
    ]
    document = {
        "categories": [{"id": k, "name": kind} for k, kind in enumerate(kinds)],
        "images": [{"id": 7, "file_name": "images/one.png"}],
        "annotations": annotations,
    }
    (folder / "annotations.coco.json").write_text(json.dumps(document))
    return tmp_path


def test_a_blind_is_part_of_the_window_that_it_covers(cmp_folder):
    (facade,) = read_set(cmp_folder, "cmp-facades")
    found = {
        label: sorted(
            bounds(p).tolist() for p, mine in zip(*labelled, strict=True) if mine == label
        )
        for labelled in [(facade.polygons, facade.labels)]
        for label in (WINDOW, IGNORE)
    }
    # The open shutter beside the third window and the blind without window are dropped.
    assert found[WINDOW] == [[20, 20, 50, 60], [98, 10, 132, 60], [200, 20, 230, 60]]
    assert found[IGNORE] == [[20, 120, 220, 180], [300, 120, 330, 180]]
    assert facade.classes == (WINDOW,)


def test_pictures_are_measured_at_the_resolution_of_a_run(cmp_folder):
    facades = read_set(cmp_folder, "cmp-facades")
    sets = pictures_of(facades * 2)
    (picture,) = sets["cmp"]  # a picture that a list names twice counts once
    assert picture.m_per_px == 0.02
    heights = picture.truth[:, 3] - picture.truth[:, 1]
    assert np.median(heights) == pytest.approx(70.0)  # 1.4 m
    assert len(picture.truth) == 3 and len(picture.ignored) == 2


def facade_picture(seed: int = 0) -> Picture:
    """Plaster with noise, dark windows 1.3 x 1.8 m in rows with a white frame each; 0.02 m/px."""
    rng = np.random.default_rng(seed)
    rgb = np.full((480, 640, 3), (190, 180, 160), np.uint8)
    truth = []
    for y in range(40, 400, 150):
        for x in range(50, 560, 130):
            rgb[y : y + 90, x : x + 65] = 235
            rgb[y + 4 : y + 86, x + 4 : x + 61] = (50, 55, 65)
            truth.append([x, y, x + 65, y + 90])
    noise = cv2.GaussianBlur(rng.normal(0, 12, rgb.shape), (0, 0), 1.0)
    rgb = np.clip(rgb + noise, 1, 255).astype(np.uint8)
    return Picture(rgb, 0.02, np.array(truth, float), NOTHING)


def test_the_baseline_finds_plain_windows():
    picture = facade_picture()
    detector = Detector("classical", classical.find_windows, classical.THRESHOLD)
    result = measure(detector, [picture])
    assert result["f1_50"] > 0.95
    assert result["mean_iou"] > 0.8


def test_the_baseline_scales_with_the_picture():
    picture = facade_picture()
    boxes, scores = classical.find_windows(picture.rgb, 0.02)
    half = cv2.resize(picture.rgb, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    small, _ = classical.find_windows(half, 0.04)
    sure = boxes[scores >= classical.THRESHOLD]
    # A pixel of the working resolution per side, of windows 43 x 60 of them.
    assert np.all(iou(sure, 2 * small).max(axis=1) > 0.85)


@pytest.mark.parametrize("shape", [(8, 8, 3), (300, 400, 3)])
def test_the_baseline_finds_nothing_on_a_bare_wall(shape):
    boxes, scores = classical.find_windows(np.full(shape, 150, np.uint8), 0.02)
    assert boxes.shape == (0, 4) and scores.shape == (0,)


def test_the_shift_of_a_whole_picture_is_not_the_detectors():
    picture = facade_picture()
    moved = picture.truth + np.array([7, -4, 7, -4])
    assert common_shift(moved, picture.truth) == pytest.approx([7, -4])
    assert common_shift(NOTHING, picture.truth) == pytest.approx([0, 0])
    detector = Detector("moved", lambda _rgb, _scale: (moved, np.full(len(moved), 0.9)), 0.5)
    adrift = Picture(picture.rgb, 0.02, picture.truth, NOTHING, adrift=True)
    assert measure(detector, [adrift])["mean_iou"] == pytest.approx(1.0)
    assert measure(detector, [picture])["mean_iou"] < 0.85


def test_the_shipped_detector_and_its_refinement_are_measured():
    plain, refined = shipped(None)
    picture = facade_picture()
    before, after = measure(plain, [picture]), measure(refined, [picture])
    assert before["f1_50"] > 0.9 and after["f1_50"] > 0.9
    assert before["n"] == after["n"] == len(picture.truth)
    assert "refined" in refined.title and plain.threshold == refined.threshold


class MadeUp:
    """A further detector, as ``--other`` takes it."""

    def __init__(self, path):
        self.path = path

    def __call__(self, _rgb, _m_per_px):
        return np.concatenate([TRUTH, TRUTH + 40]), np.repeat([0.3, 0.1], 4)


def test_any_function_can_be_measured(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "made_up", sys.modules[__name__])
    picture = Picture(np.zeros((200, 200, 3), np.uint8), 0.02, TRUTH, NOTHING)
    sets = {"hslu-rectified": [picture], "spb": [picture]}
    detector = other("made up", "made_up:MadeUp", str(tmp_path), sets)
    assert detector.find.path == tmp_path and detector.threshold == 0.3
    line = row("spb", detector.title, measure(detector, [picture]))
    assert line.startswith("| SPB val | made up | 4 | 1.000 |")
    assert line.count("|") == header().splitlines()[0].count("|")


def test_measuring_needs_no_torch():
    names = "augment, data, matching, measure, rectify, targets"
    code = f"import sys; from training import {names}; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
