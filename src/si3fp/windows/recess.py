"""M.1: how far the glass lies behind the wall, by the parallax between registered views.

On the wall plane, a point of the glass appears in every view at another place
(`si3fp.windows.parallax`). Undone for the right depth, the views of a window agree. The same is
asked of the wall around the window, because registration leaves the wall's views a little apart,
as if it stood at another depth: the recess is the difference of the two depths.

Frames and bars agree between views; reflections do not, and where a reveal hides the glass there
is nothing to compare. So the measure is the correlation of clipped gradients over what each pair
of views can see through the opening.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.config import MeasureConfig
from si3fp.geometry.rigid import FloatArray
from si3fp.model import OrthoImage
from si3fp.windows.parallax import patch_warp, seen_from, widest_views
from si3fp.windows.recess_estimate import (
    ALIKE,
    UNKNOWN_RECESS,
    RecessEstimate,
    drawn_to_kind,
)

FloatImage = NDArray[np.float32]

WALL_DEPTHS_M = np.arange(-0.36, 0.361, 0.04)
"""Where the wall around a window is sought; registration leaves it within 0.2 m."""
GLASS_DEPTHS_M = np.arange(-0.10, 0.601, 0.04)
"""Where the glass is sought, behind the wall around it."""
RING_M = 0.36
"""How far around a window its wall is looked at."""
BORDER_M = 0.04
"""Left out inside an opening's border: its reveal."""
SURROUND_M = 0.12
"""Left out outside of it: a surround's moulding, which slopes inwards."""
MIN_OVERLAP = 0.3
"""Share of the window that both views of a pair must see."""
SIGMA_PER_WIDTH = 0.2
"""Standard deviation of a peak per half width at half its height (docs/decisions/0008)."""


@dataclass(frozen=True, slots=True, eq=False)
class _View:
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


@dataclass(frozen=True, slots=True)
class _Peak:
    """Maximum of an agreement curve: place and half width at half height."""

    depth_m: float
    half_width_m: float


def estimate_recess(
    boxes_px: FloatArray,
    views: Sequence[OrthoImage],
    cameras_in_facade: Mapping[str, FloatArray],
    m_per_px: float,
    config: MeasureConfig,
) -> tuple[RecessEstimate, ...]:
    """The recess of every window; None in it where views or texture do not tell.

    Parameters
    ----------
    boxes_px
        (N, 4) x0 y0 x1 y1 windows without their surrounds, on the grid of the views.
    views
        Registered views of one facade.
    cameras_in_facade
        Optical centres (3,) in the facade frame by view id; views without one are not used.
    m_per_px
        Resolution of the grid.
    config
        Fields ``recess_*``.

    Notes
    -----
    Windows of one size share what they show: the curve of agreement over depth is summed over
    them, and a window departs from its kind as far as its own curve is sharper than the kind's
    values are spread (a normal prior with the kind's mean and spread).
    """
    boxes = np.asarray(boxes_px, np.float64).reshape(-1, 4)
    known = [view for view in views if view.source in cameras_in_facade]
    chosen = widest_views(known, cameras_in_facade, config.recess_max_views)
    if not len(boxes) or len(chosen) < config.recess_min_views:
        return (UNKNOWN_RECESS,) * len(boxes)
    scale = min(1.0, m_per_px / config.recess_m_per_px)
    prepared = [_prepare(v, cameras_in_facade[v.source], m_per_px, scale) for v in chosen]
    step_m = m_per_px / scale
    near = [_that_see(box * scale, prepared, step_m, config) for box in boxes]
    walls = [
        _peak(WALL_DEPTHS_M, _wall_curve(box * scale, seen, step_m), config)
        for box, seen in zip(boxes, near, strict=True)
    ]
    depths = [wall.depth_m for wall in walls if wall is not None]
    usual = float(np.median(depths)) if depths else 0.0
    wall_m = np.array([usual if wall is None else wall.depth_m for wall in walls])
    curves = np.array(
        [
            _glass_curve(box * scale, seen, step_m, depth)
            for box, seen, depth in zip(boxes, near, wall_m, strict=True)
        ]
    )
    own = [_peak(GLASS_DEPTHS_M, curve, config) for curve in curves]
    estimates = []
    for index, (recess_m, sigma_m) in enumerate(_by_kind(boxes, curves, own, walls, config)):
        mine = own[index]
        behind_m = mine.depth_m if mine is not None else recess_m or 0.0
        glass_m = float(wall_m[index]) + behind_m
        estimates.append(RecessEstimate(recess_m, sigma_m, glass_m, len(near[index])))
    return tuple(estimates)


