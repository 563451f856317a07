"""Meshes of what a facade has beyond its wall's plan: pediments, shutters, awnings, letters.

Everything is in the wall's frame: x right, y up, z out of the wall.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import cv2
import numpy as np
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.facades.styles_draft import Extra
from benchmarks.estate.meshes.solids import band, box, boxes, plane, prism, quad
from benchmarks.estate.meshes.wall_meshes import ornament_parts
from benchmarks.estate.painting.house_materials import matt, paint
from benchmarks.estate.parts import Material, Mesh, Parts
from benchmarks.estate.plan import Ornament, Rgb
from shapely.geometry import Point, Polygon
from shapely.geometry import box as rectangle

SLAT_M = 0.05
BAR_M = 0.016
SHEET_M = 0.018
_TEXELS = 256


def extra_parts(extra: Extra, rng: np.random.Generator) -> Parts:
    """The meshes of one detail."""
    makers = {
        "triangle": _pediment,
        "segment": _pediment,
        "roller": _roller,
        "leaf": _leaves,
        "fan": _fan,
        "lines": _lines,
        "awning": _awning,
        "text": _letters,
    }
    return makers[extra.kind](extra, rng)


def masonry_parts(ornament: Ornament) -> Parts:
    """An ornament as masonry, matt and a little uneven, where the plan says painted box.

    Thin sheets stay painted.
    """
    thin = ornament.out_m < SHEET_M
    if thin or ornament.kind == "pipe" or ornament.material != "painted":
        return ornament_parts(ornament)
    parts = Parts()
    low = (ornament.x_m, ornament.y_m, ornament.gap_m)
    high = (
        ornament.x_m + ornament.width_m,
        ornament.y_m + ornament.height_m,
        ornament.gap_m + ornament.out_m,
    )
    parts.meshes.append(box(stucco(parts, ornament.rgb), low, high))
    return parts


def stucco(parts: Parts, rgb: Rgb) -> str:
    """Name of a matt, slightly stained surface of a colour, which the parts then hold."""
    key = tuple(round(float(value), 2) for value in rgb)
    name = "stucco-" + "-".join(f"{value:.2f}" for value in key)
    parts.materials.setdefault(name, Material("diffuse", rgb, _stained(key)))
    return name


@cache
def _stain() -> np.ndarray:
    rng = rng_of(0, "stucco")
    field = np.zeros((_TEXELS, _TEXELS))
    for cells, weight in ((4, 0.05), (16, 0.03), (64, 0.02), (_TEXELS, 0.03)):
        coarse = np.pad(rng.normal(0, 1, (cells, cells)), 2, mode="wrap")
        fine = cv2.resize(
            coarse, None, fx=_TEXELS / cells, fy=_TEXELS / cells, interpolation=cv2.INTER_CUBIC
        )
        start = 2 * _TEXELS // cells
        field += weight * fine[start : start + _TEXELS, start : start + _TEXELS]
    return 1 + field


@cache
def _stained(rgb: Rgb) -> np.ndarray:
    picture = _stain()[..., None] * np.asarray(rgb) * 255
    return np.clip(picture, 20, 235).astype(np.uint8)


def _corners(extra: Extra) -> tuple[float, float, float, float]:
    return (
        extra.x_m,
        extra.y_m,
        extra.x_m + extra.width_m,
        extra.y_m + extra.height_m,
    )


def _pediment(extra: Extra, rng: np.random.Generator) -> Parts:
    """A triangle or a circle's segment with a raised rim."""
    parts = Parts()
    x0, y0, x1, y1 = _corners(extra)
    middle = (x0 + x1) / 2
    if extra.kind == "triangle":
        outer = Polygon([(x0, y0), (x1, y0), (middle, y1)])
    else:
        turn = np.linspace(0, np.pi, 13)
        arc = np.column_stack(
            [middle + np.cos(turn) * (x1 - x0) / 2, y0 + np.sin(turn) * (y1 - y0)]
        )
        outer = Polygon(arc)
    inner = outer.buffer(-0.08, join_style="mitre")
    stone = stucco(parts, extra.rgb)
    parts.meshes += prism(stone, outer.difference(inner), 0.0, extra.z_m + extra.out_m)
    if not inner.is_empty:
        parts.meshes.append(plane(stone, inner, extra.z_m + 0.4 * extra.out_m))
        back, front = extra.z_m + 0.4 * extra.out_m, extra.z_m + extra.out_m
        parts.meshes.append(band(stone, inner, back, front, inward=True))
    return parts


def _slats(parts: Parts, extra: Extra, rgb: Rgb, x0: float, x1: float) -> None:
    """Level slats with dark gaps between x0 and x1."""
    y0, y1 = extra.y_m, extra.y_m + extra.height_m
    back, front = extra.z_m, extra.z_m + extra.out_m
    dark = (rgb[0] * 0.5, rgb[1] * 0.5, rgb[2] * 0.5)
    parts.meshes.append(plane(matt(parts, dark), rectangle(x0, y0, x1, y1), (back + front) / 2))
    count = max(2, int((y1 - y0) / SLAT_M))
    low = y0 + (y1 - y0) * np.arange(count) / count
    lows = np.column_stack([np.full(count, x0), low, np.full(count, back)])
    highs = np.column_stack(
        [np.full(count, x1), low + 0.84 * (y1 - y0) / count, np.full(count, front)]
    )
    parts.meshes.append(boxes(paint(parts, rgb), lows, highs, without="back left right"))


