"""A building as meshes: skin, openings, rooms behind them, balconies, roof."""

from __future__ import annotations

import numpy as np
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.meshes.balcony_meshes import balcony_parts, front_kind_of
from benchmarks.estate.meshes.opening_meshes import Joinery, filling_parts, trim_parts
from benchmarks.estate.meshes.roof_meshes import roof_parts
from benchmarks.estate.meshes.roof_things import roof_things
from benchmarks.estate.meshes.room_meshes import behind_parts, room_of
from benchmarks.estate.meshes.solids import moved, placed, plane
from benchmarks.estate.meshes.wall_meshes import ornament_parts, skin_parts
from benchmarks.estate.painting.house_materials import matt
from benchmarks.estate.painting.wall_painting import paint_wall
from benchmarks.estate.parts import Material, Parts, joined
from benchmarks.estate.plan import Building, Wall
from shapely import LineString, Polygon, affinity
from shapely.ops import unary_union

INNER_SKIN_M = 0.02  # rooms keep this far from the inside of any wall
OTHER_WALLS_M = 0.45  # and this far from the other walls, whose frames lie up to 0.3 m behind them


def building_parts(building: Building, seed: int, *, m_per_texel: float = 0.01) -> Parts:
    """All meshes of a building in the world, one per material.

    The same building and seed give the same meshes.
    """
    parts = Parts()
    plan = Polygon(building.outline)
    for wall in building.walls:
        others = [other for other in building.walls if other is not wall]
        lines = unary_union([LineString([other.start, other.end]) for other in others])
        taken = [lines.buffer(OTHER_WALLS_M), _loggias(wall)]
        taken += [_loggias(other, OTHER_WALLS_M) for other in others]
        own = plan.buffer(-INNER_SKIN_M).difference(unary_union(taken))
        parts.add(_wall(wall, building.id, seed, _seen_from(wall, own), m_per_texel))
    parts.add(roof_parts(building, rng_of(seed, building.id, "roof")))
    parts.add(roof_things(building, rng_of(seed, building.id, "roof things")))
    parts.meshes.append(plane(matt(parts, (0.2, 0.2, 0.2)), plan, -0.02))
    parts.meshes = joined(parts.meshes)
    return parts


def _loggias(wall: Wall, behind_m: float = 0.0) -> Polygon:
    """The plan (world) of what the wall's loggias and some metres behind them take."""
    frame = wall.world_from_facade
    cuts = []
    for balcony in wall.balconies:
        if balcony.kind == "loggia":
            x0, x1 = balcony.x_m - 0.1, balcony.x_m + balcony.width_m + 0.1
            z = -balcony.depth_m - behind_m
            corners = [(x0, 0, 0), (x1, 0, 0), (x1, 0, z), (x0, 0, z)]
            cuts.append(Polygon(frame.apply(corners)[:, :2]))
    return unary_union(cuts) if cuts else Polygon()


def _to_wall(wall: Wall) -> list[float]:
    """Coefficients of shapely's affine transform from the world's plan to (along, behind)."""
    frame = wall.world_from_facade
    along, inward = frame.rotation[:2, 0], -frame.rotation[:2, 2]
    start = np.asarray(wall.start)
    return [*along, *inward, -float(along @ start), -float(inward @ start)]


def _seen_from(wall: Wall, free: Polygon) -> Polygon:
    return affinity.affine_transform(free, _to_wall(wall))


def _wall(wall: Wall, house: str, seed: int, free: Polygon, m_per_texel: float) -> Parts:
    """Meshes of one wall in the world; ``free`` is the room (along, behind) there is behind it."""
    parts = Parts()
    skin = f"wall-{wall.id}"
    parts.materials[skin] = Material("diffuse", wall.finish.rgb, _painting(wall, seed, m_per_texel))
    parts.add(skin_parts(wall, skin, m_per_texel))
    joinery = Joinery.of(rng_of(seed, house, "joinery"))
    for number, opening in enumerate(wall.openings):
        rng = rng_of(seed, wall.id, "opening", number)
        own = filling_parts(opening, joinery, rng)
        own.add(trim_parts(opening, joinery))
        if opening.depth_m:
            own.meshes = [moved(mesh, (0, 0, -opening.depth_m)) for mesh in own.meshes]
        parts.add(own)
        parts.add(behind_parts(opening, room_of(opening, free), rng))
    for number, balcony in enumerate(wall.balconies):
        front = front_kind_of(balcony, rng_of(seed, house, "front", *balcony.rgb))
        parts.add(balcony_parts(balcony, front, rng_of(seed, wall.id, "balcony", number)))
    for ornament in wall.ornaments:
        parts.add(ornament_parts(ornament))
    frame = wall.world_from_facade
    parts.meshes = [placed(mesh, frame) for mesh in joined(parts.meshes)]
    return parts


def _painting(wall: Wall, seed: int, m_per_texel: float) -> np.ndarray:
    """The wall's whole picture, from its bounds' upper left corner."""
    size = [max(2, round(length / m_per_texel)) for length in (wall.width_m, wall.height_m)]
    return paint_wall(wall, size[0], size[1], rng_of(seed, wall.id, "painting"))
