"""What paths look up on the device: colours of textures, the sky, values inside a triangle."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
from benchmarks.estate.rendering.device_scene import Sky, Surfaces, Triangles


def colour_of(mi: Any, surfaces: Surfaces, material: Any, uv: Any, active: Any) -> Any:
    """Linear colour of materials at a place of their textures (bilinear, repeating)."""
    plain = dr.gather(mi.Color3f, surfaces.rgb, material, active)
    width = dr.gather(mi.Int32, surfaces.width, material, active)
    height = dr.gather(mi.Int32, surfaces.height, material, active)
    start = dr.gather(mi.UInt32, surfaces.start, material, active)
    textured = active & (width > 0)
    x = (uv.x - dr.floor(uv.x)) * mi.Float(width) - 0.5
    y = (1 - (uv.y - dr.floor(uv.y))) * mi.Float(height) - 0.5
    colour = mi.Color3f(0)
    for column, row, weight in _neighbours(mi, x, y):
        place = start + mi.UInt32(_wrapped(row, height) * width + _wrapped(column, width))
        texel = dr.gather(mi.UInt32, surfaces.texels, place, textured)
        root = mi.Color3f(
            mi.Float(texel & 1023), mi.Float((texel >> 10) & 1023), mi.Float(texel >> 20)
        )
        colour += (weight / 1023**2) * root * root
    return dr.select(textured, colour, plain)


def sky_radiance(mi: Any, sky: Sky, direction: Any, active: Any) -> Any:
    """Radiance of the sky (bilinear)."""
    azimuth = dr.atan2(direction.x, direction.y) / (2 * np.pi)
    x = (azimuth - dr.floor(azimuth)) * sky.width - 0.5
    y = dr.safe_acos(direction.z) / np.pi * sky.height - 0.5
    colour = mi.Color3f(0)
    for column, row, weight in _neighbours(mi, x, y):
        line = dr.clip(row, 0, sky.height - 1)
        place = mi.UInt32(line * sky.width + _wrapped(column, sky.width))
        colour += weight * dr.gather(mi.Color3f, sky.rgb, place, active)
    return colour


def blended(kind: Any, values: Any, index: Any, place: Any, active: Any) -> Any:
    """Values at three vertices, mixed for a place in the face."""
    a, b, c = (dr.gather(kind, values, index[k], active) for k in range(3))
    return a * (1 - place.x - place.y) + b * place.x + c * place.y


def shading_normal(
    mi: Any, triangles: Triangles, index: Any, place: Any, flat: Any, active: Any
) -> Any:
    """The vertices' normals mixed for a place in the face, on the side of its own, ``flat``.

    Where the vertices have none it is ``flat``.
    """
    mixed = blended(mi.Vector3f, triangles.normals, index, place, active)
    mixed = dr.select(dr.dot(mixed, flat) < 0, -mixed, mixed)
    return dr.select(dr.squared_norm(mixed) > 0.01, dr.normalize(mixed), flat)


def _neighbours(mi: Any, x: Any, y: Any) -> list[tuple[Any, Any, Any]]:
    """Column, row and weight of the four texels around a place."""
    x0, y0 = dr.floor(x), dr.floor(y)
    right, below = x - x0, y - y0
    return [
        (mi.Int32(x0) + dx, mi.Int32(y0) + dy, wx * wy)
        for dy, wy in ((0, 1 - below), (1, below))
        for dx, wx in ((0, 1 - right), (1, right))
    ]


def _wrapped(number: Any, count: Any) -> Any:
    """A number at most one step outside 0..count, repeated into it."""
    number = dr.select(number < 0, number + count, number)
    return dr.select(number >= count, number - count, number)
