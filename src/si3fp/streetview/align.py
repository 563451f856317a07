"""S.3: registration of the views of one facade on their common grid.

Every view has its own pose error, so every view gets its own small motion of the facade plane.
SIFT matches between all pairs of the best views are filtered pair by pair (ratio test, robust
homography) and then explained jointly: one least-squares problem over all views in which a prior
on pose errors fixes what no match can, the common drift. The remaining views are registered
against the result. The motion model is the one with the best evidence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from si3fp.config import AlignConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import FacadeViews, OrthoImage, Panorama

MotionModel = Literal["translation", "similarity", "homography"]
MODELS: tuple[MotionModel, ...] = ("translation", "similarity", "homography")
ROBUST_ROUNDS = 10
GAUGE_WEIGHT = 1e6
DOWN = np.array([1.0, -1.0])
"""Facade y runs up; matches are in metres to the right and down, like pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """How one view was moved onto the common grid, or why it was dropped.

    Attributes
    ----------
    source
        Id of the view.
    used
        False where the view was dropped.
    reason
        Why it was dropped, or what was done, in words.
    model
        Motion model; ``none`` where the view was not moved.
    grid_from_view
        (3, 3) homography in grid pixels.
    inliers
        Matches with other views that the motion explains.
    residual_before_px, residual_after_px
        Median distance of its matches to the other views in grid pixels; None without matches.
    shift_m
        Length of the motion at the middle of the grid.
    """

    source: str
    used: bool
    reason: str
    model: Literal["none", "translation", "similarity", "homography"]
    grid_from_view: FloatArray
    inliers: int = 0
    residual_before_px: float | None = None
    residual_after_px: float | None = None
    shift_m: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class _Matches:
    """Matched points of two views in metres from the middle of the grid, (M, 2) each."""

    first: int
    second: int
    points_first: FloatArray
    points_second: FloatArray


def register(
    views: FacadeViews,
    quality: Sequence[float],
    covariances: Sequence[FloatArray],
    config: AlignConfig,
) -> tuple[Registration, ...]:
    """One registration per view, in the order of the views.

    Parameters
    ----------
    views
        Views on one grid with their pose errors.
    quality
        One number per view, larger is better: resolution, obliqueness and coverage in one.
    covariances
        (8, 8) per view: how its pose error moves it on the wall, from `motion_covariance`.
    config
        Resolution, number of views that are matched all against all, tolerances, priors.

    Notes
    -----
    SI3FP, step S.3, with METHOD decisions 8 and 14. Pixels that were not seen never match. A view
    without a chain of matches to the others is dropped; where nothing matches at all, the best
    view is kept alone.
    """
    # The products of matrices here are small: the threads of BLAS would wait for one another
    # longer than they work, on a busy machine by far (docs/benchmarks.md).
    with threadpool_limits(limits=1, user_api="blas"):
        return _register(views, quality, covariances, config)


def _register(
    views: FacadeViews,
    quality: Sequence[float],
    covariances: Sequence[FloatArray],
    config: AlignConfig,
) -> tuple[Registration, ...]:
    order = sorted(range(len(views.views)), key=lambda i: (-quality[i], views.views[i].source))
    if len(order) < 2:
        return tuple(_unmoved(view, "the only view") for view in views.views)
    features = [_features(view, views.grid, config) for view in views.views]
    best, others = order[: config.best_views], order[config.best_views :]
    pairs = [m for i, j in combinations(best, 2) if (m := _match(i, j, features, config))]
    group = _largest_group(best, pairs)
    pairs = [pair for pair in pairs if pair.first in group and pair.second in group]
    if not pairs:
        return tuple(
            _unmoved(view, "kept alone: no two views could be registered")
            if i == order[0]
            else _dropped(view, "no other view has enough matching points")
            for i, view in enumerate(views.views)
        )
    model, motions = _best_model(pairs, group, {}, covariances, config)
    models: dict[int, MotionModel] = dict.fromkeys(group, model)
    fixed = dict(motions)
    for i in others:
        links = [m for j in group if (m := _match(i, j, features, config))]
        if links:
            models[i], motion = _best_model(links, [i], fixed, covariances, config)
            motions[i] = motion[i]
            pairs += links
    without_drift = np.linalg.inv(_matrix(_drift(views, motions, covariances)))
    moves = {i: without_drift @ _matrix(motion) for i, motion in motions.items()}
    return tuple(
        _registration(i, view, views.grid, pairs, moves, models, config)
        for i, view in enumerate(views.views)
    )


