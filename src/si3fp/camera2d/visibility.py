"""Which places of a wall a photo sees: other walls and what stands in front hide the rest.

Answers are lattices, (h, w) bool in image order with cells of about `LATTICE_M`: poses and planes
are exact, but what stands in front of a wall is only known where the reconstruction has points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.camera2d.facade_plane import FacadePlane
from si3fp.config import MosaicConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Photo, SparsePoints
from si3fp.ortho import view_distances

LATTICE_M = 0.2
NEAR_SHARE = 0.95
"""Points farther than this share of the way from the wall to the camera are at the camera."""
BoolLattice = NDArray[np.bool_]


def seen_from(
    plane: FacadePlane,
    grid: FacadeGrid,
    photos: Sequence[Photo],
    occluders: Sequence[FacadePlane],
    points: SparsePoints,
    config: MosaicConfig,
) -> dict[str, BoolLattice]:
    """By photo id the places of a wall that the photo shows, (h, w) bool on one lattice.

    Parameters
    ----------
    plane
        The wall.
    grid
        Its grid; the lattice divides it into cells of equal size.
    photos
        Photos with their poses.
    occluders
        All known walls; the wall itself, if among them, hides nothing.
    points
        Sparse points with the photos that saw them; there may be none.
    config
        What counts as too oblique, and which points stand in front of the wall.

    Notes
    -----
    A place is seen if it lies inside the photo, at most `max_obliqueness_deg` from the wall's
    normal, behind no other wall, and behind no foreground. Foreground is where points in front of
    the wall outnumber those on the wall that the photo itself saw. It hides a place only if two
    other photos see past it: what all photos show there is a balcony, a part of the facade, or a
    hedge that nothing can remove.
    """
    nodes = lattice_pixels(grid)
    places = grid.world_from_pixels(nodes)
    walls = [wall for wall in occluders if wall.facade_id != plane.facade_id]
    points_in_facade = grid.world_from_facade.inverse().apply(points.points_in_world)
    in_front = points_in_facade[points_in_facade[:, 2] > config.clearance_m]
    on_wall = np.abs(points_in_facade[:, 2]) <= config.clearance_m
    rows_by_photo = _rows_by_photo(points, on_wall)
    in_sight, before = {}, {}
    for photo in photos:
        sight = _inside_photo(photo, grid, nodes, config.max_obliqueness_deg)
        foreground = np.zeros_like(sight)
        if sight.any():
            for wall in walls:
                sight &= ~_behind_wall(photo, grid, places, wall, config.clearance_m)
            mine = points_in_facade[rows_by_photo.get(photo.id, [])]
            foreground = _behind_points(photo, grid, in_front, mine, config)
        in_sight[photo.id], before[photo.id] = sight, foreground
    clear = np.zeros(nodes.shape[:2], np.int_)
    for name, sight in in_sight.items():
        clear += sight & ~before[name]
    removable = clear >= config.min_photos
    return {name: sight & ~(before[name] & removable) for name, sight in in_sight.items()}


def lattice_pixels(grid: FacadeGrid) -> FloatArray:
    """Grid pixels (h, w, 2) of the middles of the lattice's cells."""
    columns = max(2, round(grid.width_m / LATTICE_M))
    rows = max(2, round(grid.height_m / LATTICE_M))
    x, y = np.meshgrid(
        (np.arange(columns) + 0.5) / columns * grid.width_px,
        (np.arange(rows) + 0.5) / rows * grid.height_px,
    )
    return np.stack([x, y], axis=-1)


def on_grid(lattice: BoolLattice, grid: FacadeGrid) -> NDArray[np.bool_]:
    """The lattice at every pixel (H, W) of the grid, its steps cut off to slopes."""
    size = (grid.width_px, grid.height_px)
    share = cv2.resize(lattice.astype(np.float32), size, interpolation=cv2.INTER_LINEAR)
    return np.asarray(share, np.float32) > 0.5


def _inside_photo(
    photo: Photo, grid: FacadeGrid, nodes: FloatArray, max_obliqueness_deg: float
) -> BoolLattice:
    camera = photo.camera
    _, cosines = view_distances(photo, grid, nodes)
    pixels = camera.project(photo.cam_from_world.apply(grid.world_from_pixels(nodes)))
    with np.errstate(invalid="ignore"):
        inside = (pixels >= 0) & (pixels <= [camera.width_px, camera.height_px])
    sight: BoolLattice = inside.all(axis=-1) & (cosines >= np.cos(np.deg2rad(max_obliqueness_deg)))
    return sight


