"""M.1: what the depth of an orthographic render tells of its wall and the recesses in it.

Depth is metres in front of the facade plane. All is compared with the wall itself, which may lie
some centimetres off that plane.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from si3fp.config import MeasureConfig
from si3fp.errors import InputError
from si3fp.geometry.rigid import FloatArray
from si3fp.model import OrthoImage
from si3fp.windows.recess import BORDER_M, GLASS_DEPTHS_M, RING_M, SURROUND_M
from si3fp.windows.recess_estimate import ALIKE, UNKNOWN_RECESS, RecessEstimate, drawn_to_kind

WALL_WITHIN_M = 0.3
"""The wall lies this near to the facade plane."""
IN_FRONT_M = 0.4
"""What stands so far in front of the wall is no wall and no window of it."""
FRAME_M = 0.10
"""Width of the strip inside a window's border where its frame is looked for."""
WALL_SIGMA_M = 0.02
"""No wall's depth is known better."""
FLAT_M = 0.08
"""How far the wall lies off its usual depth, standard deviation."""
KNOWN_SHARE = 0.5
"""Share of an area whose depth must be known."""
LEAST_PARTS = 3
"""Of four borders and the middle of a window, so many must tell a depth."""
MAX_SPREAD_M = 0.10
"""A part whose pixels, or a window whose parts scatter more, tells nothing."""
MEDIAN_ERROR = 1.25
"""Standard deviation of a median over that of a mean."""


def known_depth(ortho: OrthoImage) -> FloatArray:
    """(H, W) depth where the image is valid, NaN elsewhere.

    Raises
    ------
    InputError
        If the image has no depth.
    """
    if ortho.depth_m is None:
        raise InputError(
            f"Orthographic image {ortho.source} has no depth; render it with depth or parse its "
            "views."
        )
    return np.where(ortho.valid, ortho.depth_m, np.nan).astype(np.float64)


def wall_depth(ortho: OrthoImage) -> float:
    """Metres by which the wall lies in front of the facade plane; 0 where no depth is known."""
    depth_m = known_depth(ortho)
    near = depth_m[np.abs(depth_m) < WALL_WITHIN_M]
    return float(np.median(near)) if len(near) else 0.0


def in_front(ortho: OrthoImage, wall_m: float) -> NDArray[np.bool_]:
    """(H, W) where something stands in front of the wall: balconies, trees, other buildings."""
    depth_m = known_depth(ortho)
    hides: NDArray[np.bool_] = depth_m - wall_m > IN_FRONT_M
    return hides


def part_of(box_px: FloatArray) -> tuple[slice, slice]:
    """Rows and columns of the whole pixels next to a box (4,)."""
    left, top, right, bottom = np.maximum(np.round(box_px).astype(int), 0)
    return slice(top, bottom), slice(left, right)


def share_within(mask: NDArray[np.bool_], box_px: FloatArray) -> float:
    """Share of a box (4,) where a mask is True; 0 for a box off the image."""
    part = mask[part_of(box_px)]
    return float(part.mean()) if part.size else 0.0


def depth_recesses(
    ortho: OrthoImage, boxes_px: FloatArray, wall_m: float, m_per_px: float, config: MeasureConfig
) -> tuple[RecessEstimate, ...]:
    """The recess of every window (N, 4) by depth; None in it where its parts do not agree.

    Parameters
    ----------
    ortho
        Image with depth; only valid pixels count.
    boxes_px
        Windows without their surrounds.
    wall_m
        Usual depth of the wall.
    m_per_px
        Resolution.
    config
        Systematic error ``recess_floor_m``.

    Notes
    -----
    Panes show reflections, whose depth lies anywhere. So the four borders, where the frame is, and
    the middle have one vote each, and their median counts if they agree. Windows of one size are
    of one kind: each is drawn towards the median of its kind, and takes it where it tells nothing
    itself.
    """
    boxes = np.asarray(boxes_px, np.float64).reshape(-1, 4)
    depth_m = known_depth(ortho)
    depth_m = np.where(depth_m - wall_m > IN_FRONT_M, np.nan, depth_m)
    walls = [_wall_around(depth_m, box, boxes, wall_m, m_per_px) for box in boxes]
    own = [
        _own_recess(depth_m, box, around_m, m_per_px, np.hypot(config.recess_floor_m, sigma_m))
        for box, (around_m, sigma_m) in zip(boxes, walls, strict=True)
    ]
    log_size = np.log(np.maximum(boxes[:, 2:] - boxes[:, :2], 1.0))
    estimates = []
    for index, mine in enumerate(own):
        alike = np.abs(log_size - log_size[index]).max(axis=1) < ALIKE
        told = np.array([own[i][0] for i in np.flatnonzero(alike).tolist()], np.float64)
        told = told[np.isfinite(told)]
        if not len(told) or (len(told) < 2 and not np.isfinite(mine[0])):
            estimates.append(UNKNOWN_RECESS)
            continue
        value_m, sigma_m = mine
        value_m, sigma_m = drawn_to_kind(
            float(np.median(told)),
            told,
            value_m if np.isfinite(value_m) else None,
            sigma_m,
            config.recess_floor_m,
        )
        how = "depth" if np.isfinite(mine[0]) else f"the depth of {len(told)} windows of its size"
        glass_m = value_m - walls[index][0]
        estimates.append(RecessEstimate(value_m, sigma_m, glass_m, 1, how))
    return tuple(estimates)


