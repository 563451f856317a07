"""Cameras of the renderer: panoramas, photos through a lens, and orthographic views of a facade."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.estate.capture.lens import Distortion, distort, undistort
from numpy.typing import NDArray

from si3fp.geometry.equirect import (
    directions_from_pixels,
    pixels_from_directions,
    world_from_pano_rotation,
)
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import Rigid3

FloatArray = NDArray[np.float64]
NO_DISTORTION = Distortion()


@dataclass(frozen=True)
class Pose:
    """Where a camera stands (m in the world) and looks: compass heading, pitch up, right side down.

    The angles are those of `si3fp.geometry.equirect.world_from_pano_rotation`, for photos too.
    """

    place: tuple[float, float, float]
    heading_deg: float
    pitch_deg: float
    roll_deg: float

    @property
    def world_from_cam(self) -> Rigid3:
        """The pose as a transform; frame ``cam`` is x right, y down, z forward."""
        rotation = world_from_pano_rotation(self.heading_deg, self.pitch_deg, self.roll_deg)
        return Rigid3(rotation, np.array(self.place))


@dataclass(frozen=True, eq=False)
class Equirect:
    """A panorama of 360 x 180 degrees, twice as wide as high; black where not ``seen``."""

    world_from_cam: Rigid3
    width_px: int
    seen: NDArray[np.bool_] | None = None

    @property
    def height_px(self) -> int:
        """Half the width."""
        return self.width_px // 2

    def rays(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Origins and unit directions (N, 3) in the world through pixels (N, 2)."""
        in_cam = directions_from_pixels(pixels, self.width_px, self.height_px)
        return _from_one_place(self.world_from_cam, in_cam)

    def pixels(self, points_in_world: FloatArray) -> FloatArray:
        """Pixels (..., 2) of points (..., 3)."""
        in_cam = self.world_from_cam.inverse().apply(points_in_world)
        return pixels_from_directions(in_cam, self.width_px, self.height_px)


@dataclass(frozen=True, eq=False)
class LensCamera:
    """A pinhole camera whose lens distorts as ``lens`` says (COLMAP's OPENCV model)."""

    world_from_cam: Rigid3
    pinhole: Pinhole
    lens: Distortion = NO_DISTORTION
    seen: None = None

    @property
    def width_px(self) -> int:
        """Width of the photo."""
        return self.pinhole.width_px

    @property
    def height_px(self) -> int:
        """Height of the photo."""
        return self.pinhole.height_px

    def rays(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Origins and unit directions (N, 3) in the world through pixels (N, 2)."""
        in_cam = self.pinhole.unproject(pixels)
        in_cam[:, :2] = undistort(in_cam[:, :2], self.lens)
        in_cam /= np.linalg.norm(in_cam, axis=-1, keepdims=True)
        return _from_one_place(self.world_from_cam, in_cam)

    def pixels(self, points_in_world: FloatArray) -> FloatArray:
        """Pixels (N, 2) of points (N, 3); NaN behind the camera and outside the photo."""
        in_cam = self.world_from_cam.inverse().apply(points_in_world)
        depth = np.where(in_cam[:, 2:] > 0, in_cam[:, 2:], np.nan)
        # Far outside the photo the polynomial of the lens turns back: no place there is sound.
        widest = 1.3 * np.hypot(self.width_px, self.height_px) / 2 / self.pinhole.fx_px
        on_plane = in_cam[:, :2] / depth
        on_plane[np.hypot(*on_plane.T) > widest] = np.nan
        bent = distort(on_plane, self.lens)
        pixels = self.pinhole.project(np.concatenate([bent, np.ones_like(depth)], axis=-1))
        inside = ((pixels >= 0) & (pixels < [self.width_px, self.height_px])).all(axis=-1)
        return np.where(inside[:, None], pixels, np.nan)


@dataclass(frozen=True, eq=False)
class Orthographic:
    """A view along the normal of a facade: one pixel of the grid is one parallel ray.

    The rays start ``standoff_m`` in front of the plane, so that a ray of length d ends
    ``standoff_m - d`` in front of it.
    """

    grid: FacadeGrid
    standoff_m: float
    seen: None = None

    @property
    def width_px(self) -> int:
        """Width of the grid."""
        return self.grid.width_px

    @property
    def height_px(self) -> int:
        """Height of the grid."""
        return self.grid.height_px

    def rays(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Origins and unit directions (N, 3) in the world through pixels (N, 2)."""
        normal = self.grid.normal_in_world
        starts = self.grid.world_from_pixels(pixels) + self.standoff_m * normal
        return starts, np.broadcast_to(-normal, starts.shape)


def _from_one_place(world_from_cam: Rigid3, in_cam: FloatArray) -> tuple[FloatArray, FloatArray]:
    directions = world_from_cam.rotate(in_cam)
    return np.broadcast_to(world_from_cam.translation, directions.shape), directions
