"""Random patterns that repeat seamlessly: single octaves, clouds and specks, float32."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float32]


def stretched(
    lattice: Field, height_px: int, width_px: int, start: tuple[float, float] = (0.0, 0.0)
) -> Field:
    """The lattice drawn out smoothly to (height_px, width_px); opposite borders fit together.

    ``start`` (row, column) is the place on the lattice where it begins, in cells.
    """
    rows, columns = lattice.shape[:2]
    scale_x, scale_y = columns / width_px, rows / height_px
    source = np.array(
        [
            [scale_x, 0.0, 0.5 * scale_x - 0.5 + start[1]],
            [0.0, scale_y, 0.5 * scale_y - 0.5 + start[0]],
        ],
        np.float64,
    )
    return cv2.warpAffine(
        lattice,
        source,
        (width_px, height_px),
        flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_WRAP,
    )


def octave(
    height_px: int, width_px: int, cell_px: tuple[float, float], rng: np.random.Generator
) -> Field:
    """Smooth noise about zero, deviation 1 on its lattice, cells (rows, columns) in pixels."""
    rows = max(2, round(height_px / max(cell_px[0], 1.0)))
    columns = max(2, round(width_px / max(cell_px[1], 1.0)))
    lattice = (rng.random((rows, columns), dtype=np.float32) - np.float32(0.5)) * np.float32(3.46)
    if (rows, columns) == (height_px, width_px):
        return lattice
    start = rng.random(2)  # so that the nodes of octaves do not lie upon one another
    return stretched(lattice, height_px, width_px, (float(start[0]), float(start[1])))


def clouds(
    height_px: int,
    width_px: int,
    cell_px: tuple[float, float],
    octaves: int,
    rng: np.random.Generator,
    gain: float = 0.5,
) -> Field:
    """Octaves of noise about zero, each half the size and ``gain`` the strength of the last.

    The deviation is about 1. Octaves below a pixel are left out.
    """
    total = np.zeros((height_px, width_px), np.float32)
    power, strength = 0.0, 1.0
    for index in range(octaves):
        cell = (cell_px[0] / 2**index, cell_px[1] / 2**index)
        if index and max(cell) < 1.0:
            break
        layer = octave(height_px, width_px, cell, rng)
        cv2.scaleAdd(layer, strength, total, total)
        power += strength**2
        strength *= gain
    total *= np.float32(1.4 / power**0.5)
    return total


def specks(
    height_px: int,
    width_px: int,
    share: float,
    radius_px: float,
    rng: np.random.Generator,
) -> Field:
    """Single soft spots in 0..1, their centres on ``share`` of the pixels."""
    field = np.zeros((height_px, width_px), np.float32)
    count = round(share * height_px * width_px)
    rows = rng.integers(0, height_px, count)
    columns = rng.integers(0, width_px, count)
    field[rows, columns] = rng.random(count, dtype=np.float32)
    if radius_px < 0.5:
        return field
    pad = int(3 * radius_px) + 1
    wide = cv2.copyMakeBorder(field, pad, pad, pad, pad, cv2.BORDER_WRAP)
    wide = cv2.GaussianBlur(wide, (0, 0), radius_px)
    soft = wide[pad : pad + height_px, pad : pad + width_px]
    return np.minimum(soft * np.float32(2 * np.pi * radius_px**2), np.float32(1.0))
