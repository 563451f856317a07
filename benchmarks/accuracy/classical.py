"""Windows without learning: rectangles whose four sides are edges and whose inside is not wall.

The baseline that a trained detector has to beat. Its few constants were chosen on training pictures
(rectified HSLU, SPB), never on validation pictures.
"""

from __future__ import annotations

from itertools import product

import cv2
import numpy as np

WORKING_M_PER_PX = 0.03
THRESHOLD = 0.059
"""Score from which a box is taken for a window: the best F1 on the training pictures."""
SIZES_M = (0.3, 2.4)
SIZE_STEPS = 16
LARGEST_RATIO = 3.0
STRIDE_PX = 2
REACH_PX = 2
"""How far a side may be from its edge before it is moved there."""
USUAL_EDGE_M = 3.0
"""Side of the square whose mean gradient is the usual one."""
LEAST_EDGE = 0.6
"""Gradient that the weaker sides need, as a multiple of the usual one."""
MOST = 8000
"""Candidates that are looked at more closely."""
WALL_M = 2.0
"""Side of the square whose median colour is the wall's."""
LARGEST_DISTANCE = 60.0
RING_M = 0.15
HALF_EDGE, HALF_CONTRAST = 2.0, 6.0
"""Gradient (times the usual one) that scores 0.5, and Lab distance that noise makes."""
USUAL_M2, USUAL_SPREAD = 1.6, 0.8
"""Area of a window with its frame and surround, and standard deviation of its logarithm."""
NMS_SHARE = 0.4


def find_windows(rgb: np.ndarray, m_per_px: float) -> tuple[np.ndarray, np.ndarray]:
    """Boxes (N, 4) x0 y0 x1 y1 in pixels and scores (N,) in 0 to 1, best first.

    Parameters
    ----------
    rgb
        Orthographic picture, (H, W, 3) uint8, black where nothing is known.
    m_per_px
        Its resolution.
    """
    scale = m_per_px / WORKING_M_PER_PX
    size = max(1, round(rgb.shape[1] * scale)), max(1, round(rgb.shape[0] * scale))
    small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    lab = cv2.cvtColor(cv2.GaussianBlur(small, (0, 0), 0.7), cv2.COLOR_RGB2LAB).astype(np.float32)
    # The border of what is known is no edge.
    known = cv2.erode((small.max(axis=2) > 0).astype(np.uint8), np.ones((5, 5), np.uint8))
    across, down = (
        np.abs(cv2.Sobel(lab, cv2.CV_32F, *order, scale=0.25)).max(axis=2) * known
        for order in ((1, 0), (0, 1))
    )
    # Among leaves an edge means less than on plaster, in the dark more than by day.
    side = round(USUAL_EDGE_M / WORKING_M_PER_PX)
    usual = cv2.blur(across + down, (side, side)) + 1.0
    across, down = across / usual, down / usual
    boxes = _candidates(across, down)
    boxes, strength = _snapped(boxes, across, down)
    scores = strength / (strength + HALF_EDGE) * _contrast(boxes, _wall_distance(lab, known))
    scores *= _usual_size(boxes)
    scores *= 0.5 + 0.5 * _company(boxes, scores)
    kept = _suppressed(boxes, scores)
    per_pixel = np.array([rgb.shape[1] / size[0], rgb.shape[0] / size[1]] * 2)
    return boxes[kept] * per_pixel, scores[kept]


