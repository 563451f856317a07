"""The vertical of a reconstruction, from its cameras and its walls (C.2).

Who takes photos of a house holds the camera level, whatever its pitch: the cameras' x axes are
horizontal, and so are the normals of walls. Up is the direction at right angles to all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from si3fp.errors import InputError, ReconstructionError
from si3fp.geometry.rigid import FloatArray, Rigid3

_MIN_SIGMA_DEG = 0.2  # neither hands nor masons are better
_ROLL_SIGMA_DEG = 2.0  # of a hand-held camera; closer rolls are no outliers
_PITCH_SIGMA_DEG = 20.0  # only tells up from forward where all cameras look the same way
_WALL_SIGMA_DEG = 1.0  # of a wall fitted to sparse points
_MAX_SIGMA_DEG = 2.0
_OUTLIER_SIGMAS = 3.0
_MAX_MEDIAN_ROLL_DEG = 8.0
_MAX_PAIRED = 60  # cameras whose x axes are paired: 1770 pairs


@dataclass(frozen=True, slots=True, eq=False)
class Gravity:
    """Where up is.

    Attributes
    ----------
    level_from_reconstruction
        Rotation that makes z point up, without any turn about up: north is still unknown.
    sigma_deg
        Standard deviation of the vertical in its worse direction.
    roll_sigma_deg
        Spread of the cameras' rolls, outliers left out.
    tilted_cameras
        Indices of the cameras that are not level: photos in portrait format, careless shots.
    tilted_walls
        Indices of the planes that are not vertical.
    """

    level_from_reconstruction: Rigid3
    sigma_deg: float
    roll_sigma_deg: float
    tilted_cameras: tuple[int, ...]
    tilted_walls: tuple[int, ...]

    @property
    def up_in_reconstruction(self) -> FloatArray:
        """Unit vector (3,)."""
        up: FloatArray = self.level_from_reconstruction.rotation[2]
        return up


def find_gravity(
    cams_from_reconstruction: Sequence[Rigid3], wall_normals: ArrayLike = ()
) -> Gravity:
    """The vertical that cameras and walls agree on.

    Parameters
    ----------
    cams_from_reconstruction
        Poses, 3 or more.
    wall_normals
        (P, 3) unit normals of planes thought to be vertical, either sign; may be none.

    Raises
    ------
    InputError
        If there are fewer than three cameras or a normal is no unit vector.
    ReconstructionError
        If fewer than half of the cameras are level, the cameras and most walls disagree, or all
        look the same way and no wall fixes their common pitch.
    """
    if len(cams_from_reconstruction) < 3:
        raise InputError(
            f"The vertical needs at least 3 cameras, got {len(cams_from_reconstruction)}."
        )
    normals = np.asarray(wall_normals, dtype=np.float64).reshape(-1, 3)
    if not np.allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-3):
        raise InputError(f"Wall normals must be unit vectors, got {normals.tolist()}.")
    right = np.stack([pose.rotation[0] for pose in cams_from_reconstruction])
    down = np.stack([pose.rotation[1] for pose in cams_from_reconstruction])

    level, roll_sigma_deg = _level_cameras(right, down)
    information = _information(right[level], roll_sigma_deg)
    upright = np.ones(len(normals), dtype=np.bool_)
    if _sigma_deg(information) <= _MAX_SIGMA_DEG:
        upright = _upright_walls(normals, information)
    information = information + _information(normals[upright], _WALL_SIGMA_DEG)
    upright &= _upright_walls(normals, information)  # they may contradict one another
    up, _ = _vertical(information)
    sigma_deg = _sigma_deg(information)
    if sigma_deg > _MAX_SIGMA_DEG:
        raise ReconstructionError(
            f"The vertical is uncertain by {min(sigma_deg, 90.0):.1f} degrees: all cameras look "
            "the same way and no wall fixes their pitch. Add photos that look along the facade or "
            "at another side of the building."
        )
    up = up * np.sign(np.median(-down[level] @ up))
    if np.mean(-down[level] @ up > 0.5) < 0.75:
        raise ReconstructionError(
            "The photos seem to lie on their sides: the lower side of most images does not point "
            "down. Turn photos in portrait format upright, or give known cameras (--cameras)."
        )
    return Gravity(
        Rigid3(_rotation_to_z(up), np.zeros(3)),
        sigma_deg,
        roll_sigma_deg,
        tuple(np.flatnonzero(~level).tolist()),
        tuple(np.flatnonzero(~upright).tolist()),
    )


def _level_cameras(right: FloatArray, down: FloatArray) -> tuple[NDArray[np.bool_], float]:
    """Mask of the cameras that are level, and the standard deviation of their rolls in degrees.

    Starts from the vertical with the least median roll (Rousseeuw 1984), which nearly half of the
    cameras may contradict.
    """
    some = right[:: -(-len(right) // _MAX_PAIRED)]
    first, second = np.triu_indices(len(some), k=1)
    pairs = np.cross(some[first], some[second])
    length = np.linalg.norm(pairs, axis=1)
    candidates = np.concatenate([pairs[length > 0.1] / length[length > 0.1, None], down])
    median_deg = np.median(_tilts_deg(right, candidates), axis=0)
    up = candidates[np.argmin(median_deg)]
    if median_deg.min() > _MAX_MEDIAN_ROLL_DEG:
        raise ReconstructionError(
            f"The cameras do not agree on a vertical: half of them roll by {median_deg.min():.0f} "
            "degrees or more. Turn photos in portrait format upright, or give known cameras "
            "(--cameras)."
        )
    pitches = _information(np.cross(right, down), _PITCH_SIGMA_DEG)
    for _ in range(5):
        rolls_deg = _tilts_deg(right, up)
        spread_deg = 1.4826 * float(np.median(rolls_deg))
        level = rolls_deg <= _OUTLIER_SIGMAS * max(spread_deg, _ROLL_SIGMA_DEG)
        up, _ = _vertical(pitches + _information(right[level], _ROLL_SIGMA_DEG))
    rolls_deg = _tilts_deg(right[level], up)
    sigma_deg = float(np.sqrt((rolls_deg**2).sum() / max(len(rolls_deg) - 2, 1)))
    return level, max(sigma_deg, _MIN_SIGMA_DEG)


def _upright_walls(normals: FloatArray, information: FloatArray) -> NDArray[np.bool_]:
    """Mask of the planes that are vertical within the uncertainty of the vertical and their own."""
    up, covariance = _vertical(information)
    sigma = np.sqrt(np.einsum("pi,ij,pj->p", normals, covariance, normals))
    limit_deg = _OUTLIER_SIGMAS * np.hypot(np.rad2deg(sigma), _WALL_SIGMA_DEG)
    tilts_deg = _tilts_deg(normals, up)
    upright: NDArray[np.bool_] = tilts_deg <= limit_deg
    if upright.sum() < len(normals) / 2:
        raise ReconstructionError(
            f"Cameras and walls disagree about the vertical: {(~upright).sum()} of {len(normals)} "
            f"walls lean by {np.median(tilts_deg):.1f} degrees (median). Photos taken with a "
            "tilted camera, or planes that are no walls: check both."
        )
    return upright


def _information(horizontals: FloatArray, sigma_deg: float) -> FloatArray:
    """(3, 3) inverse covariance of the vertical from directions at right angles to it, 1/rad^2."""
    matrix: FloatArray = horizontals.T @ horizontals / np.deg2rad(sigma_deg) ** 2
    return matrix


def _vertical(information: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The direction most at right angles to all, either sign, and its covariance in rad^2."""
    values, vectors = np.linalg.eigh(information)
    inverse = 1 / np.maximum(values[1:], 1e-6)
    covariance: FloatArray = (vectors[:, 1:] * inverse) @ vectors[:, 1:].T
    return vectors[:, 0], covariance


def _sigma_deg(information: FloatArray) -> float:
    """Standard deviation of the vertical in its worse direction."""
    values = np.linalg.eigvalsh(information)
    return float(np.rad2deg(1 / np.sqrt(max(values[1], 1e-6))))


def _tilts_deg(horizontals: FloatArray, up: FloatArray) -> FloatArray:
    """Angles between directions (N, 3) and the plane at right angles to up (3,) or (M, 3)."""
    tilts: FloatArray = np.rad2deg(np.arcsin(np.clip(np.abs(horizontals @ up.T), 0, 1)))
    return tilts


def _rotation_to_z(up: FloatArray) -> FloatArray:
    """The smallest rotation that takes a unit vector to z (Rodrigues)."""
    x, y, z = up
    if z < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    rotation: FloatArray = np.eye(3) + cross + cross @ cross / (1 + z)
    return rotation
