"""Meshes of buildings against the plan that they come from."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.estate.meshes.balcony_meshes import balcony_parts
from benchmarks.estate.meshes.building_meshes import building_parts
from benchmarks.estate.meshes.roof_meshes import roof_parts, slopes_of
from benchmarks.estate.meshes.room_meshes import behind_parts, room_of
from benchmarks.estate.meshes.solids import ball, box, boxes, cylinder, plane, prism, sheet
from benchmarks.estate.meshes.wall_meshes import opening_outline, ornament_parts, skin_parts
from benchmarks.estate.parts import Mesh, Parts
from benchmarks.estate.plan import (
    Balcony,
    Behind,
    Building,
    Finish,
    Opening,
    Ornament,
    Roof,
    Wall,
    WindowStyle,
)
from shapely import Polygon
from shapely.geometry import box as rectangle

from si3fp.errors import InputError

COARSE = 0.1  # m per texel: the pictures do not matter here


def triangles(mesh: Mesh) -> np.ndarray:
    return mesh.vertices[mesh.faces].astype(np.float64)


def area_m2(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(triangles(mesh), 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def volume_m3(meshes: list[Mesh]) -> float:
    """Enclosed volume; positive where closed faces look outward (divergence theorem)."""
    found = 0.0
    for mesh in meshes:
        a, b, c = np.moveaxis(triangles(mesh), 1, 0)
        found += np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    return float(found)


def first_hit(parts: Parts, origin: np.ndarray, direction: np.ndarray) -> tuple[float, str]:
    """Distance to the first triangle on a ray and its material (Moller and Trumbore, 1997)."""
    best, name = np.inf, ""
    for mesh in parts.meshes:
        a, b, c = np.moveaxis(triangles(mesh), 1, 0)
        edge1, edge2, to = b - a, c - a, origin - a
        across = np.cross(direction, edge2)
        scale = np.einsum("ij,ij->i", edge1, across)
        crossed = np.abs(scale) > 1e-12
        scale[~crossed] = 1.0
        u = np.einsum("ij,ij->i", to, across) / scale
        turned = np.cross(to, edge1)
        v = turned @ direction / scale
        t = np.einsum("ij,ij->i", edge2, turned) / scale
        t[~(crossed & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-6))] = np.inf
        if len(t) and t.min() < best:
            best, name = float(t.min()), mesh.material
    return best, name


WINDOW = Opening("window", 1.0, 1.0, 1.4, 1.3, 0.12, WindowStyle((0.5, 0.5)))
DOOR = Opening("door", 4.0, 0.2, 1.2, 2.1, 0.15, WindowStyle((0.7, 0.3), panel=0.3))
INNER = Opening("balcony_door", 7.0, 3.0, 0.9, 2.1, 0.08, WindowStyle(panel=0.3), depth_m=1.4)
LOGGIA = Balcony("loggia", 6.5, 3.0, 2.5, 1.4)
WALL = Wall(
    "w", (2.0, 1.0), (12.0, 1.0), 6.0, Finish("plaster", (0.7, 0.6, 0.5)), (WINDOW, DOOR, INNER),
    (LOGGIA, Balcony("solid", 0.5, 3.2, 3.0, 1.4, things=True)),
    (Ornament("pipe", 9.6, 0.0, 0.1, 6.0, 0.1, 0.04),),
)  # fmt: skip


def house(roof: Roof, *, openings: tuple[Opening, ...] = (WINDOW, DOOR)) -> Building:
    corners = [(0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0)]
    finish = Finish("plaster", (0.7, 0.6, 0.5))
    walls = tuple(
        Wall(f"h-{i}", a, b, 6.0, finish, openings)
        for i, (a, b) in enumerate(zip(corners, corners[1:] + corners[:1], strict=True))
    )
    return Building("h", walls, 6.0, 2, 2.8, 1965, roof)


def behind(front: Wall, seed: int) -> Parts:
    """A house 8 m deep behind `WALL` or a wall like it; its other walls are bare."""
    corners = [(2.0, 1.0), (12.0, 1.0), (12.0, 9.0), (2.0, 9.0)]
    bare = replace(front, openings=(), balconies=(), ornaments=())
    others = (
        replace(bare, id=f"w-{i}", start=corners[i], end=corners[(i + 1) % 4]) for i in (1, 2, 3)
    )
    building = Building("h", (front, *others), 6.0, 2, 2.8, 1965)
    return building_parts(building, seed, m_per_texel=COARSE)


@pytest.fixture(scope="module")
def whole() -> Parts:
    return building_parts(house(Roof()), 3, m_per_texel=COARSE)


def test_solids_enclose_their_volume_with_outward_faces() -> None:
    assert volume_m3([box("m", (1, 2, 3), (2, 4, 6))]) == pytest.approx(6, rel=1e-5)
    two = boxes("m", [(0, 0, 0), (5, 0, 0)], [(1, 1, 1), (6, 2, 1)])
    assert volume_m3([two]) == pytest.approx(3, rel=1e-5)
    round_ = cylinder("m", (0, 0, 0), (3, 0, 4), 0.5, sides=64)
    assert volume_m3([round_]) == pytest.approx(np.pi * 0.25 * 5, rel=3e-3)
    assert volume_m3([ball("m", (1, 1, 1), (1, 2, 3), rings=24)]) == pytest.approx(
        4 / 3 * np.pi * 6, rel=2e-2
    )
    ring = rectangle(0, 0, 3, 3).difference(rectangle(1, 1, 2, 2))
    assert volume_m3(prism("m", ring, 1.0, 1.5, with_back=True)) == pytest.approx(4, rel=1e-5)


def test_smooth_normals_look_the_way_of_their_faces() -> None:
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(3.0)), axis=-1)
    wave = sheet("m", np.dstack([grid, 0.2 * np.sin(grid[..., 0])]), smooth=True)
    for mesh in (wave, cylinder("m", (0, 0, 0), (0, 1, 0), 0.3), ball("m", (0, 0, 0), 1.0)):
        a, b, c = np.moveaxis(triangles(mesh), 1, 0)
        flat = np.cross(b - a, c - a)
        assert mesh.normals is not None
        smooth = mesh.normals[mesh.faces].mean(1)
        whole_faces = np.linalg.norm(flat, axis=1) > 1e-9
        assert (np.einsum("ij,ij->i", flat, smooth)[whole_faces] > 0).all()


def test_plate_keeps_its_texture_where_it_is_told() -> None:
    mesh = plane("m", rectangle(2, 1, 4, 2), 0.5, uv_box=(0, 0, 4, 2))
    assert mesh.uv is not None
    np.testing.assert_allclose(mesh.uv * (4, 2), mesh.vertices[:, :2], atol=1e-6)


def test_skin_is_the_wall_without_its_openings() -> None:
    parts = skin_parts(WALL, "skin")
    at = {0.0: 0.0, -LOGGIA.depth_m: 0.0}
    for mesh in parts.meshes:
        corners = triangles(mesh)
        for z in at:
            level = np.abs(corners[:, :, 2] - z).max(1) < 1e-6
            if mesh.material == "skin" and level.any():
                at[z] += area_m2(replace(mesh, faces=mesh.faces[level]))
    loggia = LOGGIA.width_m * LOGGIA.clear_m
    openings = sum(o.width_m * o.height_m for o in (WINDOW, DOOR))
    assert at[0.0] == pytest.approx(10 * 6 - openings - loggia, rel=1e-6)
    assert at[-LOGGIA.depth_m] == pytest.approx(loggia - INNER.width_m * INNER.height_m, rel=1e-6)
    for mesh in parts.meshes:
        if mesh.material == "skin":
            assert mesh.uv is not None
            assert mesh.uv.min() >= 0
            assert mesh.uv.max() <= 1


def test_skin_and_reveals_look_outward() -> None:
    """From any place before the wall, a ray to it meets the front of a face."""
    parts = skin_parts(replace(WALL, openings=(WINDOW,), balconies=()), "skin")
    (jambs,) = [mesh for mesh in parts.meshes if np.ptp(mesh.vertices[:, 2]) > 0.01]
    a, b, c = np.moveaxis(triangles(jambs), 1, 0)
    middle = np.array([1.7, 1.65, -0.09])
    towards = middle - (a + b + c) / 3
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), towards) > 0).all()


@pytest.mark.parametrize("opening", [WINDOW, DOOR, INNER], ids=lambda o: o.kind)
def test_ray_meets_the_glass_at_the_recess(opening: Opening) -> None:
    parts = behind(replace(WALL, balconies=(LOGGIA,)), 5)
    share = opening.style.lights[0] / 2
    x = opening.x_m + share * opening.width_m
    y = opening.y_m + (0.75 if opening.style.panel else 0.5) * opening.height_m
    frame = WALL.world_from_facade
    distance, material = first_hit(
        parts, frame.apply([x, y, 3.0]), frame.rotate(np.array([0.0, 0.0, -1.0]))
    )
    assert material == "glass"
    assert distance == pytest.approx(3.0 + opening.depth_m + opening.recess_m, abs=1e-4)


def test_frame_fills_the_box_and_stands_before_the_glass() -> None:
    parts = behind(replace(WALL, openings=(WINDOW,), balconies=()), 5)
    frame = WALL.world_from_facade

    def seen(x: float, y: float) -> tuple[float, str]:
        distance, name = first_hit(
            parts, frame.apply([x, y, 3.0]), frame.rotate(np.array([0.0, 0.0, -1.0]))
        )
        return 3.0 - distance, name

    skin = seen(0.5, 0.5)[1]
    y = WINDOW.y_m + 0.4
    for edge, inward in ((WINDOW.x_m, 1), (WINDOW.x_m + WINDOW.width_m, -1)):
        assert seen(edge - 0.002 * inward, y) == (pytest.approx(0.0, abs=1e-5), skin)
        depth, name = seen(edge + 0.002 * inward, y)
        assert name.startswith("painted")
        assert 0.02 <= depth + WINDOW.recess_m <= 0.06
    top = WINDOW.y_m + WINDOW.height_m
    assert seen(1.2, top + 0.002)[1] == skin
    assert seen(1.2, top - 0.002)[1].startswith("painted")


def test_arched_opening_stays_in_its_box() -> None:
    arched = replace(WINDOW, style=replace(WINDOW.style, arch=0.2))
    outline = opening_outline(arched)
    assert outline.bounds == pytest.approx(opening_outline(WINDOW).bounds, abs=1e-9)
    rise, half = 0.2 * 1.4, 0.7
    radius = (half**2 + rise**2) / (2 * rise)
    angle = 2 * np.arcsin(half / radius)
    segment = radius**2 / 2 * (angle - np.sin(angle))
    assert outline.area == pytest.approx(1.4 * (1.3 - rise) + segment, rel=5e-3)


def test_every_material_is_known_and_meshes_are_one_per_material(whole: Parts) -> None:
    assert {mesh.material for mesh in whole.meshes} <= set(whole.materials)
    keys = [(m.material, m.uv is None, m.normals is None) for m in whole.meshes]
    assert len(keys) == len(set(keys))
    for mesh in whole.meshes:
        assert np.isfinite(mesh.vertices).all()
        assert mesh.faces.min() >= 0
        assert mesh.faces.max() < len(mesh.vertices)
        if whole.materials[mesh.material].texture is not None:
            assert mesh.uv is not None


def test_same_seed_same_meshes_and_another_seed_other_things(whole: Parts) -> None:
    again = building_parts(house(Roof()), 3, m_per_texel=COARSE)
    for one, two in zip(whole.meshes, again.meshes, strict=True):
        assert one.material == two.material
        np.testing.assert_array_equal(one.vertices, two.vertices)
    other = building_parts(house(Roof()), 4, m_per_texel=COARSE)
    found = [np.concatenate([m.vertices for m in parts.meshes]) for parts in (whole, other)]
    assert found[0].shape != found[1].shape or not np.allclose(*found)


def test_meshes_and_paint_are_the_same_in_another_process() -> None:
    """Another order of sets and dictionaries of names changes nothing."""
    program = (
        "import hashlib; from benchmarks.estate.specs import estate_of;"
        "from benchmarks.estate.meshes.building_meshes import building_parts;"
        "parts = building_parts(estate_of('small', 1).buildings[0], 1, m_per_texel=0.2);"
        "digest = hashlib.sha256(repr(list(parts.materials)).encode());"
        "[digest.update(mesh.vertices.tobytes()) for mesh in parts.meshes];"
        "[digest.update(m.texture) for m in parts.materials.values() if m.texture is not None];"
        "print(digest.hexdigest())"
    )
    root = Path(__file__).parents[1]
    found = {
        subprocess.run(
            [sys.executable, "-c", program],
            cwd=root,
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    }
    assert len(found) == 1


def test_window_costs_at_most_600_triangles() -> None:
    style = WindowStyle((0.5, 0.5), transom=0.7, bars=(1, 2))
    rich = replace(WINDOW, width_m=2.0, style=style, behind=Behind(0.5, blind=0.4, things=True))
    bare = replace(WALL, openings=(), balconies=(), ornaments=())
    for seed in range(5):
        without, found = (
            sum(len(mesh.faces) for mesh in behind(wall, seed).meshes)
            for wall in (bare, replace(bare, openings=(rich,)))
        )
        assert 0 < found - without <= 600


def test_rooms_stay_inside_the_house() -> None:
    free = rectangle(0.02, 0.02, 9.98, 1.0).difference(rectangle(3.0, 0.0, 10.0, 1.0))
    corner = replace(WINDOW, x_m=0.1)
    room = room_of(corner, free)
    assert free.contains(rectangle(room.x[0], -room.near_z, room.x[1], -room.far_z))
    rng = np.random.default_rng(1)
    parts = behind_parts(replace(corner, behind=Behind(0.9, things=True)), room, rng)
    assert min(mesh.vertices[:, 2].min() for mesh in parts.meshes) > -1.0


@pytest.mark.parametrize("x_m", [0.1, 0.43, 8.0, 8.5])
def test_windows_near_a_corner_have_a_real_room(x_m: float) -> None:
    """A board right behind the glass would be a flat white window in the sun."""
    free = rectangle(0.45, 0.02, 9.55, 8.0)
    window = replace(WINDOW, x_m=x_m)
    right = x_m + window.width_m
    room = room_of(window, free)
    assert room.near_z - room.far_z > 1.0
    assert free.contains(rectangle(room.x[0], -room.near_z, room.x[1], -room.far_z))
    assert room.front[0] < x_m and room.front[1] > right
    parts = behind_parts(replace(window, behind=Behind(0.0)), room, np.random.default_rng(1))
    for x in np.linspace(x_m + 0.05, right - 0.05, 7):
        start = np.array([x, window.y_m + 0.3, 0.0])
        distance, _ = first_hit(parts, start, np.array([0.0, 0.0, -1.0]))
        assert distance < -room.far_z + 1e-3
        inside = room.x[0] + 0.1 < x < room.x[1] - 0.1
        assert distance > 1.0 if inside else distance > -room.near_z


def test_a_window_half_before_a_loggia_has_its_room_and_curtains_beside_it() -> None:
    window = replace(WINDOW, x_m=0.85, behind=Behind(0.9, blind=0.5, things=True))
    room = room_of(window, rectangle(1.7, 0.02, 9.0, 8.0))
    assert room.near_z - room.far_z > 1.0 and room.x[0] >= 1.7
    parts = behind_parts(window, room, np.random.default_rng(1))
    behind = np.concatenate([mesh.vertices for mesh in parts.meshes])
    assert behind[behind[:, 2] < room.near_z - 0.16][:, 0].min() > 1.6


def test_rooms_keep_off_the_openings_of_other_walls_loggias() -> None:
    """A window round the corner has its room behind a loggia, not before the loggia's door."""
    door = replace(INNER, x_m=8.8)
    loggia = replace(LOGGIA, x_m=7.4, width_m=2.3)
    front = replace(WALL, start=(0, 0), end=(10, 0), openings=(door,), balconies=(loggia,))
    round_the_corner = replace(WINDOW, x_m=3.0, y_m=3.8)
    gable = replace(WALL, id="g", start=(10, 0), end=(10, 8), openings=(round_the_corner,))
    back, left = (
        replace(gable, id=name, start=start, end=end, openings=())
        for name, start, end in (("b", (10, 8), (0, 8)), ("l", (0, 8), (0, 0)))
    )
    for x_m in (1.3, 1.5, 1.8, 2.2):  # some are where the room comes nearest
        window = replace(round_the_corner, x_m=x_m)
        walls = (front, replace(gable, openings=(window,), balconies=()), back, left)
        parts = building_parts(Building("h", walls, 6.0, 2, 3.0, 1968), 1, m_per_texel=COARSE)
        distance, _ = first_hit(parts, np.array([9.25, 1.35, 4.6]), np.array([0.0, 1.0, 0.0]))
        assert distance > 0.05 + 0.3 * door.recess_m


