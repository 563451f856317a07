"""Photos and the true orthophoto of a synthetic facade, by casting rays."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from benchmarks.accuracy.radiance.rays import (
    FRAME,
    GLASS,
    GROUND,
    REVEAL,
    SILL,
    SKY,
    SOFFIT,
    WALL,
    Rays,
    Wall,
    WallHits,
    body_hits,
    corners_of,
    facade_rays,
    photo_rays,
    sight_rays,
)
from benchmarks.accuracy.radiance.scene import Scene, without_obstacles
from benchmarks.accuracy.radiance.solids import Ball
from benchmarks.accuracy.radiance.textures import MARGIN_M, NOISE_PX, TEXEL_M, Float, lookup, paint
from numpy.typing import NDArray

from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.model import Image, Photo

START_M = 2.0
"""The true orthophoto looks from here: in front of all balconies, behind trees and cars."""

SENSOR_NOISE = 1.0
"""Standard deviation of a photo's pixels in grey levels."""

BAND_ROWS = 64
LIGHT_OF_FACE = {
    (0, 1): 0.84,
    (0, -1): 0.76,
    (1, 1): 1.04,
    (1, -1): 0.42,
    (2, 1): 1.0,
    (2, -1): 0.6,
}
"""Overcast light on faces by axis and side: below a slab it is dark."""


@dataclass(frozen=True)
class Truth:
    """The exact orthophoto of a facade on a grid.

    Attributes
    ----------
    rgb
        (H, W, 3) uint8, averaged over each pixel.
    depth_m
        (H, W) at pixel centres, metres in front of the wall.
    sees
        (photos, H, W) bool: the photo shows the place at the pixel's centre.
    """

    grid: FacadeGrid
    rgb: Image
    depth_m: Float
    sees: NDArray[np.bool_]

    @property
    def seen_by(self) -> NDArray[np.uint8]:
        """(H, W) number of photos."""
        return np.asarray(self.sees.sum(axis=0), np.uint8)


