"""Equirectangular cameras: pixels, rays and the pose of a panorama.

Frame ``pano``: x right, y down, z forward (through the image centre). Pixel (0, 0) is the upper
left corner of the upper left pixel, (0.5, 0.5) its centre.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from si3fp.geometry.rigid import FloatArray


def directions_from_pixels(pixels: ArrayLike, width_px: int, height_px: int) -> FloatArray:
    """Unit rays in frame ``pano`` of equirectangular pixels.

    ``yaw = (x / W - 0.5) * 360``, ``pitch = (0.5 - y / H) * 180``,
    ``ray = (cos p sin yaw, -sin p, cos p cos yaw)``.

    Parameters
    ----------
    pixels
        (..., 2) x, y in pixels.
    width_px, height_px
        Size of the full 360 x 180 degree image.

    Returns
    -------
    (..., 3) unit vectors.

    Examples
    --------
    >>> directions_from_pixels([4096.0, 2048.0], 8192, 4096).round(6).tolist()
    [0.0, -0.0, 1.0]
    """
    xy: FloatArray = np.asarray(pixels, dtype=np.float64)
    yaw = (xy[..., 0] / width_px - 0.5) * (2 * np.pi)
    pitch = (0.5 - xy[..., 1] / height_px) * np.pi
    return np.stack(
        [np.cos(pitch) * np.sin(yaw), -np.sin(pitch), np.cos(pitch) * np.cos(yaw)], axis=-1
    )


def pixels_from_directions(
    directions_in_pano: ArrayLike, width_px: int, height_px: int
) -> FloatArray:
    """Equirectangular pixels (..., 2) that rays (..., 3) in frame ``pano`` hit; x in [0, W)."""
    rays: FloatArray = np.asarray(directions_in_pano, dtype=np.float64)
    yaw = np.arctan2(rays[..., 0], rays[..., 2])
    pitch = np.arctan2(-rays[..., 1], np.hypot(rays[..., 0], rays[..., 2]))
    x = (yaw / (2 * np.pi) + 0.5) * width_px
    return np.stack([np.mod(x, width_px), (0.5 - pitch / np.pi) * height_px], axis=-1)


def world_from_pano_rotation(heading_deg: float, pitch_deg: float, roll_deg: float) -> FloatArray:
    """Rotation (3, 3) of a panorama: heading about up, then pitch, then roll.

    Parameters
    ----------
    heading_deg
        Compass bearing of the image centre, clockwise from north.
    pitch_deg
        Elevation of the image centre above the horizon.
    roll_deg
        Positive when the right side is down.

    Examples
    --------
    >>> east = world_from_pano_rotation(90.0, 0.0, 0.0) @ [0.0, 0.0, 1.0]
    >>> (east.round(6) + 0.0).tolist()
    [1.0, 0.0, 0.0]
    """
    heading, pitch, roll = np.deg2rad([heading_deg, pitch_deg, roll_deg])
    about_up = np.array(
        [
            [np.cos(heading), np.sin(heading), 0.0],
            [-np.sin(heading), np.cos(heading), 0.0],
            [0.0, 0.0, 1.0],
        ]
    )
    level = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    about_right = np.array(
        [
            [1.0, 0.0, 0.0],
            [0.0, np.cos(pitch), -np.sin(pitch)],
            [0.0, np.sin(pitch), np.cos(pitch)],
        ]
    )
    about_forward = np.array(
        [
            [np.cos(roll), -np.sin(roll), 0.0],
            [np.sin(roll), np.cos(roll), 0.0],
            [0.0, 0.0, 1.0],
        ]
    )
    rotation: FloatArray = about_up @ level @ about_right @ about_forward
    return rotation
