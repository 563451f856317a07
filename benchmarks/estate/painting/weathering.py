"""What rain, dirt, algae and rust leave on a wall: streaks, stains and sheltered places.

Everything is drawn on coarse pixels (2 cm): stains are soft.
"""

from __future__ import annotations

import numpy as np
from benchmarks.estate.painting.noise import Field
from benchmarks.estate.painting.sheet import Sheet, smooth
from benchmarks.estate.plan import Balcony, Ornament, Rgb, Wall

ALGAE: Rgb = (0.30, 0.33, 0.25)
SOOT: Rgb = (0.22, 0.21, 0.20)
RUST: Rgb = (0.42, 0.27, 0.17)
SALT: Rgb = (0.80, 0.79, 0.76)
SPLASH: Rgb = (0.36, 0.33, 0.29)


class Stains:
    """Stains upon stains as one step: the painted wall becomes ``keep`` x wall + ``add``."""

    def __init__(self, sheet: Sheet) -> None:
        self.sheet = sheet
        shape = (sheet.height_px, sheet.width_px)
        self.keep = np.ones(shape, np.float32)
        self.add = np.zeros((*shape, 3), np.float32)

    def cover(self, share: Field, rgb: Rgb) -> None:
        """Cover a share (H, W) in 0..1 of the surface with a colour."""
        share = np.clip(share, 0.0, 0.9)
        self.keep *= 1 - share
        self.add *= (1 - share)[..., None]
        self.add += share[..., None] * np.array(rgb, np.float32)

    def shade(self, factor: Field) -> None:
        """Multiply the surface (1 = unchanged)."""
        self.keep *= factor
        self.add *= factor[..., None]

    def laid_on(self, picture: Field, sheet: Sheet) -> None:
        """Change the picture (H, W, 3) in place."""
        picture *= sheet.fitted(self.keep)[..., None]
        picture += sheet.fitted(self.add)


def weathered(wall: Wall, sheet: Sheet, rng: np.random.Generator) -> Stains:
    """All stains of a wall; their strength grows with ``wall.finish.weathering``."""
    stains = Stains(sheet.coarser(0.02))
    coarse = stains.sheet
    age = wall.finish.weathering
    if age <= 0:
        return stains
    patchy = np.clip(0.75 + 0.5 * coarse.soft_clouds((0.9, 0.7), 3, rng), 0.0, 1.8)
    runs = _runs(coarse, rng)
    dark, dirt = _sources(wall, coarse, rng)
    top = _from_above(coarse, wall.height_m, 0.9, 0.45)
    dark += np.float32(rng.uniform(0.1, 0.6)) * top
    stains.shade(1 + np.float32(0.018 * (1 + age)) * coarse.soft_clouds((2.5, 1.2), 4, rng))
    stains.shade(1 - np.minimum(np.float32(0.30 * age) * dark * runs * patchy, 0.55))
    stains.cover(np.float32(0.20 * age) * dirt * patchy, SOOT)
    stains.cover(np.float32(0.10 * age) * _from_above(coarse, wall.height_m, 0.35, 1.0), SOOT)
    if wall.finish.kind == "brick":
        stains.cover(_salt(wall, coarse, rng) * np.float32(0.45 * age), SALT)
    _foot(wall, stains, patchy, rng)
    _pipes(wall, stains, rng)
    _rust(wall, stains, runs, rng)
    return stains


