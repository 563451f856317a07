"""A rendered corner of two walls, photographed on an arc around it."""

from __future__ import annotations

import cv2
import numpy as np

from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import Rigid3

CAMERA = Pinhole(330.0, 330.0, 160.0, 120.0, 320, 240)
SIZE_M, PX_PER_M = (8.0, 6.0), 40
# Corners of the two walls: origin, direction to the right and down, seen from outside.
WALLS = (
    ((0.0, 0.0, 6.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
    ((0.0, 8.0, 6.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)),
)


def texture(seed):
    """Blobs of all sizes, (H, W) uint8."""
    rng = np.random.default_rng(seed)
    size = (int(SIZE_M[1] * PX_PER_M), int(SIZE_M[0] * PX_PER_M))
    layers = [cv2.GaussianBlur(rng.standard_normal(size), (0, 0), s) * s for s in (1.5, 3, 6)]
    return np.clip(128 + 110 * sum(layers), 0, 255).astype(np.uint8)


def look_at(centre, target):
    forward = np.subtract(target, centre) / np.linalg.norm(np.subtract(target, centre))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    return Rigid3(rotation, -rotation @ np.asarray(centre, float))


def render(cam_from_world, textures):
    """Picture (240, 320) of the two walls; each wall is a homography."""
    picture = np.full((CAMERA.height_px, CAMERA.width_px), 200, np.uint8)
    intrinsics = np.array([[330.0, 0, 160.0], [0, 330.0, 120.0], [0, 0, 1]])
    for (origin, right, down), wall in zip(WALLS, textures, strict=True):
        frame = np.column_stack([right, down, origin])
        image_from_wall = intrinsics @ (
            cam_from_world.rotation @ frame + np.outer(cam_from_world.translation, [0.0, 0.0, 1.0])
        )
        half = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1.0]])  # cv2 counts from pixel centres
        wall_from_texture = np.diag([1 / PX_PER_M, 1 / PX_PER_M, 1]) @ half
        homography = np.linalg.inv(half) @ image_from_wall @ wall_from_texture
        cv2.warpPerspective(
            wall,
            homography,
            (CAMERA.width_px, CAMERA.height_px),
            dst=picture,
            flags=cv2.INTER_AREA,
            borderMode=cv2.BORDER_TRANSPARENT,
        )
    return picture


def poses(count):
    """An arc of cameras around the corner of the walls."""
    angles = np.deg2rad(np.linspace(-165, -105, count))
    centres = np.stack(
        [11 * np.cos(angles), 11 * np.sin(angles), 1.6 + 0.5 * np.sin(5 * angles)], axis=1
    )
    return [look_at(centre, (0.5, 0.5, 3.0)) for centre in centres]
