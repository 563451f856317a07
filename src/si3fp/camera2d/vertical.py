"""The vertical of a reconstruction by its cameras and the walls among its points (C.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from si3fp.camera2d.gravity import Gravity, find_gravity
from si3fp.camera2d.plumb import plumb_vertical, sharpest_wall
from si3fp.errors import ReconstructionError
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Photo, SparsePoints

_MIN_PHOTOS = 3  # by which a point must be seen: two cannot show a wrong match


@dataclass(frozen=True, slots=True, eq=False)
class Vertical:
    """Where up is, and what tells it.

    Attributes
    ----------
    level_from_reconstruction
        (3, 3) rotation that makes z point up; north is still unknown.
    sigma_deg
        Standard deviation of the vertical in its worse direction.
    walls
        Number of walls that it rests on besides the cameras.
    tilted
        Ids of the photos that were not held level.
    """

    level_from_reconstruction: FloatArray
    sigma_deg: float
    walls: int
    tilted: tuple[str, ...]


def find_vertical(photos: Sequence[Photo], points: SparsePoints, tolerance: float) -> Vertical:
    """The vertical on which level cameras and upright walls agree.

    Parameters
    ----------
    photos
        Three or more.
    points
        Sparse points in the frame of the poses.
    tolerance
        Distance from a wall in units of the poses beyond which a point is not of it.

    Raises
    ------
    ReconstructionError
        If cameras agree on no vertical, or all look the same way and the points show no wall.
    """
    solid = np.array([len(ids) >= _MIN_PHOTOS for ids in points.photo_ids], dtype=np.bool_)
    places = points.points_in_world[solid]
    gravity = _gravity(photos, places, tolerance)
    plumb = plumb_vertical(places, gravity.up_in_reconstruction, gravity.sigma_deg, tolerance)
    right = gravity.level_from_reconstruction.rotation[0]
    right = right - (right @ plumb.up) * plumb.up
    right /= np.linalg.norm(right)
    return Vertical(
        np.stack([right, np.cross(plumb.up, right), plumb.up]),
        plumb.sigma_deg,
        len(plumb.walls),
        tuple(photos[n].id for n in gravity.tilted_cameras),
    )


def _gravity(photos: Sequence[Photo], places: FloatArray, tolerance: float) -> Gravity:
    """By the cameras; where they all look the same way with the wall that fixes their pitch."""
    poses = [photo.cam_from_world for photo in photos]
    try:
        return find_gravity(poses)
    except ReconstructionError:
        right = np.median([pose.rotation[0] for pose in poses], axis=0)
        down = np.median([pose.rotation[1] for pose in poses], axis=0)
        length = float(np.linalg.norm(right))
        if length < 0.5 or len(places) == 0:  # the cameras do not look the same way
            raise
        right = right / length
        up = -(down - (down @ right) * right)
        normals = sharpest_wall(places, up / np.linalg.norm(up), right, tolerance)
        if not len(normals):
            raise
        return find_gravity(poses, normals)
