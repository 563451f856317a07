"""Clad walls: timber boards, ashlar, corrugated sheet and facade tiles."""

from __future__ import annotations

import numpy as np
from benchmarks.estate.painting.noise import Field
from benchmarks.estate.painting.sheet import FloatArray, Sheet, covered, smooth
from benchmarks.estate.plan import Finish


def boards(sheet: Sheet, finish: Finish, rng: np.random.Generator) -> Field:
    """Painted timber (H, W, 3) float32 sRGB: boards with cover strips, upright, or lapped level."""
    if rng.random() < 0.7:
        light = _boarding(sheet, sheet.x_edges_m, (0.18, 0.45), 0, finish, rng)
    else:
        light = _boarding(sheet, sheet.y_edges_m, (0.40, 0.16), 1, finish, rng)
    light += np.float32(0.012) * sheet.soft_clouds(1.2, 3, rng)
    light += np.float32(0.018) * sheet.grain(rng)
    return _coloured(light, finish.rgb)


def _boarding(
    sheet: Sheet,
    edges_m: FloatArray,
    cell: tuple[float, float],
    axis: int,
    finish: Finish,
    rng: np.random.Generator,
) -> Field:
    """Brightness (H, W) of boards side by side across ``edges_m``; axis 0 = upright boards."""
    width_m = rng.uniform(0.11, 0.15)
    strip_m = 0.045 if axis == 0 else 0.0
    extent = abs(edges_m[-1] - edges_m[0])
    count = int(extent / width_m) + 2
    starts = np.arange(count) * width_m
    centres = (edges_m[1:] + edges_m[:-1]) / 2
    tone = rng.uniform(-0.022, 0.022, (count, 12)).astype(np.float32)
    light = 1 - np.float32(0.30) * covered(starts, starts + 0.008, edges_m)
    if strip_m:
        light -= np.float32(0.22) * covered(starts + strip_m, starts + strip_m + 0.008, edges_m)
        light += np.float32(0.02) * covered(starts + 0.008, starts + strip_m, edges_m)
    board = np.clip((centres / width_m).astype(int), 0, count - 1)
    along = sheet.y_m if axis == 0 else sheet.x_m
    pieces = rng.uniform(0, 4.0, count)[board]
    piece = ((along[:, None] + pieces[None, :]) / 4.2).astype(int) % 12
    field = light[None, :] + tone[board[None, :], piece]
    field = np.ascontiguousarray(field if axis == 0 else field.T, dtype=np.float32)
    fibres = (cell[1], 0.012) if axis == 0 else (0.012, cell[0])
    field += np.float32(0.012 + 0.02 * finish.weathering) * sheet.clouds(fibres, 1, rng)
    field -= np.float32(0.22 * finish.weathering) * sheet.specks(6.0, 0.008, rng)
    return field


def stone(sheet: Sheet, finish: Finish, rng: np.random.Generator) -> Field:
    """Ashlar (H, W, 3) float32 sRGB: courses of 0.3-0.5 m, blocks 0.5-1.1 m, joints 8 mm."""
    joint_m = 0.008
    heights = rng.uniform(0.28, 0.50, int(sheet.height_m / 0.28) + 2)
    if rng.random() < 0.6:
        heights[:] = heights[0]
    levels = np.cumsum(heights)
    course = np.searchsorted(levels, sheet.y_m)
    bed = covered(levels - joint_m / 2, levels + joint_m / 2, sheet.y_edges_m)
    lines = np.empty((len(levels) + 1, sheet.width_px, 3), np.float32)
    mortar = np.array(finish.second_rgb, np.float32) * np.float32(0.85)
    spread, hue = rng.uniform(0.02, 0.05), rng.uniform(0.004, 0.012)
    for index in range(len(lines)):
        ends = np.cumsum(rng.uniform(0.5, 1.1, int(sheet.width_m / 0.5) + 3))
        ends -= rng.uniform(0.0, 0.5)
        tone = 1 + spread * (rng.uniform(-1, 1, (len(ends) + 1, 1)) * 1.6)
        warm = hue * rng.uniform(-1.6, 1.6, (len(ends) + 1, 1)) * np.array([1.0, 0.0, -1.0])
        colours = (np.array(finish.rgb) * tone + warm).astype(np.float32)
        line = colours[np.searchsorted(ends, sheet.x_m)]
        head = covered(ends - joint_m / 2, ends + joint_m / 2, sheet.x_edges_m)[:, None]
        lines[index] = line + (mortar - line) * head
    picture = np.take(lines, course, axis=0)
    rows = bed > 0
    picture[rows] += (mortar - picture[rows]) * bed[rows, None, None]
    light = 1 + np.float32(0.02) * sheet.soft_clouds((0.25, 0.5), 3, rng)
    light += np.float32(0.028) * sheet.grain(rng) + np.float32(0.02) * sheet.clouds(0.06, 2, rng)
    light -= np.float32(0.15) * sheet.specks(12.0, 0.008, rng)
    picture *= light[..., None]
    return picture


