"""S.3, second half: small motions of views on a facade, estimated jointly from their matches.

A motion has 2, 4 or 8 parameters near zero: shift, then scale and turn, or linear and perspective
part; in metres from the middle of the grid, x right and y down.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from scipy.linalg import block_diag

from si3fp.config import AlignConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.streetview.matching import Matches

MotionModel = Literal["translation", "similarity", "homography"]
MODELS: tuple[MotionModel, ...] = ("translation", "similarity", "homography")
ROBUST_ROUNDS = 10
GAUGE_WEIGHT = 1e6


def motion_basis(points: FloatArray, model: MotionModel) -> FloatArray:
    """Derivative (M, 2, K) of a point's motion by the K parameters of the model, at zero motion."""
    x, y = points[:, 0], points[:, 1]
    one, zero = np.ones_like(x), np.zeros_like(x)
    columns = [(one, zero), (zero, one)]
    if model == "similarity":
        columns += [(x, y), (-y, x)]
    if model == "homography":
        columns += [(x, zero), (y, zero), (zero, x), (zero, y), (x * x, x * y), (x * y, y * y)]
    return np.stack([np.stack(column, axis=-1) for column in columns], axis=-1)


def _prior(model: MotionModel, covariance: FloatArray) -> FloatArray:
    """Inverse covariance (K, K) of a model's parameters from that of the homography's (8, 8)."""
    part = {
        "translation": np.eye(2, 8),
        "similarity": np.array(
            [
                [1, 0, 0, 0, 0, 0, 0, 0],
                [0, 1, 0, 0, 0, 0, 0, 0],
                [0, 0, 0.5, 0, 0, 0.5, 0, 0],
                [0, 0, 0, -0.5, 0.5, 0, 0, 0],
            ]
        ),
        "homography": np.eye(8),
    }[model]
    precision: FloatArray = np.linalg.inv(part @ covariance @ part.T)
    return precision


def motion_matrix(motion: FloatArray) -> FloatArray:
    """Homography (3, 3) in metres from the middle of the grid, of 2, 4, 6 or 8 parameters."""
    if len(motion) >= 6:
        tx, ty, xx, xy, yx, yy, px, py = (*motion, 0.0, 0.0)[:8]
        return np.array([[1 + xx, xy, tx], [yx, 1 + yy, ty], [-px, -py, 1.0]])
    tx, ty, scale, turn = (*motion, 0.0, 0.0)[:4]
    return np.array([[1 + scale, -turn, tx], [turn, 1 + scale, ty], [0.0, 0.0, 1.0]])


def moved(points: FloatArray, matrix: FloatArray) -> FloatArray:
    """Points (M, 2) after a homography (3, 3)."""
    homogeneous = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])


def in_pixels(matrix: FloatArray, grid: FacadeGrid) -> FloatArray:
    """A homography (3, 3) of metres from the grid's middle as one of the grid's pixels."""
    pixels = _pixels_from_metres(grid)
    moved_pixels = pixels @ matrix @ np.linalg.inv(pixels)
    return np.asarray(moved_pixels / moved_pixels[2, 2])


def in_metres(matrix: FloatArray, grid: FacadeGrid) -> FloatArray:
    """A homography (3, 3) of the grid's pixels as one of metres from its middle."""
    pixels = _pixels_from_metres(grid)
    moved_metres = np.linalg.inv(pixels) @ matrix @ pixels
    return np.asarray(moved_metres / moved_metres[2, 2])


def _pixels_from_metres(grid: FacadeGrid) -> FloatArray:
    scale = 1 / grid.m_per_px
    return np.array(
        [[scale, 0.0, grid.width_px / 2], [0.0, scale, grid.height_px / 2], [0.0, 0.0, 1.0]]
    )


def best_model(
    pairs: Sequence[Matches],
    free: Sequence[int],
    fixed: dict[int, FloatArray],
    covariances: Sequence[FloatArray],
    config: AlignConfig,
) -> tuple[MotionModel, dict[int, FloatArray]]:
    """The motion model with the most evidence and its motions of the free views.

    Evidence is the Bayesian information criterion on the robust cost, prior included: more
    parameters must pay for themselves.
    """
    count = sum(len(pair.points_first) for pair in pairs)
    solutions = []
    for model in MODELS:
        priors = {view: _prior(model, covariances[view]) for view in free}
        motions, cost = _solve(pairs, priors, fixed, model, config)
        parameters = sum(len(precision) for precision in priors.values())
        solutions.append((cost + parameters * np.log(max(count, 2)), model, motions))
    _, model, motions = min(solutions, key=lambda solution: solution[0])
    return model, motions


def _solve(
    pairs: Sequence[Matches],
    priors: dict[int, FloatArray],
    fixed: dict[int, FloatArray],
    model: MotionModel,
    config: AlignConfig,
) -> tuple[dict[int, FloatArray], float]:
    """Most probable motions of the free views and the robust cost (-2 log posterior).

    Gauss-Newton with Cauchy weights; motions are near the identity, so a few rounds suffice.
    ``priors`` holds the inverse covariance of the parameters of every free view.
    """
    size = len(next(iter(priors.values())))
    slot = {view: slice(k * size, (k + 1) * size) for k, view in enumerate(priors)}
    motions = {view: np.zeros(size) for view in priors}
    precision = block_diag(*priors.values())
    if not fixed:
        # Matches cannot tell a motion that all views share, and shrinking them all would even
        # shrink the residuals: hold the mean motion at zero (its best value comes later).
        sums = np.tile(np.eye(size), len(priors))
        precision += GAUGE_WEIGHT * sums.T @ sums
    # How the residual of a match changes with the motion of its two views, if they are free.
    slopes = [
        {
            view: sign * motion_basis(points, model).reshape(-1, size) / config.match_sigma_m
            for view, points, sign in (
                (pair.first, pair.points_first, 1.0),
                (pair.second, pair.points_second, -1.0),
            )
            if view in slot
        }
        for pair in pairs
    ]
    cost = np.inf
    for _ in range(ROBUST_ROUNDS):
        matrices = {view: motion_matrix(motion) for view, motion in (fixed | motions).items()}
        state = np.concatenate(list(motions.values()))
        normal = precision.copy()
        gradient = precision @ state
        cost = float(state @ gradient)
        for pair, slope_of in zip(pairs, slopes, strict=True):
            first = moved(pair.points_first, matrices[pair.first])
            second = moved(pair.points_second, matrices[pair.second])
            residual = (first - second) / config.match_sigma_m
            square = np.sum(residual**2, axis=1)
            cost += float(np.sum(np.log1p(square)))
            weight = np.repeat(1 / (1 + square), 2)[:, None]
            for view, slope in slope_of.items():
                weighted = (weight * slope).T
                gradient[slot[view]] += weighted @ residual.reshape(-1)
                for other, other_slope in slope_of.items():
                    normal[slot[view], slot[other]] += weighted @ other_slope
        step = np.linalg.solve(normal, gradient)
        motions = {view: motions[view] - step[slot[view]] for view in priors}
    return motions, cost
