"""Compiled kernels of the radiance field: gradients into tables, Adam, the occupancy grid.

Each level of the table is one task, in the order of the samples, so that the result does not
depend on the number of threads.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from si3fp.camera2d.radiance.arrays import (
    F32,
    FEATURES,
    I64,
    ONE,
    ZERO,
    Field,
    Lanes,
    Samples,
    compiled,
)
from si3fp.camera2d.radiance.kernels import corners


@compiled
def add_row(table: F32, row: np.uint64, weight: np.float32, g: Lanes) -> None:
    """``table[row] += weight * g``."""
    a = (
        table[row, 0] + weight * g[0],
        table[row, 1] + weight * g[1],
        table[row, 2] + weight * g[2],
        table[row, 3] + weight * g[3],
    )
    table[row, 0], table[row, 1], table[row, 2], table[row, 3] = a


@compiled
def scatter(field: Field, level: int, samples: Samples, gradient: F32) -> None:
    """Add the samples' gradients of one level to the table's, in the order of the samples."""
    for part in range(samples.filled.shape[0]):
        for n in range(samples.filled[part, 0]):
            g = samples.gradient[part, level, n]
            if g[0] == ZERO and g[1] == ZERO and g[2] == ZERO and g[3] == ZERO:
                continue
            p = samples.position[part, n]
            rows, weights = corners(field, level, p[0], p[1], p[2])
            values = (g[0], g[1], g[2], g[3])
            add_row(gradient, rows[0], weights[0], values)
            add_row(gradient, rows[1], weights[1], values)
            add_row(gradient, rows[2], weights[2], values)
            add_row(gradient, rows[3], weights[3], values)
            add_row(gradient, rows[4], weights[4], values)
            add_row(gradient, rows[5], weights[5], values)
            add_row(gradient, rows[6], weights[6], values)
            add_row(gradient, rows[7], weights[7], values)


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
            moments[e, 0, f] = beta1 * moments[e, 0, f] + (ONE - beta1) * g[f]
            moments[e, 1, f] = beta2 * moments[e, 1, f] + (ONE - beta2) * g[f] * g[f]
            table[e, f] -= rate * moments[e, 0, f] / (np.sqrt(moments[e, 1, f]) + epsilon)
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
