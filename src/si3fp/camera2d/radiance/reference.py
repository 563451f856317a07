"""The equations of the radiance field in plain numpy and float64, slow: what the kernels must give.

For each ray: samples at ``start + k step`` in occupied cells, front first, then slab.

- features: per level, trilinear between the 8 vertices of the cell (Müller et al. 2022, eq. 4)
- hidden ``h = relu(f W1)``, ``sigma = exp(h w + prior)``
- colour ``c = logistic(relu(h W2 + (1, dx, dy) W2') W3)``
- ``w_i = T_i (1 - exp(-sigma_i dt_i))``, ``T_i = exp(-sum_{j<i} sigma_j dt_j)``
- error of a ray: ``sum_c huber(gain_c (sum_i w_i c_i + T background_c) - pixel_c)``
- spread: ``sum_ij w_i w_j |t_i - t_j| + sum_i w_i^2 dt_i / 3`` over the slab
- standing off: ``sum_i w_i max(z_i, 0)`` over the slab
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from si3fp.camera2d.radiance.arrays import (
    FEATURES,
    HIDDEN,
    LANES,
    LEVELS,
    MAX_BLOCKS,
    OPAQUE,
    PRIME_X,
    PRIME_Y,
    Field,
    Photos,
)
from si3fp.camera2d.radiance.layout import SLAB
from si3fp.geometry.rigid import FloatArray

Spans = tuple[tuple[float, float, float], tuple[float, float, float]]


@dataclass(slots=True)
class Gradients:
    """Derivatives of the error with respect to everything that is learned."""

    table: FloatArray
    hidden: FloatArray
    density: FloatArray
    colour: FloatArray
    output: FloatArray
    gain: FloatArray

    @property
    def network(self) -> FloatArray:
        """The network's, in one vector as the kernels keep them."""
        parts = (self.hidden, self.density, self.colour, self.output)
        return np.concatenate([part.ravel() for part in parts])


def vertices(
    field: Field, position: FloatArray, level: int
) -> tuple[NDArray[np.int64], FloatArray]:
    """Rows of the table and weights, both (N, 8), of positions (N, 3) at one level."""
    u = (position - field.low) * float(field.per_cell[level])
    u = np.clip(u, 0.0, field.dims[level] - 1 - 1e-3)
    lower = u.astype(np.int64)
    fraction = u - lower
    rows, weights = [], []
    for corner in np.ndindex(2, 2, 2):
        i, j, k = (lower + corner).T
        if field.mask[level] == 0:
            at = (i * field.dims[level, 1] + j) * field.dims[level, 2] + k
        else:
            at = (i * PRIME_X ^ j * PRIME_Y ^ k) & field.mask[level]
        rows.append(field.first[level] + at)
        weights.append(np.where(corner, fraction, 1.0 - fraction).prod(axis=1))
    return np.stack(rows, axis=1), np.stack(weights, axis=1)


def encode(field: Field, position: FloatArray, region: NDArray[np.int64]) -> FloatArray:
    """Features (N, LEVELS * FEATURES + 1) of positions; the last is 1."""
    features = np.zeros((len(position), LEVELS * FEATURES + 1))
    features[:, -1] = 1.0
    for level in range(LEVELS):
        rows, weights = vertices(field, position, level)
        value = np.einsum("nv,nvf->nf", weights, field.table[rows].astype(np.float64))
        value[level >= field.region_levels[region]] = 0.0
        features[:, level * FEATURES : (level + 1) * FEATURES] = value
    return features


def log_prior(field: Field, z: FloatArray, region: NDArray[np.int64]) -> FloatArray:
    """Log density (N,) that a field starts from, at heights z above the plane."""
    rise = field.prior[2] * np.maximum(0.0, 1.0 - (z * field.prior[3]) ** 2)
    return np.asarray(field.prior[region] + np.where(region == SLAB, rise, 0.0), dtype=np.float64)