def _behind_wall(
    photo: Photo, grid: FacadeGrid, places: FloatArray, wall: FacadePlane, clearance_m: float
) -> BoolLattice:
    """(h, w) bool: the ray from the camera to a place (h, w, 3) passes through the rectangle.

    Crossings nearer to the grid's plane than the clearance do not count: a wall found twice, a
    shallow bay, a corner that is a little off.
    """
    wall_from_world = wall.world_from_facade.inverse()
    camera = wall_from_world.apply(photo.centre_in_world)
    ends = wall_from_world.apply(places)
    fall = camera[2] - ends[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(np.abs(fall) > 1e-9, camera[2] / fall, -1.0)
    between = (share > 0) & (share < 1)
    x, y = np.moveaxis(camera[:2] + share[..., None] * (ends[..., :2] - camera[:2]), -1, 0)
    in_rectangle = (x >= 0) & (x <= wall.width_m) & (y >= 0) & (y <= wall.height_m)
    camera_height_m = grid.world_from_facade.inverse().apply(photo.centre_in_world)[2]
    hidden: BoolLattice = between & in_rectangle & ((1 - share) * camera_height_m > clearance_m)
    return hidden


def _behind_points(
    photo: Photo,
    grid: FacadeGrid,
    in_front: FloatArray,
    on_wall: FloatArray,
    config: MosaicConfig,
) -> BoolLattice:
    """(h, w) bool: foreground.

    All points in front of the wall (P, 3), in the facade's frame, hide what lies behind them; only
    the points on the wall that the photo itself saw show that it can be seen.
    """
    camera = grid.world_from_facade.inverse().apply(photo.centre_in_world)

    def density(points: FloatArray) -> FloatArray:
        points = points[points[:, 2] < NEAR_SHARE * camera[2]]
        # Where the ray from the camera through the point meets the wall.
        stretch = camera[2] / (camera[2] - points[:, 2])
        feet = camera[:2] + stretch[:, None] * (points[:, :2] - camera[:2])
        return _density(feet, grid, config.point_reach_m)

    needed = np.maximum(config.wall_point_weight * density(on_wall), config.min_points)
    return _without_specks(density(in_front) > needed)


def _without_specks(hidden: BoolLattice) -> BoolLattice:
    """The lattice without parts and gaps narrower than three cells."""
    cells = cv2.morphologyEx(hidden.view(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    cells = cv2.morphologyEx(cells, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    return np.asarray(cells, np.uint8) > 0


def _density(feet_m: FloatArray, grid: FacadeGrid, reach_m: float) -> FloatArray:
    """(h, w) number of points (P, 2) around every cell; one point alone counts 1 at its place."""
    rows, columns = lattice_pixels(grid).shape[:2]
    pixels = grid.pixels_from_facade(feet_m)
    column = np.floor(pixels[:, 0] / grid.width_px * columns).astype(int)
    row = np.floor(pixels[:, 1] / grid.height_px * rows).astype(int)
    # Points beyond the border reach into the grid.
    sigma = reach_m / LATTICE_M
    rim = int(np.ceil(3 * sigma))
    inside = (column >= -rim) & (column < columns + rim) & (row >= -rim) & (row < rows + rim)
    wide = columns + 2 * rim
    cell = (row[inside] + rim) * wide + column[inside] + rim
    counts = np.bincount(cell, minlength=(rows + 2 * rim) * wide).reshape(-1, wide)
    smooth = cv2.GaussianBlur(counts.astype(np.float64), (2 * rim + 1, 2 * rim + 1), sigma)
    return np.asarray(smooth[rim : rim + rows, rim : rim + columns] * (2 * np.pi * sigma**2))


def _rows_by_photo(points: SparsePoints, which: NDArray[np.bool_]) -> Mapping[str, list[int]]:
    """Indices of some of the points by the photos that saw them."""
    rows: dict[str, list[int]] = {}
    for row in np.flatnonzero(which).tolist():
        for name in points.photo_ids[row]:
            rows.setdefault(name, []).append(row)
    return rows
