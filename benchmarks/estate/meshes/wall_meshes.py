"""The skin of a wall with its holes, reveals and loggias, and what stands out of it.

Everything is in the wall's own frame: x right, y up from the lower left corner, z out of the wall.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from benchmarks.estate.meshes.solids import band, box, boxes, cylinder, plane
from benchmarks.estate.painting.house_materials import fixed, paint
from benchmarks.estate.parts import Mesh, Parts
from benchmarks.estate.plan import Balcony, Opening, Ornament, Wall
from shapely.geometry import Polygon
from shapely.geometry import box as rectangle

ARCH_STEPS = 10
FRAME_LEAD_M = 0.04
FRAME_BACK_M = 0.06
_CLAMP_EVERY_M = 2.0
_OWN_COLOUR = Ornament("box", 0, 0, 0, 0, 0).rgb


def outline_of(wall: Wall) -> Polygon:
    """The wall's outline (x, y) in metres."""
    return Polygon(wall.outline) if wall.outline else rectangle(0, 0, wall.width_m, wall.height_m)


def opening_outline(opening: Opening) -> Polygon:
    """The opening's outline (x, y): its box, or what lies below a segmental arch in it."""
    x0, y0 = opening.x_m, opening.y_m
    x1, y1 = x0 + opening.width_m, y0 + opening.height_m
    rise = min(opening.style.arch, 0.5) * opening.width_m
    if rise < 0.01:
        return rectangle(x0, y0, x1, y1)
    half = opening.width_m / 2
    radius = (half**2 + rise**2) / (2 * rise)
    reach = np.arcsin(min(half / radius, 1.0))
    turn = np.linspace(reach, -reach, ARCH_STEPS + 1)
    arc = np.column_stack([x0 + half + radius * np.sin(turn), y1 - radius * (1 - np.cos(turn))])
    return Polygon([(x0, y0), (x1, y0), *arc.tolist()])


def loggia_outline(balcony: Balcony) -> Polygon:
    """The hole (x, y) that a loggia cuts into the wall."""
    x, y = balcony.x_m, balcony.y_m
    return rectangle(x, y, x + balcony.width_m, y + balcony.clear_m)


def loggia_of(opening: Opening, wall: Wall) -> Balcony | None:
    """The loggia whose back wall holds the opening."""
    if opening.depth_m <= 0:
        return None
    x, y = opening.x_m + opening.width_m / 2, opening.y_m + opening.height_m / 2
    for balcony in wall.balconies:
        if balcony.kind == "loggia" and loggia_outline(balcony).buffer(0.01).intersects(
            rectangle(x, y, x, y)
        ):
            return balcony
    return None


def frame_front_m(opening: Opening) -> float:
    """How far the front of the frame lies behind the surface that holds the opening."""
    return opening.recess_m - min(FRAME_LEAD_M, 0.7 * opening.recess_m)


@dataclass(frozen=True)
class _Skin:
    """A wall's material and where its texture lies."""

    wall: Wall
    material: str
    margin: tuple[float, float]  # half a texel, so that the picture's far side does not bleed in

    def mapped(self, mesh: Mesh, places: np.ndarray) -> Mesh:
        """The mesh with the wall's picture at places (V, 2) in metres on the wall."""
        size = np.array([self.wall.width_m, self.wall.height_m])
        margin = np.asarray(self.margin)
        uv = np.clip(places / size, margin, 1 - margin)
        return replace(mesh, material=self.material, uv=uv.astype(np.float32))

    def face(self, shape: Polygon, z: float) -> list[Mesh]:
        """A part of the wall at depth z with its own piece of the picture."""
        found = []
        for polygon in getattr(shape, "geoms", [shape]):
            if not polygon.is_empty:
                mesh = plane(self.material, polygon, z)
                found.append(self.mapped(mesh, mesh.vertices[:, :2].astype(np.float64)))
        return found

    def reveal(self, hole: Polygon, back: float, front: float) -> Mesh:
        """The sides of a hole; the wall's picture goes round the edge into them."""
        mesh = band(self.material, hole, back, front, inward=True)
        points = mesh.vertices.reshape(-1, 4, 3).astype(np.float64)
        low, high = points[:, :, :2].min(1), points[:, :, :2].max(1)
        along = high - low
        normal = np.column_stack([along[:, 1], along[:, 0]])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        centre = np.asarray(hole.centroid.coords[0])
        normal *= np.where((low + high) / 2 >= centre, 1.0, -1.0)
        depth = front - points[:, :, 2:]
        return self.mapped(mesh, (points[:, :, :2] + depth * normal[:, None]).reshape(-1, 2))