def registered(view: OrthoImage, registration: Registration, grid: FacadeGrid) -> OrthoImage:
    """The view moved by its registration; pixels outside the view are not valid."""
    if np.allclose(registration.grid_from_view, np.eye(3), atol=1e-9):
        return view
    view_from_grid = np.linalg.inv(registration.grid_from_view)
    # cv2 puts (0, 0) at the centre of the first pixel.
    to_cv2 = np.array([[1.0, 0.0, -0.5], [0.0, 1.0, -0.5], [0.0, 0.0, 1.0]])
    matrix = to_cv2 @ view_from_grid @ np.linalg.inv(to_cv2)
    size = (grid.width_px, grid.height_px)
    rgb = cv2.warpPerspective(
        view.rgb,
        matrix,
        size,
        flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    # The cubic reaches one pixel farther than the linear: none of it may be unseen.
    inner = cv2.erode(view.valid.view(np.uint8), np.ones((3, 3), np.uint8))
    valid = cv2.warpPerspective(
        inner * np.uint8(255), matrix, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    )
    return replace(view, rgb=np.asarray(rgb, np.uint8), valid=valid == 255)


def _unmoved(view: OrthoImage, reason: str) -> Registration:
    return Registration(view.source, True, reason, "none", np.eye(3))


def _dropped(view: OrthoImage, reason: str) -> Registration:
    return Registration(view.source, False, reason, "none", np.eye(3))


def _features(
    view: OrthoImage, grid: FacadeGrid, config: AlignConfig
) -> tuple[FloatArray, NDArray[np.float32]]:
    """SIFT points (K, 2) in metres from the grid's middle, and RootSIFT descriptors (K, 128)."""
    size = (
        max(1, round(grid.width_m / config.m_per_px)),
        max(1, round(grid.height_m / config.m_per_px)),
    )
    small = cv2.resize(view.rgb, size, interpolation=cv2.INTER_AREA)
    seen = cv2.resize(view.valid.view(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    # The edge of what was seen is no feature of the wall.
    inner = cv2.erode(seen, np.ones((9, 9), np.uint8), borderType=cv2.BORDER_REPLICATE)
    grey = cv2.createCLAHE(3.0, (8, 8)).apply(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY))
    # Without precise upscaling all features lie a quarter of a pixel to the right and down.
    sift = cv2.SIFT.create(
        nfeatures=config.max_features, contrastThreshold=0.02, enable_precise_upscale=True
    )
    points, descriptors = sift.detectAndCompute(grey, inner)
    if not points:
        return np.zeros((0, 2)), np.zeros((0, 128), np.float32)
    # cv2 puts (0, 0) at the centre of the first pixel.
    pixels = np.array([point.pt for point in points], np.float64) + 0.5
    metres = (pixels / size - 0.5) * [grid.width_m, grid.height_m]
    # Hellinger kernel: Arandjelovic and Zisserman (2012), doi:10.1109/CVPR.2012.6248018.
    root = np.sqrt(descriptors / np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-9))
    return metres, root.astype(np.float32)


def _match(
    first: int,
    second: int,
    features: Sequence[tuple[FloatArray, NDArray[np.float32]]],
    config: AlignConfig,
) -> _Matches | None:
    """Mutual nearest neighbours within the largest plausible shift that one homography explains.

    The bound on the shift is what keeps repeated windows apart: they are farther from each other
    than any pose error moves them.
    """
    (points_a, root_a), (points_b, root_b) = features[first], features[second]
    if min(len(points_a), len(points_b)) < config.min_inliers:
        return None
    best_b, best_a, top, runner_up = _nearest(
        points_a, root_a, points_b, root_b, config.max_shift_m
    )
    # Distances of unit vectors; rounding may take a similarity of one beyond it.
    nearest, next_nearest = (np.sqrt(np.maximum(2 - 2 * cosine, 0)) for cosine in (top, runner_up))
    distinct = nearest < config.ratio * next_nearest
    keep = (top > 0) & (best_a[best_b] == np.arange(len(points_a))) & distinct
    matched_a, matched_b = points_a[keep], points_b[best_b[keep]]
    if len(matched_a) < config.min_inliers:
        return None
    _, mask = cv2.findHomography(
        matched_a, matched_b, cv2.USAC_MAGSAC, config.inlier_px * config.m_per_px
    )
    inlier = np.zeros(len(matched_a), bool) if mask is None else mask.ravel().astype(bool)
    if inlier.sum() < config.min_inliers:
        return None
    return _Matches(first, second, matched_a[inlier], matched_b[inlier])


def _nearest(
    points: FloatArray,
    descriptors: NDArray[np.float32],
    others: FloatArray,
    other_descriptors: NDArray[np.float32],
    reach_m: float,
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float32], NDArray[np.float32]]:
    """Index of the most similar point within reach, both ways, its similarity and the runner-up's.

    Both sets are sorted by x, so that a block of points meets only the strip around it.

    Returns
    -------
    Index (K,) of the best other point, index (L,) of the best point of every other, and the
    similarity (K,) of the best and of the second best other point; -1 where there is none.
    """
    order, other_order = np.argsort(points[:, 0]), np.argsort(others[:, 0])
    other_x, other_y = others[other_order].T
    best, best_back = np.zeros(len(points), np.intp), np.zeros(len(others), np.intp)
    top, top_back = (np.full(len(some), -1.0, np.float32) for some in (points, others))
    second = top.copy()
    for start in range(0, len(points), 128):
        rows = order[start : start + 128]
        x, y = points[rows].T
        low, high = np.searchsorted(other_x, [x[0] - reach_m, x[-1] + reach_m])
        if low == high:
            continue
        strip = other_order[low:high]
        similarity = descriptors[rows] @ other_descriptors[strip].T
        far = np.abs(x[:, None] - other_x[low:high]) > reach_m
        far |= np.abs(y[:, None] - other_y[low:high]) > reach_m
        np.copyto(similarity, -1.0, where=far)
        row = similarity.argmax(axis=0)
        back = similarity[row, np.arange(len(strip))]
        better = back > top_back[strip]
        best_back[strip[better]], top_back[strip[better]] = rows[row[better]], back[better]
        column = similarity.argmax(axis=1)
        line = np.arange(len(rows))
        best[rows] = strip[column]
        top[rows] = similarity[line, column]
        similarity[line, column] = -1.0
        second[rows] = similarity.max(axis=1)
    return best, best_back, top, second


