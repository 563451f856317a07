"""The fused orthophoto with the insides of its windows at their own depth.

What lies behind the wall stands at another place in every view on the wall plane, so that their
blend smears frames and bars. Where the depth of the glass is known, the views are blended on the
plane of the glass instead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np

from si3fp.blend import blend, exposure_gains
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Image, OrthoImage
from si3fp.ortho import wall_resolution
from si3fp.windows.parallax import patch_warp, seen_from
from si3fp.windows.recess_estimate import RecessEstimate

REVEAL_PX = 1.5
"""Left out inside an opening's border, where a view mixes it with the wall."""
MIN_SHARE = 0.34
"""A place that a smaller share of the views sees stays as it is on the wall plane."""
SPREAD_PX = 9
"""Size of the neighbourhood in which the agreement of the views is compared."""
MAX_SPREAD = 40.0
"""Grey levels: a view farther off counts as this."""
GLASS_FIRST = 1.3
"""The views may lie this much farther apart on the glass than on the wall, which reflections do."""
MAX_RATIO = 0.78
"""Of these two distances in a whole window; above it, the picture on the wall plane is sharper."""
FEATHER_PX = 1.0
"""Standard deviation of the soft border between the two pictures."""


def sharpen_windows(
    fused: OrthoImage,
    views: Sequence[OrthoImage],
    boxes_px: Sequence[FloatArray] | FloatArray,
    recesses: Sequence[RecessEstimate],
    cameras_in_facade: Mapping[str, FloatArray],
    grid: FacadeGrid,
) -> OrthoImage:
    """The fused image with every window of known recess blended on the plane of its glass.

    Parameters
    ----------
    fused
        Blend of the views on the wall plane.
    views
        The registered views.
    boxes_px
        (N, 4) openings x0 y0 x1 y1 as they are, corrected for the recess.
    recesses
        Their depths from `si3fp.windows.recess.estimate_recess`.
    cameras_in_facade
        Optical centres (3,) in the facade frame by view id.
    grid
        The grid of all images.
    """
    known = [view for view in views if view.source in cameras_in_facade]
    if not known or all(recess.recess_m is None for recess in recesses):
        return fused
    gains = exposure_gains(known)
    rgb = fused.rgb.copy()
    limit = np.array([grid.width_px, grid.height_px])
    for box, recess in zip(boxes_px, recesses, strict=True):
        if recess.recess_m is None:
            continue
        left, top = np.clip(np.floor(box[:2]).astype(int), 0, limit)
        right, bottom = np.clip(np.ceil(box[2:]).astype(int), 0, limit)
        if right - left < 3 or bottom - top < 3:
            continue
        depth_px = recess.glass_m / grid.m_per_px
        area = (int(left), int(top), int(right), int(bottom))
        parts, weights = [], []
        for view in known:
            camera = cameras_in_facade[view.source]
            parts.append(view_behind(view, box, area, camera, depth_px, grid))
            weights.append(weight_within(area, camera, grid))
        inside = blend(parts, weights, gains)
        old = rgb[top:bottom, left:right]
        wall = [
            OrthoImage(v.source, v.rgb[top:bottom, left:right], v.valid[top:bottom, left:right])
            for v in known
        ]
        on_glass, on_wall = _spread(parts, inside.rgb, gains), _spread(wall, old, gains)
        if on_glass[inside.valid].sum() > MAX_RATIO * on_wall[inside.valid].sum():
            continue
        share = _share(on_glass, on_wall, parts)
        mixed = share * inside.rgb + (1 - share) * old
        rgb[top:bottom, left:right] = np.round(mixed).astype(np.uint8)
    return OrthoImage(fused.source, rgb, fused.valid, fused.depth_m, fused.seen_by)


def view_behind(
    view: OrthoImage,
    box: FloatArray,
    area: tuple[int, int, int, int],
    camera: FloatArray,
    depth_px: float,
    grid: FacadeGrid,
) -> OrthoImage:
    """A view of a plane behind the wall in ``area``, valid where it sees that past an opening.

    Parameters
    ----------
    view
        Registered view on the wall plane.
    box
        (4,) x0 y0 x1 y1 of the opening in the wall.
    area
        The part of the plane that is shown, likewise.
    camera
        Optical centre (3,) in the facade frame.
    depth_px
        Depth of the plane behind the wall, in pixels.
    grid
        Grid of the view.
    """
    left, top, right, bottom = area
    foot = grid.pixels_from_facade(camera[:2])
    shrink, shift = seen_from(foot, float(camera[2]) / grid.m_per_px, depth_px)
    warp, size = patch_warp(shrink, shift, (left, top)), (right - left, bottom - top)
    flags = cv2.WARP_INVERSE_MAP
    rgb = cv2.warpAffine(view.rgb, warp, size, flags=flags | cv2.INTER_CUBIC)
    valid = cv2.warpAffine(
        view.valid.view(np.uint8), warp, size, flags=flags | cv2.INTER_NEAREST
    ).astype(bool)
    x = shrink * (np.arange(left, right) + 0.5) + shift[0]
    y = shrink * (np.arange(top, bottom) + 0.5) + shift[1]
    valid &= ((x > box[0] + REVEAL_PX) & (x < box[2] - REVEAL_PX))[None, :]
    valid &= ((y > box[1] + REVEAL_PX) & (y < box[3] - REVEAL_PX))[:, None]
    if camera[2] <= 0:
        valid[...] = False
    return OrthoImage(view.source, np.asarray(rgb, np.uint8), valid)


def _spread(parts: Sequence[OrthoImage], middle: Image, gains: FloatArray) -> FloatArray:
    """(h, w) how far the views lie off their blend around every pixel, grey levels."""
    total, count = np.zeros(middle.shape[:2]), np.zeros(middle.shape[:2])
    for part, gain in zip(parts, gains, strict=True):
        off = np.minimum(np.abs(part.rgb * gain - middle).max(axis=2), MAX_SPREAD)
        total += off * part.valid
        count += part.valid
    size = (SPREAD_PX, SPREAD_PX)
    return np.asarray(cv2.blur(total, size) / np.maximum(cv2.blur(count, size), 1e-6), np.float64)


def _share(glass: FloatArray, wall: FloatArray, parts: Sequence[OrthoImage]) -> FloatArray:
    """(h, w, 1) share of the picture on the glass plane: where the views agree better on it."""
    better = 1 / (1 + (glass / np.maximum(GLASS_FIRST * wall, 1e-6)) ** 8)
    seen_by = np.sum([part.valid for part in parts], axis=0)
    enough = (seen_by >= max(1.0, MIN_SHARE * seen_by.max())).astype(np.float64)
    enough[[0, -1]] = enough[:, [0, -1]] = 0.0
    # Eroded first, so that the feather ends where the views end.
    core = cv2.erode(enough, np.ones((3, 3)), borderValue=0)
    feather = cv2.GaussianBlur(core, (0, 0), FEATHER_PX) * enough
    share: FloatArray = (better * feather)[..., None]
    return share


def weight_within(
    area: tuple[int, int, int, int], camera: FloatArray, grid: FacadeGrid
) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """(h, w) resolution of the view of a ``camera`` (3,) in ``area``, as for the fused image."""
    left, top, right, bottom = area
    x = (np.arange(left, right) + 0.5) * grid.m_per_px - camera[0]
    y = (grid.height_px - np.arange(top, bottom) - 0.5) * grid.m_per_px - camera[1]
    return wall_resolution(x[None, :], y[:, None], float(camera[2])).astype(np.float32)
