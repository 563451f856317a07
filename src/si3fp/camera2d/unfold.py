"""C.2: a model in which two parts of a building, that look alike, were laid on each other.

Photos are numbered in the order in which they were taken, on a walk. Where a model jumps from one
part of the building to another, the photos of a stretch of the walk lie where others are, and share
nothing with them. Of the matches between the stretch and the other photos, the false ones are those
that the folded model follows; the true ones it contradicts (docs/decisions/0020-unfolding.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from si3fp.camera2d.coherence import ModelView, Pair
from si3fp.config import SfmConfig
from si3fp.geometry.rigid import FloatArray

DISTANCES = (5.0, 95.0)
"""Percentiles of the distances at which a photo sees points."""
BEYOND = 1.4
"""Factor by which a match may lie nearer or farther."""


def displaced(
    photos: Sequence[int],
    strangers: Sequence[Pair],
    followed: Mapping[Pair, int],
    enough: float = 1.0,
) -> frozenset[int]:
    """The photos of a stretch of the walk that lies where other photos belong; none if none does.

    Parameters
    ----------
    photos
        Of the model, in the order of the walk.
    strangers
        Pairs that the model puts side by side though they share too little.
    followed
        Number of matches that the model follows, by pair of photos.
    enough
        Share of the most strangers that a stretch can part, from which on it may be the one.

    Notes
    -----
    The stretch is the one, of a walk taken as a ring, that parts the most strangers; of those the
    one that parts the fewest matches, as any other goes through photos that belong together. Which
    of the two parts is the wrong one is all the same.
    """
    place = {photo: index for index, photo in enumerate(photos)}
    apart = _places(strangers, place)
    linked = _places(followed, place)
    weights = np.array(list(followed.values()), np.float64)
    ends = np.arange(1, len(photos) + 1)
    parted = np.zeros((len(photos), len(ends)), np.intp)
    cost = np.full(parted.shape, np.inf)
    for start in range(len(photos)):
        parted[start, start:] = _parted(apart, start, ends[start:]).sum(axis=1)
        cost[start, start:] = _parted(linked, start, ends[start:]) @ weights
    if not parted.any():
        return frozenset()
    cost[parted < enough * parted.max()] = np.inf
    first, last = divmod(int(cost.argmin()), len(ends))
    return frozenset(photos[first : last + 1])


def _places(
    pairs: Sequence[Pair] | Mapping[Pair, int], place: Mapping[int, int]
) -> NDArray[np.intp]:
    return np.array([[place[a], place[b]] for a, b in pairs], np.intp).reshape(-1, 2)


def _parted(pairs: NDArray[np.intp], first: int, ends: NDArray[np.intp]) -> NDArray[np.bool_]:
    """(E, P) whether one photo of a pair (P, 2) alone lies in the stretch from first to an end."""
    inside = (pairs[None] >= first) & (pairs[None] < ends[:, None, None])
    return np.asarray(inside[..., 0] != inside[..., 1])


def follows(
    rays: tuple[FloatArray, FloatArray], pair: Pair, model: ModelView, config: SfmConfig
) -> NDArray[np.bool_]:
    """(M,) which matches of two photos a model agrees with.

    Parameters
    ----------
    rays
        Directions (M, 3) of the matched points in the two cameras, with z = 1.
    pair
        Numbers of the photos.
    model
        The model.
    config
        `SfmConfig.agree_share` is the distance that agrees.

    Notes
    -----
    A match has to lie near the part of the epipolar line that belongs to the distances at which the
    first photo sees points: on a wall along which somebody walks, what repeats lies on the line
    itself.
    """
    first, second = (model.photos[photo] for photo in pair)
    if not len(model.seen[pair[0]]) or not len(rays[0]):
        return np.zeros(len(rays[0]), bool)
    in_first = first.cam_from_world.apply(model.points[model.seen[pair[0]]])
    nearest, farthest = np.percentile(in_first[:, 2], DISTANCES)
    second_from_first = second.cam_from_world @ first.cam_from_world.inverse()
    ends = [
        second_from_first.apply(rays[0] * depth) for depth in (nearest / BEYOND, farthest * BEYOND)
    ]
    before = np.minimum(ends[0][:, 2], ends[1][:, 2]) > 0
    start, end = (each[:, :2] / np.where(before, each[:, 2], 1.0)[:, None] for each in ends)
    along = end - start
    length = np.maximum((along**2).sum(axis=1), 1e-300)
    share = np.clip(((rays[1][:, :2] - start) * along).sum(axis=1) / length, 0, 1)
    off = np.linalg.norm(start + share[:, None] * along - rays[1][:, :2], axis=1)
    limit_px = config.agree_share * max(second.camera.width_px, second.camera.height_px)
    return np.asarray(before & (off * second.camera.fx_px <= limit_px))
