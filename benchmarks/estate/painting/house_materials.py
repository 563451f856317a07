"""Materials of a house beyond the fixed ones: curtains, blinds, rooms, roofings."""

from __future__ import annotations

from functools import cache
from typing import Literal

import numpy as np
from benchmarks.estate.painting import textures
from benchmarks.estate.painting.materials import FIXED, painted
from benchmarks.estate.painting.noise import Field
from benchmarks.estate.painting.sheet import Sheet
from benchmarks.estate.painting.textures import Painter, tile
from benchmarks.estate.parts import Material, Parts
from benchmarks.estate.plan import Rgb

from si3fp.errors import InputError

CoverKind = Literal["slats", "roof_tiles", "felt", "sheet_roof", "weathered_coat"]


def _weathered_coat(sheet: Sheet, rng: np.random.Generator) -> Field:
    """Paint that has hung outside for years: faint runs and blots."""
    light = 1 + np.float32(0.02) * sheet.clouds(0.6, 4, rng)
    return light + np.float32(0.02) * sheet.clouds((0.9, 0.05), 3, rng)


_COVERS: dict[CoverKind, tuple[Painter, bool]] = {
    "slats": (textures.slats, False),
    "roof_tiles": (textures.roof_tiles, False),
    "felt": (textures.felt, False),
    "sheet_roof": (textures.seamed, True),
    "weathered_coat": (_weathered_coat, True),
}


def _hex(rgb: Rgb) -> str:
    return "".join(f"{round(255 * min(max(value, 0.0), 1.0)):02x}" for value in rgb)


def _kept(parts: Parts, name: str, material: Material) -> str:
    parts.materials.setdefault(name, material)
    return name


def paint(parts: Parts, rgb: Rgb) -> str:
    """Name of glossy paint of a colour, which the parts then hold."""
    return _kept(parts, *painted(rgb))


def fixed(parts: Parts, name: str) -> str:
    """Name of a fixed material, which the parts then hold.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name not in FIXED:
        raise InputError(f"No fixed material is called {name!r}; there are {', '.join(FIXED)}.")
    return _kept(parts, name, FIXED[name])


def matt(parts: Parts, rgb: Rgb) -> str:
    """Name of a matt surface of a colour: wallpaper, cloth, render."""
    return _kept(parts, f"matt-{_hex(rgb)}", Material("diffuse", rgb))


def glow(parts: Parts, rgb: Rgb, strength: float) -> str:
    """Name of a lamp's light; ``strength`` is 0..1."""
    level = round(8 * strength) / 8
    colour = tuple(level * value for value in rgb)
    return _kept(parts, f"glow-{_hex(colour)}", Material("light", colour))  # type: ignore[arg-type]


def covered_with(parts: Parts, kind: CoverKind, rgb: Rgb) -> str:
    """Name of a texture of a mean colour that repeats; colours are rounded to spare painting."""
    near = tuple(round(32 * value) / 32 for value in rgb)
    name = f"{kind}-{_hex(near)}"  # type: ignore[arg-type]
    return _kept(parts, name, _cover(kind, near))  # type: ignore[arg-type]


@cache
def _cover(kind: CoverKind, rgb: Rgb) -> Material:
    painter, glossy = _COVERS[kind]
    return Material("plastic" if glossy else "diffuse", rgb, tile(kind, rgb, painter), 0.35)
