"""Planes ``n . x = offset`` and their intersections with rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from si3fp.errors import InputError
from si3fp.geometry.rigid import FloatArray, Rigid3


@dataclass(frozen=True, slots=True, eq=False)
class Planes:
    """Parallel arrays of planes ``normals[i] . x = offsets_m[i]`` in one frame.

    Attributes
    ----------
    normals
        (P, 3) unit vectors.
    offsets_m
        (P,) metres, signed.
    """

    normals: FloatArray
    offsets_m: FloatArray

    def __post_init__(self) -> None:
        normals = np.asarray(self.normals, dtype=np.float64).reshape(-1, 3)
        offsets = np.asarray(self.offsets_m, dtype=np.float64).reshape(-1)
        if len(normals) != len(offsets):
            raise InputError(f"Got {len(normals)} plane normals but {len(offsets)} offsets.")
        if not (np.isfinite(normals).all() and np.isfinite(offsets).all()):
            raise InputError("A plane contains NaN or infinity.")
        if len(normals) and np.abs(np.linalg.norm(normals, axis=1) - 1).max() > 1e-3:
            raise InputError("Plane normals must have unit length (tolerance 1e-3).")
        object.__setattr__(self, "normals", normals)
        object.__setattr__(self, "offsets_m", offsets)

    def __len__(self) -> int:
        return len(self.offsets_m)

    def transformed(self, b_from_a: Rigid3) -> Planes:
        """The same planes in frame b; the sign of the offset is kept, never flipped."""
        normals = b_from_a.rotate(self.normals)
        return Planes(normals, self.offsets_m + normals @ b_from_a.translation)


def ray_plane_distances(
    origin: ArrayLike, directions: ArrayLike, normal: ArrayLike, offset_m: float | FloatArray
) -> FloatArray:
    """Distances along rays to a plane, in units of the directions' length.

    Parameters
    ----------
    origin
        (3,) start of the rays.
    directions
        (..., 3).
    normal
        (3,) or (..., 3) plane normals.
    offset_m
        Scalar or (...).

    Returns
    -------
    (...) distances, NaN where the plane is parallel to the ray or behind its start.
    """
    start: FloatArray = np.asarray(origin, dtype=np.float64)
    rays: FloatArray = np.asarray(directions, dtype=np.float64)
    normals: FloatArray = np.asarray(normal, dtype=np.float64)
    slope = np.sum(rays * normals, axis=-1)
    gap = offset_m - np.sum(normals * start, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        distances: FloatArray = gap / slope
    return np.where((np.abs(slope) > 1e-9) & (distances > 0), distances, np.nan)
