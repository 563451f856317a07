"""Compiled kernels of the radiance field: rays of photos, and their samples in occupied cells."""

from __future__ import annotations

import numpy as np

from si3fp.camera2d.radiance.arrays import (
    F32,
    FAR,
    LANES,
    ONE,
    ZERO,
    Field,
    Photos,
    Work,
    compiled,
)


@compiled
def photo_ray(photos: Photos, photo: int, x: float, y: float, ray: F32) -> None:
    """Origin and unit direction of the ray through the centre of pixel (x, y) of a photo."""
    matrix = photos.direction[photo]
    u, v = np.float32(x) + np.float32(0.5), np.float32(y) + np.float32(0.5)
    length = ZERO
    for axis in range(3):
        ray[axis] = photos.centre[photo, axis]
        d = matrix[axis, 0] * u + matrix[axis, 1] * v + matrix[axis, 2]
        ray[3 + axis] = d
        length += d * d
    length = np.sqrt(length)
    for axis in range(3):
        ray[3 + axis] /= length


@compiled
def between_sides(field: Field, ray: F32) -> tuple[np.float32, np.float32]:
    """Distances at which a ray enters and leaves the slab by its left, right, bottom or top."""
    enter, leave = -FAR, FAR
    for axis in range(2):
        d = ray[3 + axis]
        low = field.region_low[1, axis]
        high = low + field.region_cell[1] * np.float32(field.region_dims[1, axis])
        if abs(d) > np.float32(1e-9):
            a, b = (low - ray[axis]) / d, (high - ray[axis]) / d
            enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
    return enter, leave


@compiled
def clip(ray: F32, field: Field, spans: F32, bounds: F32) -> bool:
    """Spans of a ray that looks at the wall: front, then slab; False if it misses the rectangle.

    ``bounds``: left, right, bottom, top of the rectangle on the plane, z where the slab ends, z
    where it starts, share of the way to the wall that is skipped.
    """
    if ray[5] > np.float32(-0.02) or ray[2] <= ZERO:
        return False
    wall = -ray[2] / ray[5]
    x, y = ray[0] + wall * ray[3], ray[1] + wall * ray[4]
    if x < bounds[0] or x > bounds[1] or y < bounds[2] or y > bounds[3]:
        return False
    enter, leave = between_sides(field, ray)
    start = max(enter, (bounds[5] - ray[2]) / ray[5])
    end = min(leave, (bounds[4] - ray[2]) / ray[5])
    near = wall * bounds[6]
    spans[0, 0] = near
    spans[0, 1] = (bounds[5] - ray[2]) / ray[5]
    spans[1, 0] = max(start, near)
    spans[1, 1] = end
    return bool(spans[1, 0] < end)


@compiled
def next_block(field: Field, ray: F32, spans: F32, cursor: F32, w: Work, b: int) -> int:
    """Fill block b with the next occupied samples of a ray; the number of lanes filled.

    ``ray`` is origin and unit direction, ``spans`` start, end and step per region, ``cursor`` the
    region and the distance reached.
    """
    n = 0
    while n < LANES and cursor[0] < 2:
        r = np.int64(cursor[0])
        t, end, step = cursor[1], spans[r, 1], spans[r, 2]
        cell = field.region_cell[r]
        found = False
        at = 0
        while t < end:
            at = 0
            leave = FAR
            for axis in range(3):
                d = ray[3 + axis]
                p = ray[axis] + t * d - field.region_low[r, axis]
                i = min(max(np.int64(p / cell), 0), field.region_dims[r, axis] - 1)
                at = at * field.region_dims[r, axis] + i
                if abs(d) > np.float32(1e-9):
                    edge = np.float32(i + (1 if d > 0 else 0)) * cell
                    leave = min(leave, (edge - p) / d)
            at += field.region_first[r]
            if field.occupied[at]:
                found = True
                break
            t += step * max(ONE, np.float32(np.ceil(leave / step)))
        if not found:
            cursor[0] += ONE
            if r == 0:
                cursor[1] = spans[1, 0]
            continue
        for axis in range(3):
            w.position[b, axis, n] = ray[axis] + t * ray[3 + axis]
        w.distance[b, n] = t
        w.step[b, n] = step
        w.region[b, n] = r
        w.cell[b, n] = at
        cursor[1] = t + step
        n += 1
    w.lanes[b] = n
    return n
