"""Where a view on the wall plane shows what lies behind the wall.

At depth ``r`` behind the plane, the point ``s`` is seen by a camera with foot ``c`` and distance
``z`` at ``(s z + r c) / (z + r)``, on each axis of the wall: a scaling and a shift.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from si3fp.geometry.rigid import FloatArray
from si3fp.model import OrthoImage


def seen_from(foot_px: FloatArray, distance_px: float, depth_px: float) -> tuple[float, FloatArray]:
    """Factor and shift (2,) from a place on a plane behind the wall to where a view shows it.

    Parameters
    ----------
    foot_px
        Foot (2,) of the camera on the wall, in pixels of the view.
    distance_px
        Distance of the camera to the wall, in the same pixels.
    depth_px
        Depth of the plane behind the wall, in the same pixels.
    """
    whole = distance_px + depth_px
    return distance_px / whole, depth_px / whole * foot_px


def patch_warp(shrink: float, shift: FloatArray, corner_px: tuple[int, int]) -> FloatArray:
    """(2, 3) matrix for `cv2.warpAffine` with ``WARP_INVERSE_MAP``: a patch of that plane.

    ``corner_px`` is the upper left corner of the patch on the grid.
    """
    # cv2 counts from the centre of the first pixel.
    x, y = shrink * (np.array(corner_px) + 0.5) + shift - 0.5
    return np.array([[shrink, 0.0, x], [0.0, shrink, y]])


def widest_views(
    views: Sequence[OrthoImage], cameras_in_facade: Mapping[str, FloatArray], count: int
) -> list[OrthoImage]:
    """At most ``count`` views whose directions to the wall lie far apart, in the order given."""
    if not views:
        return []
    cameras = np.array([cameras_in_facade[view.source] for view in views])
    slopes = cameras[:, :2] / np.maximum(cameras[:, 2:], 0.5)
    taken = [int(np.linalg.norm(slopes - np.median(slopes, axis=0), axis=1).argmin())]
    gap = np.linalg.norm(slopes - slopes[taken[0]], axis=1)
    while len(taken) < min(count, len(views)):
        gap[taken] = -1.0
        taken.append(int(gap.argmax()))
        gap = np.minimum(gap, np.linalg.norm(slopes - slopes[taken[-1]], axis=1))
    return [views[index] for index in sorted(taken)]
