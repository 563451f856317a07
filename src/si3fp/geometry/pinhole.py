"""Pinhole cameras: points in frame ``cam`` to pixels, and pixels to rays.

Frame ``cam``: x right, y down, z forward from the optical centre. Pixel (0, 0) is the upper left
corner of the upper left pixel, (0.5, 0.5) its centre, as in COLMAP.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from si3fp.errors import InputError
from si3fp.geometry.rigid import FloatArray


@dataclass(frozen=True, slots=True)
class Pinhole:
    """A camera without lens distortion.

    Attributes
    ----------
    fx_px, fy_px
        Focal lengths.
    cx_px, cy_px
        Principal point from the image's upper left corner.
    width_px, height_px
        Size of the image.

    Raises
    ------
    InputError
        If a value is not finite, or a focal length or the size not positive.
    """

    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    width_px: int
    height_px: int

    def __post_init__(self) -> None:
        finite = np.isfinite([self.fx_px, self.fy_px, self.cx_px, self.cy_px]).all()
        if not (finite and self.fx_px > 0 and self.fy_px > 0):
            raise InputError(
                f"A pinhole camera needs positive focal lengths and a finite principal point in "
                f"pixels, got {self}."
            )
        if self.width_px < 1 or self.height_px < 1:
            raise InputError(f"A camera of {self.width_px} x {self.height_px} px has no image.")

    def project(self, points_in_cam: ArrayLike) -> FloatArray:
        """Pixels (..., 2) of points (..., 3); NaN for points that are not in front of the camera.

        ``x_px = fx X / Z + cx``, ``y_px = fy Y / Z + cy``.

        Examples
        --------
        >>> Pinhole(1000.0, 1000.0, 320.0, 240.0, 640, 480).project([1.0, 0.0, 10.0]).tolist()
        [420.0, 240.0]
        """
        points: FloatArray = np.asarray(points_in_cam, dtype=np.float64)
        z = points[..., 2]
        depth = np.where(z > 0, z, np.nan)
        return np.stack(
            [
                self.fx_px * points[..., 0] / depth + self.cx_px,
                self.fy_px * points[..., 1] / depth + self.cy_px,
            ],
            axis=-1,
        )

    def unproject(self, pixels: ArrayLike) -> FloatArray:
        """Rays (..., 3) through pixels (..., 2), with z = 1: ray times depth is the point.

        Examples
        --------
        >>> Pinhole(1000.0, 1000.0, 320.0, 240.0, 640, 480).unproject([420.0, 240.0]).tolist()
        [0.1, 0.0, 1.0]
        """
        xy: FloatArray = np.asarray(pixels, dtype=np.float64)
        x = (xy[..., 0] - self.cx_px) / self.fx_px
        y = (xy[..., 1] - self.cy_px) / self.fy_px
        return np.stack([x, y, np.ones_like(x)], axis=-1)
