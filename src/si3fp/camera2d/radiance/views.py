"""Compiled kernels that look at a finished field: orthographic rows, visibility of points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from si3fp.camera2d.radiance.arrays import (
    F32,
    HALF,
    HIDDEN,
    I64,
    LANES,
    ONE,
    ZERO,
    Field,
    Photos,
    compiled,
)
from si3fp.camera2d.radiance.kernels import direction_share, evaluate_density, new_work, trace
from si3fp.camera2d.radiance.march import between_sides, clip, photo_ray


@compiled
def render_points(
    field: Field,
    foot: F32,
    near: np.float32,
    far: np.float32,
    step: np.float32,
    view: F32,
    out: F32,
) -> None:
    """Look at the wall along -z through points of its plane.

    ``foot`` (N, 2) metres, from ``near`` in front to ``far`` behind. ``view`` (6,): the direction
    in its last three numbers colours glossy surfaces. ``out`` (N, 5): r, g, b in 0..1, opacity,
    metres in front of the plane where half the light is absorbed (NaN where it never is).
    """
    w = new_work()
    ray, spans = np.zeros(6, np.float32), np.zeros((2, 3), np.float32)
    shaded, towards = np.zeros(5, np.float32), np.zeros(HIDDEN, np.float32)
    direction_share(field, view, towards)
    for n in range(foot.shape[0]):
        ray[0], ray[1], ray[2] = foot[n, 0], foot[n, 1], near
        ray[3], ray[4], ray[5] = ZERO, ZERO, -ONE
        spans[1, 0], spans[1, 1], spans[1, 2] = HALF * step, near + far, step
        trace(field, ray, spans, w, towards, shaded)
        opacity = ONE - shaded[3]
        for c in range(3):
            out[n, c] = shaded[c] / max(opacity, np.float32(1e-3))
        out[n, 3] = opacity
        out[n, 4] = near - shaded[4] if shaded[4] >= ZERO else np.float32(np.nan)


@compiled
def see_points(
    field: Field,
    centre: F32,
    points: F32,
    slab_top: np.float32,
    steps: F32,
    before: np.float32,
    skip: np.float32,
    seen: NDArray[np.bool_],
) -> None:
    """Whether more than half the light of points (N, 3) reaches a photo's centre.

    The ray ends ``before`` metres in front of the point and starts at the share ``skip`` of it.
    """
    w = new_work()
    ray, spans = np.zeros(6, np.float32), np.zeros((2, 3), np.float32)
    shaded, towards = np.zeros(5, np.float32), np.zeros(HIDDEN, np.float32)
    for n in range(points.shape[0]):
        length = ZERO
        for axis in range(3):
            ray[axis] = centre[axis]
            ray[3 + axis] = points[n, axis] - centre[axis]
            length += ray[3 + axis] * ray[3 + axis]
        length = np.sqrt(length)
        for axis in range(3):
            ray[3 + axis] /= length
        border = (slab_top - ray[2]) / ray[5] if ray[5] < ZERO else ZERO
        end = length - before
        spans[0, 0], spans[0, 1], spans[0, 2] = skip * length, min(border, end), steps[0]
        enter, leave = between_sides(field, ray)
        spans[1, 0] = max(border, enter, skip * length)
        spans[1, 1], spans[1, 2] = min(end, leave), steps[1]
        trace(field, ray, spans, w, towards, shaded)
        seen[n] = shaded[3] > HALF


@compiled
def render_pixels(
    field: Field,
    photos: Photos,
    draws: I64,
    bounds: F32,
    steps: F32,
    out: F32,
) -> None:
    """Colour (N, 3) in 0..1 of photo pixels (N, 3: photo, column, row); NaN where they miss."""
    w = new_work()
    ray, spans = np.zeros(6, np.float32), np.zeros((2, 3), np.float32)
    shaded, towards = np.zeros(5, np.float32), np.zeros(HIDDEN, np.float32)
    for r in range(draws.shape[0]):
        out[r] = np.float32(np.nan)
        photo_ray(photos, draws[r, 0], draws[r, 1], draws[r, 2], ray)
        if not clip(ray, field, spans, bounds):
            continue
        for region in range(2):
            spans[region, 2] = steps[region]
            spans[region, 0] += HALF * steps[region]
        direction_share(field, ray, towards)
        trace(field, ray, spans, w, towards, shaded)
        for c in range(3):
            out[r, c] = shaded[c] / max(ONE - shaded[3], np.float32(1e-3))


@compiled
def cell_densities(
    field: Field, region: int, cells: I64, inside: F32, keep: np.float32, value: F32
) -> None:
    """Look up the density at one point of each cell (N,); remember it, or ``keep`` of the past.

    ``inside`` (N, 3) in 0..1 places the point in the cell; ``value`` is indexed by cell.
    """
    w = new_work()
    size, dims = field.region_cell[region], field.region_dims[region]
    for start in range(0, cells.shape[0], LANES):
        n = min(LANES, cells.shape[0] - start)
        for s in range(n):
            at = cells[start + s] - field.region_first[region]
            w.region[0, s] = region
            for axis in range(2, -1, -1):
                place = np.float32(at % dims[axis]) + inside[start + s, axis]
                at = at // dims[axis]
                w.position[0, axis, s] = field.region_low[region, axis] + size * place
        evaluate_density(field, w, 0, n)
        for s in range(n):
            cell = cells[start + s]
            value[cell] = max(value[cell] * keep, w.sigma[0, s])
