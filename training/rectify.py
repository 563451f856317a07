"""Homographies that make facades orthographic, from the sides of window quadrilaterals."""

from __future__ import annotations

import cv2
import numpy as np

_TOLERANCE = np.radians(2.5)
_MIN_WINDOWS = 4


def quadrilateral(polygon: np.ndarray) -> np.ndarray | None:
    """Corners (4, 2) in the order top-left, top-right, bottom-right, bottom-left, or None."""
    ring = polygon.astype(np.float32).reshape(-1, 1, 2)
    length = cv2.arcLength(ring, True)
    corners = cv2.approxPolyDP(ring, 0.03 * length, True).reshape(-1, 2).astype(float)
    if len(corners) != 4 or not cv2.isContourConvex(corners.astype(np.float32)):
        return None
    if min(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)) < 8:
        return None
    centre = corners.mean(axis=0)
    order = np.argsort(np.arctan2(*(corners - centre).T[::-1]))
    corners = corners[order]
    return np.roll(corners, -int(np.argmin(corners.sum(axis=1))), axis=0)


def find_rectifications(
    windows: list[np.ndarray], shape: tuple[int, int], most: int = 2, seed: int = 0
) -> list[np.ndarray]:
    """Up to ``most`` homographies (3 x 3), one per facade seen, each agreed on by >= 4 windows.

    Each maps picture pixels to a frame where the sides of that facade's windows are parallel to
    the axes. The aspect ratio assumes a focal length equal to the picture's width.
    """
    quads = [q for q in (quadrilateral(w) for w in windows) if q is not None]
    rng = np.random.default_rng(seed)
    found: list[np.ndarray] = []
    while len(found) < most and len(quads) >= _MIN_WINDOWS:
        sample = np.array(quads)
        best, best_vanishing = np.zeros(len(quads), bool), None
        for _ in range(40):
            pair = rng.choice(len(quads), 2, replace=False)
            vanishing = _vanishing_points(sample[pair])
            inliers = _agreeing(sample, vanishing)
            if inliers.sum() > best.sum():
                best, best_vanishing = inliers, vanishing
        if best.sum() < _MIN_WINDOWS:
            break
        refined = _vanishing_points(sample[best])
        agreeing = _agreeing(sample, refined)
        if agreeing.sum() >= best.sum():
            best, best_vanishing = agreeing, refined
        matrix = _homography(best_vanishing, sample[best], shape)
        if matrix is not None:
            found.append(matrix)
        quads = [q for q, taken in zip(quads, best, strict=True) if not taken]
    return found


def _lines(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    one = np.ones((len(start), 1))
    lines = np.cross(np.hstack([start, one]), np.hstack([end, one]))
    return lines / np.linalg.norm(lines[:, :2], axis=1, keepdims=True)


def _vanishing_points(quads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Homogeneous vanishing points of the horizontal and vertical sides of quads (N, 4, 2)."""
    origin = quads.reshape(-1, 2).mean(axis=0)
    scale = 200.0
    q = (quads - origin) / scale
    points = []
    for sides in (((0, 1), (3, 2)), ((0, 3), (1, 2))):
        lines = np.vstack([_lines(q[:, a], q[:, b]) for a, b in sides])
        lengths = np.concatenate([np.linalg.norm(q[:, a] - q[:, b], axis=1) for a, b in sides])
        v = np.linalg.svd(lines * lengths[:, None])[2][-1]
        points.append(
            np.array([v[0] * scale + origin[0] * v[2], v[1] * scale + origin[1] * v[2], v[2]])
        )
    return points[0], points[1]


def _agreeing(quads: np.ndarray, vanishing: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    good = np.ones(len(quads), bool)
    for point, sides in zip(vanishing, (((0, 1), (3, 2)), ((0, 3), (1, 2))), strict=True):
        for a, b in sides:
            side = quads[:, b] - quads[:, a]
            middle = (quads[:, a] + quads[:, b]) / 2
            towards = point[:2] - middle * point[2]
            cross = side[:, 0] * towards[:, 1] - side[:, 1] * towards[:, 0]
            norm = np.linalg.norm(side, axis=1) * np.linalg.norm(towards, axis=1)
            good &= np.abs(cross) <= np.sin(_TOLERANCE) * np.maximum(norm, 1e-9)
    return good


def _homography(
    vanishing: tuple[np.ndarray, np.ndarray], quads: np.ndarray, shape: tuple[int, int]
) -> np.ndarray | None:
    origin = quads.reshape(-1, 2).mean(axis=0)
    shift = np.array([[1, 0, -origin[0]], [0, 1, -origin[1]], [0, 0, 1.0]])
    h, v = (shift @ p for p in vanishing)
    horizon = np.cross(h, v)
    if abs(horizon[2]) < 1e-9:
        return None
    projective = np.eye(3)
    projective[2] = horizon / horizon[2]
    across, down = (projective @ h)[:2], (projective @ v)[:2]
    across = across / np.linalg.norm(across) * np.sign(across[0] or 1.0)
    down = down / np.linalg.norm(down) * np.sign(down[1] or 1.0)
    basis = np.column_stack([across, down])
    if np.linalg.det(basis) < 0.4:
        return None
    focal, centre = float(shape[1]), np.array([shape[1], shape[0]]) / 2
    rays = []
    for point in vanishing:
        ray = np.array(
            [
                (point[0] - centre[0] * point[2]) / focal,
                (point[1] - centre[1] * point[2]) / focal,
                point[2],
            ]
        )
        rays.append(ray / np.linalg.norm(ray))
    at = np.append((origin - centre) / focal, 1.0)
    speed = [np.linalg.norm(ray[:2] - at[:2] * ray[2]) for ray in rays]
    aspect = np.clip(speed[1] / max(speed[0], 1e-6), 0.5, 2.5)
    affine = np.eye(3)
    affine[:2, :2] = np.diag([aspect, 1.0]) @ np.linalg.inv(basis)
    matrix = affine @ projective @ shift
    corners = np.concatenate([quads.reshape(-1, 2), np.ones((quads.size // 2, 1))], axis=1)
    if np.any(corners @ matrix[2] < 0.3) or np.any(corners @ matrix[2] > 3.0):
        return None
    return matrix
