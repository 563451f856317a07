"""`FacadeGrid`: the only place where pixels of a facade become metres and back.

Frame ``facade``: origin at the lower left corner seen from outside, x right, y up, z along the
outward normal. Frame ``img``: origin at the upper left corner of the upper left pixel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from si3fp.errors import InputError
from si3fp.geometry.rigid import FloatArray, Rigid3


@dataclass(frozen=True, slots=True, eq=False)
class FacadeGrid:
    """An orthographic pixel grid on a facade plane.

    Attributes
    ----------
    world_from_facade
        Pose of the facade frame.
    width_px, height_px
        Size of the image.
    m_per_px
        Size of a square pixel in metres.
    """

    world_from_facade: Rigid3
    width_px: int
    height_px: int
    m_per_px: float

    def __post_init__(self) -> None:
        if self.width_px < 1 or self.height_px < 1:
            raise InputError(f"A facade grid of {self.width_px} x {self.height_px} px is empty.")
        if not (np.isfinite(self.m_per_px) and self.m_per_px > 0):
            raise InputError(f"Metres per pixel must be positive, got {self.m_per_px}.")

    @classmethod
    def covering(
        cls, world_from_facade: Rigid3, width_m: float, height_m: float, m_per_px: float
    ) -> FacadeGrid:
        """The smallest grid with this pixel size that covers width_m x height_m."""
        if not (np.isfinite(width_m) and np.isfinite(height_m) and width_m > 0 and height_m > 0):
            raise InputError(f"A facade of {width_m} x {height_m} m has no area.")
        return cls(
            world_from_facade,
            max(1, int(np.ceil(width_m / m_per_px - 1e-9))),
            max(1, int(np.ceil(height_m / m_per_px - 1e-9))),
            m_per_px,
        )

    @property
    def width_m(self) -> float:
        """Width of the grid in metres."""
        return self.width_px * self.m_per_px

    @property
    def height_m(self) -> float:
        """Height of the grid in metres."""
        return self.height_px * self.m_per_px

    @property
    def normal_in_world(self) -> FloatArray:
        """Outward unit normal (3,)."""
        normal: FloatArray = self.world_from_facade.rotation[:, 2]
        return normal

    def facade_from_pixels(self, pixels: ArrayLike) -> FloatArray:
        """Metres (..., 2) in the facade plane of pixel coordinates (..., 2)."""
        xy: FloatArray = np.asarray(pixels, dtype=np.float64)
        return np.stack(
            [xy[..., 0] * self.m_per_px, (self.height_px - xy[..., 1]) * self.m_per_px], axis=-1
        )

    def pixels_from_facade(self, points_m: ArrayLike) -> FloatArray:
        """Pixel coordinates (..., 2) of points (..., 2) in the facade plane in metres."""
        xy: FloatArray = np.asarray(points_m, dtype=np.float64)
        return np.stack(
            [xy[..., 0] / self.m_per_px, self.height_px - xy[..., 1] / self.m_per_px], axis=-1
        )

    def world_from_pixels(self, pixels: ArrayLike) -> FloatArray:
        """World points (..., 3) on the facade plane of pixel coordinates (..., 2)."""
        plane = self.facade_from_pixels(pixels)
        return self.world_from_facade.apply(
            np.concatenate([plane, np.zeros((*plane.shape[:-1], 1))], axis=-1)
        )

    def cropped(self, left_px: int, top_px: int, right_px: int, bottom_px: int) -> FacadeGrid:
        """The grid of the half-open pixel box; its frame starts at the box's lower left corner."""
        corner = self.world_from_pixels([left_px, bottom_px])
        return replace(
            self,
            world_from_facade=Rigid3(self.world_from_facade.rotation, corner),
            width_px=right_px - left_px,
            height_px=bottom_px - top_px,
        )
