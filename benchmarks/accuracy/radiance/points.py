"""Sparse points from the pictures alone: SIFT matches of photos with known poses, triangulated."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.geometry.rigid import FloatArray
from si3fp.model import LoadImage, Photo, SparsePoints

NEIGHBOURS = 8
FEATURES = 3000
RATIO = 0.8
EPIPOLAR_PX = 2.0
REPROJECTION_PX = 2.0
MIN_ANGLE_DEG = 3.0

Observations = tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]


def sparse_points(photos: Sequence[Photo], load: LoadImage) -> SparsePoints:
    """Points that at least three photos agree on within REPROJECTION_PX."""
    images = [load(photo.id) for photo in photos]
    features = [_features(image) for image in images]
    track, photo_index, pixels = _tracks(photos, features)
    points = _triangulated(photos, track, photo_index, pixels)
    for limit_px in (4 * REPROJECTION_PX, REPROJECTION_PX):
        error_px = _errors(photos, points, track, photo_index, pixels)
        kept = error_px < limit_px
        track, photo_index, pixels = track[kept], photo_index[kept], pixels[kept]
        points = _triangulated(photos, track, photo_index, pixels, len(points))
    error_px = _errors(photos, points, track, photo_index, pixels)
    rows, count = np.unique(track[error_px < REPROJECTION_PX], return_counts=True)
    wide = _widest_angle(photos, points, track, photo_index) > MIN_ANGLE_DEG
    rows = [int(row) for row in rows[(count >= 3) & wide[rows]]]
    rgb, mean_px, seen_in = [], [], []
    for row in rows:
        seen = np.flatnonzero(track == row)
        column, line = pixels[seen[0]].astype(int)
        rgb.append(images[photo_index[seen[0]]][line, column])
        mean_px.append(error_px[seen].mean())
        seen_in.append(tuple(sorted({photos[k].id for k in photo_index[seen]})))
    return SparsePoints(points[rows], np.array(rgb, np.uint8), np.array(mean_px), tuple(seen_in))


def _features(image: NDArray[np.uint8]) -> tuple[FloatArray, NDArray[np.float32]]:
    sift = cv2.SIFT_create(nfeatures=FEATURES, contrastThreshold=0.01)
    keypoints, descriptors = sift.detectAndCompute(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), None)
    # cv2 puts (0, 0) at the centre of the first pixel.
    return np.array([k.pt for k in keypoints]) + 0.5, np.sqrt(
        descriptors / np.maximum(descriptors.sum(axis=1, keepdims=True), 1)
    )


def _tracks(
    photos: Sequence[Photo], features: list[tuple[FloatArray, NDArray[np.float32]]]
) -> Observations:
    """Track, photo and pixel (N, 2) of each feature that matches another."""
    starts = np.cumsum([0] + [len(places) for places, _ in features])
    root = np.arange(starts[-1])

    def find(node: int) -> int:
        while root[node] != node:
            root[node] = root[root[node]]
            node = int(root[node])
        return node

    for i, j in _pairs(photos):
        for a, b in _matches(photos[i], photos[j], features[i], features[j]):
            root[find(int(starts[i] + a))] = find(int(starts[j] + b))
    track = np.array([find(node) for node in range(len(root))])
    photo_index = np.searchsorted(starts, np.arange(len(root)), side="right") - 1
    _, track, count = np.unique(track, return_inverse=True, return_counts=True)
    used = count[track] >= 2
    _, track = np.unique(track[used], return_inverse=True)
    pixels = np.concatenate([places for places, _ in features])
    return track, photo_index[used], pixels[used]


def _pairs(photos: Sequence[Photo]) -> list[tuple[int, int]]:
    """Each photo with the nearest NEIGHBOURS."""
    centres = np.array([photo.centre_in_world for photo in photos])
    gaps = np.linalg.norm(centres[:, None] - centres[None], axis=-1)
    order = np.argsort(gaps, axis=1, kind="stable")[:, 1 : NEIGHBOURS + 1]
    return sorted({(min(i, int(j)), max(i, int(j))) for i, row in enumerate(order) for j in row})


def _matches(
    first: Photo,
    second: Photo,
    in_first: tuple[FloatArray, NDArray[np.float32]],
    in_second: tuple[FloatArray, NDArray[np.float32]],
) -> NDArray[np.intp]:
    """Index pairs (M, 2) that pass the ratio test both ways and the known epipolar geometry."""
    likeness = in_first[1] @ in_second[1].T  # root SIFT: unit vectors
    best = likeness.argmax(axis=1)
    rows = np.arange(len(best))
    top = likeness[rows, best]
    mutual = likeness.argmax(axis=0)[best] == rows
    likeness[rows, best] = -1.0
    runner_up = likeness.max(axis=1)
    apart = np.sqrt(np.maximum(2 - 2 * top, 0)) < RATIO * np.sqrt(np.maximum(2 - 2 * runner_up, 0))
    pairs = np.stack([rows, best], axis=1)[mutual & apart]

    relative = second.cam_from_world @ first.cam_from_world.inverse()
    x, y, z = relative.translation
    essential = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ relative.rotation
    ray_1 = first.camera.unproject(in_first[0][pairs[:, 0]])
    ray_2 = second.camera.unproject(in_second[0][pairs[:, 1]])
    line_2, line_1 = ray_1 @ essential.T, ray_2 @ essential
    square = (line_2[:, :2] ** 2).sum(axis=1) + (line_1[:, :2] ** 2).sum(axis=1)
    sampson = np.abs((ray_2 * line_2).sum(axis=1)) / np.sqrt(square) * first.camera.fx_px
    return np.asarray(pairs[sampson < EPIPOLAR_PX])


def _triangulated(
    photos: Sequence[Photo],
    track: NDArray[np.intp],
    photo_index: NDArray[np.intp],
    pixels: FloatArray,
    count: int | None = None,
) -> FloatArray:
    """Points (T, 3) with the least squared distance to their rays; NaN where that is undefined."""
    count = int(track.max()) + 1 if count is None else count
    origins, rays = _rays(photos, photo_index, pixels)
    across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
    normal, right = np.zeros((count, 3, 3)), np.zeros((count, 3))
    np.add.at(normal, track, across)
    np.add.at(right, track, np.einsum("nij,nj->ni", across, origins))
    solvable = np.linalg.det(normal) > 1e-6
    points = np.full((count, 3), np.nan)
    points[solvable] = np.linalg.solve(normal[solvable], right[solvable][..., None])[..., 0]
    return points


def _rays(
    photos: Sequence[Photo], photo_index: NDArray[np.intp], pixels: FloatArray
) -> tuple[FloatArray, FloatArray]:
    origins, rays = np.zeros((len(pixels), 3)), np.zeros((len(pixels), 3))
    for index, photo in enumerate(photos):
        own = photo_index == index
        rays[own] = photo.cam_from_world.inverse().rotate(photo.camera.unproject(pixels[own]))
        origins[own] = photo.centre_in_world
    return origins, rays / np.linalg.norm(rays, axis=1, keepdims=True)


def _errors(
    photos: Sequence[Photo],
    points: FloatArray,
    track: NDArray[np.intp],
    photo_index: NDArray[np.intp],
    pixels: FloatArray,
) -> FloatArray:
    """Reprojection error (N,) of each observation; infinite behind the camera."""
    error_px = np.zeros(len(track))
    for index, photo in enumerate(photos):
        own = photo_index == index
        places = photo.camera.project(photo.cam_from_world.apply(points[track[own]]))
        error_px[own] = np.linalg.norm(places - pixels[own], axis=1)
    return np.nan_to_num(error_px, nan=np.inf)


def _widest_angle(
    photos: Sequence[Photo],
    points: FloatArray,
    track: NDArray[np.intp],
    photo_index: NDArray[np.intp],
) -> FloatArray:
    """Angle in degrees (T,) between the rays at the left and right end of a point's cameras."""
    centres = np.array([photo.centre_in_world for photo in photos])
    rays = points[track] - centres[photo_index]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    low, high = np.full((len(points), 3), 2.0), np.full((len(points), 3), -2.0)
    np.minimum.at(low, track, rays)
    np.maximum.at(high, track, rays)
    span = np.linalg.norm(np.maximum(high - low, 0), axis=1)
    return np.rad2deg(2 * np.arcsin(np.clip(span / 2, 0, 1)))
