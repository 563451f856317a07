"""M.1: on which side of a frame the door is, as what shows below the sill tells.

The door goes on there, beside it is wall (docs/decisions/0019-what-slabs-hide.md).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from si3fp.geometry.rigid import FloatArray

WIDTHS_M = np.arange(0.7, 1.051, 0.05)
"""Width of doors of one leaf."""
LEAST_WINDOW_M = 0.5
"""Width of the window beside it."""
SILL_M = (0.9, 1.7)
"""Sills lie so far below the heads."""
BELOW_SILL_M = (0.1, 0.65)
"""Where below a sill the door is told from the wall."""
BESIDE_M = (0.16, 0.4)
"""Where beside the frame the wall is looked at, at the same height: behind the same bars."""
MOST_CONTRAST = 40.0
"""A storey says no more; in 8-bit CIE Lab."""
SAME_HEAD_M = 0.3
"""Heads of one storey lie no farther apart as they show."""
LEAST_ROW = 2  # windows that tell the sill of a storey
BINS = 64


def votes_by_sill(
    box: FloatArray,
    boxes_px: FloatArray,
    lab: FloatArray,
    valid: NDArray[np.bool_],
    m_per_px: float,
) -> FloatArray:
    """(2, widths) how much more the door's part below the sill differs from the wall.

    First for a door on the left, then on the right; 0 where the picture ends.

    Parameters
    ----------
    box
        (4,) the frame.
    boxes_px
        (N, 4) all openings, whose sills tell that of the storey.
    lab
        (H, W, 3) the facade in 8-bit CIE Lab.
    valid
        (H, W) where it is known.
    m_per_px
        Its resolution.
    """
    upwards = np.array([1, 1, -1, -1]) * m_per_px
    sill_m = sill_of_row(box[[0, 2, 3, 1]] * upwards, boxes_px[:, [0, 2, 3, 1]] * upwards)
    sill = float(box[3]) if sill_m is None else -sill_m / m_per_px
    profile = _profile(float(box[0]), float(box[2]), sill, lab, valid, m_per_px)
    if profile is None:
        return np.zeros((2, len(WIDTHS_M)))
    wide_m = float(box[2] - box[0]) * m_per_px
    return np.array([_steps(profile, wide_m), _steps(profile[::-1], wide_m)])


def sill_of_row(edges_m: FloatArray, others_m: FloatArray) -> float | None:
    """Sill that the windows (N, 4) of an opening's (4,) storey share; None if less than two do."""
    heights_m = others_m[:, 3] - others_m[:, 2]
    row = np.abs(others_m[:, 3] - edges_m[3]) < SAME_HEAD_M
    row &= (heights_m > SILL_M[0]) & (heights_m < SILL_M[1]) & (others_m != edges_m).any(axis=1)
    return float(np.median(others_m[row, 2])) if row.sum() >= LEAST_ROW else None


def _profile(
    left: float,
    right: float,
    sill: float,
    lab: FloatArray,
    valid: NDArray[np.bool_],
    m_per_px: float,
) -> FloatArray | None:
    """(BINS,) from left to right, how far what is below a sill differs from the wall beside."""
    rows = slice(*(round(sill + each / m_per_px) for each in BELOW_SILL_M))
    near, far = (each / m_per_px for each in BESIDE_M)
    if rows.stop > len(lab):
        return None

    def colours(first: float, last: float) -> FloatArray:
        """(W, 3) median colour of each column of pixels."""
        part = slice(max(round(first), 0), max(round(last), 0))
        seen = valid[rows, part].mean(axis=0) > 0.5
        return np.asarray(np.median(lab[rows, part], axis=0)[seen])

    wall = np.concatenate([colours(left - far, left - near), colours(right + near, right + far)])
    inside = colours(left, right)
    if not len(wall) or len(inside) < BINS // 2:
        return None
    off = np.linalg.norm(inside - np.median(wall, axis=0), axis=1).clip(0, MOST_CONTRAST)
    at = (np.arange(BINS) + 0.5) / BINS * len(off) - 0.5
    return np.asarray(np.interp(at, np.arange(len(off)), off))


def _steps(profile: FloatArray, wide_m: float) -> FloatArray:
    """(widths,) how far the first part of a profile lies above the rest, by the door's width."""
    ends = np.round(WIDTHS_M / wide_m * BINS).astype(int)
    return np.array(
        [
            profile[:end].mean() - profile[end:].mean()
            if wide_m - door_m >= LEAST_WINDOW_M
            else 0.0
            for end, door_m in zip(ends, WIDTHS_M, strict=True)
        ]
    )
