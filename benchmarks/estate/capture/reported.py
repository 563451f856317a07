"""What a mapping vehicle reports: poses and planes that are a little off, plane maps with gaps."""

from __future__ import annotations

from typing import Any

import numpy as np
from benchmarks.estate.capture.cameras import Equirect, Pose
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.plan import Estate, Tree
from benchmarks.estate.rays import distances_to_line
from benchmarks.estate.site.car_shapes import CAR_SIZES_M, car_outline
from numpy.typing import NDArray

from si3fp.geometry.enu import geodetic_from_world
from si3fp.geometry.planes import Planes
from si3fp.sources.plane_map import MAX_PLANES

FloatArray = NDArray[np.float64]
Json = dict[str, Any]

POSITION_M = (0.10, 0.15)
ROTATION_DEG = (0.2, 0.3)
PLANE_M = 0.05
PLANE_DEG = 0.3
PLANE_MAP_PX = (512, 256)
WALL_REACH_M = 80.0
GROUND_REACH_M = 50.0
LEAST_PIXELS = 12  # a plane seen by fewer is left out
GAPS = 10
GAP_DEG = (1.5, 5.0)


def noise_record() -> Json:
    """The errors of the reported values, for the metadata."""
    return {
        "position_m": list(POSITION_M),
        "rotation_deg": list(ROTATION_DEG),
        "plane_offset_sigma_m": PLANE_M,
        "plane_angle_sigma_deg": PLANE_DEG,
        "note": "Every pose is shifted by a length and turned by an angle within these ranges, in "
        "a random direction; planes are off by normal errors.",
    }


def reported_pose(pose: Pose, rng: np.random.Generator) -> Pose:
    """The pose as reported: 0.10-0.15 m and 0.2-0.3 degrees off."""
    shift = rng.normal(0, 1, 3) * [1, 1, 0.6]
    shift *= rng.uniform(*POSITION_M) / np.linalg.norm(shift)
    angles = rng.normal(0, 1, 3)
    angles *= rng.uniform(*ROTATION_DEG) / np.linalg.norm(angles)
    x, y, z = (round(float(v), 3) for v in np.array(pose.place) + shift)
    return Pose(
        (x, y, z),
        round(float(pose.heading_deg + angles[0]) % 360, 4),
        round(float(pose.pitch_deg + angles[1]), 4),
        round(float(pose.roll_deg + angles[2]), 4),
    )


def exact_planes(estate: Estate, pose: Pose) -> tuple[Planes, NDArray[np.int32]]:
    """Planes in the panorama's frame and their index (256, 512), -1 = none.

    Every wall is one rectangle up to the eaves, balconies and all; the ground is one plane. What
    stands before a wall and is no wall (trees, hedges, cars) has no plane, nor has the sky. Normals
    point from the camera into the surface.
    """
    camera = Equirect(pose.world_from_cam, PLANE_MAP_PX[0])
    x, y = np.meshgrid(np.arange(camera.width_px) + 0.5, np.arange(camera.height_px) + 0.5)
    _, rays = camera.rays(np.stack([x, y], axis=-1).reshape(-1, 2))
    place = np.array(pose.place)
    nearest = np.full(len(rays), np.inf)
    index = np.full(len(rays), -1, np.int32)
    normals: list[FloatArray] = [np.array([0.0, 0.0, -1.0])]
    offsets = [0.0]
    with np.errstate(divide="ignore"):
        ground = np.where(rays[:, 2] < 0, -place[2] / rays[:, 2], np.inf)
    index[ground < GROUND_REACH_M] = 0
    nearest = np.minimum(nearest, ground)
    for building in (*estate.buildings, *estate.neighbours):
        for wall in building.walls:
            inward = -wall.world_from_facade.rotation[:, 2]
            offset = float(inward @ [*wall.start, 0.0])
            if offset - inward @ place < 0.05:
                continue  # its back is turned to the camera
            top_m = min(wall.height_m, building.height_m)
            distance = _to_fence(place, rays, wall.start, wall.end, top_m)
            hit = distance < nearest
            nearest[hit] = distance[hit]
            index[hit] = np.where(distance[hit] < WALL_REACH_M, len(normals), -1)
            normals.append(inward)
            offsets.append(offset)
    for distance in _others(estate, place, rays):
        hit = distance < nearest
        nearest[hit], index[hit] = distance[hit], -1
    counts = np.bincount(index[index >= 0], minlength=len(normals))
    order = np.argsort(-counts, kind="stable")[:MAX_PLANES]
    kept = np.sort(order[counts[order] >= LEAST_PIXELS])
    renumbered = np.full(len(normals) + 1, -1, np.int32)
    renumbered[kept] = np.arange(len(kept))
    in_world = Planes(np.array(normals)[kept], np.array(offsets)[kept])
    return in_world.transformed(pose.world_from_cam.inverse()), renumbered[index].reshape(x.shape)


