"""Cameras of facade pictures: a raster on the wall, seen straight on or from one place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.estate.facades.styles_draft import Box
from benchmarks.estate.plan import FloatArray
from numpy.typing import NDArray

from si3fp.geometry.rigid import Rigid3


@dataclass(frozen=True)
class FacadeCamera:
    """A picture whose pixels lie evenly on a wall's plane: a rectified photo, or an ortho image.

    ``left_m``, ``top_m`` is its upper left corner in the wall's frame. With an ``eye`` (x, y, z in
    the wall's frame, z > 0) every pixel shows what is on the ray from the eye through its place on
    the wall, so what lies before or behind the plane is shifted as in a rectified photo. Without,
    rays run straight into the wall from ``start_m`` before it.
    """

    world_from_facade: Rigid3
    left_m: float
    top_m: float
    m_per_px: float
    width_px: int
    height_px: int
    eye: tuple[float, float, float] | None = None
    start_m: float = 9.0

    @property
    def seen(self) -> NDArray[np.bool_] | None:
        """All of it."""
        return None

    def _in_facade(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Origins and unit directions in the wall's frame."""
        places = np.zeros((len(pixels), 3))
        places[:, 0] = self.left_m + pixels[:, 0] * self.m_per_px
        places[:, 1] = self.top_m - pixels[:, 1] * self.m_per_px
        if self.eye is None:
            places[:, 2] = self.start_m
            return places, np.broadcast_to([0.0, 0.0, -1.0], places.shape)
        ways = places - np.asarray(self.eye)
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        return np.broadcast_to(self.eye, ways.shape), ways

    def rays(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Origins and unit directions (N, 3) in the world through pixels (N, 2)."""
        right, up, out = self.world_from_facade.rotation.T
        corner = self.world_from_facade.apply(np.array([self.left_m, self.top_m, 0.0]))
        steps = np.stack([right, -up]) * self.m_per_px
        if self.eye is None:
            origins = pixels @ steps + (corner + self.start_m * out)
            return origins, np.broadcast_to(-out, origins.shape)
        eye = self.world_from_facade.apply(np.asarray(self.eye))
        ways = pixels @ steps + (corner - eye)
        ways /= np.sqrt(np.einsum("ij,ij->i", ways, ways))[:, None]
        return np.broadcast_to(eye, ways.shape), ways

    def out_m(self, depth_m: NDArray[np.float32]) -> NDArray[np.float32]:
        """How far before the wall's plane (H, W) the surfaces lie that a depth picture shows."""
        rows, columns = np.mgrid[0 : self.height_px, 0 : self.width_px] + 0.5
        pixels = np.column_stack([columns.ravel(), rows.ravel()])
        origins, directions = self._in_facade(pixels)
        out = origins[:, 2] + directions[:, 2] * depth_m.ravel().astype(np.float64)
        return out.reshape(depth_m.shape).astype(np.float32)

    def shown(self, box: Box, out_m: float) -> FloatArray:
        """Where a box (left, bottom, right, top, metres) that stands ``out_m`` before the wall's
        plane is in the picture: x0, y0, x1, y1 in pixels, y down."""
        x = np.array([box[0], box[2]], np.float64)
        y = np.array([box[3], box[1]], np.float64)
        if self.eye is not None:
            stretch = self.eye[2] / (self.eye[2] - out_m)
            x = self.eye[0] + (x - self.eye[0]) * stretch
            y = self.eye[1] + (y - self.eye[1]) * stretch
        x = (x - self.left_m) / self.m_per_px
        y = (self.top_m - y) / self.m_per_px
        return np.array([x[0], y[0], x[1], y[1]])
