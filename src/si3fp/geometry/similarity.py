"""Similarity transforms: rotation, translation and one scale between two frames.

A reconstruction without measurements is known up to such a transform; a variable of type
`Similarity3` is named ``b_from_a``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from si3fp.errors import InputError
from si3fp.geometry.rigid import FloatArray, Rigid3

# Below this ratio of the spread across a line to the spread along it, the rotation about the line
# rests on noise: 3 cm on 30 m.
_MIN_SPREAD_RATIO = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Similarity3:
    """A rigid transform with a scale, ``x_in_b = scale * rotation @ x_in_a + translation``.

    Attributes
    ----------
    scale
        Units of b per unit of a, positive.
    rotation
        (3, 3) proper rotation matrix.
    translation
        (3,) the origin of frame a in frame b, in units of b.

    Raises
    ------
    InputError
        If a value is not finite, the scale not positive or the matrix not a rotation.
    """

    scale: float
    rotation: FloatArray
    translation: FloatArray

    def __post_init__(self) -> None:
        if not (np.isfinite(self.scale) and self.scale > 0):
            raise InputError(f"A similarity needs a positive, finite scale, got {self.scale}.")
        checked = Rigid3(self.rotation, self.translation)
        object.__setattr__(self, "scale", float(self.scale))
        object.__setattr__(self, "rotation", checked.rotation)
        object.__setattr__(self, "translation", checked.translation)

    def apply(self, points_in_a: ArrayLike) -> FloatArray:
        """Points in frame b, shape (..., 3)."""
        points: FloatArray = np.asarray(points_in_a, dtype=np.float64)
        return self.scale * points @ self.rotation.T + self.translation

    def rotate(self, directions_in_a: ArrayLike) -> FloatArray:
        """Directions in frame b, shape (..., 3), their length kept."""
        directions: FloatArray = np.asarray(directions_in_a, dtype=np.float64)
        return directions @ self.rotation.T

    def cam_from_b(self, cam_from_a: Rigid3) -> Rigid3:
        """The pose of the same camera with respect to frame b, in units of b.

        The camera sees the same picture: its frame is scaled with the points.
        """
        rotation = cam_from_a.rotation @ self.rotation.T
        return Rigid3(rotation, self.scale * cam_from_a.translation - rotation @ self.translation)

    def inverse(self) -> Similarity3:
        """The transform ``a_from_b``."""
        return Similarity3(
            1 / self.scale, self.rotation.T, -self.rotation.T @ self.translation / self.scale
        )

    def __matmul__(self, other: Similarity3) -> Similarity3:
        """``c_from_a = c_from_b @ b_from_a``."""
        return Similarity3(
            self.scale * other.scale,
            self.rotation @ other.rotation,
            self.apply(other.translation),
        )


@dataclass(frozen=True, slots=True, eq=False)
class SimilarityFit:
    """A similarity with how well it fits.

    Attributes
    ----------
    b_from_a
        The transform.
    residuals
        (N, 3) transformed points minus their targets, in units of b.
    """

    b_from_a: Similarity3
    residuals: FloatArray

    @property
    def distances(self) -> FloatArray:
        """(N,) lengths of the residuals."""
        distances: FloatArray = np.linalg.norm(self.residuals, axis=1)
        return distances


def fit_similarity(
    points_in_a: ArrayLike, points_in_b: ArrayLike, weights: ArrayLike | None = None
) -> SimilarityFit:
    """The similarity that takes points to their targets with the least weighted squared error.

    Parameters
    ----------
    points_in_a, points_in_b
        (N, 3) corresponding points, N >= 3, not on one line; one plane is enough.
    weights
        (N,) not negative, inverse variances up to a factor; equal if left out.

    Raises
    ------
    InputError
        If shapes differ, a value is not finite, or fewer than three points (of positive weight)
        lie off one line.

    Notes
    -----
    Umeyama (1991), Least-squares estimation of transformation parameters between two point
    patterns, IEEE PAMI 13(4), equations 34 to 43. Three points and points of one plane give a
    covariance of rank 2, where the rotation is the one of determinant +1.
    """
    source, target = _points(points_in_a), _points(points_in_b)
    if source.shape != target.shape:
        raise InputError(
            f"A similarity needs pairs of points, got {len(source)} and {len(target)} points."
        )
    weight = _weights(weights, len(source))
    count = int((weight > 0).sum())
    if count < 3:
        raise InputError(
            f"A similarity needs at least 3 pairs of points, got {count}; add known points."
        )
    weight = weight / weight.sum()
    source_mean, target_mean = weight @ source, weight @ target
    source_rest, target_rest = source - source_mean, target - target_mean
    for rest in (source_rest, target_rest):
        _require_off_line(rest * np.sqrt(weight)[:, None])

    u, singular, v_transposed = np.linalg.svd((target_rest * weight[:, None]).T @ source_rest)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(v_transposed))])
    rotation: FloatArray = (u * signs) @ v_transposed
    scale = float(singular @ signs / (weight @ (source_rest**2).sum(axis=1)))
    if scale <= 0:
        raise InputError(
            "No similarity fits: the two sets of points have nothing to do with each other. "
            "Check which point belongs to which."
        )
    b_from_a = Similarity3(scale, rotation, target_mean - scale * rotation @ source_mean)
    return SimilarityFit(b_from_a, b_from_a.apply(source) - target)


def _points(values: ArrayLike) -> FloatArray:
    points = np.asarray(values, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"Points of a similarity must be (N, 3), got {points.shape}.")
    if not np.isfinite(points).all():
        bad = np.flatnonzero(~np.isfinite(points).all(axis=1)).tolist()
        raise InputError(f"Points {bad} of a similarity contain NaN or infinity; remove them.")
    return points


def _weights(values: ArrayLike | None, count: int) -> FloatArray:
    weights = np.ones(count) if values is None else np.asarray(values, dtype=np.float64)
    if weights.shape != (count,) or not np.isfinite(weights).all() or (weights < 0).any():
        raise InputError(f"Weights must be {count} finite numbers >= 0, got {weights}.")
    return weights


def _require_off_line(rest: FloatArray) -> None:
    spread = np.linalg.svd(rest, compute_uv=False)
    if spread[1] <= _MIN_SPREAD_RATIO * spread[0]:
        raise InputError(
            f"The {len(rest)} known points lie on one line (spread across it "
            f"{spread[1]:.3g}, along it {spread[0]:.3g}), so the rotation about that line is "
            "unknown; add a point off the line."
        )
