"""The planes of plane maps in one world frame: walls with their support, and the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from si3fp.config import ClusterConfig
from si3fp.geometry.equirect import directions_from_pixels
from si3fp.geometry.planes import Planes, ray_plane_distances
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Panorama

SUPPORT_POINTS = 400
"""Support points kept per plane: enough to place it to a few centimetres along a wall."""

GROUND_CAMERAS = 5
"""Nearest panoramas whose ground planes or heights vote for the ground at a place."""


@dataclass(frozen=True, slots=True, eq=False)
class WallPlane:
    """A wall as one panorama sees it, as a line in plan with its supporting points.

    Attributes
    ----------
    panorama_id, plane_index
        Where it comes from.
    outward
        (2,) unit vector in plan, from the wall towards the camera: minus the plane's normal.
    foot_in_world
        (2,) the point of the plane at the camera's height that is nearest to the camera in plan.
        An error of the bearing leaves it in place, so its offset is measured best.
    pixels
        Pixels of the plane map that hit the wall within the distance limit.
    support_in_world
        (K, 3) where those pixels hit the plane, evenly subsampled, metres.
    """

    panorama_id: str
    plane_index: int
    outward: FloatArray
    foot_in_world: FloatArray
    pixels: int
    support_in_world: FloatArray


def planes_in_world(panorama: Panorama) -> Planes:
    """The planes of a panorama in frame ``world``; none where it has no plane map."""
    if panorama.planes_in_pano is None:
        return Planes(np.empty((0, 3)), np.empty(0))
    return panorama.planes_in_pano.transformed(panorama.pano_from_world.inverse())


def wall_indices(panorama: Panorama, horizontal_normal: float) -> NDArray[np.int_]:
    """Indices of the planes of a panorama that are neither horizontal nor zero.

    A zero plane goes through the camera (offset below a micrometre): it stands for "no plane".
    """
    if panorama.planes_in_pano is None:
        return np.empty(0, dtype=np.int_)
    up = np.abs(planes_in_world(panorama).normals[:, 2])
    zero = np.abs(panorama.planes_in_pano.offsets_m) < 1e-6
    return np.flatnonzero((up <= horizontal_normal) & ~zero)


def wall_planes(panoramas: Sequence[Panorama], config: ClusterConfig) -> list[WallPlane]:
    """Every wall plane of every panorama that any of its pixels see, in input order.

    Paper, step S.2: pixel to ray to plane intersection, planes moved to the world frame. Normals
    in a panorama point from the camera into the wall; the sign of the offset is kept.
    """
    return [plane for panorama in panoramas for plane in _walls_of(panorama, config)]


def _walls_of(panorama: Panorama, config: ClusterConfig) -> list[WallPlane]:
    indices = wall_indices(panorama, config.horizontal_normal)
    if panorama.plane_index is None or not len(indices):
        return []
    height_px, width_px = panorama.plane_index.shape
    flat = panorama.plane_index.ravel()
    order = np.argsort(flat, kind="stable")
    planes = planes_in_world(panorama)
    starts = np.searchsorted(flat[order], np.arange(len(planes) + 1))
    world_from_pano = panorama.pano_from_world.inverse()
    centre = world_from_pano.translation

    found = []
    for index in indices:
        pixels = order[starts[index] : starts[index + 1]]
        if not len(pixels):
            continue
        count = min(len(pixels), SUPPORT_POINTS)
        chosen = pixels[np.linspace(0, len(pixels) - 1, count).round().astype(np.int_)]
        xy = np.stack([chosen % width_px + 0.5, chosen // width_px + 0.5], axis=-1)
        rays = world_from_pano.rotate(directions_from_pixels(xy, width_px, height_px))
        normal, offset = planes.normals[index], float(planes.offsets_m[index])
        distance = ray_plane_distances(centre, rays, normal, offset)
        hit = np.nan_to_num(distance, nan=np.inf) <= config.max_distance_m
        flat_length = float(np.hypot(normal[0], normal[1]))
        inward = normal[:2] / flat_length
        to_plane = (offset - float(normal @ centre)) / flat_length
        found.append(
            WallPlane(
                panorama.id,
                int(index),
                -inward,
                centre[:2] + to_plane * inward,
                round(len(pixels) * float(hit.mean())),
                centre + rays[hit] * distance[hit, None],
            )
        )
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """The ground below and around the panoramas.

    Attributes
    ----------
    centres_in_world
        (N, 3) optical centres.
    normals, offsets_m
        (N, 3), (N,) the ground plane that each panorama sees, NaN where it has none.
    camera_height_m
        Height of a camera above the ground where no panorama near it has a ground plane.
    """

    centres_in_world: FloatArray
    normals: FloatArray
    offsets_m: FloatArray
    camera_height_m: float

    def height_m(self, point_in_world: FloatArray) -> tuple[float, str]:
        """World z of the ground at a point (2,), and in words where it comes from."""
        distance = np.hypot(*(self.centres_in_world[:, :2] - point_in_world).T)
        near = np.argsort(distance, kind="stable")[:GROUND_CAMERAS]
        seen = near[np.isfinite(self.offsets_m[near])]
        if len(seen):
            normals = self.normals[seen]
            z = (self.offsets_m[seen] - normals[:, :2] @ point_in_world) / normals[:, 2]
            return float(np.median(z)), f"ground from the plane maps of {len(seen)} panoramas"
        z = self.centres_in_world[near, 2] - self.camera_height_m
        return float(np.median(z)), f"ground assumed {self.camera_height_m} m below the cameras"


def ground_of(panoramas: Sequence[Panorama], config: ClusterConfig) -> Ground:
    """The ground from the largest horizontal plane below the camera of each plane map."""
    normals = np.full((len(panoramas), 3), np.nan)
    offsets = np.full(len(panoramas), np.nan)
    for row, panorama in enumerate(panoramas):
        if panorama.plane_index is None:
            continue
        planes = planes_in_world(panorama)
        seen = panorama.plane_index[panorama.plane_index >= 0]
        pixels = np.bincount(seen, minlength=len(planes))
        pixels[planes.normals[:, 2] > -config.horizontal_normal] = 0
        if pixels.max(initial=0) >= config.min_pixels:
            best = int(np.argmax(pixels))
            normals[row], offsets[row] = planes.normals[best], planes.offsets_m[best]
    centres = np.array([p.centre_in_world for p in panoramas]).reshape(-1, 3)
    return Ground(centres, normals, offsets, config.camera_height_m)