def _to_fence(
    place: FloatArray, rays: FloatArray, start: Any, end: Any, top_m: float
) -> FloatArray:
    """Distance (N,) along rays to an upright rectangle on the ground; inf where it is missed."""
    distance = distances_to_line(place, rays, start, end)
    with np.errstate(invalid="ignore"):  # inf times 0: a level ray that misses
        height_m = place[2] + distance * rays[:, 2]
    return np.where((height_m >= 0) & (height_m <= top_m), distance, np.inf)


def _others(estate: Estate, place: FloatArray, rays: FloatArray) -> list[FloatArray]:
    """Distances to what hides walls without being one."""
    found = [_to_crown(place, rays, tree) for tree in estate.trees]
    for hedge in estate.hedges:
        for start, end in zip(hedge.line[:-1], hedge.line[1:], strict=True):
            found.append(_to_fence(place, rays, start, end, hedge.height_m))
    for car in estate.cars:
        corners = np.asarray(car_outline(car))[:, :2]
        for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            if np.linalg.norm(end - start) > 0:
                found.append(_to_fence(place, rays, start, end, CAR_SIZES_M[car.kind][2]))
    return found


def _to_crown(place: FloatArray, rays: FloatArray, tree: Tree) -> FloatArray:
    """Distance (N,) to the crown as an ellipsoid that fills the upper part of the tree."""
    foot_m = 0.0 if tree.kind == "shrub" else min(0.35 * tree.height_m, 2.5)
    half_m = (tree.height_m - foot_m) / 2
    scale = np.array([2 / tree.crown_m, 2 / tree.crown_m, 1 / half_m])
    start = (place - [*tree.place, foot_m + half_m]) * scale
    way = rays * scale
    a, b, c = (way * way).sum(axis=1), way @ start, float(start @ start) - 1
    root = b * b - a * c
    distance = (-b - np.sqrt(np.maximum(root, 0))) / a
    return np.where((root > 0) & (distance > 0), distance, np.inf)


def reported_planes(
    planes: Planes, index: NDArray[np.int32], rng: np.random.Generator
) -> tuple[Planes, NDArray[np.int32]]:
    """The planes 0.05 m and 0.3 degrees off, and their index with round gaps."""
    tilt = rng.normal(0, np.deg2rad(PLANE_DEG) / np.sqrt(2), planes.normals.shape)
    normals = planes.normals + tilt
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = planes.offsets_m + rng.normal(0, PLANE_M, len(planes))
    gaps = index.copy()
    rows, columns = np.mgrid[0 : index.shape[0], 0 : index.shape[1]]
    for _ in range(GAPS):
        column, row = rng.uniform(0, index.shape[1]), rng.uniform(0.3, 0.6) * index.shape[0]
        radius = rng.uniform(*GAP_DEG) / 360 * index.shape[1]
        gaps[np.hypot(columns - column, rows - row) < radius] = -1
    return Planes(normals, np.maximum(offsets, 0.0)), gaps


def panorama_feature(name: str, pose: Pose, estate: Estate, links: list[str]) -> Json:
    """A panorama as a feature of ``panoramas.geojson``, at the pose given."""
    lat, lon, height_m = geodetic_from_world(np.array(pose.place), estate.origin)
    return {
        "type": "Feature",
        "geometry": {
            "type": "Point",
            "coordinates": [round(float(lon), 9), round(float(lat), 9), round(float(height_m), 3)],
        },
        "properties": {
            "id": name,
            "image": f"panoramas/{name}.jpg",
            "depth": f"depth/{name}.b64",
            "heading_deg": pose.heading_deg,
            "pitch_deg": pose.pitch_deg,
            "roll_deg": pose.roll_deg,
            "captured": estate.light.date[:7],
            "provider": "si3fp estate",
            "links": links,
        },
    }


def reported(estate: Estate, name: str, pose: Pose) -> tuple[Pose, Planes, NDArray[np.int32]]:
    """Pose, planes and index of a panorama as reported; by name, so that each stands alone."""
    planes, index = exact_planes(estate, pose)
    noisy = reported_pose(pose, rng_of(estate.seed, "reported pose", name))
    rng = rng_of(estate.seed, "reported planes", name)
    return noisy, *reported_planes(planes, index, rng)
