"""Compiled kernels of the radiance field, backward: from the colour error of rays to gradients."""

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
    U64,
    ZERO,
    Field,
    Lanes,
    Photos,
    Samples,
    Work,
    compiled,
)
from si3fp.camera2d.radiance.kernels import add_lanes, direction_share, lanes_of, new_work, trace
from si3fp.camera2d.radiance.march import clip, photo_ray


@compiled
def shape_gradient(w: Work, blocks: int, spread: np.float32, stand_off: np.float32, v: F32) -> None:
    """Write to ``v`` (blocks, lanes) what each weight in the slab adds to two costs of shape.

    Spread along the ray, ``spread * (sum_ij w_i w_j |t_i - t_j| + sum_i w_i^2 dt_i / 3)`` (Barron
    et al. 2022, doi:10.1109/CVPR52688.2022.00539, in metres), and distance in front of the plane,
    ``stand_off * sum_i w_i max(z_i, 0)``: what looks the same farther back is farther back.
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
                v[b, s] = spread * (two * away + third * p * w.step[b, s])
                v[b, s] += stand_off * max(w.position[b, 2, s], ZERO)
                before += p
                before_moment += p * t


@compiled
def add_products(x: F32, row: int, y: Lanes, z: Lanes) -> None:
    """``x[row] += y * z`` lane by lane; all is read before anything is written."""
    i, a = U64(row), lanes_of(x, row)
    x[i, 0], x[i, 1] = a[0] + y[0] * z[0], a[1] + y[1] * z[1]
    x[i, 2], x[i, 3] = a[2] + y[2] * z[2], a[3] + y[3] * z[3]
    x[i, 4], x[i, 5] = a[4] + y[4] * z[4], a[5] + y[5] * z[5]
    x[i, 6], x[i, 7] = a[6] + y[6] * z[6], a[7] + y[7] * z[7]


@compiled
def block_backward(
    field: Field, ray: F32, w: Work, b: int, d_raw: F32, d_rgb: F32, sums: tuple[F32, F32, F32, F32]
) -> F32:
    """Gradient of a block's features (INPUTS, LANES); the network's is added to ``sums``.

    ``d_raw`` (1, LANES) is the gradient of the log density, ``d_rgb`` (3, LANES) that of the colour
    before its logistic function.
    """
    sum_hidden, sum_density, sum_colour, sum_output = sums
    feature, hidden, colour = w.feature[b], w.hidden[b], w.colour[b]
    d_colour = np.zeros((HIDDEN, LANES), np.float32)
    d_hidden = np.zeros((HIDDEN, LANES), np.float32)
    d_feature = np.zeros((INPUTS, LANES), np.float32)
    raw = lanes_of(d_raw, 0)
    for c in range(3):
        d = lanes_of(d_rgb, c)
        for j in range(HIDDEN + 1):
            add_products(sum_output[j], c, lanes_of(colour, j), d)
        for j in range(HIDDEN):
            add_lanes(d_colour, j, field.output[j, c], d)
    for j in range(HIDDEN):
        for s in range(LANES):
            d_colour[j, s] = d_colour[j, s] if colour[j, s] > ZERO else ZERO
        d = lanes_of(d_colour, j)
        add_lanes(sum_colour[HIDDEN], j, ONE, d)
        add_lanes(sum_colour[HIDDEN + 1], j, ray[3], d)
        add_lanes(sum_colour[HIDDEN + 2], j, ray[4], d)
        for k in range(HIDDEN):
            add_lanes(d_hidden, k, field.colour[k, j], d)
    for k in range(HIDDEN):
        h = lanes_of(hidden, k)
        add_lanes(d_hidden, k, field.density[k], raw)
        add_products(sum_density, k, h, raw)
        for j in range(HIDDEN):
            add_products(sum_colour[k], j, h, lanes_of(d_colour, j))
        for s in range(LANES):
            d_hidden[k, s] = d_hidden[k, s] if hidden[k, s] > ZERO else ZERO
        d = lanes_of(d_hidden, k)
        for i in range(INPUTS):
            add_lanes(d_feature, i, field.hidden[i, k], d)
    for i in range(INPUTS):
        f = lanes_of(feature, i)
        for j in range(HIDDEN):
            add_products(sum_hidden[i], j, f, lanes_of(d_hidden, j))
    return d_feature


@compiled
def train_rays(  # noqa: PLR0912, PLR0915
    field: Field,
    photos: Photos,
    draws: I64,
    noise: F32,
    bounds: F32,
    steps: F32,
    shape: F32,
    huber: np.float32,
    part: int,
    out: Samples,
    gain_gradient: F32,
    network_gradient: F32,
    totals: NDArray[np.float64],
) -> None:
    """Render the rays of one part of a batch and leave all gradients of their colour error.

    ``draws`` (N, 3) photo, column, row; ``noise`` (N, 4) in 0..1, background colour and offset of
    the samples; ``steps`` of front and slab; ``shape``: weights of spread and of standing off.
    Written: ``network_gradient`` (parameters,), ``gain_gradient`` (P, 3), ``totals`` (3,): squared
    error, rays, rays dropped for want of room.
    """
    w = new_work()
    ray, spans, shaded = (
        np.zeros(6, np.float32),
        np.zeros((2, 3), np.float32),
        np.zeros(5, np.float32),
    )
    towards = np.zeros(HIDDEN, np.float32)
    v_shape = np.zeros((MAX_BLOCKS, LANES), np.float32)
    d_raw, d_rgb = np.zeros((1, LANES), np.float32), np.zeros((3, LANES), np.float32)
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
        shape_gradient(w, blocks, shape[0], shape[1], v_shape)
        for b in range(blocks - 1, -1, -1):
            n = w.lanes[b]
            d_raw[0, :] = ZERO
            d_rgb[:, :] = ZERO
            largest = ZERO
            for s in range(n - 1, -1, -1):
                value = v_shape[b, s]
                weight = w.weight[b, s]
                for c in range(3):
                    rgb = w.rgb[b, c, s]
                    value += error[c] * rgb
                    d_rgb[c, s] = error[c] * weight * rgb * (ONE - rgb)
                tau = w.sigma[b, s] * w.step[b, s]
                d_raw[0, s] = (w.after[b, s] * value - suffix) * tau
                suffix += weight * value
                out.cell[part, visited] = w.cell[b, s]
                out.sigma[part, visited] = w.sigma[b, s]
                visited += 1
                largest = max(largest, abs(d_raw[0, s]) + weight)
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
