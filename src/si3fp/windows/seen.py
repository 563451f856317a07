"""Where the wall itself was seen: the views of it agree, those of what stands before it do not."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.blend import exposure_gains
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import OrthoImage

CELL_PX = 4
"""Views are compared in cells: what registration leaves must not count as disagreement."""
AGREEMENT = 12.0
"""Grey levels: how far the mean of a cell may lie off that of the blend."""
ONE_OF_MANY = 0.5
"""Trust in a pixel that one view alone saw where most of the facade was seen by several."""


def wall_seen(fused: OrthoImage, views: Sequence[OrthoImage]) -> NDArray[np.float32]:
    """How sure it is that a pixel (H, W) shows the wall, or what is set into it: 0 to 1.

    Parameters
    ----------
    fused
        The blend of the views.
    views
        Registered views. With one view, what it saw counts as the wall.

    Notes
    -----
    Views of a point on the wall agree with their blend. A van in front of the wall lies elsewhere
    in every view, and so does a reflection in a pane: glass, too, counts as not seen.
    """
    if len(views) < 2:
        return fused.valid.astype(np.float32)
    height, width = fused.valid.shape
    size = (-(-width // CELL_PX), -(-height // CELL_PX))
    target = _cells(fused.rgb, size)
    looked = np.zeros(target.shape[:2], np.float32)
    agreed = np.zeros_like(looked)
    for view, gain in zip(views, exposure_gains(views), strict=True):
        valid = _cells(view.valid.astype(np.float32), size) > 0.99
        gap = _cells(view.rgb, size) * gain.astype(np.float32) - target
        looked += valid
        agreed += valid & (np.abs(gap).max(axis=-1) < AGREEMENT)
    sure = (agreed > 0.5 * looked).astype(np.float32)
    if np.median(looked) > 1:
        sure[looked == 1] *= ONE_OF_MANY
    seen = cv2.resize(sure, (width, height), interpolation=cv2.INTER_NEAREST)
    return np.asarray(seen * fused.valid, np.float32)


def _cells(
    picture: NDArray[np.uint8] | NDArray[np.float32], size: tuple[int, int]
) -> NDArray[np.float32]:
    """Means of cells."""
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)


def share_seen(seen: NDArray[np.float32], grid: FacadeGrid, edges_m: FloatArray) -> float:
    """Mean of `wall_seen` in a rectangle left, right, bottom, top; NaN off the image."""
    left, right, bottom, top = edges_m
    corners = grid.pixels_from_facade([[left, top], [right, bottom]]).round().astype(int)
    (x0, y0), (x1, y1) = corners.clip(0, [grid.width_px, grid.height_px])
    return float(seen[y0:y1, x0:x1].mean()) if x1 > x0 and y1 > y0 else float("nan")
