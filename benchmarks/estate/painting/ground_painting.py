"""The albedo of the ground: lawns, asphalt, paving, gravel, markings, from a map of labels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from benchmarks.estate.painting.bitumen import bitumen_repairs, paint_traffic
from benchmarks.estate.painting.noise import Field
from benchmarks.estate.painting.sheet import Sheet, smooth
from benchmarks.estate.plan import Rgb
from numpy.typing import NDArray

GroundKind = Literal["grass", "asphalt", "paving", "gravel", "marking", "soil", "setts", "parking"]
KINDS: tuple[GroundKind, ...] = (
    "grass",
    "asphalt",
    "paving",
    "gravel",
    "marking",
    "soil",
    "setts",
    "parking",
)
"""What the labels 0..7 of a ground map mean."""

COLOURS: dict[GroundKind, Rgb] = {
    "grass": (0.375, 0.415, 0.265),
    "asphalt": (0.385, 0.380, 0.372),
    "paving": (0.55, 0.54, 0.515),
    "gravel": (0.52, 0.50, 0.46),
    "marking": (0.74, 0.74, 0.71),
    "soil": (0.30, 0.25, 0.20),
    "setts": (0.45, 0.44, 0.43),
    "parking": (0.365, 0.362, 0.357),
}
_SOFT = ("grass", "gravel", "soil")  # their edges are ragged
_BITUMEN = ("asphalt", "marking", "parking")
_COARSE_M = 0.15
_FINE_PX = 1024
_PATCH_PX = 48
_BAND_PX = 256


@dataclass(frozen=True)
class _Skin:
    """One kind of ground: colour (h, w, 3) on coarse pixels, fine brightness on a tile."""

    colour: Field
    fine: Field


def paint_ground(
    labels: NDArray[np.uint8], m_per_texel: float, along_deg: float, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """Albedo of the ground (H, W, 3) uint8 sRGB for labels (H, W) that number `KINDS`.

    Row 0 is north, column 0 west; ``along_deg`` is the bearing that slabs and repairs lie along.
    """
    height, width = labels.shape
    step = max(1, round(_COARSE_M / m_per_texel))
    coarse = np.ascontiguousarray(labels[step // 2 :: step, step // 2 :: step])
    if min(coarse.shape) < 8:
        coarse, step = labels, 1
    sheet = Sheet(width * m_per_texel, height * m_per_texel, coarse.shape[1], coarse.shape[0])
    skins = {
        kind: _skin(kind, _area(kind, coarse), sheet, m_per_texel, rng)
        for index, kind in enumerate(KINDS)
        if (labels == index).any()
    }
    repairs = bitumen_repairs(_area("asphalt", labels), m_per_texel, along_deg, rng)
    edges = _ragged(labels, m_per_texel, rng)
    picture = np.empty((height, width, 3), np.uint8)
    for top in range(0, height, _BAND_PX):
        rows = slice(top, min(top + _BAND_PX, height))
        band = np.zeros((rows.stop - top, width, 3), np.float32)
        for kind, skin in skins.items():
            inside = edges[rows] == KINDS.index(kind)
            columns = np.flatnonzero(inside.any(axis=0))
            if len(columns) == 0:
                continue
            across = slice(int(columns[0]), int(columns[-1]) + 1)
            here = _laid(skin, rows, across, labels.shape)
            if kind in ("paving", "setts") and m_per_texel < 0.1:
                here *= _slabs(kind, rows, across, m_per_texel, along_deg)[..., None]
            np.copyto(band[:, across], here, where=inside[:, across, None])
        band *= 1 + repairs[rows, :, None].astype(np.float32) / np.float32(255)
        picture[rows] = cv2.convertScaleAbs(np.clip(band, 0.08, 0.85), alpha=255.0)
    return picture


def _area(kind: GroundKind, labels: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Where a kind lies (H, W); markings and parking places belong to one sheet of bitumen."""
    kinds = _BITUMEN if kind in _BITUMEN else (kind,)
    return np.isin(labels, [KINDS.index(each) for each in kinds])


