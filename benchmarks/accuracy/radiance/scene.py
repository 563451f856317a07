"""Two synthetic facades with cameras in front of them; nobody tunes on the second.

Everything is in frame ``facade``: x right and y up seen from outside, z outward, the wall at z = 0,
the ground at y = 0. The world is turned and shifted against it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from benchmarks.accuracy.radiance.layouts import (
    BRICK,
    STONE,
    five_storeys,
    four_storeys,
    round_tree_and_car,
    slim_tree_and_van,
)
from benchmarks.accuracy.radiance.solids import Ball, Box, Opening
from benchmarks.accuracy.radiance.textures import Look

from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Photo

VARIANTS = ("tuned", "held-out")


@dataclass(frozen=True)
class Scene:
    """A facade, what stands in front of it and who photographs it.

    Attributes
    ----------
    openings, boxes, balls
        Geometry in frame facade.
    shadows
        (left, right, top) of the places below balconies and eaves, metres.
    """

    name: str
    seed: int
    width_m: float
    height_m: float
    look: Look
    openings: tuple[Opening, ...]
    boxes: tuple[Box, ...]
    balls: tuple[Ball, ...]
    shadows: tuple[tuple[float, float, float], ...]
    world_from_facade: Rigid3
    photos: tuple[Photo, ...]

    @property
    def bodies(self) -> tuple[Box | Ball, ...]:
        """All that stands on or in front of the wall."""
        return (*self.boxes, *self.balls)


def scene(
    seed: int, variant: str = "tuned", photo_count: int = 48, photo_width_px: int = 600
) -> Scene:
    """The facade of a variant, its irregularities and cameras drawn from the seed.

    ``tuned`` is 20 x 15 m, five storeys, 39 openings and 8 balconies; ``held-out`` is 22 x 13.2 m,
    four storeys, with other openings, recesses, balconies, colours, tree, van and camera heights.
    """
    rng = np.random.default_rng([seed, VARIANTS.index(variant)])
    tuned = variant == "tuned"
    look = BRICK if tuned else STONE
    width_m, height_m = (20.0, 15.0) if tuned else (22.0, 13.2)
    openings, balconies = (five_storeys if tuned else four_storeys)(rng, look)
    solids, leaves = (round_tree_and_car if tuned else slim_tree_and_van)(rng, look)
    cornice = Box(
        (-0.1, height_m - 0.22, 0.0), (width_m + 0.1, height_m, 0.24), (190, 184, 172), True
    )
    shadows = [(-1.0, width_m + 1.0, height_m - 0.2)]
    shadows += [(box.low[0], box.high[0], box.low[1]) for box in balconies if box.low[2] == 0.0]
    turn = np.deg2rad(rng.uniform(0, 360))
    along = np.array([np.cos(turn), np.sin(turn), 0.0])
    outward = np.cross(along, [0.0, 0.0, 1.0])
    world_from_facade = Rigid3(
        np.stack([along, [0.0, 0.0, 1.0], outward], axis=1), rng.uniform(-20, 20, 3)
    )
    return Scene(
        f"{variant}-{seed}",
        seed,
        width_m,
        height_m,
        look,
        tuple(openings),
        (*balconies, cornice, *solids),
        tuple(leaves),
        tuple(shadows),
        world_from_facade,
        _photos(rng, variant, width_m, world_from_facade, photo_count, photo_width_px),
    )


def _photos(
    rng: np.random.Generator,
    variant: str,
    width_m: float,
    world_from_facade: Rigid3,
    count: int,
    width_px: int,
) -> tuple[Photo, ...]:
    """Hand-held portrait photos along the facade at three distances, every fourth one oblique."""
    tuned = variant == "tuned"
    heights_m, distances_m = (
        ((1.55, 1.65), (9.0, 11.0, 13.0)) if tuned else ((1.3, 2.3), (8.0, 10.5, 13.5))
    )
    focal = (550.0 if tuned else 510.0) * width_px / 600
    height_px = width_px * 4 // 3
    camera = Pinhole(focal, focal, width_px / 2, height_px / 2, width_px, height_px)
    photos = []
    for index in range(count):
        distance = distances_m[index % 3] + rng.uniform(-0.4, 0.4)
        x = width_m * (index + 0.5) / count + rng.uniform(-0.5, 0.5)
        yaw_deg = rng.uniform(-6, 6) + 14 * (1 - 2 * x / width_m) * rng.random()
        if index % 4 == 3:
            yaw_deg = rng.choice([-1.0, 1.0]) * rng.uniform(18, 30)
        # Eaves and pavement both fit.
        pitch_deg = np.rad2deg(np.arctan2(5.6, distance)) - 8 + rng.uniform(-3, 3)
        centre = np.array([x, rng.uniform(*heights_m), distance])
        pose = _pose(centre, np.deg2rad([yaw_deg, pitch_deg, rng.normal(0, 1.5)]))
        photos.append(Photo(f"{index:02d}.jpg", camera, pose @ world_from_facade.inverse()))
    return tuple(photos)


def _pose(centre: FloatArray, yaw_pitch_roll: FloatArray) -> Rigid3:
    """cam_from_facade; yaw turns right, pitch up, roll the right side down, all in radians."""
    yaw, pitch, roll = yaw_pitch_roll
    forward = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), -np.cos(yaw) * np.cos(pitch)])
    right = np.array([np.cos(yaw), 0.0, np.sin(yaw)])
    down = np.cross(forward, right)
    turned = np.cos(roll) * right + np.sin(roll) * down
    rotation = np.stack([turned, np.cross(forward, turned), forward])
    return Rigid3(rotation, -rotation @ centre)


def without_obstacles(full: Scene) -> Scene:
    """The facade alone, as the true orthophoto shows it: no tree, no car."""
    return replace(full, boxes=tuple(box for box in full.boxes if box.of_facade), balls=())
