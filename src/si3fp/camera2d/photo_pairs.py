"""C.2: which pairs of photos are matched in full."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from si3fp.camera2d.overlap import Features, candidate_pairs
from si3fp.config import CaptureConfig, SfmConfig
from si3fp.geometry.rigid import FloatArray


def pairs_to_match(
    positions_m: ArrayLike,
    coarse_features: Callable[[], list[Features]],
    config: SfmConfig,
    capture: CaptureConfig,
) -> list[tuple[int, int]]:
    """Pairs of photos by index, the smaller first, sorted.

    Up to `SfmConfig.all_pairs_up_to` photos every pair. Of more, those that follow each other, the
    first photos with the last (a walk around a building ends where it began), those whose coarse
    features agree best, and those taken near each other.

    Parameters
    ----------
    positions_m
        (N, 3) places in the order in which the photos were taken, in metres in any frame; a row of
        NaN where unknown.
    coarse_features
        Called where they are needed, as they take time: the features of each photo.
    config, capture
        Constants; ``capture`` those of the coarse features.
    """
    positions = np.asarray(positions_m, np.float64).reshape(-1, 3)
    count = len(positions)
    if count <= config.all_pairs_up_to:
        return list(combinations(range(count), 2))
    followers = replace(capture, all_pairs_up_to=0, followers=config.followers)
    pairs = set(candidate_pairs(coarse_features(), followers))
    pairs |= {
        (first, last)
        for first in range(config.followers)
        for last in range(count - config.followers, count)
    }
    return sorted(pairs | _near(positions, config))


def _near(positions: FloatArray, config: SfmConfig) -> set[tuple[int, int]]:
    """Pairs of photos that were taken near each other."""
    known = np.flatnonzero(np.isfinite(positions).all(axis=1))
    pairs = set()
    for photo in known.tolist():
        others = known[known != photo]
        away_m = np.linalg.norm(positions[others] - positions[photo], axis=1)
        nearest = np.argsort(away_m, kind="stable")[: config.near_photos]
        for other in others[nearest[away_m[nearest] <= config.near_m]].tolist():
            pairs.add((min(photo, other), max(photo, other)))
    return pairs
