"""C.1: which photos show the same place, found from coarse features, and how they hang together."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from si3fp.camera2d.quality import Grey
from si3fp.config import CaptureConfig
from si3fp.geometry.rigid import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """Coarse features of one photo, the largest first.

    Attributes
    ----------
    points
        (K, 2) in units of the photo's longer side, from its upper left corner.
    descriptors
        RootSIFT (K, 128), of length 1.
    """

    points: FloatArray
    descriptors: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Overlap:
    """Two photos that show the same place, ``first`` < ``second``.

    Attributes
    ----------
    matches
        Number of points that agree with one motion of the camera.
    share
        Share of the photo's texture that both show, from 0 to 1, counted in cells of an eighth of
        the longer side; of the two photos the smaller.
    moved
        How far they lie apart in the two photos, as a share of the longer side; the median.
    """

    first: int
    second: int
    matches: int
    share: float
    moved: float


@dataclass(frozen=True, slots=True)
class WeakLink:
    """A photo that alone connects ``group``, the photos of the smaller side, with the others."""

    photo: int
    group: tuple[int, ...]


def features_of(grey: Grey, config: CaptureConfig) -> Features:
    """SIFT points and RootSIFT descriptors of a photo scaled to `CaptureConfig.match_side_px`."""
    longer = max(grey.shape)
    scale = min(1.0, config.match_side_px / longer)
    small = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    sift = cv2.SIFT.create(nfeatures=config.max_features, contrastThreshold=0.02)
    points, descriptors = sift.detectAndCompute(small, None)
    if not points:
        return Features(np.zeros((0, 2)), np.zeros((0, 128), np.float32))
    order = np.argsort([-point.size for point in points], kind="stable")
    places = (np.array([point.pt for point in points], np.float64) + 0.5) / max(small.shape)
    # Hellinger kernel: Arandjelovic and Zisserman (2012), doi:10.1109/CVPR.2012.6248018.
    root = np.sqrt(descriptors / np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-9))
    return Features(places[order], root[order].astype(np.float32))


def find_overlaps(
    photos: Sequence[Features],
    config: CaptureConfig,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Overlap]:
    """All pairs of photos that show the same place, in order.

    Up to `CaptureConfig.all_pairs_up_to` photos every pair is matched. Of more photos, those pairs
    that follow each other or whose few largest features agree best (preemptive matching: Wu 2013,
    doi:10.1109/3DV.2013.25).

    Parameters
    ----------
    photos
        In the order in which they were taken.
    config
        Constants.
    progress
        Told how many pairs are done.
    """
    pairs = candidate_pairs(photos, config)
    found: list[Overlap] = []
    for done, (first, second) in enumerate(pairs):
        progress(done, len(pairs))
        found += _overlap(first, second, photos[first], photos[second], config)
    progress(len(pairs), len(pairs))
    return found


def candidate_pairs(photos: Sequence[Features], config: CaptureConfig) -> list[tuple[int, int]]:
    """The pairs that are worth a full match, sorted."""
    everything = list(combinations(range(len(photos)), 2))
    if len(photos) <= config.all_pairs_up_to:
        return everything
    agree = np.zeros((len(photos), len(photos)), np.intp)
    largest = [photo.descriptors[: config.coarse_features] for photo in photos]
    for first, second in everything:
        agree[first, second] = agree[second, first] = len(
            _distinct_pairs(largest[first], largest[second], config.ratio)
        )
    best = np.argsort(-agree, axis=1, kind="stable")[:, : config.best_partners]
    chosen = {
        (min(photo, other), max(photo, other))
        for photo, others in enumerate(best.tolist())
        for other in others
        if agree[photo, other]
    }
    return sorted(chosen | {pair for pair in everything if pair[1] - pair[0] <= config.followers})


def components(count: int, overlaps: Sequence[Overlap]) -> list[tuple[int, ...]]:
    """The groups of photos that hang together, the largest first, each sorted."""
    return _groups(range(count), [(pair.first, pair.second) for pair in overlaps])


def weak_links(count: int, overlaps: Sequence[Overlap]) -> list[WeakLink]:
    """Photos without which two photos or more lose the rest of their group, in order."""
    edges = [(pair.first, pair.second) for pair in overlaps]
    links = []
    for group in components(count, overlaps):
        inside = [edge for edge in edges if edge[0] in group]
        for photo in group:
            left = [other for other in group if other != photo]
            parts = _groups(left, [edge for edge in inside if photo not in edge])
            hanging = tuple(sorted(other for part in parts[1:] for other in part))
            if len(hanging) >= 2:
                links.append(WeakLink(photo, hanging))
    return links


def _groups(photos: Sequence[int], edges: Sequence[tuple[int, int]]) -> list[tuple[int, ...]]:
    if not photos:
        return []
    place = {photo: index for index, photo in enumerate(photos)}
    ends = np.array([[place[a], place[b]] for a, b in edges], np.intp).reshape(-1, 2)
    shape = (len(photos), len(photos))
    graph = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=shape)
    number, labels = connected_components(graph, directed=False)
    groups = [
        tuple(photo for photo, label in zip(photos, labels, strict=True) if label == index)
        for index in range(number)
    ]
    return sorted(groups, key=lambda group: (-len(group), group))


def _distinct_pairs(
    first: NDArray[np.float32], second: NDArray[np.float32], ratio: float
) -> NDArray[np.intp]:
    """(M, 2) mutual nearest neighbours that are clearly nearer than the second nearest."""
    if min(len(first), len(second)) < 2:
        return np.zeros((0, 2), np.intp)
    similarity = first @ second.T
    rows = np.arange(len(first))
    best = similarity.argmax(axis=1)
    mutual = similarity.argmax(axis=0)[best] == rows
    top = similarity[rows, best]
    similarity[rows, best] = -1.0
    # Distances of unit vectors; rounding may take a similarity of one beyond it.
    gap, next_gap = (np.sqrt(np.maximum(2 - 2 * s, 0)) for s in (top, similarity.max(axis=1)))
    keep = mutual & (gap < ratio * next_gap)
    return np.stack([rows[keep], best[keep]], axis=1)


def _overlap(
    first: int, second: int, photo: Features, other: Features, config: CaptureConfig
) -> Iterator[Overlap]:
    """The overlap of two photos, or nothing."""
    pairs = _distinct_pairs(photo.descriptors, other.descriptors, config.ratio)
    if len(pairs) < config.min_matches:
        return
    here, there = photo.points[pairs[:, 0]], other.points[pairs[:, 1]]
    side = config.match_side_px
    _, mask = cv2.findFundamentalMat(
        here * side, there * side, cv2.USAC_MAGSAC, config.inlier_px, 0.999, 2000
    )
    agree = np.zeros(len(pairs), bool) if mask is None else mask.ravel().astype(bool)
    if agree.sum() < max(config.min_matches, config.min_agreeing * len(pairs)):
        return
    here, there = here[agree], there[agree]
    moved = float(np.median(np.linalg.norm(here - there, axis=1)))
    share = min(_cells(here) / _cells(photo.points), _cells(there) / _cells(other.points))
    yield Overlap(first, second, int(agree.sum()), share, moved)


def _cells(points: FloatArray) -> int:
    return len(np.unique((points * 8).astype(np.intp), axis=0))
