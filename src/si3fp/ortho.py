"""Algorithm 1: one panorama resampled onto one facade grid.

The map from grid to panorama is smooth, so it is computed exactly on a coarse lattice and
interpolated; the lattice is refined until the interpolation error is below `MAP_ERROR_PX`. What
remains per pixel is one `cv2.remap`.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.config import OrthoConfig
from si3fp.geometry.equirect import pixels_from_directions
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Image, OrthoImage, Panorama

MAP_ERROR_PX = 0.05
"""Largest error of the interpolated map, in source pixels: half a step of cv2's fixed point."""

LATTICE_STEPS_PX = (32, 16, 8, 4, 2)


def view_distances(
    panorama: Panorama, grid: FacadeGrid, pixels: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Distance in metres and cosine of obliqueness of a panorama to grid pixels (..., 2).

    The cosine is negative where the camera is behind the facade plane.
    """
    rays = panorama.centre_in_world - grid.world_from_pixels(pixels)
    distances_m = np.linalg.norm(rays, axis=-1)
    return distances_m, rays @ grid.normal_in_world / np.maximum(distances_m, 1e-9)


def source_m_per_px(panorama: Panorama, grid: FacadeGrid, width_px: int) -> float:
    """Size in metres of a source pixel at the best seen tenth of the facade.

    The nearest point decides what the image can resolve: a grid finer than that only magnifies.
    """
    corners = np.stack(
        np.meshgrid(
            np.linspace(0, grid.width_px, 33), np.linspace(0, grid.height_px, 17), indexing="xy"
        ),
        axis=-1,
    )
    distances_m, cosines = view_distances(panorama, grid, corners)
    sizes = np.where(
        cosines > 0.1, distances_m * (2 * np.pi / width_px) / np.maximum(cosines, 0.1), np.inf
    )
    return float(np.quantile(sizes, 0.1))


def rectify(
    panorama: Panorama,
    image: Image,
    seen: NDArray[np.bool_],
    grid: FacadeGrid,
    config: OrthoConfig,
) -> OrthoImage:
    """The facade as this panorama shows it, orthographic, on the common grid.

    Parameters
    ----------
    panorama
        Pose of the image.
    image
        (H, W, 3) full equirectangular RGB image, W = 2 H.
    seen
        (H, W) bool, False where the image has no content.
    grid
        Grid on the common plane of the facade (METHOD decision 5, not the panorama's own plane).
    config
        Band height and the largest viewing angle to the facade normal.

    Returns
    -------
    OrthoImage with ``valid`` False outside the content, behind the camera and beyond
    ``max_obliqueness_deg``.

    Notes
    -----
    SI3FP, Algorithm 1, at pixel centres. Where the source is finer than the grid it is first
    averaged down by a power of two, so that nothing aliases.
    """
    lattice, step = _lattice_map(panorama, grid, image.shape[1], image.shape[0])
    window = _source_window(lattice, step, image.shape[1], image.shape[0])
    left, top_row, _, _, shrink = window
    source = _cut(image, window)
    mask = np.multiply(_cut(seen.view(np.uint8), (*window[:4], 1)), np.uint8(255), dtype=np.uint8)
    mask = _shrunk(mask, shrink)
    local = ((lattice - [left, top_row]) / shrink).astype(np.float32)

    rgb = np.empty((grid.height_px, grid.width_px, 3), np.uint8)
    valid = np.empty((grid.height_px, grid.width_px), np.uint8)
    rows_per_band = max(1, config.band_px // step) * step
    for top in range(0, grid.height_px, rows_per_band):
        bottom = min(top + rows_per_band, grid.height_px)
        # cv2 puts (0, 0) at the centre of the first pixel; the lattice counts from its corner.
        map_x, map_y = (
            _upsampled(local[..., axis], step, top, bottom, grid.width_px) - np.float32(0.5)
            for axis in (0, 1)
        )
        for target, pixels in ((rgb, source), (valid, mask)):
            cv2.remap(pixels, map_x, map_y, cv2.INTER_LINEAR, dst=target[top:bottom])
    looks_at_front = _within_obliqueness(panorama, grid, config.max_obliqueness_deg)
    return OrthoImage(panorama.id, rgb, (valid == 255) & looks_at_front)


def _lattice_map(
    panorama: Panorama, grid: FacadeGrid, width_px: int, height_px: int
) -> tuple[FloatArray, int]:
    """Source pixels (h, w, 2) at lattice nodes ``(k - 0.5) * step`` and the step in grid pixels."""
    step = LATTICE_STEPS_PX[0]
    for step in LATTICE_STEPS_PX:
        nodes = _node_pixels(grid, step)
        lattice = _project(panorama, grid, nodes, width_px, height_px)
        middles = (nodes[:-1, :-1] + nodes[1:, 1:]) / 2
        exact = _project(panorama, grid, middles, width_px, height_px)
        linear = (lattice[:-1, :-1] + lattice[1:, 1:] + lattice[1:, :-1] + lattice[:-1, 1:]) / 4
        if np.abs(linear - exact).max() < MAP_ERROR_PX:
            break
    return lattice, step


def _node_pixels(grid: FacadeGrid, step: int) -> FloatArray:
    columns = (np.arange(-(-grid.width_px // step) + 2) - 0.5) * step
    rows = (np.arange(-(-grid.height_px // step) + 2) - 0.5) * step
    return np.stack(np.meshgrid(columns, rows, indexing="xy"), axis=-1)


def _project(
    panorama: Panorama, grid: FacadeGrid, pixels: FloatArray, width_px: int, height_px: int
) -> FloatArray:
    """Source pixels of grid pixels, x unwrapped around the facade's middle so that it is smooth."""
    rays = panorama.pano_from_world.apply(grid.world_from_pixels(pixels))
    source = pixels_from_directions(rays, width_px, height_px)
    middle = panorama.pano_from_world.apply(
        grid.world_from_pixels([grid.width_px / 2, grid.height_px / 2])
    )
    centre_x = pixels_from_directions(middle, width_px, height_px)[0]
    source[..., 0] = centre_x + (source[..., 0] - centre_x + width_px / 2) % width_px - width_px / 2
    return source


def _source_window(
    lattice: FloatArray, step: int, width_px: int, height_px: int
) -> tuple[int, int, int, int, int]:
    """Left, top, right, bottom of the source pixels needed, and the factor to average by."""
    across = np.linalg.norm(np.diff(lattice, axis=1), axis=-1) / step
    down = np.linalg.norm(np.diff(lattice, axis=0), axis=-1) / step
    scale = min(float(np.median(across)), float(np.median(down)))
    shrink = 2 ** max(0, int(np.floor(np.log2(max(scale, 1.0)) + 0.2)))
    left = int(np.floor(lattice[..., 0].min())) - 2 * shrink
    right = int(np.ceil(lattice[..., 0].max())) + 2 * shrink
    top = max(0, int(np.floor(lattice[..., 1].min())) - 2 * shrink)
    bottom = min(height_px, int(np.ceil(lattice[..., 1].max())) + 2 * shrink)
    right = min(right, left + width_px)
    return left, top, right, bottom, shrink


def _cut(pixels: Image, window: tuple[int, int, int, int, int]) -> Image:
    """The window of the source, wrapped around the seam, averaged down."""
    left, top, right, bottom, shrink = window
    width = pixels.shape[1]
    start = left % width
    stop = start + right - left
    if stop <= width:
        part = pixels[top:bottom, start:stop]
    else:
        part = np.concatenate(
            [pixels[top:bottom, start:], pixels[top:bottom, : stop - width]], axis=1
        )
    return _shrunk(part, shrink)


def _shrunk(pixels: Image, shrink: int) -> Image:
    if shrink == 1:
        return np.ascontiguousarray(pixels)
    height, width = pixels.shape[0] // shrink * shrink, pixels.shape[1] // shrink * shrink
    small = cv2.resize(
        pixels[:height, :width], (width // shrink, height // shrink), interpolation=cv2.INTER_AREA
    )
    return np.asarray(small, np.uint8)


def _upsampled(
    local: NDArray[np.float32], step: int, top: int, bottom: int, width_px: int
) -> NDArray[np.float32]:
    """The map of the rows ``top:bottom`` (a multiple of step, except at the end) at every pixel."""
    first, last = top // step, -(-bottom // step) + 2
    rows = local[first:last]
    full = cv2.resize(
        rows, (rows.shape[1] * step, rows.shape[0] * step), interpolation=cv2.INTER_LINEAR
    )
    # Node k stands at pixel (k - 0.5) * step; resize puts it at (k + 0.5) * step.
    return np.ascontiguousarray(full[step : step + bottom - top, step : step + width_px])


def _within_obliqueness(
    panorama: Panorama, grid: FacadeGrid, max_obliqueness_deg: float
) -> NDArray[np.bool_]:
    """(H, W) bool: the camera is in front of the plane and not too oblique to it."""
    camera = grid.world_from_facade.inverse().apply(panorama.centre_in_world)
    x, y = _axis_gaps(grid, camera)
    reach = max(camera[2], 0.0) * np.tan(np.deg2rad(max_obliqueness_deg))
    inside: NDArray[np.bool_] = x[None, :] ** 2 + y[:, None] ** 2 <= reach**2
    return inside


def _axis_gaps(grid: FacadeGrid, camera: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Metres from the camera's foot to the pixel columns (W,) and rows (H,)."""
    x = grid.facade_from_pixels(
        np.stack([np.arange(grid.width_px) + 0.5, np.zeros(grid.width_px)], axis=-1)
    )[:, 0]
    y = grid.facade_from_pixels(
        np.stack([np.zeros(grid.height_px), np.arange(grid.height_px) + 0.5], axis=-1)
    )[:, 1]
    return x - camera[0], y - camera[1]


def view_weight(panorama: Panorama, grid: FacadeGrid) -> NDArray[np.float32]:
    """(H, W) resolution on the wall relative to the grid, squared: pixels per grid pixel.

    A pixel at distance d and viewing angle a to the normal shows ``cos(a) / d**2`` of solid angle
    per square metre; obliqueness and distance both lower it.
    """
    camera = grid.world_from_facade.inverse().apply(panorama.centre_in_world)
    x, y = _axis_gaps(grid, camera)
    square = x[None, :] ** 2 + y[:, None] ** 2 + camera[2] ** 2
    weight: NDArray[np.float32] = (max(camera[2], 0.0) / square**1.5).astype(np.float32)
    return weight


def pose_sigma_m(
    panorama: Panorama, grid: FacadeGrid, position_sigma_m: float, direction_sigma_deg: float
) -> float:
    """How far a pose error moves the view at the middle of the facade, standard deviation in m."""
    middle = np.array([grid.width_px / 2, grid.height_px / 2])
    distance_m, cosine = view_distances(panorama, grid, middle)
    turn_m = distance_m * np.deg2rad(direction_sigma_deg)
    return float(np.hypot(position_sigma_m, turn_m) / max(float(cosine), 0.1))
