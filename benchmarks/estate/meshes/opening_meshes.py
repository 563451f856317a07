"""The filling of an opening: frame, casements, panes, panels and bars; sill, surround, shutters.

Everything is in the frame of the surface that holds the opening: x right, y up, z out of it. The
frame's outer edge is the opening's outline; the glass lies at z = -recess_m.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from benchmarks.estate.meshes.solids import band, box, cylinder, plane, prism, quad
from benchmarks.estate.meshes.wall_meshes import FRAME_BACK_M, frame_front_m, opening_outline
from benchmarks.estate.painting.house_materials import fixed, paint
from benchmarks.estate.parts import Mesh, Parts
from benchmarks.estate.plan import Opening, Rgb
from shapely import BufferJoinStyle, Polygon
from shapely.geometry import box as rectangle

_GAP_M = 0.005  # air between frame and casement, dark in every photo
_BAR_M = 0.024
_RAIL_M = 0.06


@dataclass(frozen=True)
class Joinery:
    """What all the windows of a house share: how casements lie in frames, colour of sills."""

    casement_out_m: float
    sill_rgb: Rgb | None  # None: bare zinc

    @classmethod
    def of(cls, rng: np.random.Generator) -> Joinery:
        """A joiner's habit."""
        out = (0.010, -0.010, -0.016)[int(rng.integers(3))]
        sill = (None, (0.30, 0.30, 0.31), (0.85, 0.85, 0.83), (0.24, 0.19, 0.16))
        return cls(out, sill[int(rng.integers(4))])


def _inset(shape: Any, by_m: float) -> Any:
    return shape.buffer(-by_m, join_style=BufferJoinStyle.mitre)


def _darker(rgb: Rgb, factor: float) -> Rgb:
    return (rgb[0] * factor, rgb[1] * factor, rgb[2] * factor)


