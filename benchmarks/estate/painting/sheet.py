"""A rectangle of wall or ground that is painted: its size in metres and in pixels."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from benchmarks.estate.painting import noise
from benchmarks.estate.painting.noise import Field
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Sheet:
    """Width and height in metres and pixels; x to the right, y up from the lower left corner.

    Row 0 of every array is the top.
    """

    width_m: float
    height_m: float
    width_px: int
    height_px: int

    @property
    def m_per_px(self) -> float:
        """The larger side of a pixel in metres."""
        return max(self.width_m / self.width_px, self.height_m / self.height_px)

    @property
    def x_edges_m(self) -> FloatArray:
        """Left and right borders of the columns, (W + 1,), ascending."""
        return np.linspace(0.0, self.width_m, self.width_px + 1)

    @property
    def y_edges_m(self) -> FloatArray:
        """Upper and lower borders of the rows, (H + 1,), descending."""
        return np.linspace(self.height_m, 0.0, self.height_px + 1)

    @property
    def x_m(self) -> Field:
        """Centres of the columns, (W,)."""
        edges = self.x_edges_m
        return ((edges[1:] + edges[:-1]) / 2).astype(np.float32)

    @property
    def y_m(self) -> Field:
        """Centres of the rows, (H,), descending."""
        edges = self.y_edges_m
        return ((edges[1:] + edges[:-1]) / 2).astype(np.float32)

    def coarser(self, m_per_px: float) -> Sheet:
        """The same rectangle with pixels of at least that size."""
        width_px = max(4, min(self.width_px, round(self.width_m / m_per_px)))
        height_px = max(4, min(self.height_px, round(self.height_m / m_per_px)))
        return Sheet(self.width_m, self.height_m, width_px, height_px)

    def fitted(self, field: Field) -> Field:
        """A coarser array of the same rectangle, drawn out to this sheet's pixels."""
        size = (self.width_px, self.height_px)
        return cv2.resize(field, size, interpolation=cv2.INTER_LINEAR)

    def soft_clouds(
        self,
        cell_m: float | tuple[float, float],
        octaves: int,
        rng: np.random.Generator,
    ) -> Field:
        """Clouds without fine detail, cheap: no finer than half the smallest octave."""
        finest = min(cell_m) if isinstance(cell_m, tuple) else cell_m
        coarse = self.coarser(finest / 2 ** (octaves + 1))
        return self.fitted(coarse.clouds(cell_m, octaves, rng))

    def box(self, x0_m: float, y0_m: float, x1_m: float, y1_m: float) -> tuple[slice, slice]:
        """Rows and columns whose centres lie in the box."""
        per_x, per_y = self.width_px / self.width_m, self.height_px / self.height_m
        columns = np.clip(np.round([x0_m * per_x, x1_m * per_x]), 0, self.width_px).astype(int)
        rows = np.clip(
            np.round([(self.height_m - y1_m) * per_y, (self.height_m - y0_m) * per_y]),
            0,
            self.height_px,
        ).astype(int)
        return slice(rows[0], rows[1]), slice(columns[0], columns[1])

    def clouds(
        self,
        cell_m: float | tuple[float, float],
        octaves: int,
        rng: np.random.Generator,
        gain: float = 0.5,
    ) -> Field:
        """Clouds of noise (H, W), deviation about 1; the cell is in metres, or (up, along)."""
        up_m, along_m = cell_m if isinstance(cell_m, tuple) else (cell_m, cell_m)
        cell_px = (
            up_m * self.height_px / self.height_m,
            along_m * self.width_px / self.width_m,
        )
        return noise.clouds(self.height_px, self.width_px, cell_px, octaves, rng, gain)

    def grain(self, rng: np.random.Generator) -> Field:
        """White noise (H, W), deviation 1."""
        return noise.octave(self.height_px, self.width_px, (1.0, 1.0), rng)

    def specks(self, per_m2: float, radius_m: float, rng: np.random.Generator) -> Field:
        """Soft spots in 0..1."""
        pixel_m2 = self.width_m * self.height_m / (self.width_px * self.height_px)
        share = min(per_m2 * pixel_m2, 0.5)
        return noise.specks(self.height_px, self.width_px, share, radius_m / self.m_per_px, rng)


def covered(starts_m: FloatArray, ends_m: FloatArray, edges_m: FloatArray) -> Field:
    """Share of every pixel (N,) that lies in ascending, disjoint intervals; edges are (N + 1,)."""
    if len(starts_m) == 0:
        return np.zeros(len(edges_m) - 1, np.float32)
    places = np.stack([starts_m, ends_m], axis=1).ravel()
    lengths = np.stack([np.zeros(len(starts_m)), ends_m - starts_m], axis=1).ravel()
    total = np.interp(edges_m, places, np.cumsum(lengths))
    return np.abs(np.diff(total) / np.diff(edges_m)).astype(np.float32)


def smooth(low: float, high: float, values: Field) -> Field:
    """0 up to ``low``, 1 from ``high`` on, and smooth between (the other way where low > high)."""
    share = np.clip((values - low) / (high - low), 0.0, 1.0).astype(np.float32)
    return share * share * (3 - 2 * share)
