"""Brick walls: Swedish format 250 x 62 mm with 12 mm joints, bonds and soldier courses."""

from __future__ import annotations

import numpy as np
from benchmarks.estate.painting.noise import Field
from benchmarks.estate.painting.sheet import FloatArray, Sheet, covered
from benchmarks.estate.plan import Finish, Opening

STRETCHER_M, HEADER_M, BRICK_HEIGHT_M, JOINT_M = 0.250, 0.120, 0.062, 0.012
COURSE_M = BRICK_HEIGHT_M + JOINT_M


def brick(
    sheet: Sheet, finish: Finish, openings: tuple[Opening, ...], rng: np.random.Generator
) -> Field:
    """A brick wall (H, W, 3) float32 sRGB with a bed joint at its foot.

    Most are in running bond, some in Flemish bond; most have soldier courses over the openings.
    """
    bricks = (STRETCHER_M,) if rng.random() < 0.7 else (STRETCHER_M, HEADER_M)
    soldiers = rng.random() < 0.75
    tones = _Tones(finish, rng)
    courses = int(np.ceil(sheet.height_m / COURSE_M)) + 1
    period = sum(bricks) + JOINT_M * len(bricks)
    shift = np.where(np.arange(courses) % 2 == 0, 0.0, period / 2)
    shift = shift + rng.uniform(-0.004, 0.004, courses)
    edges = sheet.x_edges_m[None, :] + shift[:, None]
    head = _joints(edges, bricks, period)
    centres = (edges[:, 1:] + edges[:, :-1]) / 2
    turns = np.floor(centres / period)
    place = turns.astype(np.int64)
    if len(bricks) == 2:
        place = 2 * place + (centres - turns * period >= STRETCHER_M + JOINT_M)
    colours = tones.bricks((courses, int(place.max()) + 2), rng)
    lines = np.take_along_axis(colours, place[..., None], axis=1)
    lines += (tones.mortar - lines) * head[..., None]

    foot = np.arange(courses) * COURSE_M
    bed = covered(foot, foot + JOINT_M, sheet.y_edges_m)
    course = np.clip((sheet.y_m / COURSE_M).astype(np.int64), 0, courses - 1)
    picture = np.take(lines, course, axis=0)
    rows = bed > 0
    picture[rows] += (tones.mortar - picture[rows]) * bed[rows, None, None]
    if soldiers:
        for opening in openings:
            if opening.depth_m == 0 and opening.style.arch == 0:
                _soldiers(picture, sheet, opening, tones, rng)
    light = 1 + np.float32(0.035) * sheet.grain(rng)
    light *= 1 + np.float32(0.022) * sheet.soft_clouds((0.5, 1.6), 3, rng)
    picture *= light[..., None]
    return picture


class _Tones:
    """Colours of a wall's mortar and of single bricks."""

    def __init__(self, finish: Finish, rng: np.random.Generator) -> None:
        self.mortar = np.array(finish.second_rgb, np.float32) * np.float32(0.92)
        self.brick = np.array(finish.rgb, np.float32)
        strong = float(np.ptp(self.brick))  # burnt clay varies more than grey or white brick
        self.spread = rng.uniform(0.022, 0.040) + rng.uniform(0.02, 0.10) * strong
        self.hue = rng.uniform(0.002, 0.005) + rng.uniform(0.01, 0.05) * strong
        self.dark = rng.uniform(0.0, 0.20) * strong

    def bricks(self, shape: tuple[int, ...], rng: np.random.Generator) -> Field:
        """Colours (*shape, 3): most near the mean, a few fired dark."""
        bell = rng.uniform(-1, 1, shape) + rng.uniform(-1, 1, shape)
        light = 1 + self.spread * bell - 0.2 * (rng.random(shape) < self.dark) * rng.random(shape)
        hue = rng.uniform(-1.7, 1.7, shape) * self.hue
        colours = self.brick * light[..., None]
        colours[..., 0] += hue
        colours[..., 2] -= 0.6 * hue
        return colours.astype(np.float32)


def _joints(edges_m: FloatArray, bricks: tuple[float, ...], period_m: float) -> Field:
    """Share of each pixel (courses, W) that head joints fill; a joint stands before each brick."""
    turns = np.floor(edges_m / period_m)
    rest = edges_m - turns * period_m
    filled = turns * JOINT_M * len(bricks)
    start = 0.0
    for length in bricks:
        filled += np.clip(rest - start, 0.0, JOINT_M)
        start += length + JOINT_M
    return (np.diff(filled, axis=1) / np.diff(edges_m, axis=1)).astype(np.float32)


def _soldiers(
    picture: Field, sheet: Sheet, opening: Opening, tones: _Tones, rng: np.random.Generator
) -> None:
    """Paint a course of upright bricks over an opening."""
    count = max(1, round(opening.width_m / COURSE_M))
    y0 = opening.y_m + opening.height_m
    x0 = opening.x_m + (opening.width_m - count * COURSE_M) / 2
    rows, columns = sheet.box(x0, y0, x0 + count * COURSE_M, y0 + STRETCHER_M)
    if picture[rows, columns].size == 0:
        return
    x_edges = sheet.x_edges_m[columns.start : columns.stop + 1] - x0
    starts = np.arange(count + 1) * COURSE_M - JOINT_M / 2
    head = covered(starts, starts + JOINT_M, x_edges)
    place = np.clip(((x_edges[1:] + x_edges[:-1]) / 2 / COURSE_M).astype(int), 0, count - 1)
    line = tones.bricks((count,), rng)[place]
    line += (tones.mortar - line) * head[:, None]
    y_edges = sheet.y_edges_m[rows.start : rows.stop + 1] - y0
    bed = covered(np.array([STRETCHER_M - JOINT_M]), np.array([STRETCHER_M]), y_edges)
    picture[rows, columns] = line + (tones.mortar - line) * bed[:, None, None]
