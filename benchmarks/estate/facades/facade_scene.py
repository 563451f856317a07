"""A facade with its ground, its neighbours, what stands before it and what its panes reflect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.facades.facade_details import extra_parts, masonry_parts, stucco
from benchmarks.estate.facades.styles_draft import FacadePlan
from benchmarks.estate.meshes.balcony_meshes import balcony_parts, front_kind_of
from benchmarks.estate.meshes.opening_meshes import Joinery, filling_parts, trim_parts
from benchmarks.estate.meshes.room_meshes import behind_parts, room_of
from benchmarks.estate.meshes.solids import box, cylinder, placed, quad
from benchmarks.estate.meshes.wall_meshes import loggia_of, skin_parts
from benchmarks.estate.painting.house_materials import fixed, paint
from benchmarks.estate.painting.wall_painting import paint_wall
from benchmarks.estate.parts import Material, Mesh, Parts, joined
from benchmarks.estate.plan import Car, Rgb, Tree, Wall
from benchmarks.estate.site.cars import car_parts
from benchmarks.estate.site.trees import tree_parts
from shapely.geometry import box as rectangle

from si3fp.geometry.rigid import Rigid3

M_PER_TEXEL = 0.015
ACROSS_M = 24.0
"""Where the other side of the street begins, metres before the wall; nothing nearer is behind
any camera."""
_HOUSE_M = 9.0  # depth of the house behind the facade


@dataclass(frozen=True)
class Before:
    """What stands before the wall, in its frame: trees (x, z, height), posts (x, z).

    Cars have their place as (x, -z), as in a world whose north is into the wall. ``wires`` are
    heights. Neighbours, left and right, are the colour of a plain wall, or not there.
    """

    trees: tuple[tuple[float, float, float], ...] = ()
    cars: tuple[Car, ...] = ()
    posts: tuple[tuple[float, float], ...] = ()
    wires: tuple[float, ...] = ()
    neighbours: tuple[Rgb | None, Rgb | None] = (None, None)
    season: str = "summer"


def facade_parts(plan: FacadePlan, before: Before, seed: int, number: int) -> Parts:
    """Everything of one picture, in the frame of the wall of the plan (x right, y up, z out)."""
    rng = rng_of(seed, "facade meshes", number)
    parts = _wall_parts(plan, rng)
    _house(parts, plan.wall, before)
    _street(parts, plan.wall, rng)
    _standing(parts, plan.wall, before, seed)
    return Parts(joined(parts.meshes), parts.materials)


def _wall_parts(plan: FacadePlan, rng: np.random.Generator) -> Parts:
    wall = plan.wall
    width = max(2, round(wall.width_m / M_PER_TEXEL))
    height = max(2, round(wall.height_m / M_PER_TEXEL))
    skin = Material("diffuse", wall.finish.rgb, paint_wall(wall, width, height, rng))
    parts = Parts(materials={"skin": skin})
    parts.add(skin_parts(wall, "skin", M_PER_TEXEL))
    free = rectangle(-1, 0, wall.width_m + 1, _HOUSE_M)
    for balcony in wall.balconies:
        if balcony.kind == "loggia":
            cut = rectangle(balcony.x_m, 0, balcony.x_m + balcony.width_m, balcony.depth_m)
            free = free.difference(cut)
    joinery = Joinery.of(rng)
    for opening in wall.openings:
        loggia = loggia_of(opening, wall)
        back = Parts()
        back.add(filling_parts(opening, joinery, rng))
        back.add(trim_parts(opening, joinery))
        parts.add(_moved(back, -loggia.depth_m if loggia else 0.0))
        parts.add(behind_parts(opening, room_of(opening, free), rng))
    fronts = {}
    for balcony in wall.balconies:
        if balcony.guard_m > 0:
            front = fronts.setdefault(balcony.kind, front_kind_of(balcony, rng))
            parts.add(balcony_parts(balcony, front, rng))
    for ornament in wall.ornaments:
        parts.add(masonry_parts(ornament))
    for extra in plan.extras:
        parts.add(extra_parts(extra, rng))
    return parts


def _moved(parts: Parts, out_m: float) -> Parts:
    """The parts moved along z."""
    if out_m == 0:
        return parts
    shift = Rigid3(np.eye(3), np.array([0.0, 0.0, out_m]))
    return Parts([placed(mesh, shift) for mesh in parts.meshes], parts.materials)


def _house(parts: Parts, wall: Wall, before: Before) -> None:
    """The roof's edge, and the neighbours' walls beside the facade."""
    dark = paint(parts, (0.22, 0.22, 0.23))
    top = wall.height_m
    parts.meshes.append(box(dark, (0, top, -_HOUSE_M), (wall.width_m, top + 0.12, 0.06)))
    for rgb, left, right in (
        (before.neighbours[0], -8.0, -0.01),
        (before.neighbours[1], wall.width_m + 0.01, wall.width_m + 8.0),
    ):
        if rgb is not None:
            skin = stucco(parts, rgb)
            parts.meshes.append(box(skin, (left, 0, -_HOUSE_M), (right, top + 1.5, -0.03)))


def _street(parts: Parts, wall: Wall, rng: np.random.Generator) -> None:
    """Pavement, road, and the houses across that the panes reflect."""
    far = 70.0
    middle = wall.width_m / 2
    paving, asphalt = fixed(parts, "paving"), fixed(parts, "asphalt")
    for material, near, end, y in ((paving, -12.0, 4.0, 0.0), (asphalt, 4.0, far, -0.12)):
        x0, x1 = middle - 60, middle + 60
        corners = [(x0, y, end), (x1, y, end), (x1, y, near), (x0, y, near)]
        uv = np.array([[x0, -end], [x1, -end], [x1, -near], [x0, -near]]) / 4.0
        parts.meshes.append(quad(material, corners, uv))
    x = middle - 45.0
    while x < middle + 45:
        wide = rng.uniform(8, 22)
        if rng.random() < 0.8:
            height, z = rng.uniform(5, 22), ACROSS_M + rng.uniform(0, 9)
            name = f"across-{int(rng.integers(8))}"
            parts.materials[name] = Material("diffuse", texture=_across(int(name[-1])))
            corners = [(x + wide, 0, z), (x, 0, z), (x, height, z), (x + wide, height, z)]
            uv = np.array([[0, 0], [wide, 0], [wide, height], [0, height]]) / 3.0
            parts.meshes.append(quad(name, corners, uv))
        x += wide + float(rng.choice([0.0, 0.0, 4.0]))


def _across(number: int) -> np.ndarray:
    """One storey's bay, 3 x 3 m, of a house across the street, as a texture."""
    rng = rng_of(0, "across", number)
    light = rng.uniform(0.35, 0.75)
    wall = light * np.array([1.0, rng.uniform(0.85, 1.0), rng.uniform(0.65, 0.98)])
    picture = np.broadcast_to(wall, (48, 48, 3)).copy()
    left, right = int(rng.integers(8, 16)), int(rng.integers(30, 42))
    picture[10:34, left:right] = 0.85
    picture[12:32, left + 2 : right - 2] = rng.uniform(0.1, 0.3)
    picture *= rng.normal(1, 0.03, (48, 48, 1))
    return np.clip(picture * 255, 20, 230).astype(np.uint8)