def test_no_ray_sees_through_the_house(whole: Parts) -> None:
    """Past the glass every ray through a window ends on something inside."""
    opaque = Parts([mesh for mesh in whole.meshes if mesh.material != "glass"], whole.materials)
    rng = np.random.default_rng(2)
    for _ in range(60):
        at = np.array([rng.uniform(1.0, 2.4), 0.0, rng.uniform(1.0, 2.3)])
        eye = np.array([rng.uniform(-4, 8), -5.0, rng.uniform(0.5, 4)])
        way = (at - eye) / np.linalg.norm(at - eye)
        distance, _ = first_hit(opaque, eye, way)
        end = eye + distance * way
        assert -0.2 < end[1] < 7.9


@pytest.mark.parametrize("kind", ["gable", "hip", "shed"])
def test_pitched_roof_starts_on_the_walls_and_rises_as_told(kind: str) -> None:
    building = house(Roof(kind, 2.0, 0.4))  # type: ignore[arg-type]
    slopes = slopes_of(building)
    plan = Polygon(building.outline)
    corners = np.array(plan.exterior.coords)
    heights = np.array([slope.z(corners) for slope in slopes])
    for place, height in zip(corners, heights.T, strict=True):
        on = [slope.plan.buffer(1e-6).covers(Polygon([place, place, place])) for slope in slopes]
        assert all(6 - 1e-6 <= z <= 8 + 1e-6 for z, here in zip(height, on, strict=True) if here)
    top = max(
        float(slope.z(np.asarray(slope.plan.intersection(plan).exterior.coords)).max())
        for slope in slopes
    )
    assert top == pytest.approx(8.0, abs=1e-3)
    assert sum(slope.plan.area for slope in slopes) == pytest.approx(10.8 * 8.8, rel=1e-6)


