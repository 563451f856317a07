"""Textures that repeat: concrete, wood, roofing, ground, bark and cloth, each 2 x 2 m, seamless."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.painting.noise import Field
from benchmarks.estate.painting.sheet import Sheet, covered, smooth
from benchmarks.estate.plan import Rgb
from numpy.typing import NDArray

TILE_M = 2.0  # what a texture covers, both ways
TILE_PX = 640

Painter = Callable[[Sheet, np.random.Generator], Field]
"""Brightness (H, W) about 1, or colours about 1 (H, W, 3), of one tile."""


def tile(name: str, rgb: Rgb, painter: Painter) -> NDArray[np.uint8]:
    """The texture of a surface of a mean colour, (640, 640, 3) uint8 sRGB."""
    field = painter(Sheet(TILE_M, TILE_M, TILE_PX, TILE_PX), rng_of(0, "texture", name))
    if field.ndim == 2:
        field = field[..., None]
    picture = np.clip(field * np.array(rgb, np.float32), 0.03, 0.90)
    return cv2.convertScaleAbs(picture, alpha=255.0)


def concrete(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Cast concrete: clouds, pores, faint streaks."""
    light = 1 + np.float32(0.03) * sheet.clouds(0.7, 4, rng)
    light += np.float32(0.018) * sheet.grain(rng) + np.float32(0.015) * sheet.clouds(0.05, 2, rng)
    light -= np.float32(0.22) * sheet.specks(60.0, 0.004, rng)
    return light - np.float32(0.015) * sheet.clouds((0.8, 0.05), 2, rng)


def plain(sheet: Sheet, rng: np.random.Generator) -> Field:
    """A faintly uneven, slightly dirty coat."""
    return 1 + np.float32(0.012) * sheet.clouds(0.5, 3, rng) + 0.006 * sheet.grain(rng)


