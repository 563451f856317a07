"""Roofs: flat ones behind a metal edge, and gable, hip and shed roofs with overhang and gutters.

Everything is in the world: x east, y north, z up; plans are polygons (x, y).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from benchmarks.estate.meshes.solids import TILE_M, band, cylinder, plane, prism, quad
from benchmarks.estate.painting.house_materials import CoverKind, covered_with, fixed, matt, paint
from benchmarks.estate.parts import Mesh, Parts
from benchmarks.estate.plan import Building, Wall
from shapely import BufferJoinStyle, Polygon
from shapely.geometry import LineString
from shapely.ops import split, unary_union

_EDGE_M = 0.04  # a flat roof's metal edge stands this far before the wall
_PARAPET_M = 0.30
UPSTAND_M = 0.14
_THICK_M = 0.16
_GUTTER_M = 0.065


@dataclass(frozen=True)
class Slope:
    """A plane piece of roof: its plan, and z = a x + b y + c of its underside."""

    plan: Polygon
    a: float
    b: float
    c: float

    def z(self, places: np.ndarray) -> np.ndarray:
        """Height (N,) at places (N, 2)."""
        return places @ np.array([self.a, self.b]) + self.c


def _grown(shape: Polygon, by_m: float) -> Polygon:
    return shape.buffer(by_m, join_style=BufferJoinStyle.mitre)


def roof_parts(building: Building, rng: np.random.Generator) -> Parts:
    """The whole roof without what stands on it."""
    plan = Polygon(building.outline)
    slopes = slopes_of(building)
    if not slopes:
        return _flat(building, plan)
    parts = Parts()
    roof = building.roof
    red = roof.rgb[0] > roof.rgb[2] + 0.08
    steep = float(np.hypot(slopes[0].a, slopes[0].b))
    kinds: tuple[CoverKind, ...] = ("roof_tiles", "sheet_roof")
    if red or steep < 0.25:
        kinds = ("roof_tiles",) if red else ("felt", "sheet_roof")
    cover = covered_with(parts, kinds[int(rng.integers(len(kinds)))], roof.rgb)
    board = paint(parts, tuple(0.75 * value for value in roof.rgb))  # type: ignore[arg-type]
    under = matt(parts, (0.70, 0.69, 0.66))
    for slope in slopes:
        parts.meshes += [_laid(cover, slope, _THICK_M), _laid(under, slope, 0.0)]
    edge = unary_union([slope.plan.buffer(1e-6) for slope in slopes]).simplify(1e-4)
    metal = fixed(parts, "zinc")
    for slope in slopes:
        shared = [other.plan for other in slopes if other is not slope]
        ring = np.asarray(slope.plan.exterior.coords)
        for a, b in pairwise(ring):
            middle = (a + b) / 2
            if edge.exterior.distance(LineString([middle, middle + 1e-6])) > 1e-3 and shared:
                continue
            parts.meshes.append(_fascia(board, slope, a, b))
            low = min(slope.z(np.stack([a, b])))
            lowest = float(min(slope.z(ring)))
            if abs(slope.z(a[None])[0] - slope.z(b[None])[0]) < 1e-3 and low < lowest + 1e-3:
                parts.meshes.append(_gutter(metal, slope, a, b))
    parts.add(_infill(building, slopes))
    parts.meshes += _ridges(cover, slopes)
    return parts


def slopes_of(building: Building) -> list[Slope]:
    """The plane pieces of a pitched roof; none for a flat one or a hip that is not convex."""
    roof = building.roof
    plan = Polygon(building.outline)
    wide = _grown(plan, roof.overhang_m)
    if roof.kind == "flat" or roof.rise_m < 0.05:
        return []
    if roof.kind == "hip":
        return _hip(building, plan, wide)
    along, origin = _ridge_of(building)
    across = np.array([-along[1], along[0]])
    reach = (building.outline - origin) @ across
    if roof.kind == "shed":
        gain = roof.rise_m / np.ptp(reach)
        level = building.height_m - gain * (reach.min() + across @ origin)
        return [Slope(wide, *(gain * across), level)]
    far = 4 * np.abs(building.outline - building.outline.mean(0)).max() + 10
    ridge = LineString([origin - far * along, origin + far * along])
    found = []
    for piece in split(wide, ridge).geoms:
        side = np.sign((np.asarray(piece.representative_point().coords[0]) - origin) @ across)
        gain = roof.rise_m / max(float((side * reach).max()), 0.5)
        a, b = -side * gain * across
        top = building.height_m + roof.rise_m
        found.append(Slope(piece, a, b, top - float(np.dot((a, b), origin))))
    return found


def _ridge_of(building: Building) -> tuple[np.ndarray, np.ndarray]:
    """Direction of the ridge and a place on it: from a gable's top, else along the longest wall."""
    for wall in building.walls:
        if wall.outline and max(y for _, y in wall.outline) > building.height_m + 0.05:
            top = max(wall.outline, key=lambda point: point[1])[0]
            frame = wall.world_from_facade
            return -frame.rotation[:2, 2], frame.apply([top, 0.0, 0.0])[:2]
    longest: Wall = max(building.walls, key=lambda wall: wall.width_m)
    along = longest.world_from_facade.rotation[:2, 0]
    across = np.array([-along[1], along[0]])
    reach = building.outline @ across
    return along, across * (reach.min() + reach.max()) / 2 + along * (building.outline[0] @ along)


