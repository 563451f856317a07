"""Geometric and photometric augmentation: one warp from the cached picture to the crop."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from training.data import IGNORE, NOMINAL_HEIGHT, Facade, bounds, median_height, warp_points

_MIN_SIDE = 6.0
_MIN_FILL = {0: 0.72, 1: 0.55}


@dataclass
class Sample:
    """A crop: RGB uint8 (H, W, 3), boxes (N, 4) left, top, right, bottom in its pixels, labels
    (N,) with IGNORE for areas that must neither attract nor repel detections."""

    image: np.ndarray
    boxes: np.ndarray
    labels: np.ndarray


def translation(x: float, y: float) -> np.ndarray:
    """3 x 3 matrix of a shift in pixels."""
    return np.array([[1, 0, x], [0, 1, y], [0, 0, 1.0]])


def scaling(x: float, y: float) -> np.ndarray:
    """3 x 3 matrix of a scaling about the origin."""
    return np.diag([x, y, 1.0])


def warp_image(
    facade: Facade, matrix: np.ndarray, size: tuple[int, int], border: int = 0
) -> np.ndarray:
    """Picture under a homography of pixel-edge coordinates, (H, W, 3); ``size`` is (W, H).

    The pyramid level is chosen so that the warp shrinks by less than two. Places behind the
    horizon or outside the picture get the ``border`` value.
    """
    width, height = size
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], float)
    inverse = np.linalg.inv(matrix)
    back = corners @ inverse[:, :2].T + inverse[:, 2]
    area = float(width * height)
    if np.all(back[:, 2] > 1e-9):
        ring = (back[:, :2] / back[:, 2:]).astype(np.float32)
        area = max(abs(cv2.contourArea(ring)), 1.0)
    shrink = np.sqrt(area / (width * height))
    level = int(np.clip(np.floor(np.log2(max(shrink, 1.0)) + 0.35), 0, len(facade.levels) - 1))
    source = facade.levels[level]
    ratio_x = facade.levels[0].shape[1] / source.shape[1]
    ratio_y = facade.levels[0].shape[0] / source.shape[0]
    full = matrix @ scaling(ratio_x, ratio_y)
    centred = translation(-0.5, -0.5) @ full @ translation(0.5, 0.5)
    warped = cv2.warpPerspective(
        source, centred, (width, height), flags=cv2.INTER_LINEAR, borderValue=(border,) * 3
    )
    if np.any(back[:, 2] <= 1e-9):
        yy, xx = np.mgrid[0:height, 0:width] + 0.5
        behind = xx * inverse[2, 0] + yy * inverse[2, 1] + inverse[2, 2] <= 1e-9
        warped[behind] = border
    return warped


def warp_boxes(
    facade: Facade, matrix: np.ndarray, size: tuple[int, int], upright: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Boxes (N, 4) and labels (N,) of the polygons after the homography, clipped to the crop.

    A polygon with less than 40 % of its box inside, smaller than 6 px, or (``upright``: the crop
    shows a rectified facade) far from filling its box becomes IGNORE.
    """
    boxes, labels = [], []
    limit = np.array([size[0], size[1], size[0], size[1]], float)
    for polygon, original in zip(facade.polygons, facade.labels, strict=True):
        label = original
        points = warp_points(matrix, polygon)
        if points is None:
            continue
        box = bounds(points)
        inside = np.clip(box, 0, limit)
        w, h = inside[2] - inside[0], inside[3] - inside[1]
        if w < 1 or h < 1:
            continue
        area = float((box[2] - box[0]) * (box[3] - box[1]))
        if label != IGNORE:
            fill = abs(cv2.contourArea(points.astype(np.float32))) / area
            skewed = upright and fill < _MIN_FILL[int(label)]
            if w * h < 0.4 * area or min(w, h) < _MIN_SIDE or skewed:
                label = IGNORE
        boxes.append(inside)
        labels.append(label)
    return np.array(boxes, float).reshape(-1, 4), np.array(labels, int)


def random_crop(facade: Facade, size: tuple[int, int], rng: np.random.Generator) -> Sample:
    """A random crop of ``size`` (W, H) px at a random scale and view, colours as they are."""
    for _ in range(8):
        placed = _random_matrix(facade, size, rng)
        if placed is not None:
            break
    else:
        scale = NOMINAL_HEIGHT / max(median_height(facade), 1.0)
        placed = scaling(scale, scale), False
    matrix, upright = placed
    border = 0 if rng.random() < 0.7 else int(rng.integers(0, 256))
    image = warp_image(facade, matrix, size, border)
    boxes, labels = warp_boxes(facade, matrix, size, upright)
    return Sample(image, boxes, labels)


def _random_matrix(
    facade: Facade, size: tuple[int, int], rng: np.random.Generator
) -> tuple[np.ndarray, bool] | None:
    upright = bool(facade.rectifications) and rng.random() < 0.7
    matrix = np.eye(3)
    if upright:
        matrix = facade.rectifications[rng.integers(len(facade.rectifications))]
    height, width = facade.levels[0].shape[:2]
    centre = warp_points(matrix, np.array([[width / 2, height / 2]]))
    middle = np.zeros(2) if centre is None else centre[0]
    angle = np.radians(rng.uniform(-3, 3) if rng.random() < 0.5 else 0.0)
    shear = rng.normal(0, 0.02, 2)
    local = np.array(
        [
            [np.cos(angle), -np.sin(angle) + shear[0], 0],
            [np.sin(angle) + shear[1], np.cos(angle), 0],
            [0, 0, 1],
        ]
    )
    if rng.random() < 0.5:
        tilt = 0.12 if not upright else 0.05
        local[2, :2] = rng.normal(0, tilt, 2) / max(width, height)
    stretch = np.exp(rng.uniform(-0.18, 0.18))
    flip = -1.0 if rng.random() < 0.5 else 1.0
    view = scaling(flip * stretch, 1.0) @ local @ translation(*-middle) @ matrix
    unit = median_height(facade, view)
    if unit <= 0:
        return None
    factor = np.exp(rng.uniform(np.log(0.55), np.log(1.7)))
    scale = NOMINAL_HEIGHT * factor / unit
    view = scaling(scale, scale) @ view
    polygons = [p for p, label in zip(facade.polygons, facade.labels, strict=True) if label == 0]
    anchor = warp_points(view, polygons[rng.integers(len(polygons))])
    if anchor is None:
        return None
    box = bounds(anchor)
    if not 8 < box[3] - box[1] < 3.5 * NOMINAL_HEIGHT * factor:
        return None
    corner = (box[:2] + box[2:]) / 2 - rng.uniform(0.1, 0.9, 2) * size
    if rng.random() < 0.85:
        low, high = _content(facade, view)
        room = high - low - size
        held = np.clip(corner, low, low + np.maximum(room, 0))
        loose = low + np.minimum(room, 0) * rng.random(2)
        corner = np.where(room > 0, held, loose)
    return translation(*-corner) @ view, upright


def _content(facade: Facade, view: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner (2,) of what is worth seeing: the picture near its windows."""
    height, width = facade.levels[0].shape[:2]
    points = [
        p
        for polygon, label in zip(facade.polygons, facade.labels, strict=True)
        if label == 0 and (p := warp_points(view, polygon)) is not None
    ]
    box = bounds(np.concatenate(points))
    margin = 2.0 * float(np.median([np.ptp(p[:, 1]) for p in points]))
    low, high = box[:2] - margin, box[2:] + margin
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], float)
    frame = warp_points(view, corners)
    if frame is not None:
        low, high = np.maximum(low, frame.min(axis=0)), np.minimum(high, frame.max(axis=0))
    return low, high
