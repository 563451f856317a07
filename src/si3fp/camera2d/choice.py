"""C.3: which photos a facade is rendered from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from si3fp.camera2d.visibility import BoolLattice, lattice_pixels
from si3fp.config import MosaicConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Photo
from si3fp.ortho import view_distances


def choose_photos(
    photos: Sequence[Photo],
    seen: Mapping[str, BoolLattice],
    grid: FacadeGrid,
    config: MosaicConfig,
) -> list[Photo]:
    """The photos that together show a facade best, best first, at most `max_views`.

    Parameters
    ----------
    photos
        Candidates.
    seen
        From `si3fp.camera2d.visibility.seen_from`.
    grid
        The facade's grid: resolution beyond it is worth nothing.
    config
        Number of photos and the least share of the facade that one must show.

    Notes
    -----
    Greedy: the worth of a place is ``log(1 + sum of q)`` over the photos that show it, q being
    their pixels in one of the grid, at most 1. The first photos cover the facade, further ones go
    where it is still shown poorly. Equal photos are taken in order of their ids.
    """
    worth = {
        photo.id: _resolution(photo, grid, 0) * seen[photo.id]
        for photo in sorted(photos, key=lambda each: each.id)
        if seen[photo.id].mean() >= config.min_seen
    }
    by_id = {photo.id: photo for photo in photos}
    chosen: list[Photo] = []
    total = np.zeros(lattice_pixels(grid).shape[:2])
    while worth and len(chosen) < config.max_views:
        gains = {name: float(np.log1p(w / (1 + total)).sum()) for name, w in worth.items()}
        best = max(gains, key=gains.__getitem__)
        total += worth.pop(best)
        chosen.append(by_id[best])
    return chosen


def best_places(
    photos: Sequence[Photo],
    seen: Mapping[str, BoolLattice],
    grid: FacadeGrid,
    config: MosaicConfig,
) -> dict[str, BoolLattice]:
    """The few photos that look straight at a facade, and the places (h, w) that each stands for.

    Parameters
    ----------
    photos
        Candidates.
    seen
        From `si3fp.camera2d.visibility.seen_from`.
    grid
        The facade's grid: resolution beyond it is worth nothing.
    config
        How many photos stand for a place, how many there are at most, and the least share of the
        facade that one must show.

    Notes
    -----
    A photo is worth ``min(pixels per grid pixel, 1) * cos(obliqueness)**2`` at a place; a facade
    the sum over its places of the `photos_per_place` best. Photos are taken greedily by what they
    add, the best first, equal ones in order of their ids; each then stands for the places where it
    is among the best of those taken. What lies r behind the wall is displaced by r times the
    tangent of the obliqueness, by another amount in every photo: so few and frontal ones.
    """
    worth = {
        photo.id: _resolution(photo, grid, 2) * seen[photo.id]
        for photo in sorted(photos, key=lambda each: each.id)
        if seen[photo.id].mean() >= config.min_seen
    }
    if not worth:
        return {}
    shape = next(iter(worth.values())).shape
    best = np.zeros((config.photos_per_place, *shape))
    chosen: dict[str, FloatArray] = {}
    while worth and len(chosen) < config.max_views:
        gains = {name: float(np.maximum(w - best[0], 0.0).mean()) for name, w in worth.items()}
        name = max(gains, key=gains.__getitem__)
        if gains[name] < config.min_gain:
            break
        chosen[name] = worth.pop(name)
        best[0] = np.maximum(best[0], chosen[name])
        best.sort(axis=0)
    return {name: (worth >= best[0]) & (worth > 0) for name, worth in chosen.items()}


def _resolution(photo: Photo, grid: FacadeGrid, frontal_power: int) -> FloatArray:
    """(h, w) pixels of a photo per grid pixel, at most 1, times a power of the obliqueness."""
    distances_m, cosines = view_distances(photo, grid, lattice_pixels(grid))
    cosines = np.maximum(cosines, 0.0)
    focal_px2 = photo.camera.fx_px * photo.camera.fy_px
    pixels = focal_px2 * cosines * (grid.m_per_px / np.maximum(distances_m, 1e-9)) ** 2
    resolution: FloatArray = np.minimum(pixels, 1.0) * cosines**frontal_power
    return resolution
