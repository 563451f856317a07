"""Scores made probabilities, and how far window-to-wall ratios are off, on the validation pictures.

The constants go into detector.json, where the package reads them. What is reported of them comes
from pictures that they were not fitted to: five parts, no source photo in two of them.
"""

from __future__ import annotations

import argparse
import json
import shutil
import tempfile
from dataclasses import asdict, dataclass, replace
from itertools import compress
from pathlib import Path

import numpy as np

from si3fp.windows.detect import LAPLACE_SIGMA, OnnxDetector
from si3fp.windows.interval import WwrErrors, window_area, wwr_interval
from training.data import LABELS, Facade, data_folder, read_set, read_validation
from training.matching import best_threshold, join
from training.reliability import KNOTS, Curve, draw, fit_curve, reliability
from training.walls import Picture, look

FOLDS = 5
_NO_ERRORS = WwrErrors(0.0, 0.0, 0.0, 0.0, 0.0)
_WEIGHTS = Path(__file__).parents[1] / "src/si3fp/windows/weights"
_LOG = Path(__file__).with_name("log")


def fit_spread_factor(pictures: list[Picture]) -> float:
    """What makes the network's Laplace scales fit the sides of the hits: mean of error / scale."""
    sigma = np.concatenate([picture.sigma[picture.matched.hits] for picture in pictures])
    known = sigma > 0
    error = np.concatenate([picture.errors_px for picture in pictures])
    return _round((error[known] * LAPLACE_SIGMA / sigma[known]).mean()) if known.any() else 1.0


def fit_errors(pictures: list[Picture], curve: Curve) -> WwrErrors:
    """How ratios are off, from moments: what is observed less what the other terms explain."""
    rows = []
    for picture in pictures:
        probability = curve(picture.matched.scores)
        hits = picture.matched.hits
        area = picture.matched.area / picture.wall_px2
        doubt = area * np.sqrt(probability * (1 - probability))
        certain = picture.windows(np.ones(len(hits)))
        sides = window_area(list(compress(certain, hits)), _NO_ERRORS)[1] / picture.wall_m2**2
        found = area[hits].sum()
        true = picture.matched.true_area.sum() / picture.wall_px2
        rows.append(
            (picture.true_ratio - probability @ area, found - probability @ area,
             found - true, found, doubt @ doubt, doubt.sum() ** 2, sides)
        )  # fmt: skip
    total, real, moved, found, alone, together, sides = np.array(rows).T
    correlation = np.clip((real**2 - alone).sum() / (together - alone).sum(), 0, 1)
    common = max((moved**2 - sides).sum() / (found**2).sum(), 0)
    missed = max(total.mean(), 0)
    explained = alone + correlation * (together - alone) + sides + common * found**2
    return WwrErrors(
        correlation=_round(correlation),
        missed_mean=_round(missed),
        missed_sd=_round(np.sqrt(max(((total - missed) ** 2 - explained).mean(), 0))),
        common_sd=_round(np.sqrt(common)),
        part_sd=_round(np.sqrt(np.mean([picture.parts**2 for picture in pictures]))),
    )


def _round(value: float) -> float:
    return round(float(value), 4)


def folds(pictures: list[Picture], seed: int = 0) -> np.ndarray:
    """(N,) number of the part of every picture; the pictures of one photo are in one part."""
    groups = sorted({picture.group for picture in pictures})
    order = np.random.default_rng(seed).permutation(len(groups))
    part = {group: int(order[k]) % FOLDS for k, group in enumerate(groups)}
    return np.array([part[picture.group] for picture in pictures])


def coverage(names: list[str], truth: np.ndarray, intervals: np.ndarray) -> dict[str, dict]:
    """By set: pictures, share of true ratios (N,) within intervals (N, 2), median width."""
    inside = (intervals[:, 0] <= truth) & (truth <= intervals[:, 1])
    width = intervals[:, 1] - intervals[:, 0]
    sets = {name: np.array([other == name for other in names]) for name in sorted(set(names))}
    sets["all"] = np.ones(len(names), bool)
    return {
        name: {
            "pictures": int(mine.sum()),
            "covered": _round(inside[mine].mean()),
            "median_width": _round(np.median(width[mine])),
            "median_ratio": _round(np.median(truth[mine])),
        }
        for name, mine in sets.items()
    }


@dataclass(frozen=True)
class Calibration:
    """What the pictures tell of a detector: probabilities at `KNOTS` and threshold by label."""

    knots: dict[str, np.ndarray]
    thresholds: dict[str, float]
    spread_factor: float
    errors: WwrErrors

    def curve(self, label: str) -> Curve:
        return lambda scores: np.interp(scores, KNOTS, self.knots[label])

    def interval(self, picture: Picture) -> tuple[float, float]:
        """90 % interval of the picture's ratio, as the package would give it."""
        probability = self.curve("window")(picture.matched.scores)
        scaled = replace(picture, sigma=picture.sigma * self.spread_factor)
        boxes = scaled.windows(probability)
        sure = int((probability >= self.thresholds["window"]).sum())  # best first
        return wwr_interval(boxes[:sure], boxes[sure:], picture.wall_m2, 1.0, self.errors)


