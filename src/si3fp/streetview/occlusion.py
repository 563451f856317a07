"""What stands between a camera and a wall: other buildings, and nearer planes of the plane map.

A gable beside a house shows the house's windows, not its own, where the house stands in front.
Both tests are made on a coarse lattice of the wall; moving things are left to the blend.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.config import ClusterConfig
from si3fp.geometry.equirect import pixels_from_directions
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.planes import ray_plane_distances
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Footprint, Panorama
from si3fp.streetview.cluster import Wall

LATTICE_M = 0.2
STANDOFF_M = 0.5
"""Rays end this far in front of the wall: maps and planes are not more exact."""

CLEARANCE_M = 1.5
"""A plane hides the wall if it is nearer by this much; planes of one wall scatter by less."""


def hidden_part(
    panorama: Panorama,
    wall: Wall,
    grid: FacadeGrid,
    footprints: Sequence[Footprint],
    config: ClusterConfig,
) -> NDArray[np.bool_]:
    """(H, W) bool on the grid: True where the panorama cannot see the wall.

    Parameters
    ----------
    panorama
        Pose and, where known, plane map.
    wall
        The wall; its own footprint edge hides nothing.
    grid
        Grid on the wall.
    footprints
        All buildings; each hides what lies behind it up to its height.
    config
        What counts as a horizontal plane, and the height of buildings without one.
    """
    columns = max(2, round(grid.width_m / LATTICE_M))
    rows = max(2, round(grid.height_m / LATTICE_M))
    x, y = np.meshgrid(
        (np.arange(columns) + 0.5) / columns * grid.width_px,
        (np.arange(rows) + 0.5) / rows * grid.height_px,
    )
    points = grid.world_from_pixels(np.stack([x, y], axis=-1))
    hidden = _behind_buildings(panorama.centre_in_world, points, wall, grid, footprints, config)
    hidden |= _behind_planes(panorama, points, wall, config)
    size = (grid.width_px, grid.height_px)
    return cv2.resize(hidden.view(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0


def _behind_buildings(
    camera: FloatArray,
    points: FloatArray,
    wall: Wall,
    grid: FacadeGrid,
    footprints: Sequence[Footprint],
    config: ClusterConfig,
) -> NDArray[np.bool_]:
    """(h, w) bool: an edge of a footprint cuts the ray below the height of its building."""
    targets = points + STANDOFF_M * grid.normal_in_world
    plan = targets[0, :, :2]  # the wall is vertical: one ray in plan per column
    hidden = np.zeros(points.shape[:2], bool)
    for footprint in footprints:
        top_m = (footprint.ground_m or 0.0) + (footprint.height_m or config.default_height_m)
        for index, (start, end) in enumerate(footprint.edges()):
            if (footprint.id, index) == (wall.building_id, wall.edge_index):
                continue
            ray, edge, gap = plan - camera[:2], end - start, start - camera[:2]
            cross = ray[:, 0] * edge[1] - ray[:, 1] * edge[0]
            with np.errstate(divide="ignore", invalid="ignore"):
                along_ray = (gap[0] * edge[1] - gap[1] * edge[0]) / cross
                along_edge = (gap[0] * ray[:, 1] - gap[1] * ray[:, 0]) / cross
            cut = (along_ray > 0) & (along_ray < 1) & (along_edge >= 0) & (along_edge <= 1)
            height_m = camera[2] + np.where(cut, along_ray, 0.0) * (targets[..., 2] - camera[2])
            hidden |= cut & (height_m < top_m)
    return hidden


def _behind_planes(
    panorama: Panorama, points: FloatArray, wall: Wall, config: ClusterConfig
) -> NDArray[np.bool_]:
    """(h, w) bool: the plane map has a wall there that is clearly nearer and is not this wall."""
    hidden = np.zeros(points.shape[:2], bool)
    planes, plane_index = panorama.planes_in_pano, panorama.plane_index
    if planes is None or plane_index is None or not len(planes):
        return hidden
    rays = panorama.pano_from_world.apply(points)
    height, width = plane_index.shape
    pixels = pixels_from_directions(rays, width, height).astype(int)
    index = plane_index[np.minimum(pixels[..., 1], height - 1), pixels[..., 0] % width]
    own = [plane for name, plane in wall.members if name == panorama.id]
    upright = np.abs(panorama.pano_from_world.inverse().rotate(planes.normals)[:, 2])
    walls = (upright <= config.horizontal_normal) & ~np.isin(np.arange(len(planes)), own)
    distance_m = np.linalg.norm(rays, axis=-1)
    nearer = ray_plane_distances(
        np.zeros(3), rays / distance_m[..., None], planes.normals[index], planes.offsets_m[index]
    )
    with np.errstate(invalid="ignore"):
        hidden |= (index >= 0) & walls[index] & (nearer < distance_m - CLEARANCE_M)
    return hidden
