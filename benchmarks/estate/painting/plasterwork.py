"""Plastered walls: grain, trowel marks, day joints, repaired patches and hairline cracks."""

from __future__ import annotations

import cv2
import numpy as np
from benchmarks.estate.painting.noise import Field
from benchmarks.estate.painting.sheet import Sheet, smooth
from benchmarks.estate.plan import Finish, Opening


def plaster(
    sheet: Sheet, finish: Finish, openings: tuple[Opening, ...], rng: np.random.Generator
) -> Field:
    """A plastered wall (H, W, 3) float32 sRGB; repairs and cracks grow with the weathering."""
    light = 1 + np.float32(rng.uniform(0.010, 0.018)) * sheet.soft_clouds((1.4, 2.6), 4, rng)
    light += np.float32(0.004 + 0.010 * rng.random() ** 3) * sheet.soft_clouds((0.2, 0.5), 4, rng)
    light += _day_joints(sheet, rng)
    light += np.float32(rng.uniform(0.016, 0.030)) * sheet.grain(rng)
    light += np.float32(0.012) * sheet.clouds(0.04, 1, rng)
    light -= np.float32(0.10) * sheet.specks(2.5, 0.012, rng)
    light += np.float32(0.05) * sheet.specks(3.0, 0.02, rng)
    patches = _patches(sheet, finish, openings, rng)
    light += patches
    light *= 1 - _cracks(sheet, finish, openings, rng)
    picture = np.empty((sheet.height_px, sheet.width_px, 3), np.float32)
    hue = np.float32(0.25) * patches
    for band, warm in enumerate((-1.0, 0.0, 1.0)):
        picture[..., band] = (light + np.float32(warm) * hue) * np.float32(finish.rgb[band])
    return picture


def _day_joints(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Slight steps of tone between the lifts of the scaffold, (H, W)."""
    wobble = np.float32(0.05) * sheet.soft_clouds(0.8, 2, rng)
    level = (sheet.y_m[:, None] + wobble) / np.float32(2.0)
    tones = rng.uniform(-0.008, 0.008, int(sheet.height_m / 2.0) + 4).astype(np.float32)
    place = np.clip(level, 0, len(tones) - 2)
    below = place.astype(np.int32)
    share = smooth(0.96, 1.0, place - below)
    return tones[below] + (tones[below + 1] - tones[below]) * share


def _patches(
    sheet: Sheet, finish: Finish, openings: tuple[Opening, ...], rng: np.random.Generator
) -> Field:
    """Change of tone (H, W) where the plaster was repaired: rough blots of another batch."""
    mean = sheet.width_m * sheet.height_m * finish.weathering / 45.0
    field = np.zeros((sheet.height_px, sheet.width_px), np.float32)
    for _ in range(int(rng.poisson(mean))):
        x_m, y_m = _place(sheet, openings, rng)
        half = np.array([rng.uniform(0.08, 0.6), rng.uniform(0.06, 0.45)])
        tone = rng.uniform(-0.055, 0.055)
        angles = np.linspace(0, 2 * np.pi, 15)[:-1] + rng.uniform(-0.15, 0.15, 14)
        ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        ring /= np.maximum(np.abs(ring).max(axis=1, keepdims=True), 1e-6) ** rng.uniform(0.2, 0.9)
        corners = ring * half * rng.uniform(0.85, 1.15, (14, 1)) + (x_m, y_m)
        _fill(field, sheet, corners, tone)
    return cv2.GaussianBlur(field, (0, 0), max(0.012 / sheet.m_per_px, 0.5))


def _place(
    sheet: Sheet, openings: tuple[Opening, ...], rng: np.random.Generator
) -> tuple[float, float]:
    """Where a repair is likely: near the corner of an opening, near the ground, or anywhere."""
    draw = rng.random()
    if openings and draw < 0.5:
        opening = openings[int(rng.integers(len(openings)))]
        x_m = opening.x_m + opening.width_m * rng.integers(0, 2) + rng.uniform(-0.3, 0.3)
        y_m = opening.y_m + opening.height_m * rng.integers(0, 2) + rng.uniform(-0.3, 0.3)
        return float(x_m), float(y_m)
    top = 1.2 if draw < 0.7 else sheet.height_m
    return rng.uniform(0, sheet.width_m), rng.uniform(0, top)


def _pixels(sheet: Sheet, points_m: np.ndarray) -> np.ndarray:
    """Points (N, 2) in metres as fixed-point pixels with 4 fractional bits, for OpenCV."""
    x_px = points_m[:, 0] * sheet.width_px / sheet.width_m - 0.5
    y_px = (sheet.height_m - points_m[:, 1]) * sheet.height_px / sheet.height_m - 0.5
    return np.round(np.stack([x_px, y_px], axis=1) * 16).astype(np.int32)


def _fill(field: Field, sheet: Sheet, corners_m: np.ndarray, value: float) -> None:
    cv2.fillPoly(field, [_pixels(sheet, corners_m)], float(value), cv2.LINE_8, 4)


def _cracks(
    sheet: Sheet, finish: Finish, openings: tuple[Opening, ...], rng: np.random.Generator
) -> Field:
    """How much hairline cracks darken (H, W): from corners of openings, and wandering ones."""
    mask = np.zeros((sheet.height_px, sheet.width_px), np.uint8)
    for opening in openings:
        if opening.depth_m == 0 and rng.random() < 0.25 * finish.weathering:
            right, top = rng.integers(0, 2, 2)
            start = (opening.x_m + opening.width_m * right, opening.y_m + opening.height_m * top)
            heading = np.arctan2(2.0 * top - 1, 2.0 * right - 1) + rng.uniform(-0.5, 0.5)
            _crack(mask, sheet, start, heading, rng.uniform(0.2, 1.2), rng)
    for _ in range(int(rng.poisson(sheet.width_m * sheet.height_m * finish.weathering / 120.0))):
        start = (rng.uniform(0, sheet.width_m), rng.uniform(0, sheet.height_m))
        heading = rng.choice([0.0, np.pi / 2]) + rng.uniform(-0.4, 0.4)
        _crack(mask, sheet, start, heading, rng.uniform(0.3, 2.0), rng)
    return mask.astype(np.float32) * np.float32(0.22 / 255)


def _crack(
    mask: np.ndarray,
    sheet: Sheet,
    start: tuple[float, float],
    heading: float,
    length_m: float,
    rng: np.random.Generator,
) -> None:
    steps = max(4, round(length_m / 0.04))
    headings = heading + np.cumsum(rng.uniform(-0.2, 0.2, steps)) + rng.uniform(-0.9, 0.9, steps)
    moves = 0.04 * np.stack([np.cos(headings), np.sin(headings)], axis=1)
    points = np.concatenate([[start], np.asarray(start) + np.cumsum(moves, axis=0)])
    strength = int(255 * rng.uniform(0.3, 1.0) * min(1.0, 0.01 / sheet.m_per_px))
    cv2.polylines(mask, [_pixels(sheet, points)], False, strength, 1, cv2.LINE_AA, 4)
