"""Pictures of an estate as seen by any camera: linear radiance and depth."""

from __future__ import annotations

import functools
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from benchmarks.estate.denoise import available, denoised
from benchmarks.estate.device_scene import uploaded_parts, uploaded_sky
from benchmarks.estate.light import SkyMap, sky_map
from benchmarks.estate.parts import Parts
from benchmarks.estate.plan import Light
from benchmarks.estate.rays import Camera
from benchmarks.estate.variant import mitsuba
from numpy.typing import NDArray

from si3fp.geometry.enu import GeoOrigin

FloatArray = NDArray[np.float64]
BATCH_RAYS = 1 << 21  # at once: about 0.5 GB
STEP = np.array([0.7548776662466927, 0.5698402909980532])  # R2 sequence (Roberts, 2018)
WITHOUT_DENOISER = 4
BACK_M = 0.02  # a place counts as seen where nothing lies more than this before it


@dataclass(frozen=True)
class Rendered:
    """A picture: radiance (H, W, 3) float32 linear, depth_m (H, W) along the ray, inf where none.

    ``seen`` (H, W) is what was rendered; elsewhere radiance is 0 and depth infinite. A white wall
    that faces a high summer sun has a radiance of about 0.3.
    """

    radiance: NDArray[np.float32]
    depth_m: NDArray[np.float32]
    seen: NDArray[np.bool_]


@functools.cache
def denoiser_or_note() -> bool:
    """Whether there is a denoiser; says once what happens without."""
    if not available():
        print(
            f"No denoiser (package oidn): {WITHOUT_DENOISER} times as many samples are rendered.",
            file=sys.stderr,
        )
    return available()


