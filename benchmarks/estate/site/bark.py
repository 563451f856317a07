"""Textures of bark, one metre square."""

from __future__ import annotations

import numpy as np
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.parts import Material
from benchmarks.estate.plan import FloatArray
from scipy.ndimage import gaussian_filter

SIZE_PX = 256


def bark_materials() -> dict[str, Material]:
    """Materials ``bark``, ``pine-bark``, ``birch-bark`` and ``birch-twig``."""
    return {
        "bark": Material(texture=_furrowed((0.27, 0.24, 0.21), (0.46, 0.43, 0.39), 1)),
        "pine-bark": Material(texture=_furrowed((0.30, 0.20, 0.15), (0.58, 0.38, 0.26), 2)),
        "birch-bark": Material(texture=_birch()),
        "birch-twig": Material(rgb=(0.26, 0.19, 0.16)),
    }


def _smooth(rng: np.random.Generator, across: float, along: float) -> FloatArray:
    """Noise that repeats, 0..1, with features of a size in texels."""
    field = gaussian_filter(rng.normal(0, 1, (SIZE_PX, SIZE_PX)), (along, across), mode="wrap")
    return (field - field.min()) / np.ptp(field)


def _furrowed(dark: tuple[float, ...], light: tuple[float, ...], seed: int) -> np.ndarray:
    rng = rng_of(seed, "bark")
    ridges = np.abs(_smooth(rng, 3, 14) - 0.5) * 3.2
    share = np.clip(0.65 * ridges + 0.45 * _smooth(rng, 1, 2), 0, 1)[..., None]
    colour = np.array(dark) * (1 - share) + np.array(light) * share
    return (np.clip(colour, 0, 1) * 255).astype(np.uint8)


def _birch() -> np.ndarray:
    rng = rng_of(3, "bark")
    share = _smooth(rng, 12, 3)[..., None]
    colour = np.array([0.70, 0.69, 0.66]) * (1 - share) + np.array([0.86, 0.85, 0.83]) * share
    marks = np.clip((_smooth(rng, 9, 1.2) - 0.68) * 14, 0, 1)
    plates = np.clip((_smooth(rng, 10, 7) - 0.74) * 16, 0, 1)
    dark = np.maximum(marks * 0.75, plates)[..., None]
    colour = colour * (1 - dark) + np.array([0.13, 0.12, 0.11]) * dark
    return (np.clip(colour, 0, 1) * 255).astype(np.uint8)
