"""Concrete elements of a storey's height: joints, speckle of the aggregate, tone by element."""

from __future__ import annotations

import numpy as np
from benchmarks.estate.painting.noise import Field
from benchmarks.estate.painting.sheet import FloatArray, Sheet, covered, smooth
from benchmarks.estate.plan import Finish, Opening

SEALANT_M = 0.020
KEEP_OFF_M = 0.30  # between a joint and an opening, where there is room


def element_joints(
    width_m: float,
    height_m: float,
    plinth_m: float,
    module_m: tuple[float, float],
    openings: tuple[Opening, ...] = (),
) -> tuple[FloatArray, FloatArray]:
    """Places of the upright (K,) and of the level joints (L,) in metres, without the borders.

    Upright joints divide the wall evenly, as near to the module as can be; one that would cut an
    opening moves beside it. Level joints stand on the plinth; all of them
    shift together where that cuts or touches fewer openings.
    """
    count = max(1, round(width_m / module_m[0]))
    upright = np.arange(1, count) * (width_m / count)
    gaps = _gaps([(o.x_m, o.x_m + o.width_m) for o in openings], width_m)
    upright = np.array([_moved(x, gaps, module_m[0] / 2) for x in upright])
    upright = np.unique(np.round(upright, 3))

    spans = np.array([(o.y_m, o.y_m + o.height_m) for o in openings]).reshape(-1, 2)
    best, fewest = 0.0, np.inf
    for shift in (0.0, -0.25, 0.25, -0.5, 0.5, -0.75, 0.75, -1.0, 1.0, 1.25):
        levels = _levels(plinth_m + shift, module_m[1], plinth_m, height_m)[:, None]
        inside = (levels > spans[:, 0]) & (levels < spans[:, 1])
        beside = np.minimum(np.abs(levels - spans[:, 0]), np.abs(levels - spans[:, 1])) < 0.2
        cost = np.sum(inside) + 0.5 * np.sum(beside) + 0.1 * abs(shift)
        if cost < fewest:
            best, fewest = shift, cost
    return upright, _levels(plinth_m + best, module_m[1], plinth_m, height_m)


def _levels(start_m: float, module_m: float, low_m: float, high_m: float) -> FloatArray:
    first = np.ceil((low_m - start_m) / module_m - 1e-9)
    levels = start_m + module_m * np.arange(first, first + 60)
    return levels[(levels >= max(low_m, 0.05)) & (levels < high_m - 0.3)]


def _gaps(spans: list[tuple[float, float]], width_m: float) -> list[tuple[float, float]]:
    """Stretches of the wall's width that no opening on any storey covers."""
    gaps, place = [], 0.0
    for start, end in sorted(spans):
        if start > place:
            gaps.append((place, start))
        place = max(place, end)
    if place < width_m:
        gaps.append((place, width_m))
    return gaps


def _moved(x_m: float, gaps: list[tuple[float, float]], most_m: float) -> float:
    """The nearest place that keeps off the openings; where none is near, the same place."""
    places = []
    for start, end in gaps:
        margin = min(KEEP_OFF_M, (end - start) / 2)
        places.append(float(np.clip(x_m, start + margin, end - margin)))
    near = [place for place in places if abs(place - x_m) <= most_m]
    return min(near, key=lambda place: abs(place - x_m)) if near else x_m


