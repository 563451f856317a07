"""Painted facades: the wall with its openings, and the windows that lie behind them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from tests.scenes import textures
from tests.scenes.textures import Picture

Style = Literal["brick", "plaster", "panel"]


@dataclass(frozen=True)
class Opening:
    """A rectangle in the wall, metres from the facade's lower left corner."""

    x_m: float
    y_m: float
    width_m: float
    height_m: float
    kind: Literal["window", "door"] = "window"


@dataclass(frozen=True)
class Look:
    """What a building looks like."""

    style: Style
    colour: tuple[float, float, float]
    frame: tuple[float, float, float]
    surround: tuple[float, float, float] | None
    surround_m: float
    transom: bool
    recess_m: float


@dataclass(frozen=True)
class PaintedFacade:
    """Pictures of one facade at ``m_per_px``, row 0 on top.

    ``wall`` (H, W, 3) uint8; ``behind`` (H, W, 4) uint8 at the depth of the recess, alpha = share
    of glass; ``opening_id`` (H, W) uint8, 0 = wall, i + 1 = opening i.
    """

    wall: NDArray[np.uint8]
    behind: NDArray[np.uint8]
    opening_id: NDArray[np.uint8]
    openings: tuple[Opening, ...]
    recess_m: float
    m_per_px: float


def _box(
    opening: Opening, shape: tuple[int, int], m_per_px: float, grow_m: float = 0.0
) -> tuple[slice, slice]:
    """Rows and columns of an opening, clipped to the picture."""
    top = shape[0] - round((opening.y_m + opening.height_m + grow_m) / m_per_px)
    bottom = shape[0] - round((opening.y_m - grow_m) / m_per_px)
    left = round((opening.x_m - grow_m) / m_per_px)
    right = round((opening.x_m + opening.width_m + grow_m) / m_per_px)
    return slice(max(top, 0), max(bottom, 0)), slice(max(left, 0), max(right, 0))


def _paint_wall(
    width_m: float,
    height_m: float,
    openings: tuple[Opening, ...],
    look: Look,
    storey_m: float,
    m_per_px: float,
    rng: np.random.Generator,
) -> Picture:
    shape = (round(height_m / m_per_px), round(width_m / m_per_px))
    if look.style == "brick":
        wall = textures.brick(shape, m_per_px, rng, look.colour)
    elif look.style == "panel":
        wall = textures.panels(shape, m_per_px, rng, look.colour, (3.0, storey_m))
    else:
        wall = textures.plaster(shape, m_per_px, rng, look.colour)
    plinth = round(0.7 / m_per_px)
    wall[-plinth:] = textures.stone((plinth, shape[1]), m_per_px, rng)
    wall[-plinth - max(1, round(0.03 / m_per_px)) : -plinth] *= 1.15
    if look.style == "plaster":  # string course above the ground floor
        row = shape[0] - round((storey_m + 0.55) / m_per_px)
        band = round(0.18 / m_per_px)
        wall[row - band : row] = 0.5 * wall[row - band : row] + 0.5 * np.array([214, 206, 190])
        wall[row : row + max(1, round(0.05 / m_per_px))] *= 0.62
    dirt = np.exp(-np.arange(shape[0])[::-1] * m_per_px / 1.2)[:, None, None]
    wall *= 1 - 0.14 * dirt * (1 + 0.5 * textures.noise(shape, rng, 0.5 / m_per_px)[..., None])
    eaves = np.exp(-np.arange(shape[0]) * m_per_px / 0.5)[:, None, None]
    wall *= 1 - 0.45 * eaves  # ambient shadow below the eaves
    for opening in openings:
        _paint_surround(wall, opening, look, m_per_px, rng)
    for x_m in (0.35, width_m - 0.45):
        _paint_downpipe(wall, x_m, m_per_px)
    return wall


def _paint_surround(
    wall: Picture, opening: Opening, look: Look, m_per_px: float, rng: np.random.Generator
) -> None:
    shape = (wall.shape[0], wall.shape[1])
    if look.surround is not None:
        rows, columns = _box(opening, shape, m_per_px, look.surround_m)
        old = wall[rows, columns]
        grain = 1 + 0.03 * textures.noise((old.shape[0], old.shape[1]), rng, 0.08 / m_per_px, 3)
        wall[rows, columns] = np.array(look.surround, np.float32) * grain[..., None]
        edge = max(1, round(0.015 / m_per_px))
        wall[rows.stop : rows.stop + edge, columns] *= 0.7
        wall[rows, columns.stop : columns.stop + edge] *= 0.8
    if opening.kind == "door":
        return
    rows, columns = _box(opening, shape, m_per_px)
    reach = round(0.06 / m_per_px)
    sill = slice(rows.stop, rows.stop + max(1, round(0.05 / m_per_px)))
    sides = slice(max(columns.start - reach, 0), columns.stop + reach)
    below = wall[sill.stop : sill.stop + round(0.9 / m_per_px), sides]
    fall = np.exp(-np.arange(below.shape[0]) * m_per_px / 0.07)[:, None, None]
    streak = textures.noise((1, below.shape[1]), rng, 0.10 / m_per_px, 3)
    run = np.exp(-np.arange(below.shape[0]) * m_per_px / 0.45)[:, None]
    below *= 1 - 0.4 * fall
    below *= 1 - (0.10 * np.clip(streak, 0, 2) * run)[..., None]
    metal = np.array([150, 152, 154], np.float32) if look.style != "brick" else None
    wall[sill, sides] = (168, 160, 150) if metal is None else metal
    wall[sill.start : sill.start + 1, sides] = 200


