"""Anchors of RetinaNet: their places, their targets in training, and boxes from their outputs.

All numpy. Boxes and anchors are (left, top, right, bottom) in pixels of the network's input. Sizes,
thresholds and rounding are those under which the published COCO weights were trained (torchvision's
``retinanet_resnet50_fpn``), after Lin et al. 2017, arXiv:1708.02002.
"""

from __future__ import annotations

import math

import numpy as np

from training.targets import iou

SIZES_PX = (32, 64, 128, 256, 512)
"""Side of the smallest square anchor of each level."""
OCTAVES = (0.0, 1 / 3, 2 / 3)
RATIOS = (0.5, 1.0, 2.0)
"""Height over width."""
PER_CELL = len(OCTAVES) * len(RATIOS)
MULTIPLE_PX = 32
"""The input's sides are multiples of this."""
BACKGROUND, NEITHER = -1, -2
"""Kinds of anchors that show no object: one counts as background, the other not at all."""

_POSITIVE_IOU, _NEGATIVE_IOU = 0.5, 0.4
_IGNORED_SHARE = 0.5
_LARGEST_LOG = math.log(1000 / 16)
_LOWEST_SCORE = 0.05
_PER_LEVEL = 1000
_NMS_IOU = 0.5
_MOST = 300


def grids(size: tuple[int, int]) -> list[tuple[int, int]]:
    """(columns, rows) of each level for an input of ``size`` (W, H) px."""
    columns, rows = size[0] // 8, size[1] // 8
    found = []
    for _ in SIZES_PX:
        found.append((columns, rows))
        columns, rows = (columns + 1) // 2, (rows + 1) // 2
    return found


def anchors(size: tuple[int, int]) -> np.ndarray:
    """Anchors (A, 4) float32 of an input of ``size`` (W, H) px: levels, rows, columns, shapes.

    They sit on the cells' upper left corners, and a cell measures the whole pixels of input over
    cells, as the published weights expect.
    """
    ratio = np.sqrt(np.array(RATIOS))
    levels = []
    for side, (columns, rows) in zip(SIZES_PX, grids(size), strict=True):
        sides = np.array([int(side * 2**octave) for octave in OCTAVES])
        width, height = (sides / ratio[:, None]).ravel(), (sides * ratio[:, None]).ravel()
        shapes = np.round(np.stack([-width, -height, width, height], axis=1) / 2)
        x, y = np.meshgrid(np.arange(columns), np.arange(rows))
        corner = np.stack([x.ravel() * (size[0] // columns), y.ravel() * (size[1] // rows)], axis=1)
        levels.append((np.tile(corner, 2)[:, None] + shapes).reshape(-1, 4))
    return np.concatenate(levels).astype(np.float32)


def match(
    boxes: np.ndarray, labels: np.ndarray, places: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Kind (A,) and wanted deltas (A, 4) of each anchor.

    The kind is the label of the box that overlaps most if the IoU is at least 0.5, `NEITHER` from
    0.4, else `BACKGROUND`. The anchors that overlap a box most take part whatever their IoU, each
    with the box it overlaps most itself. Background that lies by more than half in a box of
    negative label is `NEITHER`.

    Parameters
    ----------
    boxes, labels
        (N, 4) and (N,); a negative label marks an area that is neither object nor background.
    places
        (A, 4) anchors.
    """
    truth, names = boxes[labels >= 0], labels[labels >= 0]
    overlap = np.zeros(len(places), np.float32)
    nearest = np.zeros(len(places), int)
    best = np.zeros(len(places), bool)
    for index, box in enumerate(truth):
        row = iou(box[None], places)[0]
        nearer = row > overlap
        overlap[nearer], nearest[nearer] = row[nearer], index
        best |= (row == row.max()) & (row > 0)
    kinds = np.full(len(places), BACKGROUND)
    kinds[overlap >= _NEGATIVE_IOU] = NEITHER
    positive = (overlap >= _POSITIVE_IOU) | best
    deltas = np.zeros((len(places), 4), np.float32)
    if len(truth):
        kinds[positive] = names[nearest[positive]]
        deltas[positive] = encode(truth[nearest[positive]], places[positive])
    area = (places[:, 2:] - places[:, :2]).prod(axis=1)
    for box in boxes[labels < 0]:
        sides = np.minimum(places[:, 2:], box[2:]) - np.maximum(places[:, :2], box[:2])
        inside = np.clip(sides, 0, None).prod(axis=1) > _IGNORED_SHARE * area
        kinds[inside & (kinds == BACKGROUND)] = NEITHER
    return kinds, deltas


def encode(boxes: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Deltas (N, 4) of boxes from anchors: shift over size and log of the ratio of the sizes."""
    extent = places[:, 2:] - places[:, :2]
    sides = boxes[:, 2:] - boxes[:, :2]
    shift = (boxes[:, :2] + boxes[:, 2:] - places[:, :2] - places[:, 2:]) / 2
    return np.concatenate([shift / extent, np.log(sides / extent)], axis=1)


def decode(deltas: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Boxes (N, 4) of deltas from anchors; the inverse of `encode` up to 62.5 times the anchor."""
    extent = places[:, 2:] - places[:, :2]
    centre = (places[:, :2] + places[:, 2:]) / 2 + deltas[:, :2] * extent
    half = np.exp(np.minimum(deltas[:, 2:], _LARGEST_LOG)) * extent / 2
    return np.concatenate([centre - half, centre + half], axis=1)


def detections(
    logits: np.ndarray, deltas: np.ndarray, size: tuple[int, int], seen: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Boxes (K, 4), scores (K,) and labels (K,), best first, of one picture.

    Of each level the 1000 best above a score of 0.05; of those, per label, what no better box
    overlaps by an IoU above 0.5; at most 300.

    Parameters
    ----------
    logits, deltas
        Outputs of the network, (A, labels) and (A, 4).
    size
        (W, H) px of the network's input.
    seen
        (W, H) px of the picture in it; boxes are clipped to it.
    """
    places = anchors(size)
    scores = 1 / (1 + np.exp(-logits.astype(np.float64)))
    chosen: list[np.ndarray] = []
    start = 0
    for columns, rows in grids(size):
        stop = start + columns * rows * PER_CELL
        level = scores[start:stop].ravel()
        found = np.flatnonzero(level > _LOWEST_SCORE)
        found = found[np.argsort(-level[found], kind="stable")[:_PER_LEVEL]]
        chosen.append(found + start * scores.shape[1])
        start = stop
    flat = np.concatenate(chosen)
    flat = flat[np.argsort(-scores.ravel()[flat], kind="stable")]
    anchor, label = np.divmod(flat, scores.shape[1])
    boxes = np.clip(decode(deltas[anchor].astype(np.float64), places[anchor]), 0, [*seen, *seen])
    kept = _not_suppressed(boxes, label)
    return boxes[kept], scores.ravel()[flat][kept], label[kept]


def _not_suppressed(boxes: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Indices that no better box of the same label suppresses; the best come first."""
    left = np.arange(len(boxes))
    kept: list[int] = []
    while len(left) and len(kept) < _MOST:
        first, left = left[0], left[1:]
        kept.append(int(first))
        clash = (iou(boxes[first][None], boxes[left])[0] > _NMS_IOU) & (
            labels[left] == labels[first]
        )
        left = left[~clash]
    return np.array(kept, int)
