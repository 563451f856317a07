"""Algorithm 1: one panorama resampled onto one facade grid; how well any camera resolves a wall.

The map from grid to panorama is smooth, so it is computed exactly on a coarse lattice and
interpolated; the lattice is as fine as `MAP_ERROR_PX` asks. What remains per pixel is one
`cv2.remap`.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.config import OrthoConfig
from si3fp.geometry.equirect import pixels_from_directions
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Image, OrthoImage, Panorama, Photo

MAP_ERROR_PX = 0.05
"""Largest error of the interpolated map, in pixels of the source as it is sampled, that is after
averaging down: cv2's own fixed point has steps of 1/32."""

LATTICE_STEPS_PX = (32, 16, 8, 4, 2)


def view_distances(
    source: Panorama | Photo, grid: FacadeGrid, pixels: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Distance in metres and cosine of obliqueness of a camera to grid pixels (..., 2).

    The cosine is negative where the camera is behind the facade plane.
    """
    rays = source.centre_in_world - grid.world_from_pixels(pixels)
    distances_m = np.linalg.norm(rays, axis=-1)
    return distances_m, rays @ grid.normal_in_world / np.maximum(distances_m, 1e-9)


def source_m_per_px(panorama: Panorama, grid: FacadeGrid, width_px: int) -> float:
    """Size in metres of a source pixel at the best seen tenth of the facade.

    The nearest point decides what the image can resolve: a grid finer than that only magnifies.
    Infinite where the camera sees less than that tenth.
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
    return float(np.quantile(sizes, 0.1, method="lower"))


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
    averaged down by a power of two, so that it does not alias. One factor serves the whole view,
    that of the median pixel: places much nearer than most are still sampled, not averaged.
    """
    lattice, step, shrink = _lattice_map(panorama, grid, image.shape[1], image.shape[0])
    window = _source_window(lattice, shrink, image.shape[1], image.shape[0])
    source = _shrunk(_cut(image, window), shrink)
    mask = _shrunk(_cut(seen.view(np.uint8), window) * np.uint8(255), shrink)
    # cv2 puts (0, 0) at the centre of the first pixel; the lattice counts from its corner.
    corner = np.array(window[:2])[:, None, None]
    local = ((lattice - corner) / shrink - 0.5).astype(np.float32)

    rgb = np.empty((grid.height_px, grid.width_px, 3), np.uint8)
    valid = within_obliqueness(panorama, grid, config.max_obliqueness_deg)
    rows_per_band = max(1, config.band_px // step) * step
    for top in range(0, grid.height_px, rows_per_band):
        band = slice(top, min(top + rows_per_band, grid.height_px))
        nodes = local[:, _node_rows(band, step)]
        map_x, map_y = (_upsampled(axis, step, valid[band].shape) for axis in nodes)
        cv2.remap(source, map_x, map_y, cv2.INTER_LINEAR, dst=rgb[band])
        if not _all_seen(nodes, mask):
            valid[band] &= np.equal(cv2.remap(mask, map_x, map_y, cv2.INTER_LINEAR), 255)
    return OrthoImage(panorama.id, rgb, valid)


def _lattice_map(
    panorama: Panorama, grid: FacadeGrid, width_px: int, height_px: int
) -> tuple[FloatArray, int, int]:
    """Source pixels (2, h, w) at lattice nodes, the step in grid pixels, the factor to average by.

    Node k stands at grid pixel ``(k - 0.5) * step``. Between nodes a step h apart, linear
    interpolation errs by h**2 / 8 times the second derivative, which is an eighth of the second
    difference of the nodes; both axes add up.
    """
    step = LATTICE_STEPS_PX[0]
    lattice = _project(panorama, grid, _node_pixels(grid, step), width_px, height_px)
    shrink = _averaging_factor(lattice, step)
    while (error_px := _interpolation_error(lattice)) > MAP_ERROR_PX * shrink:
        finer = [smaller for smaller in LATTICE_STEPS_PX if smaller < step]
        if not finer:
            break
        # The error falls with the square of the step.
        fitting = step * np.sqrt(MAP_ERROR_PX * shrink / error_px)
        step = next((smaller for smaller in finer if smaller <= fitting), finer[-1])
        lattice = _project(panorama, grid, _node_pixels(grid, step), width_px, height_px)
        shrink = _averaging_factor(lattice, step)
    return lattice, step, shrink


def _interpolation_error(lattice: FloatArray) -> float:
    """Bound in source pixels on what linear interpolation between the nodes (2, h, w) errs."""
    across = np.abs(np.diff(lattice, 2, axis=2)).max(axis=(1, 2))
    down = np.abs(np.diff(lattice, 2, axis=1)).max(axis=(1, 2))
    return float((across + down).max()) / 8


def _averaging_factor(lattice: FloatArray, step: int) -> int:
    """Power of two by which the source is finer than the grid on most of the facade."""
    across = np.hypot(*np.diff(lattice, axis=2)) / step
    down = np.hypot(*np.diff(lattice, axis=1)) / step
    scale = min(float(np.median(across)), float(np.median(down)))
    return 1 << int(np.floor(np.log2(max(scale, 1.0)) + 0.2))


def _node_pixels(grid: FacadeGrid, step: int) -> FloatArray:
    columns = (np.arange(-(-grid.width_px // step) + 2) - 0.5) * step
    rows = (np.arange(-(-grid.height_px // step) + 2) - 0.5) * step
    return np.stack(np.meshgrid(columns, rows, indexing="xy"), axis=-1)


def _project(
    panorama: Panorama, grid: FacadeGrid, pixels: FloatArray, width_px: int, height_px: int
) -> FloatArray:
    """Source pixels (2, ...) of grid pixels (..., 2), x unwrapped around the facade's middle."""
    rays = panorama.pano_from_world.apply(grid.world_from_pixels(pixels))
    x, y = np.moveaxis(pixels_from_directions(rays, width_px, height_px), -1, 0)
    middle = panorama.pano_from_world.apply(
        grid.world_from_pixels([grid.width_px / 2, grid.height_px / 2])
    )
    centre_x = pixels_from_directions(middle, width_px, height_px)[0]
    x = centre_x + (x - centre_x + width_px / 2) % width_px - width_px / 2
    return np.stack([x, y])


def _source_window(
    lattice: FloatArray, shrink: int, width_px: int, height_px: int
) -> tuple[int, int, int, int]:
    """Left, top, right, bottom of the source pixels needed; x may run beyond the seam.

    Never wider than the image: within the 16 bit sizes of cv2.remap for 16384 pixels and more.
    """
    low = np.floor(lattice.min(axis=(1, 2))).astype(int) - 2 * shrink
    high = np.ceil(lattice.max(axis=(1, 2))).astype(int) + 2 * shrink
    left, top = int(low[0]), max(0, int(low[1]))
    return left, top, min(int(high[0]), left + width_px), min(int(high[1]), height_px)


def _cut(pixels: Image, window: tuple[int, int, int, int]) -> Image:
    """The window of the source, wrapped around the seam."""
    left, top, right, bottom = window
    width = pixels.shape[1]
    start = left % width
    stop = start + right - left
    if stop <= width:
        return pixels[top:bottom, start:stop]
    return np.concatenate([pixels[top:bottom, start:], pixels[top:bottom, : stop - width]], axis=1)


def _shrunk(pixels: Image, shrink: int) -> Image:
    """The image averaged down by a power of two."""
    if shrink == 1:
        return pixels
    height, width = pixels.shape[0] // shrink, pixels.shape[1] // shrink
    small = cv2.resize(
        pixels[: height * shrink, : width * shrink], (width, height), interpolation=cv2.INTER_AREA
    )
    return np.asarray(small, np.uint8)


def _node_rows(band: slice, step: int) -> slice:
    """Rows of the lattice around a band of grid rows that starts at a multiple of step."""
    return slice(band.start // step, -(-band.stop // step) + 2)


def _upsampled(
    nodes: NDArray[np.float32], step: int, shape: tuple[int, ...]
) -> NDArray[np.float32]:
    """One axis of the map at every pixel (height, width) of a band, from the nodes around it."""
    full = cv2.resize(
        nodes, (nodes.shape[1] * step, nodes.shape[0] * step), interpolation=cv2.INTER_LINEAR
    )
    # Node k stands at pixel (k - 0.5) * step; resize puts it at (k + 0.5) * step.
    return np.asarray(full[step : step + shape[0], step : step + shape[1]], np.float32)


def _all_seen(nodes: NDArray[np.float32], mask: Image) -> bool:
    """Whether a band samples nothing unseen and nothing beyond the rim of the source."""
    left, top = np.floor(nodes.min(axis=(1, 2))).astype(int)
    right, bottom = np.ceil(nodes.max(axis=(1, 2))).astype(int) + 1
    if min(left, top) < 0 or bottom > mask.shape[0] or right > mask.shape[1]:
        return False
    return bool((mask[top:bottom, left:right] == 255).all())


def within_obliqueness(
    source: Panorama | Photo, grid: FacadeGrid, max_obliqueness_deg: float
) -> NDArray[np.bool_]:
    """(H, W) bool: the camera is in front of the plane and not too oblique to it."""
    camera = grid.world_from_facade.inverse().apply(source.centre_in_world)
    if camera[2] <= 0:
        return np.zeros((grid.height_px, grid.width_px), np.bool_)
    x, y = _axis_gaps(grid, camera)
    reach = camera[2] * np.tan(np.deg2rad(max_obliqueness_deg))
    inside: NDArray[np.bool_] = x[None, :] ** 2 <= (reach**2 - y**2)[:, None]
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


def view_weight(source: Panorama | Photo, grid: FacadeGrid) -> NDArray[np.float32]:
    """(H, W) `wall_resolution` of a camera at every pixel of a grid."""
    camera = grid.world_from_facade.inverse().apply(source.centre_in_world)
    x, y = _axis_gaps(grid, camera)
    return wall_resolution(x[None, :], y[:, None], float(camera[2])).astype(np.float32)


def wall_resolution(across_m: FloatArray, up_m: FloatArray, distance_m: float) -> FloatArray:
    """Solid angle per square metre of wall at places ``across_m, up_m`` from a camera's foot.

    At range d and viewing angle a to the normal it is ``cos(a) / d**2``: the pixels of a source
    that show a square metre, squared resolution. 0 for cameras behind the wall.
    """
    square = across_m**2 + up_m**2 + distance_m**2
    density: FloatArray = max(distance_m, 0.0) / square**1.5
    return density