class Renderer:
    """An estate on the device, ready for any number of cameras."""

    def __init__(
        self,
        parts: Parts,
        light: Light | SkyMap,
        origin: GeoOrigin,
        variant: str | None = None,
    ) -> None:
        self.mi = mitsuba(variant)
        from benchmarks.estate.paths import Tracer  # noqa: PLC0415

        sky = light if isinstance(light, SkyMap) else sky_map(self.mi, light, origin)
        opaque, glass, surfaces = uploaded_parts(self.mi, parts)
        self._tracer = Tracer(self.mi, opaque, glass, surfaces, uploaded_sky(self.mi, sky))
        self._scenes = (opaque.scene, glass.scene)

    def render(
        self,
        camera: Camera,
        samples: int,
        seed: int,
        *,
        denoise: bool = True,
        max_depth: int = 6,
    ) -> Rendered:
        """The picture with ``samples`` paths per pixel, each of at most ``max_depth`` hits."""
        height, width = camera.height_px, camera.width_px
        if denoise and not denoiser_or_note():
            samples *= WITHOUT_DENOISER
        seen = np.ones((height, width), bool) if camera.seen is None else camera.seen
        places = np.flatnonzero(seen)
        radiance, albedo, normal = (np.zeros((height * width, 3), np.float32) for _ in range(3))
        depth_m = np.full(height * width, np.inf, np.float32)
        step = max(1, BATCH_RAYS // samples)
        for first in range(0, len(places), step):
            some = places[first : first + step]
            found = self._traced(camera, some, samples, seed, max_depth)
            for picture, values in zip((radiance, albedo, normal), found, strict=True):
                picture[some] = values
        for first in range(0, len(places), BATCH_RAYS):
            some = places[first : first + BATCH_RAYS]
            middle = np.stack([some % width + 0.5, some // width + 0.5], axis=1)
            depth_m[some] = self.depth_m(*camera.rays(middle))
        shape = (height, width, 3)
        picture = radiance.reshape(shape)
        if denoise and denoiser_or_note():
            picture = denoised(picture, albedo.reshape(shape), normal.reshape(shape), seen)
        return Rendered(picture, depth_m.reshape(height, width), seen)

    def _traced(
        self, camera: Camera, places: Any, samples: int, seed: int, max_depth: int
    ) -> list[NDArray[np.float32]]:
        """Mean radiance, albedo and normal (N, 3) of some pixels."""
        import drjit as dr  # noqa: PLC0415

        mi = self.mi
        corner = np.stack([places % camera.width_px, places // camera.width_px], axis=1)
        shift = _shift(places, seed)
        inside = (shift[:, None, :2] + np.arange(samples)[None, :, None] * STEP) % 1
        pixels = (corner[:, None] + inside).reshape(-1, 2)
        origins, directions = camera.rays(pixels)
        pixel = mi.UInt32(places.astype(np.uint32))
        each = dr.arange(mi.UInt32, len(places) * samples)
        index, sample = each // samples, each % samples
        number = dr.gather(mi.UInt32, pixel, index)
        hashed = mi.sample_tea_32(number, sample + mi.UInt32([(seed * 0x9E3779B9) & 0xFFFFFFFF]))
        rng = mi.PCG32(initstate=mi.UInt64(hashed[0]), initseq=mi.UInt64(hashed[1]))
        shifts = [
            dr.gather(mi.Float, mi.Float(np.float32(shift[:, k])), index) for k in (2, 3, 4, 5)
        ]
        found = self._tracer.traced(
            mi.Point3f(*(mi.Float(np.float32(origins[:, k])) for k in range(3))),
            mi.Vector3f(*(mi.Float(np.float32(directions[:, k])) for k in range(3))),
            sample,
            shifts,
            rng,
            mi.UInt32([max_depth]),
        )
        dr.eval(found)
        mean = [dr.block_sum(channel, samples) / samples for value in found for channel in value]
        dr.eval(mean)
        flat = np.stack([np.array(channel) for channel in mean], axis=1)
        return [flat[:, 0:3], flat[:, 3:6], flat[:, 6:9]]

    def depth_m(self, origins: FloatArray, directions: FloatArray) -> NDArray[np.float32]:
        """Distance (N,) to the first surface, glass too, along unit directions; inf if none."""
        ray = self._ray(origins, directions, np.inf)
        hits = [scene.ray_intersect_preliminary(ray) for scene in self._scenes]
        return np.minimum(*(np.array(hit.t, np.float32) for hit in hits))

    def visible(self, from_points: FloatArray, to_points: FloatArray) -> NDArray[np.bool_]:
        """(N,) whether nothing, glass included, lies between two points (2 cm are spared)."""
        way = to_points - from_points
        length = np.linalg.norm(way, axis=1)
        ray = self._ray(
            from_points, way / np.maximum(length, 1e-9)[:, None], np.maximum(length - BACK_M, 0)
        )
        hits = [np.array(scene.ray_test(ray)) for scene in self._scenes]
        return ~(hits[0] | hits[1])

    def _ray(self, origins: FloatArray, directions: FloatArray, length: FloatArray | float) -> Any:
        mi = self.mi
        ray = mi.Ray3f(
            mi.Point3f(*(mi.Float(np.float32(origins[:, k])) for k in range(3))),
            mi.Vector3f(*(mi.Float(np.float32(directions[:, k])) for k in range(3))),
        )
        if np.ndim(length):
            ray.maxt = mi.Float(np.float32(length))
        return ray


def _shift(places: NDArray[np.int64], seed: int) -> FloatArray:
    """(N, 6) numbers in 0..1 that belong to a pixel and a seed, whatever the batch."""
    state = places.astype(np.uint64)[:, None] * np.uint64(6) + np.arange(6, dtype=np.uint64)
    state += np.uint64((seed * 0x9E3779B97F4A7C15) & 0xFFFFFFFFFFFFFFFF)
    for factor in (0xBF58476D1CE4E5B9, 0x94D049BB133111EB):  # SplitMix64 (Steele et al., 2014)
        state = (state ^ (state >> np.uint64(30))) * np.uint64(factor)
    return (state >> np.uint64(40)) / float(1 << 24)
