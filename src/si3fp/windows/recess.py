"""M.1: how far the glass lies behind the wall, by the parallax between registered views.

On the wall plane, a point of the glass appears in every view at another place
(`si3fp.windows.parallax`). Undone for the right depth, the views of a window agree. The same is
asked of the wall around the window, because registration leaves the wall's views a little apart,
as if it stood at another depth: the recess is the difference of the two depths.

How views are compared: `si3fp.windows.agreement`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from si3fp.config import MeasureConfig
from si3fp.geometry.rigid import FloatArray
from si3fp.model import OrthoImage
from si3fp.windows.agreement import PreparedView, agreement, prepared_view, views_of
from si3fp.windows.parallax import widest_views
from si3fp.windows.recess_estimate import (
    ALIKE,
    UNKNOWN_RECESS,
    RecessEstimate,
    drawn_to_kind,
)

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
SIGMA_PER_WIDTH = 0.2
"""Standard deviation of a peak per half width at half its height (docs/decisions/0008)."""


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
    prepared = [prepared_view(v, cameras_in_facade[v.source], m_per_px, scale) for v in chosen]
    step_m = m_per_px / scale
    near = [views_of(box * scale, prepared, step_m, config) for box in boxes]
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


def _wall_curve(box: FloatArray, views: Sequence[PreparedView], step_m: float) -> FloatArray:
    """Agreement of the views on the wall around a box at every depth of `WALL_DEPTHS_M`."""
    outward = np.array([-1, -1, 1, 1]) / step_m
    area, hole = box + RING_M * outward, box + SURROUND_M * outward
    depths = WALL_DEPTHS_M / step_m
    return np.array([agreement(views, area, hole, depth, in_hole=False) for depth in depths])


def _glass_curve(
    box: FloatArray, views: Sequence[PreparedView], step_m: float, wall_m: float
) -> FloatArray:
    """Agreement of the views inside a box at every depth of `GLASS_DEPTHS_M` behind the wall."""
    hole = box + BORDER_M / step_m * np.array([1, 1, -1, -1])
    depths = (wall_m + GLASS_DEPTHS_M) / step_m
    return np.array([agreement(views, box, hole, depth, in_hole=True) for depth in depths])


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
