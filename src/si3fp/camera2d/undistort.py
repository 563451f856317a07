"""Photos without lens distortion: OpenCV's model with k1, k2, p1 and p2, which is COLMAP's OPENCV.

In coordinates x = X / Z, y = Y / Z of frame ``cam`` and with r^2 = x^2 + y^2 the lens moves a point
to ``x (1 + k1 r^2 + k2 r^4) + 2 p1 x y + p2 (r^2 + 2 x^2)``, and y likewise with p1 and p2
exchanged (Brown 1971, Close-range camera calibration).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from si3fp.errors import InputError
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Image

_BORDER_STEPS = 200  # points on each side of the image
_ITERATIONS = 50
_TOLERANCE_PX = 1e-6
_BAND_PX = 512  # rows resampled at once: the maps of 50 megapixels would take 400 MB
_MIN_SHARE = 0.5  # of either side that must remain


@dataclass(frozen=True, slots=True, eq=False)
class Lens:
    """A camera as it took the photo.

    Attributes
    ----------
    camera
        Focal lengths, principal point and size of the photo as stored upright.
    distortion
        (4,) coefficients k1, k2, p1, p2; all zero for a photo free of distortion.

    Raises
    ------
    InputError
        If the coefficients are not four finite numbers.
    """

    camera: Pinhole
    distortion: FloatArray

    def __post_init__(self) -> None:
        distortion = np.asarray(self.distortion, dtype=np.float64)
        if distortion.shape != (4,) or not np.isfinite(distortion).all():
            raise InputError(
                f"The distortion of a lens is k1, k2, p1, p2, four finite numbers, got "
                f"{distortion.tolist()}."
            )
        object.__setattr__(self, "distortion", distortion)

    def project(self, points_in_cam: ArrayLike) -> FloatArray:
        """Pixels (..., 2) of points (..., 3) in the photo as taken; NaN behind the camera."""
        points: FloatArray = np.asarray(points_in_cam, dtype=np.float64)
        depth = np.where(points[..., 2:] > 0, points[..., 2:], np.nan)
        return _pixels(self.camera, _distorted(points[..., :2] / depth, self.distortion))


def undistorted_camera(lens: Lens) -> Pinhole:
    """The camera of the photo once the distortion is taken out.

    Its focal lengths are the lens's; its image is the largest rectangle, upright and of whole
    pixels between the borders' innermost points, of which every pixel lies inside the photo.
    Without distortion it is the lens's own camera.

    Raises
    ------
    InputError
        If the distortion folds the image over or leaves less than half of it.
    """
    camera = lens.camera
    if not lens.distortion.any():
        return camera
    steps = np.linspace(0.0, 1.0, _BORDER_STEPS)
    zeros, ones = np.zeros_like(steps), np.ones_like(steps)
    sides = np.array([[zeros, steps], [ones, steps], [steps, zeros], [steps, ones]])
    border = np.moveaxis(sides, 1, -1) * [camera.width_px, camera.height_px]
    left, right, top, bottom = _undistorted(lens, border)
    x0, x1 = np.ceil(left[:, 0].max()), np.floor(right[:, 0].min())
    y0, y1 = np.ceil(top[:, 1].max()), np.floor(bottom[:, 1].min())
    if x1 - x0 < _MIN_SHARE * camera.width_px or y1 - y0 < _MIN_SHARE * camera.height_px:
        raise InputError(
            f"{_named(lens)} leaves {max(x1 - x0, 0):.0f} x {max(y1 - y0, 0):.0f} px of the "
            "photo. Add photos taken with this camera, or leave its photos out."
        )
    return Pinhole(
        camera.fx_px,
        camera.fy_px,
        camera.cx_px - float(x0),
        camera.cy_px - float(y0),
        int(x1 - x0),
        int(y1 - y0),
    )


def undistort(image: Image, lens: Lens, target: Pinhole) -> Image:
    """The photo (H, W, 3) as ``target`` would have taken it from the same place.

    Parameters
    ----------
    image
        RGB pixels of the lens's size; returned as it is where nothing is to be done.
    lens
        The camera that took it.
    target
        Camera of the result, which gives its size.

    Raises
    ------
    InputError
        If the photo is not of the lens's size.
    """
    camera = lens.camera
    if image.shape[:2] != (camera.height_px, camera.width_px):
        raise InputError(
            f"The photo is {image.shape[1]} x {image.shape[0]} px but its camera "
            f"{camera.width_px} x {camera.height_px} px; give the photos that the cameras were "
            "made from, upright and in full size."
        )
    if target == camera and not lens.distortion.any():
        return image
    result = np.empty((target.height_px, target.width_px, 3), np.uint8)
    for top in range(0, target.height_px, _BAND_PX):
        rows = min(_BAND_PX, target.height_px - top)
        map_x, map_y = cv2.initUndistortRectifyMap(
            _matrix(camera),
            lens.distortion,
            None,
            _matrix(target) - np.array([[0, 0, 0], [0, 0, top], [0, 0, 0]]),
            (target.width_px, rows),
            cv2.CV_32FC1,
        )
        band = cv2.remap(image, map_x, map_y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        result[top : top + rows] = band
    return result


def _matrix(camera: Pinhole) -> FloatArray:
    """(3, 3) for cv2, which puts (0, 0) at the centre of the first pixel."""
    return np.array(
        [
            [camera.fx_px, 0.0, camera.cx_px - 0.5],
            [0.0, camera.fy_px, camera.cy_px - 0.5],
            [0.0, 0.0, 1.0],
        ]
    )


def _pixels(camera: Pinhole, normalised: FloatArray) -> FloatArray:
    focal, centre = [camera.fx_px, camera.fy_px], [camera.cx_px, camera.cy_px]
    pixels: FloatArray = normalised * focal + centre
    return pixels


def _distorted(normalised: FloatArray, distortion: FloatArray) -> FloatArray:
    k1, k2, p1, p2 = distortion
    x, y = normalised[..., 0], normalised[..., 1]
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2 * r2
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + 2 * p2 * x * y + p1 * (r2 + 2 * y * y),
        ],
        axis=-1,
    )


def _jacobian(normalised: FloatArray, distortion: FloatArray) -> FloatArray:
    """Derivatives (..., 2, 2) of `_distorted`."""
    k1, k2, p1, p2 = distortion
    x, y = normalised[..., 0], normalised[..., 1]
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2 * r2
    slope = 2 * k1 + 4 * k2 * r2
    across = slope * x * y + 2 * p1 * x + 2 * p2 * y
    rows = [
        np.stack([radial + slope * x * x + 2 * p1 * y + 6 * p2 * x, across], axis=-1),
        np.stack([across, radial + slope * y * y + 2 * p2 * x + 6 * p1 * y], axis=-1),
    ]
    return np.stack(rows, axis=-2)


def _undistorted(lens: Lens, pixels: FloatArray) -> FloatArray:
    """Pixels (..., 2) of a camera without distortion, by Newton's method from the centre outwards.

    The image must not fold: where the Jacobian turns singular on the way, several points have the
    same pixel.
    """
    camera = lens.camera
    seen = camera.unproject(pixels)[..., :2]
    found = np.zeros_like(seen)
    # In steps along the ray, so that Newton's method stays on the branch of the image's centre.
    for share in (0.25, 0.5, 0.75, 1.0):
        for _ in range(_ITERATIONS):
            jacobian = _jacobian(found, lens.distortion)
            if (np.linalg.det(jacobian) <= 0).any():
                raise InputError(
                    f"{_named(lens)} folds the image over. Add photos taken with this camera, or "
                    "leave its photos out."
                )
            gap = _distorted(found, lens.distortion) - share * seen
            found = found - np.linalg.solve(jacobian, gap[..., None])[..., 0]
            if np.abs(gap).max() * camera.fx_px < _TOLERANCE_PX:
                break
        else:
            raise InputError(
                f"{_named(lens)} has no inverse at the edge of the image. Add photos taken with "
                "this camera, or leave its photos out."
            )
    return _pixels(camera, found)


def _named(lens: Lens) -> str:
    numbers = ", ".join(f"{value:.4g}" for value in lens.distortion)
    return (
        f"The lens distortion (k1, k2, p1, p2 = {numbers}) of a camera of "
        f"{lens.camera.width_px} x {lens.camera.height_px} px, focal length "
        f"{lens.camera.fx_px:.0f} px,"
    )
