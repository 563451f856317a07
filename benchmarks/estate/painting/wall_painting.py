"""The unique albedo of a whole wall: its skin, its plinth and what the weather did to them."""

from __future__ import annotations

import cv2
import numpy as np
from benchmarks.estate.painting.brickwork import brick
from benchmarks.estate.painting.claddings import boards, metal, stone, tiles
from benchmarks.estate.painting.noise import Field
from benchmarks.estate.painting.panelwork import panel
from benchmarks.estate.painting.plasterwork import plaster
from benchmarks.estate.painting.sheet import Sheet, covered, smooth
from benchmarks.estate.painting.weathering import weathered
from benchmarks.estate.plan import Wall
from numpy.typing import NDArray

# Albedo of real matt surfaces, sRGB: nothing is blacker than soot or whiter than fresh paint.
DARKEST, BRIGHTEST = 0.10, 0.85
COARSEST_M = 0.03  # bricks and joints alias above it


def paint_wall(
    wall: Wall, width_px: int, height_px: int, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """Albedo of a wall (height_px, width_px, 3) uint8 sRGB, row 0 on top.

    The picture covers the wall's width and height; openings, balconies and ornaments leave their
    stains but are not drawn. Values stay within ``DARKEST`` and ``BRIGHTEST``.
    """
    sheet = Sheet(wall.width_m, wall.height_m, width_px, height_px)
    factor = int(np.ceil(sheet.m_per_px / COARSEST_M - 1e-6))
    if factor > 1:
        picture = _painted(
            wall, Sheet(wall.width_m, wall.height_m, width_px * factor, height_px * factor), rng
        )
        picture = cv2.resize(picture, (width_px, height_px), interpolation=cv2.INTER_AREA)
    else:
        picture = _painted(wall, sheet, rng)
    np.clip(picture, DARKEST, BRIGHTEST, out=picture)
    return cv2.convertScaleAbs(picture, alpha=255.0)


def _painted(wall: Wall, sheet: Sheet, rng: np.random.Generator) -> Field:
    finish = wall.finish
    match finish.kind:
        case "brick":
            picture = brick(sheet, finish, wall.openings, rng)
        case "plaster":
            picture = plaster(sheet, finish, wall.openings, rng)
        case "panel":
            picture = panel(sheet, finish, wall.openings, wall.plinth_m, rng)
        case "boards":
            picture = boards(sheet, finish, rng)
        case "stone":
            picture = stone(sheet, finish, rng)
        case "metal":
            picture = metal(sheet, finish, rng)
        case "tiles":
            picture = tiles(sheet, finish, rng)
    if wall.plinth_m > 0:
        _plinth(picture, wall, sheet, rng)
    weathered(wall, sheet, rng).laid_on(picture, sheet)
    return picture


def _plinth(picture: Field, wall: Wall, sheet: Sheet, rng: np.random.Generator) -> None:
    """Paint the plinth: concrete in its own colour below an edge that is not quite sharp."""
    top = min(wall.plinth_m + 0.06, sheet.height_m)
    rows, columns = sheet.box(0.0, 0.0, sheet.width_m, top)
    if rows.stop - rows.start < 2:
        return
    strip = Sheet(
        sheet.width_m,
        (rows.stop - rows.start) * sheet.height_m / sheet.height_px,
        sheet.width_px,
        rows.stop - rows.start,
    )
    light = 1 + np.float32(0.025) * strip.soft_clouds((0.4, 1.0), 4, rng)
    light += np.float32(0.03) * strip.grain(rng) + np.float32(0.012) * strip.clouds(0.05, 2, rng)
    light -= np.float32(0.25) * strip.specks(20.0, 0.007, rng)
    seams = np.arange(1, int(strip.height_m / 0.15) + 1) * 0.15
    light -= np.float32(0.06) * covered(seams, seams + 0.008, strip.y_edges_m)[:, None]
    ragged = np.float32(wall.plinth_m) + np.float32(0.0015) * strip.clouds((9.0, 0.25), 3, rng)
    inside = smooth(0.012, -0.012, strip.y_m[:, None] - ragged)
    shadow = np.exp(-np.abs(strip.y_m - wall.plinth_m) / np.float32(0.012))[:, None]
    light *= 1 - np.float32(0.18) * shadow
    below = light[..., None] * np.array(wall.plinth_rgb, np.float32)
    area = picture[rows, columns]
    area += (below - area) * inside[..., None]