def _wall_around(
    depth_m: FloatArray, box: FloatArray, boxes: FloatArray, usual_m: float, m_per_px: float
) -> tuple[float, float]:
    """Depth of the wall around a window and its standard deviation.

    The ring around the window tells it, the less the more it scatters: walls without texture bulge
    in a render, but are flat.
    """
    near, far = SURROUND_M / m_per_px, (SURROUND_M + RING_M) / m_per_px
    outwards = np.array([-1.0, -1.0, 1.0, 1.0])
    rows, columns = part_of(box + far * outwards)
    ring = depth_m[rows, columns].copy()
    for other in boxes:
        inner_rows, inner_columns = part_of(
            other + near * outwards - [columns.start, rows.start] * 2
        )
        ring[inner_rows, inner_columns] = np.nan
    near_wall = ring[np.abs(ring - usual_m) < WALL_WITHIN_M]
    area = (far - near) * float((box[2:] - box[:2]).sum())
    if len(near_wall) <= KNOWN_SHARE * area:
        return usual_m, WALL_SIGMA_M
    middle_m, spread_m = _middle_and_spread(near_wall)
    told = 1 / max(spread_m, WALL_SIGMA_M) ** 2
    flat = 1 / FLAT_M**2
    return (told * middle_m + flat * usual_m) / (told + flat), float((told + flat) ** -0.5)


def _own_recess(
    depth_m: FloatArray, box: FloatArray, wall_m: float, m_per_px: float, floor_m: float
) -> tuple[float, float]:
    """Recess and its standard deviation from one window alone; NaN where it tells none."""
    start, stop = BORDER_M / m_per_px, (BORDER_M + FRAME_M) / m_per_px
    left, top, right, bottom = box
    inner = (left + start, top + start, right - start, bottom - start)
    parts = (
        (inner[0], inner[1], left + stop, inner[3]),
        (right - stop, inner[1], inner[2], inner[3]),
        (inner[0], inner[1], inner[2], top + stop),
        (inner[0], bottom - stop, inner[2], inner[3]),
        (left + stop, top + stop, right - stop, bottom - stop),
    )
    told = []
    for part in parts:
        area = depth_m[part_of(np.array(part))]
        known = area[np.isfinite(area)]
        if not area.size or len(known) <= KNOWN_SHARE * area.size:
            continue
        middle_m, spread_m = _middle_and_spread(known)
        if spread_m <= MAX_SPREAD_M:
            told.append(wall_m - middle_m)
    if len(told) < LEAST_PARTS:
        return float("nan"), 0.0
    value_m, spread_m = _middle_and_spread(np.array(told))
    if spread_m > MAX_SPREAD_M or not GLASS_DEPTHS_M[0] <= value_m <= GLASS_DEPTHS_M[-1]:
        return float("nan"), 0.0
    return value_m, float(np.hypot(MEDIAN_ERROR * spread_m / np.sqrt(len(told)), floor_m))


def _middle_and_spread(values: FloatArray) -> tuple[float, float]:
    """Median, and the median deviation from it as a standard deviation."""
    middle = float(np.median(values))
    return middle, 1.4826 * float(np.median(np.abs(values - middle)))
