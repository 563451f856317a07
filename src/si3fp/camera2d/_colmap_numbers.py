"""What COLMAP's models and database say, in numbers; part of its process."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pycolmap
from numpy.typing import NDArray

from si3fp.camera2d.coherence import ModelView, Pair
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Photo


def view(model: Any) -> ModelView:
    """A model in numbers, photos counted from zero."""
    place = {point: index for index, point in enumerate(model.points3D)}
    points = np.array([point.xyz for point in model.points3D.values()], np.float64)
    seen: dict[int, set[int]] = {number - 1: set() for number in model.reg_image_ids()}
    for point, index in place.items():
        for element in model.points3D[point].track.elements:
            seen[element.image_id - 1].add(index)
    photos = {}
    for number in model.reg_image_ids():
        image = model.images[number]
        camera = model.cameras[image.camera_id]
        (fx, _, cx), (_, fy, cy), _ = camera.calibration_matrix().tolist()
        pose = image.cam_from_world().matrix()
        photos[number - 1] = Photo(
            image.name,
            Pinhole(fx, fy, cx, cy, camera.width, camera.height),
            Rigid3(pose[:, :3], pose[:, 3]),
        )
    indices = {photo: np.array(sorted(index), np.intp) for photo, index in seen.items()}
    return ModelView(photos, points.reshape(-1, 3), indices)


def verified_matches(database: Any) -> dict[Pair, tuple[FloatArray, FloatArray]]:
    """Pixels (M, 2) of verified matches in both photos, by pair, photos counted from zero."""
    found = {}
    pixels: dict[int, Any] = {}
    for pair_id, geometry in zip(*database.read_two_view_geometries(), strict=True):
        matches = geometry.inlier_matches
        if not len(matches):
            continue
        pair = pycolmap.pair_id_to_image_pair(pair_id)
        for number in pair:
            if number not in pixels:
                pixels[number] = database.read_keypoints(number)[:, :2].astype(np.float64)
        first, second = (number - 1 for number in pair)
        found[first, second] = (pixels[pair[0]][matches[:, 0]], pixels[pair[1]][matches[:, 1]])
    return found


def all_matches(
    database: Any, pairs: Sequence[Pair]
) -> dict[Pair, tuple[NDArray[np.uint32], tuple[FloatArray, FloatArray]]]:
    """Features (M, 2) and pixels (M, 2) in both photos of all matches of some pairs of photos."""
    found = {}
    for pair in pairs:
        ids = [number + 1 for number in pair]
        indices = database.read_matches(*ids)
        here, there = (
            database.read_keypoints(number)[indices[:, column], :2].astype(np.float64)
            for column, number in enumerate(ids)
        )
        found[pair] = (indices, (here, there))
    return found


def rays_of(
    matches: dict[Pair, tuple[FloatArray, FloatArray]], model: Any
) -> dict[Pair, tuple[FloatArray, FloatArray]]:
    """The matches of the photos of a model as directions with z = 1, free of distortion."""
    registered = {number - 1 for number in model.reg_image_ids()}

    def rays(photo: int, pixels: FloatArray) -> FloatArray:
        camera = model.cameras[model.images[photo + 1].camera_id]
        return np.pad(camera.cam_from_img(pixels), ((0, 0), (0, 1)), constant_values=1.0)

    return {
        (first, second): (rays(first, here), rays(second, there))
        for (first, second), (here, there) in matches.items()
        if registered >= {first, second}
    }
