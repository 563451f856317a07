"""M.1: solid fronts of balconies that the detector found, where no depth tells them.

A balcony repeats in its column: one that the detector is sure of speaks for weaker ones above and
below. Openings that show below the upper edge of a front, through bars or glass, speak against a
front that hides anything (docs/decisions/0018-openings-behind-balconies.md).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from si3fp.geometry.boxes import iou_matrix
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections
from si3fp.windows.depth import part_of

REPEATED_SCORE = 0.1
"""Score from which a balcony counts that stands above or below a sure one."""
REPEATED_IOU = 0.6
"""Such a one spans the same part of the facade, in one dimension."""
HIDDEN_M = 0.3
"""Openings that end so near to the upper edge are cut by the front; what goes on shows through."""
STANDS_OUT_SIGMA_M = 0.3
"""A front stands 1 to 1.5 m before the wall: seen from the street, it lies off its place on it."""
HALF = 0.5


def hiding_fronts(
    balconies: Detections, openings_px: FloatArray, sure_score: float, m_per_px: float
) -> Detections:
    """The balconies whose fronts hide what is behind them, with the deviation of their lower edge.

    Parameters
    ----------
    balconies
        All of the detector, however weak.
    openings_px
        (N, 4) boxes of windows and doors.
    sure_score
        Score from which a balcony needs no other.
    m_per_px
        Resolution.

    Notes
    -----
    Balconies of one column are alike: solid if more openings end at their upper edges than go on
    farther down behind them.
    """
    boxes = balconies.boxes_px
    column = _spans_iou(boxes, boxes) > REPEATED_IOU
    sure = balconies.scores >= sure_score
    twice = (iou_matrix(boxes, boxes) > 0) & sure
    repeated = (balconies.scores >= REPEATED_SCORE) & (column & sure).any(axis=1)
    found = sure | (repeated & ~twice.any(axis=1))
    column &= found
    top, bottom = boxes[:, None, 1], boxes[:, None, 3]
    o_top, o_bottom = openings_px[None, :, 1], openings_px[None, :, 3]
    behind = (
        _in_span(boxes, openings_px) & (o_top < top) & (o_bottom < bottom + HIDDEN_M / m_per_px)
    )
    below_m = (o_bottom - top) * m_per_px
    cut = (behind & (np.abs(below_m) < HIDDEN_M)).sum(axis=1)
    shows = (behind & (below_m > HIDDEN_M)).sum(axis=1)
    solid = found & (column @ cut > column @ shows)
    fronts = balconies.select(np.flatnonzero(solid))
    sigma = np.tile([0.0, 0.0, 0.0, STANDS_OUT_SIGMA_M / m_per_px], (len(fronts), 1))
    return Detections(fronts.boxes_px, fronts.scores, fronts.labels, sigma)


def hidden_by(fronts: Detections, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """(H, W) what the fronts cover."""
    covered = np.zeros(shape, np.bool_)
    for box in fronts.boxes_px:
        covered[part_of(box)] = True
    return covered


def in_columns(fronts: Detections, boxes_px: FloatArray) -> NDArray[np.bool_]:
    """(N,) whether boxes (N, 4) lie behind one of the fronts, or above or below one."""
    return np.asarray(_in_span(fronts.boxes_px, boxes_px).any(axis=0))


def _in_span(fronts_px: FloatArray, boxes_px: FloatArray) -> NDArray[np.bool_]:
    """(M, N) whether fronts (M, 4) are as wide as more than half of each box (N, 4)."""
    low = np.maximum(fronts_px[:, None, 0], boxes_px[None, :, 0])
    high = np.minimum(fronts_px[:, None, 2], boxes_px[None, :, 2])
    return np.asarray(high - low > HALF * (boxes_px[:, 2] - boxes_px[:, 0]))


def _spans_iou(first: FloatArray, second: FloatArray) -> FloatArray:
    """(N, M) intersection over union of the widths of boxes (N, 4) and (M, 4)."""
    flat = [
        np.stack([box[:, 0], np.zeros(len(box)), box[:, 2], np.ones(len(box))], axis=1)
        for box in (first, second)
    ]
    return iou_matrix(flat[0], flat[1])
