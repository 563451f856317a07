"""Calibration on pictures whose truth is drawn or written by hand."""

import json
import shutil
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from training.augment import Sample
from training.calibrate import (
    FOLDS,
    calibrate,
    coverage,
    fit_errors,
    fit_spread_factor,
    folds,
    raw_detector,
)
from training.data import BALCONY, IGNORE, WINDOW
from training.matching import Matched
from training.reliability import KNOTS, draw, fit_curve, reliability
from training.walls import WALL_MARGIN_PX, Picture, compare

from si3fp.model import Detections, OrthoImage
from si3fp.windows.detect import OnnxDetector
from si3fp.windows.interval import WwrErrors


def logistic(odds):
    return 1 / (1 + np.exp(-odds))


@pytest.mark.parametrize(
    "truth",
    [
        lambda s: logistic(2.2 * np.log(s) - 1.9 * np.log(1 - s) + 0.3),
        lambda s: logistic(9 * (s - 0.45)),
        lambda s: s,
    ],
    ids=["beta", "Platt", "right already"],
)
def test_a_known_curve_is_recovered_from_its_outcomes(truth):
    rng = np.random.default_rng(1)
    scores = rng.uniform(0.05, 0.97, 6000)
    curve = fit_curve(scores, rng.random(6000) < truth(scores))
    inner = KNOTS[:-1]
    assert np.abs(curve[:-1] - truth(inner)).max() < 0.04
    assert len(curve) == len(KNOTS) <= 20
    assert (np.diff(curve) > 0).all()


def test_outcomes_that_scores_separate_still_give_a_rising_curve_within_0_and_1():
    curve = fit_curve(np.array([0.1, 0.2, 0.8, 0.9]), np.array([False, False, True, True]))
    assert (np.diff(np.round(curve, 5)) > 0).all()
    assert curve.min() > 0
    assert curve.max() < 1


def test_reliability_by_hand():
    # Thirty boxes that promise 0.9, half of them hits: off by 0.4, squared error (0.01 + 0.81) / 2.
    hits = np.arange(30) % 2 == 0
    found = reliability(np.full(30, 0.5), hits, np.full(30, 0.9))
    assert found["ece_before"] == pytest.approx(0.4, abs=0.02)  # fifteen classes of two
    assert found["ece"] == pytest.approx(0.0, abs=1e-9)
    assert found["brier_before"] == pytest.approx(0.41)
    assert found["bins"] == [[0.5, 0.5, 30]]


def test_the_diagram_is_drawn(tmp_path):
    found = reliability(np.linspace(0, 1, 40), np.arange(40) > 20, np.linspace(0, 1, 40))
    draw({"window": found}, tmp_path / "log" / "reliability.png")
    assert (tmp_path / "log" / "reliability.png").read_bytes().startswith(b"\x89PNG")


def drawn(rng, errors, *, count=20, group="photo", sigma_px=1.5):
    """A picture whose boxes, hits and areas follow the model of the interval (one score)."""
    score, side, wall = 0.7, 40.0, 160000.0
    shared = rng.random(count) < errors.correlation**0.5
    hits = np.where(shared, rng.random(), rng.random(count)) < score
    left = 60.0 * np.arange(count)
    boxes = np.stack([left, 0 * left, left + side, 0 * left + side], axis=1)
    moved = rng.normal(0, sigma_px, (count, 4))
    size = side + moved[:, :2] + moved[:, 2:]
    true = size.prod(axis=1) * (1 + errors.common_sd * rng.standard_normal())
    missed = wall * (errors.missed_mean + errors.missed_sd * rng.standard_normal())
    matched = Matched(
        np.full(count, score),
        hits.astype(int),
        hits * 0.8,
        np.full(count, side**2),
        np.where(hits, true, 0.0),
        int(hits.sum()),
        float(true[hits].sum() + missed),
    )
    balconies = Matched(np.array([0.2, 0.8]), np.array([0, 1]), *np.zeros((3, 2)), 1, 1.0)
    return Picture(
        group,
        "drawn",
        boxes,
        np.full((count, 4), sigma_px),
        matched,
        np.abs(moved[hits]),
        wall,
        1.0,
        rng.normal(0, errors.part_sd, 4),
        balconies,
    )


def test_errors_of_ratios_are_recovered():
    truth = WwrErrors(
        correlation=0.1, missed_mean=0.015, missed_sd=0.02, common_sd=0.08, part_sd=0.09
    )
    rng = np.random.default_rng(3)
    pictures = [drawn(rng, truth) for _ in range(600)]
    found = fit_errors(pictures, lambda scores: scores)
    for name in ("correlation", "missed_mean", "missed_sd", "common_sd", "part_sd"):
        assert getattr(found, name) == pytest.approx(getattr(truth, name), rel=0.2), name


def test_intervals_cover_nine_of_ten_pictures_that_the_calibration_did_not_see():
    truth = WwrErrors(0.1, 0.015, 0.02, 0.08, 0.09)
    rng = np.random.default_rng(4)
    known = calibrate([drawn(rng, truth, sigma_px=0.5) for _ in range(200)])
    fresh = [drawn(rng, truth, sigma_px=0.5) for _ in range(300)]
    intervals = np.array([known.interval(picture) for picture in fresh])
    ratios = np.array([picture.true_ratio for picture in fresh])
    report = coverage(["drawn"] * len(fresh), ratios, intervals)
    # Sampling alone moves 300 pictures by 0.017.
    assert report["all"]["covered"] == pytest.approx(0.9, abs=0.05)
    assert report["drawn"] == report["all"]


