"""The scale of a picture of unknown scale, from the windows that it shows.

The detector knows windows of a usual height best, so the right scale is the one at which it is sure
of many windows and they are about as high as windows are.
"""

from __future__ import annotations

import numpy as np

from si3fp.model import OrthoImage
from si3fp.windows.detect import WindowDetector

WINDOW_HEIGHT_M = 1.4
"""Median height of a facade's windows; the detector's training pictures were scaled to it."""

HEIGHT_SPREAD = 0.4
"""Standard deviation of the logarithm of window heights within and between facades."""

SMALLEST_SIDE_M = 2.5
"""No picture is taken to show less than this along its shorter side: one window and its wall."""

COARSEST_M_PER_PX = 0.2
"""Here a window is 7 px high; in coarser pictures none can be told."""

LARGEST_AREA_M2 = 12_800.0
"""No picture is taken to show more than this: 8 million pixels of the detector."""

LADDER = 2.0
"""Ratio of two scales that are tried; a detector finds windows from 0.6 to 1.7 times their size."""


def estimate_m_per_px(image: OrthoImage, detector: WindowDetector) -> float | None:
    """Metres per pixel at which the picture's windows are of usual height; None without windows.

    Windows are sought at scales of a geometric ladder, from few metres in the picture to many. The
    best rung is where the sum of the sure scores, each weighted by how usual the window's height
    would be, is largest; there, the median height of the sure windows is set to
    `WINDOW_HEIGHT_M`. So the result, to three digits, carries the spread of window heights between
    buildings: good for finding windows, not for measuring them.

    Parameters
    ----------
    image
        Orthographic or near-frontal picture.
    detector
        Finds windows at a given scale.
    """
    best, estimate = 0.0, None
    for m_per_px in _ladder(*image.valid.shape):
        found = detector.detect(image, m_per_px)
        sure = (found.labels == "window") & (found.scores >= detector.thresholds["window"])
        boxes, scores = found.boxes_px[sure], found.scores[sure]
        heights_m = np.maximum(boxes[:, 3] - boxes[:, 1], 1e-6) * m_per_px
        deviation = np.log(heights_m / WINDOW_HEIGHT_M) / HEIGHT_SPREAD
        total = float(np.sum(scores * np.exp(-0.5 * deviation**2)))
        if total > best:
            best, estimate = total, m_per_px * WINDOW_HEIGHT_M / float(np.median(heights_m))
    return estimate and float(f"{estimate:.3g}")


def _ladder(height_px: int, width_px: int) -> list[float]:
    """Scales to try, in metres per pixel, rising by `LADDER`."""
    last = min(COARSEST_M_PER_PX, float(np.sqrt(LARGEST_AREA_M2 / (height_px * width_px))))
    first = min(SMALLEST_SIDE_M / min(height_px, width_px), last)
    rungs = int(np.floor(np.log(last / first) / np.log(LADDER) + 1e-9)) + 1
    return [first * LADDER**rung for rung in range(rungs)]
