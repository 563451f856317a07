"""Painted surfaces of the synthetic facades: continuous in metres, without detail below 2 cm.

A texture is a picture that `lookup` reads with bilinear interpolation, so that a place has the
same colour in every photo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float32]
Rgb = tuple[float, float, float]

TEXEL_M = 0.01
MARGIN_M = 8.0
NOISE_PX = 1024


@dataclass(frozen=True)
class Look:
    """Materials of a facade: masonry below, plaster above; colours 0-255.

    Attributes
    ----------
    split_m
        Height where masonry ends and plaster begins.
    course_m, block_m, joint_m
        Height and length of a brick or stone, and width of its joints.
    masonry_rgb, masonry_spread, joint_rgb, plaster_rgb
        Colours, and how much one brick differs from the next.
    frame_below_rgb, frame_above_rgb
        Window frames in the masonry and in the plaster.
    balcony_rgb, leaf_rgb, car_rgb
        What stands in front.
    reflectance
        Of the glass seen head-on.
    """

    split_m: float
    course_m: float
    block_m: float
    joint_m: float
    masonry_rgb: Rgb
    masonry_spread: float
    joint_rgb: Rgb
    plaster_rgb: Rgb
    frame_below_rgb: Rgb
    frame_above_rgb: Rgb
    balcony_rgb: Rgb
    leaf_rgb: Rgb
    car_rgb: Rgb
    reflectance: float


@dataclass(frozen=True)
class Surfaces:
    """The pictures that a scene is painted with."""

    wall: Float
    ground: Float
    environment: Float
    grain: Float


def paint(
    rng: np.random.Generator,
    look: Look,
    size_m: tuple[float, float],
    shadows: Sequence[tuple[float, float, float]],
) -> Surfaces:
    """All surfaces of a facade of this size; see `wall_picture` for the shadows."""
    return Surfaces(
        wall_picture(rng, look, size_m, shadows),
        ground_picture(rng),
        environment_picture(rng),
        noise_tile(rng, 4, 60),
    )


def lookup(picture: NDArray[np.float32], column: Float, row: Float) -> Float:
    """Bilinear value of a picture at texel coordinates of any one shape, wrapped at its rim."""
    shape = column.shape
    width = 4096  # cv2.remap takes no side of 32768 or more
    count = column.size
    lines = max(1, -(-count // width))
    padded = np.zeros((2, lines * width), np.float32)
    padded[0, :count] = (column % picture.shape[1]).ravel()
    padded[1, :count] = (row % picture.shape[0]).ravel()
    maps = padded.reshape(2, lines, width)
    values = cv2.remap(picture, maps[0], maps[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    channels = picture.shape[2:]
    return np.asarray(values.reshape(-1, *channels)[:count].reshape(*shape, *channels), np.float32)


def noise_tile(rng: np.random.Generator, shortest_px: float, longest_px: float) -> Float:
    """Periodic noise (NOISE_PX, NOISE_PX) of wavelengths in a band; mean 0, deviation 1."""
    spectrum = np.fft.rfft2(rng.standard_normal((NOISE_PX, NOISE_PX)))
    frequency = np.hypot(np.fft.fftfreq(NOISE_PX)[:, None], np.fft.rfftfreq(NOISE_PX)[None, :])
    kept = np.exp(-((frequency * shortest_px) ** 4)) * (
        1 - np.exp(-((frequency * longest_px) ** 4))
    )
    # Equal power per octave: natural surfaces have no preferred size.
    noise = np.fft.irfft2(spectrum * kept / np.maximum(frequency, 1 / NOISE_PX), s=(NOISE_PX,) * 2)
    return np.asarray((noise - noise.mean()) / noise.std(), np.float32)


def wall_picture(
    rng: np.random.Generator,
    look: Look,
    size_m: tuple[float, float],
    shadows: Sequence[tuple[float, float, float]],
) -> Float:
    """Wall and its neighbours (rows from the ground up, columns from -MARGIN_M, 3), TEXEL_M.

    ``shadows`` are (left, right, top): below each the wall is darker, as below a balcony.
    """
    width_m, height_m = size_m
    columns, rows = round((width_m + 2 * MARGIN_M) / TEXEL_M), round((height_m + 3.0) / TEXEL_M)
    x = ((np.arange(columns) + 0.5) * TEXEL_M - MARGIN_M)[None, :]
    y = ((np.arange(rows) + 0.5) * TEXEL_M)[:, None]
    fine, coarse = noise_tile(rng, 3, 12), noise_tile(rng, 60, 400)
    tiled = np.ix_(np.arange(rows) % NOISE_PX, np.arange(columns) % NOISE_PX)
    plaster = np.array(look.plaster_rgb) + (1.3 * fine + 2.5 * coarse)[tiled][..., None]
    masonry = _masonry(rng, look, x, y) + (4.0 * fine + 3.0 * coarse)[tiled][..., None]
    below = np.clip((look.split_m - y) / 0.01 + 0.5, 0, 1)[..., None]
    wall = masonry * below + plaster * (1 - below)
    band = np.clip((0.1 - np.abs(y - look.split_m)) / 0.01 + 0.5, 0, 1)[..., None]
    wall = wall * (1 - band) + band * (np.array([176.0, 172.0, 164.0]) + 3 * fine[tiled][..., None])
    for left, right, top in shadows:
        across = np.clip((x - left + 0.2) / 0.4, 0, 1) * np.clip((right + 0.2 - x) / 0.4, 0, 1)
        depth = np.exp(-np.maximum(top - y, 0) / 0.7) * (y <= top)
        wall *= (1 - 0.4 * across * depth)[..., None]
    for side, tint in ((x < 0, (0.78, 0.84, 0.9)), (x > width_m, (0.95, 0.8, 0.74))):
        panes = (np.mod(x, 2.1) < 1.0) & (np.mod(y, 3.1) > 0.9) & (np.mod(y, 3.1) < 2.3)
        next_door = np.where(panes[..., None], 60.0, plaster * np.array(tint))
        wall = np.where(side[..., None], next_door, wall)
    return np.asarray(cv2.GaussianBlur(wall.astype(np.float32), (0, 0), 0.8), np.float32)


def _masonry(
    rng: np.random.Generator, look: Look, x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    course = np.floor(y / look.course_m).astype(int)
    shifted = x + MARGIN_M + (course % 2) * look.block_m / 2
    block = np.floor(shifted / look.block_m).astype(int)
    table = rng.standard_normal((course.max() + 1, block.max() + 1, 3)) * [1.0, 0.8, 0.7]
    table = (table + 1.5 * rng.standard_normal(table.shape[:2])[..., None]) / 1.8
    colour = np.array(look.masonry_rgb) + look.masonry_spread * table[course, block]
    joint = (np.mod(y, look.course_m) < look.joint_m) | (
        np.mod(shifted, look.block_m) < look.joint_m
    )
    return np.where(joint[..., None], np.array(look.joint_rgb), colour)


def ground_picture(rng: np.random.Generator) -> Float:
    """Paving of the street (NOISE_PX, NOISE_PX, 3), TEXEL_M, periodic."""
    fine, coarse = noise_tile(rng, 3, 10), noise_tile(rng, 60, 300)
    place = np.arange(NOISE_PX) % 64
    joint = (place < 2)[:, None] | (place < 2)[None, :]
    grey = np.where(joint, 88.0, 132.0) + 5 * fine + 5 * coarse
    picture = grey[..., None] * np.array([1.0, 0.98, 0.94])
    return np.asarray(cv2.GaussianBlur(picture.astype(np.float32), (0, 0), 0.8), np.float32)


def environment_picture(rng: np.random.Generator) -> Float:
    """Sky, clouds and the houses opposite (512, 1024, 3): all directions, zenith in row 0.

    Columns run with the bearing ``atan2(x, z)`` of the facade frame from -180 to 180 degrees.
    """
    rows, columns = NOISE_PX // 2, NOISE_PX
    up_deg = (90 - (np.arange(rows) + 0.5) * 180 / rows)[:, None]
    bearing = np.arange(columns)[None, :]
    height = np.clip(up_deg / 90, 0, 1)[..., None]
    sky = (1 - height) * np.array([206.0, 217.0, 228.0]) + height * np.array([112.0, 150.0, 205.0])
    cloud = np.clip(0.35 + 0.6 * noise_tile(rng, 24, 300)[:rows], 0, 1)[..., None]
    sky = sky * (1 - cloud) + cloud * np.array([238.0, 238.0, 238.0])
    house = bearing // 37
    tops = rng.uniform(9, 17, house.max() + 1)[house]
    tones = rng.uniform(95, 175, (house.max() + 1, 3))
    tones = (tones + 2 * tones.mean(axis=1, keepdims=True)) / 3
    panes = (np.mod(bearing, 9) < 4) & (np.mod(up_deg, 4.5) > 1.6) & (up_deg > 1)
    houses = np.where(panes[..., None], 62.0, tones[house])
    picture = np.where((up_deg < tops)[..., None], houses, sky)
    street = 118.0 - 0.3 * np.abs(up_deg)[..., None] * np.ones(3)
    picture = np.where((up_deg < -2)[..., None], street, picture)
    return np.asarray(cv2.GaussianBlur(picture.astype(np.float32), (0, 0), 0.7), np.float32)
