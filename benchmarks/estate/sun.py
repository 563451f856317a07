"""Where the sun stands, for the sky of the pictures and for the choice of their hour.

Michalsky, J. (1988). The Astronomical Almanac's algorithm for approximate solar position. Solar
Energy 40.
Cooper, P. (1969). The absorption of radiation in solar stills. Solar Energy 12.
"""

from __future__ import annotations

from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin

FloatArray = NDArray[np.float64]


def sun_position_deg(date: str, hour_utc: float, origin: GeoOrigin) -> tuple[float, float]:
    """Azimuth (clockwise from north) and elevation of the sun, good to 0.02 degrees.

    ``date`` is ISO, as in 2024-06-12.
    """
    try:
        day = datetime.fromisoformat(date)
    except ValueError as error:
        raise InputError(
            f"The light's date {date!r} is no date; write it as 2024-06-12."
        ) from error
    days = (day - datetime(2000, 1, 1, 12)).total_seconds() / 86400 + hour_utc / 24
    mean_longitude = 280.460 + 0.9856474 * days
    anomaly = np.deg2rad(357.528 + 0.9856003 * days)
    longitude = np.deg2rad(mean_longitude + 1.915 * np.sin(anomaly) + 0.020 * np.sin(2 * anomaly))
    tilt = np.deg2rad(23.439 - 4e-7 * days)
    ascension = np.arctan2(np.cos(tilt) * np.sin(longitude), np.cos(longitude))
    declination = np.arcsin(np.sin(tilt) * np.sin(longitude))
    # The almanac's sidereal time is that of midnight plus the hour; both are in `days`.
    sidereal_deg = 15 * (18.697374558 + 24.06570982441908 * days) + origin.lon_deg
    hour_angle = np.deg2rad(sidereal_deg) - ascension
    east, north, up = _in_world(declination, hour_angle, origin)
    return float(np.rad2deg(np.arctan2(east, north)) % 360), float(np.rad2deg(np.arcsin(up)))


def rough_sun(month: int, day: int, hour_utc: float, origin: GeoOrigin) -> FloatArray:
    """(3,) unit vector to the sun in the world, up to 3 degrees off in summer: for hours of plans.

    By Cooper's declination and mean time. It stays as it is: a better one would choose other hours
    for some seeds, and every plan there is would be another one.
    """
    day_of_year = 30.4 * (month - 1) + day
    declination = np.deg2rad(23.45) * np.sin(2 * np.pi * (284 + day_of_year) / 365)
    hour_angle = np.deg2rad(15.0 * (hour_utc - 12.0) + origin.lon_deg)
    return np.array(_in_world(declination, hour_angle, origin))


def direction_of(azimuth_deg: float, elevation_deg: float) -> FloatArray:
    """(3,) unit vector in the world, east, north, up."""
    azimuth, elevation = np.deg2rad([azimuth_deg, elevation_deg])
    level = np.cos(elevation)
    return np.array([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(elevation)])


def _in_world(
    declination: float, hour_angle: float, origin: GeoOrigin
) -> tuple[float, float, float]:
    """East, north and up of the unit vector to the sun; both angles in radians."""
    latitude = np.deg2rad(origin.lat_deg)
    east = -np.cos(declination) * np.sin(hour_angle)
    north = np.sin(declination) * np.cos(latitude)
    north -= np.cos(declination) * np.cos(hour_angle) * np.sin(latitude)
    up = np.sin(declination) * np.sin(latitude)
    up += np.cos(declination) * np.cos(hour_angle) * np.cos(latitude)
    return east, north, up