class Renderer:
    """A scene with its surfaces painted, ready to be looked at."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        rng = np.random.default_rng(scene.seed)
        size_m = (scene.width_m, scene.height_m)
        self.surfaces = paint(rng, scene.look, size_m, scene.shadows)
        self.wall = Wall(scene)

    def photo(self, photo: Photo, rng: np.random.Generator, samples: int = 2) -> Image:
        """The photo as RGB (H, W, 3) uint8; each pixel is the mean of samples x samples rays."""
        rays = photo_rays(photo, self.scene.world_from_facade, samples)
        size = (photo.camera.width_px, photo.camera.height_px)
        rgb = cv2.resize(self._colours(self.scene, rays), size, interpolation=cv2.INTER_AREA)
        rgb += SENSOR_NOISE * rng.standard_normal(rgb.shape, np.float32)
        return np.asarray(np.clip(rgb + 0.5, 0, 255), np.uint8)

    def truth(self, m_per_px: float, samples: int = 4) -> Truth:
        """The facade as no camera can show it: orthographic, without tree and car."""
        scene, bare = self.scene, without_obstacles(self.scene)
        size_m = (scene.width_m, scene.height_m)
        grid = FacadeGrid.covering(scene.world_from_facade, *size_m, m_per_px)
        rgb = np.zeros((grid.height_px, grid.width_px, 3), np.uint8)
        depth_m = np.zeros((grid.height_px, grid.width_px), np.float32)
        for top in range(0, grid.height_px, BAND_ROWS):
            rows = slice(top, min(top + BAND_ROWS, grid.height_px))
            size = (grid.width_px, rows.stop - rows.start)
            colours = self._colours(bare, _facade_rays(grid, rows, samples))
            colours = cv2.resize(colours, size, interpolation=cv2.INTER_AREA)
            rgb[rows] = np.clip(colours + 0.5, 0, 255)
            depth_m[rows] = START_M - _nearest(bare, self.wall, _facade_rays(grid, rows, 1))
        sees = [_sees(scene, self.wall, photo, grid, depth_m) for photo in scene.photos]
        return Truth(grid, rgb, depth_m, np.stack(sees))

    def _colours(self, scene: Scene, rays: Rays) -> Float:
        """Colour (h, w, 3) that each ray brings, grey levels."""
        hits = self.wall.cast(rays)
        rgb = self._background(rays, hits)
        t = hits.t
        for body in scene.bodies:
            window = rays.window(corners_of(body))
            if not t[window].size:
                continue
            origin, direction = rays.at(window)
            hit, face = body_hits(body, origin, direction)
            first = hit < t[window]
            if not first.any():
                continue
            at = hit[first]
            point = [o[first] + at * d[first] for o, d in zip(origin, direction, strict=True)]
            if isinstance(body, Ball):
                up = (point[1] - np.float32(body.centre[1])) / np.float32(body.radius)
                light, rough = 0.82 + 0.28 * up, 14.0
            else:
                towards = np.stack([d[first] for d in direction])
                light, rough = _light(face[first], towards), 3.0
            # One tile serves all: two skew coordinates that no face holds constant.
            grain = lookup(
                self.surfaces.grain,
                (point[0] + 0.71 * point[2]) / np.float32(TEXEL_M),
                (point[1] + 0.37 * point[2]) / np.float32(TEXEL_M),
            )
            colour = np.array(body.rgb, np.float32) + (rough * grain)[:, None]
            t[window][first] = at
            rgb[window][first] = colour * light[:, None]
        return np.clip(rgb, 0, 255)

    def _background(self, rays: Rays, hits: WallHits) -> Float:
        """Colours of wall, recesses, ground and sky."""
        rgb = np.empty((*rays.shape, 3), np.float32)

        def place(mask: NDArray[np.bool_]) -> list[Float]:
            t = hits.t[mask]
            return [o[mask] + t * d[mask] for o, d in zip(rays.origin, rays.direction, strict=True)]

        sky = hits.part == SKY
        rgb[sky] = self._surroundings([d[sky] for d in rays.direction])
        ground = hits.part == GROUND
        x, _, z = place(ground)
        rgb[ground] = lookup(self.surfaces.ground, x / np.float32(TEXEL_M), z / np.float32(TEXEL_M))
        plain = (hits.part >= WALL) & (hits.part <= SILL)
        x, y, z = place(plain)
        # Reveals carry the wall's picture, unrolled from the edge that they start at.
        column = (x - 0.6 * z + np.float32(MARGIN_M)) / np.float32(TEXEL_M) - 0.5
        row = np.maximum(y - 0.8 * z, 0.01) / np.float32(TEXEL_M) - 0.5
        colour = lookup(self.surfaces.wall, column, row)
        level = np.ones(8, np.float32)
        level[[REVEAL, SOFFIT, SILL]] = 0.78, 0.55, 1.0
        deeper = 1 + 0.6 * z  # less light reaches the inner end
        rgb[plain] = colour * (level[hits.part[plain]] * deeper)[:, None]
        frame = hits.part == FRAME
        tints = np.array([opening.frame_rgb for opening in self.scene.openings], np.float32)
        rgb[frame] = tints[hits.opening[frame]] * np.float32(0.95)
        glass = hits.part == GLASS
        rgb[glass] = self._glass(rays, hits.opening[glass], glass, place(glass))
        return rgb

    def _glass(
        self,
        rays: Rays,
        opening: NDArray[np.int16],
        glass: NDArray[np.bool_],
        point: list[Float],
    ) -> Float:
        """Room and curtains behind the glass, and what it mirrors (Schlick 1994)."""
        left, right, room, curtain, tilt_x, tilt_y = np.array(
            [[o.left, o.right, o.interior, o.curtain, *o.tilt] for o in self.scene.openings],
            np.float32,
        )[opening].T
        across = (point[0] - left) / (right - left)
        folds = 168 + 10 * np.sin(point[0] * 60) * np.sin(point[0] * 17)
        inside = np.clip((curtain - np.minimum(across, 1 - across)) / 0.02 + 0.5, 0, 1)
        grey = room * (1 - inside) + folds * inside
        dx, dy, dz = (axis[glass] for axis in rays.direction)
        cosine = -dz / np.sqrt(dx * dx + dy * dy + dz * dz)
        base = self.scene.look.reflectance
        share = np.float32(base) + np.float32(1 - base) * (1 - cosine) ** 5
        mirrored = self._surroundings([dx + 2 * dz * tilt_x, dy + 2 * dz * tilt_y, -dz])
        tint = np.array([0.96, 1.0, 0.98], np.float32)
        return np.asarray(
            (1 - share)[:, None] * grey[:, None] * tint + share[:, None] * mirrored, np.float32
        )

    def _surroundings(self, direction: list[Float]) -> Float:
        """Colour (N, 3) of sky and street in directions."""
        dx, dy, dz = direction
        bearing = np.arctan2(dx, dz) / np.float32(2 * np.pi) + np.float32(0.5)
        up = np.arctan2(dy, np.hypot(dx, dz)) / np.float32(np.pi)
        return lookup(
            self.surfaces.environment,
            bearing * NOISE_PX - 0.5,
            (np.float32(0.5) - up) * (NOISE_PX // 2) - 0.5,
        )


def _facade_rays(grid: FacadeGrid, rows: slice, samples: int) -> Rays:
    columns = (np.arange(grid.width_px * samples) + 0.5) / samples
    lines = (np.arange(rows.start * samples, rows.stop * samples) + 0.5) / samples
    x_m = grid.facade_from_pixels(np.stack([columns, 0 * columns], axis=-1))[:, 0]
    y_m = grid.facade_from_pixels(np.stack([0 * lines, lines], axis=-1))[:, 1]
    return facade_rays(x_m, y_m, START_M)


def _nearest(scene: Scene, wall: Wall, rays: Rays) -> Float:
    """t of the first hit of each ray."""
    t = wall.cast(rays).t
    for body in scene.bodies:
        window = rays.window(corners_of(body))
        if t[window].size:
            origin, direction = rays.at(window)
            t[window] = np.minimum(t[window], body_hits(body, origin, direction)[0])
    return t


def _sees(
    scene: Scene, wall: Wall, photo: Photo, grid: FacadeGrid, depth_m: Float
) -> NDArray[np.bool_]:
    facade_from_world = scene.world_from_facade.inverse()
    centre = facade_from_world.apply(photo.centre_in_world)
    pixels = np.stack(
        np.meshgrid(np.arange(grid.width_px) + 0.5, np.arange(grid.height_px) + 0.5), axis=-1
    )
    places = grid.facade_from_pixels(pixels)
    points = np.concatenate([places, depth_m[..., None]], axis=-1)
    cam_from_facade = photo.cam_from_world @ scene.world_from_facade
    camera = photo.camera
    x_px, y_px = np.moveaxis(camera.project(cam_from_facade.apply(points)), -1, 0)
    framed = (x_px >= 0.5) & (x_px <= camera.width_px - 0.5)
    framed &= (y_px >= 0.5) & (y_px <= camera.height_px - 0.5)
    rays = sight_rays(centre, places[0, :, 0], places[:, 0, 1], depth_m)
    # 0.02 % of the way is 2 mm: more than float32 rounds.
    return np.asarray(framed & (_nearest(scene, wall, rays) > 1 - 2e-4))


def _light(face: NDArray[np.int8], towards: Float) -> Float:
    light = np.ones(len(face), np.float32)
    for (axis, side), level in LIGHT_OF_FACE.items():
        light[(face == axis) & (towards[axis] * side < 0)] = level
    return light
