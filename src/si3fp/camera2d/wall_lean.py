"""How walls lean: their normals for the vertical of a reconstruction (C.2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from si3fp.camera2d.wall_points import WallPoints, select_wall_points
from si3fp.camera2d.wall_runs import WallRun, find_walls
from si3fp.config import PlaneConfig
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Photo, SparsePoints

_BANDS_M = (0.2, 0.15, 0.1, 0.1, 0.1)


def wall_normals(photos: Sequence[Photo], points: SparsePoints, config: PlaneConfig) -> FloatArray:
    """Unit normals (W, 3) of the walls, free to lean, for `camera2d.gravity.find_gravity`.

    Of the walls as wide and high as a facade, each the plane (least squares, robust) of its points.
    The world's z needs to point up to a few degrees only.
    """
    chosen = select_wall_points(photos, points, config)
    normals = []
    for run in find_walls(chosen, config):
        height = chosen.points_in_world[run.members, 2]
        if (
            run.width_m >= config.min_width_m
            and np.ptp(np.quantile(height, [0.05, 0.95])) >= config.min_height_m
            and len(run.members) >= config.min_points
        ):
            normals.append(_leaning_normal(run, chosen, config))
    return np.array(normals).reshape(-1, 3)


def _leaning_normal(run: WallRun, points: WallPoints, config: PlaneConfig) -> FloatArray:
    """Normal (3,) of the plane of a wall's points, robust."""
    along, front = run.line.coordinates(points.points_in_world).T
    beside = (along >= run.left_m) & (along <= run.right_m)
    low, high = np.quantile(points.points_in_world[run.members, 2], [0.02, 0.98])
    height = points.points_in_world[:, 2]
    beside &= (height >= low) & (height <= high) & (np.abs(front) <= config.relief_m)
    design = np.stack([along[beside], height[beside], np.ones(beside.sum())], axis=1)
    depth, weights = front[beside], points.weights[beside]
    slope = np.zeros(3)
    for width_m in _BANDS_M:
        rest = (depth - design @ slope) / width_m
        robust = np.sqrt(weights) / (1 + rest**2)
        slope = np.linalg.lstsq(design * robust[:, None], depth * robust, rcond=None)[0]
    flat = np.array([-slope[0], 1.0]) @ np.stack([run.line.along, run.line.outward])
    normal = np.array([*flat, -slope[1]])
    unit: FloatArray = normal / np.linalg.norm(normal)
    return unit
