"""Compiled kernels of the radiance field, forward: encode, network, composite.

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
    U64,
    ZERO,
    Field,
    Lanes,
    Rows,
    Work,
    compiled,
)
from si3fp.camera2d.radiance.march import next_block


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
def corners(
    field: Field, level: int, x: np.float32, y: np.float32, z: np.float32
) -> tuple[Rows, Lanes]:
    """Rows of the table and weights of the eight vertices around a place; z runs fastest."""
    scale = field.per_cell[level]
    u = min(max((x - field.low[0]) * scale, ZERO), field.top[level, 0])
    v = min(max((y - field.low[1]) * scale, ZERO), field.top[level, 1])
    w = min(max((z - field.low[2]) * scale, ZERO), field.top[level, 2])
    i, j, k = np.int64(u), np.int64(v), np.int64(w)
    u, v, w = u - np.float32(i), v - np.float32(j), w - np.float32(k)
    first, mask = field.first[level], field.mask[level]
    if mask == 0:
        across = field.dims[level, 2]
        a = first + (i * field.dims[level, 1] + j) * across + k
        b, c = a + across, a + across * field.dims[level, 1]
        d = c + across
        e, f, g, h = a + 1, b + 1, c + 1, d + 1
    else:
        near, far = i * PRIME_X, (i + 1) * PRIME_X
        low, high = j * PRIME_Y, (j + 1) * PRIME_Y
        a, e = first + ((near ^ low ^ k) & mask), first + ((near ^ low ^ (k + 1)) & mask)
        b, f = first + ((near ^ high ^ k) & mask), first + ((near ^ high ^ (k + 1)) & mask)
        c, g = first + ((far ^ low ^ k) & mask), first + ((far ^ low ^ (k + 1)) & mask)
        d, h = first + ((far ^ high ^ k) & mask), first + ((far ^ high ^ (k + 1)) & mask)
    # Unsigned, so that no index is tested for counting from the end.
    rows = (U64(a), U64(b), U64(c), U64(d), U64(e), U64(f), U64(g), U64(h))
    p, q, r, s = (ONE - u) * (ONE - v), (ONE - u) * v, u * (ONE - v), u * v
    n = ONE - w
    return rows, (p * n, q * n, r * n, s * n, p * w, q * w, r * w, s * w)


@compiled
def plus_row(f: Lanes, weight: np.float32, table: F32, row: np.uint64) -> Lanes:
    """``f + weight * table[row]``."""
    return (
        f[0] + weight * table[row, 0],
        f[1] + weight * table[row, 1],
        f[2] + weight * table[row, 2],
        f[3] + weight * table[row, 3],
    )


@compiled
def encode(field: Field, w: Work, b: int, lane: int) -> None:
    """Interpolated features of one sample, all levels of its region."""
    x, y, z = w.position[b, 0, lane], w.position[b, 1, lane], w.position[b, 2, lane]
    levels = field.region_levels[w.region[b, lane]]
    feature, table = w.feature[b], field.table
    for level in range(levels):
        r, g = corners(field, level, x, y, z)
        f = plus_row((ZERO, ZERO, ZERO, ZERO), g[0], table, r[0])
        f = plus_row(plus_row(f, g[1], table, r[1]), g[2], table, r[2])
        f = plus_row(plus_row(f, g[3], table, r[3]), g[4], table, r[4])
        f = plus_row(plus_row(f, g[5], table, r[5]), g[6], table, r[6])
        f = plus_row(f, g[7], table, r[7])
        at = level * FEATURES
        feature[at, lane], feature[at + 1, lane] = f[0], f[1]
        feature[at + 2, lane], feature[at + 3, lane] = f[2], f[3]
    for at in range(levels * FEATURES, INPUTS - 1):
        feature[at, lane] = ZERO
    feature[INPUTS - 1, lane] = ONE


@compiled
def lanes_of(x: F32, row: int) -> Lanes:
    """The lanes of one row."""
    i = U64(row)
    return (x[i, 0], x[i, 1], x[i, 2], x[i, 3], x[i, 4], x[i, 5], x[i, 6], x[i, 7])


@compiled
def add_lanes(x: F32, row: int, scale: np.float32, y: Lanes) -> None:
    """``x[row] += scale * y``; all is read before anything is written."""
    i, a = U64(row), lanes_of(x, row)
    x[i, 0], x[i, 1] = a[0] + scale * y[0], a[1] + scale * y[1]
    x[i, 2], x[i, 3] = a[2] + scale * y[2], a[3] + scale * y[3]
    x[i, 4], x[i, 5] = a[4] + scale * y[4], a[5] + scale * y[5]
    x[i, 6], x[i, 7] = a[6] + scale * y[6], a[7] + scale * y[7]


@compiled
def evaluate_density(field: Field, w: Work, b: int, n: int) -> None:
    """Hidden layer and density of a block."""
    for lane in range(n):
        encode(field, w, b, lane)
    feature, hidden, sigma, z = w.feature[b], w.hidden[b], w.sigma[b : b + 1], w.position[b, 2]
    hidden[:, :] = ZERO
    for k in range(INPUTS):
        f = lanes_of(feature, k)
        for j in range(HIDDEN):
            add_lanes(hidden, j, field.hidden[k, j], f)
    sigma[0, :] = ZERO
    for j in range(HIDDEN):
        for s in range(LANES):
            hidden[j, s] = max(hidden[j, s], ZERO)
        add_lanes(sigma, 0, field.density[j], lanes_of(hidden, j))
    for s in range(n):
        log_density = field.prior[w.region[b, s]]
        if w.region[b, s] == 1:
            off = z[s] * field.prior[3]
            log_density += field.prior[2] * max(ZERO, ONE - off * off)
        sigma[0, s] = np.exp(min(sigma[0, s] + log_density, MAX_RAW))


@compiled
def evaluate_colour(field: Field, towards: F32, w: Work, b: int, n: int) -> None:
    """Colour of a block after its density; ``towards`` comes from `direction_share`."""
    hidden, colour, rgb = w.hidden[b], w.colour[b], w.rgb[b]
    for j in range(HIDDEN):
        for s in range(LANES):
            colour[j, s] = towards[j]
    for s in range(LANES):
        colour[HIDDEN, s] = ONE
    for k in range(HIDDEN):
        h = lanes_of(hidden, k)
        for j in range(HIDDEN):
            add_lanes(colour, j, field.colour[k, j], h)
    rgb[:, :] = ZERO
    for j in range(HIDDEN + 1):
        for s in range(LANES):
            colour[j, s] = max(colour[j, s], ZERO)
        for c in range(3):
            add_lanes(rgb, c, field.output[j, c], lanes_of(colour, j))
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