def _hip(building: Building, plan: Polygon, wide: Polygon) -> list[Slope]:
    """One slope over each wall: where that wall is the nearest one."""
    if plan.convex_hull.area > plan.area * 1.001:
        return []
    inward = np.array([-wall.world_from_facade.rotation[:2, 2] for wall in building.walls])
    starts = building.outline
    offset = np.einsum("ij,ij->i", inward, starts)
    pieces = []
    for i in range(len(starts)):
        piece = wide
        for j in range(len(starts)):
            if j == i:
                continue
            # Keep what is nearer to wall i: (n_i - n_j) x <= o_i - o_j.
            normal, level = inward[i] - inward[j], offset[i] - offset[j]
            size = np.linalg.norm(normal)
            if size > 1e-6:
                piece = piece.intersection(_half_plane(normal / size, level / size))
        if not piece.is_empty and piece.geom_type == "Polygon" and piece.area > 1e-3:
            pieces.append((i, piece))
    inner = max(
        float((np.asarray(piece.exterior.coords) @ inward[i] - offset[i]).max())
        for i, piece in pieces
    )
    gain = building.roof.rise_m / inner
    return [
        Slope(piece, *(gain * inward[i]), building.height_m - gain * offset[i])
        for i, piece in pieces
    ]


def _half_plane(normal: np.ndarray, level: float) -> Polygon:
    """A large square whose points have n x <= level."""
    along = np.array([-normal[1], normal[0]])
    foot, far = level * normal, 2000.0
    return Polygon(
        [
            foot - far * along,
            foot + far * along,
            foot + far * along - far * normal,
            foot - far * along - far * normal,
        ]
    )


def _laid(material: str, slope: Slope, lift: float) -> Mesh:
    """The slope's upper face (lift > 0) or its underside, with a texture that runs up the slope."""
    flat = plane(material, slope.plan, 0.0, down=lift <= 0)
    places = flat.vertices[:, :2].astype(np.float64)
    steep = np.hypot(slope.a, slope.b)
    up = np.array([slope.a, slope.b]) / max(steep, 1e-9)
    along = np.array([up[1], -up[0]])
    uv = np.column_stack([places @ along, places @ up * np.hypot(1, steep)]) / TILE_M
    vertices = np.column_stack([places, slope.z(places) + lift])
    return replace(flat, vertices=vertices.astype(np.float32), uv=uv.astype(np.float32))


