"""Materials of a house beyond the fixed ones: curtains, blinds, rooms, roofings."""

from __future__ import annotations

import numpy as np
from benchmarks.estate.materials import FIXED, painted
from benchmarks.estate.parts import Material, Parts
from benchmarks.estate.plan import Rgb, rng_of
from numpy.typing import NDArray


def _hex(rgb: Rgb) -> str:
    return "".join(f"{round(255 * min(max(value, 0.0), 1.0)):02x}" for value in rgb)


def _kept(parts: Parts, name: str, material: Material) -> str:
    parts.materials.setdefault(name, material)
    return name


def paint(parts: Parts, rgb: Rgb) -> str:
    """Name of glossy paint of a colour, which the parts then hold."""
    return _kept(parts, *painted(rgb))


def fixed(parts: Parts, name: str) -> str:
    """Name of a fixed material, which the parts then hold."""
    return _kept(parts, name, FIXED[name])


def matt(parts: Parts, rgb: Rgb) -> str:
    """Name of a matt surface of a colour: wallpaper, cloth, render."""
    return _kept(parts, f"matt-{_hex(rgb)}", Material("diffuse", rgb))


def glow(parts: Parts, rgb: Rgb, strength: float) -> str:
    """Name of a lamp's light; ``strength`` is 0..1."""
    level = round(8 * strength) / 8
    colour = tuple(level * value for value in rgb)
    return _kept(parts, f"glow-{_hex(colour)}", Material("light", colour))  # type: ignore[arg-type]


def slats(parts: Parts, rgb: Rgb) -> str:
    """Name of a venetian blind of 25 mm slats; `TILE_M` holds 80 of them."""
    across = np.linspace(0.0, 1.0, 12, endpoint=False)
    shade = 0.62 + 0.38 * np.sin(np.pi * (0.15 + 0.8 * across))
    shade[-1] = 0.30
    column = np.tile(shade, 80)[:, None, None] * np.asarray(rgb) * 255
    texture = np.repeat(column, 4, axis=1).round().astype(np.uint8)
    return _kept(parts, f"slats-{_hex(rgb)}", Material("diffuse", rgb, texture))


def _tiles(rgb: Rgb, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Pantiles of 0.2 x 0.333 m over one `TILE_M`: a wave across, a step at every course."""
    size = 400
    columns, rows = 10, 6
    x = (np.arange(size) + 0.5) / size * columns
    y = (size - 0.5 - np.arange(size)) / size * rows
    tint = rng.normal(1.0, 0.07, (rows, columns))
    shade = tint[y.astype(int)[:, None], x.astype(int)[None]]
    wave = 0.80 + 0.20 * np.sin(2 * np.pi * (x % 1.0) + 0.6)
    course = np.where(y % 1.0 < 0.10, 0.55, 0.92 + 0.08 * (y % 1.0))
    grain = rng.normal(1.0, 0.03, (size, size))
    value = shade * grain * wave[None] * course[:, None]
    return (255 * np.clip(value[..., None] * np.asarray(rgb), 0, 1)).astype(np.uint8)


def _felt(rgb: Rgb, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Bitumen felt in strips of 1 m with grit and a few paler strips."""
    size = 400
    strip = np.repeat(rng.normal(1.0, 0.06, 2), size // 2)
    grit = rng.normal(1.0, 0.08, (size, size))
    value = grit * strip[:, None]
    value[:: size // 2] *= 0.6
    value[1 :: size // 2] *= 0.7
    return (255 * np.clip(value[..., None] * np.asarray(rgb), 0, 1)).astype(np.uint8)


def _seamed(rgb: Rgb, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Sheet metal with standing seams every 0.5 m."""
    size = 400
    value = rng.normal(1.0, 0.015, (size, 1)) * np.repeat(rng.normal(1.0, 0.03, 4), 100)[None]
    for seam in range(0, size, 100):
        value[:, seam : seam + 3] *= 1.25
        value[:, seam + 3 : seam + 8] *= 0.55
    return (255 * np.clip(value[..., None] * np.asarray(rgb), 0, 1)).astype(np.uint8)


def roofing(parts: Parts, kind: str, rgb: Rgb) -> str:
    """Name of a roof's cover: ``tiles``, ``felt`` or ``seamed``; its texture covers `TILE_M`."""
    painters = {"tiles": _tiles, "felt": _felt, "seamed": _seamed}
    name = f"{kind}-{_hex(rgb)}"
    texture = painters[kind](rgb, rng_of(0, "roofing", kind))
    return _kept(parts, name, Material("diffuse", rgb, texture))