def _laid(skin: _Skin, rows: slice, columns: slice, shape: tuple[int, int]) -> Field:
    """Colours (h, w, 3) of a part of the ground as if all of it were of that kind."""
    height, width = skin.colour.shape[:2]
    sx, sy = width / shape[1], height / shape[0]
    source = np.array(
        [
            [sx, 0, (columns.start + 0.5) * sx - 0.5],
            [0, sy, (rows.start + 0.5) * sy - 0.5],
        ]
    )
    size = (columns.stop - columns.start, rows.stop - rows.start)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    here = cv2.warpAffine(skin.colour, source, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    here *= _strewn(skin.fine, rows, columns)[..., None]
    return here


def _strewn(tile: Field, rows: slice, columns: slice) -> Field:
    """Brightness (h, w) of a part of the ground: patches of the tile, each from somewhere in it.

    Laid side by side the tile would show the same lawn in places metres apart, and photos of both
    would match.
    """
    size = len(tile)
    table = np.random.default_rng(11).integers(0, size, (2, 61, 67)).astype(np.int32)
    down = np.arange(rows.start, rows.stop, dtype=np.int32)
    across = np.arange(columns.start, columns.stop, dtype=np.int32)
    patch = np.ix_(down // _PATCH_PX % 61, across // _PATCH_PX % 67)
    row = (down[:, None] + table[0][patch]) % size
    column = (across[None, :] + table[1][patch]) % size
    return tile[row, column]


def _skin(
    kind: GroundKind,
    inside: NDArray[np.bool_],
    sheet: Sheet,
    m_per_texel: float,
    rng: np.random.Generator,
) -> _Skin:
    size_m = _FINE_PX * m_per_texel
    tile = Sheet(size_m, size_m, _FINE_PX, _FINE_PX)
    near_m = cv2.distanceTransform(
        cv2.copyMakeBorder(inside.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_REPLICATE),
        cv2.DIST_L2,
        3,
    )[1:-1, 1:-1] * np.float32(sheet.m_per_px)
    light = np.ones((sheet.height_px, sheet.width_px), np.float32)
    warm = np.zeros_like(light)
    fade = np.float32(min(1.0, (0.03 / m_per_texel) ** 0.7))
    match kind:
        case "grass":
            light += np.float32(0.04) * sheet.clouds(6.0, 5, rng, 0.6)
            dry = smooth(0.5, 2.4, sheet.clouds(3.5, 5, rng, 0.6) + 0.9 * np.exp(-near_m / 0.25))
            warm += np.float32(0.007) * sheet.clouds(2.0, 4, rng) + np.float32(0.030) * dry
            light += np.float32(0.10) * dry
            clover = smooth(1.2, 2.0, sheet.clouds(1.4, 3, rng))
            light -= np.float32(0.05) * clover
            warm -= np.float32(0.012) * clover
            fine = np.float32(0.12) * tile.grain(rng) + np.float32(0.05) * tile.clouds(0.12, 2, rng)
            fine += np.float32(0.4) * tile.specks(1.2, 0.012, rng)  # daisies and dry leaves
        case "gravel" | "soil":
            light += np.float32(0.05) * sheet.clouds(3.0, 5, rng)
            light -= np.float32(0.10) * np.exp(-near_m / np.float32(0.3))
            fine = np.float32(0.07) * tile.grain(rng) + np.float32(0.03) * tile.clouds(0.08, 1, rng)
            fine -= np.float32(0.3) * tile.specks(2.0, 0.02, rng)
        case "paving" | "setts":
            light += np.float32(0.04) * sheet.clouds(2.5, 5, rng)
            light -= np.float32(0.09) * np.exp(-near_m / np.float32(0.2))
            fine = np.float32(0.03) * tile.grain(rng) - np.float32(0.3) * tile.specks(
                1.5, 0.02, rng
            )
        case _:
            light += np.float32(0.03) * sheet.clouds((5.0, 5.0), 5, rng)
            paint_traffic(light, warm, near_m, sheet, kind == "parking", rng)
            fine = np.float32(0.05) * tile.grain(rng) + np.float32(0.02) * tile.clouds(0.1, 1, rng)
            fine -= np.float32(0.18) * tile.specks(0.7, 0.03, rng)
            if kind == "marking":
                worn = smooth(0.6, 1.8, tile.clouds(0.35, 5, rng, 0.7))
                fine -= np.float32(0.38) * worn
    colour = np.empty((*light.shape, 3), np.float32)
    for band, turn in enumerate((1.0, 0.0, -0.2)):
        colour[..., band] = light * np.float32(COLOURS[kind][band]) + np.float32(turn) * warm
    return _Skin(colour, 1 + fade * fine)


def _slabs(
    kind: GroundKind, rows: slice, columns: slice, m_per_texel: float, along_deg: float
) -> Field:
    """Brightness (h, w) of slabs 0.35 m square, or setts 0.14 x 0.11 m in broken rows."""
    east = (np.arange(columns.start, columns.stop, dtype=np.float32) + 0.5) * m_per_texel
    north = -(np.arange(rows.start, rows.stop, dtype=np.float32) + 0.5) * m_per_texel
    sine, cosine = np.sin(np.radians(along_deg)), np.cos(np.radians(along_deg))
    along = (east * sine)[None, :] + (north * cosine)[:, None]
    aside = (east * cosine)[None, :] - (north * sine)[:, None]
    long_m, short_m, joint_m = (0.35, 0.35, 0.008) if kind == "paving" else (0.14, 0.11, 0.012)
    row = np.floor(aside / short_m)
    if kind == "setts":
        along = along + np.mod(row * np.float32(0.37), 1.0) * long_m
    column = np.floor(along / long_m)
    depth = np.zeros(along.shape, np.float32)
    for place, step in ((along - column * long_m, long_m), (aside - row * short_m, short_m)):
        off = np.minimum(place, step - place)
        share = (joint_m / 2 + m_per_texel / 2 - off) / m_per_texel
        depth = np.maximum(depth, np.clip(share, 0.0, min(1.0, joint_m / m_per_texel)))
    table = np.random.default_rng(7).uniform(-1, 1, (61, 67)).astype(np.float32)
    tone = table[np.mod(row, 61).astype(np.int16), np.mod(column, 67).astype(np.int16)]
    spread, dirt = (0.045, 0.55) if kind == "paving" else (0.10, 0.45)
    return (1 + np.float32(spread) * tone) * (1 - np.float32(dirt) * depth)


def _ragged(
    labels: NDArray[np.uint8], m_per_texel: float, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """The labels with edges of lawn, soil and gravel a few centimetres out of line."""
    if m_per_texel > 0.1:
        return labels
    height, width = labels.shape
    tile = Sheet(_FINE_PX * m_per_texel, _FINE_PX * m_per_texel, _FINE_PX, _FINE_PX)
    reach = np.float32(0.045 / m_per_texel)
    shift_x = np.rint(reach * tile.clouds(0.5, 5, rng, 0.7)).astype(np.int32)
    shift_y = np.rint(reach * tile.clouds(0.5, 5, rng, 0.7)).astype(np.int32)
    soft = np.isin(np.arange(256), [KINDS.index(kind) for kind in _SOFT])
    found = labels.copy()
    across = np.arange(width)
    for top in range(0, height, _BAND_PX):
        down = np.arange(top, min(top + _BAND_PX, height))
        if (labels[down] == labels[down[0], 0]).all():
            continue
        tiled = np.ix_(down % _FINE_PX, across % _FINE_PX)
        y = np.clip(down[:, None] + shift_y[tiled], 0, height - 1)
        x = np.clip(across[None, :] + shift_x[tiled], 0, width - 1)
        other = labels[y, x]
        found[down] = np.where(soft[other], other, labels[down])
    return found
