"""Everything around the target buildings as meshes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from benchmarks.estate.drawing import millimetres, rng_of
from benchmarks.estate.meshes.building_meshes import building_parts
from benchmarks.estate.meshes.solids import cylinder
from benchmarks.estate.parts import Material, Parts, joined
from benchmarks.estate.plan import Building, Estate, Tree, Wall
from benchmarks.estate.site.cars import car_parts
from benchmarks.estate.site.foliage import hedge_parts, season_of
from benchmarks.estate.site.grass import grass_parts
from benchmarks.estate.site.ground import ROAD_Z_M, ground_parts
from benchmarks.estate.site.layout import layout_of
from benchmarks.estate.site.trees import tree_parts
from shapely import Point, Polygon

FINE_M = 20.0
"""Trees and cars within this distance of the targets are made in full, others with less."""
NEIGHBOUR_TEXEL_M = 0.04
WOOD_M = (150.0, 260.0)
"""Distances of the wood that closes the horizon."""
WOOD_TREES = 240


def surroundings_parts(estate: Estate) -> Parts:
    """Ground, neighbours, trees, hedges, cars and lamps of an estate."""
    season = season_of(estate.light.date)
    targets = shapely.union_all([Polygon(building.outline) for building in estate.buildings])

    def near(place: tuple[float, float]) -> bool:
        return bool(targets.distance(Point(place)) < FINE_M)

    parts = ground_parts(estate)
    for neighbour in estate.neighbours:
        away = targets.distance(Polygon(neighbour.outline))
        texel_m = NEIGHBOUR_TEXEL_M * (1 if away < 2 * FINE_M else 2)
        parts.add(building_parts(_emptied(neighbour), estate.seed, m_per_texel=texel_m))
    for detail, wanted in (("fine", True), ("medium", False)):
        some = [tree for tree in estate.trees if near(tree.place) == wanted]
        parts.add(tree_parts(some, season, estate.seed, detail))
    parts.add(tree_parts(_wood(estate), season, estate.seed, "far"))
    layout = layout_of((*estate.buildings, *estate.neighbours), estate.streets)
    parts.add(grass_parts(estate, layout))
    parts.add(hedge_parts(estate.hedges, season, estate.seed))
    for coarse in (False, True):
        some = [car for car in estate.cars if near(car.place) != coarse]
        parts.add(car_parts(some, ROAD_Z_M, estate.seed, coarse=coarse))
    parts.add(_lamp_parts(estate))
    parts.meshes = joined(parts.meshes)
    return parts


def _emptied(building: Building) -> Building:
    """The building without furniture and plants on balconies and sills."""

    def emptied(wall: Wall) -> Wall:
        return replace(
            wall,
            openings=tuple(
                replace(opening, behind=replace(opening.behind, things=False))
                for opening in wall.openings
            ),
            balconies=tuple(replace(balcony, things=False) for balcony in wall.balconies),
        )

    return replace(building, walls=tuple(emptied(wall) for wall in building.walls))


def _wood(estate: Estate) -> list[Tree]:
    """Trees all around, behind everything else."""
    rng = rng_of(estate.seed, "wood")
    corners = np.concatenate([building.outline for building in estate.buildings])
    centre = (corners.min(0) + corners.max(0)) / 2
    built = shapely.union_all([Polygon(b.outline).buffer(8) for b in estate.neighbours])
    roads = shapely.union_all([shapely.LineString(s.line).buffer(8) for s in estate.streets])
    trees = []
    for number in range(WOOD_TREES):
        angle = 2 * np.pi * (number + rng.uniform(0, 1)) / WOOD_TREES
        radius = WOOD_M[0] + (WOOD_M[1] - WOOD_M[0]) * rng.uniform(0, 1) ** 1.5
        place = centre + radius * np.array([np.cos(angle), np.sin(angle)])
        tall = rng.uniform(11, 19)
        pine = rng.uniform() < 0.5
        if built.distance(Point(place)) > 0 and roads.distance(Point(place)) > 0:
            trees.append(
                Tree(
                    (millimetres(place[0]), millimetres(place[1])),
                    millimetres(tall),
                    millimetres(tall * (0.45 if pine else 0.65)),
                    "pine" if pine else "round",
                )
            )
    return trees


def _lamp_parts(estate: Estate) -> Parts:
    """Posts with an arm over the road and a flat head."""
    parts = Parts(
        materials={
            "lamp-post": Material("metal", (0.55, 0.57, 0.58), roughness=0.45),
            "lamp-head": Material("plastic", (0.36, 0.37, 0.38), roughness=0.4),
        }
    )
    roads = shapely.union_all([shapely.LineString(street.line) for street in estate.streets])
    for lamp in estate.lamps:
        foot = np.array([*lamp.place, 0.0])
        ahead = shapely.get_coordinates(shapely.shortest_line(Point(lamp.place), roads))
        over = np.append(ahead[1] - ahead[0], 0.0)
        over /= np.linalg.norm(over)
        bend = np.array([*lamp.place, 1.1])
        top = np.array([*lamp.place, lamp.height_m])
        arm = top + over * 0.7
        arm[2] += 0.12
        parts.meshes += [
            cylinder("lamp-post", foot, bend, 0.07, sides=14),
            cylinder("lamp-post", bend, top, 0.055, end_radius_m=0.04, sides=14),
            cylinder("lamp-post", top, arm, 0.03, sides=10),
            cylinder(
                "lamp-head", arm - over * 0.1, arm + over * 0.5, 0.085, sides=14, end_radius_m=0.06
            ),
        ]
    return parts
