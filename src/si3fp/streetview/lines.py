"""Horizontal and vertical lines of the views of a facade, and those seen in several views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.config import FacadeBoxConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import OrthoImage

BORDER_M = 0.2
"""A line this near to what was not seen is the edge of the picture, not of the house."""


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """Axis-parallel line segments of one direction on a raster; pixels, (0, 0) a corner.

    Attributes
    ----------
    position_px
        (N,) rows of horizontal or columns of vertical segments.
    low_px, high_px
        (N,) where they begin and end along the other axis.
    """

    position_px: FloatArray
    low_px: FloatArray
    high_px: FloatArray

    def __len__(self) -> int:
        return len(self.position_px)

    @property
    def length_px(self) -> FloatArray:
        """(N,) lengths."""
        return self.high_px - self.low_px

    def select(self, mask: NDArray[np.bool_]) -> Segments:
        """The segments where the mask is True."""
        return Segments(self.position_px[mask], self.low_px[mask], self.high_px[mask])


@dataclass(frozen=True, slots=True, eq=False)
class ViewLines:
    """The lines of one view on the raster at which lines are sought.

    Attributes
    ----------
    seen
        (h, w) bool, what the view saw.
    horizontal, vertical
        Its lines within `FacadeBoxConfig.angle_deg` of the axes, without those along the borders
        of what was seen.
    """

    seen: NDArray[np.bool_]
    horizontal: Segments
    vertical: Segments


def raster_size(grid: FacadeGrid, config: FacadeBoxConfig) -> tuple[int, int]:
    """Width and height in pixels of the grid at `config.m_per_px`, or its own where coarser."""
    m_per_px = max(grid.m_per_px, config.m_per_px)
    return max(1, round(grid.width_m / m_per_px)), max(1, round(grid.height_m / m_per_px))


def find_lines(view: OrthoImage, grid: FacadeGrid, config: FacadeBoxConfig) -> ViewLines:
    """The horizontal and vertical lines of one view.

    Line segment detector of von Grompone von Gioi et al. (2010), doi:10.1109/TPAMI.2008.300, on
    the grey image, its contrast stretched to what was seen. Paper, step S.4: 10 degrees.
    """
    width, height = raster_size(grid, config)
    m_per_px = grid.width_m / width
    size = (width, height)
    share = cv2.resize(view.valid.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    seen = np.asarray(share > 0.99)
    grey = cv2.cvtColor(
        cv2.resize(view.rgb, size, interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2GRAY
    )
    grey = _stretched(np.asarray(grey, np.uint8), seen)

    found = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD).detect(grey)[0]
    ends: FloatArray = (
        np.empty((0, 4)) if found is None else found.reshape(-1, 4).astype(np.float64)
    )
    ends = ends + 0.5  # cv2 puts (0, 0) at the centre of the first pixel
    along = ends[:, 2:] - ends[:, :2]
    tilt = np.rad2deg(np.arctan2(np.abs(along[:, 1]), np.abs(along[:, 0])))
    long = np.hypot(*along.T) * m_per_px >= config.min_length_m
    inside = _inside(ends, seen, BORDER_M / m_per_px)
    horizontal = long & inside & (tilt <= config.angle_deg)
    vertical = long & inside & (tilt >= 90 - config.angle_deg)
    return ViewLines(seen, _segments(ends[horizontal], 1), _segments(ends[vertical], 0))


def _stretched(grey: NDArray[np.uint8], seen: NDArray[np.bool_]) -> NDArray[np.uint8]:
    if not seen.any():
        return grey
    low, high = np.percentile(grey[seen], [1, 99])
    scaled = (grey.astype(np.float32) - low) * (255 / max(high - low, 1.0))
    return np.asarray(np.clip(scaled, 0, 255), np.uint8)


def _inside(ends: FloatArray, seen: NDArray[np.bool_], border_px: float) -> NDArray[np.bool_]:
    """True where at least three quarters of a segment keep clear of what was not seen."""
    padded = np.pad(seen, 1).astype(np.uint8)
    clearance = cv2.distanceTransform(padded, cv2.DIST_L2, 5)[1:-1, 1:-1]
    shares = np.linspace(0, 1, 9)
    points = ends[:, None, :2] * (1 - shares[:, None]) + ends[:, None, 2:] * shares[:, None]
    columns = np.clip(points[..., 0].astype(np.int_), 0, seen.shape[1] - 1)
    rows = np.clip(points[..., 1].astype(np.int_), 0, seen.shape[0] - 1)
    return np.asarray((clearance[rows, columns] > border_px).mean(axis=1) >= 0.75)


def _segments(ends: FloatArray, axis: int) -> Segments:
    across = ends[:, [axis, axis + 2]]
    along = ends[:, [1 - axis, 3 - axis]]
    return Segments(across.mean(axis=1), along.min(axis=1), along.max(axis=1))


def band(
    segments: Segments, positions: int, length: int, reach_px: float, values: FloatArray
) -> FloatArray:
    """Sum of the values of all segments within a reach of each place, (positions + 1, length).

    Row i stands for the pixel boundary i across the segments, column j for the pixel j along them.
    """
    first = np.clip(np.ceil(segments.position_px - reach_px), 0, positions + 1).astype(np.int_)
    last = np.clip(np.floor(segments.position_px + reach_px), -1, positions).astype(np.int_)
    start = np.clip(np.round(segments.low_px), 0, length).astype(np.int_)
    stop = np.clip(np.round(segments.high_px), 0, length).astype(np.int_)
    steps = np.zeros((positions + 2, length + 1))
    last = np.maximum(last, first - 1)
    for rows, columns, sign in (
        (first, start, 1),
        (first, stop, -1),
        (last + 1, start, -1),
        (last + 1, stop, 1),
    ):
        np.add.at(steps, (rows, columns), sign * values)
    total: FloatArray = steps.cumsum(axis=0).cumsum(axis=1)[: positions + 1, :length]
    return total


def relevant_positions(
    segments: Sequence[Segments],
    positions: int,
    length: int,
    m_per_px: float,
    config: FacadeBoxConfig,
) -> FloatArray:
    """Positions (R,) in pixels, ascending, of the lines that several views show.

    A segment is relevant if, along at least half of it, `config.relevant_views` views (all views
    where there are fewer) have a segment within `config.relevant_distance_m`. Relevant segments
    within that distance of one another merge into one line.

    Parameters
    ----------
    segments
        The segments of one direction of each view.
    positions, length
        Size of the raster across and along the segments.
    """
    reach_px = config.relevant_distance_m / m_per_px
    needed = min(config.relevant_views, len(segments))
    shown = np.zeros((positions + 1, length), dtype=np.int_)
    for one in segments:
        shown += band(one, positions, length, reach_px, np.ones(len(one))) > 0.5
    often = np.pad(np.cumsum(shown >= needed, axis=1), ((0, 0), (1, 0)))

    weights = np.zeros(positions + 1)
    for one in segments:
        row = np.clip(np.round(one.position_px), 0, positions).astype(np.int_)
        start = np.clip(np.round(one.low_px), 0, length).astype(np.int_)
        stop = np.clip(np.round(one.high_px), 0, length).astype(np.int_)
        share = (often[row, stop] - often[row, start]) / np.maximum(stop - start, 1)
        relevant = share >= 0.5
        np.add.at(weights, row[relevant], one.length_px[relevant])
    return _peaks(weights, max(1, round(reach_px)))


def _peaks(weights: FloatArray, reach: int) -> FloatArray:
    """Centres of the heaviest groups of weights, none within reach of a heavier one."""
    found = []
    left = weights.copy()
    half = reach // 2
    while left.any():
        peak = int(np.argmax(np.convolve(left, np.ones(2 * half + 1), mode="same")))
        low, high = max(0, peak - half), peak + half + 1
        found.append(float(np.average(np.arange(len(left))[low:high], weights=left[low:high])))
        left[max(0, peak - reach) : peak + reach + 1] = 0.0
    return np.sort(np.array(found))
