"""The fused orthophoto: a robust per-pixel blend of views on one grid, for both paths.

Per pixel, the median of the views that saw it is what most of them agree on: a passing car or a
tree in one of three views is outvoted. The views near that median are then averaged by how well
they resolve the wall, so that the sharpest one dominates.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from si3fp.errors import FacadeError
from si3fp.geometry.rigid import FloatArray
from si3fp.model import OrthoImage

AGREEMENT = 18.0
"""Grey levels: how far a view may be from the median before it counts as something else."""

SHARPNESS_POWER = 2.0
"""Power of the resolution in the weights; large values take the best view, 0 the plain mean."""

BAND_ROWS = 64
SAMPLES_FOR_GAIN = 4000


def blend(
    views: Sequence[OrthoImage],
    weights: Sequence[NDArray[np.float32]],
    gains: FloatArray | None = None,
) -> OrthoImage:
    """The fused orthophoto of registered views, ``seen_by`` included.

    Parameters
    ----------
    views
        Views of one size, registered.
    weights
        (H, W) per view: resolution on the wall, any unit (see `si3fp.ortho.view_weight`).
    gains
        `exposure_gains` of a larger picture that these views are parts of; by default their own.

    Returns
    -------
    OrthoImage ``fused``; ``valid`` where at least one view saw.

    Raises
    ------
    FacadeError
        If there is no view.
    """
    if not views:
        raise FacadeError("No view of the facade is left to blend.")
    height, width = views[0].valid.shape
    if gains is None:
        gains = exposure_gains(views)
    rgb = np.zeros((height, width, 3), np.uint8)
    seen_by = np.zeros((height, width), np.uint8)
    for top in range(0, height, BAND_ROWS):
        rows = slice(top, min(top + BAND_ROWS, height))
        colours = np.stack([view.rgb[rows] for view in views]).astype(np.float32)
        colours *= gains[:, None, None, :].astype(np.float32)
        valid = np.stack([view.valid[rows] for view in views])
        weight = np.stack([weight[rows] for weight in weights]) ** np.float32(SHARPNESS_POWER)
        rgb[rows] = _blend_band(colours, valid, weight)
        seen_by[rows] = np.minimum(valid.sum(axis=0), 255)
    return OrthoImage("fused", rgb, seen_by > 0, seen_by=seen_by)


def _blend_band(
    colours: NDArray[np.float32], valid: NDArray[np.bool_], weight: NDArray[np.float32]
) -> NDArray[np.uint8]:
    """Robust mean (h, W, 3) of colours (N, h, W, 3) where valid (N, h, W)."""
    middle = _median(colours, valid)
    distance = np.abs(colours - middle).max(axis=-1)
    trust = weight * valid / (1 + (distance / AGREEMENT) ** 4)
    total = trust.sum(axis=0)
    mean = np.einsum("nhw,nhwc->hwc", trust, colours) / np.maximum(total, 1e-30)[..., None]
    return np.clip(np.where((total > 0)[..., None], mean, 0) + 0.5, 0, 255).astype(np.uint8)


def _median(colours: NDArray[np.float32], valid: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Median over the valid views, per channel; the mean of the middle two where even."""
    count = valid.sum(axis=0)
    ordered = np.sort(np.where(valid[..., None], colours, np.float32(np.inf)), axis=0)
    low = np.maximum((count - 1) // 2, 0)[None, ..., None]
    high = np.maximum(count // 2, 0)[None, ..., None]
    low = np.minimum(low, len(colours) - 1)
    high = np.minimum(high, len(colours) - 1)
    middle = (
        np.take_along_axis(ordered, low, axis=0)[0] + np.take_along_axis(ordered, high, axis=0)[0]
    ) / 2
    return np.where((count > 0)[..., None], middle, np.float32(0))


def exposure_gains(views: Sequence[OrthoImage]) -> FloatArray:
    """Factor (N, 3) per view and channel that brings the views to one exposure.

    Log gains that explain the median ratios of all overlapping pairs, with mean zero.
    """
    count = len(views)
    logs = []
    step = max(1, int(np.sqrt(views[0].valid.size / SAMPLES_FOR_GAIN)))
    for view in views:
        sample = np.log(view.rgb[::step, ::step].astype(np.float64) + 4.0)
        logs.append(np.where(view.valid[::step, ::step, None], sample, np.nan))
    normal = np.full((count, count), 1.0 / count)
    right = np.zeros((count, 3))
    for i in range(count):
        for j in range(i + 1, count):
            difference = logs[i] - logs[j]
            both = np.isfinite(difference[..., 0])
            if both.sum() < 50:
                continue
            gap = np.median(difference[both], axis=0)
            normal[i, i] += 1
            normal[j, j] += 1
            normal[i, j] -= 1
            normal[j, i] -= 1
            right[i] -= gap
            right[j] += gap
    gains: FloatArray = np.exp(np.linalg.lstsq(normal, right, rcond=None)[0])
    return np.clip(gains, 0.33, 3.0)
