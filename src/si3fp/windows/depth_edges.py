"""M.1: sides of windows moved to where the depth of a render steps from the wall to the glass.

Colours alone cannot tell a frame from a surround or from the wall (`si3fp.windows.refine`); the
step can, where the recess is deep enough.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from si3fp.geometry.rigid import FloatArray
from si3fp.model import OrthoImage
from si3fp.windows.depth import known_depth
from si3fp.windows.fuse import FusedDetections
from si3fp.windows.recess_estimate import RecessEstimate

LEAST_RECESS_M = 0.06
"""Shallower steps drown in the noise of a render's depth."""
REACH_M = 0.1
"""How far a side may move; farther out, blinds and mirrored walls look like steps (real photos)."""
PRIOR_SIGMA_M = 0.04
"""What colours may be off beside what they state: the width of a frame."""
NOISE_M = 0.04
"""Standard deviation of a render's depth."""
PATCH_M = 0.06
"""Length over which the errors of depth are alike."""
BLUR_M = 0.02
"""Width over which a render smears a step."""
LARGEST = 3.0
"""Standard deviations: a depth farther off counts as this."""
MIDDLE = 0.15
"""Share of a side's length left out at both ends."""
KNOWN_SHARE = 0.5
"""Share of the pixels along a side whose depth must be known."""
LEAST_SIGMA_M = 0.02
"""No side is known better: a render smears the step."""
MAX_SIGMA = 0.8
"""A posterior that is not narrower than this share of its prior tells nothing."""
OUTWARD_PX = (-1, -1, 1, 1)
"""Sign of an outward move of x0, y0, x1 and y1."""


def edges_by_depth(
    found: FusedDetections,
    recesses: Sequence[RecessEstimate],
    ortho: OrthoImage,
    m_per_px: float,
) -> FusedDetections:
    """The same windows with each side at its step in depth, and standard deviations of the sides.

    Sides of which depth tells nothing, and windows of unknown or small recess, stay as they are.

    Parameters
    ----------
    found
        Windows in pixels of the image.
    recesses
        Depths of their glass.
    ortho
        Image with depth.
    m_per_px
        Its resolution.

    Notes
    -----
    Every place of a side has a likelihood: what lies outside must not lie behind the wall, and what
    lies inside not in front of the glass. The given side is the prior, mean and width of the
    posterior are the result.
    """
    depth_m = known_depth(ortho)
    boxes = found.detections.boxes_px.copy()
    sigma = found.detections.edge_sigma_px.copy()
    reach = max(2, round(REACH_M / m_per_px))
    for index, recess in enumerate(recesses):
        if recess.recess_m is None or recess.recess_m < LEAST_RECESS_M:
            continue
        wall_m = recess.recess_m - recess.glass_m
        for side in range(4):
            prior_px = np.hypot(sigma[index, side], PRIOR_SIGMA_M / m_per_px)
            profile = _profile(depth_m, found.detections.boxes_px[index], side, reach)
            move_px, sigma_px = _step(wall_m - profile, recess.recess_m, prior_px, m_per_px)
            if sigma_px < MAX_SIGMA * prior_px:
                boxes[index, side] += OUTWARD_PX[side] * move_px
                sigma[index, side] = max(sigma_px, LEAST_SIGMA_M / m_per_px)
    height, width = depth_m.shape
    boxes = np.clip(boxes, 0, [width, height, width, height])
    detections = replace(found.detections, boxes_px=boxes, edge_sigma_px=sigma)
    return FusedDetections(detections, found.views, found.notes)


def _profile(depth_m: FloatArray, box: FloatArray, side: int, reach: int) -> FloatArray:
    """Median depth (2 reach,) along a side, from inside to outside; NaN where it is not known."""
    across = side % 2  # 0: left and right, along x
    low, high = box[1 - across], box[3 - across]
    margin = MIDDLE * (high - low)
    along = slice(max(round(low + margin), 0), max(round(high - margin), 0))
    turned = (depth_m.T if across == 0 else depth_m)[:, along]
    start = round(box[side])
    places = start + OUTWARD_PX[side] * (np.arange(-reach, reach) + 0.5) - 0.5
    profile = np.full(2 * reach, np.nan)
    for k, place in enumerate(places.astype(int)):
        if 0 <= place < len(turned) and turned.shape[1]:
            known = turned[place][np.isfinite(turned[place])]
            if len(known) > KNOWN_SHARE * turned.shape[1]:
                profile[k] = np.median(known)
    return profile


def _step(
    behind_m: FloatArray, recess_m: float, prior_px: float, m_per_px: float
) -> tuple[float, float]:
    """Outward move of a side in pixels and its standard deviation, by its profile behind the wall.

    Notes
    -----
    What is nearer than the wall outside, or deeper than the glass inside, is as good: sills stand
    out, and panes show what they mirror.
    """
    reach = len(behind_m) // 2
    at = np.arange(-reach, reach) + 0.5
    moves = np.arange(-reach, reach + 1)
    expected = recess_m * np.clip((moves[:, None] - at) * m_per_px / BLUR_M + 0.5, 0, 1)
    off = behind_m - expected
    off = np.where(expected > 0.99 * recess_m, np.minimum(off, 0), off)
    off = np.where(expected < 0.01 * recess_m, np.maximum(off, 0), off)
    square = np.minimum((np.nan_to_num(off) / NOISE_M) ** 2, LARGEST**2)
    # A Cauchy prior: a box that missed the whole side is rare, but far off.
    score = -0.5 * square.sum(axis=1) * m_per_px / PATCH_M - np.log1p((moves / prior_px) ** 2)
    weight = np.exp(score - score.max())
    weight /= weight.sum()
    mean = float((weight * moves).sum())
    return mean, float(np.sqrt((weight * (moves - mean) ** 2).sum()))
