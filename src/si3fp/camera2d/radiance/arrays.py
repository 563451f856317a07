"""The arrays that the compiled kernels of the radiance field share, and how kernels are compiled.

Everything is in frame ``facade``, metres, float32. Numba's cache notices an edit of the file that
holds a kernel, not of the kernels that it calls: after editing one, delete ``__pycache__``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, ParamSpec, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

P = ParamSpec("P")
R = TypeVar("R")
F32 = NDArray[np.float32]
I64 = NDArray[np.int64]
Rows = tuple[np.uint64, ...]
Lanes = tuple[np.float32, ...]

LANES = 8
FEATURES = 4
LEVELS = 6
HIDDEN = 16
INPUTS = LEVELS * FEATURES + 1
DIRECTIONS = 3
MAX_BLOCKS = 32
PRIME_X, PRIME_Y = 2654435761, 805459861
U64 = np.uint64
ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
FAR = np.float32(1e9)
MAX_RAW = np.float32(8.0)
OPAQUE = np.float32(1e-3)

# The kernels write out the lanes of a block and the features of a row; LLVM turns them into vector
# instructions only with this, which makes them 3 to 6 times as fast.
numba.config.SLP_VECTORIZE = 1  # type: ignore[attr-defined]


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """The function compiled without the interpreter's lock; cached where the disk allows it."""
    options: dict[str, Any] = {"nogil": True, "fastmath": True, "error_model": "numpy"}
    try:
        return cast(Callable[P, R], numba.njit(cache=True, **options)(function))
    except RuntimeError:  # numba found no folder that it may write to
        return cast(Callable[P, R], numba.njit(**options)(function))


class Field(NamedTuple):
    """What the kernels read of the field; region 0 is the front, 1 the slab at the wall."""

    low: F32  # (3,) corner of the encoded box
    per_cell: F32  # (LEVELS,) cells per metre
    dims: I64  # (LEVELS, 3) vertices
    top: F32  # (LEVELS, 3) largest place, in cells
    first: I64  # (LEVELS,) first row of the level in the table
    mask: I64  # (LEVELS,) hash mask, 0 for a dense level
    table: F32  # (E, FEATURES)
    hidden: F32  # (INPUTS, HIDDEN), last row is the bias
    density: F32  # (HIDDEN,)
    colour: F32  # (HIDDEN + DIRECTIONS, HIDDEN)
    output: F32  # (HIDDEN + 1, 3), last row is the bias
    prior: F32  # (4,) log density of front and slab, rise at the plane, 1 / half width of the rise
    region_low: F32  # (2, 3)
    region_cell: F32  # (2,) metres
    region_dims: I64  # (2, 3)
    region_first: I64  # (2,)
    occupied: NDArray[np.uint8]  # cells of both regions
    region_levels: I64  # (2,) levels used


class Photos(NamedTuple):
    """Pixels and cameras for training, packed."""

    centre: F32  # (P, 3)
    direction: F32  # (P, 3, 3) direction = matrix @ (x_px, y_px, 1)
    gain: F32  # (P, 3)
    pixels: NDArray[np.uint8]  # (N, 3)
    first: I64  # (P,) first pixel
    width: I64  # (P,)


class Samples(NamedTuple):
    """What one batch leaves for the tables and the occupancy grid, one row of parts."""

    position: F32  # (parts, N, 3)
    gradient: F32  # (parts, LEVELS, N, FEATURES)
    cell: NDArray[np.int32]  # (parts, N)
    sigma: F32  # (parts, N)
    filled: I64  # (parts, 2) rows with gradient, rows visited


class Work(NamedTuple):
    """Scratch of one ray: MAX_BLOCKS blocks of LANES samples."""

    position: F32
    feature: F32
    hidden: F32
    colour: F32
    rgb: F32
    sigma: F32
    distance: F32
    step: F32
    weight: F32
    after: F32
    region: I64
    cell: I64
    lanes: I64
