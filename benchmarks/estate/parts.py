"""Meshes and materials: what the plan becomes before it is rendered."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from benchmarks.estate.plan import Rgb
from numpy.typing import NDArray

MaterialKind = Literal["diffuse", "plastic", "metal", "glass", "leaf", "light"]


@dataclass(frozen=True)
class Material:
    """How a surface scatters light.

    Attributes
    ----------
    kind
        ``diffuse``; ``plastic`` (coloured, with a glossy coat: paint, cars); ``metal`` (rough);
        ``glass`` (a thin pane that reflects and lets through); ``leaf`` (diffuse from both sides,
        partly through); ``light`` (emits ``rgb``).
    rgb
        sRGB in 0..1, where there is no texture.
    texture
        (H, W, 3) uint8 sRGB, row 0 on top, or None. ``uv`` (0, 0) is its lower left corner, (1, 1)
        its upper right; it repeats.
    roughness
        Of the coat or metal.
    """

    kind: MaterialKind = "diffuse"
    rgb: Rgb = (0.5, 0.5, 0.5)
    texture: NDArray[np.uint8] | None = None
    roughness: float = 0.2


@dataclass(frozen=True)
class Mesh:
    """Triangles of one material: vertices (V, 3) m in world, faces (F, 3), uv (V, 2) or None.

    Faces are counter-clockwise seen from outside. ``normals`` (V, 3) are for round things; without
    them every triangle is flat.
    """

    material: str
    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    uv: NDArray[np.float32] | None = None
    normals: NDArray[np.float32] | None = None


@dataclass
class Parts:
    """Meshes and the materials that they name."""

    meshes: list[Mesh] = field(default_factory=list)
    materials: dict[str, Material] = field(default_factory=dict)

    def add(self, other: Parts) -> None:
        """Take over the meshes and materials of others; equal names mean equal materials."""
        self.meshes.extend(other.meshes)
        self.materials.update(other.materials)


def joined(meshes: Iterable[Mesh]) -> list[Mesh]:
    """One mesh per material (and per having normals or not)."""
    groups: dict[tuple[str, bool, bool], list[Mesh]] = {}
    for mesh in meshes:
        key = (mesh.material, mesh.uv is not None, mesh.normals is not None)
        groups.setdefault(key, []).append(mesh)
    found = []
    for (material, has_uv, has_normals), group in groups.items():
        starts = np.cumsum([0, *(len(mesh.vertices) for mesh in group[:-1])])
        found.append(
            Mesh(
                material,
                np.concatenate([mesh.vertices for mesh in group]),
                np.concatenate([m.faces + s for m, s in zip(group, starts, strict=True)]).astype(
                    np.int32
                ),
                np.concatenate([m.uv for m in group if m.uv is not None]) if has_uv else None,
                np.concatenate([m.normals for m in group if m.normals is not None])
                if has_normals
                else None,
            )
        )
    return found
