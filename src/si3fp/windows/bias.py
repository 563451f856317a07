"""M.1: the edges that no camera saw, on a render with depth (docs/decisions/0012-depth-renders.md).

A perpendicular ray shows the glass where it is, so a render with depth has no parallax. But seen
from below, the lowest part of recessed glass lies behind the sill for all cameras, and so the
lower edge appears too high: ``r tan(e)`` for glass r behind the wall and the smallest elevation e
(METHOD decision 12). From above it is the upper edge, and a jamb if all cameras look from its side.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from si3fp.config import MeasureConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import OrthoImage
from si3fp.windows.measure import MIN_DISTANCE_M, OUTWARD, EdgeLever, edges_from_box, recess_depth
from si3fp.windows.recess_estimate import RecessEstimate

TRUSTED_PHOTOS = 2
"""What fewer photos saw is masked in a render."""
MIDDLE = 0.15
"""Share left out at both ends of a side, where the next side's hidden strip crosses."""
SETBACK = 0.5
"""Share of the recess from which a place lies behind the wall."""


def hidden_lever(
    edges_m: FloatArray, recess_m: float, cameras_in_facade: Sequence[FloatArray]
) -> FloatArray:
    """How much of the glass is hidden at each edge (4,) per metre of recess.

    Parameters
    ----------
    edges_m
        Left, right, bottom, top of the glass that shows.
    recess_m
        Depth of the glass.
    cameras_in_facade
        Optical centres (3,) of the photos that see the window.

    Notes
    -----
    The reveal hides the glass from a camera beyond the edge. An edge shows as far as the two best
    placed cameras see, because what one photo alone saw is masked. From the edge that shows, y, and
    a camera at (y_c, z_c) the hidden part is ``r (y - y_c) / (z_c + r)``: the line of sight touches
    the sill.
    """
    cameras = [camera for camera in cameras_in_facade if camera[2] > MIN_DISTANCE_M]
    if not cameras:
        return np.zeros(4)
    hidden = [
        np.clip(-OUTWARD * (edges_m - camera[[0, 0, 1, 1]]), 0, None) / (camera[2] + recess_m)
        for camera in cameras
    ]
    lever: FloatArray = np.sort(hidden, axis=0)[min(TRUSTED_PHOTOS, len(hidden)) - 1]
    return lever


def render_lever(
    box_px: FloatArray,
    recess: RecessEstimate,
    ortho: OrthoImage,
    wall_m: float,
    cameras_in_facade: Sequence[FloatArray],
    grid: FacadeGrid,
    config: MeasureConfig,
) -> EdgeLever:
    """How far the edges of a window appear moved inwards on a render with depth.

    Parameters
    ----------
    box_px
        (4,) x0 y0 x1 y1 as it appears.
    recess
        Depth of its glass.
    ortho
        The render: valid is False where fewer than two photos saw.
    wall_m
        Depth of the wall in front of the facade plane.
    cameras_in_facade
        Optical centres of the photos that see the window.
    grid, config
        Grid of the image; the assumed recess.

    Notes
    -----
    The geometry says how much can be hidden. The image says how much is missing from the box: the
    strip outside an edge counts as glass as far as it was not seen or lies behind the wall. Wall
    that shows there means that the edge is already right.
    """
    edges_m = edges_from_box(box_px, grid)
    depth_m = recess_depth(recess, config)
    lever = hidden_lever(edges_m, depth_m, cameras_in_facade)
    reach_px = lever * depth_m / grid.m_per_px
    corner = np.maximum(np.floor(box_px[:2] - reach_px[[0, 3]]).astype(int), 0)
    end = np.maximum(np.ceil(box_px[2:] + reach_px[[1, 2]]).astype(int), 0)
    opening = _opening(ortho, wall_m - SETBACK * depth_m, corner, end)
    box = box_px - np.tile(corner, 2)
    shares = np.array([_share_outside(side, box, opening, reach_px[side]) for side in range(4)])
    return EdgeLever(lever * shares, lever * np.sqrt(shares * (1 - shares)))


def _opening(
    ortho: OrthoImage, behind_m: float, corner: NDArray[np.int_], end: NDArray[np.int_]
) -> FloatArray:
    """1 where a pixel of a part was not seen or lies deeper than ``behind_m``, else 0."""
    part = (slice(corner[1], end[1]), slice(corner[0], end[0]))
    opening = ~ortho.valid[part]
    if ortho.seen_by is not None:
        opening = opening | (ortho.seen_by[part] < TRUSTED_PHOTOS)
    if ortho.depth_m is not None:
        opening = opening | (ortho.depth_m[part] < behind_m)
    return opening.astype(np.float64)


def _share_outside(side: int, box_px: FloatArray, opening: FloatArray, reach_px: float) -> float:
    """Share of the strip of ``reach_px`` outside a side that belongs to the opening, from it on."""
    left, top, right, bottom = box_px
    # Turned so that the side is on top and the outside runs downwards from the first row.
    turned, start, low, high = (
        (opening[:, ::-1].T, opening.shape[1] - left, top, bottom),
        (opening.T, right, top, bottom),
        (opening, bottom, left, right),
        (opening[::-1], opening.shape[0] - top, left, right),
    )[side]
    margin = MIDDLE * (high - low)
    columns = slice(max(round(low + margin), 0), max(round(high - margin), 0))
    first, last = max(int(np.floor(start)), 0), int(np.ceil(start + reach_px))
    strip = turned[first:last, columns]
    if reach_px <= 0 or not strip.size:
        return 0.0
    # Beyond the first wall nothing belongs to the opening any more.
    profile = np.minimum.accumulate(strip.mean(axis=1))
    rows = first + np.arange(len(profile))
    weight = np.clip(np.minimum(rows + 1, start + reach_px) - np.maximum(rows, start), 0, None)
    return float(np.clip((profile * weight).sum() / reach_px, 0, 1))