def panel(
    sheet: Sheet,
    finish: Finish,
    openings: tuple[Opening, ...],
    plinth_m: float,
    rng: np.random.Generator,
) -> Field:
    """A wall of concrete elements (H, W, 3) float32 sRGB.

    Surfaces are exposed aggregate, smooth painted concrete, or concrete ribbed upright.
    """
    surface = rng.choice(["aggregate", "smooth", "ribbed"], p=[0.55, 0.3, 0.15])
    upright, level = element_joints(
        sheet.width_m, sheet.height_m, plinth_m, finish.module_m, openings
    )
    column = np.searchsorted(upright, sheet.x_m)
    row = np.searchsorted(level, sheet.y_m)
    shape = (len(level) + 1, len(upright) + 1)
    kept = _kept(upright, level, openings, sheet.width_m)
    tone = rng.uniform(0.012, 0.035) * (rng.uniform(-1, 1, shape) + rng.uniform(-1, 1, shape))
    hue = rng.uniform(-0.006, 0.006, shape)
    for index in range(len(level)):  # elements without a joint between them are one
        tone[index + 1] = np.where(kept[index], tone[index + 1], tone[index])
        hue[index + 1] = np.where(kept[index], hue[index + 1], hue[index])
    light = 1 + tone.astype(np.float32)[row][:, column]
    light += np.float32(0.016) * sheet.soft_clouds((0.7, 0.9), 3, rng)
    light += _surface(surface, sheet, rng)
    _stain_joints(light, sheet, upright, level, kept, finish.weathering, rng)

    joint_x = covered(upright - SEALANT_M / 2, upright + SEALANT_M / 2, sheet.x_edges_m)
    joint_y = covered(level - SEALANT_M / 2, level + SEALANT_M / 2, sheet.y_edges_m)
    rows = np.flatnonzero(joint_y)
    if len(rows):
        nearest = np.abs(sheet.y_m[rows, None] - level[None, :]).argmin(axis=1)
        seam_y = joint_y[rows, None] * kept[nearest][:, column]
    warmth = hue.astype(np.float32)[row][:, column]
    sealant = np.array(finish.second_rgb, np.float32) * np.float32(0.55)
    picture = np.empty((*light.shape, 3), np.float32)
    for band, warm in enumerate((1.0, 0.0, -1.0)):
        plane = light * np.float32(finish.rgb[band])
        if warm:
            plane += np.float32(warm) * warmth
        columns = np.flatnonzero(joint_x)
        plane[:, columns] += (sealant[band] - plane[:, columns]) * joint_x[columns]
        if len(rows):
            plane[rows] += (sealant[band] - plane[rows]) * seam_y
        picture[..., band] = plane
    return picture


def _kept(
    upright: FloatArray, level: FloatArray, openings: tuple[Opening, ...], width_m: float
) -> np.ndarray:
    """Whether a level joint (L, columns) runs through a column of elements: not through a window.

    Stairs have their windows between the storeys and elements of their own.
    """
    sides = np.concatenate([[0.0], upright, [width_m]])
    kept = np.ones((len(level), len(sides) - 1), bool)
    for opening in openings:
        x0, x1 = opening.x_m, opening.x_m + opening.width_m
        cut = (level > opening.y_m) & (level < opening.y_m + opening.height_m)
        kept &= ~(cut[:, None] & ((sides[1:] > x0) & (sides[:-1] < x1))[None, :])
    return kept


def _surface(surface: str, sheet: Sheet, rng: np.random.Generator) -> Field:
    if surface == "aggregate":
        grain = sheet.grain(rng)
        stones = np.float32(0.030) * grain * np.abs(grain) + np.float32(0.022) * grain
        return stones + np.float32(0.020) * sheet.clouds(0.03, 1, rng)
    fine = np.float32(0.02) * sheet.grain(rng) - np.float32(0.25) * sheet.specks(14.0, 0.004, rng)
    fine += np.float32(0.012) * sheet.clouds(0.06, 2, rng)
    if surface == "ribbed":
        phase = np.mod(sheet.x_m, np.float32(0.08)) / np.float32(0.08)
        groove = smooth(0.62, 0.70, phase) * smooth(1.0, 0.92, phase)
        fine -= np.float32(0.10) * groove[None, :]
    return fine


def _stain_joints(
    light: Field,
    sheet: Sheet,
    upright: FloatArray,
    level: FloatArray,
    kept: np.ndarray,
    weathering: float,
    rng: np.random.Generator,
) -> None:
    """Darken beside the joints, and brighten the chipped arris next to some of them."""
    coarse = sheet.coarser(0.02)
    uneven = np.clip(0.6 + 0.5 * coarse.clouds((0.5, 0.5), 3, rng), 0.0, 1.6)
    x_m, y_m = coarse.x_m, coarse.y_m
    stain_x = np.zeros(len(x_m), np.float32)
    for place in upright:
        stain_x += np.exp(-np.abs(x_m - place) / rng.uniform(0.03, 0.10)) * rng.uniform(0.3, 1)
    stain = np.repeat(stain_x[None, :], len(y_m), axis=0)
    column = np.searchsorted(upright, x_m)
    for place, runs in zip(level, kept, strict=True):
        off_m = np.abs(y_m - place)
        below, above = np.exp(-off_m / rng.uniform(0.10, 0.30)), 0.7 * np.exp(-off_m / 0.04)
        along = (np.where(y_m <= place, below, above) * rng.uniform(0.5, 1)).astype(np.float32)
        stain += along[:, None] * runs[column][None, :]
    stain = np.minimum(stain, np.float32(1.2))
    light *= 1 - sheet.fitted(np.float32(0.05 + 0.13 * weathering) * stain * uneven)
