"""Boxes to training targets and predictions back to boxes, both in numpy."""

from __future__ import annotations

import numpy as np

from training.data import IGNORE

STRIDE = 4
"""Pixels of the picture per cell of the maps."""


def encode(
    boxes: np.ndarray, labels: np.ndarray, size: tuple[int, int], classes: int = 2
) -> dict[str, np.ndarray]:
    """Targets of one crop of ``size`` (W, H) px; all float32, on the (H/4, W/4) grid.

    ``heat`` (classes, h, w): 1 in the cell of a box's centre, a Gaussian around it. ``sides``
    (4, h, w): left, top, right, bottom in px from the cell centre; ``side_weight`` (h, w): > 0 in
    the middle of boxes, where ``sides`` holds. ``care`` (h, w): 0 in ignored areas, else 1.
    """
    width, height = size[0] // STRIDE, size[1] // STRIDE
    heat = np.zeros((classes, height, width), np.float32)
    sides = np.ones((4, height, width), np.float32)
    weight = np.zeros((height, width), np.float32)
    care = np.ones((height, width), np.float32)
    x = STRIDE * (np.arange(width, dtype=np.float32) + 0.5)
    y = STRIDE * (np.arange(height, dtype=np.float32) + 0.5)
    areas = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
    for k in np.argsort(-areas, kind="stable"):
        left, top, right, bottom = boxes[k]
        if labels[k] == IGNORE:
            inside = (y[:, None] > top) & (y[:, None] < bottom) & (x > left) & (x < right)
            care[inside] = 0
    for k in np.argsort(-areas, kind="stable"):
        if labels[k] == IGNORE:
            continue
        left, top, right, bottom = boxes[k]
        w, h = right - left, bottom - top
        column = min(int((left + right) / 2 / STRIDE), width - 1)
        row = min(int((top + bottom) / 2 / STRIDE), height - 1)
        sigma_x, sigma_y = max(0.13 * w, 2.2), max(0.13 * h, 2.2)
        gauss = np.exp(
            -((x - x[column]) ** 2)[None, :] / (2 * sigma_x**2)
            - ((y - y[row]) ** 2)[:, None] / (2 * sigma_y**2)
        )
        np.maximum(heat[labels[k]], gauss, out=heat[labels[k]])
        heat[labels[k], row, column] = 1.0
        reach_x, reach_y = max(0.2 * w, 0.1), max(0.2 * h, 0.1)
        middle = (np.abs(x - (left + right) / 2) < reach_x)[None, :] & (
            np.abs(y - (top + bottom) / 2) < reach_y
        )[:, None]
        middle[row, column] = True
        rows, columns = np.nonzero(middle)
        sides[0, rows, columns] = np.maximum(x[columns] - left, 0.2)
        sides[1, rows, columns] = np.maximum(y[rows] - top, 0.2)
        sides[2, rows, columns] = np.maximum(right - x[columns], 0.2)
        sides[3, rows, columns] = np.maximum(bottom - y[rows], 0.2)
        weight[rows, columns] = 1.0 / np.sqrt(len(rows))
        care[row, column] = 1.0
    return {"heat": heat, "sides": sides, "side_weight": weight, "care": care}


def decode(
    scores: np.ndarray, distances: np.ndarray, threshold: float, most: int = 500
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Boxes (M, 4) px, scores (M,), classes (M,) of one image, best first, after NMS at 0.5.

    ``scores`` (classes, h, w), ``distances`` (4, h, w). Peaks are the maxima of 3 x 3 cells.
    """
    padded = np.pad(scores, ((0, 0), (1, 1), (1, 1)), constant_values=-1.0)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), axis=(1, 2))
    peaks = (scores >= windows.max(axis=(3, 4))) & (scores >= threshold)
    classes, rows, columns = np.nonzero(peaks)
    values = scores[classes, rows, columns]
    order = np.argsort(-values, kind="stable")[:most]
    classes, rows, columns, values = classes[order], rows[order], columns[order], values[order]
    x, y = STRIDE * (columns + 0.5), STRIDE * (rows + 0.5)
    d = distances[:, rows, columns]
    boxes = np.stack([x - d[0], y - d[1], x + d[2], y + d[3]], axis=1)
    kept = suppress(boxes, classes, 0.5)
    return boxes[kept], values[kept], classes[kept]


def iou(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Intersection over union of boxes (N, 4) and (M, 4): (N, M)."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    common = np.clip(high - low, 0, None).prod(axis=2)
    area_a = (a[:, 2:] - a[:, :2]).prod(axis=1)
    area_b = (b[:, 2:] - b[:, :2]).prod(axis=1)
    return common / np.maximum(area_a[:, None] + area_b[None] - common, 1e-9)


def suppress(boxes: np.ndarray, classes: np.ndarray, limit: float) -> np.ndarray:
    """Indices kept by non-maximum suppression per class; the boxes come best first."""
    overlaps = iou(boxes, boxes) * (classes[:, None] == classes[None])
    kept: list[int] = []
    for k in range(len(boxes)):
        if not kept or overlaps[k, kept].max() <= limit:
            kept.append(k)
    return np.array(kept, int)
