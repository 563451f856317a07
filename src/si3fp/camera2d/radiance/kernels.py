"""Compiled kernels of the radiance field, forward: march, encode, network, composite.

A ray is cut into blocks of `LANES` samples; the network runs over the lanes of a block.
`reference` states the same equations in plain numpy.
"""

from __future__ import annotations

import numpy as np

from si3fp.camera2d.radiance.arrays import (
    F32,
    FEATURES,
    HALF,
    HIDDEN,
    INPUTS,
    LANES,
    MAX_BLOCKS,
    MAX_RAW,
    ONE,
    OPAQUE,
    PRIME_X,
    PRIME_Y,
    ZERO,
    Field,
    Photos,
    Work,
    compiled,
)


@compiled
def new_work() -> Work:
    """Scratch of one thread."""
    blocks = MAX_BLOCKS
    return Work(
        np.zeros((blocks, 3, LANES), np.float32),
        np.zeros((blocks, INPUTS, LANES), np.float32),
        np.zeros((blocks, HIDDEN, LANES), np.float32),
        np.zeros((blocks, HIDDEN + 1, LANES), np.float32),
        np.zeros((blocks, 3, LANES), np.float32),
        np.zeros((blocks, LANES), np.float32),
        np.zeros((blocks, LANES), np.float32),
        np.zeros((blocks, LANES), np.float32),
        np.zeros((blocks, LANES), np.float32),
        np.zeros((blocks, LANES), np.float32),
        np.zeros((blocks, LANES), np.int64),
        np.zeros((blocks, LANES), np.int64),
        np.zeros(blocks, np.int64),
    )


@compiled
def vertex(field: Field, level: int, axis: int, x: float) -> tuple[np.int64, np.float32]:
    """Lower vertex and fraction along one axis, kept inside the level."""
    u = (x - field.low[axis]) * field.per_cell[level]
    u = min(max(u, ZERO), np.float32(field.dims[level, axis] - 1) - np.float32(1e-3))
    i = np.int64(u)
    return i, u - np.float32(i)


@compiled
def row_of(field: Field, level: int, i: np.int64, j: np.int64, k: np.int64) -> np.int64:
    """Row of a vertex in the table; z runs fastest because rays do."""
    mask = field.mask[level]
    if mask == 0:
        at = (i * field.dims[level, 1] + j) * field.dims[level, 2] + k
    else:
        at = ((i * PRIME_X) ^ (j * PRIME_Y) ^ k) & mask
    row: np.int64 = field.first[level] + at
    return row


@compiled
def encode(field: Field, w: Work, b: int, lane: int) -> None:
    """Interpolated features of one sample, all levels of its region."""
    x, y, z = w.position[b, 0, lane], w.position[b, 1, lane], w.position[b, 2, lane]
    levels = field.region_levels[w.region[b, lane]]
    for level in range(levels):
        i, fi = vertex(field, level, 0, x)
        j, fj = vertex(field, level, 1, y)
        k, fk = vertex(field, level, 2, z)
        f0, f1, f2, f3 = ZERO, ZERO, ZERO, ZERO
        for a in range(2):
            wa = fi if a else ONE - fi
            for c in range(2):
                wac = wa * (fj if c else ONE - fj)
                row = field.table[row_of(field, level, i + a, j + c, k)]
                near = wac * (ONE - fk)
                f0 += near * row[0]
                f1 += near * row[1]
                f2 += near * row[2]
                f3 += near * row[3]
                row = field.table[row_of(field, level, i + a, j + c, k + 1)]
                far = wac * fk
                f0 += far * row[0]
                f1 += far * row[1]
                f2 += far * row[2]
                f3 += far * row[3]
        at = level * FEATURES
        w.feature[b, at, lane] = f0
        w.feature[b, at + 1, lane] = f1
        w.feature[b, at + 2, lane] = f2
        w.feature[b, at + 3, lane] = f3
    for at in range(levels * FEATURES, INPUTS - 1):
        w.feature[b, at, lane] = ZERO


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
            leave = np.float32(1e9)
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