def _largest_group(views: Sequence[int], pairs: Sequence[_Matches]) -> list[int]:
    """The views of the largest set connected by pairs; the earliest, best one where two tie."""
    group_of = {view: view for view in views}
    for pair in pairs:
        old, new = group_of[pair.second], group_of[pair.first]
        group_of = {view: new if group == old else group for view, group in group_of.items()}
    groups: dict[int, list[int]] = {}
    for view in views:
        groups.setdefault(group_of[view], []).append(view)
    return max(groups.values(), key=len)


def _basis(points: FloatArray, model: MotionModel) -> FloatArray:
    """Derivative (M, 2, K) of a point's motion by the K parameters of the model, at zero motion."""
    x, y = points[:, 0], points[:, 1]
    one, zero = np.ones_like(x), np.zeros_like(x)
    columns = [(one, zero), (zero, one)]
    if model == "similarity":
        columns += [(x, y), (-y, x)]
    if model == "homography":
        columns += [(x, zero), (y, zero), (zero, x), (zero, y), (x * x, x * y), (x * y, y * y)]
    return np.stack([np.stack(column, axis=-1) for column in columns], axis=-1)


def motion_covariance(panorama: Panorama, grid: FacadeGrid, config: AlignConfig) -> FloatArray:
    """Covariance (8, 8) of a view's motion on the wall that its pose error explains.

    The parameters are those of the homography model: shift, linear and perspective part, in metres
    from the middle of the grid. An oblique view is uncertain in scale, a distant one in shift; the
    common drift of all views is best estimated where that is known. Each of the three positions
    and three angles is moved by its standard deviation, and the motion of the wall fitted.
    """
    columns = (np.arange(7) + 0.5) / 7 * grid.width_px
    rows = (np.arange(5) + 0.5) / 5 * grid.height_px
    pixels = np.stack(np.meshgrid(columns, rows, indexing="xy"), axis=-1).reshape(-1, 2)
    world = grid.world_from_pixels(pixels)
    middle = np.array([grid.width_m / 2, grid.height_m / 2])
    plane = (grid.facade_from_pixels(pixels) - middle) * DOWN
    rays = panorama.pano_from_world.apply(world)
    basis = _basis(plane, "homography").reshape(-1, 8)
    # Points that the camera sees more steeply than most count less, as they do in the matches.
    distance_m = np.linalg.norm(rays, axis=1)
    steep = np.abs((world - panorama.centre_in_world) @ grid.normal_in_world) / distance_m
    weight = np.repeat(np.maximum(steep, 0.05) ** 2 / distance_m, 2)[:, None]
    facade_from_world = grid.world_from_facade.inverse()
    world_from_pano = panorama.pano_from_world.inverse()
    normal = grid.normal_in_world
    offset_m = float(normal @ grid.world_from_facade.translation)
    motions = []
    for axis in range(3):
        turn = np.deg2rad(config.direction_sigma_deg) * np.eye(3)[axis]
        for centre, moved_rays in (
            (np.eye(3)[axis] * config.position_sigma_m, rays),
            (np.zeros(3), rays + np.cross(turn, rays)),
        ):
            start = world_from_pano.apply(centre)
            lines = world_from_pano.rotate(moved_rays)
            along = (offset_m - normal @ start) / (lines @ normal)
            seen = facade_from_world.apply(start + along[:, None] * lines)[:, :2]
            shift = (seen - middle) * DOWN - plane
            fit = np.linalg.lstsq(basis * weight, shift.reshape(-1) * weight[:, 0], rcond=None)
            motions.append(fit[0])
    root = np.array(motions)
    floor = np.array([0.01] * 2 + [0.001] * 4 + [0.00005] * 2)
    covariance: FloatArray = root.T @ root + np.diag(floor**2)
    return covariance


