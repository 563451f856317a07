"""One box per opening: no lights inside a window, no window twice, no halves beside a mullion.

Two boxes side by side, or one above the other, are lights of one opening if no more than a mullion
(a transom) can lie between them. Their gap says so, and whether their union is as large as other
windows of the facade are; wall that shows between them speaks against it. Of a window of many
lights the network often boxes the outer ones well and something in between: that is cut to the
lights between them.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from si3fp.config import MeasureConfig
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections, OrthoImage
from si3fp.windows.fuse import FusedDetections

NESTED_SHARE = 0.8
NESTED_SCORE = 0.7
TWICE_SHARE = 0.3
"""Share of the smaller of two boxes from which their overlap makes them one window."""
ALIGNED_M = 0.05
"""Tops and bottoms of two lights differ by no more, besides their uncertainty."""
ALIKE = 0.15
"""Windows are of one size if width and height differ by less than this share."""
WALL_DISTANCE_M = (0.15, 0.4)
"""Where beside a pair the wall is looked at: beyond its surround."""
WALL_COLOUR = 12.0
"""Difference in 8-bit CIE Lab below which a strip looks like the wall."""
WALL_LOG_ODDS = -4.0


def join_openings(
    found: FusedDetections, image: OrthoImage, m_per_px: float, config: MeasureConfig
) -> FusedDetections:
    """The openings that the boxes show, best first.

    Parameters
    ----------
    found
        Windows in pixels of the image.
    image
        The fused orthophoto.
    m_per_px
        Its resolution.
    config
        Width of a mullion, uncertainty of a side where the network does not tell it.
    """
    lab = cv2.cvtColor(image.rgb, cv2.COLOR_RGB2LAB).astype(np.float64)
    found = found.select(_not_nested(found.detections))
    found = _without_overlaps(_cut_between(found, lab, image.valid, m_per_px, config))
    for axis in (0, 1):
        found = _joined_along(axis, found, lab, image.valid, m_per_px, config)
    return found.select(np.argsort(-found.detections.scores, kind="stable"))


def _not_nested(detections: Detections) -> NDArray[np.int_]:
    """Indices, best first, without boxes inside another: the lights of a window are no windows.

    Of a box and what lies in it, the outer one stays unless its score is much lower.
    """
    boxes, scores = detections.boxes_px, detections.scores
    common = _common_area(boxes)
    area = np.prod(boxes[:, 2:] - boxes[:, :2], axis=-1)
    # inside[i, j]: most of i lies in j, which is larger.
    inside = (common > NESTED_SHARE * area[:, None]) & (area[:, None] < area[None])
    dropped = np.zeros(len(boxes), bool)
    for outer in np.argsort(-area, kind="stable"):
        inner = np.flatnonzero(inside[:, outer] & ~dropped)
        if not len(inner) or dropped[outer]:
            continue
        if scores[outer] >= NESTED_SCORE * scores[inner].max():
            dropped[inner] = True
        else:
            dropped[outer] = True
    order = np.argsort(-scores, kind="stable")
    return order[~dropped[order]]


def _cut_between(
    found: FusedDetections,
    lab: FloatArray,
    valid: NDArray[np.bool_],
    m_per_px: float,
    config: MeasureConfig,
) -> FusedDetections:
    """The same boxes; one with blurred ends between two others is cut to what lies between them.

    It overlaps both, as far as the uncertainty of its ends explains, and has their top and
    bottom; it would be dropped as a window that is there twice, and the lights it shows be lost.
    Wall that shows between the two keeps it from being cut.
    """
    detections = found.detections
    boxes, sigma = detections.boxes_px.copy(), detections.edge_sigma_px.copy()
    reach = 2 * _sigma_m(detections, m_per_px, config) / m_per_px
    aligned = _aligned(0, detections, m_per_px, config)
    left, right = detections.boxes_px[:, 0], detections.boxes_px[:, 2]
    for k in range(len(boxes)):
        before = aligned[k] & (left < left[k]) & (right > left[k]) & (right < left[k] + reach[k, 0])
        after = aligned[k] & (right > right[k]) & (left < right[k])
        after &= left > right[k] - reach[k, 2]
        if not (before.any() and after.any()):
            continue
        i, j = np.flatnonzero(before)[0], np.flatnonzero(after)[0]
        one, other = detections.boxes_px[i], detections.boxes_px[j]
        if one[2] < other[0] and not _wall_between(0, one, other, lab, valid, m_per_px):
            boxes[k, [0, 2]] = right[i], left[j]
            sigma[k, [0, 2]] = sigma[i, 2], sigma[j, 0]
    cut = Detections(boxes, detections.scores, detections.labels, sigma)
    return FusedDetections(cut, found.views, found.notes)


def _without_overlaps(found: FusedDetections) -> FusedDetections:
    """Without what overlaps with a better box: windows do not overlap, so it is there twice."""
    boxes = found.detections.boxes_px
    area = np.prod(boxes[:, 2:] - boxes[:, :2], axis=-1)
    twice = _common_area(boxes) > TWICE_SHARE * np.minimum(area[:, None], area[None])
    kept: list[int] = []
    for index in range(len(boxes)):
        if not twice[index, kept].any():
            kept.append(index)
    return found.select(np.array(kept, dtype=np.int_))


def _common_area(boxes: FloatArray) -> FloatArray:
    low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
    area: FloatArray = np.prod(np.clip(high - low, 0, None), axis=-1)
    return area


def _joined_along(
    axis: int,
    found: FusedDetections,
    lab: FloatArray,
    valid: NDArray[np.bool_],
    m_per_px: float,
    config: MeasureConfig,
) -> FusedDetections:
    """Lights side by side (axis 0) or one above the other (axis 1) as one; best pairs first."""
    single: NDArray[np.bool_] | None = None
    sizes = np.zeros((0, 2))
    while len(found.detections) > 1:
        boxes = found.detections.boxes_px
        gap, gap_sigma = _gaps(axis, found.detections, m_per_px, config)
        near = np.isfinite(gap)
        if single is None:
            # Windows without a neighbour so near show what sizes the facade has.
            single = np.logical_not(near.any(axis=0) | near.any(axis=1))
            sizes = (boxes[:, 2:] - boxes[:, :2])[single]
        best, pair = 0.0, (-1, -1)
        for i, j in np.argwhere(near).tolist():
            margin = (config.mullion_m - gap[i, j]) / gap_sigma[i, j]
            odds = float(log_ndtr(margin) - log_ndtr(-margin))
            odds += _repetition(boxes[i], boxes[j], sizes)
            if _wall_between(axis, boxes[i], boxes[j], lab, valid, m_per_px):
                odds += WALL_LOG_ODDS
            if odds > best:
                best, pair = odds, (i, j)
        if best == 0.0:
            break
        found = _merged(axis, found, *pair, gap_m=float(gap[pair]))
    return found


def _gaps(
    axis: int, detections: Detections, m_per_px: float, config: MeasureConfig
) -> tuple[FloatArray, FloatArray]:
    """Gap (N, N) in metres from each box to its next in the axis, and its standard deviation.

    Infinite where the boxes are not aligned across the axis or the gap is out of the question.
    """
    boxes = detections.boxes_px * m_per_px
    sigma = _sigma_m(detections, m_per_px, config)
    low, high = axis, axis + 2
    gap = boxes[None, :, low] - boxes[:, None, high]
    gap_sigma = np.hypot(sigma[None, :, low], sigma[:, None, high])
    possible = (gap < config.mullion_m + 2 * gap_sigma) & (gap > -config.mullion_m - 2 * gap_sigma)
    possible &= _aligned(axis, detections, m_per_px, config)
    # Of two boxes, the second begins beyond the middle of the first.
    possible &= boxes[None, :, low] > (boxes[:, None, low] + boxes[:, None, high]) / 2
    return np.where(possible, gap, np.inf), gap_sigma


def _aligned(
    axis: int, detections: Detections, m_per_px: float, config: MeasureConfig
) -> NDArray[np.bool_]:
    """Whether two boxes (N, N) begin and end at the same places across the axis."""
    boxes = detections.boxes_px * m_per_px
    sigma = _sigma_m(detections, m_per_px, config)
    aligned = np.ones((len(boxes), len(boxes)), bool)
    for side in (1 - axis, 3 - axis):
        tolerance = ALIGNED_M + np.hypot(sigma[:, None, side], sigma[None, :, side])
        aligned &= np.abs(boxes[:, None, side] - boxes[None, :, side]) < tolerance
    return aligned


def _sigma_m(detections: Detections, m_per_px: float, config: MeasureConfig) -> FloatArray:
    """Standard deviations (N, 4) of the sides in metres, the usual one where none is told."""
    sigma = detections.edge_sigma_px * m_per_px
    return np.where(sigma > 0, sigma, config.box_sigma_m)


def _repetition(first: FloatArray, second: FloatArray, sizes: FloatArray) -> float:
    """Log odds: how many single windows are as large as the union, and as one of the two."""
    union = np.maximum(first[2:], second[2:]) - np.minimum(first[:2], second[:2])

    def alike(size: FloatArray) -> NDArray[np.bool_]:
        return np.asarray((np.abs(np.log(sizes / size)) < ALIKE).all(axis=1))

    half = alike(first[2:] - first[:2]) | alike(second[2:] - second[:2])
    return float(np.log((alike(union).sum() + 1) / (half.sum() + 1)))


def _wall_between(
    axis: int,
    first: FloatArray,
    second: FloatArray,
    lab: FloatArray,
    valid: NDArray[np.bool_],
    m_per_px: float,
) -> bool:
    """Whether what lies between two boxes looks like the wall beside them and unlike them."""
    if axis == 1:
        first, second = first[[1, 0, 3, 2]], second[[1, 0, 3, 2]]
        lab, valid = lab.swapaxes(0, 1), valid.T
    rows = (max(first[1], second[1]), min(first[3], second[3]))
    near, far = (distance / m_per_px for distance in WALL_DISTANCE_M)

    def colour(spans: list[tuple[float, float]]) -> FloatArray:
        part = slice(max(int(np.ceil(rows[0])), 0), max(int(rows[1]), 0))
        seen = [
            lab[part, max(int(np.ceil(a)), 0) : max(int(b), 0)][
                valid[part, max(int(np.ceil(a)), 0) : max(int(b), 0)]
            ]
            for a, b in spans
        ]
        pixels = np.concatenate(seen)
        return np.median(pixels, axis=0) if len(pixels) else np.full(3, np.nan)

    strip = colour([(first[2], second[0])])
    wall = colour([(first[0] - far, first[0] - near), (second[2] + near, second[2] + far)])
    panes = colour([(first[0], first[2]), (second[0], second[2])])
    to_wall = float(np.linalg.norm(strip - wall))
    return to_wall < WALL_COLOUR and to_wall < 0.5 * float(np.linalg.norm(panes - wall))


def _merged(axis: int, found: FusedDetections, i: int, j: int, gap_m: float) -> FusedDetections:
    """The list with box j, which follows box i in the axis, taken into box i."""
    boxes, sigma = found.detections.boxes_px.copy(), found.detections.edge_sigma_px.copy()
    scores = found.detections.scores.copy()
    union = np.concatenate(
        [np.minimum(boxes[i, :2], boxes[j, :2]), np.maximum(boxes[i, 2:], boxes[j, 2:])]
    )
    from_j = union != boxes[i]
    boxes[i], sigma[i] = union, np.where(from_j, sigma[j], sigma[i])
    scores[i] = max(scores[i], scores[j])
    views, notes = list(found.views), list(found.notes)
    views[i] = tuple(sorted({*views[i], *views[j]}))
    kind = ("mullion", "transom")[axis]
    notes[i] = f"lights joined across a {kind} of {max(gap_m, 0):.2f} m"
    joined = Detections(boxes, scores, found.detections.labels, sigma)
    rest = np.array([k for k in range(len(notes)) if k != j], dtype=np.int_)
    return FusedDetections(joined, tuple(views), tuple(notes)).select(rest)
