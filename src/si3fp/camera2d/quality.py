"""C.1: how sharp and how well exposed one photo is, measured on its grey values."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.geometry.rigid import FloatArray

Grey = NDArray[np.uint8]

_SMOOTHING_PX = 1.0
_REBLUR_PX = 2.0
_LEAST_STEP = 4.0
_LEAST_EDGES = 200
_MOST_BLUR_PX = 20.0


def blur_px(grey: Grey) -> float:
    """Standard deviation of the blur of a photo's strong edges, in pixels.

    Every edge is blurred once more by a known amount: the less its slope drops, the wider it was.
    The contrast of the scene cancels. The median of the edges of each direction counts, and of the
    two directions the worse, for motion blurs one only. Sharpened photos have 0. Method: Zhuo and
    Sim (2011), doi:10.1016/j.patcog.2011.03.009.

    Parameters
    ----------
    grey
        (H, W) uint8. Photos compare at one size only.

    Returns
    -------
    From 0 to 20 px; 20 where neither direction shows edges.
    """
    before = _blurred(grey.astype(np.float32), _SMOOTHING_PX)
    after = _blurred(before, _REBLUR_PX)
    blurs = []
    for axis in (1, 0):
        slope, across = _slope(before, axis), _slope(before, 1 - axis)
        crest = np.asarray(cv2.dilate(slope, np.ones((1, 5) if axis else (5, 1), np.uint8)))
        candidates = (slope == crest) & (slope > 2 * across) & (slope > _LEAST_STEP)
        steep = slope[candidates]
        if len(steep) < _LEAST_EDGES:
            continue
        strong = steep >= np.quantile(steep, 0.5)
        ratio = steep[strong] / np.maximum(_slope(after, axis)[candidates][strong], 1e-3)
        blurs.append(float(np.median(_blur_of(ratio))))
    return max(blurs, default=_MOST_BLUR_PX)


def _blurred(values: NDArray[np.float32], sigma_px: float) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(values, (0, 0), sigma_px), np.float32)


def _slope(values: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    dx, dy = (1, 0) if axis else (0, 1)
    return np.abs(
        np.asarray(cv2.Sobel(values, cv2.CV_32F, dx, dy, ksize=3, scale=0.125), np.float32)
    )


def _blur_of(ratio: NDArray[np.float32]) -> FloatArray:
    """Blur of Gaussian edges whose slope drops by ``ratio`` when blurred by `_REBLUR_PX` more."""
    variance = _REBLUR_PX**2 / np.maximum(ratio.astype(np.float64) ** 2 - 1, 1e-6)
    return np.asarray(np.sqrt(np.clip(variance - _SMOOTHING_PX**2, 0, _MOST_BLUR_PX**2)))


def clipped_shares(grey: Grey) -> tuple[float, float]:
    """Shares of black and of white pixels below the sky, from 0 to 1.

    A white area that touches the upper border is sky and may be white; it leaves the count
    altogether unless it is most of the photo.
    """
    white = (grey >= 250).astype(np.uint8)
    framed = cv2.copyMakeBorder(white, 1, 0, 0, 0, cv2.BORDER_CONSTANT, value=1)
    cv2.floodFill(framed, None, (0, 0), 2)
    sky = framed[1:] == 2
    if sky.mean() > 0.5:
        sky[:] = False
    below = max(int((~sky).sum()), 1)
    return float((grey <= 3).sum() / below), float(((white == 1) & ~sky).sum() / below)
