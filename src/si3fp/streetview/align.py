"""S.3: registration of the views of one facade on their common grid.

Every view has its own pose error, so every view gets its own small motion of the facade plane.
SIFT matches between all pairs of the best views are filtered pair by pair (ratio test, robust
homography) and then explained jointly: one least-squares problem over all views in which a prior
on pose errors fixes what no match can, the common drift. The remaining views are registered
against the result. The motion model is the one with the best evidence.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

from si3fp.config import AlignConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import FacadeViews, OrthoImage
from si3fp.streetview.matching import Matches, features_of, largest_group, match
from si3fp.streetview.motion import (
    MotionModel,
    best_model,
    in_pixels,
    motion_basis,
    motion_matrix,
    moved,
)


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
        Motion model; ``none`` where the view was not moved against others.
    grid_from_view
        (3, 3) homography in grid pixels.
    inliers
        Matches with other views that the motion explains.
    residual_before_px, residual_after_px
        Median distance of its matches to the other views in grid pixels; None without matches.
    shift_m
        Length of the motion at the middle of the grid.
    information
        (8, 8) inverse covariance of the motion's parameters that the matches give, in metres from
        the middle of the grid (`si3fp.streetview.motion`); None where the view defines the place
        of the others.
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
    information: FloatArray | None = None


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
        (8, 8) per view: how its pose error moves it on the wall, from
        `si3fp.streetview.pose_motion.motion_covariance`.
    config
        Resolution, number of views that are matched all against all, tolerances, priors.

    Notes
    -----
    SI3FP, step S.3, with METHOD decisions 8 and 14. Pixels that were not seen never match. A view
    without a chain of matches to the others is dropped; where nothing matches at all, the best
    view is kept alone. The mean motion of the best views is zero: their common drift is left in.
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
    features = [features_of(view, views.grid, config) for view in views.views]
    best, others = order[: config.best_views], order[config.best_views :]
    pairs = [m for i, j in combinations(best, 2) if (m := match(i, j, features, config))]
    group = largest_group(best, pairs)
    pairs = [pair for pair in pairs if pair.first in group and pair.second in group]
    if not pairs:
        return tuple(
            _unmoved(view, "kept alone: no two views could be registered")
            if i == order[0]
            else _dropped(view, "no other view has enough matching points")
            for i, view in enumerate(views.views)
        )
    model, motions = best_model(pairs, group, {}, covariances, config)
    models: dict[int, MotionModel] = dict.fromkeys(group, model)
    fixed = dict(motions)
    reach_m = config.inlier_px * config.m_per_px
    for i in others:
        links = [m for j in group if (m := match(i, j, features, config))]
        if not links:
            continue
        model, motion = best_model(links, [i], fixed, covariances, config)
        matrices = {view: motion_matrix(each) for view, each in (fixed | motion).items()}
        agreeing = sum((_gaps(link, matrices) < reach_m).sum() for link in links)
        # A view that is going to be dropped must not blur the residuals of others.
        if agreeing >= config.min_inliers:
            models[i], motions[i] = model, motion[i]
            pairs += links
    moves = {i: motion_matrix(motion) for i, motion in motions.items()}
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


def _gaps(pair: Matches, matrices: Mapping[int, FloatArray]) -> FloatArray:
    """Distances (M,) in metres between the matched points of two moved views."""
    first = moved(pair.points_first, matrices[pair.first])
    second = moved(pair.points_second, matrices[pair.second])
    return np.asarray(np.linalg.norm(first - second, axis=1))


def _registration(
    index: int,
    view: OrthoImage,
    grid: FacadeGrid,
    pairs: Sequence[Matches],
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
            after.append(_gaps(pair, moves))
    gap_before, gap_after = np.concatenate(before), np.concatenate(after)
    inliers = int((gap_after < config.inlier_px * config.m_per_px).sum())
    shift_m = float(np.linalg.norm(moved(np.zeros((1, 2)), moves[index])))
    if inliers < config.min_inliers:
        return _dropped(view, f"only {inliers} matching points agree with the other views")
    if shift_m > config.max_shift_m:
        return _dropped(view, f"would have to move by {shift_m:.2f} m: a mismatch")
    return Registration(
        view.source,
        True,
        "registered",
        models[index],
        in_pixels(moves[index], grid),
        inliers,
        float(np.median(gap_before)) / grid.m_per_px,
        float(np.median(gap_after)) / grid.m_per_px,
        shift_m,
        _information(index, pairs, moves, config),
    )


def _information(
    index: int, pairs: Sequence[Matches], moves: Mapping[int, FloatArray], config: AlignConfig
) -> FloatArray:
    """Inverse covariance (8, 8) of a view's motion, the others' known; matches weigh by Cauchy."""
    total = np.zeros((8, 8))
    for pair in pairs:
        if index not in (pair.first, pair.second):
            continue
        points = pair.points_first if index == pair.first else pair.points_second
        weight = 1 / (config.match_sigma_m**2 + _gaps(pair, moves) ** 2)
        basis = motion_basis(points, "homography")
        total += np.einsum("p,pck,pcl->kl", weight, basis, basis)
    return total
