"""`FieldLayout`: the boxes, levels and cells of a radiance field over one facade.

Region 1, the slab, holds the wall with its recesses and balconies in fine cells; region 0, the
front, reaches from the slab to the cameras in coarse cells and holds trees, cars and people. All
coordinates are in frame ``facade``, metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from si3fp.camera2d.radiance.arrays import (
    DIRECTIONS,
    FEATURES,
    HIDDEN,
    INPUTS,
    LEVELS,
    Field,
)
from si3fp.config import RadianceConfig
from si3fp.geometry.rigid import FloatArray

FRONT, SLAB = 0, 1
MAX_CELLS = 20_000_000
"""Largest occupancy grid of one region; its cells grow beyond that."""

MIN_LOG2_ENTRIES = 16
"""Rows of a hashed level, as a power of two, which the front of a small wall needs as well."""

NETWORK_SHAPES = (
    (INPUTS, HIDDEN),
    (HIDDEN,),
    (HIDDEN + DIRECTIONS, HIDDEN),
    (HIDDEN + 1, 3),
)


@dataclass(frozen=True, slots=True, eq=False)
class FieldLayout:
    """Where the numbers of a field belong.

    Attributes
    ----------
    low_m, high_m
        (3,) box of both regions.
    cell_m
        (LEVELS,) size of a cell, coarse to fine.
    dims
        (LEVELS, 3) vertices per level.
    first
        (LEVELS + 1,) first row of each level in the table.
    mask
        (LEVELS,) hash mask, 0 where the level has a row per vertex.
    region_low_m, region_cell_m, region_dims, region_first
        (2, 3), (2,), (2, 3), (3,) occupancy cells.
    """

    low_m: FloatArray
    high_m: FloatArray
    cell_m: FloatArray
    dims: NDArray[np.int64]
    first: NDArray[np.int64]
    mask: NDArray[np.int64]
    region_low_m: FloatArray
    region_cell_m: FloatArray
    region_dims: NDArray[np.int64]
    region_first: NDArray[np.int64]

    @classmethod
    def around(
        cls, width_m: float, height_m: float, centres_m: FloatArray, config: RadianceConfig
    ) -> FieldLayout:
        """The layout for a rectangle and the cameras (P, 3) that look at it."""
        margin = config.margin_m
        slab_low = np.array([-margin, -margin, -config.slab_behind_m])
        slab_high = np.array([width_m + margin, height_m + margin, config.slab_front_m])
        low = np.minimum(slab_low, np.append(centres_m[:, :2].min(axis=0) - 0.1, np.inf))
        high = np.maximum(slab_high, centres_m.max(axis=0) + 0.1)

        levels = np.arange(LEVELS - 1, -1, -1, dtype=np.float64)
        cell = config.m_per_px * np.exp2(levels)
        dims = np.floor((high - low) / cell[:, None]).astype(np.int64) + 2
        pixels = width_m * height_m / config.m_per_px**2
        wanted = np.log2(max(pixels * config.entries_per_px, 2.0))
        finest = int(np.clip(np.ceil(wanted), MIN_LOG2_ENTRIES, config.max_log2_entries))
        # A surface has a quarter of the vertices at each coarser level, but the front shares them.
        coarsest = max(finest - 2, MIN_LOG2_ENTRIES)
        hashed = 2 ** np.maximum(np.arange(finest - LEVELS + 1, finest + 1), coarsest)
        dense = dims.prod(axis=1)
        rows = np.minimum(dense, hashed)

        lows = np.stack([np.array([low[0], low[1], config.slab_front_m]), slab_low])
        highs = np.stack([high, slab_high])
        sides = np.maximum(highs - lows, 1e-3)
        wanted_cell = np.array([config.front_cell_m, config.cell_px * config.m_per_px])
        cells: FloatArray = np.maximum(wanted_cell, np.cbrt(sides.prod(axis=1) / MAX_CELLS))
        region_dims = np.floor(sides / cells[:, None]).astype(np.int64) + 1
        return cls(
            low,
            high,
            cell,
            dims,
            np.concatenate([[0], np.cumsum(rows)]),
            np.where(dense <= hashed, 0, hashed - 1),
            lows,
            cells,
            region_dims,
            np.concatenate([[0], np.cumsum(region_dims.prod(axis=1))]),
        )


def new_field(
    layout: FieldLayout, config: RadianceConfig, rng: np.random.Generator
) -> tuple[Field, NDArray[np.float32]]:
    """An empty field with random features, and the vector that its network's arrays view."""
    table = rng.uniform(-1e-3, 1e-3, (int(layout.first[-1]), FEATURES)).astype(np.float32)
    sizes = [int(np.prod(shape)) for shape in NETWORK_SHAPES]
    network = np.zeros(sum(sizes), np.float32)
    parts = np.split(network, np.cumsum(sizes)[:-1])
    hidden, density, colour, output = (
        part.reshape(shape) for part, shape in zip(parts, NETWORK_SHAPES, strict=True)
    )
    for array in (hidden, density, colour, output):
        fan_in = array.shape[0]
        array[...] = rng.normal(0.0, np.sqrt(2.0 / fan_in), array.shape)
    hidden[-1] = 0.0  # biases
    colour[HIDDEN:] = 0.0
    output[-1] = 0.0
    prior = [
        np.log(config.front_density_per_m),
        np.log(config.slab_density_per_m),
        config.plane_rise,
        1.0 / config.plane_rise_m,
    ]
    field = Field(
        layout.low_m.astype(np.float32),
        (1.0 / layout.cell_m).astype(np.float32),
        layout.dims,
        (layout.dims - 1.001).astype(np.float32),
        layout.first[:-1].copy(),
        layout.mask,
        table,
        hidden,
        density,
        colour,
        output,
        np.array(prior, np.float32),
        layout.region_low_m.astype(np.float32),
        layout.region_cell_m.astype(np.float32),
        layout.region_dims,
        layout.region_first[:-1].copy(),
        np.zeros(int(layout.region_first[-1]), np.uint8),
        np.array([config.front_levels, LEVELS], np.int64),
    )
    return field, network
