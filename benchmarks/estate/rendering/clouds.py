"""Clouds as they look from the ground: cumulus in a layer, and the texture of a closed sky."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
EARTH_M = 6.371e6
BASE_M = 1400.0
LATTICE = 256


def fractal_noise(points: FloatArray, octaves: int, rng: np.random.Generator) -> FloatArray:
    """Smooth noise of about mean 0.5 in 0..1 at points (..., 2); detail halves per octave."""
    lattice = rng.random((LATTICE, LATTICE))
    total, weight, weights = np.zeros(points.shape[:-1]), 1.0, 0.0
    for octave in range(octaves):
        place = points * 2.03**octave + 37.7 * octave
        corner = np.floor(place)
        share = place - corner
        share = share * share * (3 - 2 * share)
        x, y = (
            (corner.astype(np.int64) % LATTICE)[..., 0],
            (corner.astype(np.int64) % LATTICE)[..., 1],
        )
        right, below = (x + 1) % LATTICE, (y + 1) % LATTICE
        upper = lattice[y, x] * (1 - share[..., 0]) + lattice[y, right] * share[..., 0]
        lower = lattice[below, x] * (1 - share[..., 0]) + lattice[below, right] * share[..., 0]
        total += weight * (upper * (1 - share[..., 1]) + lower * share[..., 1])
        weights += weight
        weight *= 0.52
    return total / weights


def _on_layer(directions: FloatArray, base_m: float) -> tuple[FloatArray, FloatArray]:
    """Where directions meet a layer around the Earth: places (..., 2) and distance, metres."""
    up = np.maximum(directions[..., 2], 0.0)
    distance = np.sqrt((EARTH_M * up) ** 2 + 2 * EARTH_M * base_m + base_m**2) - EARTH_M * up
    return directions[..., :2] * distance[..., None], distance


def sky_with_clouds(
    clear: FloatArray,
    directions: FloatArray,
    sun: FloatArray,
    cloud: float,
    rng: np.random.Generator,
) -> FloatArray:
    """The clear sky (H, W, 3) with cumulus over about the share ``cloud`` of it.

    Clouds are bright where they are thin or turn to the sun and grey where they are thick; far
    ones fade into the haze of the horizon.
    """
    if cloud <= 0:
        return clear
    places, distance = _on_layer(directions, BASE_M)
    places = places / 1900.0 + rng.uniform(0, 200, 2)
    bent = places + 0.35 * np.stack(
        [fractal_noise(places * 1.7, 3, rng), fractal_noise(places * 1.7 + 51, 3, rng)], axis=-1
    )
    seed = rng.integers(2**32)

    def density(at: FloatArray, octaves: int) -> FloatArray:
        return fractal_noise(at, octaves, np.random.default_rng(seed))

    field = density(bent, 7)
    # The noise is about normal around 0.5 with a deviation of 0.13: its quantile is the threshold.
    near = directions[..., 2] > 0.15
    threshold = np.quantile(field[near], 1 - np.clip(cloud, 0.02, 0.98))
    thick = np.clip((field - threshold) / 0.16, 0, 1)
    edge = 0.045 + 0.08 * cloud  # where there are many they hang together, with soft edges
    cover = np.clip((field - threshold) / edge, 0, 1)
    cover = cover * cover * (3 - 2 * cover)
    towards = sun[:2] / max(np.linalg.norm(sun[:2]), 1e-6)
    behind = np.clip((density(bent + 0.22 * towards, 5) - threshold) / 0.2, 0, 1)
    cosine = directions @ sun
    white = np.quantile(clear[near] @ [0.2126, 0.7152, 0.0722], 0.5) * 3.4
    lit = np.exp(-1.1 * thick) * np.exp(-0.8 * behind) * (1 + 0.5 * np.clip(cosine, 0, 1) ** 8)
    base = 0.42 + 0.10 * (1 - thick)
    grey = np.array([0.93, 0.97, 1.04])
    warm = np.array([1.03, 1.0, 0.95])
    colour = white * (base[..., None] * grey + 0.62 * lit[..., None] * warm)
    haze = np.exp(-distance / 28_000.0)[..., None]
    horizon = clear * 0.85 + 0.15 * white
    colour = colour * haze + horizon * (1 - haze)
    return clear * (1 - cover[..., None]) + colour * cover[..., None]


def overcast_texture(directions: FloatArray, rng: np.random.Generator) -> FloatArray:
    """(H, W, 1) factor of mean 1: the soft structure of a closed cloud cover."""
    places, distance = _on_layer(directions, 900.0)
    places = places / 2600.0 + rng.uniform(0, 200, 2)
    bent = places + 0.8 * fractal_noise(places * 0.8, 3, rng)[..., None]
    structure = fractal_noise(bent * np.array([1.0, 1.6]), 6, rng) - 0.5
    return (1 + 1.1 * structure * np.exp(-distance / 15_000.0))[..., None]
