"""Precision, recall and overlap of a detector on the validation list or on cmp-facades."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnxruntime

from training.augment import Sample, scaling, translation, warp_boxes, warp_image
from training.data import (
    IGNORE,
    LABELS,
    M_PER_PX,
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
from training.matching import Matched, best_threshold, clipped, describe, join, match
from training.targets import decode

Predict = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""RGB uint8 (H, W, 3) to scores (2, H/4, W/4) and distances (4, H/4, W/4)."""
_LOWEST = 0.05
_LARGEST_M = 41.0
_COLUMNS = ("n", "ap50", "f1_50", "f1_75", "mean_iou", "precision", "recall", "threshold")
_UPRIGHT = ("hslu-rectified", "spb")
"""Validation sets that look like the runtime's orthographic pictures."""


def views(facade: Facade, factor: float = 1.0) -> list[tuple[str, Sample]]:
    """(set name, sample) of a picture as it is and, where possible, rectified.

    The scale makes the true median window 1.4 m high, which the runtime reaches by its metres per
    pixel instead; ``factor`` is by how much the resolution is finer than the one of training. Sides
    are multiples of 32 px, of about 41 m at most.
    """
    short = facade.source.removesuffix("-facades")
    found = []
    largest = factor * _LARGEST_M / M_PER_PX
    height, width = facade.levels[0].shape[:2]
    scale = factor * NOMINAL_HEIGHT / median_height(facade)
    matrix = scaling(scale, scale)
    corners = np.array([[0, 0], [width * scale, height * scale]])
    found.append((short, _view(facade, matrix, corners, False, largest)))
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
        found.append(
            (f"{short}-rectified", _view(facade, matrix, box.reshape(2, 2), True, largest))
        )
    return found


def _fills(points: np.ndarray) -> bool:
    x, y = points[:, 0], points[:, 1]
    area = 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))
    return area > 0.72 * np.ptp(x) * np.ptp(y)


def _view(
    facade: Facade, matrix: np.ndarray, corners: np.ndarray, upright: bool, largest: float
) -> Sample:
    extent = np.minimum(corners[1] - corners[0], largest)
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
        boxes = clipped(boxes, sample.image)
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
    result = describe(at50, at75, best_threshold(at50))
    return {name: round(result[name], 4) for name in _COLUMNS}


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
