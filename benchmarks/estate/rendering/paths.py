"""Paths of light through an estate, traced with Mitsuba 3 and Dr.Jit as one kernel.

Sunlight is asked for at every bounce and passes through glass. The sky, a map without its sun, is
found by the paths that leave: importance sampling would gain little, and a second ray costs more.

Jakob, W. et al. (2022). Dr.Jit: a just-in-time compiler for differentiable rendering. ACM TOG 41.
Walter, B. et al. (2007). Microfacet models for refraction through rough surfaces. EGSR (GGX).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
from benchmarks.estate.rendering.device_scene import (
    LAMP,
    LEAF,
    METAL,
    PLASTIC,
    Sky,
    Surfaces,
    Triangles,
)
from benchmarks.estate.rendering.lookups import blended, colour_of, shading_normal, sky_radiance

GLASS_INDEX = 1.5
LEAF_THROUGH = (0.75, 0.85, 0.45)  # of the leaf's colour; light that comes through is yellower
LAMP_RADIANCE = 0.15  # of a white one; a white wall in full sun has about 0.3
BRIGHTEST = 6.0  # radiance of what is seen directly
BRIGHTEST_INDIRECT = 1.0  # more than this by way of a rough surface is chance, not a picture
ROUGHEST_MIRROR = 0.35  # what rough surfaces see of shiny ones is blurred: no caustics
EPSILON_M = 1e-3
MOST_PANES = 5


@dataclass
class Path:
    """State of paths between two bounces.

    ``first`` is true until a surface that is not glass is met; its colour and normal are kept.
    """

    active: Any
    origin: Any
    direction: Any
    radiance: Any
    through: Any
    albedo: Any
    normal: Any
    first: Any
    depth: Any
    rng: Any


@dataclass
class Hit:
    """Where a path met an opaque surface: ``frame`` is its shading frame, towards the viewer."""

    valid: Any
    point: Any
    normal: Any
    frame: Any
    colour: Any
    plastic: Any
    metal: Any
    leaf: Any
    gloss: Any


class Tracer:
    """Traces paths through one scene."""

    def __init__(
        self, mi: Any, opaque: Triangles, glass: Triangles, surfaces: Surfaces, sky: Sky
    ) -> None:
        self.mi, self.opaque, self.glass, self.surfaces, self.sky = mi, opaque, glass, surfaces, sky

    def traced(
        self, origin: Any, direction: Any, even: list[Any], rng: Any, max_depth: Any
    ) -> tuple[Any, Any, Any]:
        """Radiance, albedo and normal of the first surface that is not glass, per ray.

        ``even`` are 5 numbers in 0..1 per ray that lie evenly among the samples of a pixel: one
        for the choice at a first pane, two for the sun's disc, two for the first bounce.
        """
        mi = self.mi
        path = self._start(origin, direction, rng)

        def bounced(path: Path) -> tuple[Path]:
            hit, pane, on_glass = self._met(path)
            fresh = mi.Bool(path.first)
            numbers = [
                dr.select(
                    fresh & (path.depth == 0) if k == 0 else fresh,
                    value,
                    path.rng.next_float32(path.active),
                )
                for k, value in enumerate(even)
            ]
            self._through_glass(path, pane, on_glass, numbers[0])
            path.first &= on_glass
            sunlight = self._sunlight(path, hit, mi.Point2f(numbers[1], numbers[2]))
            self._add(path, hit.valid, sunlight, fresh)
            which = path.rng.next_float32(path.active)
            self._scatter(path, hit, mi.Point2f(numbers[3], numbers[4]), which)
            path.active = hit.valid | on_glass
            self._roulette(path, max_depth)
            return (path,)

        (path,) = dr.while_loop((path,), lambda path: path.active, bounced)
        return path.radiance, path.albedo, path.normal

    def albedo(self, origin: Any, direction: Any, chosen: Any, rng: Any) -> Any:
        """Albedo of the first surface that is not glass, per ray, and nothing else: fast."""
        path = self._start(origin, direction, rng)

        def passed(path: Path) -> tuple[Path]:
            _, pane, on_glass = self._met(path)
            again = path.rng.next_float32(path.active)
            self._through_glass(path, pane, on_glass, dr.select(path.depth == 0, chosen, again))
            path.first &= on_glass
            path.depth += 1
            path.active = on_glass & (path.depth < MOST_PANES)
            return (path,)

        (path,) = dr.while_loop((path,), lambda path: path.active, passed)
        return path.albedo

    def _start(self, origin: Any, direction: Any, rng: Any) -> Path:
        mi = self.mi
        yes = dr.full(mi.Bool, True, dr.width(origin))
        return Path(
            yes,
            mi.Point3f(origin),
            mi.Vector3f(direction),
            mi.Color3f(0),
            mi.Color3f(1),
            mi.Color3f(0),
            mi.Vector3f(0),
            mi.Bool(yes),
            mi.UInt32(0),
            rng,
        )

    def _met(self, path: Path) -> tuple[Hit, Any, Any]:
        """The opaque surface met, else the pane; adds what shines by itself: sky and lamps."""
        mi, surfaces = self.mi, self.surfaces
        ray = mi.Ray3f(path.origin, path.direction)
        found = self.opaque.scene.ray_intersect_preliminary(ray, active=path.active)
        valid = path.active & found.is_valid()
        ray.maxt = dr.select(valid, found.t, dr.inf)
        pane = self.glass.scene.ray_intersect_preliminary(ray, active=path.active)
        on_glass = path.active & pane.is_valid() & (pane.t < ray.maxt)
        valid &= ~on_glass

        escaped = path.active & ~valid & ~on_glass
        self._add(path, escaped, sky_radiance(mi, self.sky, path.direction, escaped), path.first)
        path.albedo[escaped & path.first] += path.through

        face, place = found.prim_index, found.prim_uv
        index = dr.gather(mi.Vector3u, self.opaque.faces, face, valid)
        a, b, c = (dr.gather(mi.Point3f, self.opaque.vertices, index[k], valid) for k in range(3))
        normal = dr.normalize(dr.cross(b - a, c - a))
        normal = dr.select(dr.dot(normal, path.direction) > 0, -normal, normal)
        smooth = shading_normal(mi, self.opaque, index, place, normal, valid)
        smooth = dr.select(dr.dot(smooth, path.direction) > -0.02, normal, smooth)
        uv = blended(mi.Point2f, self.opaque.uv, index, place, valid)
        material = dr.gather(mi.UInt32, self.opaque.material, face, valid)
        kind = dr.gather(mi.UInt32, surfaces.kind, material, valid)
        rough = dr.gather(mi.Float, surfaces.roughness, material, valid)
        rough = dr.select(path.first, rough, dr.maximum(rough, ROUGHEST_MIRROR))
        colour = colour_of(mi, surfaces, material, uv, valid)

        lamp = valid & (kind == LAMP)
        self._add(path, lamp, colour * LAMP_RADIANCE, path.first)
        path.albedo[valid & path.first] += path.through * colour
        path.normal[valid & path.first] += smooth
        hit = Hit(
            valid & ~lamp,
            a * (1 - place.x - place.y) + b * place.x + c * place.y,
            normal,
            mi.Frame3f(smooth),
            colour,
            kind == PLASTIC,
            kind == METAL,
            kind == LEAF,
            mi.MicrofacetDistribution(mi.MicrofacetType.GGX, rough),
        )
        return hit, pane, on_glass

    def _add(self, path: Path, where: Any, radiance: Any, seen: Any) -> None:
        """Light that reaches the camera; of what comes by a rough surface, the rare is cut."""
        found = path.through * radiance
        limit = dr.select(seen, BRIGHTEST, BRIGHTEST_INDIRECT)
        path.radiance[where] += found * dr.minimum(1, limit / dr.maximum(dr.max(found), 1e-6))

    def _through_glass(self, path: Path, pane: Any, on_glass: Any, chosen: Any) -> None:
        """Mirrored or let through: where glass comes first every second sample is mirrored."""
        mi = self.mi
        index = dr.gather(mi.Vector3u, self.glass.faces, pane.prim_index, on_glass)
        a, b, c = (dr.gather(mi.Point3f, self.glass.vertices, index[k], on_glass) for k in range(3))
        flat = dr.normalize(dr.cross(b - a, c - a))
        bent = shading_normal(mi, self.glass, index, pane.prim_uv, flat, on_glass)
        cosine = dr.dot(flat, path.direction)
        mirror = path.direction - 2 * dr.dot(bent, path.direction) * bent
        outside = dr.dot(mirror, flat) * cosine < 0  # not so for a bent pane at a grazing angle
        mirror = dr.select(outside, mirror, path.direction - 2 * cosine * flat)
        share = pane_reflectance(dr.abs(cosine))
        chance = dr.select(path.depth == 0, 0.5, share)
        mirrored = on_glass & (chosen < chance)
        path.through[on_glass] *= dr.select(mirrored, share / chance, (1 - share) / (1 - chance))
        path.origin[on_glass] += path.direction * pane.t
        path.direction[mirrored] = mirror
        path.origin[on_glass] += path.direction * EPSILON_M

    def _sunlight(self, path: Path, hit: Hit, u: Any) -> Any:
        """Radiance that the sun sends on from there; glass does not cast shadows."""
        mi, sky = self.mi, self.sky
        disc = mi.warp.square_to_uniform_disk_concentric(u) * sky.sun_radius
        frame = mi.Frame3f(sky.sun_direction)
        to_sun = dr.normalize(frame.to_world(mi.Vector3f(disc.x, disc.y, 1)))
        wi, wo = hit.frame.to_local(-path.direction), hit.frame.to_local(to_sun)
        half = dr.normalize(wi + wo)
        glossy = coat_reflectance(mi, hit, dr.dot(wi, half)) * (
            hit.gloss.eval(half) * hit.gloss.G(wi, wo, half) / (4 * dr.maximum(wi.z, 1e-3))
        )
        soft = base_colour(mi, hit, wi.z) * (dr.maximum(wo.z, 0) / np.pi)
        front = (wo.z > 0) & (dr.dot(hit.normal, to_sun) > 0)
        response = dr.select(front, soft + dr.select(hit.plastic | hit.metal, glossy, 0), 0)
        back = hit.leaf & (wo.z < 0)
        passed = hit.colour * mi.Color3f(LEAF_THROUGH) * (dr.maximum(-wo.z, 0) / np.pi)
        response = dr.select(back, passed, response)
        lit = hit.valid & (dr.max(response) > 0) & (dr.max(sky.sun_rgb) > 0)
        side = dr.select(back, -hit.normal, hit.normal)
        shadow = self.opaque.scene.ray_test(
            mi.Ray3f(hit.point + side * EPSILON_M, to_sun), active=lit
        )
        return dr.select(lit & ~shadow, response * sky.sun_rgb, 0)

    def _scatter(self, path: Path, hit: Hit, u: Any, which: Any) -> None:
        """The next direction, its weight, and whether the path goes on."""
        mi = self.mi
        wi = hit.frame.to_local(-path.direction)
        pale = _varnish(hit, wi.z)
        coat_share = dr.select(hit.metal, 1.0, dr.select(hit.plastic, 0.2 + 0.5 * pale, 0))
        coated = which < coat_share
        facet, _ = hit.gloss.sample(wi, u)
        mirror = 2 * dr.dot(wi, facet) * facet - wi
        glossy = coat_reflectance(mi, hit, dr.dot(wi, facet)) * (
            hit.gloss.smith_g1(mirror, facet) / dr.maximum(coat_share, 1e-3)
        )
        through_leaf = hit.leaf & (which > 0.5)
        lobe = mi.warp.square_to_cosine_hemisphere(u)
        lobe.z = dr.select(through_leaf, -lobe.z, lobe.z)
        soft = base_colour(mi, hit, wi.z) / dr.maximum(1 - coat_share, 1e-3)
        soft = dr.select(hit.leaf, 2 * soft, soft)
        soft = dr.select(through_leaf, soft * mi.Color3f(LEAF_THROUGH), soft)
        side = dr.select(through_leaf, -hit.normal, hit.normal)
        direction = dr.normalize(hit.frame.to_world(dr.select(coated, mirror, lobe)))
        path.through[hit.valid] *= dr.select(coated, glossy, soft)
        path.direction[hit.valid] = direction
        path.origin[hit.valid] = hit.point + side * EPSILON_M
        hit.valid &= dr.dot(side, direction) > 0

    def _roulette(self, path: Path, max_depth: Any) -> None:
        """Ends faint paths by chance after the second bounce."""
        path.depth += 1
        strength = dr.clip(dr.max(path.through), 0.05, 0.95)
        late = path.depth > 2
        ends = late & (path.rng.next_float32(path.active) > strength)
        path.through[late] /= strength
        path.active &= ~ends & (path.depth < max_depth) & (dr.max(path.through) > 0)


def pane_reflectance(cosine: Any) -> Any:
    """Share of light that double glazing reflects: two panes, four faces, nothing absorbed."""
    inside = dr.sqrt(dr.maximum(1 - (1 - cosine * cosine) / GLASS_INDEX**2, 0))
    across = (cosine - GLASS_INDEX * inside) / (cosine + GLASS_INDEX * inside)
    along = (inside - GLASS_INDEX * cosine) / (inside + GLASS_INDEX * cosine)
    one = (across * across + along * along) / 2
    return 4 * one / (1 + 3 * one)


def base_colour(mi: Any, hit: Hit, cosine: Any) -> Any:
    """What scatters evenly: nothing of a metal, what its varnish lets in of a plastic."""
    return dr.select(hit.metal, mi.Color3f(0), hit.colour * (1 - _varnish(hit, cosine)))


def coat_reflectance(mi: Any, hit: Hit, cosine: Any) -> Any:
    """Reflectance of a facet of varnish or metal (Schlick's approximation)."""
    rest = dr.power(1 - dr.clip(cosine, 0, 1), 5)
    metal = hit.colour + (1 - hit.colour) * rest
    return dr.select(hit.metal, metal, mi.Color3f(_varnish(hit, cosine)))


def _varnish(hit: Hit, cosine: Any) -> Any:
    return dr.select(hit.plastic, 0.04 + 0.96 * dr.power(1 - dr.clip(cosine, 0, 1), 5), 0)