def _paint_downpipe(wall: Picture, x_m: float, m_per_px: float) -> None:
    left, right = round(x_m / m_per_px), round((x_m + 0.10) / m_per_px)
    across = np.linspace(-1, 1, max(right - left, 1), dtype=np.float32)
    shade = 70 + 75 * np.sqrt(np.clip(1 - across**2, 0, 1)) - 25 * across
    shadow = round(0.06 / m_per_px)
    wall[:, right : right + shadow] *= 0.72
    wall[:, left:right] = shade[None, :, None] * np.array([0.96, 0.98, 1.0], np.float32)
    for row in range(0, wall.shape[0], max(1, round(2.0 / m_per_px))):
        wall[row : row + max(1, round(0.03 / m_per_px)), left:right] *= 0.6


def _paint_interior(shape: tuple[int, int], m_per_px: float, rng: np.random.Generator) -> Picture:
    """What is seen through a pane: a dim room, often a curtain, a blind or a plant."""
    height, width = shape
    y = np.linspace(0, 1, height, dtype=np.float32)[:, None]
    x_m = np.arange(width, dtype=np.float32) * m_per_px
    tone = rng.uniform(20, 46)
    room = tone * (1.0 + 0.5 * y) + 4 * textures.noise(shape, rng, 0.5 / m_per_px, 3)
    picture = room[..., None] * np.array([1.0, 1.02, 1.06], np.float32)
    folds = 1 + 0.12 * np.sin(2 * np.pi * x_m / rng.uniform(0.07, 0.12) + rng.uniform(0, 6))
    folds = folds + 0.06 * np.sin(2 * np.pi * x_m / 0.19)
    cloth = np.array([(196, 192, 182), (184, 176, 160), (150, 128, 110)][rng.integers(3)])
    kind = rng.choice(["none", "sheer", "drapes", "blind", "half"], p=[0.28, 0.25, 0.25, 0.1, 0.12])
    if kind == "sheer":
        amount = rng.uniform(0.4, 0.62)
        picture = picture * (1 - amount) + amount * (
            folds[None, :, None] * cloth * (0.85 - 0.2 * y[..., None])
        )
    elif kind == "drapes":
        part = rng.uniform(0.14, 0.26) * width * m_per_px
        side = (x_m < part) | (x_m > width * m_per_px - part)
        drape = np.broadcast_to(folds[None, :, None] * cloth * 0.78, picture.shape)
        picture = np.where(side[None, :, None], drape, picture)
    elif kind == "blind":
        drawn = int(height * rng.uniform(0.2, 0.7))
        slats = 1 - 0.12 * ((np.arange(drawn) * m_per_px % 0.05) < 0.015)
        picture[:drawn] = slats[:, None, None] * np.array([205, 200, 188]) * 0.85
    elif kind == "half":
        drawn = int(height * rng.uniform(0.45, 0.6))
        picture[drawn:] = folds[None, :, None] * np.array([208, 206, 200]) * 0.8
    if rng.random() < 0.3 and kind != "half":  # a plant on the sill
        centre, radius = rng.uniform(0.2, 0.8) * width, 0.16 / m_per_px
        rows, columns = np.mgrid[0:height, 0:width]
        leafy = np.hypot(columns - centre, (rows - height + radius * 1.1) * 0.8)
        leafy = leafy + 0.35 * radius * textures.noise(shape, rng, 0.06 / m_per_px, 3)
        picture = np.where((leafy < radius)[..., None], np.array([48, 70, 38]), picture)
    return picture.astype(np.float32)