def _fascia(material: str, slope: Slope, a: np.ndarray, b: np.ndarray) -> Mesh:
    za, zb = slope.z(np.stack([a, b]))
    if slope.plan.exterior.is_ccw is False:
        a, b, za, zb = b, a, zb, za
    return quad(
        material,
        [(*a, za), (*b, zb), (*b, zb + _THICK_M), (*a, za + _THICK_M)],
    )


def _gutter(material: str, slope: Slope, a: np.ndarray, b: np.ndarray) -> Mesh:
    """A round gutter before an eave."""
    down = -np.array([slope.a, slope.b])
    shift = 1.1 * _GUTTER_M * down / max(float(np.linalg.norm(down)), 1e-9)
    z = slope.z(np.stack([a, b])) + 0.6 * _THICK_M
    return cylinder(material, (*(a + shift), z[0]), (*(b + shift), z[1]), _GUTTER_M, sides=8)


def _ridges(material: str, slopes: list[Slope]) -> list[Mesh]:
    """Round caps where two slopes meet."""
    found = []
    for i, one in enumerate(slopes):
        for other in slopes[i + 1 :]:
            line = one.plan.intersection(other.plan.buffer(1e-6)).intersection(
                one.plan.exterior.buffer(1e-5)
            )
            if line.is_empty or line.length < 0.2:
                continue
            box = line.minimum_rotated_rectangle
            corners = np.asarray(box.exterior.coords)[:4]
            sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
            k = int(np.argmin(sides))
            ends = [(corners[k] + corners[k - 3]) / 2, (corners[k - 1] + corners[k - 2]) / 2]
            z = one.z(np.stack(ends)) + _THICK_M - 0.03
            found.append(cylinder(material, (*ends[0], z[0]), (*ends[1], z[1]), 0.09, sides=8))
    return found


def _infill(building: Building, slopes: list[Slope]) -> Parts:
    """Upright triangles between the top of plain walls and the roof above them."""
    parts = Parts()
    for wall in building.walls:
        if wall.outline:
            continue
        line = LineString([wall.start, wall.end])
        for slope in slopes:
            cut = line.intersection(slope.plan.buffer(1e-6))
            if cut.is_empty or cut.geom_type != "LineString":
                continue
            ends = np.asarray(cut.coords)[[0, -1]]
            if (ends[1] - ends[0]) @ (np.asarray(wall.end) - wall.start) < 0:
                ends = ends[::-1]
            z = np.maximum(slope.z(ends), wall.height_m)
            if z.max() < wall.height_m + 0.02:
                continue
            low = [(*ends[0], wall.height_m), (*ends[1], wall.height_m)]
            material = matt(parts, wall.finish.rgb)
            parts.meshes.append(quad(material, [*low, (*ends[1], z[1]), (*ends[0], z[0])]))
    return parts


def _flat(building: Building, plan: Polygon) -> Parts:
    """A deck of felt behind a low parapet with a metal edge."""
    parts = Parts()
    roof = building.roof
    metal = paint(parts, roof.rgb)
    top = building.height_m + max(roof.rise_m, 0.05)
    foot = min(top - roof.fascia_m, building.height_m)
    outer = _grown(plan, roof.overhang_m + _EDGE_M)
    inner = _grown(plan, -_PARAPET_M)
    if inner.geom_type != "Polygon" or inner.is_empty:
        inner = _grown(plan, -0.05)
    parts.meshes += prism(metal, outer.difference(plan), foot, top, with_back=True)
    parts.meshes += prism(metal, _grown(outer, 0.02).difference(plan), top - 0.05, top + 0.01)
    parts.meshes.append(plane(metal, plan.difference(inner), top + 0.01))
    deck = fixed(parts, "felt")
    parts.meshes.append(band(deck, inner, top - UPSTAND_M, top + 0.01, inward=True))
    parts.meshes.append(plane(deck, inner, top - UPSTAND_M))
    return parts
