"""S.3, first half: which points of two views of a facade are the same place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.config import AlignConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import OrthoImage


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Matched points of two views in metres from the middle of the grid, (M, 2) each."""

    first: int
    second: int
    points_first: FloatArray
    points_second: FloatArray


def features_of(
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


def match(
    first: int,
    second: int,
    features: Sequence[tuple[FloatArray, NDArray[np.float32]]],
    config: AlignConfig,
) -> Matches | None:
    """Mutual nearest neighbours within the largest plausible shift that one homography explains.

    The bound on the shift is what keeps repeated windows apart: they are farther from each other
    than any pose error moves them.
    """
    (points_a, root_a), (points_b, root_b) = features[first], features[second]
    if min(len(points_a), len(points_b)) < config.min_inliers:
        return None
    best_b, best_a, top, runner_up = nearest(points_a, root_a, points_b, root_b, config.max_shift_m)
    # Distances of unit vectors; rounding may take a similarity of one beyond it.
    gap, next_gap = (np.sqrt(np.maximum(2 - 2 * cosine, 0)) for cosine in (top, runner_up))
    distinct = gap < config.ratio * next_gap
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
    return Matches(first, second, matched_a[inlier], matched_b[inlier])


def nearest(
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


def largest_group(views: Sequence[int], pairs: Sequence[Matches]) -> list[int]:
    """The views of the largest set connected by pairs; the earliest, best one where two tie."""
    group_of = {view: view for view in views}
    for pair in pairs:
        old, new = group_of[pair.second], group_of[pair.first]
        group_of = {view: new if group == old else group for view, group in group_of.items()}
    groups: dict[int, list[int]] = {}
    for view in views:
        groups.setdefault(group_of[view], []).append(view)
    return max(groups.values(), key=len)