def _standing(parts: Parts, wall: Wall, before: Before, seed: int) -> None:
    """Trees, lamp posts and wires before the wall."""
    grown = Parts()
    if before.trees:
        trees = [
            Tree((x, -z), height, 0.65 * height, "shrub" if height < 2.5 else "round")
            for x, z, height in before.trees
        ]
        grown.add(tree_parts(trees, before.season, seed, "medium"))
    if before.cars:
        grown.add(car_parts(before.cars, -0.12, seed))
    upright = Rigid3(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), np.zeros(3))
    parts.add(Parts([placed(mesh, upright) for mesh in grown.meshes], grown.materials))
    iron = paint(parts, (0.25, 0.26, 0.26))
    for x, z in before.posts:
        parts.meshes.append(cylinder(iron, (x, 0, z), (x, 6.0, z), 0.09, end_radius_m=0.06))
        parts.meshes.append(cylinder(iron, (x, 6.0, z), (x + 0.9, 6.2, z), 0.04))
        parts.meshes.append(box(iron, (x + 0.6, 6.12, z - 0.1), (x + 1.2, 6.25, z + 0.1)))
    for y in before.wires:
        ends = np.linspace(-6, wall.width_m + 6, 13)
        sag = y + 0.4 * ((ends - ends.mean()) / (ends[-1] - ends[0]) * 2) ** 2
        for index in range(12):
            start = (ends[index], sag[index], 5.0)
            parts.meshes.append(
                cylinder(iron, start, (ends[index + 1], sag[index + 1], 5.0), 0.012, sides=5)
            )


def in_world(parts: Parts, world_from_facade: Rigid3) -> Parts:
    """The parts in the world's frame."""
    meshes: list[Mesh] = [placed(mesh, world_from_facade) for mesh in parts.meshes]
    return Parts(meshes, parts.materials)
