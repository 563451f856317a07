"""Algorithm 1 for photos: one photo resampled onto one facade grid."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.config import MosaicConfig
from si3fp.errors import InputError
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Image, OrthoImage, Photo
from si3fp.ortho import within_obliqueness

TILE_PX = 256
"""Tiles of the grid, each with its own factor of averaging: an oblique photo is several times
finer at its near end than at its far end."""


def rectify_photo(photo: Photo, image: Image, grid: FacadeGrid, config: MosaicConfig) -> OrthoImage:
    """The facade as this photo shows it, orthographic, on the grid.

    Parameters
    ----------
    photo
        Camera and pose.
    image
        (H, W, 3) RGB, free of lens distortion.
    grid
        Grid on the facade's plane.
    config
        Largest viewing angle to the facade normal.

    Returns
    -------
    OrthoImage with ``valid`` False outside the photo, behind the camera and beyond
    ``max_obliqueness_deg``; occlusion plays no part.

    Raises
    ------
    InputError
        If the image has not the camera's size.

    Notes
    -----
    SI3FP, Algorithm 1, for a pinhole: a plane and a photo of it differ by a homography, evaluated
    at pixel centres. Where the photo is finer than the grid it is averaged down along each of its
    axes, so that it does not alias.
    """
    camera = photo.camera
    if image.shape != (camera.height_px, camera.width_px, 3):
        raise InputError(
            f"Photo {photo.id} has {image.shape[1]} x {image.shape[0]} px, its camera "
            f"{camera.width_px} x {camera.height_px}; use the photos that the poses belong to."
        )
    homography = _photo_from_grid(photo, grid)
    valid = within_obliqueness(photo, grid, config.max_obliqueness_deg)
    rgb = np.zeros((grid.height_px, grid.width_px, 3), np.uint8)
    for top in range(0, grid.height_px, TILE_PX):
        for left in range(0, grid.width_px, TILE_PX):
            tile = np.s_[top : top + TILE_PX, left : left + TILE_PX]
            _rectify_tile(image, homography, (left, top), rgb[tile], valid[tile])
    return OrthoImage(photo.id, rgb, valid)


def _photo_from_grid(photo: Photo, grid: FacadeGrid) -> FloatArray:
    """(3, 3) homography from grid pixels to photo pixels; its third row is the depth in metres."""
    camera, cam_from_facade = photo.camera, photo.cam_from_world @ grid.world_from_facade
    facade_from_grid = np.array(
        [[grid.m_per_px, 0.0, 0.0], [0.0, -grid.m_per_px, grid.height_m], [0.0, 0.0, 1.0]]
    )
    cam_from_plane = np.column_stack([cam_from_facade.rotation[:, :2], cam_from_facade.translation])
    photo_from_cam = np.array(
        [[camera.fx_px, 0.0, camera.cx_px], [0.0, camera.fy_px, camera.cy_px], [0.0, 0.0, 1.0]]
    )
    homography: FloatArray = photo_from_cam @ cam_from_plane @ facade_from_grid
    return homography


def _rectify_tile(
    image: Image,
    homography: FloatArray,
    corner_px: tuple[int, int],
    rgb: Image,
    valid: NDArray[np.bool_],
) -> None:
    """Fill one tile of the grid in place, and take from its valid pixels those not in the photo."""
    rows, columns = valid.shape
    x = corner_px[0] + np.arange(columns) + 0.5
    y = (corner_px[1] + np.arange(rows) + 0.5)[:, None]
    u, v, depth = (row[0] * x + row[1] * y + row[2] for row in homography)
    valid &= depth > 0
    depth = np.where(depth > 0, depth, 1.0)
    u /= depth
    v /= depth
    sizes = image.shape[1::-1]
    valid &= (u > 0) & (u < sizes[0]) & (v > 0) & (v < sizes[1])
    if not valid.any():
        return
    shrink = [
        _averaging_factor(homography[axis], homography[2], at[valid], depth[valid])
        for axis, at in enumerate((u, v))
    ]
    for at, factor, length in zip((u, v), shrink, sizes, strict=True):
        # Nothing is extrapolated beyond the middle of the first and last averaged pixel.
        valid &= (at >= factor / 2) & (at <= length // factor * factor - factor / 2)
    if not valid.any():
        return
    # The window starts at a multiple of the factor: neighbouring tiles average the same pixels.
    spans = []
    for at, factor, length in zip((u, v), shrink, sizes, strict=True):
        low = max(0, int(at[valid].min() / factor) - 1) * factor
        high = min(length, (int(at[valid].max() / factor) + 2) * factor)
        spans.append((low, low + max(1, (high - low) // factor) * factor))
    (x0, x1), (y0, y1) = spans
    size = ((x1 - x0) // shrink[0], (y1 - y0) // shrink[1])
    source = cv2.resize(image[y0:y1, x0:x1], size, interpolation=cv2.INTER_AREA)
    # cv2 puts (0, 0) at the centre of the first pixel.
    map_x = ((u - x0) / shrink[0] - 0.5).astype(np.float32)
    map_y = ((v - y0) / shrink[1] - 0.5).astype(np.float32)
    sampled = cv2.remap(source, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    rgb[valid] = sampled[valid]


def _averaging_factor(
    row: FloatArray, depth_row: FloatArray, at_px: FloatArray, depth_m: FloatArray
) -> int:
    """Whole number of photo pixels along one of its axes that a grid pixel of the tile spans."""
    across = np.abs(row[0] - at_px * depth_row[0]) / depth_m
    down = np.abs(row[1] - at_px * depth_row[1]) / depth_m
    scale = max(float(np.median(across)), float(np.median(down)))
    return max(1, int(scale + 0.25))
