"""Casts equirectangular panoramas of textured rectangles, windows recessed with true geometry."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray
from tests.scenes.facades import PaintedFacade
from tests.scenes.textures import Picture

from si3fp.geometry.equirect import directions_from_pixels
from si3fp.geometry.rigid import Rigid3

Float32 = NDArray[np.float32]
SUPERSAMPLING = 2  # rays per pixel and axis where there is more than ground and sky


@dataclass(frozen=True)
class Surface:
    """A rectangle in the world with a picture on it.

    ``axes`` (3, 3): rows right, up, normal; ``picture`` (H, W, 3 or 4) uint8, row 0 on top, alpha
    below 128 is air; ``plane`` marks the surfaces that a plane map knows, ``solid`` is False for
    the cars and trees that it looks through.
    """

    corner: NDArray[np.float64]
    axes: NDArray[np.float64]
    width_m: float
    height_m: float
    picture: NDArray[np.uint8]
    facade: PaintedFacade | None = None
    plane: bool = False
    solid: bool = True
    levels: list[NDArray[np.uint8]] = field(default_factory=list)
    levels_behind: list[NDArray[np.uint8]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.levels.extend(_pyramid(self.picture))
        if self.facade is not None:
            self.levels_behind.extend(_pyramid(self.facade.behind))


def _pyramid(picture: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
    levels = [picture]
    while min(levels[-1].shape[:2]) >= 8 and len(levels) < 6:
        height, width = levels[-1].shape[:2]
        smaller = cv2.resize(levels[-1], (width // 2, height // 2), interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(smaller, np.uint8))
    return levels


def hit_distance(
    surface: Surface, centre: NDArray[np.float64], rays: Float32, behind_m: float = 0.0
) -> tuple[Float32, Float32, Float32]:
    """Distance along the rays and place (u, v in metres) on the surface's plane."""
    local = np.asarray(cv2.transform(rays, surface.axes))
    start = surface.axes @ (centre - surface.corner)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.float32(-start[2] - behind_m) / local[..., 2]
    distance = np.where(distance > 1e-3, distance, np.inf).astype(np.float32)
    with np.errstate(invalid="ignore"):
        u = np.float32(start[0]) + distance * local[..., 0]
        v = np.float32(start[1]) + distance * local[..., 1]
    return distance, u, v


def inside(surface: Surface, distance: Float32, u: Float32, v: Float32) -> NDArray[np.bool_]:
    """Which rays meet the rectangle."""
    return (
        np.isfinite(distance) & (u >= 0) & (u < surface.width_m) & (v >= 0) & (v < surface.height_m)
    )


def _sample(
    levels: list[NDArray[np.uint8]],
    surface: Surface,
    u: Float32,
    v: Float32,
    hit: NDArray[np.bool_],
) -> Float32:
    """Picture values at places in metres, from the pyramid level that fits the rays' spacing."""
    width = levels[0].shape[1]
    per_m = width / surface.width_m
    both = hit[:-1, :-1] & hit[1:, :-1] & hit[:-1, 1:]
    usual = 0.0
    if both.any():
        u_here, v_here = u[:-1, :-1][both], v[:-1, :-1][both]
        u_right, v_right = u[:-1, 1:][both], v[:-1, 1:][both]
        u_below, v_below = u[1:, :-1][both], v[1:, :-1][both]
        step_u = np.hypot(u_right - u_here, u_below - u_here)
        step_v = np.hypot(v_right - v_here, v_below - v_here)
        usual = float(np.sqrt(np.median(step_u) * np.median(step_v)))
    level = int(np.clip(round(np.log2(max(usual * per_m, 1e-6)) + 0.2), 0, len(levels) - 1))
    picture = levels[level]
    scale_x, scale_y = picture.shape[1] / surface.width_m, picture.shape[0] / surface.height_m
    x = np.where(np.isfinite(u), u * scale_x - 0.5, -1).astype(np.float32)
    y = np.where(np.isfinite(v), (surface.height_m - v) * scale_y - 0.5, -1).astype(np.float32)
    sampled = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(sampled, np.float32)