def _candidates(across: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Boxes (N, 4) of all sizes and places whose four sides lie near edges, in whole pixels."""
    reach = 2 * REACH_PX + 1
    columns = _sums(cv2.dilate(across, np.ones((1, reach), np.uint8)))
    rows = _sums(cv2.dilate(down, np.ones((reach, 1), np.uint8)).T).T
    height, width = across.shape
    low, high = np.array(SIZES_M) / WORKING_M_PER_PX
    sizes = np.unique(np.geomspace(low, high, SIZE_STEPS).astype(int))
    boxes, strengths = [np.zeros((0, 4), int)], [np.zeros(0, np.float32)]
    for w, h in product(sizes, sizes):
        if not 1 / LARGEST_RATIO <= w / h <= LARGEST_RATIO or w >= width or h >= height:
            continue
        step = slice(None, None, STRIDE_PX)
        upright = ((columns[h:] - columns[:-h]) / h)[:-1][step]
        level = ((rows[:, w:] - rows[:, :-w]) / w)[:, :-1][:, step]
        left, right = upright[:, :-w][:, step], upright[:, w:][:, step]
        top, bottom = level[:-h][step], level[h:][step]
        strength = _weaker(left, top, right, bottom)
        peak = strength >= cv2.dilate(strength, np.ones((3, 3), np.uint8))
        y, x = np.nonzero(peak & (strength > LEAST_EDGE))
        corner = np.stack([x, y], axis=1) * STRIDE_PX
        boxes.append(np.concatenate([corner, corner + np.array([w, h])], axis=1))
        strengths.append(strength[y, x])
    best = np.argsort(-np.concatenate(strengths), kind="stable")[:MOST]
    return np.concatenate(boxes)[best]


def _sums(gradient: np.ndarray) -> np.ndarray:
    """Running sums down the columns (H + 1, W)."""
    return np.pad(np.cumsum(gradient, axis=0, dtype=np.float32), ((1, 0), (0, 0)))


def _weaker(*sides: np.ndarray) -> np.ndarray:
    """Geometric mean of the weaker upright and the weaker level side's gradient."""
    left, top, right, bottom = sides
    return np.sqrt(np.minimum(left, right) * np.minimum(top, bottom))


def _snapped(
    boxes: np.ndarray, across: np.ndarray, down: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Boxes with each side on the strongest edge within reach, and their weaker gradients (N,)."""
    moved, strengths = boxes.copy(), []
    for side in range(4):
        gradient = across if side % 2 == 0 else down.T
        sums = _sums(gradient)
        start, stop = boxes[:, 1 - side % 2, None], boxes[:, 3 - side % 2, None]
        # A side between pixels k - 1 and k has its gradient on both.
        near = boxes[:, side, None] + np.arange(-REACH_PX, REACH_PX + 1)
        both = np.clip(near, 1, gradient.shape[1] - 1)
        total = sums[stop, both] - sums[start, both] + sums[stop, both - 1] - sums[start, both - 1]
        best = total.argmax(axis=1)[:, None]
        moved[:, side] = np.take_along_axis(both, best, axis=1)[:, 0]
        strengths.append(np.take_along_axis(total / 2 / (stop - start), best, axis=1)[:, 0])
    return moved, _weaker(*strengths)


def _wall_distance(lab: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Lab distance (H, W) of the pixels from the wall, the median colour of their surroundings."""
    side = round(WALL_M / WORKING_M_PER_PX) // 4 * 2 + 1
    half = cv2.resize(lab.astype(np.uint8), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    wall = cv2.resize(cv2.medianBlur(half, side), lab.shape[1::-1])
    return np.minimum(np.linalg.norm(lab - wall, axis=2), LARGEST_DISTANCE) * known


def _contrast(boxes: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """How much less the inside is like the wall than the ring around it (N,), 0 to 1."""
    height, width = distance.shape
    sums = cv2.integral(distance, sdepth=cv2.CV_64F)

    def total(x0: np.ndarray, y0: np.ndarray, x1: np.ndarray, y1: np.ndarray) -> np.ndarray:
        return sums[y1, x1] - sums[y0, x1] - sums[y1, x0] + sums[y0, x0]

    ring = round(RING_M / WORKING_M_PER_PX)
    outer = np.clip(boxes + np.array([-ring, -ring, ring, ring]), 0, [width, height, width, height])
    area, whole = ((b[:, 2:] - b[:, :2]).prod(axis=1) for b in (boxes, outer))
    inside = total(*boxes.T) / area
    around = (total(*outer.T) - total(*boxes.T)) / np.maximum(whole - area, 1)
    return np.clip((inside - around) / (inside + around + HALF_CONTRAST), 0, None)


def _usual_size(boxes: np.ndarray) -> np.ndarray:
    """How usual a window of this area is (N,), 0 to 1: log-normal."""
    area = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1) * WORKING_M_PER_PX**2
    return np.exp(-0.5 * (np.log(area / USUAL_M2) / USUAL_SPREAD) ** 2)


def _company(boxes: np.ndarray, scores: np.ndarray) -> np.ndarray:
    """How many others of its size stand in its row or column (N,), 0 for none, towards 1."""
    kept = _suppressed(boxes, scores)
    kept = kept[scores[kept] > 0.5 * THRESHOLD]
    centre, size = (boxes[:, :2] + boxes[:, 2:]) / 2, boxes[:, 2:] - boxes[:, :2]
    apart = np.abs(centre[:, None] - centre[kept]) / size[:, None]
    alike = np.abs(np.log(size[:, None] / size[kept])).max(axis=2) < 0.2
    aligned = (apart.min(axis=2) < 0.12) & (apart.max(axis=2) > 1.0)
    return 1 - np.exp(-(alike & aligned).sum(axis=1) / 2)


def _suppressed(boxes: np.ndarray, scores: np.ndarray) -> np.ndarray:
    """Indices of the boxes that share little with any better one, best first."""
    areas = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1)
    left = np.argsort(-scores, kind="stable")
    kept = []
    while len(left):
        best, left = left[0], left[1:]
        kept.append(int(best))
        low = np.maximum(boxes[best, :2], boxes[left, :2])
        high = np.minimum(boxes[best, 2:], boxes[left, 2:])
        common = np.clip(high - low, 0, None).prod(axis=1)
        left = left[common <= NMS_SHARE * np.minimum(areas[best], areas[left])]
    return np.array(kept, int)