@pytest.mark.parametrize("kind", ["flat", "gable", "hip", "shed"])
def test_roof_covers_the_house(kind: str) -> None:
    building = house(Roof(kind, 1.5, 0.3))  # type: ignore[arg-type]
    parts = roof_parts(building, np.random.default_rng(1))
    for x in (0.1, 3.0, 5.0, 9.9):
        for y in (0.1, 4.1, 7.9):
            down, _ = first_hit(parts, np.array([x, y, 20.0]), np.array([0.0, 0.0, -1.0]))
            assert 5.9 < 20 - down < 8.0


@pytest.mark.parametrize("front", ["concrete", "sheet", "board"])
@pytest.mark.parametrize("kind", ["solid", "railing", "loggia", "french"])
def test_balcony_stays_in_its_box(kind: str, front: str) -> None:
    balcony = Balcony(kind, 2.0, 3.0, 4.0, 1.4, guard_m=1.1)  # type: ignore[arg-type]
    parts = balcony_parts(balcony, front, np.random.default_rng(1))  # type: ignore[arg-type]
    points = np.concatenate([mesh.vertices for mesh in parts.meshes])
    near, far = {"loggia": (-0.2, 0.05), "french": (0.0, 0.15)}.get(kind, (-0.05, 1.45))
    low, high = points.min(0), points.max(0)
    assert low[0] > 1.95
    assert high[0] < 6.05
    assert high[1] == pytest.approx(4.1, abs=0.04)
    assert low[1] >= 3.0 - balcony.slab_m - 0.03
    assert near <= low[2]
    assert high[2] <= far
    if kind in ("solid", "railing"):
        down, _ = first_hit(parts, np.array([4.0, 3.9, 0.7]), np.array([0.0, -1.0, 0.0]))
        assert down == pytest.approx(0.9, abs=1e-5)


