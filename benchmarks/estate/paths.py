"""Paths of light through triangles, traced by Mitsuba 3 and Dr.Jit as one kernel for every scene.

All triangles lie in two meshes (opaque, glass) and all textures in one buffer, so nothing depends
on how many materials or meshes a scene has: the kernel is compiled once and kept on disk by Dr.Jit.
Sunlight is asked for at every bounce and passes through glass; the sky is found by the paths that
leave, which is enough for a sky without its sun.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
from benchmarks.estate.parts import Material, Mesh, Parts
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
KINDS = ("diffuse", "plastic", "metal", "leaf", "light")
GLASS_INDEX = 1.5
LEAF_THROUGH = (0.75, 0.85, 0.45)  # of the leaf's colour; light that comes through is yellower
LIGHT_STRENGTH = 0.6  # radiance of a white lamp; a white wall in full sun has about 0.3
CLAMP = 6.0  # of one sample's radiance: what is brighter is a rare path, not a picture
EPSILON_M = 1e-3
FAR_M = 1e4


def linear_of(srgb: Any) -> FloatArray:
    """Linear light of sRGB values in 0..1 (IEC 61966-2-1)."""
    value = np.asarray(srgb, np.float64)
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def packed_texels(texture: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """(H * W,) the square root of linear light in 10 bits a channel: 4 bytes, cheap to undo."""
    table = np.round(np.sqrt(linear_of(np.arange(256) / 255)) * 1023).astype(np.uint32)
    red, green, blue = (table[texture[..., channel]] for channel in range(3))
    return (red | (green << 10) | (blue << 20)).ravel()


@dataclass(frozen=True)
class Triangles:
    """One mesh on the device: its Mitsuba scene and what shading looks up per face and vertex."""

    scene: Any
    faces: Any
    vertices: Any
    uv: Any
    normals: Any
    material: Any


@dataclass(frozen=True)
class Surfaces:
    """Materials on the device, one entry each; ``texels`` holds all textures."""

    kind: Any
    rgb: Any
    roughness: Any
    start: Any
    width: Any
    height: Any
    texels: Any


@dataclass(frozen=True)
class Sky:
    """Radiance of the sky by direction (rows from zenith to nadir, columns clockwise from north).

    ``sun_direction`` points to the sun, ``sun_rgb`` is its irradiance on a plane that faces it, and
    ``sun_radius`` the sine of half its angle.
    """

    width: int
    height: int
    rgb: Any
    sun_direction: Any
    sun_rgb: Any
    sun_radius: Any


def uploaded_triangles(mi: Any, meshes: list[Mesh], index_of: dict[str, int]) -> Triangles:
    """All meshes as one, and a far speck, so that there always is one."""
    speck = Mesh(next(iter(index_of)), 1e-3 * np.eye(3) - FAR_M, np.array([[0, 1, 2]]))
    meshes = [*(mesh for mesh in meshes if len(mesh.faces)), speck]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    vertices = np.concatenate([mesh.vertices for mesh in meshes]).astype(np.float32)
    faces = np.concatenate([m.faces + s for m, s in zip(meshes, starts, strict=True)])
    uv = np.concatenate(
        [np.zeros((len(m.vertices), 2)) if m.uv is None else m.uv for m in meshes]
    ).astype(np.float32)
    normals = np.concatenate(
        [np.zeros((len(m.vertices), 3)) if m.normals is None else m.normals for m in meshes]
    ).astype(np.float32)
    material = np.repeat(
        np.array([index_of[mesh.material] for mesh in meshes], np.uint32),
        [len(mesh.faces) for mesh in meshes],
    )
    shape = mi.Mesh("triangles", len(vertices), len(faces))
    params = mi.traverse(shape)
    params["vertex_positions"] = mi.Float(vertices.ravel())
    params["faces"] = mi.UInt32(faces.astype(np.uint32).ravel())
    params.update()
    return Triangles(
        mi.load_dict({"type": "scene", "shape": shape}),
        mi.UInt32(faces.astype(np.uint32).ravel()),
        mi.Float(vertices.ravel()),
        mi.Float(uv.ravel()),
        mi.Float(normals.ravel()),
        mi.UInt32(material),
    )


def uploaded_surfaces(mi: Any, materials: list[Material]) -> Surfaces:
    """The materials and their textures."""
    start, size, texels, first = [], [], [], 0
    for material in materials:
        texture = material.texture
        start.append(first)
        if texture is None:
            size.append((0, 0))
            continue
        size.append((texture.shape[1], texture.shape[0]))
        texels.append(packed_texels(texture))
        first += len(texels[-1])
    sizes = np.array(size, np.int32).reshape(-1, 2)
    return Surfaces(
        mi.UInt32([KINDS.index(m.kind) if m.kind in KINDS else 0 for m in materials]),
        mi.Float(linear_of([m.rgb for m in materials]).astype(np.float32).ravel()),
        mi.Float([max(float(m.roughness), 0.03) for m in materials]),
        mi.UInt32(np.array(start, np.uint32)),
        mi.Int32(sizes[:, 0]),
        mi.Int32(sizes[:, 1]),
        mi.UInt32(np.concatenate([*texels, np.zeros(1, np.uint32)])),
    )


def scene_of(mi: Any, parts: Parts) -> tuple[Triangles, Triangles, Surfaces]:
    """Opaque triangles, panes of glass, and the materials of the opaque ones."""
    names = sorted({*parts.materials, ""})
    index_of = {name: index for index, name in enumerate(names)}
    materials = [parts.materials.get(name, Material()) for name in names]
    glass = {name for name, material in parts.materials.items() if material.kind == "glass"}
    return (
        uploaded_triangles(mi, [m for m in parts.meshes if m.material not in glass], index_of),
        uploaded_triangles(mi, [m for m in parts.meshes if m.material in glass], index_of),
        uploaded_surfaces(mi, materials),
    )


def _looked_up(mi: Any, surfaces: Surfaces, material: Any, u: Any, v: Any, active: Any) -> Any:
    """Linear colour of the material at a place of its texture (bilinear, repeating)."""
    plain = dr.gather(mi.Color3f, surfaces.rgb, material, active)
    width = dr.gather(mi.Int32, surfaces.width, material, active)
    height = dr.gather(mi.Int32, surfaces.height, material, active)
    start = dr.gather(mi.UInt32, surfaces.start, material, active)
    textured = active & (width > 0)
    x = (u - dr.floor(u)) * mi.Float(width) - 0.5
    y = (1 - (v - dr.floor(v))) * mi.Float(height) - 0.5
    x0, y0 = dr.floor(x), dr.floor(y)
    fx, fy = x - x0, y - y0
    colour = mi.Color3f(0)
    for dy, wy in ((0, 1 - fy), (1, fy)):
        for dx, wx in ((0, 1 - fx), (1, fx)):
            column, row = mi.Int32(x0) + dx, mi.Int32(y0) + dy
            column = dr.select(column < 0, column + width, column)
            column = dr.select(column >= width, column - width, column)
            row = dr.select(row < 0, row + height, row)
            row = dr.select(row >= height, row - height, row)
            texel = dr.gather(
                mi.UInt32, surfaces.texels, start + mi.UInt32(row * width + column), textured
            )
            root = mi.Color3f(
                mi.Float(texel & 1023), mi.Float((texel >> 10) & 1023), mi.Float(texel >> 20)
            )
            colour += (wx * wy / 1023**2) * root * root
    return dr.select(textured, colour, plain)


def _sky_radiance(mi: Any, sky: Sky, direction: Any, active: Any) -> Any:
    """Radiance of the sky (bilinear)."""
    azimuth = dr.atan2(direction.x, direction.y) / (2 * np.pi)
    x = (azimuth - dr.floor(azimuth)) * sky.width - 0.5
    y = dr.safe_acos(direction.z) / np.pi * sky.height - 0.5
    x0, y0 = dr.floor(x), dr.floor(y)
    fx, fy = x - x0, y - y0
    colour = mi.Color3f(0)
    for dy, wy in ((0, 1 - fy), (1, fy)):
        for dx, wx in ((0, 1 - fx), (1, fx)):
            column = mi.Int32(x0) + dx
            column = dr.select(column < 0, column + sky.width, column)
            column = dr.select(column >= sky.width, column - sky.width, column)
            row = dr.clip(mi.Int32(y0) + dy, 0, sky.height - 1)
            place = mi.UInt32(row * sky.width + column)
            colour += wx * wy * dr.gather(mi.Color3f, sky.rgb, place, active)
    return colour


def pane_reflectance(cosine: Any) -> Any:
    """Share of light that double glazing reflects: two panes, four faces, nothing absorbed."""
    sine2 = (1 - cosine * cosine) / GLASS_INDEX**2
    inside = dr.sqrt(dr.maximum(1 - sine2, 0))
    across = (cosine - GLASS_INDEX * inside) / (cosine + GLASS_INDEX * inside)
    along = (inside - GLASS_INDEX * cosine) / (inside + GLASS_INDEX * cosine)
    one = (across * across + along * along) / 2
    return 4 * one / (1 + 3 * one)


def traced(
    mi: Any,
    opaque: Triangles,
    glass: Triangles,
    surfaces: Surfaces,
    sky: Sky,
    origin: Any,
    direction: Any,
    sample: Any,
    shift: Any,
    rng: Any,
    max_depth: Any,
) -> tuple[Any, Any, Any]:
    """Radiance, albedo and normal of the first surface that is not glass, per ray.

    ``sample`` counts the samples of a pixel and ``shift`` (4 numbers in 0..1) is its own offset:
    together they spread the first bounce and the sun's disc evenly over a pixel's samples.
    """
    o, d = mi.Point3f(origin), mi.Vector3f(direction)
    radiance, through = mi.Color3f(0), mi.Color3f(1)
    albedo, normal = mi.Color3f(0), mi.Vector3f(0)
    depth = mi.UInt32(0)
    active = dr.full(mi.Bool, True, dr.width(origin))
    first = mi.Bool(active)
    spread = mi.Float(sample)
    sun = mi.Frame3f(sky.sun_direction)

    def bounce(
        active: Any,
        o: Any,
        d: Any,
        radiance: Any,
        through: Any,
        albedo: Any,
        normal: Any,
        first: Any,
        depth: Any,
        rng: Any,
    ) -> tuple[Any, ...]:
        ray = mi.Ray3f(o, d)
        pi = opaque.scene.ray_intersect_preliminary(ray, coherent=False, active=active)
        hit = active & pi.is_valid()
        distance = dr.select(hit, pi.t, dr.inf)
        ray.maxt = distance
        pane = glass.scene.ray_intersect_preliminary(ray, coherent=False, active=active)
        on_glass = active & pane.is_valid() & (pane.t < distance)
        hit &= ~on_glass
        escaped = active & ~hit & ~on_glass

        # Sky
        seen_sky = _sky_radiance(mi, sky, d, escaped)
        radiance[escaped] += through * seen_sky
        albedo[escaped & first] += through

        # Glass: one choice in two reflects, alternating from sample to sample where it comes first
        v = _corners(mi, glass, pane.prim_index, on_glass)
        n = dr.normalize(dr.cross(v[1] - v[0], v[2] - v[0]))
        cosine = dr.abs(dr.dot(n, d))
        share = pane_reflectance(cosine)
        chosen = dr.select(depth == 0, _fraction(shift[0] + 0.5 * spread), rng.next_float32(active))
        mirrored = on_glass & (chosen < 0.5)
        through[on_glass] *= 2 * dr.select(mirrored, share, 1 - share)
        o[on_glass] = o + d * pane.t
        d[mirrored] = d - 2 * dr.dot(n, d) * n
        o[on_glass] = o + d * EPSILON_M

        # Opaque surfaces
        v = _corners(mi, opaque, pi.prim_index, hit)
        n = dr.normalize(dr.cross(v[1] - v[0], v[2] - v[0]))
        n = dr.select(dr.dot(n, d) > 0, -n, n)
        face = dr.gather(mi.Vector3u, opaque.faces, pi.prim_index, hit)
        point = _blended(mi.Point3f, opaque.vertices, face, pi.prim_uv, hit)
        smooth = _blended(mi.Vector3f, opaque.normals, face, pi.prim_uv, hit)
        smooth = dr.select(dr.dot(smooth, n) < 0, -smooth, smooth)
        smooth = dr.select(dr.squared_norm(smooth) > 0.01, dr.normalize(smooth), n)
        smooth = dr.select(dr.dot(smooth, d) > -0.02, n, smooth)
        uv = _blended(mi.Point2f, opaque.uv, face, pi.prim_uv, hit)
        material = dr.gather(mi.UInt32, opaque.material, pi.prim_index, hit)
        kind = dr.gather(mi.UInt32, surfaces.kind, material, hit)
        rough = dr.gather(mi.Float, surfaces.roughness, material, hit)
        colour = _looked_up(mi, surfaces, material, uv.x, uv.y, hit)
        plastic, metal = hit & (kind == 1), hit & (kind == 2)
        leaf, lamp = hit & (kind == 3), hit & (kind == 4)
        radiance[lamp] += through * colour * LIGHT_STRENGTH
        albedo[hit & first] += through * colour
        normal[hit & first] += smooth
        first &= on_glass
        hit &= ~lamp

        # Sun
        frame = mi.Frame3f(smooth)
        wi = frame.to_local(-d)
        disc = mi.Point2f(
            dr.select(depth == 0, _fraction(shift[1] + 0.5698403 * spread), rng.next_float32(hit)),
            dr.select(depth == 0, _fraction(shift[2] + 0.7548777 * spread), rng.next_float32(hit)),
        )
        disc = mi.warp.square_to_uniform_disk_concentric(disc) * sky.sun_radius
        to_sun = dr.normalize(sun.to_world(mi.Vector3f(disc.x, disc.y, 1)))
        wo = frame.to_local(to_sun)
        gloss = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, rough)
        half = dr.normalize(wi + wo)
        facing = (wo.z > 0) & (dr.dot(n, to_sun) > 0)
        reflected = _coat(mi, plastic, metal, colour, dr.dot(wi, half))
        glossy = reflected * gloss.eval(half) * gloss.G(wi, wo, half) / (4 * dr.maximum(wi.z, 1e-3))
        base = dr.select(metal, mi.Color3f(0), colour) * (1 - _pale(plastic, wi.z)) / np.pi
        response = base * dr.maximum(wo.z, 0) + dr.select(plastic | metal, glossy, mi.Color3f(0))
        response = dr.select(facing, response, mi.Color3f(0))
        shine = mi.Color3f(colour * mi.Color3f(LEAF_THROUGH)) * dr.maximum(-wo.z, 0) / np.pi
        response = dr.select(leaf & (wo.z < 0), shine, response)
        lit = hit & (dr.max(response) > 0) & (dr.max(sky.sun_rgb) > 0)
        side = dr.select(dr.dot(n, to_sun) > 0, n, -n)
        lit &= ~opaque.scene.ray_test(mi.Ray3f(point + side * EPSILON_M, to_sun), active=lit)
        radiance[lit] += through * response * sky.sun_rgb

        # The next direction
        u = mi.Point2f(
            dr.select(depth == 0, _fraction(shift[2] + 0.7548777 * spread), rng.next_float32(hit)),
            dr.select(depth == 0, _fraction(shift[3] + 0.5698403 * spread), rng.next_float32(hit)),
        )
        which = rng.next_float32(hit)
        coat_share = dr.select(metal, 1.0, dr.select(plastic, 0.5 * _pale(plastic, wi.z) + 0.2, 0))
        coated = hit & (which < coat_share)
        facet, _ = gloss.sample(wi, u)
        mirror = 2 * dr.dot(wi, facet) * facet - wi
        weight = (
            _coat(mi, plastic, metal, colour, dr.dot(wi, facet))
            * gloss.smith_g1(mirror, facet)
            / dr.maximum(coat_share, 1e-3)
        )
        through_leaf = leaf & (which > 0.5)
        cosine_lobe = mi.warp.square_to_cosine_hemisphere(u)
        cosine_lobe.z = dr.select(through_leaf, -cosine_lobe.z, cosine_lobe.z)
        soft = dr.select(leaf, 2 * colour, colour * (1 - _pale(plastic, wi.z)) / (1 - coat_share))
        soft = dr.select(through_leaf, soft * mi.Color3f(LEAF_THROUGH), soft)
        through[hit] *= dr.select(coated, weight, soft)
        d[hit] = dr.normalize(frame.to_world(dr.select(coated, mirror, cosine_lobe)))
        below = (dr.dot(n, d) <= 0) & ~through_leaf
        o[hit] = point + dr.select(through_leaf, -n, n) * EPSILON_M
        active = (hit & ~below) | on_glass

        # Russian roulette after the third hit
        depth += 1
        strength = dr.clip(dr.max(through), 0.05, 0.95)
        stops = (depth > 2) & (rng.next_float32(active) > strength)
        through[depth > 2] /= strength
        active &= ~stops & (depth < max_depth) & (dr.max(through) > 0)
        return active, o, d, radiance, through, albedo, normal, first, depth, rng

    state = (active, o, d, radiance, through, albedo, normal, first, depth, rng)
    _, _, _, radiance, _, albedo, normal, *_ = dr.while_loop(
        state, lambda active, *_: active, bounce
    )
    brightest = dr.max(radiance)
    return radiance * dr.minimum(1, CLAMP / dr.maximum(brightest, 1e-6)), albedo, normal


def _fraction(value: Any) -> Any:
    return value - dr.floor(value)


def _corners(mi: Any, triangles: Triangles, face: Any, active: Any) -> list[Any]:
    """The three corners of a face."""
    index = dr.gather(mi.Vector3u, triangles.faces, face, active)
    return [dr.gather(mi.Point3f, triangles.vertices, index[k], active) for k in range(3)]


def _blended(kind: Any, values: Any, face: Any, place: Any, active: Any) -> Any:
    """Values at three vertices, mixed for a place in the face."""
    a, b, c = (dr.gather(kind, values, face[k], active) for k in range(3))
    return a * (1 - place.x - place.y) + b * place.x + c * place.y


def _pale(plastic: Any, cosine: Any) -> Any:
    """What a coat of varnish reflects (Schlick); 0 without one."""
    return dr.select(plastic, 0.04 + 0.96 * dr.power(1 - dr.clip(cosine, 0, 1), 5), 0)


def _coat(mi: Any, plastic: Any, metal: Any, colour: Any, cosine: Any) -> Any:
    """Reflectance of a facet of varnish or metal (Schlick)."""
    rest = dr.power(1 - dr.clip(cosine, 0, 1), 5)
    return dr.select(metal, colour + (1 - colour) * rest, mi.Color3f(_pale(plastic, cosine)))