def calibrate(pictures: list[Picture]) -> Calibration:
    """The calibration that fits the pictures."""
    found = {
        "window": join([picture.matched for picture in pictures]),
        "balcony": join([p.balconies for p in pictures if p.balconies is not None]),
    }
    knots = {label: fit_curve(m.scores, m.hits) for label, m in found.items()}
    thresholds = {
        # Rounded down: the box that sets it stays in.
        label: float(np.floor(np.interp(best_threshold(m), KNOTS, knots[label]) * 1e4) / 1e4)
        for label, m in found.items()
    }
    factor = fit_spread_factor(pictures)
    scaled = [replace(picture, sigma=picture.sigma * factor) for picture in pictures]
    raw = Calibration(knots, thresholds, factor, _NO_ERRORS)
    return replace(raw, errors=fit_errors(scaled, raw.curve("window")))


def cross_check(pictures: list[Picture]) -> tuple[dict[str, dict], dict[str, dict]]:
    """`reliability` by label and `coverage` by set, each picture by a calibration without it."""
    part = folds(pictures)
    intervals = np.zeros((len(pictures), 2))
    rows: dict[str, list[np.ndarray]] = {label: [] for label in LABELS}
    for number in range(FOLDS):
        kept = calibrate([p for p, k in zip(pictures, part, strict=True) if k != number])
        for index in np.flatnonzero(part == number):
            picture = pictures[index]
            intervals[index] = kept.interval(picture)
            for label, matched in (("window", picture.matched), ("balcony", picture.balconies)):
                if matched is not None:
                    probability = kept.curve(label)(matched.scores)
                    rows[label].append(np.stack([probability, matched.hits, matched.scores]))
    names = [picture.name for picture in pictures]
    truth = np.array([picture.true_ratio for picture in pictures])
    return (
        {label: reliability(*np.concatenate(found, axis=1)) for label, found in rows.items()},
        coverage(names, truth, intervals),
    )


def raw_detector(model: Path) -> OnnxDetector:
    """The detector as it leaves the training, whatever its description says of a calibration."""
    described = json.loads(model.with_suffix(".json").read_text())
    for name in ("calibration", "spread_factor", "wwr"):
        described.pop(name, None)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "detector.onnx"
        shutil.copyfile(model, copy)
        copy.with_suffix(".json").write_text(json.dumps(described))
        return OnnxDetector(copy)


def source_photos(folder: Path) -> dict[str, str]:
    """Source photo of the pictures of hslu-facades, by the name of `Facade`."""
    name = "hslu-facades"
    images = json.loads((folder / name / "annotations.coco.json").read_text())["images"]
    return {f"{name}/{image['file_name']}": image["source"] for image in images}


def check_elsewhere(model: Path, facades: list[Facade]) -> dict[str, dict]:
    """`coverage` of the shipped constants on other pictures; nothing is fitted."""
    described = json.loads(model.with_suffix(".json").read_text())
    shipped = Calibration(
        {label: np.array(curve[1]) for label, curve in described["calibration"].items()},
        described["score_thresholds"],
        described["spread_factor"],
        WwrErrors(**described["wwr"]),
    )
    pictures = look(raw_detector(model), facades, {})
    return coverage(
        [picture.name for picture in pictures],
        np.array([picture.true_ratio for picture in pictures]),
        np.array([shipped.interval(picture) for picture in pictures]),
    )


def write(model: Path, folder: Path, figure: Path) -> dict:
    """Put the calibration into the model's description and draw the diagram; what was written."""
    detector = raw_detector(model)
    pictures = look(detector, read_validation(folder), source_photos(folder))
    result = calibrate(pictures)
    reliable, covered = cross_check(pictures)
    knots = {label: [KNOTS, probability] for label, probability in result.knots.items()}
    written = {
        "score_thresholds": result.thresholds,
        "calibration": {label: np.round(k, 5).tolist() for label, k in knots.items()},
        "spread_factor": result.spread_factor,
        "wwr": asdict(result.errors),
        "reliability": reliable,
        "wwr_coverage": covered,
    }
    card = model.with_suffix(".json")
    fresh = card.with_suffix(".tmp.json")
    fresh.write_text(json.dumps(json.loads(card.read_text()) | written, indent=2) + "\n")
    fresh.replace(card)
    draw(reliable, figure)
    return written


def main() -> None:
    """Write the calibration into the detector's description and draw the reliability diagram."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", help="data folder (default: SI3FP_TEST_DATA)")
    parser.add_argument("--model", type=Path, default=_WEIGHTS / "detector.onnx")
    parser.add_argument("--figure", type=Path, default=_LOG / "reliability.png")
    parser.add_argument(
        "--cmp", action="store_true", help="only say how cmp-facades are covered, write nothing"
    )
    options = parser.parse_args()
    folder = data_folder(options.data)
    if options.cmp:
        print(json.dumps(check_elsewhere(options.model, read_set(folder, "cmp-facades")), indent=1))
        return
    written = write(options.model, folder, options.figure)
    print(json.dumps({k: v for k, v in written.items() if k != "calibration"}, indent=1))


if __name__ == "__main__":
    main()