def _paint_window(
    shape: tuple[int, int], m_per_px: float, look: Look, rng: np.random.Generator
) -> Picture:
    """RGBA of one window unit: frame, casements, glazing; alpha = share of glass."""
    height, width = shape

    def px(metres: float) -> int:
        return max(1, round(metres / m_per_px))

    picture = np.zeros((height, width, 4), np.float32)
    grain = 1 + 0.02 * textures.noise(shape, rng, 0.05 / m_per_px, 3)
    frame = np.array(look.frame, np.float32) * rng.uniform(0.95, 1.03)
    picture[..., :3] = frame * grain[..., None]
    interior = _paint_interior(shape, m_per_px, rng)
    width_m = width * m_per_px
    casements = 1 if width_m < 0.85 else 2 if width_m < 1.75 else 3
    edges = np.linspace(0, width, casements + 1).round().astype(int)
    transom = [0, round(0.30 * height), height] if look.transom else [0, height]
    for left, right in pairwise(edges):
        for top, bottom in pairwise(transom):
            outer_l = left + (px(0.035) if left == 0 else px(0.01))
            outer_r = right - (px(0.035) if right == width else px(0.01))
            outer_t = top + (px(0.035) if top == 0 else px(0.015))
            outer_b = bottom - (px(0.045) if bottom == height else px(0.015))
            sash = picture[outer_t:outer_b, outer_l:outer_r, :3]
            sash[:1], sash[-1:], sash[:, :1], sash[:, -1:] = (
                0.5 * frame,
                0.55 * frame,
                0.6 * frame,
                0.7 * frame,
            )
            gap = px(0.045)
            glass = (
                slice(outer_t + gap, outer_b - gap),
                slice(outer_l + gap, outer_r - gap),
            )
            if picture[glass].size == 0:
                continue
            picture[glass][..., :3] = interior[glass]
            picture[glass][..., 3] = 255
            for thin in (picture[glass][:1], picture[glass][:, :1]):
                thin[..., :3], thin[..., 3] = 0.4 * frame, 0  # gasket in shadow
            picture[glass][-1:, :, :3] = 1.06 * frame
            picture[glass][-1:, :, 3] = 0
    depth = np.arange(height, dtype=np.float32)[:, None, None] * m_per_px
    picture[..., :3] *= 1 - 0.5 * np.exp(-depth / (0.8 * look.recess_m))
    sides = np.minimum(np.arange(width), np.arange(width)[::-1]).astype(np.float32) * m_per_px
    picture[..., :3] *= 1 - 0.18 * np.exp(-sides / 0.06)[None, :, None]
    return picture


def _paint_door(shape: tuple[int, int], m_per_px: float, rng: np.random.Generator) -> Picture:
    """RGBA of a panelled timber door with two leaves."""
    height, width = shape
    wood = np.array([(78, 50, 34), (44, 62, 52), (96, 30, 28)][rng.integers(3)], np.float32)
    grey = 1 + 0.10 * textures.noise(shape, rng, 0.04 / m_per_px, 3, stretch=12)
    picture = np.zeros((height, width, 4), np.float32)
    picture[..., :3] = wood * grey[..., None]
    for left in (0.06, 0.54):
        for top, bottom in ((0.05, 0.30), (0.34, 0.62), (0.66, 0.95)):
            rows = slice(int(top * height), int(bottom * height))
            columns = slice(int(left * width), int((left + 0.40) * width))
            picture[rows, columns, :3] *= 0.86
            picture[rows.start : rows.start + 2, columns, :3] *= 0.5
            picture[rows, columns.start : columns.start + 2, :3] *= 0.6
            picture[rows.stop - 2 : rows.stop, columns, :3] *= 1.35
    middle = width // 2
    picture[:, middle - 1 : middle + 1, :3] *= 0.35
    handle = slice(int(0.52 * height), int(0.52 * height) + max(2, round(0.12 / m_per_px)))
    picture[handle, middle + 3 : middle + 3 + max(1, round(0.03 / m_per_px)), :3] = 170
    depth = np.arange(height, dtype=np.float32)[:, None, None] * m_per_px
    picture[..., :3] *= 1 - 0.55 * np.exp(-depth / 0.12)
    return picture


def paint_facade(
    width_m: float,
    height_m: float,
    openings: tuple[Opening, ...],
    look: Look,
    storey_m: float,
    m_per_px: float,
    rng: np.random.Generator,
    brightness: float = 1.0,
) -> PaintedFacade:
    """One facade as pictures; openings lie on multiples of ``m_per_px``."""
    wall = _paint_wall(width_m, height_m, openings, look, storey_m, m_per_px, rng)
    shape = (wall.shape[0], wall.shape[1])
    behind = np.zeros((*shape, 4), np.float32)
    opening_id = np.zeros(shape, np.uint8)
    for index, opening in enumerate(openings):
        rows, columns = _box(opening, shape, m_per_px)
        size = (rows.stop - rows.start, columns.stop - columns.start)
        if opening.kind == "door":
            behind[rows, columns] = _paint_door(size, m_per_px, rng)
        else:
            behind[rows, columns] = _paint_window(size, m_per_px, look, rng)
        opening_id[rows, columns] = index + 1
    behind[..., :3] *= brightness
    return PaintedFacade(
        np.clip(wall * brightness, 0, 255).astype(np.uint8),
        np.clip(behind, 0, 255).astype(np.uint8),
        opening_id,
        openings,
        look.recess_m,
        m_per_px,
    )
