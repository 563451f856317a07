"""Procedural pictures of walls, ground, leaves and sky: float32 RGB (H, W, 3) in 0..255."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.float32]


def as_uint8(picture: Picture) -> NDArray[np.uint8]:
    """The picture cut to 0..255 and rounded down."""
    return np.clip(picture, 0, 255).astype(np.uint8)


def noise(
    shape: tuple[int, int],
    rng: np.random.Generator,
    cell_px: float,
    octaves: int = 4,
    stretch: float = 1.0,
) -> Picture:
    """Sum of smooth noises (H, W), standard deviation 1; ``stretch`` lengthens it vertically."""
    height, width = shape
    total: Picture = np.zeros(shape, np.float32)
    for octave in range(octaves):
        cell = max(cell_px / 2**octave, 1.0)
        grid = (int(height / (cell * stretch)) + 2, int(width / cell) + 2)
        coarse = rng.standard_normal(grid, dtype=np.float32)
        fine = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
        total += np.asarray(fine, np.float32) * 0.6**octave
    return total / max(float(total.std()), 1e-6)


def _tinted(grey: Picture, colour: tuple[float, float, float]) -> Picture:
    return grey[..., None] * np.array(colour, np.float32)


def plaster(
    shape: tuple[int, int],
    m_per_px: float,
    rng: np.random.Generator,
    colour: tuple[float, float, float],
) -> Picture:
    """Rendered wall: grain, trowel clouds, rain streaks and a few repaired patches."""
    grain = noise(shape, rng, 0.05 / m_per_px, 3)
    clouds = noise(shape, rng, 1.6 / m_per_px, 5)
    streaks = noise(shape, rng, 0.25 / m_per_px, 3, stretch=9.0)
    grey = 1 + 0.035 * grain + 0.035 * clouds - 0.05 * np.clip(streaks - 0.7, 0, 2)
    for _ in range(int(rng.integers(5, 10))):  # repairs
        x, y = rng.uniform(0, shape[1]), rng.uniform(0, shape[0])
        size = rng.uniform(0.2, 0.9, 2) / m_per_px
        rows = slice(max(int(y - size[1] / 2), 0), int(y + size[1] / 2) + 1)
        columns = slice(max(int(x - size[0] / 2), 0), int(x + size[0] / 2) + 1)
        patch = grey[rows, columns]
        ragged = noise(patch.shape, rng, 0.15 / m_per_px, 4) > -0.9 if patch.size > 4 else 0
        patch += np.where(ragged, rng.uniform(-0.07, 0.05), 0).astype(np.float32)
    return _tinted(grey, colour)


def brick(
    shape: tuple[int, int],
    m_per_px: float,
    rng: np.random.Generator,
    colour: tuple[float, float, float],
) -> Picture:
    """Brickwork in running bond: 250 x 75 mm with 10 mm joints, every brick with its own fire."""
    height, width = shape
    y_m = (np.arange(height) + 0.5)[::-1] * m_per_px
    x_m = (np.arange(width) + 0.5) * m_per_px
    course = np.floor(y_m / 0.075).astype(int)
    along = x_m[None, :] + np.where(course % 2, 0.125, 0.0)[:, None]
    column = np.floor(along / 0.25).astype(int)
    in_joint = ((y_m % 0.075) < 0.0101)[:, None] | ((along % 0.25) < 0.0101)
    fire = rng.normal(1, 0.13, (course.max() + 2, column.max() + 2)).astype(np.float32)
    dark = rng.random(fire.shape) < 0.06
    fire[dark] *= 0.62
    warmth = rng.normal(0, 0.05, fire.shape).astype(np.float32)
    rows = np.broadcast_to(course[:, None], shape)
    grey = fire[rows, column]
    tint = warmth[rows, column]
    picture = np.stack(
        [
            colour[0] * grey * (1 + tint),
            colour[1] * grey,
            colour[2] * grey * (1 - tint),
        ],
        axis=-1,
    ).astype(np.float32)
    mortar = np.array([168, 160, 148], np.float32) * (
        1 + 0.06 * noise(shape, rng, 0.4 / m_per_px, 4)[..., None]
    )
    picture = np.where(in_joint[..., None], mortar, picture)
    weather = 1 + 0.05 * noise(shape, rng, 1.5 / m_per_px, 5)
    weather += 0.03 * noise(shape, rng, 0.03 / m_per_px, 2)
    streaks = noise(shape, rng, 0.3 / m_per_px, 3, stretch=8.0)
    weather += 0.10 * np.clip(streaks - 1.2, 0, 1.5)  # efflorescence
    return picture * weather[..., None]


def panels(
    shape: tuple[int, int],
    m_per_px: float,
    rng: np.random.Generator,
    colour: tuple[float, float, float],
    panel_m: tuple[float, float],
) -> Picture:
    """Washed-concrete panels with dark joints, every panel with its own shade and pebbles."""
    height, width = shape
    y_m = (np.arange(height) + 0.5)[::-1] * m_per_px
    x_m = (np.arange(width) + 0.5) * m_per_px
    row, column = (y_m / panel_m[1]).astype(int), (x_m / panel_m[0]).astype(int)
    shade = rng.normal(1, 0.035, (row.max() + 1, column.max() + 1)).astype(np.float32)
    grey = shade[row[:, None], column[None, :]]
    grey = grey * (1 + 0.07 * noise(shape, rng, 0.03 / m_per_px, 2))
    grey += 0.03 * noise(shape, rng, 1.2 / m_per_px, 5)
    streaks = noise(shape, rng, 0.22 / m_per_px, 3, stretch=10.0)
    grey -= 0.06 * np.clip(streaks - 0.8, 0, 2)
    offset_y = np.minimum(y_m % panel_m[1], panel_m[1] - y_m % panel_m[1])
    offset_x = np.minimum(x_m % panel_m[0], panel_m[0] - x_m % panel_m[0])
    joint = (offset_y < 0.011)[:, None] | (offset_x < 0.011)[None, :]
    return _tinted(np.where(joint, grey * 0.45, grey).astype(np.float32), colour)


def stone(shape: tuple[int, int], m_per_px: float, rng: np.random.Generator) -> Picture:
    """Grey granite for plinths: blocks of about 0.9 m with thin joints."""
    grey = 1 + 0.10 * noise(shape, rng, 0.03 / m_per_px, 2) + 0.06 * noise(shape, rng, 0.5, 4)
    x_m = (np.arange(shape[1]) + 0.5) * m_per_px
    grey = np.where((x_m % 0.9 < 0.012)[None, :], grey * 0.55, grey)
    return _tinted(grey.astype(np.float32), (118.0, 114.0, 110.0))


def roof_tiles(shape: tuple[int, int], m_per_px: float, rng: np.random.Generator) -> Picture:
    """Clay tiles: rows of 0.35 m, columns of 0.22 m."""
    height, width = shape
    y_m = (np.arange(height) + 0.5) * m_per_px
    x_m = (np.arange(width) + 0.5) * m_per_px
    row, column = (y_m / 0.35).astype(int), (x_m / 0.22).astype(int)
    shade = rng.normal(1, 0.10, (row.max() + 1, column.max() + 1)).astype(np.float32)
    wave = 0.8 + 0.25 * np.sin(2 * np.pi * x_m / 0.22)[None, :] - 0.2 * (y_m % 0.35 < 0.04)[:, None]
    grey = shade[row[:, None], column[None, :]] * wave
    grey = grey * (1 + 0.08 * noise(shape, rng, 1.0 / m_per_px, 4))
    return _tinted(grey.astype(np.float32), (134.0, 84.0, 66.0))


def leaves(shape: tuple[int, int], m_per_px: float, rng: np.random.Generator) -> Picture:
    """RGBA of one slice through a tree crown: clumps of leaves with holes."""
    height, width = shape
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    radius = np.hypot((x / width - 0.5) * 2, (y / height - 0.5) * 2)
    clumps = noise(shape, rng, 0.5 / m_per_px, 3)
    leaf = noise(shape, rng, 0.09 / m_per_px, 2)
    solid = 0.9 * clumps + 0.9 * leaf > 4.5 * (radius - 0.62)
    light = 0.55 + 0.16 * leaf + 0.15 * clumps + 0.35 * (1 - y / height)
    light *= 1 + 0.25 * rng.standard_normal(shape, dtype=np.float32)
    rgb = np.clip(light, 0.12, 1.3)[..., None] * np.array([84, 102, 50], np.float32)
    return np.concatenate([rgb, np.where(solid, 255, 0)[..., None]], axis=-1).astype(np.float32)


def sky(width_px: int, rng: np.random.Generator) -> Picture:
    """Equirectangular sky (W / 2, W, 3), centre column north: gradient, clouds, far skyline."""
    height = width_px // 2
    pitch = (0.5 - (np.arange(height) + 0.5) / height) * 180
    climb = np.clip(pitch / 70, 0, 1)[:, None, None].astype(np.float32)
    blue = np.array([218, 226, 232], np.float32) * (1 - climb) + climb * np.array(
        [128, 164, 208], np.float32
    )
    seam = width_px // 4
    fade = np.linspace(0, 1, seam, dtype=np.float32)
    wide = noise((height, width_px + seam), rng, width_px / 10, 5)
    clouds = wide[:, :width_px]
    clouds[:, :seam] = clouds[:, :seam] * fade + wide[:, width_px:] * (1 - fade)
    cover = np.clip(0.45 + 0.4 * clouds, 0, 1)[..., None]
    white = np.clip(236 + 9 * clouds, 190, 252)[..., None] * np.array([0.985, 0.99, 1], np.float32)
    picture = blue * (1 - cover) + white * cover
    bearing = np.arange(width_px)
    roofs = np.repeat(rng.uniform(2.0, 7.5, width_px // 24 + 1), 24)[:width_px]
    trees = 3.0 + 1.5 * noise((1, width_px), rng, width_px / 60, 4)[0]
    skyline = np.maximum(roofs, trees)
    tone = np.repeat(rng.uniform(110, 175, width_px // 24 + 1), 24)[:width_px]
    tone = np.where(roofs > trees, tone, 96 + 6 * np.sin(bearing * 1.7)).astype(np.float32)
    hidden = pitch[:, None] < skyline[None, :]
    far = (tone[None, :, None] * np.array([0.97, 1.0, 1.02], np.float32)) * 0.55 + 88
    return np.where(hidden[..., None], far, picture).astype(np.float32)


def mirrored_world(sky_picture: Picture, rng: np.random.Generator) -> Picture:
    """What window panes mirror: the sky, blurred, above a row of dim houses."""
    height, width = sky_picture.shape[:2]
    pitch = (0.5 - (np.arange(height) + 0.5) / height) * 180
    roofs = 30 + 7 * noise((1, width), rng, width / 14, 3)[0]
    wall = 92 + 12 * noise((height, width), rng, width / 40, 4)
    panes = (np.arange(width) % (width // 64) < width // 160)[None, :] & ((pitch % 9) > 4)[:, None]
    house = np.where(panes, wall * 0.55, wall)[..., None] * np.array([1.05, 1.0, 0.93], np.float32)
    mixed = np.where((pitch[:, None] < roofs[None, :])[..., None], house, sky_picture)
    return np.asarray(cv2.GaussianBlur(mixed.astype(np.float32), (0, 0), width / 512), np.float32)


def pavement_and_road(
    shape: tuple[int, int], m_per_px: float, rng: np.random.Generator, kerbs_m: tuple[float, float]
) -> Picture:
    """Ground of a street along x; the kerbs lie at two heights above the lower edge."""
    height, width = shape
    y_m = (np.arange(height) + 0.5)[::-1] * m_per_px
    x_m = (np.arange(width) + 0.5) * m_per_px
    asphalt = 92 + 4 * noise(shape, rng, 1, 1) + 6 * noise(shape, rng, 3.0 / m_per_px, 4)
    cracks = np.abs(noise(shape, rng, 2.5 / m_per_px, 4)) < 0.012
    asphalt = np.where(cracks, asphalt * 0.7, asphalt)
    row, column = (y_m / 0.35).astype(int), (x_m / 0.35).astype(int)
    shade = rng.normal(1, 0.05, (row.max() + 1, column.max() + 1)).astype(np.float32)
    slabs = 150 * shade[row[:, None], column[None, :]]
    slabs = slabs * (1 + 0.04 * noise(shape, rng, 1.5 / m_per_px, 5))
    joints = (y_m % 0.35 < 0.02)[:, None] | (x_m % 0.35 < 0.02)[None, :]
    slabs = np.where(joints, slabs * 0.75, slabs)
    on_road = ((y_m > kerbs_m[0]) & (y_m < kerbs_m[1]))[:, None]
    grey = np.where(on_road, asphalt, slabs)
    for kerb_m in kerbs_m:
        grey = np.where((np.abs(y_m - kerb_m) < 0.08)[:, None], 172, grey)
    middle = 0.5 * (kerbs_m[0] + kerbs_m[1])
    dashes = (np.abs(y_m - middle) < 0.06)[:, None] & (x_m % 6 < 3)[None, :]
    grey = np.where(dashes, 205, grey).astype(np.float32)
    return _tinted(grey, (1.0, 0.985, 0.965))