def _runs(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Where water runs down (H, W), about 0..1.6: narrow upright threads of several widths."""
    fine = sheet.clouds((1.6, 0.035), 1, rng)
    broad = sheet.clouds((2.4, 0.14), 2, rng)
    return np.clip(0.35 + 0.45 * broad + 0.30 * fine, 0.0, 1.6)


def _from_above(sheet: Sheet, y_m: float, reach_m: float, power: float) -> Field:
    """1 at a height, fading to 0 below it; (H, 1)."""
    depth = np.maximum(y_m - sheet.y_m, 0) / np.float32(reach_m)
    return (np.exp(-(depth**power)) * (sheet.y_m <= y_m))[:, None].astype(np.float32)


def _pour(
    field: Field,
    sheet: Sheet,
    x0_m: float,
    x1_m: float,
    y_m: float,
    length_m: float,
    strength: float,
    soft_m: float = 0.02,
) -> None:
    """Add a strength below a level edge from x0 to x1 that fades over a length."""
    rows, columns = sheet.box(x0_m - 2 * soft_m, y_m - 3.5 * length_m, x1_m + 2 * soft_m, y_m)
    x_m, y = sheet.x_m[columns], sheet.y_m[rows]
    across = smooth(x0_m - 2 * soft_m, x0_m + soft_m, x_m)
    across *= smooth(x1_m + 2 * soft_m, x1_m - soft_m, x_m)
    down = np.exp((y - np.float32(y_m)) / np.float32(length_m))
    start = smooth(0.0, 1.0, (np.float32(y_m) - y) / np.float32(soft_m * 2))
    field[rows, columns] += np.float32(strength) * (down * start)[:, None] * across[None, :]


def _sources(wall: Wall, sheet: Sheet, rng: np.random.Generator) -> tuple[Field, Field]:
    """How much dirty water starts above each place (H, W), and how much dust is never washed."""
    dark = np.full((sheet.height_px, sheet.width_px), 0.16, np.float32)
    dirt = np.zeros_like(dark)
    for opening in wall.openings:
        if opening.depth_m > 0:
            continue
        x0, x1, y = opening.x_m, opening.x_m + opening.width_m, opening.y_m
        reach = rng.uniform(0.3, 1.3)
        out = opening.style.sill_m
        if y > wall.plinth_m + 0.2:
            for end in (x0 - out / 2, x1 + out / 2):
                strength = 1.7 * rng.random() ** 2  # few ends leak much
                _pour(dark, sheet, end - 0.05, end + 0.05, y, reach * strength, strength, 0.03)
            _pour(dark, sheet, x0, x1, y, reach * 0.7, rng.uniform(0.1, 0.6))
            _pour(dirt, sheet, x0, x1, y, 0.05 + out, 0.5)
        head = y + opening.height_m
        rows, columns = sheet.box(x0, head, x1, head + 0.12)
        dark[rows, columns] += np.float32(0.25)
    for balcony in wall.balconies:
        _balcony(balcony, wall, sheet, dark, dirt, rng)
    for ornament in wall.ornaments:
        if ornament.kind == "box" and ornament.out_m > 0.03 and ornament.width_m > 0.3:
            x0, x1 = ornament.x_m, ornament.x_m + ornament.width_m
            _pour(dirt, sheet, x0, x1, ornament.y_m, 0.12, 0.6)
            for end in (x0, x1):
                _pour(dark, sheet, end - 0.05, end + 0.05, ornament.y_m, 0.5, 0.8, 0.03)
    return dark, dirt


def _balcony(
    balcony: Balcony,
    wall: Wall,
    sheet: Sheet,
    dark: Field,
    dirt: Field,
    rng: np.random.Generator,
) -> None:
    """Wet marks beside a slab's ends, and a sheltered, dusty place below it."""
    if balcony.kind == "french":
        return
    x0, x1 = balcony.x_m, balcony.x_m + balcony.width_m
    foot = balcony.y_m - balcony.slab_m
    for end in (x0, x1):
        strength = rng.uniform(0.3, 1.5)
        reach = rng.uniform(0.5, 1.6)
        _pour(dark, sheet, end - 0.10, end + 0.10, balcony.y_m + 0.08, reach, strength, 0.05)
    if balcony.kind == "loggia":
        rows, columns = sheet.box(x0, balcony.y_m, x1, balcony.y_m + balcony.clear_m)
        dark[rows, columns] *= np.float32(0.1)  # its back wall stays dry
        _pour(dark, sheet, x0, x1, balcony.y_m, 0.6, rng.uniform(0.2, 0.7))
        return
    rows, columns = sheet.box(x0 + 0.1, foot - 1.6, x1 - 0.1, foot)
    dark[rows, columns] *= smooth(foot - 1.6, foot - 0.6, -sheet.y_m[rows] + 2 * foot - 1.6)[
        :, None
    ] * np.float32(0.7) + np.float32(0.3)
    _pour(dirt, sheet, x0, x1, foot, 0.25, rng.uniform(0.3, 0.9), 0.05)


def _salt(wall: Wall, sheet: Sheet, rng: np.random.Generator) -> Field:
    """White salts on brick (H, W): blots near the ground, below sills and at the top."""
    damp = np.float32(0.25) + np.exp(-sheet.y_m / np.float32(0.8))[:, None]
    damp = damp + np.float32(0.6) * _from_above(sheet, wall.height_m, 0.8, 1.0)
    blots = sheet.soft_clouds((0.5, 0.9), 4, rng) + np.float32(0.7) * damp
    fine = np.clip(0.7 + 0.4 * sheet.grain(rng), 0.0, 1.3)
    return smooth(1.3, 3.0, blots) * fine


def _foot(wall: Wall, stains: Stains, patchy: Field, rng: np.random.Generator) -> None:
    """Splashed soil and algae above the ground."""
    sheet, age = stains.sheet, wall.finish.weathering
    reach = np.float32(rng.uniform(0.18, 0.40))
    low = np.exp(-sheet.y_m / reach)[:, None]
    stains.cover(np.float32(0.15 + 0.35 * age) * low * patchy, SPLASH)
    blots = smooth(-0.2, 1.8, sheet.clouds((0.35, 0.8), 4, rng) + 1.6 * (low - 0.35))
    green = rng.uniform(0.0, 1.0) ** 2
    stains.cover(np.float32(0.55 * age * green) * blots * np.sqrt(low), ALGAE)


def _pipes(wall: Wall, stains: Stains, rng: np.random.Generator) -> None:
    """Algae and damp beside downpipes, most near the ground and at a leaking joint."""
    sheet, age = stains.sheet, wall.finish.weathering
    for pipe in wall.ornaments:
        if not _is_downpipe(pipe):
            continue
        middle = pipe.x_m + pipe.width_m / 2
        beside = np.exp(-np.abs(sheet.x_m - middle) / rng.uniform(0.08, 0.2))[None, :]
        leak = rng.uniform(0.2, 0.9) * pipe.height_m + pipe.y_m
        along = np.exp(-sheet.y_m / np.float32(0.7)) * 0.9 + 0.12
        along += rng.uniform(0.0, 0.5) * np.exp(-np.abs(sheet.y_m - leak) / 0.5)
        uneven = np.clip(0.7 + 0.5 * sheet.soft_clouds((0.4, 0.1), 3, rng), 0, 1.5)
        share = np.float32(0.7 * age) * along[:, None].astype(np.float32) * beside * uneven
        stains.cover(share.astype(np.float32), ALGAE)


def _is_downpipe(ornament: Ornament) -> bool:
    return ornament.kind == "pipe" and ornament.height_m > 2.0


def _rust(wall: Wall, stains: Stains, runs: Field, rng: np.random.Generator) -> None:
    """Thin brown threads below the ends of railings."""
    sheet = stains.sheet
    field = np.zeros((sheet.height_px, sheet.width_px), np.float32)
    for balcony in wall.balconies:
        if balcony.kind not in ("railing", "french"):
            continue
        for end in (balcony.x_m, balcony.x_m + balcony.width_m):
            strength = rng.uniform(-0.6, 1.0)
            reach = rng.uniform(0.15, 0.6)
            level = balcony.y_m + (0.1 if balcony.kind == "french" else -0.05)
            if strength > 0:
                _pour(field, sheet, end - 0.03, end + 0.03, level, reach, strength, 0.015)
    stains.cover(np.float32(0.5 * wall.finish.weathering) * field * runs, RUST)