def _roller(extra: Extra, rng: np.random.Generator) -> Parts:
    """A roller shutter with a heavier bottom slat."""
    parts = Parts()
    x0, y0, x1, _ = _corners(extra)
    _slats(parts, extra, extra.rgb, x0 + 0.01, x1 - 0.01)
    low, high = (x0 + 0.01, y0, extra.z_m), (x1 - 0.01, y0 + 0.05, extra.z_m + extra.out_m + 0.006)
    parts.meshes.append(box(paint(parts, extra.rgb), low, high))
    return parts


def _leaves(extra: Extra, rng: np.random.Generator) -> Parts:
    """Two closed shutters with louvres in a frame."""
    parts = Parts()
    x0, y0, x1, y1 = _corners(extra)
    wood = paint(parts, extra.rgb)
    middle = (x0 + x1) / 2
    for left, right in ((x0, middle - 0.006), (middle + 0.006, x1)):
        outer = rectangle(left, y0, right, y1)
        inner = outer.buffer(-0.05, join_style="mitre")
        if inner.is_empty:
            continue
        parts.meshes += prism(
            wood, outer.difference(inner), extra.z_m, extra.z_m + extra.out_m + 0.01
        )
        _slats(parts, extra, extra.rgb, left + 0.05, right - 0.05)
    return parts


def _fan(extra: Extra, rng: np.random.Generator) -> Parts:
    """The round grille of an air conditioner."""
    parts = Parts()
    x0, y0, x1, y1 = _corners(extra)
    centre, radius = Point((x0 + x1) / 2, (y0 + y1) / 2), (x1 - x0) / 2
    front = extra.z_m + 0.004
    parts.meshes.append(plane(matt(parts, extra.rgb), centre.buffer(radius), front))
    grey = paint(parts, (0.55, 0.55, 0.54))
    for share in (0.25, 0.55, 0.85):
        ring = centre.buffer(radius * share + 0.012).difference(centre.buffer(radius * share))
        parts.meshes.append(plane(grey, ring, front + 0.004))
    return parts


def _lines(extra: Extra, rng: np.random.Generator) -> Parts:
    """Upright bars between two rails."""
    parts = Parts()
    x0, y0, x1, y1 = _corners(extra)
    iron = paint(parts, extra.rgb)
    count = max(2, extra.count)
    x = x0 + (x1 - x0 - BAR_M) * np.arange(count) / (count - 1)
    back, front = extra.z_m, extra.z_m + min(extra.out_m, 0.03)
    lows = np.column_stack([x, np.full(count, y0), np.full(count, back)])
    size = np.array([BAR_M, y1 - y0, front - back])
    parts.meshes.append(boxes(iron, lows, lows + size))
    for y in (y0, y1 - 0.03):
        parts.meshes.append(box(iron, (x0, y, back), (x1, y + 0.03, front + 0.005)))
    return parts


def _awning(extra: Extra, rng: np.random.Generator) -> Parts:
    """Slanting cloth with a valance, sometimes striped."""
    parts = Parts()
    x0, y0, x1, y1 = _corners(extra)
    pale = (0.85, 0.84, 0.80) if rng.random() < 0.5 else extra.rgb
    count = max(2, int((x1 - x0) / 0.28))
    edges = np.linspace(x0, x1, count + 1)
    fall = y0 + 0.18
    for index, (left, right) in enumerate(pairwise(edges)):
        cloth = matt(parts, extra.rgb if index % 2 == 0 else pale)
        out = extra.z_m + extra.out_m
        front = [(left, fall, out), (right, fall, out), (right, y1, 0.04), (left, y1, 0.04)]
        parts.meshes.append(quad(cloth, front))
        valance = [(left, y0, out), (right, y0, out), (right, fall, out), (left, fall, out)]
        parts.meshes.append(quad(cloth, valance))
    return parts


def _letters(extra: Extra, rng: np.random.Generator) -> Parts:
    """Strokes that read as letters from afar."""
    parts = Parts()
    x0, y0, x1, y1 = _corners(extra)
    count = max(2, extra.count)
    pitch, high = (x1 - x0) / count, y1 - y0
    wide, pen = 0.72 * pitch, min(0.14 * high, 0.3 * pitch)
    lows: list[tuple[float, float]] = []
    highs: list[tuple[float, float]] = []
    strokes = [
        (0, 0, pen, high),
        (wide - pen, 0, wide, high),
        (0, 0, wide, pen),
        (0, high - pen, wide, high),
        (0, (high - pen) / 2, wide, (high + pen) / 2),
        ((wide - pen) / 2, 0, (wide + pen) / 2, high),
    ]
    for index in range(count):
        for number in rng.permutation(len(strokes))[: int(rng.integers(2, 5))]:
            a, b, c, d = strokes[number]
            lows.append((x0 + index * pitch + a, y0 + b))
            highs.append((x0 + index * pitch + c, y0 + d))
    low = np.column_stack([lows, np.full(len(lows), extra.z_m)])
    high_corners = np.column_stack([highs, np.full(len(lows), extra.z_m + extra.out_m)])
    mesh: Mesh = boxes(paint(parts, extra.rgb), low, high_corners, without="back")
    parts.meshes.append(mesh)
    return parts