def skin_parts(wall: Wall, material: str, m_per_texel: float = 0.01) -> Parts:
    """The wall's faces in its own material: holes, reveals of the openings, loggias."""
    parts = Parts()
    margin = (0.5 * m_per_texel / wall.width_m, 0.5 * m_per_texel / wall.height_m)
    skin = _Skin(wall, material, margin)
    shape = outline_of(wall)
    loggias = [balcony for balcony in wall.balconies if balcony.kind == "loggia"]
    backs = [loggia_outline(loggia) for loggia in loggias]
    for opening in wall.openings:
        hole = opening_outline(opening)
        loggia = loggia_of(opening, wall)
        front, back = 0.0, -opening.depth_m - opening.recess_m - FRAME_BACK_M
        if loggia is None:
            shape = shape.difference(hole)
        else:
            front = -loggia.depth_m
            backs[loggias.index(loggia)] = backs[loggias.index(loggia)].difference(hole)
        parts.meshes.append(skin.reveal(hole, back, front))
    for loggia, back_wall in zip(loggias, backs, strict=True):
        hole = loggia_outline(loggia)
        shape = shape.difference(hole)
        parts.meshes += skin.face(back_wall, -loggia.depth_m)
        parts.add(_loggia_inside(loggia, skin))
    parts.meshes += skin.face(shape, 0.0)
    return parts


def _loggia_inside(loggia: Balcony, skin: _Skin) -> Parts:
    """Side walls in the wall's material, floor and ceiling of concrete."""
    parts = Parts()
    sides = skin.reveal(loggia_outline(loggia), -loggia.depth_m, 0.0)
    upright = np.ptp(sides.vertices.reshape(-1, 4, 3)[:, :, 1], axis=1) > 1e-3
    faces = sides.faces.reshape(-1, 2, 3)
    parts.meshes.append(replace(sides, faces=faces[upright].reshape(-1, 3)))
    concrete = band(
        fixed(parts, "concrete"), loggia_outline(loggia), -loggia.depth_m, 0.0, inward=True
    )
    parts.meshes.append(replace(concrete, faces=faces[~upright].reshape(-1, 3)))
    return parts


def ornament_parts(ornament: Ornament) -> Parts:
    """A box, or an upright pipe with its clamps."""
    parts = Parts()
    if ornament.material == "painted" or ornament.rgb != _OWN_COLOUR:
        material = paint(parts, ornament.rgb)
    else:
        material = fixed(parts, ornament.material)
    x0, y0 = ornament.x_m, ornament.y_m
    x1, y1 = x0 + ornament.width_m, y0 + ornament.height_m
    if ornament.kind == "box":
        front = ornament.gap_m + ornament.out_m
        parts.meshes.append(box(material, (x0, y0, ornament.gap_m), (x1, y1, front)))
        return parts
    radius = ornament.width_m / 2
    x, z = x0 + radius, ornament.gap_m + radius
    foot = y0
    if y0 < 0.6 and ornament.height_m > 2:  # a downpipe ends in a shoe
        foot = y0 + 0.16
        toe = (x, max(y0, 0.06), z + 0.14)
        parts.meshes.append(cylinder(material, (x, foot + 0.02, z), toe, radius))
    parts.meshes.append(cylinder(material, (x, foot, z), (x, y1, z), radius))
    count = max(1, round(ornament.height_m / _CLAMP_EVERY_M))
    heights = y0 + ornament.height_m * (np.arange(count) + 0.5) / count
    for y in heights:
        parts.meshes.append(
            cylinder(material, (x, y - 0.015, z), (x, y + 0.015, z), radius + 0.008, caps=True)
        )
    arms = np.column_stack([np.full(count, x), heights, np.zeros(count)])
    half = np.array([0.01, 0.01, 0.0])
    parts.meshes.append(boxes(material, arms - half, arms + half + (0, 0, z)))
    return parts
