"""M.1: low windows of cellars and attics, which the detector knows only at twice the scale.

A window of 0.4 m is 13 pixels high at the scale of the detector, which learnt from windows twice
as high and more: it suspects something there, and no more. At twice the scale it is sure, but of
stones, panes and vents too. So what is low must be suspected at the first scale and stand in a row
of its like (docs/decisions/0021-low-windows.md).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from si3fp.geometry.boxes import iou_matrix
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections, OrthoImage
from si3fp.windows.detect import WindowDetector

LOW_M = 0.75
"""Height below which a window is low."""
FINER = 2.0
SUSPECTED = 0.05
"""Score at the first scale from which a place may hold a low window."""
SAME_PLACE_IOU = 0.4
LEAST_ROW = 3
"""Low windows of a row, all sure at the finer scale."""
MOST_HIDDEN = 0.1
"""Share of a low window's size by which the recess moves one of its sides at most."""
SAME_LEVEL_M, SAME_WIDTH = 0.12, 0.25
"""Windows of one row: heads and sills this near, logarithms of widths too."""


def detect_with_low(detector: WindowDetector, image: OrthoImage, m_per_px: float) -> Detections:
    """Detections in pixels of the image, best first; rows of low windows as at twice the scale.

    Parameters
    ----------
    detector, image, m_per_px
        As of `WindowDetector.detect`.
    """
    found = detector.detect(image, m_per_px)
    least = detector.thresholds["window"]
    suspects = found.select(_suspects(found, m_per_px, least))
    if len(suspects) < LEAST_ROW:
        return found
    finer = detector.detect(image, FINER * m_per_px)
    finer = finer.select(_low_windows(finer, m_per_px, least))
    near = iou_matrix(finer.boxes_px, suspects.boxes_px) >= SAME_PLACE_IOU
    finer = finer.select(np.flatnonzero(near.any(axis=1)))
    finer = finer.select(_in_rows(finer.boxes_px * m_per_px))
    near = iou_matrix(found.boxes_px, finer.boxes_px) >= SAME_PLACE_IOU
    others = found.select(~near.any(axis=1) | (found.labels != "window"))
    both = Detections(
        np.concatenate([others.boxes_px, finer.boxes_px]),
        np.concatenate([others.scores, finer.scores]),
        np.concatenate([others.labels, finer.labels]),
        np.concatenate([others.edge_sigma_px, finer.edge_sigma_px]),
    )
    return both.select(np.argsort(-both.scores, kind="stable"))


def of_low(lever: FloatArray, edges_m: FloatArray, recess_m: float) -> FloatArray:
    """The lever (4,) of a window, so short for a low one that its sides move by little.

    Of a low hole seen at a steep slant the reveal is most of what shows, and the detector boxes it
    with the glass.

    Parameters
    ----------
    lever
        How far left, right, bottom and top appear moved inwards per metre of recess.
    edges_m
        (4,) left, right, bottom, top as they appear.
    recess_m
        Depth of the glass.
    """
    sizes_m = np.repeat(edges_m[1::2] - edges_m[::2], 2)
    if sizes_m[2] >= LOW_M or recess_m <= 0:
        return lever
    return np.asarray(np.minimum(lever, MOST_HIDDEN * sizes_m / recess_m))


def _suspects(found: Detections, m_per_px: float, least: float) -> NDArray[np.bool_]:
    """(N,) what may be a low window; where the detector is not sure, its box is often too high."""
    heights_m = (found.boxes_px[:, 3] - found.boxes_px[:, 1]) * m_per_px
    most_m = np.where(found.scores >= least, LOW_M, LOW_M / SAME_PLACE_IOU)
    likely = (found.labels == "window") & (found.scores >= SUSPECTED)
    return np.asarray(likely & (heights_m < most_m))


def _low_windows(found: Detections, m_per_px: float, least: float) -> NDArray[np.bool_]:
    """(N,) which are sure and low."""
    heights_m = (found.boxes_px[:, 3] - found.boxes_px[:, 1]) * m_per_px
    return np.asarray((found.labels == "window") & (found.scores >= least) & (heights_m < LOW_M))


def _in_rows(boxes_m: FloatArray) -> NDArray[np.bool_]:
    """(N,) which of the boxes x0 y0 x1 y1 stand in a row of boxes alike."""
    apart = np.abs(boxes_m[:, None, 1::2] - boxes_m[None, :, 1::2]).max(axis=2, initial=0.0)
    log_width = np.log(boxes_m[:, 2] - boxes_m[:, 0])
    alike = apart < SAME_LEVEL_M
    alike &= np.abs(log_width[:, None] - log_width[None]) < SAME_WIDTH
    return np.asarray(alike.sum(axis=1) >= LEAST_ROW)