def patina(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Weathered zinc: soft blots and run marks."""
    light = 1 + np.float32(0.025) * sheet.clouds(0.35, 4, rng)
    return light + np.float32(0.018) * sheet.clouds((0.9, 0.06), 2, rng)


def spangle(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Galvanised steel: crystals of 1-3 cm in slightly different greys."""
    count = 9000
    xs, ys = rng.integers(0, sheet.width_px, count), rng.integers(0, sheet.height_px, count)
    seeds = np.full((sheet.height_px, sheet.width_px), 255, np.uint8)
    seeds[ys, xs] = 0
    pad = 32
    wide = cv2.copyMakeBorder(seeds, pad, pad, pad, pad, cv2.BORDER_WRAP)
    _, labels = cv2.distanceTransformWithLabels(
        wide, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    names = np.zeros(int(labels.max()) + 1, np.float32)
    tone = rng.uniform(-0.06, 0.06, seeds.shape).astype(np.float32)
    sites = wide == 0
    names[labels[sites]] = cv2.copyMakeBorder(tone, pad, pad, pad, pad, cv2.BORDER_WRAP)[sites]
    return 1 + names[labels][pad:-pad, pad:-pad] + 0.02 * sheet.clouds(0.4, 3, rng)


def boards(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Upright boards of 125 mm with grain and dark seams."""
    starts = np.arange(17) * 0.125
    light = 1 - np.float32(0.35) * covered(starts, starts + 0.007, sheet.x_edges_m)[None, :]
    tone = rng.uniform(-0.06, 0.06, 16).astype(np.float32)
    light = light + tone[np.minimum((sheet.x_m / 0.125).astype(int), 15)][None, :]
    return light + np.float32(0.05) * sheet.clouds((0.5, 0.008), 2, rng)


def timber(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Varnished wood: long upright grain."""
    light = 1 + np.float32(0.06) * sheet.clouds((1.2, 0.02), 2, rng)
    return light + np.float32(0.03) * sheet.clouds((0.3, 0.006), 1, rng)


def felt(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Bitumen felt in strips of 1 m, gritty, with dried puddles."""
    light = 1 + np.float32(0.08) * sheet.grain(rng) + np.float32(0.05) * sheet.clouds(0.6, 4, rng)
    seams = np.array([0.0, 1.0])
    return light - np.float32(0.3) * covered(seams, seams + 0.012, sheet.y_edges_m)[:, None]


def roof_tiles(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Pantiles of 0.20 x 0.333 m: a wave across, a shadow under each course."""
    columns, rows = 10, 6
    across, up = sheet.x_m / TILE_M * columns, sheet.y_m / TILE_M * rows
    tone = 1 + rng.uniform(-0.12, 0.12, (rows, columns)).astype(np.float32)
    light = tone[up.astype(int)][:, across.astype(int)]
    wave = 0.85 + 0.15 * np.sin(2 * np.pi * (across % 1.0) + 0.6)
    step = 1 - np.float32(0.45) * smooth(0.12, 0.02, up % 1.0)
    light *= (1.25 * wave[None, :] * step[:, None]).astype(np.float32)
    moss = smooth(0.6, 3.0, sheet.clouds(0.4, 6, rng, 0.8))
    return light * (1 + np.float32(0.04) * sheet.grain(rng)) * (1 - np.float32(0.25) * moss)


def seamed(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Sheet metal with standing seams every 0.5 m."""
    seams = np.arange(4) * 0.5
    light = 1 - np.float32(0.35) * covered(seams, seams + 0.012, sheet.x_edges_m)
    light += np.float32(0.10) * covered(seams + 0.012, seams + 0.024, sheet.x_edges_m)
    return light[None, :] + np.float32(0.02) * sheet.clouds((1.0, 0.12), 3, rng)


def asphalt(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Worn asphalt: stones of 4-11 mm, pale and dark, soft blots."""
    light = 1 + np.float32(0.07) * sheet.grain(rng) + np.float32(0.06) * sheet.clouds(0.02, 1, rng)
    light += np.float32(0.25) * sheet.specks(900.0, 0.003, rng)
    light -= np.float32(0.12) * sheet.specks(500.0, 0.004, rng)
    return light + np.float32(0.025) * sheet.clouds(0.7, 4, rng)


def slabs(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Concrete slabs 0.40 m square with dirty joints."""
    joints = np.arange(6) * 0.4
    seam_x = covered(joints, joints + 0.008, sheet.x_edges_m)[None, :]
    seam_y = covered(joints, joints + 0.008, sheet.y_edges_m)[:, None]
    column = np.minimum((sheet.x_m / 0.4).astype(int), 4)
    row = np.minimum((sheet.y_m / 0.4).astype(int), 4)
    tone = 1 + rng.uniform(-0.05, 0.05, (5, 5)).astype(np.float32)
    light = tone[row][:, column] * concrete(sheet, rng)
    return light * (1 - np.float32(0.45) * np.maximum(seam_x, seam_y))


def gravel(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Loose stones of 8-25 mm."""
    light = 1 + np.float32(0.13) * sheet.clouds(0.02, 2, rng)
    light += np.float32(0.10) * sheet.clouds(0.008, 1, rng)
    return light + np.float32(0.04) * sheet.clouds(0.5, 3, rng)


def soil(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Bare earth: crumbs, litter, damp places."""
    light = 1 + np.float32(0.12) * sheet.clouds(0.5, 7, rng, 0.9)
    return light + np.float32(0.5) * sheet.specks(60.0, 0.006, rng)


def grass(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Lawn (H, W, 3): blades, tufts of several greens, dry spots."""
    light = 1 + np.float32(0.16) * sheet.clouds(0.012, 1, rng)
    light += np.float32(0.10) * sheet.clouds(0.05, 2, rng)
    light += np.float32(0.05) * sheet.clouds(0.6, 3, rng)
    dry = np.float32(0.035) * sheet.clouds(0.25, 5, rng)
    return np.stack([light + dry, light, light - np.float32(0.6) * dry], axis=-1)


def bark(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Furrowed bark."""
    furrow = smooth(-0.3, 1.2, sheet.clouds((0.16, 0.03), 3, rng, 0.7))
    return 1.12 - np.float32(0.45) * furrow + np.float32(0.05) * sheet.grain(rng)


def birch_bark(sheet: Sheet, rng: np.random.Generator) -> Field:
    """White bark with dark level slits and black scars."""
    slits = smooth(1.4, 2.2, sheet.clouds((0.012, 0.06), 2, rng))
    scars = smooth(1.7, 2.2, sheet.clouds((0.12, 0.14), 3, rng))
    light = 1 + np.float32(0.05) * sheet.clouds((0.2, 0.1), 4, rng)
    return light * (1 - np.float32(0.55) * slits) * (1 - np.float32(0.75) * scars)


def cloth(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Hanging cloth: soft upright folds of 6-12 cm and a little weave."""
    folds = sheet.clouds((4.0, 0.09), 2, rng)
    broad = sheet.clouds((4.0, 0.3), 1, rng)
    light = 0.92 + np.float32(0.07) * np.tanh(folds) + np.float32(0.03) * broad
    return light + np.float32(0.008) * sheet.grain(rng)


def slats(sheet: Sheet, rng: np.random.Generator) -> Field:
    """A venetian blind of 25 mm slats, a few of them crooked."""
    phase = np.mod(sheet.y_m, np.float32(0.025)) / np.float32(0.025)
    shade = 0.72 + 0.28 * np.sin(np.pi * (0.1 + 0.8 * phase))
    tone = 1 + rng.uniform(-0.03, 0.03, 80)
    light = shade * tone[np.minimum((sheet.y_m / 0.025).astype(int), 79)]
    return np.repeat(light[:, None], sheet.width_px, axis=1).astype(np.float32)
