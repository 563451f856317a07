"""Local east-north-up frames on the WGS 84 ellipsoid (numpy only).

Formulas: Snyder (1987), Map Projections, USGS PP 1395; inverse by Bowring's iteration (1976).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from si3fp.errors import InputError
from si3fp.geometry.rigid import FloatArray

SEMI_MAJOR_M = 6_378_137.0
FLATTENING = 1 / 298.257223563
ECCENTRICITY2 = FLATTENING * (2 - FLATTENING)


@dataclass(frozen=True, slots=True)
class GeoOrigin:
    """Origin of a world frame (x east, y north, z up): WGS 84 degrees and metres."""

    lat_deg: float
    lon_deg: float
    height_m: float

    def __post_init__(self) -> None:
        if not (-90 <= self.lat_deg <= 90 and -180 <= self.lon_deg <= 180):
            raise InputError(
                f"Latitude {self.lat_deg} or longitude {self.lon_deg} is not on Earth; "
                "GeoJSON coordinates are [longitude, latitude]."
            )
        if not np.isfinite(self.height_m):
            raise InputError(f"The origin's height must be finite, got {self.height_m}.")


def _ecef_from_geodetic(geodetic: FloatArray) -> FloatArray:
    lat, lon = np.deg2rad(geodetic[..., 0]), np.deg2rad(geodetic[..., 1])
    height = geodetic[..., 2]
    prime = SEMI_MAJOR_M / np.sqrt(1 - ECCENTRICITY2 * np.sin(lat) ** 2)
    return np.stack(
        [
            (prime + height) * np.cos(lat) * np.cos(lon),
            (prime + height) * np.cos(lat) * np.sin(lon),
            (prime * (1 - ECCENTRICITY2) + height) * np.sin(lat),
        ],
        axis=-1,
    )


def _enu_from_ecef_rotation(origin: GeoOrigin) -> FloatArray:
    lat, lon = np.deg2rad(origin.lat_deg), np.deg2rad(origin.lon_deg)
    return np.array(
        [
            [-np.sin(lon), np.cos(lon), 0.0],
            [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)],
            [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)],
        ]
    )


def world_from_geodetic(lat_lon_height: ArrayLike, origin: GeoOrigin) -> FloatArray:
    """World points (..., 3) in metres of geodetic points (..., 3) lat deg, lon deg, height m."""
    geodetic: FloatArray = np.asarray(lat_lon_height, dtype=np.float64)
    centre = _ecef_from_geodetic(np.array([origin.lat_deg, origin.lon_deg, origin.height_m]))
    return (_ecef_from_geodetic(geodetic) - centre) @ _enu_from_ecef_rotation(origin).T


def geodetic_from_world(points_in_world: ArrayLike, origin: GeoOrigin) -> FloatArray:
    """Geodetic points (..., 3) lat deg, lon deg, height m of world points (..., 3) in metres."""
    points: FloatArray = np.asarray(points_in_world, dtype=np.float64)
    centre = _ecef_from_geodetic(np.array([origin.lat_deg, origin.lon_deg, origin.height_m]))
    ecef = points @ _enu_from_ecef_rotation(origin) + centre
    radius = np.hypot(ecef[..., 0], ecef[..., 1])
    lon = np.arctan2(ecef[..., 1], ecef[..., 0])
    lat = np.arctan2(ecef[..., 2], radius * (1 - ECCENTRICITY2))
    for _ in range(6):  # converges to below a micrometre near the surface
        prime = SEMI_MAJOR_M / np.sqrt(1 - ECCENTRICITY2 * np.sin(lat) ** 2)
        lat = np.arctan2(ecef[..., 2] + ECCENTRICITY2 * prime * np.sin(lat), radius)
    prime = SEMI_MAJOR_M / np.sqrt(1 - ECCENTRICITY2 * np.sin(lat) ** 2)
    # Valid at every latitude, the poles included.
    height = radius * np.cos(lat) + ecef[..., 2] * np.sin(lat) - SEMI_MAJOR_M**2 / prime
    return np.stack([np.rad2deg(lat), np.rad2deg(lon), height], axis=-1)
