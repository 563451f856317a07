"""The vertical by the walls among the sparse points: masons are better than hands (C.2).

Who takes photos holds the camera at a slant with some system, so that the vertical of thirty level
cameras may be a degree off: 26 cm on a wall 15 m high. Walls stand within 0.3 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from si3fp.geometry.rigid import FloatArray

_CAMERA_SIGMA_DEG = 0.8  # common slant of hand-held cameras: 0.5 and 1.2 degrees on two sets
_WALL_SIGMA_DEG = 0.3  # lean of a wall as built
_MAX_POINTS = 20_000
_MAX_WALLS = 8
_MIN_POINTS = 60
_MIN_SHARE = 0.02  # of all points
_CLEAR = 1 / 3  # of the tolerance: what scatters more is a hedge or a slice through the court
_MIN_HEIGHT = 6.0  # standard deviation of the heights of a wall's points, in tolerances
_OUTLIER_SIGMAS = 3.0
_HUBER_SIGMAS = 1.5
_PITCHES_DEG = np.arange(-30.0, 31.0, 2.0)


@dataclass(frozen=True, slots=True, eq=False)
class PlumbWall:
    """A wall that tells the vertical.

    Attributes
    ----------
    normal
        (3,) unit vector, either sign.
    sigma_deg
        Standard deviation of its lean, from its points and from how walls are built.
    points
        Number of points on it.
    """

    normal: FloatArray
    sigma_deg: float
    points: int


@dataclass(frozen=True, slots=True, eq=False)
class Plumb:
    """The vertical that cameras and walls agree on.

    Attributes
    ----------
    up
        (3,) unit vector.
    sigma_deg
        Standard deviation in its worse direction.
    walls
        Walls it rests on besides the cameras.
    """

    up: FloatArray
    sigma_deg: float
    walls: tuple[PlumbWall, ...]


def plumb_vertical(points: FloatArray, up: FloatArray, sigma_deg: float, tolerance: float) -> Plumb:
    """The vertical of the cameras, corrected by the walls that stand upright by it.

    Parameters
    ----------
    points
        (P, 3) sparse points.
    up
        (3,) the vertical by the cameras.
    sigma_deg
        Its standard deviation from roll noise; 0.8 degrees are taken where it is less.
    tolerance
        Distance in the points' unit beyond which a point is not of a wall, some 15 cm.
    """
    camera_sigma_deg = max(sigma_deg, _CAMERA_SIGMA_DEG)
    walls = tuple(
        wall
        for wall in _walls(points, up, tolerance)
        if abs(_lean_deg(wall, up)) <= _OUTLIER_SIGMAS * np.hypot(camera_sigma_deg, wall.sigma_deg)
    )
    across, along = _basis(up)
    leans = np.array([[wall.normal @ across, wall.normal @ along] for wall in walls]).reshape(-1, 2)
    offsets = np.deg2rad([_lean_deg(wall, up) for wall in walls])
    sigmas = np.deg2rad([wall.sigma_deg for wall in walls])
    weights = np.ones(len(walls))
    tilt = np.zeros(2)
    information = np.eye(2)
    for _ in range(20):
        rows = leans * (np.sqrt(weights) / sigmas)[:, None]
        information = rows.T @ rows + np.eye(2) / np.deg2rad(camera_sigma_deg) ** 2
        tilt = np.linalg.solve(information, -rows.T @ (offsets * np.sqrt(weights) / sigmas))
        excess = np.abs(leans @ tilt + offsets) / sigmas
        weights = _HUBER_SIGMAS / np.maximum(excess, _HUBER_SIGMAS)
    corrected = up + tilt[0] * across + tilt[1] * along
    worse = float(np.sqrt(1 / np.linalg.eigvalsh(information)[0]))
    return Plumb(corrected / np.linalg.norm(corrected), float(np.rad2deg(worse)), walls)


def sharpest_wall(
    points: FloatArray, up: FloatArray, right: FloatArray, tolerance: float
) -> FloatArray:
    """Normals (0 or 1, 3) of the wall that shows where the common pitch of all cameras is unknown.

    Parameters
    ----------
    points
        (P, 3) sparse points.
    up, right
        (3,) a vertical that may be off by 30 degrees about ``right``, and that direction.
    tolerance
        As in `plumb_vertical`.
    """
    some = points[:: -(-len(points) // (_MAX_POINTS // 4)) or 1]
    forward = np.cross(up, right)
    turns = np.deg2rad(_PITCHES_DEG)
    ups = np.cos(turns)[:, None] * up + np.sin(turns)[:, None] * forward
    counts = [_strongest_line(some @ _basis(one).T, tolerance)[2] for one in ups]
    best = ups[int(np.argmax(counts))]
    found = _walls(points, best, tolerance, count=1)
    return np.array([wall.normal for wall in found]).reshape(-1, 3)


def _walls(
    points: FloatArray, up: FloatArray, tolerance: float, count: int = _MAX_WALLS
) -> list[PlumbWall]:
    rest = points[:: -(-len(points) // _MAX_POINTS) or 1]
    least = max(_MIN_POINTS, _MIN_SHARE * len(rest))
    basis = _basis(up)
    walls: list[PlumbWall] = []
    for _ in range(2 * count):
        if len(rest) < least or len(walls) == count:
            break
        normal, offset, inside = _strongest_line(rest @ basis.T, tolerance)
        if inside < least:
            break
        wall, near = _fitted(rest, normal @ basis, offset, up, tolerance)
        if wall.points >= least:
            walls.append(wall)
        rest = rest[~near]
    return walls


def _strongest_line(plan: FloatArray, tolerance: float) -> tuple[FloatArray, float, int]:
    """Normal (2,), offset and number of points of the line with most points within a tolerance."""
    best = (np.array([1.0, 0.0]), 0.0, 0)
    for angle in np.deg2rad(np.arange(0.0, 180.0, 1.0)):
        normal = np.array([np.cos(angle), np.sin(angle)])
        along = plan @ normal
        start = float(along.min())
        cells = np.bincount(((along - start) / tolerance).astype(np.int64))
        pairs = np.convolve(cells, [1, 1])[1:]
        cell = int(np.argmax(pairs))
        if pairs[cell] > best[2]:
            best = (normal, start + (cell + 1) * tolerance, int(pairs[cell]))
    return best


def _fitted(
    points: FloatArray, normal: FloatArray, offset: float, up: FloatArray, tolerance: float
) -> tuple[PlumbWall, NDArray[np.bool_]]:
    """The plane near a vertical one by Tukey's weights, and the points that need not be searched.

    A plane that is not clear has zero points.
    """
    reach = 3 * tolerance
    distances = points @ normal - offset
    near = np.abs(distances) < reach
    scale = tolerance
    for _ in range(30):
        limit = min(4.7 * scale, reach)  # Tukey's constant
        weights = np.clip(1 - (distances / limit) ** 2, 0, None) ** 2
        total = weights.sum()
        if (weights > 0).sum() < _MIN_POINTS:
            return PlumbWall(normal, 90.0, 0), near
        centre = weights @ points / total
        rest = points - centre
        _, vectors = np.linalg.eigh((rest * weights[:, None]).T @ rest)
        normal = vectors[:, 0]
        distances = rest @ normal
        used = np.abs(distances) < limit
        scale = max(1.4826 * float(np.median(np.abs(distances[used]))), 1e-3 * tolerance)
    heights = float((points[used] @ up).std())
    clear = scale < _CLEAR * tolerance and heights > _MIN_HEIGHT * tolerance
    # Ten points to an independent one: those of one window hang together.
    fit_deg = np.rad2deg(scale / max(heights, tolerance) / np.sqrt(used.sum() / 10))
    wall = PlumbWall(normal, float(np.hypot(_WALL_SIGMA_DEG, fit_deg)), int(used.sum()))
    if not clear:
        wall = PlumbWall(normal, 90.0, 0)
    return wall, near | used


def _lean_deg(wall: PlumbWall, up: FloatArray) -> float:
    return float(np.rad2deg(np.arcsin(np.clip(wall.normal @ up, -1, 1))))


def _basis(up: FloatArray) -> FloatArray:
    """Two horizontal unit vectors (2, 3)."""
    side = np.eye(3)[int(np.argmin(np.abs(up)))]
    across = np.cross(side, up)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(up, across)])