def _prepare(view: OrthoImage, camera: FloatArray, m_per_px: float, scale: float) -> _View:
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
    return _View(clipped.astype(np.float32), foot, float(camera[2]) / step_m)


def _that_see(
    box: FloatArray, views: Sequence[_View], step_m: float, config: MeasureConfig
) -> list[_View]:
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


def _wall_curve(box: FloatArray, views: Sequence[_View], step_m: float) -> FloatArray:
    """Agreement of the views on the wall around a box at every depth of `WALL_DEPTHS_M`."""
    outward = np.array([-1, -1, 1, 1]) / step_m
    area, hole = box + RING_M * outward, box + SURROUND_M * outward
    depths = WALL_DEPTHS_M / step_m
    return np.array([_agreement(views, area, hole, depth, in_hole=False) for depth in depths])


def _glass_curve(
    box: FloatArray, views: Sequence[_View], step_m: float, wall_m: float
) -> FloatArray:
    """Agreement of the views inside a box at every depth of `GLASS_DEPTHS_M` behind the wall."""
    hole = box + BORDER_M / step_m * np.array([1, 1, -1, -1])
    depths = (wall_m + GLASS_DEPTHS_M) / step_m
    return np.array([_agreement(views, box, hole, depth, in_hole=True) for depth in depths])


def _agreement(
    views: Sequence[_View], area: FloatArray, hole: FloatArray, depth_px: float, *, in_hole: bool
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


def _peak(depths_m: FloatArray, curve: FloatArray, config: MeasureConfig) -> _Peak | None:
    """The maximum of a curve by a parabola; None if it is low, blunt or on the border."""
    if not np.isfinite(curve).all():
        return None
    best = int(curve.argmax())
    height = float(curve[best] - np.quantile(curve, 0.1))
    if best in (0, len(curve) - 1) or height < config.recess_min_peak:
        return None
    before, here, after = curve[best - 1 : best + 2]
    step_m = float(depths_m[1] - depths_m[0])
    bend = before - 2 * here + after
    depth_m = float(depths_m[best] + 0.5 * (before - after) / min(bend, -1e-9) * step_m)
    wide = int((curve > curve[best] - height / 2).sum()) * step_m / 2
    return _Peak(depth_m, wide) if wide <= config.recess_max_width_m else None


def _by_kind(
    boxes: FloatArray,
    curves: FloatArray,
    own: Sequence[_Peak | None],
    walls: Sequence[_Peak | None],
    config: MeasureConfig,
) -> list[tuple[float | None, float]]:
    """Recess and standard deviation of every window from its own curve and those of its kind."""
    log_size = np.log(np.maximum(boxes[:, 2:] - boxes[:, :2], 1.0))
    results: list[tuple[float | None, float]] = []
    for index in range(len(boxes)):
        alike = np.abs(log_size - log_size[index]).max(axis=1) < ALIKE
        alike &= np.isfinite(curves).all(axis=1)
        kind = _peak(GLASS_DEPTHS_M, curves[alike].mean(axis=0), config) if alike.any() else None
        if kind is None:
            results.append((None, 0.0))
            continue
        told = [own[i] for i in np.flatnonzero(alike).tolist()]
        values = np.array([peak.depth_m for peak in told if peak is not None])
        mine, wall = own[index], walls[index]
        sigma_m = np.inf
        if mine is not None:
            width_m = np.hypot(mine.half_width_m, wall.half_width_m if wall else RING_M)
            sigma_m = SIGMA_PER_WIDTH * width_m
        results.append(
            drawn_to_kind(
                kind.depth_m, values, mine.depth_m if mine else None, sigma_m, config.recess_floor_m
            )
        )
    return results
