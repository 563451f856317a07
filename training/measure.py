"""Precision, recall and overlap of a detector on the validation list or on cmp-facades."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnxruntime

from training.augment import Sample, scaling, translation, warp_boxes, warp_image
from training.data import (
    IGNORE,
    LABELS,
    NOMINAL_HEIGHT,
    WINDOW,
    Facade,
    bounds,
    data_folder,
    median_height,
    read_set,
    read_validation,
    warp_points,
)
from training.targets import decode, iou

Predict = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""RGB uint8 (H, W, 3) to scores (2, H/4, W/4) and distances (4, H/4, W/4)."""
_LOWEST = 0.05
_LARGEST = 1024
_UPRIGHT = ("hslu-rectified", "spb")
"""Validation sets that look like the runtime's orthographic pictures."""


def views(facade: Facade, factor: float = 1.0) -> list[tuple[str, Sample]]:
    """(set name, sample) of a picture as it is and, where possible, rectified.

    The scale makes the true median window 35 px times ``factor`` high, which the runtime reaches by
    its metres per pixel instead. Sides are multiples of 32, at most 1024 px.
    """
    short = facade.source.removesuffix("-facades")
    found = []
    height, width = facade.levels[0].shape[:2]
    scale = factor * NOMINAL_HEIGHT / median_height(facade)
    matrix = scaling(scale, scale)
    corners = np.array([[0, 0], [width * scale, height * scale]])
    found.append((short, _view(facade, matrix, corners, upright=False)))
    for rectification in facade.rectifications[:1]:
        scale = factor * NOMINAL_HEIGHT / median_height(facade, rectification)
        matrix = scaling(scale, scale) @ rectification
        points = [
            p
            for polygon, label in zip(facade.polygons, facade.labels, strict=True)
            if label == WINDOW and (p := warp_points(matrix, polygon)) is not None
        ]
        upright = [p for p in points if _fills(p)]
        if len(upright) < 4:
            continue
        margin = 2 * factor * NOMINAL_HEIGHT
        box = bounds(np.concatenate(upright)) + margin * np.array([-1, -1, 1, 1])
        found.append((f"{short}-rectified", _view(facade, matrix, box.reshape(2, 2), True)))
    return found


def _fills(points: np.ndarray) -> bool:
    x, y = points[:, 0], points[:, 1]
    area = 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))
    return area > 0.72 * np.ptp(x) * np.ptp(y)


def _view(facade: Facade, matrix: np.ndarray, corners: np.ndarray, upright: bool) -> Sample:
    extent = np.minimum(corners[1] - corners[0], _LARGEST)
    size = tuple(int(np.ceil(e / 32)) * 32 for e in extent)
    moved = translation(*-corners[0]) @ matrix
    image = warp_image(facade, moved, size)
    boxes, labels = warp_boxes(facade, moved, size, upright)
    return Sample(image, boxes, labels)


def all_views(
    facades: list[Facade], factor: float = 1.0
) -> list[tuple[str, tuple[int, ...], Sample]]:
    """(set name, labelled classes, sample) of every view of every picture."""
    return [(name, f.classes, sample) for f in facades for name, sample in views(f, factor)]


@dataclass(frozen=True)
class Matched:
    """The boxes found in some pictures, each (N,) with what became of it, and the true windows.

    Attributes
    ----------
    scores
        Of the boxes, 0 to 1.
    outcome
        1 hit, 0 false, -1 mostly in an ignored area, which counts neither way.
    overlap
        IoU with the true box of a hit, else 0.
    area, true_area
        Of the box and of its true box (0 without one), square pixels of the pictures.
    true_count, true_sum
        Number and summed area of all true boxes.
    """

    scores: np.ndarray
    outcome: np.ndarray
    overlap: np.ndarray
    area: np.ndarray
    true_area: np.ndarray
    true_count: int
    true_sum: float

    def at_least(self, score: float) -> Matched:
        """What would have become of the boxes with this score or more, alone.

        The matching goes from the best score down, so the others did not change it.
        """
        kept = self.scores >= score
        arrays = (self.scores, self.outcome, self.overlap, self.area, self.true_area)
        return Matched(*(array[kept] for array in arrays), self.true_count, self.true_sum)

    @property
    def hits(self) -> np.ndarray:
        return self.outcome == 1

    @property
    def precision(self) -> float:
        return float(self.hits.sum() / max((self.outcome >= 0).sum(), 1))

    @property
    def recall(self) -> float:
        return float(self.hits.sum() / max(self.true_count, 1))

    @property
    def f1(self) -> float:
        return float(_f1(self.precision, self.recall))


def match(
    boxes: np.ndarray, scores: np.ndarray, truth: np.ndarray, ignored: np.ndarray, limit: float
) -> Matched:
    """Boxes (N, 4) of one picture, best score first, against true (M, 4) and ignored (K, 4) ones.

    A box takes the true box that it overlaps most among those that no better box took, if their
    IoU is at least ``limit``.
    """
    order = np.argsort(-scores, kind="stable")
    boxes, scores = boxes[order], scores[order]
    outcome = np.zeros(len(boxes), int)
    overlap, true_area = np.zeros(len(boxes)), np.zeros(len(boxes))
    table, areas = iou(boxes, truth), _areas(truth)
    free = np.ones(len(truth), bool)
    for k, box in enumerate(boxes):
        row = np.where(free, table[k], -1.0)
        if row.size and row.max() >= limit:
            best = int(row.argmax())
            free[best] = False
            outcome[k], overlap[k], true_area[k] = 1, table[k, best], areas[best]
        elif len(ignored):
            low, high = np.maximum(box[:2], ignored[:, :2]), np.minimum(box[2:], ignored[:, 2:])
            common = np.clip(high - low, 0, None).prod(axis=1)
            if common.max() > 0.5 * (box[2:] - box[:2]).prod():
                outcome[k] = -1
    return Matched(
        scores, outcome, overlap, _areas(boxes), true_area, len(truth), float(areas.sum())
    )