def march(
    field: Field, ray: FloatArray, spans: Spans
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Distances, steps and regions of the samples of a ray (6,: origin, unit direction)."""
    distances, steps, regions = [], [], []
    for region, (start, end, step) in enumerate(spans):
        t = start + step * np.arange(max(0, int(np.ceil((end - start) / step))))
        point = ray[:3] + t[:, None] * ray[3:]
        cell = (point - field.region_low[region]) / float(field.region_cell[region])
        index = np.clip(cell.astype(np.int64), 0, field.region_dims[region] - 1)
        flat = np.ravel_multi_index(tuple(index.T), tuple(field.region_dims[region]))
        keep = field.occupied[field.region_first[region] + flat] > 0
        distances.append(t[keep])
        steps.append(np.full(keep.sum(), step))
        regions.append(np.full(keep.sum(), region))
    return np.concatenate(distances), np.concatenate(steps), np.concatenate(regions)


def error_of_ray(
    field: Field,
    ray: FloatArray,
    spans: Spans,
    background: FloatArray,
    gain: FloatArray,
    pixel: FloatArray,
    shape: tuple[float, float],
    huber: float,
    gradients: Gradients | None = None,
) -> tuple[float, FloatArray, float]:
    """Error of one ray, its rendered colour (3,) without gain, and the light left over.

    The gradients of the error, with ``gain`` taken as one row, are added to ``gradients``.
    """
    t, dt, region = march(field, ray, spans)
    position = ray[:3] + t[:, None] * ray[3:]
    features = encode(field, position, region)
    hidden = np.maximum(features @ field.hidden.astype(np.float64), 0.0)
    sigma = np.exp(
        hidden @ field.density.astype(np.float64) + log_prior(field, position[:, 2], region)
    )
    direction = np.array([1.0, ray[3], ray[4]])
    colour_weights = field.colour.astype(np.float64)
    inner = np.maximum(hidden @ colour_weights[:HIDDEN] + direction @ colour_weights[HIDDEN:], 0.0)
    with_bias = np.concatenate([inner, np.ones((len(t), 1))], axis=1)
    rgb = 1.0 / (1.0 + np.exp(-(with_bias @ field.output.astype(np.float64))))

    tau = sigma * dt
    after = np.exp(-np.cumsum(tau))
    before = np.concatenate([[1.0], after[:-1]])
    opaque = np.flatnonzero(after[LANES - 1 :: LANES] <= OPAQUE)
    used = min(len(t), LANES * (opaque[0] + 1) if len(opaque) else len(t), LANES * MAX_BLOCKS)
    live = np.arange(len(t)) < used
    weight = np.where(live, before - after, 0.0)
    left = float(after[used - 1]) if used else 1.0

    rendered = weight @ rgb + left * background
    off = gain * rendered - pixel
    linear = np.clip(off, -huber, huber)
    error = float(np.sum(linear * off - 0.5 * linear**2))
    slab = np.where(region == SLAB, weight, 0.0)
    apart = np.abs(t[:, None] - t[None, :])
    error += shape[0] * float(slab @ apart @ slab + (slab**2) @ dt / 3.0)
    in_front = np.where(region == SLAB, np.maximum(position[:, 2], 0.0), 0.0)
    error += shape[1] * float(weight @ in_front)
    if gradients is None:
        return error, rendered, left

    d_rendered = linear * gain
    gradients.gain += linear * rendered
    d_spread = np.where(region == SLAB, 2.0 * apart @ slab + 2.0 / 3.0 * slab * dt, 0.0)
    d_weight = rgb @ d_rendered + shape[0] * d_spread + shape[1] * in_front
    # w_i depends on tau_i through its own opacity and on tau_j, j < i, through T_i.
    later = np.cumsum((weight * d_weight)[::-1])[::-1] - weight * d_weight
    d_tau = np.where(live, after * d_weight - later - left * (d_rendered @ background), 0.0)
    d_raw = d_tau * tau
    d_out = weight[:, None] * d_rendered * rgb * (1.0 - rgb)
    gradients.output += with_bias.T @ d_out
    d_inner = np.where(inner > 0, d_out @ field.output[:-1].astype(np.float64).T, 0.0)
    gradients.colour[:HIDDEN] += hidden.T @ d_inner
    gradients.colour[HIDDEN:] += np.outer(direction, d_inner.sum(axis=0))
    gradients.density += hidden.T @ d_raw
    d_hidden = np.outer(d_raw, field.density) + d_inner @ colour_weights[:HIDDEN].T
    d_hidden = np.where(hidden > 0, d_hidden, 0.0)
    gradients.hidden += features.T @ d_hidden
    d_features = d_hidden @ field.hidden.astype(np.float64).T
    for level in range(LEVELS):
        rows, weights = vertices(field, position, level)
        part = d_features[:, level * FEATURES : (level + 1) * FEATURES].copy()
        part[level >= field.region_levels[region]] = 0.0
        np.add.at(gradients.table, rows, weights[:, :, None] * part[:, None, :])
    return error, rendered, left


def photo_ray(photos: Photos, photo: int, column: int, row: int) -> FloatArray:
    """Origin and unit direction (6,) through the centre of a pixel."""
    direction = photos.direction[photo].astype(np.float64) @ (column + 0.5, row + 0.5, 1.0)
    direction /= np.linalg.norm(direction)
    return np.concatenate([photos.centre[photo].astype(np.float64), direction])


def zero_gradients(field: Field) -> Gradients:
    """Gradients of zero for a field."""
    return Gradients(
        np.zeros(field.table.shape),
        np.zeros(field.hidden.shape),
        np.zeros(field.density.shape),
        np.zeros(field.colour.shape),
        np.zeros(field.output.shape),
        np.zeros(3),
    )
