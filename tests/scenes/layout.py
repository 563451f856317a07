"""Where buildings, windows, cars, trees and cameras stand; everything in metres, street along x."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from tests.scenes import textures
from tests.scenes.facades import Look, Opening, paint_facade
from tests.scenes.occluders import tree, van
from tests.scenes.render import Surface
from tests.scenes.textures import as_uint8

Size = Literal["tiny", "small", "street"]
FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class House:
    """One building: ``corners`` (4, 2) counter-clockwise, edge 0 is its street front."""

    id: str
    corners: FloatArray
    height_m: float
    storeys: int
    year: int
    look: Look
    openings: tuple[Opening, ...]  # of edge 0


@dataclass(frozen=True)
class Layout:
    """Houses and camera places (N, 3) of one street."""

    houses: tuple[House, ...]
    cameras: FloatArray
    kerbs_y_m: tuple[float, float]
    vehicles: tuple[tuple[float, float], ...]  # x, y of the middle
    trees: tuple[tuple[float, float], ...]
    m_per_px: float


def _looks(rng: np.random.Generator) -> list[Look]:
    white, brown = (226.0, 224.0, 218.0), (112.0, 76.0, 52.0)
    green, grey = (78.0, 104.0, 92.0), (92.0, 96.0, 100.0)
    frames = [white, white, brown, green, grey]
    reds = [(142.0, 84.0, 66.0), (156.0, 104.0, 74.0), (122.0, 72.0, 60.0)]
    plasters = [(204.0, 178.0, 122.0), (188.0, 190.0, 172.0), (206.0, 160.0, 130.0)]

    def frame() -> tuple[float, float, float]:
        return frames[int(rng.integers(len(frames)))]

    return [
        Look("brick", reds[int(rng.integers(3))], frame(), None, 0.0, False, 0.12),
        Look(
            "plaster",
            plasters[int(rng.integers(3))],
            white,
            (226.0, 220.0, 206.0),
            0.14,
            True,
            0.10,
        ),
        Look("panel", (170.0, 166.0, 156.0), frame(), None, 0.0, False, 0.14),
    ]


def _openings(
    width_m: float, storeys: int, storey_m: float, rng: np.random.Generator
) -> tuple[Opening, ...]:
    """Window axes with one or two window sizes, a door in the ground floor; 50 mm modules."""
    main = float(rng.choice([1.1, 1.2, 1.3, 1.4]))
    narrow = float(rng.choice([0.7, 0.8, 0.9]))
    tall = float(rng.choice([1.35, 1.45, 1.6]))
    pitch = main + float(rng.choice([1.1, 1.3, 1.45]))
    axes = int((width_m - 1.8) // pitch)
    first = (width_m - axes * pitch) / 2 + pitch / 2
    door_axis = axes // 2
    found = []
    for storey in range(storeys):
        for axis in range(axes):
            centre = first + axis * pitch
            stair = axis == door_axis
            if storey == 0 and stair:
                found.append(_snapped(centre - 0.7, 0.15, 1.4, 2.3, "door"))
                continue
            width = narrow if stair else main
            height = tall - 0.3 if stair else tall
            sill = storey * storey_m + 1.25 + (0.3 if stair else 0)
            found.append(_snapped(centre - width / 2, sill, width, height, "window"))
    return tuple(found)


def _snapped(
    x_m: float, y_m: float, width_m: float, height_m: float, kind: Literal["window", "door"]
) -> Opening:
    x, y, width, height = (round(round(v / 0.05) * 0.05, 3) for v in (x_m, y_m, width_m, height_m))
    return Opening(x, y, width, height, kind)


def _house(
    name: str,
    corners: list[tuple[float, float]],
    storeys: int,
    look: Look,
    rng: np.random.Generator,
) -> House:
    outline = np.array(corners, np.float64)
    width = float(np.linalg.norm(outline[1] - outline[0]))
    storey_m = 3.0
    height = storeys * storey_m + 0.65
    return House(
        name,
        outline,
        height,
        storeys,
        int(rng.choice([1938, 1952, 1965, 1974])),
        look,
        _openings(width, storeys, storey_m, rng),
    )


def lay_out(size: Size, rng: np.random.Generator) -> Layout:
    """The houses, cameras and occluders of a street of this size."""
    looks = _looks(rng)
    if size == "tiny":
        corners = [(0.0, 9.0), (10.0, 9.0), (10.0, 17.0), (0.0, 17.0)]
        house = _house("house-a", corners, 2, looks[1], rng)
        cameras = np.array([[1.5, 0, 2.5], [5.0, 0, 2.5], [8.5, 0, 2.5]])
        return Layout((house,), cameras, (-5.0, 5.0), (), (), 0.025)
    if size == "small":
        corners = [(0.0, 9.0), (16.0, 9.0), (16.0, 19.0), (0.0, 19.0)]
        house = _house("house-a", corners, 3, looks[int(rng.integers(3))], rng)
        cameras = np.array([[x, 0, 2.5] for x in np.linspace(-2, 18, 5)])
        return Layout((house,), cameras, (-5.0, 5.0), ((5.0, 6.4),), ((12.5, 6.2),), 0.01)
    order = rng.permutation(3)
    houses = (
        _house("north-1", [(0, 9), (24, 9), (24, 20), (0, 20)], 4, looks[order[0]], rng),
        _house("north-2", [(29, 9.6), (48, 9.6), (48, 20.6), (29, 20.6)], 3, looks[order[1]], rng),
        _house("south-1", [(36, -9), (10, -9), (10, -20), (36, -20)], 4, looks[order[2]], rng),
    )
    cameras = np.array([[x, 0.0, 2.5] for x in np.linspace(0, 48, 9)])
    vehicles = ((6.0, 5.6), (39.5, 5.8), (17.0, -5.7))
    trees = ((14.5, 6.3), (33.0, 6.4), (28.5, -6.2))
    return Layout(houses, cameras, (-5.0, 5.0), vehicles, trees, 0.01)


def _wall_axes(start: FloatArray, end: FloatArray) -> FloatArray:
    along = (end - start) / np.linalg.norm(end - start)
    return np.array([[along[0], along[1], 0.0], [0.0, 0.0, 1.0], [along[1], -along[0], 0.0]])


def build_surfaces(layout: Layout, rng: np.random.Generator) -> list[Surface]:
    """Everything that can be seen, painted; rotated and moved by nothing yet."""
    surfaces = [ground(layout, rng)]
    for house in layout.houses:
        surfaces.extend(house_surfaces(house, layout.m_per_px, rng))
    for x, y in layout.vehicles:
        surfaces.extend(van(x, y, rng))
    for x, y in layout.trees:
        surfaces.extend(tree(x, y, rng))
    return surfaces


def ground(layout: Layout, rng: np.random.Generator) -> Surface:
    """Road and pavement around everything, two texture pixels of a wall wide each."""
    everything = np.concatenate(
        [house.corners for house in layout.houses] + [layout.cameras[:, :2]]
    )
    low, high = everything.min(axis=0) - 60, everything.max(axis=0) + 60
    span = high - low
    m_per_px = max(0.05, 2 * layout.m_per_px)
    shape = (round(span[1] / m_per_px), round(span[0] / m_per_px))
    kerbs = (layout.kerbs_y_m[0] - low[1], layout.kerbs_y_m[1] - low[1])
    picture = textures.pavement_and_road(shape, m_per_px, rng, kerbs)
    for x, y in layout.vehicles:  # soft shadow
        along = ((np.arange(shape[1]) * m_per_px + low[0] - x) / 2.7) ** 2
        across = ((high[1] - np.arange(shape[0]) * m_per_px - y) / 1.3) ** 2
        shade = np.clip(1.3 - across[:, None] - along[None, :], 0, 1)
        picture *= (1 - 0.65 * shade[..., None]).astype(np.float32)
    axes = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    corner = np.array([low[0], low[1], 0.0])
    return Surface(corner, axes, span[0], span[1], as_uint8(picture), plane=True)


def house_surfaces(house: House, m_per_px: float, rng: np.random.Generator) -> list[Surface]:
    """Walls, eaves and roof; windows on edge 0 only."""
    surfaces = []
    overhang, fascia = 0.30, 0.22
    for edge in range(4):
        start, end = house.corners[edge], house.corners[(edge + 1) % 4]
        axes = _wall_axes(start, end)
        width = float(np.linalg.norm(end - start))
        openings = house.openings if edge == 0 else ()
        scale = m_per_px if edge == 0 else 2 * m_per_px
        light = (1.0, 0.84, 0.8, 0.92)[edge]
        painted = paint_facade(width, house.height_m, openings, house.look, 3.0, scale, rng, light)
        corner = np.array([*start, 0.0])
        surfaces.append(
            Surface(corner, axes, width, house.height_m, painted.wall, painted, plane=True)
        )
        if edge % 2 == 0:
            surfaces.extend(_eaves(corner, axes, width, house.height_m, overhang, fascia, rng))
            surfaces.append(_roof(corner, axes, width, house, overhang, fascia, rng))
    return surfaces


def _eaves(
    corner: FloatArray,
    axes: FloatArray,
    width: float,
    height: float,
    overhang: float,
    fascia: float,
    rng: np.random.Generator,
) -> list[Surface]:
    """Soffit and gutter board of the eaves."""
    shape = (12, max(8, round(width / 0.05)))
    boards = np.clip(150 + 9 * textures.noise(shape, rng, 5, 2), 0, 255)[..., None]
    soffit = as_uint8(boards * np.array([0.62, 0.6, 0.57], np.float32))
    gutter = boards * np.array([0.9, 0.91, 0.92], np.float32)
    gutter[:4] *= 0.6
    out = axes[2] * overhang
    start = corner + height * axes[1] - 0.2 * axes[0]
    down = np.array([axes[0], axes[2], -axes[1]])  # seen from below
    return [
        Surface(start, down, width + 0.4, overhang, soffit),
        Surface(start + out, axes, width + 0.4, fascia, as_uint8(gutter)),
    ]


def _roof(
    corner: FloatArray,
    axes: FloatArray,
    width: float,
    house: House,
    overhang: float,
    fascia: float,
    rng: np.random.Generator,
) -> Surface:
    depth = float(np.linalg.norm(house.corners[2] - house.corners[1])) / 2 + overhang
    slope = np.deg2rad(32.0)
    up = -axes[2] * np.cos(slope) + axes[1] * np.sin(slope)
    start = corner + [0, 0, house.height_m + fascia] + axes[2] * overhang - 0.2 * axes[0]
    length = depth / np.cos(slope)
    picture = textures.roof_tiles((round(length / 0.04), round((width + 0.4) / 0.04)), 0.04, rng)
    tilted = np.array([axes[0], up, np.cross(axes[0], up)])
    return Surface(start, tilted, width + 0.4, length, as_uint8(picture))
