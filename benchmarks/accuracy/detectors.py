"""Detectors of windows, compared on pictures that none of them was trained on.

``python -m benchmarks.accuracy.detectors --data DATA [--castle RUN] [--cmp]`` prints one table
(Markdown): the network that ships, the same with its edges refined as a run does it, the classical
baseline, and what ``--other`` names. ``DATA`` is the folder with ``hslu-facades`` and
``spb-facades``, ``RUN`` a finished run of `si3fp street` on the castle court. No torch needed.

All see the same pictures at 0.02 m per pixel, the resolution of a run: data sets without metres are
scaled by their true median window to 1.4 m, the castle has its own metres. Precision, recall and F1
are at one threshold per detector for all sets, the one it recommends; ``best F1`` is at the set's
own best threshold and tells how much a choice on the set itself would flatter.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np
from benchmarks.accuracy import classical
from benchmarks.accuracy.views_or_fused import facades_of, truth_of
from training.data import IGNORE, WINDOW, Facade, data_folder, read_set, read_validation
from training.data import M_PER_PX as TRAINED_M_PER_PX
from training.matching import Matched, best_threshold, clipped, describe, join, match
from training.measure import views
from training.targets import iou

from si3fp.config import MeasureConfig
from si3fp.geometry.enu import geodetic_from_world, world_from_geodetic
from si3fp.model import GeoOrigin, OrthoImage
from si3fp.windows.detect import OnnxDetector
from si3fp.windows.fuse import FusedDetections
from si3fp.windows.refine import refine_boxes
from si3fp.workspace import Workspace, read_json

Find = Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray]]
"""RGB uint8 (H, W, 3) and metres per pixel to boxes (N, 4) in pixels and scores (N,)."""
M_PER_PX = 0.02
TRUTH = Path(__file__).parents[2] / "tests" / "data" / "castle_truth.json"
UPRIGHT = ("hslu-rectified", "spb")
"""Sets like the pictures of a run."""
TITLES = {
    "hslu-rectified": "HSLU val, rectified",
    "hslu": "HSLU val, as photographed",
    "spb": "SPB val",
    "castle": "castle orthophotos",
    "cmp": "CMP base",
}
COUNTS = {"n": "windows"}
SHARES = {
    "precision": "P",
    "recall": "R",
    "f1_50": "F1",
    "best_f1": "best F1",
    "precision_75": "P 75",
    "recall_75": "R 75",
    "f1_75": "F1 75",
    "ap50": "AP50",
    "mean_iou": "mean IoU",
}
ERRORS = {
    "area_median": "area error, median",
    "area_mean": "mean",
    "area_bias_hits": "bias, hits",
    "area_bias": "bias, sum",
}
SIGNED = ("area_bias_hits", "area_bias")


@dataclass(frozen=True)
class Detector:
    """Something that finds windows, and the score from which it means it."""

    title: str
    find: Find
    threshold: float


@dataclass(frozen=True)
class Picture:
    """An orthographic picture with true and ignored boxes (N, 4) in its pixels.

    ``adrift``: the truth is off by one shift of the whole picture, which is not the detector's.
    """

    rgb: np.ndarray
    m_per_px: float
    truth: np.ndarray
    ignored: np.ndarray
    adrift: bool = False


def shipped(path: Path | None) -> list[Detector]:
    """The network of an ONNX file (without one, of the package), without and with refinement."""
    detector = OnnxDetector(path)
    threshold = detector.thresholds["window"]

    def find(rgb: np.ndarray, m_per_px: float) -> tuple[np.ndarray, np.ndarray]:
        found = detector.detect(_ortho(rgb), m_per_px)
        found = found.select(found.labels == "window")
        return found.boxes_px, found.scores

    def find_and_refine(rgb: np.ndarray, m_per_px: float) -> tuple[np.ndarray, np.ndarray]:
        image = _ortho(rgb)
        found = detector.detect(image, m_per_px)
        found = found.select(found.labels == "window")
        sure = found.select(found.scores >= threshold)
        fused = FusedDetections(sure, ((),) * len(sure))
        refined = refine_boxes(fused, image, m_per_px, MeasureConfig()).detections
        # Scores are descending: what is not sure follows.
        return np.concatenate([refined.boxes_px, found.boxes_px[len(sure) :]]), found.scores

    return [
        Detector(detector.name, find, threshold),
        Detector(f"{detector.name}, edges refined", find_and_refine, threshold),
    ]


def other(title: str, maker: str, path: str, sets: dict[str, list[Picture]]) -> Detector:
    """What ``maker`` ("module:name") makes of a path: a `Find`.

    Its threshold is chosen as that of the network that ships: the best F1 on the upright sets.
    """
    module, _, name = maker.partition(":")
    find = getattr(import_module(module), name)(Path(path))
    upright = [picture for each in UPRIGHT for picture in sets[each]]
    at50, _ = matched(Detector(title, find, 0.0), upright)
    return Detector(title, find, best_threshold(at50))


def _ortho(rgb: np.ndarray) -> OrthoImage:
    return OrthoImage("picture", np.ascontiguousarray(rgb), rgb.max(axis=2) > 0)


def pictures_of(facades: list[Facade]) -> dict[str, list[Picture]]:
    """The pictures of data sets by set, each once, also where a list names it twice."""
    sets: dict[str, list[Picture]] = {}
    for facade in {facade.name: facade for facade in facades}.values():
        for name, sample in views(facade, TRAINED_M_PER_PX / M_PER_PX):
            truth, ignored = (sample.boxes[sample.labels == k] for k in (WINDOW, IGNORE))
            sets.setdefault(name, []).append(Picture(sample.image, M_PER_PX, truth, ignored))
    return sets


def castle_pictures(run: Path, truth: Path = TRUTH) -> list[Picture]:
    """The fused images of a run with the windows of its truth on their grids."""
    true_origin, facades = truth_of(truth)
    origin = GeoOrigin(**read_json(Workspace(run).run_json)["origin"])
    true = {facade.id: facade for facade in facades}
    pictures = []
    for parsed in facades_of(run):
        facade = true[parsed.facade.id]
        boxes = []
        for window in facade.windows:
            right, top = window.x_m + window.width_m, window.y_m + window.height_m
            corners = facade.world_from_facade.apply(
                [[window.x_m, window.y_m, 0.0], [right, top, 0.0]]
            )
            if true_origin is not None:
                corners = world_from_geodetic(geodetic_from_world(corners, true_origin), origin)
            on_facade = parsed.grid.world_from_facade.inverse().apply(corners)[:, :2]
            (x0, y1), (x1, y0) = parsed.grid.pixels_from_facade(on_facade)
            boxes.append([x0, y0, x1, y1])
        rgb = np.where(parsed.fused.valid[..., None], parsed.fused.rgb, np.uint8(0))
        nothing = np.zeros((0, 4))
        pictures.append(Picture(rgb, parsed.grid.m_per_px, np.array(boxes), nothing, adrift=True))
    return pictures


def common_shift(boxes: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Median x and y from true boxes to the found ones that overlap them most, by 0.3 or more."""
    if not len(boxes) or not len(truth):
        return np.zeros(2)
    table = iou(truth, boxes)
    hit = table.max(axis=1) >= 0.3
    if not hit.any():
        return np.zeros(2)
    offsets = boxes[table.argmax(axis=1)] - truth
    return np.median((offsets[hit, :2] + offsets[hit, 2:]) / 2, axis=0)