def test_the_factor_of_the_spreads():
    rng = np.random.default_rng(2)
    picture = drawn(rng, WwrErrors(0, 0, 0, 0, 0), count=3000)
    scale = picture.sigma[picture.matched.hits] / 2**0.5
    errors = np.abs(rng.laplace(0, 1.7 * scale))
    arguments = {name: getattr(picture, name) for name in Picture.__dataclass_fields__}
    assert fit_spread_factor([Picture(**arguments | {"errors_px": errors})]) == pytest.approx(
        1.7, rel=0.03
    )
    unknown = Picture(**arguments | {"sigma": np.zeros_like(picture.sigma)})
    assert fit_spread_factor([unknown]) == 1.0


def test_pictures_of_one_photo_share_their_fold():
    rng = np.random.default_rng(0)
    none = WwrErrors(0, 0, 0, 0, 0)
    pictures = [drawn(rng, none, group=f"photo {k // 3}", count=1) for k in range(60)]
    part = folds(pictures)
    assert (part.reshape(20, 3) == part.reshape(20, 3)[:, :1]).all()
    assert np.bincount(part).tolist() == [12] * FOLDS


def test_coverage_by_hand():
    report = coverage(
        ["a", "a", "b"],
        np.array([0.1, 0.2, 0.3]),
        np.array([[0.05, 0.15], [0.0, 0.1], [0.3, 0.32]]),
    )
    assert report["a"]["covered"] == 0.5
    assert report["b"] == {
        "pictures": 1, "covered": 1.0, "median_width": 0.02, "median_ratio": 0.3,
    }  # fmt: skip
    assert report["all"]["covered"] == pytest.approx(2 / 3, abs=1e-4)


def test_a_picture_against_its_truth():
    margin = WALL_MARGIN_PX
    truth = np.array([[100.0, 100, 140, 160], [300, 100, 340, 160]])
    shop = [200.0, 100, 240, 160]
    sample = Sample(
        np.zeros((400, 500, 3), np.uint8),
        np.array([*truth, shop, [90.0, 150, 150, 170]]),
        np.array([WINDOW, WINDOW, IGNORE, BALCONY]),
    )
    found = Detections(
        np.array([[101.0, 100, 140, 163], shop, [150, 100, 190, 160], [100, 350, 140, 390],
                  [90, 150, 150, 170]]),
        np.array([0.9, 0.8, 0.3, 0.7, 0.6]),
        np.array(["window", "window", "window", "window", "balcony"]),
    )  # fmt: skip
    picture = compare("photo", "set", found, sample, with_balconies=True)
    # The shop counts neither way, what lies below the wall is cropped away.
    assert picture.matched.scores.tolist() == [0.9, 0.3]
    assert picture.matched.hits.tolist() == [True, False]
    assert picture.errors_px.tolist() == [[1, 0, 0, 3]]
    wall = (240 + 2 * margin) * (60 + 2 * margin)
    assert picture.wall_px2 == pytest.approx(wall - 40 * 60, rel=0.02)  # whole pixels
    assert picture.true_ratio == pytest.approx(2 * 40 * 60 / picture.wall_px2)
    # A quarter at the left holds one window, the half in the middle none.
    quarter = 40 * 60 / (wall / 4)
    assert picture.parts[[0, 2]] == pytest.approx([quarter - quarter / 3] * 2)
    assert picture.balconies.hits.tolist() == [True]
    window = picture.windows(np.array([0.5, 0.1]))[0]
    assert window.area_m2 == pytest.approx(39 * 63 * 0.03**2)


def test_scores_leave_the_detector_calibrated_and_the_raw_one_as_they_are(tmp_path):
    weights = Path(str(resources.files("si3fp.windows") / "weights"))
    model = tmp_path / "detector.onnx"
    shutil.copyfile(weights / "detector.onnx", model)
    described = json.loads((weights / "detector.json").read_text())
    curve = [KNOTS.tolist(), (KNOTS**2).tolist()]
    described["calibration"] = {"window": curve, "balcony": curve}
    described["wwr"] = {"correlation": 0.1, "missed_mean": 0.01, "missed_sd": 0.02,
                        "common_sd": 0.08, "part_sd": 0.09}  # fmt: skip
    model.with_suffix(".json").write_text(json.dumps(described))

    rng = np.random.default_rng(0)
    rgb = np.full((160, 160, 3), 200, np.uint8)
    rgb[50:100, 60:95] = rng.integers(20, 60, (50, 35, 3))
    image = OrthoImage("x", rgb, np.ones(rgb.shape[:2], bool))
    calibrated, raw = OnnxDetector(model), raw_detector(model)
    found = raw.detect(image, raw.m_per_px)
    scores = calibrated.detect(image, raw.m_per_px).scores
    assert len(found)
    assert scores == pytest.approx(np.interp(found.scores, *curve))
    assert calibrated.wwr_errors == WwrErrors(0.1, 0.01, 0.02, 0.08, 0.09)
    assert raw.wwr_errors is None