def _pane(material: str, shape: Polygon, z: float, rng: np.random.Generator) -> Mesh:
    """A flat pane whose shading normals bulge a little, so that its reflections bend like glass."""
    mesh = plane(material, shape, z)
    low, high = np.asarray(shape.bounds[:2]), np.asarray(shape.bounds[2:])
    across = (mesh.vertices[:, :2] - (low + high) / 2) / (high - low)
    tilt = rng.normal(0, 0.004, 2)
    slope = tilt + rng.normal(0, 0.006) * across
    normals = np.column_stack([slope, np.ones(len(slope))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return replace(mesh, normals=normals.astype(np.float32), uv=None)


def _cells(opening: Opening, inner: Polygon, post_m: float) -> tuple[list[Any], list[Any]]:
    """The lights' outlines inside the frame, and the posts and transoms between them."""
    style, x, y = opening.style, opening.x_m, opening.y_m
    shares = np.asarray(style.lights, np.float64)
    edges = x + opening.width_m * np.concatenate([[0.0], np.cumsum(shares / shares.sum())])
    x0, y0, x1, y1 = inner.bounds
    posts = [rectangle(e - post_m / 2, y0 - 1, e + post_m / 2, y1 + 1) for e in edges[1:-1]]
    if style.transom is not None:
        bar = y + style.transom * opening.height_m
        posts.append(rectangle(x0 - 1, bar - post_m / 2, x1 + 1, bar + post_m / 2))
    rest = inner
    for post in posts:  # uncut: a post clipped to the frame would leave slivers beside its ends
        rest = rest.difference(post)
    posts = [post.intersection(inner) for post in posts]
    cells = [cell for cell in getattr(rest, "geoms", [rest]) if cell.area > 0.01]
    return sorted(cells, key=lambda cell: cell.bounds), posts


def filling_parts(opening: Opening, joinery: Joinery, rng: np.random.Generator) -> Parts:
    """Frame, casements, panes and panels."""
    parts = Parts()
    style = opening.style
    frame = paint(parts, style.frame_rgb)
    outer = opening_outline(opening)
    narrow = min(style.frame_m, 0.2 * opening.width_m, 0.2 * opening.height_m)
    profile, casement = 0.45 * narrow, 0.55 * narrow
    front, back = -frame_front_m(opening), -opening.recess_m - FRAME_BACK_M
    inner = _inset(outer, profile)
    parts.meshes += prism(frame, outer.difference(inner), back, front)
    cells, posts = _cells(opening, inner, profile)
    for post in posts:
        parts.meshes += prism(frame, post, back, front)
    floor = opening.y_m + style.panel * opening.height_m
    for cell in cells:
        leaf = _inset(cell, _GAP_M)
        field = _inset(leaf, casement)
        if field.is_empty or field.geom_type != "Polygon":
            parts.meshes += prism(frame, cell, back, front)
            continue
        rabbet = cell.difference(_inset(cell, 3 * _GAP_M))
        parts.meshes.append(plane(frame, rabbet, front - 0.03))
        face = front + min(joinery.casement_out_m, 0.6 * frame_front_m(opening))
        lift = -opening.recess_m
        parts.meshes += prism(frame, leaf.difference(field), lift - 0.03, face)
        parts.add(_light(opening, field, floor, face, rng))
    if opening.kind == "door":
        parts.add(_door_furniture(opening, front))
    return parts


def _light(
    opening: Opening, field: Polygon, floor_y: float, face: float, rng: np.random.Generator
) -> Parts:
    """What fills one casement: a pane with bars, above a panel where the style has one."""
    parts = Parts()
    style, glass_z = opening.style, -opening.recess_m
    x0, y0, x1, y1 = field.bounds
    frame = paint(parts, style.frame_rgb)
    if floor_y > y0 + 0.05:
        top = min(floor_y, y1)
        panel = field.intersection(rectangle(x0, y0, x1, top))
        parts.meshes.append(plane(frame, panel, face - 0.018))
        raised = _inset(panel, min(0.07, 0.25 * (x1 - x0)))
        if not raised.is_empty:
            parts.meshes += prism(frame, raised, face - 0.018, face - 0.008)
        if y1 - top > 2 * _RAIL_M:
            rail = rectangle(x0, top, x1, top + _RAIL_M)
            parts.meshes += prism(frame, rail, glass_z - 0.02, face)
            field = field.intersection(rectangle(x0, top + _RAIL_M, x1, y1))
        else:
            return parts
    parts.meshes.append(_pane(fixed(parts, "glass"), field, glass_z, rng))
    parts.meshes.append(band(frame, field, glass_z - 0.03, glass_z, inward=True))
    x0, y0, x1, y1 = field.bounds
    columns, rows = style.bars
    for i in range(1, columns):
        x = x0 + (x1 - x0) * i / columns
        bar = rectangle(x - _BAR_M / 2, y0, x + _BAR_M / 2, y1).intersection(field)
        parts.meshes += prism(frame, bar, glass_z - 0.01, glass_z + 0.014)
    for i in range(1, rows):
        y = y0 + (y1 - y0) * i / rows
        bar = rectangle(x0, y - _BAR_M / 2, x1, y + _BAR_M / 2).intersection(field)
        parts.meshes += prism(frame, bar, glass_z - 0.01, glass_z + 0.012)
    return parts


def _door_furniture(opening: Opening, front: float) -> Parts:
    """Handle, kick plate and the step in front."""
    parts = Parts()
    steel = fixed(parts, "zinc")
    style = opening.style
    shares = np.asarray(style.lights) / sum(style.lights)
    leaf = int(np.argmax(shares))
    x0 = opening.x_m + opening.width_m * shares[:leaf].sum()
    x1 = x0 + opening.width_m * shares[leaf]
    y = opening.y_m
    grip, z = x1 - 1.2 * style.frame_m, front + 0.06
    if opening.width_m > 0.7 and opening.height_m > 1.8:
        low, high = (grip, y + 0.85, z), (grip, y + 1.35, z)
        parts.meshes.append(cylinder(steel, low, high, 0.014, sides=8))
        for height in (y + 0.90, y + 1.30):
            foot = (grip, height, front - 0.01)
            parts.meshes.append(cylinder(steel, foot, (grip, height, z), 0.009, sides=6))
        plate = (x0 + style.frame_m, y + 0.06, front), (x1 - style.frame_m, y + 0.24, front + 0.012)
        parts.meshes.append(box(steel, *plate, without="back"))
    if 0.02 < y < 0.8 and opening.depth_m == 0:
        count = max(1, round(y / 0.17))
        concrete = fixed(parts, "concrete")
        for i in range(count):
            reach = 1.1 + 0.3 * (count - 1 - i)
            low = (opening.x_m - 0.25, 0.0, -0.05)
            high = (opening.x_m + opening.width_m + 0.25, y * (i + 1) / count - 0.01, reach)
            parts.meshes.append(box(concrete, low, high))
    return parts


def trim_parts(opening: Opening, joinery: Joinery) -> Parts:
    """Sill, surround and shutters around the opening."""
    parts = Parts()
    style = opening.style
    outline = opening_outline(opening)
    x0, y0, x1, y1 = outline.bounds
    stand = 0.0
    if style.surround_m > 0:
        stand = style.surround_depth_m
        stone = paint(parts, style.surround_rgb)
        wide = outline.buffer(style.surround_m, join_style=BufferJoinStyle.mitre)
        if opening.kind != "window":  # the band ends on the ground
            wide = wide.intersection(rectangle(x0 - 9, y0, x1 + 9, y1 + 9))
        parts.meshes += prism(stone, wide.difference(outline), -0.01, stand)
        depth = -opening.recess_m - FRAME_BACK_M
        if not style.arch:
            parts.meshes.append(band(stone, outline, depth, stand, inward=True))
    if style.sill_m > 0 and opening.kind == "window":
        parts.add(_sill(opening, joinery, stand))
    if style.shutters:
        for left in (x0 - opening.width_m / 2 - 0.03, x1 + 0.03):
            parts.add(_shutter(style.shutter_rgb, left, y0, opening.width_m / 2, y1 - y0, stand))
    return parts


def _sill(opening: Opening, joinery: Joinery, stand_m: float) -> Parts:
    """A metal plate: level up to the wall's face, then sloping down to a folded nose."""
    parts = Parts()
    metal = fixed(parts, "zinc") if joinery.sill_rgb is None else paint(parts, joinery.sill_rgb)
    style = opening.style
    x0, x1, y = opening.x_m, opening.x_m + opening.width_m, opening.y_m
    ends, nose = style.surround_m * 0.5 + 0.035, stand_m + style.sill_m
    inner_z, lip = -frame_front_m(opening), 0.028
    low = y - 0.12 * nose
    level = [(x0, y + 0.001, 0.0), (x1, y + 0.001, 0.0), (x1, y + 0.001, inner_z)]
    parts.meshes.append(quad(metal, [*level, (x0, y + 0.001, inner_z)]))
    a, b = x0 - ends, x1 + ends
    top = [(a, low, nose), (b, low, nose), (b, y + 0.001, 0.0), (a, y + 0.001, 0.0)]
    under = [(x, height - lip, z) for x, height, z in top]
    parts.meshes.append(quad(metal, top))
    parts.meshes.append(quad(metal, [under[0], under[1], top[1], top[0]]))
    parts.meshes.append(quad(metal, [under[3], under[2], under[1], under[0]]))
    parts.meshes.append(quad(metal, [under[1], under[2], top[2], top[1]]))
    parts.meshes.append(quad(metal, [under[3], under[0], top[0], top[3]]))
    return parts


def _shutter(rgb: Rgb, x: float, y: float, width: float, height: float, back: float) -> Parts:
    """An open louvred shutter, flat on the wall."""
    parts = Parts()
    wood, dark = paint(parts, rgb), paint(parts, _darker(rgb, 0.6))
    outer = rectangle(x, y, x + width, y + height)
    border = min(0.06, width / 4)
    field = _inset(outer, border)
    middle = rectangle(x, y + 0.48 * height, x + width, y + 0.48 * height + border)
    parts.meshes += prism(wood, outer.difference(field).union(middle), back + 0.01, back + 0.045)
    parts.meshes.append(plane(dark, field, back + 0.015))
    count = max(2, int((height - 2 * border) / 0.055))
    low_y = y + border + (height - 2 * border) * np.arange(count) / count
    slope = np.zeros((count, 4, 3))
    slope[:, :, 0] = [x + border, x + width - border, x + width - border, x + border]
    slope[:, :, 1] = low_y[:, None] + np.array([0.0, 0.0, 0.045, 0.045])
    slope[:, :, 2] = back + np.array([0.040, 0.040, 0.020, 0.020])
    parts.meshes += [quad(wood, corners) for corners in slope]
    return parts