def test_solid_front_hides_and_railing_shows_what_is_behind() -> None:
    rng = np.random.default_rng(3)
    for kind, least, most in (("solid", 0.97, 1.0), ("railing", 0.03, 0.25)):
        balcony = Balcony(kind, 0.0, 0.0, 4.0, 1.4)  # type: ignore[arg-type]
        parts = balcony_parts(balcony, "sheet", rng)
        places = rng.uniform((0.1, 0.15), (3.9, 0.9), (200, 2))
        hits = [
            np.isfinite(first_hit(parts, np.array([x, y, 9.0]), np.array([0, 0, -1.0]))[0])
            for x, y in places
        ]
        assert least <= np.mean(hits) <= most


def test_unknown_material_of_an_ornament_is_named() -> None:
    with pytest.raises(InputError, match="gold"):
        ornament_parts(Ornament("box", 0, 0, 1, 1, 0.1, material="gold"))


def test_downpipe_stands_off_the_wall_and_ends_in_a_shoe() -> None:
    pipe = Ornament("pipe", 1.0, 0.0, 0.1, 6.0, 0.1, gap_m=0.05, material="zinc")
    (wide, *_) = ornament_parts(pipe).meshes
    points = np.concatenate([mesh.vertices for mesh in ornament_parts(pipe).meshes])
    assert wide.vertices[:, 2].max() > 0.2
    assert points[:, 1].max() == pytest.approx(6.0, abs=1e-6)
    middle = points[np.abs(points[:, 1] - 6.0) < 0.01]
    assert middle[:, 2].min() == pytest.approx(0.05, abs=1e-3)
