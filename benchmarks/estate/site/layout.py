"""What the ground is used for: roads, pavements, paths, as polygons in world metres.

Lawn is what is left over. Everything follows from the plan; nothing is drawn here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from benchmarks.estate.plan import Building, FloatArray, Street
from shapely import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

PATH_M = 1.8
APRON_M = 0.5
"""Width of the gravel strip along the walls."""
KERB_M = 0.12


@dataclass(frozen=True)
class Layout:
    """Areas of the ground, none of which overlap one another, and the doors' paths as lines."""

    built: BaseGeometry
    road: BaseGeometry
    pavement: BaseGeometry
    paths: BaseGeometry
    apron: BaseGeometry


def layout_of(buildings: Sequence[Building], streets: Sequence[Street]) -> Layout:
    """The areas between buildings and along streets."""
    built = shapely.union_all([Polygon(building.outline) for building in buildings])
    road = shapely.union_all([_strip(street, street.road_m) for street in streets]).difference(
        built
    )
    pavement = shapely.union_all(
        [_strip(street, street.road_m + 2 * street.pavement_m) for street in streets]
    )
    pavement = pavement.difference(road).difference(built)
    lines = [line for building in buildings for line in _paths_of(building, built, streets)]
    paths = shapely.union_all(
        [line.buffer(PATH_M / 2, cap_style="flat", join_style="mitre") for line in lines]
    )
    paths = paths.difference(shapely.union_all([built, road, pavement]))
    apron = built.buffer(APRON_M, join_style="mitre").difference(
        shapely.union_all([built, road, pavement, paths])
    )
    return Layout(built, road, pavement, paths, apron)


def _strip(street: Street, width_m: float) -> Polygon:
    return LineString(street.line).buffer(width_m / 2, cap_style="flat", join_style="round")


def doors_of(building: Building) -> list[tuple[FloatArray, FloatArray, float]]:
    """Middle of the foot of every entrance, the wall's outward direction, the width in metres."""
    found = []
    for wall in building.walls:
        frame = wall.world_from_facade
        right, outward = frame.rotation[:2, 0], frame.rotation[:2, 2]
        for opening in wall.openings:
            if opening.kind == "door" and opening.y_m < 0.6:
                foot = frame.translation[:2] + right * (opening.x_m + opening.width_m / 2)
                found.append((foot, outward, opening.width_m))
    return found


def _paths_of(
    building: Building, built: BaseGeometry, streets: Sequence[Street]
) -> list[LineString]:
    """Straight to the street where nothing is in the way, else around the building."""
    doors = doors_of(building)
    if not doors or not streets:
        return []
    outline = Polygon(building.outline)
    others = built.difference(outline.buffer(0.1))
    kerbs = shapely.union_all([LineString(street.line) for street in streets])
    ring = LineString(outline.buffer(4.0, join_style="mitre").exterior.coords)
    lines, around = [], False
    for foot, outward, _ in doors:
        target = shapely.get_coordinates(shapely.shortest_line(Point(foot), kerbs))[1]
        ahead = float(np.dot(target - foot, outward))
        straight = LineString([foot, foot + outward * ahead]) if ahead > 2 else None
        if straight is not None and ahead < 60 and _clear(straight, outline, others, kerbs):
            lines.append(straight)
        else:
            lines.append(LineString([foot, foot + outward * 4.0]))
            around = True
    if around:
        lines.append(ring)
        link = shapely.shortest_line(ring, kerbs)
        if link.length < 60 and not link.intersects(built):
            lines.append(link)
    return lines


def _clear(line: LineString, outline: Polygon, others: BaseGeometry, kerbs: BaseGeometry) -> bool:
    beyond = substring(line, 0.2, line.length)
    return (
        not beyond.intersects(outline)
        and not beyond.intersects(others)
        and kerbs.distance(Point(line.coords[-1])) < 0.5
    )
