"""C.2: does a reconstruction agree with itself? Parts that look alike can be folded into one.

Two signs, both from what the photos show. Photos that the model puts side by side, looking at the
same place, must share what they see there. And what two photos verifiably share must lie where the
model's cameras see it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from si3fp.config import SfmConfig
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Photo

Pair = tuple[int, int]
_NO_RAYS = (np.zeros((0, 3)), np.zeros((0, 3)))


@dataclass(frozen=True, slots=True, eq=False)
class ModelView:
    """A reconstruction, its photos by number.

    Attributes
    ----------
    photos
        With poses in the units of the reconstruction.
    points
        (P, 3).
    seen
        For each photo the sorted indices of the points that it saw.
    """

    photos: Mapping[int, Photo]
    points: FloatArray
    seen: Mapping[int, NDArray[np.intp]]


@dataclass(frozen=True, slots=True)
class Neighbours:
    """Two photos that the model puts side by side, looking at the same place.

    Attributes
    ----------
    first, second
        Numbers of the photos.
    expected
        Points of one that should be seen by the other: of the two directions the smaller number.
    shared
        Points that both saw.
    apart
        How far apart they were taken, as a share of the median distance to their points.
    """

    first: int
    second: int
    expected: int
    shared: int
    apart: float


@dataclass(frozen=True, slots=True)
class Coherence:
    """How far a reconstruction agrees with itself.

    Attributes
    ----------
    neighbours
        Number of pairs of photos that the model puts side by side.
    strangers
        Those of them that share far too little: the photos show different places.
    opposed
        Pairs of photos with many verified matches that the model contradicts.
    """

    neighbours: int
    strangers: tuple[Pair, ...]
    opposed: tuple[Pair, ...]


def coherence(
    model: ModelView,
    matches: Mapping[Pair, tuple[FloatArray, FloatArray]],
    config: SfmConfig,
) -> Coherence:
    """How far a reconstruction agrees with what its photos share.

    Parameters
    ----------
    model
        The reconstruction.
    matches
        Verified matches by pair of photos, the smaller number first: directions (M, 3) of the
        matched points in the two cameras, with z = 1.
    config
        Limits.

    Notes
    -----
    What photos side by side share depends on texture and light; too little is less than
    `SfmConfig.stranger_of_usual` of the upper quartile of such pairs. Photos from one place, one
    of the wall's foot and one of its top, share nearly all and tell nothing of what a step aside
    leaves: they are left out of it. A part that looks like another in more than about 40 % of what
    the photos show can be folded onto it unnoticed.
    """
    side_by_side = neighbours(model, config)
    found = [
        max(pair.shared, len(matches.get((pair.first, pair.second), _NO_RAYS)[0])) / pair.expected
        for pair in side_by_side
    ]
    stepped_aside = [
        share
        for pair, share in zip(side_by_side, found, strict=True)
        if pair.apart > config.same_place
    ]
    usual = float(np.percentile(stepped_aside, 75)) if stepped_aside else 0.0
    too_little = max(config.stranger_share, config.stranger_of_usual * usual)
    strangers = [
        (pair.first, pair.second)
        for pair, share in zip(side_by_side, found, strict=True)
        if share < too_little
    ]
    opposed = [
        (first, second)
        for (first, second), rays in sorted(matches.items())
        if {first, second} <= model.photos.keys()
        and len(rays[0]) >= config.strong_matches
        and agreeing_share(rays, model.photos[first], model.photos[second], config) < 0.5
    ]
    return Coherence(len(side_by_side), tuple(strangers), tuple(opposed))


def folded(strangers: int, neighbours: int, config: SfmConfig) -> bool:
    """Whether too many of the pairs of photos that lie side by side share too little."""
    return strangers >= max(config.min_strangers, config.strangers_of_neighbours * neighbours)


def neighbours(model: ModelView, config: SfmConfig) -> list[Neighbours]:
    """Pairs of photos that should share much, and how much they share.

    A point of one photo should be seen by the other where it falls into its image, from a direction
    within `SfmConfig.same_view_deg` and at a distance within `SfmConfig.same_view_ratio`; two
    photos are neighbours where that holds for at least half of the points of each.
    """
    found = []
    for first, second in combinations(sorted(model.photos), 2):
        expected = [
            _expected(model, one, other, config)
            for one, other in ((first, second), (second, first))
        ]
        sizes = [len(model.seen[first]), len(model.seen[second])]
        if all(2 * n >= size > 0 for n, size in zip(expected, sizes, strict=True)):
            shared = np.intersect1d(model.seen[first], model.seen[second], assume_unique=True)
            apart = _apart(model, first, second)
            found.append(Neighbours(first, second, min(expected), len(shared), apart))
    return found


def _apart(model: ModelView, first: int, second: int) -> float:
    here, there = (model.photos[photo].centre_in_world for photo in (first, second))
    away = np.linalg.norm(model.points[model.seen[first]] - here, axis=1)
    return float(np.linalg.norm(there - here) / np.median(away))


def _expected(model: ModelView, one: int, other: int, config: SfmConfig) -> int:
    points = model.points[model.seen[one]]
    camera = model.photos[other].camera
    pixels = camera.project(model.photos[other].cam_from_world.apply(points))
    inside = (pixels > 0).all(axis=1) & (pixels < [camera.width_px, camera.height_px]).all(axis=1)
    here = points - model.photos[one].centre_in_world
    there = points - model.photos[other].centre_in_world
    away, away_there = np.linalg.norm(here, axis=1), np.linalg.norm(there, axis=1)
    cosine = (here * there).sum(axis=1) / np.maximum(away * away_there, 1e-300)
    alike = cosine >= np.cos(np.deg2rad(config.same_view_deg))
    near = np.maximum(away, away_there) <= config.same_view_ratio * np.minimum(away, away_there)
    return int((inside & alike & near).sum())


def agreeing_share(
    rays: tuple[FloatArray, FloatArray], first: Photo, second: Photo, config: SfmConfig
) -> float:
    """Share of the matches of two photos that agree with their poses.

    Parameters
    ----------
    rays
        Directions (M, 3) of the matched points in the two cameras, with z = 1.
    first, second
        The photos.
    config
        `SfmConfig.agree_share` is the distance to the epipolar line (Sampson) that agrees.

    Notes
    -----
    Sampson error: Hartley and Zisserman (2004), Multiple View Geometry, section 11.4.3.
    """
    second_from_first = second.cam_from_world @ first.cam_from_world.inverse()
    essential = _essential(second_from_first)
    lines_there, lines_here = rays[0] @ essential.T, rays[1] @ essential
    error = (rays[1] * lines_there).sum(axis=1)
    focal_px = np.sqrt(first.camera.fx_px * second.camera.fx_px)
    slope = (lines_there[:, :2] ** 2).sum(axis=1) + (lines_here[:, :2] ** 2).sum(axis=1)
    limit_px = config.agree_share * max(first.camera.width_px, first.camera.height_px)
    distance_px = focal_px * np.abs(error) / np.sqrt(np.maximum(slope, 1e-300))
    return float((distance_px <= limit_px).mean()) if len(distance_px) else 1.0


def _essential(second_from_first: Rigid3) -> FloatArray:
    x, y, z = second_from_first.translation
    essential: FloatArray = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ (
        second_from_first.rotation
    )
    return essential


def strays(centres: FloatArray, times: float) -> NDArray[np.intp]:
    """Indices of cameras (N, 3) so many times farther from the middle than most, by medians."""
    away = np.linalg.norm(centres - np.median(centres, axis=0), axis=1)
    return np.flatnonzero(away > times * np.median(away))


def scales_contradict(model: ModelView, other: ModelView, limit: float = 0.1) -> bool:
    """Whether two reconstructions of some of the same photos differ in more than position and size.

    Of two such models the distances between the cameras that both have must be in one ratio. Where
    the ratios spread by more than ``limit`` (half the interquartile range over the median), at
    least one model is wrong. Needs three photos in both; with fewer the answer is False.
    """
    common = sorted(model.photos.keys() & other.photos.keys())
    if len(common) < 3:
        return False
    one, two = (
        np.array([view.photos[photo].centre_in_world for photo in common])
        for view in (model, other)
    )
    first, second = np.triu_indices(len(common), k=1)
    lengths = [np.linalg.norm(centres[first] - centres[second], axis=1) for centres in (one, two)]
    longest = [length.max() for length in lengths]
    if min(longest) <= 0:
        return False
    apart = np.minimum(lengths[0] / longest[0], lengths[1] / longest[1]) > 0.01
    ratios = lengths[1][apart] / lengths[0][apart]
    low, middle, high = np.percentile(ratios, [25, 50, 75])
    return bool(high - low > 2 * limit * middle)
