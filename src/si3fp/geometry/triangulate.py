"""A point in space from its pixels in several photos with known poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from si3fp.errors import InputError, ReconstructionError
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import FloatArray, Rigid3

_MIN_ANGLE_DEG = 1.0  # smaller: the depth error is 60 times the error across the ray
_OUTLIER_SIGMAS = 4.0
_ITERATIONS = 20


@dataclass(frozen=True, slots=True, eq=False)
class TriangulatedPoint:
    """A point with its uncertainty.

    Attributes
    ----------
    point_in_world
        (3,) in the units of the poses.
    covariance
        (3, 3) from the pixels' standard deviation; errors of the poses come on top.
    residuals_px
        (N, 2) projected minus marked pixel; NaN where the point lies behind the camera.
    used
        (N,) False for marks that disagree with the others.
    """

    point_in_world: FloatArray
    covariance: FloatArray
    residuals_px: FloatArray
    used: NDArray[np.bool_]


def triangulate(
    cameras: Sequence[Pinhole],
    cams_from_world: Sequence[Rigid3],
    pixels: ArrayLike,
    sigma_px: float = 1.0,
) -> TriangulatedPoint:
    """The point that was marked in several photos.

    The midpoint of the pair of rays that most marks agree with starts a Gauss-Newton refinement of
    the reprojection errors of those marks (Hartley and Zisserman 2004, chapter 12).

    Parameters
    ----------
    cameras, cams_from_world
        Camera and pose of each photo.
    pixels
        (N, 2) the mark in each photo, N >= 2.
    sigma_px
        Standard deviation of a mark.

    Raises
    ------
    InputError
        If there are fewer than two marks or one is not finite.
    ReconstructionError
        If no two rays meet at 1 degree or more in front of their cameras, or no mark agrees with
        another.
    """
    marks = np.asarray(pixels, dtype=np.float64)
    if marks.shape != (len(cameras), 2) or len(cams_from_world) != len(cameras):
        raise InputError(
            f"Triangulation needs one camera, pose and pixel per photo, got {len(cameras)} "
            f"cameras, {len(cams_from_world)} poses and pixels {marks.shape}."
        )
    if len(marks) < 2:
        raise InputError(f"A point needs marks in at least 2 photos, got {len(marks)}.")
    if not np.isfinite(marks).all() or not (np.isfinite(sigma_px) and sigma_px > 0):
        raise InputError(
            f"Marks and their standard deviation must be finite pixels, got {marks.tolist()} and "
            f"{sigma_px}."
        )
    start = _best_pair_midpoint(cameras, cams_from_world, marks, _OUTLIER_SIGMAS * sigma_px)
    used = _agreeing(cameras, cams_from_world, marks, start, 2 * _OUTLIER_SIGMAS * sigma_px)
    point, normal_matrix = _refined(cameras, cams_from_world, marks, start, used)
    agreeing = _agreeing(cameras, cams_from_world, marks, point, _OUTLIER_SIGMAS * sigma_px)
    if agreeing.sum() >= 2 and (agreeing != used).any():
        used = agreeing
        point, normal_matrix = _refined(cameras, cams_from_world, marks, point, used)
    residuals = _residuals(cameras, cams_from_world, marks, point)
    if used.sum() < 2 or not agreeing.any():
        nearest = np.sqrt(np.nanmin(np.nansum(residuals**2, axis=1)))
        raise ReconstructionError(
            f"The marks in {len(marks)} photos do not belong to one point (best residual "
            f"{nearest:.1f} px, {_OUTLIER_SIGMAS:g} x {sigma_px:g} px allowed); mark the same "
            "point in each photo."
        )
    covariance = np.asarray(sigma_px**2 * np.linalg.inv(normal_matrix), dtype=np.float64)
    return TriangulatedPoint(point, covariance, residuals, used)


def _best_pair_midpoint(
    cameras: Sequence[Pinhole], poses: Sequence[Rigid3], marks: FloatArray, limit_px: float
) -> FloatArray:
    centres = [pose.inverse().translation for pose in poses]
    rays = [
        pose.inverse().rotate(camera.unproject(mark))
        for camera, pose, mark in zip(cameras, poses, marks, strict=True)
    ]
    rays = [ray / np.linalg.norm(ray) for ray in rays]
    best: FloatArray | None = None
    least = np.inf
    for i, j in combinations(range(len(marks)), 2):
        if np.linalg.norm(np.cross(rays[i], rays[j])) < np.sin(np.deg2rad(_MIN_ANGLE_DEG)):
            continue
        along, _, _, _ = np.linalg.lstsq(
            np.column_stack([rays[i], -rays[j]]), centres[j] - centres[i], rcond=None
        )
        if (along <= 0).any():
            continue
        point = (centres[i] + along[0] * rays[i] + centres[j] + along[1] * rays[j]) / 2
        errors = np.linalg.norm(_residuals(cameras, poses, marks, point), axis=1)
        cost = float(np.minimum(np.nan_to_num(errors, nan=np.inf), 4 * limit_px).sum())
        if cost < least:
            best, least = point, cost
    if best is None:
        raise ReconstructionError(
            f"No two of the {len(marks)} marked rays meet at {_MIN_ANGLE_DEG:g} degree or more in "
            "front of their cameras; mark the point in photos taken farther apart, and check that "
            "it is the same point."
        )
    return best


def _residuals(
    cameras: Sequence[Pinhole], poses: Sequence[Rigid3], marks: FloatArray, point: FloatArray
) -> FloatArray:
    found = [camera.project(pose.apply(point)) for camera, pose in zip(cameras, poses, strict=True)]
    return np.stack(found) - marks


def _agreeing(
    cameras: Sequence[Pinhole],
    poses: Sequence[Rigid3],
    marks: FloatArray,
    point: FloatArray,
    limit_px: float,
) -> NDArray[np.bool_]:
    errors = np.linalg.norm(_residuals(cameras, poses, marks, point), axis=1)
    agreeing: NDArray[np.bool_] = errors <= limit_px  # NaN, behind the camera, is False
    return agreeing


def _refined(
    cameras: Sequence[Pinhole],
    poses: Sequence[Rigid3],
    marks: FloatArray,
    start: FloatArray,
    used: NDArray[np.bool_],
) -> tuple[FloatArray, FloatArray]:
    """Point (3,) and normal matrix (3, 3) of the least-squares fit to the marks used."""
    index: list[int] = np.flatnonzero(used).tolist()
    if len(index) < 2:
        return start, np.eye(3)
    point = start
    for _ in range(_ITERATIONS):
        jacobian = np.concatenate([_jacobian(cameras[i], poses[i], point) for i in index])
        errors = _residuals(cameras, poses, marks, point)[index].ravel()
        normal_matrix: FloatArray = jacobian.T @ jacobian
        step, _, _, _ = np.linalg.lstsq(jacobian, errors, rcond=None)
        if not np.isfinite(step).all():
            break
        point = point - step
        if np.linalg.norm(step) <= 1e-10 * (1 + np.linalg.norm(point)):
            break
    return point, normal_matrix


def _jacobian(camera: Pinhole, pose: Rigid3, point: FloatArray) -> FloatArray:
    """Derivative (2, 3) of the pixel by the point in the world."""
    x, y, z = pose.apply(point)
    by_cam = np.array(
        [
            [camera.fx_px / z, 0.0, -camera.fx_px * x / z**2],
            [0.0, camera.fy_px / z, -camera.fy_px * y / z**2],
        ]
    )
    jacobian: FloatArray = by_cam @ pose.rotation
    return jacobian