def _drift(
    views: FacadeViews, motions: dict[int, FloatArray], covariances: Sequence[FloatArray]
) -> FloatArray:
    """Parameters (6,) of the affine motion that all views share in the mean.

    Matches cannot tell it, poses can: at every place of the wall, the motions of the views that
    saw it are averaged with the inverse of the variance that their pose errors give them there.
    """
    grid = views.grid
    columns, rows = np.meshgrid(
        (np.arange(24) + 0.5) / 24 * grid.width_px, (np.arange(12) + 0.5) / 12 * grid.height_px
    )
    x, y = columns.ravel(), rows.ravel()
    points = np.stack([x - grid.width_px / 2, y - grid.height_px / 2], axis=-1) * grid.m_per_px
    basis = _basis(points, "homography")
    total, weights = np.zeros_like(points), np.zeros(len(points))
    for index, motion in motions.items():
        variance = np.einsum("pck,kl,pcl->p", basis, covariances[index], basis)
        weight = views.views[index].valid[y.astype(int), x.astype(int)] / variance
        total += weight[:, None] * (_moved(points, _matrix(motion)) - points)
        weights += weight
    mean = total / np.maximum(weights, 1e-9)[:, None]
    root = np.repeat(np.sqrt(weights), 2)
    affine = basis[..., :6].reshape(-1, 6)
    drift: FloatArray = np.linalg.lstsq(affine * root[:, None], mean.ravel() * root, rcond=None)[0]
    return drift


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


