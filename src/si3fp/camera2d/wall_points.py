"""The sparse points that can lie on walls, with the cameras that saw them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from si3fp.config import PlaneConfig
from si3fp.errors import InputError, ReconstructionError
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Photo, SparsePoints

IntArray = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class WallPoints:
    """Reliable points and who saw them.

    Attributes
    ----------
    points_in_world
        (N, 3) metres, z up.
    weights
        (N,) 1 over the number of points in the same cube of `PlaneConfig.cell_m`, so that a
        textured patch counts no more than a plain one.
    centres_in_world
        (C, 3) optical centres of the photos.
    photo_ids
        Names of the photos.
    seen_point, seen_photo
        (M,) indices of a point and of a photo that saw it.
    """

    points_in_world: FloatArray
    weights: FloatArray
    centres_in_world: FloatArray
    photo_ids: tuple[str, ...]
    seen_point: IntArray
    seen_photo: IntArray

    def views_of(self, members: IntArray) -> IntArray:
        """Number of these points (C,) that each photo saw."""
        chosen = np.zeros(len(self.weights), dtype=np.bool_)
        chosen[members] = True
        photos = self.seen_photo[chosen[self.seen_point]]
        return np.bincount(photos, minlength=len(self.photo_ids)).astype(np.intp)


def select_wall_points(
    photos: Sequence[Photo], points: SparsePoints, config: PlaneConfig
) -> WallPoints:
    """The points that enough photos saw, under a wide enough angle, with a small residual.

    Parameters
    ----------
    photos
        Photos with poses in a metric world with z up.
    points
        Points of the same world; tracks may name photos that are not among these.
    config
        Limits.

    Raises
    ------
    InputError
        If a point is not finite.
    ReconstructionError
        If fewer than `PlaneConfig.min_points` remain.
    """
    places = np.asarray(points.points_in_world, dtype=np.float64).reshape(-1, 3)
    if not np.isfinite(places).all():
        bad = int((~np.isfinite(places)).any(axis=1).sum())
        raise InputError(
            f"{bad} of {len(places)} sparse points are NaN or infinite; remove them or reconstruct "
            "the photos again."
        )
    index = {photo.id: number for number, photo in enumerate(photos)}
    pairs = [
        (point, index[name])
        for point, track in enumerate(points.photo_ids)
        for name in dict.fromkeys(track)
        if name in index
    ]
    seen_point, seen_photo = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
    centres = np.array([photo.centre_in_world for photo in photos]).reshape(-1, 3)
    views = np.bincount(seen_point, minlength=len(places))
    angle_deg = _angles_deg(places, centres, seen_point, seen_photo)
    kept = (
        (views >= config.min_views)
        & (points.error_px <= config.max_error_px)
        & (angle_deg >= config.min_angle_deg)
    )
    if kept.sum() < config.min_points:
        raise ReconstructionError(
            f"Only {int(kept.sum())} of {len(places)} sparse points were seen by "
            f"{config.min_views} photos or more, under {config.min_angle_deg:g} degrees or more, "
            f"{config.min_points} are needed to find walls. Take more photos that overlap, from "
            "places farther apart."
        )
    number = np.cumsum(kept) - 1
    used = kept[seen_point]
    return WallPoints(
        places[kept],
        cell_weights(places[kept], config.cell_m),
        centres,
        tuple(photo.id for photo in photos),
        number[seen_point[used]],
        seen_photo[used],
    )


def cell_weights(points: FloatArray, cell_m: float) -> FloatArray:
    """1 over the number of points in the same cube (N,) of points (N, 3)."""
    cells = np.floor(points / cell_m).astype(np.int64)
    _, cell, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    weights: FloatArray = 1.0 / count[cell.reshape(-1)]
    return weights


def _angles_deg(
    places: FloatArray, centres: FloatArray, seen_point: IntArray, seen_photo: IntArray
) -> FloatArray:
    """Width (P,) of the bundle of rays of each point: twice its largest angle to their mean."""
    rays = centres[seen_photo] - places[seen_point]
    rays = rays / np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-9)
    mean = np.stack(
        [np.bincount(seen_point, weights=ray, minlength=len(places)) for ray in rays.T], axis=1
    )
    mean = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-9)
    cosine = np.ones(len(places))
    np.minimum.at(cosine, seen_point, np.sum(rays * mean[seen_point], axis=1))
    return 2 * np.rad2deg(np.arccos(np.clip(cosine, -1.0, 1.0)))
