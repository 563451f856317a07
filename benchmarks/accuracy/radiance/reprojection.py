"""Photos blended on a surface of known depth: what the field is compared with."""

from __future__ import annotations

import cv2
import numpy as np
from benchmarks.accuracy.radiance.case import Case
from benchmarks.accuracy.radiance.renderer import Truth
from benchmarks.accuracy.radiance.scores import Rendering
from numpy.typing import NDArray

from si3fp.blend import blend
from si3fp.model import OrthoImage
from si3fp.ortho import view_weight


def on_true_depth(case: Case, truth: Truth) -> Rendering:
    """Each photo where it truly sees, on the true depth: no renderer knows more."""
    return _reprojected(case, truth, truth.depth_m, truth.sees)


def on_the_plane(case: Case, truth: Truth) -> Rendering:
    """The photos on the wall's plane, occlusion unknown: the plain mosaic."""
    return _reprojected(case, truth, np.zeros_like(truth.depth_m), None)


def _reprojected(
    case: Case, truth: Truth, depth_m: NDArray[np.float32], sees: NDArray[np.bool_] | None
) -> Rendering:
    grid = truth.grid
    pixels = np.stack(
        np.meshgrid(np.arange(grid.width_px) + 0.5, np.arange(grid.height_px) + 0.5), axis=-1
    )
    points = np.concatenate([grid.facade_from_pixels(pixels), depth_m[..., None]], axis=-1)
    views = []
    for index, photo in enumerate(case.photos):
        camera = photo.camera
        places = camera.project((photo.cam_from_world @ grid.world_from_facade).apply(points))
        x_px, y_px = np.moveaxis(places.astype(np.float32), -1, 0)
        framed = (x_px > 0.5) & (x_px < camera.width_px - 0.5)
        framed &= (y_px > 0.5) & (y_px < camera.height_px - 0.5)
        # cv2 puts (0, 0) at the centre of the first pixel.
        rgb = cv2.remap(case.load(photo.id), x_px - 0.5, y_px - 0.5, cv2.INTER_LINEAR)
        views.append(OrthoImage(photo.id, rgb, framed if sees is None else framed & sees[index]))
    weights = [view_weight(photo, grid) for photo in case.photos]
    # Exposure is the same in all photos: no gains to fit.
    return Rendering(blend(views, weights, np.ones((len(views), 3))).rgb, depth_m)
