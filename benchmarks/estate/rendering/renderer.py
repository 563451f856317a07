"""Pictures of an estate as seen by any camera: linear radiance and depth."""

from __future__ import annotations

import functools
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from benchmarks.estate.parts import Parts
from benchmarks.estate.plan import Light
from benchmarks.estate.rays import Camera
from benchmarks.estate.rendering.denoise import available, denoised
from benchmarks.estate.rendering.device_scene import uploaded_parts, uploaded_sky
from benchmarks.estate.rendering.light import SkyMap, sky_map
from benchmarks.estate.rendering.variant import mitsuba
from numpy.typing import NDArray
from scipy.stats import qmc

from si3fp.geometry.enu import GeoOrigin

FloatArray = NDArray[np.float64]
Places = NDArray[np.int64]  # pixels numbered along the rows
BATCH_RAYS = 1 << 21  # at once: about 0.5 GB
ALBEDO_SAMPLES = 16
DARKEST = 0.03  # albedo by which light is divided at least
DIMENSIONS = 7  # of a sample: place in the pixel (2), first pane, sun's disc (2), first bounce (2)
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


@dataclass(frozen=True)
class _Pixels:
    """Pixels on the device, N of them.

    ``origins`` and ``directions`` of rays through the first corner, and what is added to them by a
    step of one pixel to the right and below; ``shift`` turns the evenly spread numbers of each.
    """

    count: int
    numbers: Any
    origins: list[Any]
    directions: list[Any]
    shift: list[Any]
    seed: Any


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
        from benchmarks.estate.rendering.paths import Tracer  # noqa: PLC0415

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
        albedo_samples: int = ALBEDO_SAMPLES,
    ) -> Rendered:
        """The picture with ``samples`` paths per pixel, each of at most ``max_depth`` hits.

        ``albedo_samples`` smooth the edges and textures of a picture that is denoised; with no more
        than ``samples`` the albedo of the paths is but a guide to the denoiser: quick, less sharp.
        """
        height, width = camera.height_px, camera.width_px
        if denoise and not denoiser_or_note():
            samples *= WITHOUT_DENOISER
        divide = denoise and albedo_samples > samples
        seen = np.ones((height, width), bool) if camera.seen is None else camera.seen
        radiance, albedo, normal = (np.zeros((height * width, 3), np.float32) for _ in range(3))
        depth_m = np.full(height * width, np.inf, np.float32)
        for some in _batches(seen, max(samples, albedo_samples)):
            pixels = self._pixels(camera, some, seed)
            radiance[some], rough_albedo, normal[some] = self._traced(pixels, samples, max_depth)
            albedo[some] = rough_albedo
            if divide:
                radiance[some] /= np.maximum(rough_albedo, DARKEST)
                albedo[some] = self._albedo(pixels, albedo_samples)
        for some in _batches(seen, 1):
            middle = np.stack([some % width + 0.5, some // width + 0.5], axis=1)
            depth_m[some] = self.depth_m(*camera.rays(middle))
        picture = radiance.reshape(height, width, 3)
        if denoise and denoiser_or_note():
            guide = None if divide else albedo.reshape(picture.shape)
            picture = denoised(picture, normal.reshape(picture.shape), seen, guide)
        if divide:
            for rows in np.array_split(np.arange(height), height // 256 + 1):
                picture[rows] *= np.maximum(albedo.reshape(picture.shape)[rows], DARKEST)
        return Rendered(picture, depth_m.reshape(height, width), seen)

    def _traced(self, pixels: _Pixels, samples: int, max_depth: int) -> list[NDArray[np.float32]]:
        """Mean radiance, albedo and normal (N, 3) of some pixels."""
        ray, even, rng = self._samples(pixels, samples)
        found = self._tracer.traced(*ray, even, rng, self.mi.UInt32([max_depth]))
        return [_mean(value, samples) for value in _evaluated(found)]

    def _albedo(self, pixels: _Pixels, samples: int) -> NDArray[np.float32]:
        """Mean albedo (N, 3) of some pixels, of more samples than their light has."""
        ray, even, rng = self._samples(pixels, samples)
        (found,) = _evaluated([self._tracer.albedo(*ray, even[0], rng)])
        return _mean(found, samples)

    def _pixels(self, camera: Camera, places: Places, seed: int) -> _Pixels:
        """Some pixels on the device: their corners' rays, and the chance that is theirs."""
        mi = self.mi
        corner = np.stack([places % camera.width_px, places // camera.width_px], axis=1)
        rays = [camera.rays(corner + np.array(step)) for step in ((0, 0), (1, 0), (0, 1))]
        origins, directions = (
            [_device(mi.Point3f, mi, each) for each in (start, right - start, below - start)]
            for start, right, below in zip(*rays, strict=True)
        )
        shift = _shift(places, seed).astype(np.float32)
        return _Pixels(
            len(places),
            mi.UInt32(places.astype(np.uint32)),
            origins,
            directions,
            [mi.Float(np.ascontiguousarray(shift[:, k])) for k in range(DIMENSIONS)],
            mi.UInt32([(seed * 0x9E3779B9) & 0xFFFFFFFF]),
        )

    def _samples(self, pixels: _Pixels, samples: int) -> tuple[tuple[Any, Any], list[Any], Any]:
        """Rays through pixels, evenly spread numbers of each, and its own chance.

        All of them follow from pixel, sample and seed alone, whatever the batch. Within a pixel the
        rays are linear in its place: true to less than a millionth of a radian.
        """
        import drjit as dr  # noqa: PLC0415

        mi = self.mi
        table = _even_table(samples).astype(np.float32)
        each = dr.arange(mi.UInt32, pixels.count * samples)
        index, sample = each // samples, each % samples
        numbers = []
        for k in range(DIMENSIONS):
            value = dr.gather(mi.Float, pixels.shift[k], index)
            value += dr.gather(mi.Float, mi.Float(np.ascontiguousarray(table[:, k])), sample)
            numbers.append(value - dr.floor(value))
        x, y, *even = numbers
        origin, direction = (
            corner + x * right + y * below
            for corner, right, below in (
                [dr.gather(mi.Point3f, value, index) for value in values]
                for values in (pixels.origins, pixels.directions)
            )
        )
        pixel = dr.gather(mi.UInt32, pixels.numbers, index)
        start = mi.sample_tea_32(pixel, sample + pixels.seed)
        rng = mi.PCG32(initstate=mi.UInt64(start[0]), initseq=mi.UInt64(start[1]))
        return (origin, dr.normalize(mi.Vector3f(direction))), even, rng

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
        ray = mi.Ray3f(_device(mi.Point3f, mi, origins), _device(mi.Vector3f, mi, directions))
        if np.ndim(length):
            ray.maxt = mi.Float(np.float32(length))
        return ray


def _device(kind: Any, mi: Any, points: FloatArray) -> Any:
    """Points or directions (N, 3) on the device."""
    return kind(*(mi.Float(np.ascontiguousarray(points[:, k], np.float32)) for k in range(3)))


def _evaluated(values: Any) -> Any:
    """The values, computed in one go: each by itself would trace the paths anew."""
    import drjit as dr  # noqa: PLC0415

    dr.eval(values)
    return values


def _mean(value: Any, samples: int) -> NDArray[np.float32]:
    """(N, 3) means over the samples of each pixel."""
    import drjit as dr  # noqa: PLC0415

    means = [np.array(dr.block_sum(channel, samples)) / samples for channel in value]
    return np.stack(means, axis=1).astype(np.float32)


def _batches(seen: NDArray[np.bool_], samples: int) -> Iterator[Places]:
    """Numbers of the seen pixels, as many at once as memory should hold."""
    places = np.flatnonzero(seen)
    step = max(1, BATCH_RAYS // samples)
    for first in range(0, len(places), step):
        yield places[first : first + step]


@functools.cache
def _even_table(samples: int) -> FloatArray:
    """(samples, DIMENSIONS) numbers in 0..1: the beginning of Sobol's sequence."""
    sequence = qmc.Sobol(DIMENSIONS, scramble=False)
    return sequence.random_base2(max(samples - 1, 0).bit_length())[:samples]


def _shift(places: Places, seed: int) -> FloatArray:
    """(N, DIMENSIONS) numbers in 0..1 of pixels and a seed, which turn the table's."""
    state = places.astype(np.uint64)[:, None] * np.uint64(DIMENSIONS)
    state = state + np.arange(DIMENSIONS, dtype=np.uint64)
    state += np.uint64((seed * 0x9E3779B97F4A7C15) & 0xFFFFFFFFFFFFFFFF)
    for factor in (0xBF58476D1CE4E5B9, 0x94D049BB133111EB):  # SplitMix64 (Steele et al., 2014)
        state = (state ^ (state >> np.uint64(30))) * np.uint64(factor)
    return (state >> np.uint64(40)) / float(1 << 24)