def _opening_at(facade: PaintedFacade, u: Float32, v: Float32) -> NDArray[np.uint8]:
    """Index + 1 of the opening at places in metres, 0 for wall."""
    height, width = facade.opening_id.shape
    with np.errstate(invalid="ignore"):
        x = np.floor(u / np.float32(facade.m_per_px))
        y = np.floor(height - v / np.float32(facade.m_per_px))
    seen = np.isfinite(x) & np.isfinite(y) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    x, y = np.where(seen, x, 0).astype(np.intp), np.where(seen, y, 0).astype(np.intp)
    return np.where(seen, facade.opening_id[y, x], 0).astype(np.uint8)


def _through_openings(
    surface: Surface,
    facade: PaintedFacade,
    centre: NDArray[np.float64],
    rays: Float32,
    u: Float32,
    v: Float32,
    hit: NDArray[np.bool_],
    mirrored: Picture,
) -> tuple[NDArray[np.bool_], Float32]:
    """Where rays enter an opening, and the colour that they meet: pane, frame or reveal."""
    entered = np.where(hit, _opening_at(facade, u, v), 0)
    in_opening = entered > 0
    if not in_opening.any():
        return in_opening, np.zeros((*u.shape, 3), np.float32)
    _, deep_u, deep_v = hit_distance(surface, centre, rays, facade.recess_m)
    left = _opening_at(facade, deep_u, deep_v)
    unit = _sample(surface.levels_behind, surface, deep_u, deep_v, in_opening)
    glass = unit[..., 3:] / 255
    colour = unit[..., :3]
    if glass.any():
        normal = surface.axes[2].astype(np.float32)
        facing = rays[..., 0] * normal[0] + rays[..., 1] * normal[1] + rays[..., 2] * normal[2]
        tilt = np.random.default_rng(0).normal(0, 0.012, (256, 3)).astype(np.float32)
        away = rays - 2 * facing[..., None] * normal + tilt[left]
        yaw = np.arctan2(away[..., 0], away[..., 1]) / (2 * np.pi) + 0.5
        pitch = 0.5 - np.arcsin(np.clip(away[..., 2], -1, 1)) / np.pi
        height, width = mirrored.shape[:2]
        seen = cv2.remap(
            mirrored,
            (yaw * width - 0.5).astype(np.float32),
            (pitch * height - 0.5).astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        share = 0.16 + 0.84 * (1 - np.clip(np.abs(facing), 0, 1)) ** 4  # two panes, Schlick
        share = share[..., None] * glass
        colour = colour * (1 - share) + share * seen
    reveal = in_opening & (left != entered)
    if reveal.any():
        boxes = np.array(
            [(0, 0, 0, 0)]
            + [(o.x_m, o.x_m + o.width_m, o.y_m, o.y_m + o.height_m) for o in facade.openings],
            np.float32,
        )[entered]
        # Ratio of the way from the wall to the recess plane at which the ray leaves the opening.
        with np.errstate(divide="ignore", invalid="ignore"):
            du, dv = deep_u - u, deep_v - v
            to_side = np.where(du > 0, (boxes[..., 1] - u) / du, (boxes[..., 0] - u) / du)
            to_head = np.where(dv > 0, (boxes[..., 3] - v) / dv, (boxes[..., 2] - v) / dv)
        side_first = np.nan_to_num(to_side, nan=9) < np.nan_to_num(to_head, nan=9)
        shade = np.where(side_first, np.where(du > 0, 0.62, 0.74), np.where(dv > 0, 0.42, 0.95))
        plain = _sample(surface.levels, surface, u, v, in_opening)[..., :3]
        painted = 0.5 * plain + 0.5 * np.array([186, 180, 170], np.float32)
        colour = np.where(reveal[..., None], painted * shade[..., None], colour)
    return in_opening, colour.astype(np.float32)


def shade(
    surfaces: list[Surface],
    centre: NDArray[np.float64],
    rays: Float32,
    sky: Picture,
    mirrored: Picture,
) -> Float32:
    """Colours (h, w, 3) that rays (h, w, 3) meet."""
    height, width = sky.shape[:2]
    x = (np.arctan2(rays[..., 0], rays[..., 1]) / (2 * np.pi) + 0.5) * width - 0.5
    y = (0.5 - np.arcsin(np.clip(rays[..., 2], -1, 1)) / np.pi) * height - 0.5
    colour = np.asarray(
        cv2.remap(
            sky,
            x.astype(np.float32),
            y.astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
    )
    nearest = np.full(rays.shape[:2], np.inf, np.float32)
    for surface in surfaces:
        distance, u, v = hit_distance(surface, centre, rays)
        hit = inside(surface, distance, u, v) & (distance < nearest)
        if not hit.any():
            continue
        painted = _sample(surface.levels, surface, u, v, hit)
        if painted.shape[2] == 4:
            hit &= painted[..., 3] > 127
            painted = painted[..., :3]
        if surface.facade is not None:
            through, deep = _through_openings(
                surface, surface.facade, centre, rays, u, v, hit, mirrored
            )
            painted = np.where(through[..., None], deep, painted)
        haze = np.clip(1 - np.exp(-distance / 900), 0, 1)[..., None]
        painted = painted * (1 - haze) + haze * np.array([214, 220, 226], np.float32)
        colour = np.where(hit[..., None], painted, colour)
        nearest = np.where(hit, distance, nearest)
    return colour.astype(np.float32)


def rays_of(
    world_from_pano: Rigid3,
    width_px: int,
    left: float,
    top: float,
    size: tuple[int, int],
    step_px: float,
) -> Float32:
    """Unit rays (rows, columns, 3) in the world of a block of pixels, ``step_px`` apart."""
    x = left + (np.arange(size[1]) + 0.5) * step_px
    y = top + (np.arange(size[0]) + 0.5) * step_px
    half = width_px // 2  # both the image's height and the column straight ahead
    level = directions_from_pixels(np.stack([x, 0 * x + half / 2], axis=-1), width_px, half)
    ahead = directions_from_pixels(np.stack([0 * y + half, y], axis=-1), width_px, half)
    level, ahead = level.astype(np.float32), ahead.astype(np.float32)
    rays = np.empty((*size, 3), np.float32)
    rays[..., 0] = ahead[:, None, 2] * level[None, :, 0]
    rays[..., 1] = ahead[:, None, 1]
    rays[..., 2] = ahead[:, None, 2] * level[None, :, 2]
    return np.asarray(cv2.transform(rays, world_from_pano.rotation), np.float32)


def surfaces_hit(
    surfaces: list[Surface], world_from_pano: Rigid3, width_px: int
) -> tuple[NDArray[np.int32], list[NDArray[np.bool_]]]:
    """Index (h, w) of the nearest solid surface, -1 = sky, and where each surface may be seen."""
    size = (width_px // 2, width_px)
    rays = rays_of(world_from_pano, width_px, 0, 0, size, 1.0)
    index = np.full(size, -1, np.int32)
    nearest = np.full(size, np.inf, np.float32)
    crossed = []
    for i, surface in enumerate(surfaces):
        distance, u, v = hit_distance(surface, world_from_pano.translation, rays)
        within = inside(surface, distance, u, v)
        crossed.append(cv2.dilate(within.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0)
        if surface.solid:
            closer = within & (distance < nearest)
            index[closer] = i
            nearest = np.where(closer, distance, nearest)
    return index, crossed


def render_panorama(
    surfaces: list[Surface],
    world_from_pano: Rigid3,
    width_px: int,
    sky: Picture,
    mirrored: Picture,
) -> Picture:
    """Equirectangular colours (W / 2, W, 3), float32 in 0..255, anti-aliased."""
    tiles_x = 32 if width_px >= 2048 else 16
    tile = width_px // tiles_x
    coarse = min(512, width_px // 2)
    _, crossed = surfaces_hit(surfaces, world_from_pano, coarse)
    cells = coarse // tiles_x
    picture = np.empty((width_px // 2, width_px, 3), np.float32)
    for row in range(tiles_x // 2):
        for column in range(tiles_x):
            block = np.s_[row * cells : (row + 1) * cells, column * cells : (column + 1) * cells]
            there = [s for s, seen in zip(surfaces, crossed, strict=True) if seen[block].any()]
            fine = SUPERSAMPLING if any(s.facade or not s.plane for s in there) else 1
            rays = rays_of(
                world_from_pano, width_px, column * tile, row * tile, (tile * fine,) * 2, 1 / fine
            )
            colours = shade(there, world_from_pano.translation, rays, sky, mirrored)
            if fine > 1:
                colours = cv2.resize(colours, (tile, tile), interpolation=cv2.INTER_AREA)
            where = np.s_[row * tile : (row + 1) * tile, column * tile : (column + 1) * tile]
            picture[where] = colours
    return picture