def _matrix(motion: FloatArray) -> FloatArray:
    """Homography (3, 3) in metres from the middle of the grid, of 2, 4, 6 or 8 parameters."""
    if len(motion) >= 6:
        tx, ty, xx, xy, yx, yy, px, py = (*motion, 0.0, 0.0)[:8]
        return np.array([[1 + xx, xy, tx], [yx, 1 + yy, ty], [-px, -py, 1.0]])
    tx, ty, scale, turn = (*motion, 0.0, 0.0)[:4]
    return np.array([[1 + scale, -turn, tx], [turn, 1 + scale, ty], [0.0, 0.0, 1.0]])


def _moved(points: FloatArray, matrix: FloatArray) -> FloatArray:
    homogeneous = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])


def _best_model(
    pairs: Sequence[_Matches],
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
    pairs: Sequence[_Matches],
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
            view: sign * _basis(points, model).reshape(-1, size) / config.match_sigma_m
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
        matrices = {view: _matrix(motion) for view, motion in (fixed | motions).items()}
        state = np.concatenate(list(motions.values()))
        normal = precision.copy()
        gradient = precision @ state
        cost = float(state @ gradient)
        for pair, slope_of in zip(pairs, slopes, strict=True):
            first = _moved(pair.points_first, matrices[pair.first])
            second = _moved(pair.points_second, matrices[pair.second])
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


def _registration(
    index: int,
    view: OrthoImage,
    grid: FacadeGrid,
    pairs: Sequence[_Matches],
    moves: dict[int, FloatArray],
    models: dict[int, MotionModel],
    config: AlignConfig,
) -> Registration:
    if index not in moves:
        return _dropped(view, f"fewer than {config.min_inliers} matching points with other views")
    before, after = [], []
    for pair in pairs:
        if index in (pair.first, pair.second):
            before.append(np.linalg.norm(pair.points_first - pair.points_second, axis=1))
            moved = _moved(pair.points_first, moves[pair.first]) - _moved(
                pair.points_second, moves[pair.second]
            )
            after.append(np.linalg.norm(moved, axis=1))
    gap_before, gap_after = np.concatenate(before), np.concatenate(after)
    inliers = int((gap_after < config.inlier_px * config.m_per_px).sum())
    shift_m = float(np.linalg.norm(_moved(np.zeros((1, 2)), moves[index])))
    if inliers < config.min_inliers:
        return _dropped(view, f"only {inliers} matching points agree with the other views")
    if shift_m > config.max_shift_m:
        return _dropped(view, f"would have to move by {shift_m:.2f} m: a mismatch")
    pixels_from_metres = np.array(
        [
            [1 / grid.m_per_px, 0.0, grid.width_px / 2],
            [0.0, 1 / grid.m_per_px, grid.height_px / 2],
            [0.0, 0.0, 1.0],
        ]
    )
    matrix = pixels_from_metres @ moves[index] @ np.linalg.inv(pixels_from_metres)
    return Registration(
        view.source,
        True,
        "registered",
        models[index],
        matrix / matrix[2, 2],
        inliers,
        float(np.median(gap_before)) / grid.m_per_px,
        float(np.median(gap_after)) / grid.m_per_px,
        shift_m,
    )
