"""Meshes, materials and sky on the device, as few large arrays.

All triangles lie in two meshes (opaque, glass) and all textures in one buffer, so nothing that is
compiled depends on how many materials or meshes a scene has.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from benchmarks.estate.parts import Material, Mesh, Parts
from benchmarks.estate.rendering.light import SkyMap
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
DIFFUSE, PLASTIC, METAL, LEAF, LAMP = range(5)
KIND_NUMBERS = {"diffuse": DIFFUSE, "plastic": PLASTIC, "metal": METAL, "leaf": LEAF, "light": LAMP}
SMOOTHEST = 0.03
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
        mi.UInt32([KIND_NUMBERS.get(m.kind, DIFFUSE) for m in materials]),
        mi.Float(linear_of([m.rgb for m in materials]).astype(np.float32).ravel()),
        mi.Float([max(float(m.roughness), SMOOTHEST) for m in materials]),
        mi.UInt32(np.array(start, np.uint32)),
        mi.Int32(sizes[:, 0]),
        mi.Int32(sizes[:, 1]),
        mi.UInt32(np.concatenate([*texels, np.zeros(1, np.uint32)])),
    )


def uploaded_parts(mi: Any, parts: Parts) -> tuple[Triangles, Triangles, Surfaces]:
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


def uploaded_sky(mi: Any, sky: SkyMap) -> Sky:
    """The sky map on the device."""
    return Sky(
        sky.rgb.shape[1],
        sky.rgb.shape[0],
        mi.Float(np.ascontiguousarray(sky.rgb, np.float32).ravel()),
        mi.Vector3f(sky.sun_direction),
        mi.Color3f(sky.sun_rgb),
        mi.Float(np.sin(np.deg2rad(sky.sun_radius_deg))),
    )