def metal(sheet: Sheet, finish: Finish, rng: np.random.Generator) -> Field:
    """Corrugated sheet (H, W, 3) float32 sRGB: faintly shaded ridges, laps and dents."""
    period_m = rng.choice([0.076, 0.15, 0.20])
    phase = np.mod(sheet.x_m / np.float32(period_m), 1.0)
    ridge = smooth(0.0, 0.18, phase) * smooth(0.68, 0.5, phase)
    soft = min(1.0, period_m / (3 * sheet.m_per_px))
    light = 1 + np.float32(0.08 * soft) * (ridge - np.float32(0.5))[None, :]
    light = light - np.float32(0.06 * soft) * smooth(0.10, 0.0, np.abs(phase - 0.62))[None, :]
    laps_m = np.arange(1.0, sheet.width_m, 1.0)
    light = light - np.float32(0.10) * covered(laps_m, laps_m + 0.006, sheet.x_edges_m)[None, :]
    height_m = rng.uniform(4.0, 6.5)
    ends = np.arange(height_m, sheet.height_m - 0.5, height_m)
    light = light - np.float32(0.25) * covered(ends - 0.01, ends, sheet.y_edges_m)[:, None]
    light += np.float32(0.010) * sheet.soft_clouds((2.0, 0.5), 3, rng)
    light += np.float32(0.012) * sheet.grain(rng)
    light += np.float32(0.006) * sheet.clouds((0.5, 0.03), 1, rng)
    light -= np.float32(0.12) * sheet.specks(2.0, 0.010, rng)
    tone = rng.uniform(-0.012, 0.012, len(laps_m) + 1).astype(np.float32)
    light += tone[np.searchsorted(laps_m, sheet.x_m)][None, :]
    return _coloured(light.astype(np.float32), finish.rgb)


def tiles(sheet: Sheet, finish: Finish, rng: np.random.Generator) -> Field:
    """Facade tiles (H, W, 3) float32 sRGB on the finish's module, or 0.6 x 0.3 m if that is large.

    A few tiles were replaced and have another tone.
    """
    width_m, height_m = finish.module_m if max(finish.module_m) < 1.6 else (0.6, 0.3)
    joint_m = min(0.008, 0.06 * min(width_m, height_m))
    joints = []
    for step, extent, edges in (
        (width_m, sheet.width_m, sheet.x_edges_m),
        (height_m, sheet.height_m, sheet.y_edges_m),
    ):
        places = np.arange(1, int(extent / step) + 1) * step
        joints.append(covered(places - joint_m / 2, places + joint_m / 2, edges))
    column = (sheet.x_m / width_m).astype(int)
    row = (sheet.y_m / height_m).astype(int)
    shape = (int(row.max()) + 1, int(column.max()) + 1)
    tone = 1 + rng.uniform(0.01, 0.03) * rng.uniform(-1.6, 1.6, shape)
    tone += (rng.random(shape) < 0.025) * rng.uniform(-0.14, 0.10, shape)
    light = tone.astype(np.float32)[row][:, column]
    light += np.float32(0.012) * sheet.soft_clouds((0.3, 0.5), 3, rng)
    light += np.float32(0.02) * sheet.grain(rng)
    light -= np.float32(0.2) * sheet.specks(8.0, 0.008, rng)
    picture = _coloured(light, finish.rgb)
    mortar = np.array(finish.second_rgb, np.float32) * np.float32(0.8)
    seam = np.maximum(joints[0][None, :], joints[1][:, None])[..., None]
    picture += (mortar - picture) * seam
    return picture


def _coloured(light: Field, rgb: tuple[float, float, float]) -> Field:
    picture = np.empty((*light.shape, 3), np.float32)
    for band in range(3):
        picture[..., band] = light * np.float32(rgb[band])
    return picture
