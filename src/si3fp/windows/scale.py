"""The scale of a picture of unknown scale, from the windows that it shows.

The detector knows windows of a usual height best, so the right scale is the one at which it is sure
of many windows and they are about as high as windows are.
"""

from __future__ import annotations

import numpy as np

from si3fp.model import Detections, OrthoImage
from si3fp.windows.detect import WindowDetector

WINDOW_HEIGHT_M = 1.4
"""Median height of a facade's windows; the detector's training pictures were scaled to it."""

HEIGHT_SPREAD = 0.4
"""Standard deviation of the logarithm of window heights within and between facades."""

SMALLEST_SIDE_M = 2.5
"""No picture is taken to show less than this along its shorter side: one window and its wall."""

COARSEST_M_PER_PX = 0.2
"""Here a window is 7 px high; in coarser pictures none can be told."""

LARGEST_AREA_M2 = 7200.0
"""No picture is taken to show more than this, say 240 m of a street 30 m high."""

LADDER = 2.0
"""Ratio of two scales that are tried; a detector finds windows from 0.6 to 1.7 times their size."""


def estimate_m_per_px(image: OrthoImage, detector: WindowDetector) -> float | None:
    """Metres per pixel at which the picture's windows are of usual height; None without windows.

    Windows are sought at scales of a geometric ladder, from few metres in the picture to many. On
    the best rung the sum over the sure windows, each weighted by how sure it is and how usual its
    height would be, is largest; then their median height is set to `WINDOW_HEIGHT_M`. So the
    result, of three digits, carries the spread of window heights between buildings: good for
    finding windows, not for measuring them. benchmarks/accuracy/picture_scale.py measures it.

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
        sure = found.select(
            (found.labels == "window") & (found.scores >= detector.thresholds["window"])
        )
        total = _evidence(sure, m_per_px, detector.thresholds["window"])
        if total > best:
            height_m = m_per_px * np.median(sure.boxes_px[:, 3] - sure.boxes_px[:, 1])
            change = 1 / np.clip(height_m / WINDOW_HEIGHT_M, 1 / LADDER, LADDER)
            best, estimate = total, float(f"{m_per_px * change:.3g}")
    return estimate


def _evidence(sure: Detections, m_per_px: float, threshold: float) -> float:
    """How much the sure windows speak for a scale.

    The fourth root of the area stands between counting, which favours the many small things of an
    enlarged picture that resemble windows, and adding up areas, which favours few large ones.
    """
    width_px, height_px = (sure.boxes_px[:, 2:] - sure.boxes_px[:, :2]).clip(1e-6).T
    deviation = np.log(height_px * m_per_px / WINDOW_HEIGHT_M) / HEIGHT_SPREAD
    usual = np.exp(-0.5 * deviation**2)
    return float(np.sum((sure.scores - threshold) * usual * (width_px * height_px) ** 0.25))


def _ladder(height_px: int, width_px: int) -> list[float]:
    """Scales to try, in metres per pixel, rising by `LADDER`."""
    last = min(COARSEST_M_PER_PX, float(np.sqrt(LARGEST_AREA_M2 / (height_px * width_px))))
    first = min(SMALLEST_SIDE_M / min(height_px, width_px), last)
    rungs = int(np.floor(np.log(last / first) / np.log(LADDER) + 1e-9)) + 1
    return [first * LADDER**rung for rung in range(rungs)]
