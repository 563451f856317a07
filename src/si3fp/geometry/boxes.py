"""Axis-parallel boxes x0 y0 x1 y1."""

from __future__ import annotations

import numpy as np

from si3fp.geometry.rigid import FloatArray


def iou_matrix(first: FloatArray, second: FloatArray) -> FloatArray:
    """Intersection over union (N, M) of boxes (N, 4) and (M, 4)."""
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    common = np.prod(np.clip(high - low, 0, None), axis=-1)
    areas = [np.prod(np.clip(b[:, 2:] - b[:, :2], 0, None), axis=-1) for b in (first, second)]
    union = areas[0][:, None] + areas[1][None] - common
    overlap: FloatArray = common / np.maximum(union, 1e-12)
    return overlap
