"""Compiled kernels of the radiance field, backward: rays of a batch, tables, Adam, occupancy.

The first pass runs over parts of a batch, each with its own output; the second over levels of the
table, each in the order of the samples. So the result does not depend on the number of threads.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from si3fp.camera2d.radiance.arrays import (
    DIRECTIONS,
    F32,
    FEATURES,
    HIDDEN,
    I64,
    INPUTS,
    LANES,
    LEVELS,
    MAX_BLOCKS,
    ONE,
    ZERO,
    Field,
    Photos,
    Samples,
    Work,
    compiled,
)
from si3fp.camera2d.radiance.kernels import (
    clip,
    direction_share,
    new_work,
    photo_ray,
    row_of,
    trace,
    vertex,
)


@compiled
def spread_gradient(w: Work, blocks: int, weight: np.float32, v: F32) -> None:
    """Write to ``v`` (blocks, lanes) what each weight adds to the spread along the ray.

    Spread: ``weight * (sum_ij w_i w_j |t_i - t_j| + sum_i w_i^2 dt_i / 3)`` over the slab (Barron
    et al. 2022, doi:10.1109/CVPR52688.2022.00539, in metres).
    """
    total, moment = ZERO, ZERO
    for b in range(blocks):
        for s in range(w.lanes[b]):
            if w.region[b, s] == 1:
                total += w.weight[b, s]
                moment += w.weight[b, s] * w.distance[b, s]
    before, before_moment = ZERO, ZERO
    two, third = np.float32(2.0), np.float32(2.0 / 3.0)
    for b in range(blocks):
        for s in range(w.lanes[b]):
            v[b, s] = ZERO
            if w.region[b, s] == 1:
                p, t = w.weight[b, s], w.distance[b, s]
                after, after_moment = total - before - p, moment - before_moment - p * t
                away = t * (before - after) - before_moment + after_moment
                v[b, s] = weight * (two * away + third * p * w.step[b, s])
                before += p
                before_moment += p * t


@compiled
def block_backward(  # noqa: PLR0912 plain loops, so that they become vector instructions
    field: Field, ray: F32, w: Work, b: int, d_raw: F32, d_rgb: F32, sums: tuple[F32, F32, F32, F32]
) -> F32:
    """Gradient of a block's features (INPUTS, LANES); the network's is added to ``sums``.

    ``d_raw`` (LANES,) is the gradient of the log density, ``d_rgb`` (3, LANES) that of the colour
    before its logistic function.
    """
    sum_hidden, sum_density, sum_colour, sum_output = sums
    feature, hidden, colour = w.feature[b], w.hidden[b], w.colour[b]
    d_colour = np.zeros((HIDDEN, LANES), np.float32)
    d_hidden = np.zeros((HIDDEN, LANES), np.float32)
    d_feature = np.zeros((INPUTS, LANES), np.float32)
    for j in range(HIDDEN + 1):
        for c in range(3):
            for s in range(LANES):
                sum_output[j, c, s] += colour[j, s] * d_rgb[c, s]
    for j in range(HIDDEN):
        for c in range(3):
            v = field.output[j, c]
            for s in range(LANES):
                d_colour[j, s] += v * d_rgb[c, s]
        for s in range(LANES):
            d_colour[j, s] = d_colour[j, s] if colour[j, s] > ZERO else ZERO
            sum_colour[HIDDEN, j, s] += d_colour[j, s]
            sum_colour[HIDDEN + 1, j, s] += d_colour[j, s] * ray[3]
            sum_colour[HIDDEN + 2, j, s] += d_colour[j, s] * ray[4]
    for k in range(HIDDEN):
        v = field.density[k]
        for s in range(LANES):
            d_hidden[k, s] = v * d_raw[s]
            sum_density[k, s] += hidden[k, s] * d_raw[s]
    for j in range(HIDDEN):
        for k in range(HIDDEN):
            v = field.colour[k, j]
            for s in range(LANES):
                d_hidden[k, s] += v * d_colour[j, s]
                sum_colour[k, j, s] += hidden[k, s] * d_colour[j, s]
    for k in range(HIDDEN):
        for s in range(LANES):
            d_hidden[k, s] = d_hidden[k, s] if hidden[k, s] > ZERO else ZERO
    for j in range(HIDDEN):
        for k in range(INPUTS):
            v = field.hidden[k, j]
            for s in range(LANES):
                d_feature[k, s] += v * d_hidden[j, s]
                sum_hidden[k, j, s] += feature[k, s] * d_hidden[j, s]
    return d_feature


@compiled
def train_rays(  # noqa: PLR0912, PLR0915 one fused pass
    field: Field,
    photos: Photos,
    draws: I64,
    noise: F32,
    bounds: F32,
    steps: F32,
    spread: np.float32,
    huber: np.float32,
    part: int,
    out: Samples,
    gain_gradient: F32,
    network_gradient: F32,
    totals: NDArray[np.float64],
) -> None:
    """Render the rays of one part of a batch and leave all gradients of their colour error.

    ``draws`` (N, 3) photo, column, row; ``noise`` (N, 4) in 0..1, background colour and offset of
    the samples; ``steps`` of front and slab. ``network_gradient`` (parameters,), ``gain_gradient``
    (P, 3), ``totals`` (3,): squared error, rays, rays dropped for want of room.
    """
    w = new_work()
    ray, spans, shaded = (
        np.zeros(6, np.float32),
        np.zeros((2, 3), np.float32),
        np.zeros(5, np.float32),
    )
    towards = np.zeros(HIDDEN, np.float32)
    v_spread = np.zeros((MAX_BLOCKS, LANES), np.float32)
    d_raw, d_rgb = np.zeros(LANES, np.float32), np.zeros((3, LANES), np.float32)
    error = np.zeros(3, np.float32)
    sums = (
        np.zeros((INPUTS, HIDDEN, LANES), np.float32),
        np.zeros((HIDDEN, LANES), np.float32),
        np.zeros((HIDDEN + DIRECTIONS, HIDDEN, LANES), np.float32),
        np.zeros((HIDDEN + 1, 3, LANES), np.float32),
    )
    room = out.position.shape[1]
    kept, visited = 0, 0
    for r in range(draws.shape[0]):
        photo = draws[r, 0]
        photo_ray(photos, photo, draws[r, 1], draws[r, 2], ray)
        if not clip(ray, field, spans, bounds):
            continue
        if visited + MAX_BLOCKS * LANES > room:
            totals[2] += 1
            continue
        for region in range(2):
            spans[region, 2] = steps[region]
            spans[region, 0] += noise[r, 3] * steps[region]
        direction_share(field, ray, towards)
        blocks = trace(field, ray, spans, w, towards, shaded)
        pixel = photos.pixels[photos.first[photo] + draws[r, 2] * photos.width[photo] + draws[r, 1]]
        left = shaded[3]
        suffix = ZERO
        for c in range(3):
            rendered = shaded[c] + left * noise[r, c]
            gain = photos.gain[photo, c]
            off = gain * rendered - np.float32(pixel[c]) / np.float32(255.0)
            totals[0] += off * off
            off = min(max(off, -huber), huber)
            gain_gradient[photo, c] += off * rendered
            error[c] = off * gain
            suffix += left * error[c] * noise[r, c]
        totals[1] += 1
        if spread > ZERO:
            spread_gradient(w, blocks, spread, v_spread)
        for b in range(blocks - 1, -1, -1):
            n = w.lanes[b]
            d_raw[:] = ZERO
            d_rgb[:, :] = ZERO
            largest = ZERO
            for s in range(n - 1, -1, -1):
                value = v_spread[b, s] if spread > ZERO else ZERO
                weight = w.weight[b, s]
                for c in range(3):
                    rgb = w.rgb[b, c, s]
                    value += error[c] * rgb
                    d_rgb[c, s] = error[c] * weight * rgb * (ONE - rgb)
                tau = w.sigma[b, s] * w.step[b, s]
                d_raw[s] = (w.after[b, s] * value - suffix) * tau
                suffix += weight * value
                out.cell[part, visited] = w.cell[b, s]
                out.sigma[part, visited] = w.sigma[b, s]
                visited += 1
                largest = max(largest, abs(d_raw[s]) + weight)
            if largest < np.float32(1e-6):
                continue
            d_feature = block_backward(field, ray, w, b, d_raw, d_rgb, sums)
            for s in range(n):
                for axis in range(3):
                    out.position[part, kept, axis] = w.position[b, axis, s]
                for level in range(LEVELS):
                    for f in range(FEATURES):
                        out.gradient[part, level, kept, f] = d_feature[level * FEATURES + f, s]
                if w.region[b, s] == 0:
                    for level in range(field.region_levels[0], LEVELS):
                        for f in range(FEATURES):
                            out.gradient[part, level, kept, f] = ZERO
                kept += 1
    out.filled[part, 0] = kept
    out.filled[part, 1] = visited
    at = 0
    for k in range(INPUTS):
        for j in range(HIDDEN):
            network_gradient[at] = sums[0][k, j].sum()
            at += 1
    for j in range(HIDDEN):
        network_gradient[at] = sums[1][j].sum()
        at += 1
    for k in range(HIDDEN + DIRECTIONS):
        for j in range(HIDDEN):
            network_gradient[at] = sums[2][k, j].sum()
            at += 1
    for k in range(HIDDEN + 1):
        for c in range(3):
            network_gradient[at] = sums[3][k, c].sum()
            at += 1


@compiled
def scatter(field: Field, level: int, samples: Samples, gradient: F32) -> None:
    """Add the samples' gradients of one level to the table's, in the order of the samples."""
    for part in range(samples.filled.shape[0]):
        for n in range(samples.filled[part, 0]):
            g = samples.gradient[part, level, n]
            if g[0] == ZERO and g[1] == ZERO and g[2] == ZERO and g[3] == ZERO:
                continue
            p = samples.position[part, n]
            i, fi = vertex(field, level, 0, p[0])
            j, fj = vertex(field, level, 1, p[1])
            k, fk = vertex(field, level, 2, p[2])
            for a in range(2):
                wa = fi if a else ONE - fi
                for c in range(2):
                    wac = wa * (fj if c else ONE - fj)
                    near, far = wac * (ONE - fk), wac * fk
                    row = gradient[row_of(field, level, i + a, j + c, k)]
                    row[0] += near * g[0]
                    row[1] += near * g[1]
                    row[2] += near * g[2]
                    row[3] += near * g[3]
                    row = gradient[row_of(field, level, i + a, j + c, k + 1)]
                    row[0] += far * g[0]
                    row[1] += far * g[1]
                    row[2] += far * g[2]
                    row[3] += far * g[3]


@compiled
def adam(table: F32, gradient: F32, moments: F32, first: int, last: int, rates: F32) -> None:
    """One Adam step on the touched rows first..last; their gradient becomes zero.

    ``moments`` (E, 2, FEATURES); ``rates``: step size with both bias corrections, beta 1, beta 2,
    epsilon.
    """
    rate, beta1, beta2, epsilon = rates[0], rates[1], rates[2], rates[3]
    for e in range(first, last):
        g = gradient[e]
        if g[0] == ZERO and g[1] == ZERO and g[2] == ZERO and g[3] == ZERO:
            continue
        for f in range(FEATURES):
            mean = beta1 * moments[e, 0, f] + (ONE - beta1) * g[f]
            square = beta2 * moments[e, 1, f] + (ONE - beta2) * g[f] * g[f]
            moments[e, 0, f] = mean
            moments[e, 1, f] = square
            table[e, f] -= rate * mean / (np.sqrt(square) + epsilon)
            g[f] = ZERO


@compiled
def visit(samples: Samples, value: F32, decay: np.float32) -> None:
    """Let the cells of the occupancy grid forget, and remember the densities just seen."""
    for part in range(samples.filled.shape[0]):
        for n in range(samples.filled[part, 1]):
            cell = samples.cell[part, n]
            value[cell] = max(value[cell] * decay, samples.sigma[part, n])


@compiled
def refresh(
    value: F32, first: int, dims: I64, threshold: np.float32, occupied: NDArray[np.uint8]
) -> None:
    """Occupied are the cells of one region above the threshold, and their six neighbours."""
    nx, ny, nz = dims[0], dims[1], dims[2]
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                at = first + (i * ny + j) * nz + k
                occupied[at] = 0
                if (
                    value[at] > threshold
                    or (k > 0 and value[at - 1] > threshold)
                    or (k < nz - 1 and value[at + 1] > threshold)
                    or (j > 0 and value[at - nz] > threshold)
                    or (j < ny - 1 and value[at + nz] > threshold)
                    or (i > 0 and value[at - ny * nz] > threshold)
                    or (i < nx - 1 and value[at + ny * nz] > threshold)
                ):
                    occupied[at] = 1
