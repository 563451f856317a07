"""Rigid transforms between frames; a variable of type `Rigid3` is named ``b_from_a``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from si3fp.errors import InputError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Rigid3:
    """A rotation followed by a translation, ``x_in_b = rotation @ x_in_a + translation``.

    Attributes
    ----------
    rotation
        (3, 3) proper rotation matrix, orthonormal to 1e-6.
    translation
        (3,) metres, the origin of frame a in frame b.

    Raises
    ------
    InputError
        If a value is not finite or the matrix is not a rotation.
    """

    rotation: FloatArray
    translation: FloatArray

    def __post_init__(self) -> None:
        rotation = np.asarray(self.rotation, dtype=np.float64)
        translation = np.asarray(self.translation, dtype=np.float64)
        if rotation.shape != (3, 3) or translation.shape != (3,):
            raise InputError(
                f"A rigid transform needs a (3, 3) rotation and a (3,) translation, "
                f"got {rotation.shape} and {translation.shape}."
            )
        if not (np.isfinite(rotation).all() and np.isfinite(translation).all()):
            raise InputError(
                "A pose contains NaN or infinity; remove the image or repair its pose."
            )
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0:
            raise InputError(f"Not a rotation matrix (orthonormal, determinant +1): {rotation}.")
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation", translation)

    def apply(self, points_in_a: ArrayLike) -> FloatArray:
        """Points in frame b, shape (..., 3), metres."""
        points: FloatArray = np.asarray(points_in_a, dtype=np.float64)
        return points @ self.rotation.T + self.translation

    def rotate(self, directions_in_a: ArrayLike) -> FloatArray:
        """Directions in frame b, shape (..., 3), without the translation."""
        directions: FloatArray = np.asarray(directions_in_a, dtype=np.float64)
        return directions @ self.rotation.T

    def inverse(self) -> Rigid3:
        """The transform ``a_from_b``."""
        return Rigid3(self.rotation.T, -self.rotation.T @ self.translation)

    def __matmul__(self, other: Rigid3) -> Rigid3:
        """``c_from_a = c_from_b @ b_from_a``."""
        return Rigid3(
            self.rotation @ other.rotation, self.rotation @ other.translation + self.translation
        )
