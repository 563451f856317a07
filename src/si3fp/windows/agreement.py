"""How well the views of an opening agree on a plane behind the wall, as a number per depth.

Frames and bars agree between views; reflections do not, and where a reveal hides the plane there
is nothing to compare. So the measure is the correlation of clipped gradients over what each pair
of views can see through the opening.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.config import MeasureConfig
from si3fp.geometry.rigid import FloatArray
from si3fp.model import OrthoImage
from si3fp.windows.parallax import patch_warp, seen_from

FloatImage = NDArray[np.float32]

MIN_OVERLAP = 0.3
"""Share of the window that both views of a pair must see."""


@dataclass(frozen=True, slots=True, eq=False)
class PreparedView:
    """A view prepared for comparison.

    Attributes
    ----------
    gradients
        (H, W, 2) clipped gradients, 0 where the view did not see.
    foot_px, distance_px
        Camera on this view's grid: foot (2,) from the upper left corner, distance to the wall.
    """

    gradients: FloatImage
    foot_px: FloatArray
    distance_px: float


def prepared_view(
    view: OrthoImage, camera: FloatArray, m_per_px: float, scale: float
) -> PreparedView:
    """Clipped gradients of a view at ``scale``; exposure and contrast of the view drop out."""
    grey = cv2.cvtColor(view.rgb, cv2.COLOR_RGB2GRAY)
    size = (round(grey.shape[1] * scale), round(grey.shape[0] * scale))
    small = cv2.resize(grey, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    seen = cv2.resize(view.valid.view(np.uint8), size, interpolation=cv2.INTER_AREA)
    seen = cv2.erode(seen, np.ones((5, 5), np.uint8), borderValue=1)
    smooth = cv2.GaussianBlur(small, (0, 0), 0.7)
    gradients = np.dstack(
        [cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=3), cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=3)]
    )
    # Against the contrast nearby, so that a frame counts as much as a shadow on the wall.
    window = (2 * round(0.5 / (m_per_px / scale)) + 1,) * 2
    level = np.sqrt(np.maximum(cv2.blur((gradients**2).sum(axis=2), window), 0.0)) + 4.0
    clipped = np.clip(gradients / (1.5 * level[..., None]), -1.0, 1.0) * seen[..., None]
    step_m = m_per_px / scale
    foot = np.array([camera[0] / step_m, size[1] - camera[1] / step_m])
    return PreparedView(clipped.astype(np.float32), foot, float(camera[2]) / step_m)


def views_of(
    box: FloatArray, views: Sequence[PreparedView], step_m: float, config: MeasureConfig
) -> list[PreparedView]:
    """The views in front of a box, none if their rays there do not cross widely enough."""
    middle = (box[:2] + box[2:]) / 2
    left, top = np.maximum(np.floor(box[:2]).astype(int), 0)
    right, bottom = np.ceil(box[2:]).astype(int)
    seeing = [
        view
        for view in views
        if view.distance_px * step_m > 0.5
        and np.any(view.gradients[top:bottom, left:right], axis=2).mean() > 0.8
    ]
    if len(seeing) < config.recess_min_views:
        return []
    slopes = np.array([(view.foot_px - middle) / view.distance_px for view in seeing])
    return seeing if np.ptp(slopes, axis=0).max() >= config.recess_min_spread else []


def agreement(
    views: Sequence[PreparedView],
    area: FloatArray,
    hole: FloatArray,
    depth_px: float,
    *,
    in_hole: bool,
) -> float:
    """Mean correlation of all pairs of views of an area at one depth; NaN without pairs.

    ``hole`` is the opening in the wall. A view counts only where its line of sight passes through
    it (``in_hole``) or misses it.
    """
    if not views:
        return float("nan")
    left, top = np.floor(area[:2]).astype(int)
    width, height = np.ceil(area[2:]).astype(int) - [left, top]
    patches = np.zeros((len(views), height, width, 2), np.float32)
    masks = np.full((len(views), height, width), not in_hole, np.float32)
    for patch, mask, view in zip(patches, masks, views, strict=True):
        shrink, shift = seen_from(view.foot_px, view.distance_px, depth_px)
        warp = patch_warp(shrink, shift, (left, top))
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        cv2.warpAffine(view.gradients, warp, (int(width), int(height)), patch, flags)
        # The opening, carried along the lines of sight onto the plane at this depth.
        through = (hole - np.tile(shift, 2)) / shrink
        x0, y0, x1, y1 = np.round(through - [left, top, left, top]).astype(int).clip(0)
        mask[y0:y1, x0:x1] = in_hole
    masks *= np.any(patches, axis=3)
    patches *= masks[..., None]
    count = len(views)
    flat, seen = patches.reshape(count, -1), masks.reshape(count, -1)
    energy = (patches**2).sum(axis=3).reshape(count, -1) @ seen.T
    correlation = flat @ flat.T / np.sqrt(energy * energy.T + 1e-6)
    overlap = seen @ seen.T
    pairs = np.triu_indices(count, 1)
    usable = overlap[pairs] > MIN_OVERLAP * seen.sum(axis=1).max(initial=1.0)
    return float(correlation[pairs][usable].mean()) if usable.any() else float("nan")
