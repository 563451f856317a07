"""What stands between camera and facade: parked vans and street trees, in the street's frame."""

from __future__ import annotations

import cv2
import numpy as np
from tests.scenes import textures
from tests.scenes.render import Surface
from tests.scenes.textures import as_uint8


def van(x: float, y: float, rng: np.random.Generator) -> list[Surface]:
    """A parked delivery van: a box with wheels, windows and rounded silhouette."""
    length, width, height = 4.9, 1.95, 2.0
    colour = np.array([(188, 190, 192), (58, 70, 92), (112, 46, 42)][rng.integers(3)], np.float32)
    scale = 0.02
    shape = (round((height) / scale), round(length / scale))
    side = np.empty((*shape, 4), np.float32)
    shine = np.linspace(1.12, 0.75, shape[0], dtype=np.float32)[:, None, None]
    side[..., :3] = colour * shine
    side[..., 3] = 255
    rows, columns = shape
    side[int(0.15 * rows) : int(0.45 * rows), int(0.06 * columns) : int(0.30 * columns), :3] = 38
    side[int(0.16 * rows) : int(0.18 * rows), int(0.06 * columns) : int(0.30 * columns), :3] = 92
    side[:, int(0.33 * columns) : int(0.33 * columns) + 1, :3] *= 0.5
    side[:, int(0.62 * columns) : int(0.62 * columns) + 1, :3] *= 0.5
    side[int(0.52 * rows) : int(0.53 * rows), :, :3] *= 0.7
    side[int(0.86 * rows) :, :, 3] = 0
    for slant in range(int(0.45 * rows)):  # windscreen
        side[slant, : int((0.45 * rows - slant) * 0.5), 3] = 0
    wheel = np.zeros(shape, np.uint8)
    for hub in (0.19, 0.80):
        cv2.circle(wheel, (int(hub * columns), int(0.84 * rows)), round(0.33 / scale), 1, -1)
        cv2.circle(wheel, (int(hub * columns), int(0.84 * rows)), round(0.18 / scale), 2, -1)
    side[wheel > 0] = (26, 26, 27, 255)
    side[wheel == 2] = (120, 122, 124, 255)
    front = np.full((rows, round(width / scale), 4), 255, np.float32)
    front[..., :3] = colour * shine * 0.85
    front[int(0.12 * rows) : int(0.42 * rows), 8:-8, :3] = 46
    front[int(0.88 * rows) :, :, 3] = 0
    roof = np.broadcast_to(np.append(colour * 1.1, 255), (20, 40, 4)).astype(np.float32)
    low = np.array([x - length / 2, y - width / 2, 0.0])
    right, forward, up = np.eye(3)
    return [
        Surface(low, np.array([right, up, -forward]), length, height, as_uint8(side), solid=False),
        Surface(
            low + length * right + width * forward, np.array([-right, up, forward]), length, height,
            as_uint8(side[:, ::-1]), solid=False,
        ),
        Surface(
            low + 0.5 * right + width * forward, np.array([-forward, up, -right]), width, height,
            as_uint8(front), solid=False,
        ),
        Surface(
            low + length * right, np.array([forward, up, right]), width, height,
            as_uint8(front), solid=False,
        ),
        Surface(
            low + 0.5 * right + height * up, np.array([right, forward, up]), length - 0.5, width,
            as_uint8(roof), solid=False,
        ),
    ]  # fmt: skip


def tree(x: float, y: float, rng: np.random.Generator) -> list[Surface]:
    """A street tree: two crossed bark strips and slices of leaves through one round crown."""
    surfaces = []
    bark = 86 * (1 + 0.25 * textures.noise((150, 12), rng, 3, 3, stretch=4))
    bark *= np.linspace(0.7, 1.15, 12, dtype=np.float32)
    trunk = as_uint8(bark[..., None] * np.array([1.0, 0.92, 0.82], np.float32))
    up = np.array([0.0, 0.0, 1.0])
    for angle in (0.3, 0.3 + np.pi / 2):
        right = np.array([np.cos(angle), np.sin(angle), 0.0])
        axes = np.array([right, up, np.cross(right, up)])
        corner = np.array([x, y, 0.0]) - 0.12 * right
        surfaces.append(Surface(corner, axes, 0.24, 3.2, trunk, solid=False))
    radius = float(rng.uniform(1.2, 1.5))
    centre = np.array([x, y, 2.6 + radius])
    for slice_ in range(7):
        angle = np.pi * slice_ / 7 + rng.normal(0, 0.1)
        right = np.array([np.cos(angle), np.sin(angle), 0.0])
        axes = np.array([right, up, np.cross(right, up)])
        size = 2 * radius * rng.uniform(0.85, 1.0)
        picture = textures.leaves((round(size / 0.015),) * 2, 0.015, rng)
        corner = centre - 0.5 * size * (right + up) + rng.normal(0, 0.1, 3)
        surfaces.append(Surface(corner, axes, size, size, as_uint8(picture), solid=False))
    return surfaces