@compiled
def evaluate_density(field: Field, w: Work, b: int, n: int) -> None:
    """Hidden layer and density of a block."""
    for lane in range(n):
        encode(field, w, b, lane)
        w.feature[b, INPUTS - 1, lane] = ONE
    feature, hidden = w.feature[b], w.hidden[b]
    hidden[:, :] = ZERO
    for k in range(INPUTS):
        for j in range(HIDDEN):
            v = field.hidden[k, j]
            for s in range(LANES):
                hidden[j, s] += v * feature[k, s]
    raw = np.zeros(LANES, np.float32)
    for j in range(HIDDEN):
        v = field.density[j]
        for s in range(LANES):
            hidden[j, s] = max(hidden[j, s], ZERO)
            raw[s] += v * hidden[j, s]
    for s in range(n):
        log_density = field.prior[w.region[b, s]]
        if w.region[b, s] == 1:
            off = w.position[b, 2, s] * field.prior[3]
            log_density += field.prior[2] * max(ZERO, ONE - off * off)
        w.sigma[b, s] = np.exp(min(raw[s] + log_density, MAX_RAW))


@compiled
def evaluate_colour(field: Field, towards: F32, w: Work, b: int, n: int) -> None:
    """Colour of a block after its density; ``towards`` comes from `direction_share`."""
    hidden, colour, rgb = w.hidden[b], w.colour[b], w.rgb[b]
    for j in range(HIDDEN):
        for s in range(LANES):
            colour[j, s] = towards[j]
    for k in range(HIDDEN):
        for j in range(HIDDEN):
            v = field.colour[k, j]
            for s in range(LANES):
                colour[j, s] += v * hidden[k, s]
    for s in range(LANES):
        colour[HIDDEN, s] = ONE
    rgb[:, :] = ZERO
    for j in range(HIDDEN + 1):
        for s in range(LANES):
            colour[j, s] = max(colour[j, s], ZERO)
        for c in range(3):
            v = field.output[j, c]
            for s in range(LANES):
                rgb[c, s] += v * colour[j, s]
    for c in range(3):
        for s in range(n):
            rgb[c, s] = ONE / (ONE + np.exp(-rgb[c, s]))


@compiled
def direction_share(field: Field, ray: F32, towards: F32) -> None:
    """What the direction of a ray adds to its colour layer."""
    for j in range(HIDDEN):
        towards[j] = (
            field.colour[HIDDEN, j]
            + field.colour[HIDDEN + 1, j] * ray[3]
            + field.colour[HIDDEN + 2, j] * ray[4]
        )


@compiled
def trace(field: Field, ray: F32, spans: F32, w: Work, towards: F32, out: F32) -> int:
    """Composite a ray; ``out`` gets r, g, b, transmittance left, median distance or -1.

    ``towards`` is what `direction_share` wrote. Returns the number of blocks used.
    """
    cursor = np.zeros(2, np.float32)
    cursor[1] = spans[0, 0]
    out[:] = ZERO
    out[4] = np.float32(-1.0)
    left = ONE
    blocks = 0
    while blocks < MAX_BLOCKS and left > OPAQUE:
        n = next_block(field, ray, spans, cursor, w, blocks)
        if n == 0:
            break
        evaluate_density(field, w, blocks, n)
        evaluate_colour(field, towards, w, blocks, n)
        for s in range(n):
            tau = w.sigma[blocks, s] * w.step[blocks, s]
            after = left * np.exp(-tau)
            if out[4] < ZERO and after < HALF:
                share = np.log(left / HALF) / tau
                out[4] = w.distance[blocks, s] + (share - HALF) * w.step[blocks, s]
            w.weight[blocks, s] = left - after
            w.after[blocks, s] = after
            for c in range(3):
                out[c] += (left - after) * w.rgb[blocks, c, s]
            left = after
        blocks += 1
    out[3] = left
    return blocks


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
    start, end = (bounds[5] - ray[2]) / ray[5], (bounds[4] - ray[2]) / ray[5]
    near = wall * bounds[6]
    for axis in range(2):
        d = ray[3 + axis]
        low = field.region_low[1, axis]
        high = low + field.region_cell[1] * np.float32(field.region_dims[1, axis])
        if abs(d) > np.float32(1e-9):
            a, b = (low - ray[axis]) / d, (high - ray[axis]) / d
            start, end = max(start, min(a, b)), min(end, max(a, b))
    spans[0, 0] = near
    spans[0, 1] = (bounds[5] - ray[2]) / ray[5]
    spans[1, 0] = max(start, near)
    spans[1, 1] = end
    return bool(spans[1, 0] < end)


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
