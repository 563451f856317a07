"""Which walls a camera sees in plan, where no plane map tells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from si3fp.config import ClusterConfig
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Footprint
from si3fp.streetview.wall_fit import Line

Sight = Literal["seen", "far", "behind", "oblique", "hidden"]

SAMPLES = 5
"""Points of a wall to which rays are cast; one free ray is enough to see it."""

SAME_WAY = float(np.cos(np.deg2rad(10.0)))
TOUCHING_M = 0.5

STANDOFF_M = 0.1
"""Rays end this far in front of the wall, so that the wall itself does not hide it."""


def footprint_edges(footprints: Sequence[Footprint]) -> dict[str, Line]:
    """Every footprint edge by its facade id ``<building id>-<edge index>``."""
    return {
        f"{footprint.id}-{index}": Line(left, right)
        for footprint in footprints
        for index, (left, right) in enumerate(footprint.edges())
        if np.hypot(*(right - left)) > 1e-6
    }


def visible_walls(
    centre_in_world: FloatArray, walls: Mapping[str, Line], config: ClusterConfig
) -> dict[str, Sight]:
    """Whether a camera at a point (3,) or (2,) sees each wall, and if not, why.

    ``seen``: the camera is in front of the wall, its nearest point is within
    `config.max_distance_m` and is seen at less than `config.max_obliqueness_deg`, and a ray to
    at least one of five points along it is not cut by any wall. Heights play no part.

    Parameters
    ----------
    centre_in_world
        Optical centre; only x and y are used.
    walls
        Walls in plan by id; all of them hide one another.
    """
    camera = np.asarray(centre_in_world, dtype=np.float64)[:2]
    starts = np.array([wall.left_in_world for wall in walls.values()]).reshape(-1, 2)
    ends = np.array([wall.right_in_world for wall in walls.values()]).reshape(-1, 2)
    return {wall_id: _sight(camera, wall, starts, ends, config) for wall_id, wall in walls.items()}


def _sight(
    camera: FloatArray, wall: Line, starts: FloatArray, ends: FloatArray, config: ClusterConfig
) -> Sight:
    along, front = wall.coordinates(camera)
    if front <= STANDOFF_M:
        return "behind"
    beside = max(-along, along - wall.length_m, 0.0)
    if np.hypot(front, beside) > config.max_distance_m:
        return "far"
    if np.rad2deg(np.arctan2(beside, front)) > config.max_obliqueness_deg:
        return "oblique"
    shares = (np.arange(SAMPLES) + 0.5) / SAMPLES
    targets = wall.left_in_world + shares[:, None] * wall.length_m * wall.along
    targets = targets + STANDOFF_M * wall.outward
    cut = _segments_cross(camera, targets, starts, ends)
    return "hidden" if cut.any(axis=1).all() else "seen"


def _segments_cross(
    camera: FloatArray, targets: FloatArray, starts: FloatArray, ends: FloatArray
) -> FloatArray:
    """True (T, E) where the segment from the camera to a target crosses a wall."""

    def side(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
        turn: FloatArray = (b - a)[..., 0] * (c - a)[..., 1] - (b - a)[..., 1] * (c - a)[..., 0]
        return turn

    goal, start, end = targets[:, None], starts[None], ends[None]
    splits_wall = side(camera, goal, start) * side(camera, goal, end) < 0
    splits_ray = side(start, end, camera[None, None]) * side(start, end, goal) < 0
    return np.asarray(splits_wall & splits_ray)


def goes_on(wall_id: str, walls: Mapping[str, Line]) -> tuple[bool, bool]:
    """Whether another wall continues this one beyond its left and its right end.

    Terraces and split edges: nothing on the facade need show where one wall ends, only the map
    does. A wall continues another if it faces the same way and starts where that one ends.
    """
    wall = walls[wall_id]
    ends = {"left": False, "right": False}
    for other_id, other in walls.items():
        if other_id == wall_id or float(other.outward @ wall.outward) < SAME_WAY:
            continue
        ends["left"] |= bool(np.hypot(*(other.right_in_world - wall.left_in_world)) < TOUCHING_M)
        ends["right"] |= bool(np.hypot(*(other.left_in_world - wall.right_in_world)) < TOUCHING_M)
    return ends["left"], ends["right"]
