"""What a camera makes of the light: distortion, exposure, colour, tone, blur and noise.

Brown, D. (1971). Close-range camera calibration. Photogrammetric Engineering 37.
Narkowicz, K. (2016). ACES filmic tone mapping curve (but for the lift of its toe).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
MIDDLE = 0.30  # where the scene's average lands before the tone curve
HIGHLIGHT = 1.9  # and how far the brightest parts may go
BAND_ROWS = 512
MARGIN_ROWS = 8


@dataclass(frozen=True)
class Distortion:
    """Brown-Conrady coefficients in OpenCV's sense, for coordinates of focal length 1."""

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0


def distort(points: FloatArray, lens: Distortion) -> FloatArray:
    """Where the lens images ideal points (N, 2), both in units of the focal length."""
    x, y = points[:, 0], points[:, 1]
    square = x * x + y * y
    radial = 1 + square * (lens.k1 + square * lens.k2)
    return np.stack(
        [
            x * radial + 2 * lens.p1 * x * y + lens.p2 * (square + 2 * x * x),
            y * radial + lens.p1 * (square + 2 * y * y) + 2 * lens.p2 * x * y,
        ],
        axis=1,
    )


def undistort(points: FloatArray, lens: Distortion, steps: int = 4) -> FloatArray:
    """The ideal points (N, 2) of distorted ones, by Newton's method from the points themselves.

    Holds where the lens does not fold the picture over, as within the pictures of real lenses.
    """
    found = np.array(points, np.float64)
    for _ in range(steps):
        x, y = found[:, 0], found[:, 1]
        square = x * x + y * y
        radial = 1 + square * (lens.k1 + square * lens.k2)
        slope = 2 * lens.k1 + 4 * lens.k2 * square  # d radial / d x is slope * x
        xx = radial + slope * x * x + 2 * lens.p1 * y + 6 * lens.p2 * x
        yy = radial + slope * y * y + 6 * lens.p1 * y + 2 * lens.p2 * x
        xy = slope * x * y + 2 * lens.p1 * x + 2 * lens.p2 * y
        off = distort(found, lens) - points
        determinant = xx * yy - xy * xy
        found[:, 0] -= (yy * off[:, 0] - xy * off[:, 1]) / determinant
        found[:, 1] -= (xx * off[:, 1] - xy * off[:, 0]) / determinant
    return found


def photographed(
    radiance: NDArray[np.float32],
    seen: NDArray[np.bool_],
    rng: np.random.Generator,
    *,
    vignetting: float = 0.25,
    exposure_jitter_ev: float = 0.15,
    noise: float = 1.0,
) -> NDArray[np.uint8]:
    """The picture (H, W, 3) sRGB that a camera with everything on automatic takes.

    ``vignetting`` is the most that a corner may lose (0 for a stitched panorama); how much it is,
    exposure, white balance, blur and noise are drawn from ``rng``. Black where not ``seen``.
    """
    gain = exposure(radiance, seen) * 2.0 ** rng.uniform(-exposure_jitter_ev, exposure_jitter_ev)
    gain = gain * white_balance(radiance, seen) * np.exp(rng.uniform(-0.03, 0.03, 3))
    loss = vignetting * rng.uniform(0.3, 1.0)
    blur_px, sharpening = rng.uniform(0.35, 0.6), rng.uniform(0.3, 0.7)
    electrons = rng.uniform(3000, 12000) / max(noise, 1e-3)
    height, width = seen.shape
    x = (np.arange(width, dtype=np.float32) + 0.5) / width - 0.5
    picture = np.zeros((height, width, 3), np.uint8)
    for top in range(0, height, BAND_ROWS):
        bottom = min(top + BAND_ROWS, height)
        if not seen[top:bottom].any():
            continue
        first, last = max(top - MARGIN_ROWS, 0), min(bottom + MARGIN_ROWS, height)
        y = ((np.arange(first, last, dtype=np.float32) + 0.5) - height / 2) / width
        corner = 0.25 * (1 + (height / width) ** 2)
        dimmed = 1 - loss * (x**2 + y[:, None] ** 2) / corner
        light = radiance[first:last] * (gain.astype(np.float32) * dimmed[..., None])
        light = cv2.GaussianBlur(light, (0, 0), blur_px)
        if noise > 0:
            spread = np.sqrt(np.maximum(light, 0) / electrons + (6 / electrons) ** 2)
            grain = rng.standard_normal(light.shape, np.float32) * spread.astype(np.float32)
            light = light + cv2.GaussianBlur(grain, (0, 0), 0.6) * 1.5  # as demosaicking does
        shown = srgb_of(tone(light))
        soft = cv2.GaussianBlur(shown, (0, 0), 0.9)
        shown = shown + np.float32(sharpening) * (shown - soft)
        inner = shown[top - first : top - first + bottom - top]
        picture[top:bottom] = np.clip(inner * 255 + 0.5, 0, 255)
    picture[~seen] = 0
    return picture


def exposure(radiance: NDArray[np.float32], seen: NDArray[np.bool_]) -> float:
    """Factor that brings the seen part to a middle tone without burning its bright parts out."""
    values = _sampled(radiance, seen) @ LUMINANCE
    values = values[values > 0]
    if not len(values):
        return 1.0
    low, high, bright = np.percentile(values, [5, 95, 97])
    average = np.exp(np.log(np.clip(values, low, high)).mean())
    return float(min(MIDDLE / average, HIGHLIGHT / bright))


def white_balance(radiance: NDArray[np.float32], seen: NDArray[np.bool_]) -> FloatArray:
    """(3,) factors that take half of the average's colour away, as cameras do; green stays."""
    mean = _sampled(radiance, seen).mean(axis=0) + 1e-6
    return np.clip((mean[1] / mean).astype(np.float64) ** 0.5, 0.8, 1.25)


def tone(light: NDArray[np.float32]) -> NDArray[np.float32]:
    """Display light 0..1 by a filmic curve: a shoulder for highlights, shadows lifted a little."""
    x = np.maximum(light, 0) * np.float32(0.55)
    shown = x * (2.51 * x + 0.10) / (x * (2.43 * x + 0.59) + 0.14)
    return np.clip(shown, 0, 1).astype(np.float32)


def srgb_of(light: NDArray[np.float32]) -> NDArray[np.float32]:
    """sRGB values 0..1 of linear light 0..1 (IEC 61966-2-1)."""
    curve = 1.055 * np.power(np.maximum(light, 1e-6), 1 / 2.4) - 0.055
    return np.where(light <= 0.0031308, 12.92 * light, curve).astype(np.float32)


def _sampled(radiance: NDArray[np.float32], seen: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(N, 3) colours of at most a million or so seen pixels, in a regular grid; a grey if none."""
    step = max(1, int(np.sqrt(seen.size / 1e6)))
    values = radiance[::step, ::step][seen[::step, ::step]]
    return values if len(values) else np.full((1, 3), 0.18, np.float32)