def matched(detector: Detector, pictures: list[Picture]) -> tuple[Matched, Matched]:
    """Everything that a detector finds on pictures of one scale, at IoU 0.5 and at IoU 0.75."""
    parts = []
    for picture in pictures:
        boxes, scores = detector.find(picture.rgb, picture.m_per_px)
        boxes, truth = clipped(boxes, picture.rgb), picture.truth
        if picture.adrift:
            truth = truth + np.tile(common_shift(boxes[scores >= detector.threshold], truth), 2)
        parts.append([match(boxes, scores, truth, picture.ignored, limit) for limit in (0.5, 0.75)])
    at50, at75 = zip(*parts, strict=True)
    return join(list(at50)), join(list(at75))


def measure(detector: Detector, pictures: list[Picture]) -> dict[str, float]:
    """The metrics of `training.matching.describe` of a detector on pictures of one scale."""
    return describe(*matched(detector, pictures), detector.threshold)


def row(set_name: str, title: str, metrics: dict[str, float]) -> str:
    """One row of the table."""
    cells = [TITLES.get(set_name, set_name), title]
    cells += [f"{metrics[name]:.0f}" for name in COUNTS]
    cells += [f"{metrics[name]:.3f}" for name in SHARES]
    cells += [
        "-"
        if np.isnan(metrics[name])
        else f"{100 * metrics[name]:{'+' if name in SIGNED else ''}.1f} %"
        for name in ERRORS
    ]
    return f"| {' | '.join(cells)} |"


def header() -> str:
    """The first two rows of the table."""
    names = ["set", "detector", *COUNTS.values(), *SHARES.values(), *ERRORS.values()]
    return f"| {' | '.join(names)} |\n|{'---|' * len(names)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", help="data folder (default: SI3FP_TEST_DATA)")
    parser.add_argument("--weights", type=Path, help="another detector.onnx than the shipped one")
    parser.add_argument(
        "--other",
        nargs=3,
        action="append",
        default=[],
        metavar=("TITLE", "MODULE:NAME", "PATH"),
        help="a further detector: NAME(PATH) gives a function of a picture and its m per pixel",
    )
    parser.add_argument("--castle", type=Path, help="run folder of the castle court")
    parser.add_argument("--cmp", action="store_true", help="CMP too; every look at it is counted")
    parser.add_argument("--json", type=Path, help="file for all figures, unrounded")
    options = parser.parse_args()
    folder = data_folder(options.data)
    sets = pictures_of(read_validation(folder))
    detectors = [
        *shipped(options.weights),
        *(other(*words, sets) for words in options.other),
        Detector("classical baseline", classical.find_windows, classical.THRESHOLD),
    ]
    if options.castle:
        sets["castle"] = castle_pictures(options.castle)
    if options.cmp:
        sets |= pictures_of(read_set(folder, "cmp-facades"))
    figures: dict[str, dict[str, dict[str, float]]] = {}
    print(header())
    for name in (name for name in TITLES if name in sets):
        for detector in detectors:
            figures.setdefault(name, {})[detector.title] = measure(detector, sets[name])
            print(row(name, detector.title, figures[name][detector.title]), flush=True)
    if options.castle:
        print(
            "\nCastle: truth moved by one shift per facade (the median offset of the matches), so "
            "that the error of registration does not count."
        )
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
