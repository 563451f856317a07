"""M.1: which of the panes above a rail is the door, where nothing below tells it.

A door of one leaf is one pane as wide as a door, at one end of the frame. Between panes stand
posts: there colours change from left to right, within a pane hardly
(docs/decisions/0019-what-slabs-hide.md).
"""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np

from si3fp.geometry.rigid import FloatArray
from si3fp.windows.balcony_sills import BESIDE_M, LEAST_WINDOW_M

DOOR_M = (0.7, 1.05)
"""Width of doors of one leaf."""
NARROWER_M = 0.08
"""Of two panes, one each of a door and a window, the door's is narrower by so much or more."""
HEAD_M = (0.12, 0.9)
"""What shows above a rail lies so far below the heads."""
BELOW_M = (0.1, 0.35)
"""Where below what shows of a frame the front is told from the wall."""
LEAST_CONTRAST = 14.0
"""How far the front differs from the wall, at least; in 8-bit CIE Lab."""
SAME_SIDE_M = 0.1
"""Sides of one column lie no farther apart."""
SMOOTH_M = 0.12
LEAST_PANE_M = 0.12
"""Glass between two bars is so wide; the gap between the frames of door and window is not."""
LEAST_BOXES = 2


def door_by_posts(
    boxes_px: FloatArray, lab: FloatArray, m_per_px: float
) -> tuple[bool, float] | None:
    """Whether the door is on the left, and its width in m; None where the panes do not tell.

    Parameters
    ----------
    boxes_px
        (N, 4) frames of one column.
    lab
        (H, W, 3) the facade in CIE Lab.
    m_per_px
        Its resolution.

    Notes
    -----
    It must be a frame behind a front: what shows below it is not the wall that shows beside it.
    Storeys differ in curtains and reflections, not in posts: their mean decides. The pane at one
    end must be as wide as a door, and that at the other not. Where both are, of two panes the
    narrower is the door, and more panes do not tell.
    """
    contrasts = [_contrast_below(box, lab, m_per_px) for box in boxes_px]
    if len(boxes_px) < LEAST_BOXES or np.median(contrasts) < LEAST_CONTRAST:
        return None
    left, right = np.median(boxes_px[:, [0, 2]], axis=0)
    off_m = np.abs(boxes_px[:, [0, 2]] - [left, right]).max(axis=1) * m_per_px
    changes = [
        change
        for box in boxes_px[off_m < SAME_SIDE_M]
        if (change := _changes(box, (round(left), round(right)), lab, m_per_px)) is not None
    ]
    if len(changes) < LEAST_BOXES:
        return None
    posts = _posts(np.mean(changes, axis=0), m_per_px)
    if not len(posts):
        return None
    wide_m = (round(right) - round(left)) * m_per_px
    ends_m = np.array([posts[0], wide_m - posts[-1]])
    fits = (ends_m >= DOOR_M[0]) & (ends_m <= DOOR_M[1]) & (wide_m - ends_m >= LEAST_WINDOW_M)
    if fits.all() and (len(posts) > 1 or np.ptp(ends_m) < NARROWER_M):
        return None
    if not fits.any():
        return None
    door = int(np.where(fits, ends_m, np.inf).argmin())
    return door == 0, float(ends_m[door])


def _contrast_below(box_px: FloatArray, lab: FloatArray, m_per_px: float) -> float:
    """How far the colour below a box differs from that beside it; 0 where the picture ends."""
    left, top, right, bottom = box_px

    def colours(x: tuple[float, float], y: tuple[float, float]) -> FloatArray:
        (x0, x1), (y0, y1) = ([max(round(each), 0) for each in pair] for pair in (x, y))
        return np.asarray(lab[y0:y1, x0:x1].reshape(-1, 3))

    near, far = (each / m_per_px for each in BESIDE_M)
    sides = ((left - far, left - near), (right + near, right + far))
    beside = np.concatenate([colours(side, (top, bottom)) for side in sides])
    below = colours((left, right), (bottom + BELOW_M[0] / m_per_px, bottom + BELOW_M[1] / m_per_px))
    if not len(beside) or not len(below):
        return 0.0
    return float(np.linalg.norm(np.median(below, axis=0) - np.median(beside, axis=0)))


def _changes(
    box_px: FloatArray, sides: tuple[int, int], lab: FloatArray, m_per_px: float
) -> FloatArray | None:
    """(W,) how much colours change from left to right at the columns of a frame; mean 1."""
    top = round(box_px[1] + HEAD_M[0] / m_per_px)
    bottom = round(min(box_px[3], box_px[1] + HEAD_M[1] / m_per_px))
    part = lab[max(top, 0) : bottom, max(sides[0], 0) : sides[1]]
    if part.shape[0] < 2 or part.shape[1] != sides[1] - sides[0]:
        return None
    smooth = cv2.GaussianBlur(part, (0, 0), 1.0)
    change = np.linalg.norm(np.gradient(smooth, axis=1), axis=2).mean(axis=0)
    return np.asarray(change / max(float(change.mean()), 1e-6))


def _posts(change: FloatArray, m_per_px: float) -> list[float]:
    """Middles in m of what stands between panes, from the left; the frame's own sides are none."""
    width = max(1, round(SMOOTH_M / m_per_px))
    calm = np.convolve(change, np.ones(width) / width, mode="same") < 1.0
    ends = np.flatnonzero(np.diff(np.concatenate([[0], calm.view(np.int8), [0]])))
    panes = [(a, b) for a, b in ends.reshape(-1, 2) if (b - a) * m_per_px >= LEAST_PANE_M]
    return [(a[1] + b[0]) / 2 * m_per_px for a, b in pairwise(panes)]
