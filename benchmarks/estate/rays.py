"""Rays: what a camera is for the renderer, and where rays meet an upright plane."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class Camera(Protocol):
    """A camera of any projection.

    ``seen`` (H, W) is where it is worth rendering; elsewhere the picture stays black.
    """

    @property
    def width_px(self) -> int: ...
    @property
    def height_px(self) -> int: ...
    @property
    def seen(self) -> NDArray[np.bool_] | None: ...
    def rays(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Origins and unit directions (N, 3) in the world through pixels (N, 2) x, y."""
        ...


def distances_to_line(
    place: FloatArray,
    rays: FloatArray,
    start: tuple[float, float] | FloatArray,
    end: tuple[float, float] | FloatArray,
) -> FloatArray:
    """Distances (N,) from a place to the upright plane over a line on the ground; inf beside it.

    ``place`` (2 or 3,) in the world, ``rays`` (N, 2 or 3) directions; the distances are in their
    lengths.
    """
    offset = np.asarray(start, np.float64) - place[:2]
    edge = np.asarray(end, np.float64) - np.asarray(start, np.float64)
    across = rays[:, 0] * edge[1] - rays[:, 1] * edge[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (offset[0] * edge[1] - offset[1] * edge[0]) / across
        share = (offset[0] * rays[:, 1] - offset[1] * rays[:, 0]) / across
    hit = (distance > 0) & (share >= 0) & (share <= 1)
    return np.where(hit, distance, np.inf)
