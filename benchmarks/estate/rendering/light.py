"""Sun and sky over the estate by date, hour, place and cloud.

A radiance of 1 in the pictures stands for 100 000 lm / (m2 sr): the sun gives about 1 on a plane
that faces it, a white wall in it has about 0.3.

Gillette, G., Pierpoint, W. (1982). A general illuminance model for daylight availability (the sky
conditions of the IES handbook).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.plan import Light
from benchmarks.estate.rendering.clouds import overcast_texture, sky_with_clouds
from benchmarks.estate.sun import direction_of, sun_position_deg
from numpy.typing import NDArray

from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin

FloatArray = NDArray[np.float64]
SOLAR_CONSTANT = 1.275  # 127.5 klx
# Illuminance from the sky on the ground, A + B sin(elevation) ** C in 100 klx, and what the air
# takes from the sun per air mass: clear, partly cloudy, overcast.
SKY_CONDITIONS = ((0.008, 0.155, 0.5), (0.003, 0.45, 1.0), (0.003, 0.21, 1.0))
EXTINCTION = 0.21
SUN_DEPTHS = np.array([0.14, 0.19, 0.29])  # optical depth of clean air in red, green, blue
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
GROUND_ALBEDO = 0.2
LOWEST_SUN_DEG = 2.0  # the sky of a lower sun is that of this one: no nights


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
    sun_direction: FloatArray
    sun_rgb: FloatArray
    sun_radius_deg: float = 0.27


def sky_map(mi: Any, light: Light, origin: GeoOrigin, height_px: int = 1024) -> SkyMap:
    """Sun and sky of that hour; ``mi`` is Mitsuba with its variant set (its clear sky is used).

    Cumulus covers about ``light.cloud`` of the sky; above 0.65 it closes to an overcast sky. The
    sun is dimmed from 0.35 on and gone at 0.8.
    """
    if not 0 <= light.cloud <= 1:
        raise InputError(f"The light's cloud must be 0 (clear) to 1 (overcast), got {light.cloud}.")
    azimuth_deg, elevation_deg = sun_position_deg(light.date, light.hour_utc, origin)
    elevation_deg = max(elevation_deg, LOWEST_SUN_DEG)
    sun = direction_of(azimuth_deg, elevation_deg)
    sun_rgb = sun_light(sun[2]) * (1 - _smooth_step(light.cloud, 0.35, 0.8))

    upper = height_px // 2
    directions = _directions(height_px)[:upper]
    rng = rng_of(0, "sky", light.date, light.hour_utc, light.cloud)
    clear = clear_sky(mi, directions, sun)
    closed = _smooth_step(light.cloud, 0.65, 0.85)
    sky = np.zeros_like(clear)
    if closed < 1:
        sky += (1 - closed) * sky_with_clouds(clear, directions, sun, light.cloud, rng)
    if closed > 0:
        grey = (1 + 2 * directions[..., 2:]) / 3 * overcast_texture(directions, rng)
        sky += closed * grey * np.array([0.96, 1.0, 1.06]) * 0.09
    wanted = sky_illuminance(sun[2], light.cloud)
    sky *= wanted / (level_irradiance(sky) @ LUMINANCE)
    ground = GROUND_ALBEDO / np.pi * (level_irradiance(sky) + sun_rgb * sun[2])
    below = np.broadcast_to(ground, (height_px - upper, *sky.shape[1:]))
    return SkyMap(np.concatenate([sky, below]).astype(np.float32), sun, sun_rgb)


def sun_light(sine_elevation: float) -> FloatArray:
    """(3,) irradiance of an unclouded sun on a plane that faces it."""
    air_mass = 1 / max(sine_elevation, 0.03)
    colour = np.exp(-SUN_DEPTHS * air_mass)
    return SOLAR_CONSTANT * np.exp(-EXTINCTION * air_mass) * colour / (colour @ LUMINANCE)


def sky_illuminance(sine_elevation: float, cloud: float) -> float:
    """Irradiance of the ground by the sky alone, between the three sky conditions."""
    values = [a + b * max(sine_elevation, 0.03) ** c for a, b, c in SKY_CONDITIONS]
    return float(np.interp(cloud, [0, 0.5, 1], values))


def clear_sky(mi: Any, directions: FloatArray, sun: FloatArray) -> FloatArray:
    """(H, W, 3) relative radiance of the sky without clouds and sun (Mitsuba's `sunsky`)."""
    emitter = mi.load_dict(
        {
            "type": "sunsky",
            "sun_direction": [float(v) for v in sun],
            "sun_scale": 0.0,
            "turbidity": 2.8,
            "albedo": GROUND_ALBEDO,
        }
    )
    found = mi.SurfaceInteraction3f()
    towards = np.maximum(directions, [-1, -1, 1e-3]).reshape(-1, 3)
    found.wi = -mi.Vector3f(*(mi.Float(np.float32(towards[:, k])) for k in range(3)))
    values = np.array(emitter.eval(found), np.float64)
    return values.reshape(3, -1).T.reshape(directions.shape)


def level_irradiance(upper_half: FloatArray) -> FloatArray:
    """(3,) irradiance of level ground by the upper half (H / 2, W, 3) of a sky map."""
    rows, columns = upper_half.shape[:2]
    zenith = (np.arange(rows) + 0.5) / rows * np.pi / 2
    weight = np.cos(zenith) * np.sin(zenith) * (np.pi / 2 / rows) * (2 * np.pi / columns)
    return np.einsum("rcx,r->x", upper_half, weight)


def _directions(height_px: int) -> FloatArray:
    """(H, 2 H, 3) unit vectors through the middles of a sky map's pixels."""
    zenith = (np.arange(height_px) + 0.5) / height_px * np.pi
    azimuth = (np.arange(2 * height_px) + 0.5) / height_px * np.pi
    level = np.sin(zenith)[:, None]
    up = np.broadcast_to(np.cos(zenith)[:, None], (height_px, 2 * height_px))
    return np.stack([level * np.sin(azimuth), level * np.cos(azimuth), up], axis=-1)


def _smooth_step(value: float, low: float, high: float) -> float:
    share = np.clip((value - low) / (high - low), 0, 1)
    return float(share * share * (3 - 2 * share))