def join(parts: list[Matched]) -> Matched:
    """Several pictures as one set."""
    names = ("scores", "outcome", "overlap", "area", "true_area")
    arrays = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
    return Matched(*arrays, sum(p.true_count for p in parts), sum(p.true_sum for p in parts))


def _areas(boxes: np.ndarray) -> np.ndarray:
    return (boxes[:, 2:] - boxes[:, :2]).prod(axis=1)


def curve(matched: Matched) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scores, precision and recall at every score, best first."""
    counted = matched.outcome >= 0
    scores, outcome = matched.scores[counted], matched.outcome[counted]
    order = np.argsort(-scores, kind="stable")
    hits = np.cumsum(outcome[order])
    return scores[order], hits / np.arange(1, len(hits) + 1), hits / max(matched.true_count, 1)


def average_precision(matched: Matched) -> float:
    """Area under the curve of precision over recall, precision made monotone."""
    _, precision, recall = curve(matched)
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    return float((envelope * np.diff(recall, prepend=0.0)).sum())


def best_threshold(matched: Matched) -> float:
    """Score with the best F1; 0.5 where nothing was found or nothing is there."""
    scores, precision, recall = curve(matched)
    if not len(scores) or not matched.true_count:
        return 0.5
    return float(scores[_f1(precision, recall).argmax()])


def _f1(precision, recall):
    return 2 * precision * recall / np.maximum(precision + recall, 1e-9)


def areas(matched: Matched) -> dict[str, float]:
    """Errors of window areas, as shares of the true area.

    ``area_median`` and ``area_mean`` of the absolute errors of hits, ``area_bias_hits`` of the
    summed area of hits, ``area_bias`` of everything found against everything that is there. Boxes
    in ignored areas count on neither side.
    """
    hits = matched.hits
    found, true = matched.area[hits], matched.true_area[hits]
    error = np.abs(found / true - 1) if hits.any() else np.array([np.nan])
    everything = matched.area[matched.outcome >= 0].sum()
    return {
        "area_median": float(np.median(error)),
        "area_mean": float(error.mean()),
        "area_bias_hits": float(found.sum() / true.sum() - 1) if hits.any() else float("nan"),
        "area_bias": float(everything / max(matched.true_sum, 1e-9) - 1),
    }


def _groups(name: str) -> tuple[str, ...]:
    return (name, "all", "upright") if name in _UPRIGHT else (name, "all")


def evaluate(predict: Predict, seen: list[tuple[str, tuple[int, ...], Sample]]) -> dict:
    """Metrics per "set/class", "all/class" and "upright/class" (sets like the runtime's pictures).

    The threshold is the one of the best F1 at IoU 0.5 for that entry; ``f1_75``, precision, recall
    and the mean IoU of the hits are at that threshold.
    """
    groups: dict[str, tuple[list[Matched], list[Matched]]] = {}
    for name, classes, sample in seen:
        scores, distances = predict(sample.image)
        boxes, values, kinds = decode(scores, distances, _LOWEST)
        size = sample.image.shape[1], sample.image.shape[0]
        boxes = np.clip(boxes, 0, np.array([*size, *size]))
        ignored = sample.boxes[sample.labels == IGNORE]
        for k in classes:
            truth = sample.boxes[sample.labels == k]
            for group in _groups(name):
                for parts, limit in zip(
                    groups.setdefault(f"{group}/{LABELS[k]}", ([], [])), (0.5, 0.75), strict=True
                ):
                    parts.append(
                        match(boxes[kinds == k], values[kinds == k], truth, ignored, limit)
                    )
    return {key: _summary(join(at50), join(at75)) for key, (at50, at75) in groups.items()}


def _summary(at50: Matched, at75: Matched) -> dict[str, float]:
    threshold = best_threshold(at50)
    chosen = at50.at_least(threshold)
    result = {
        "n": at50.true_count,
        "ap50": average_precision(at50),
        "f1_50": chosen.f1,
        "f1_75": at75.at_least(threshold).f1,
        "mean_iou": float(chosen.overlap[chosen.hits].mean()) if chosen.hits.any() else 0.0,
        "precision": chosen.precision,
        "recall": chosen.recall,
        "threshold": threshold,
    }
    return {k: round(v, 4) for k, v in result.items()}


def onnx_predictor(path: Path) -> Predict:
    """Predictor of an exported model on the processor."""
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])

    def predict(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        batch = image.transpose(2, 0, 1)[None].astype(np.float32)
        scores, distances = session.run(["scores", "distances"], {"image": batch})
        return scores[0], distances[0]

    return predict


def main() -> None:
    """Print the metrics of an exported model as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", type=Path, required=True)
    parser.add_argument("--data", help="data folder (default: SI3FP_TEST_DATA)")
    parser.add_argument("--set", choices=["validation", "cmp"], default="validation")
    parser.add_argument("--factor", type=float, default=1.0, help="times the normal scale")
    options = parser.parse_args()
    folder = data_folder(options.data)
    cmp = options.set == "cmp"
    facades = read_set(folder, "cmp-facades") if cmp else read_validation(folder)
    print(
        json.dumps(
            evaluate(onnx_predictor(options.model), all_views(facades, options.factor)), indent=1
        )
    )


if __name__ == "__main__":
    main()
