"""What stands where: an estate as plain data. Truth and meshes both come from it and nothing else.

Lengths are metres in the run's ``world`` frame (east, north, up; ground at z = 0). Positions on a
wall are metres from its lower left corner as seen from outside. Colours are sRGB in 0..1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from si3fp.geometry.enu import GeoOrigin
from si3fp.geometry.rigid import Rigid3

FloatArray = NDArray[np.float64]
Rgb = tuple[float, float, float]
OpeningKind = Literal["window", "balcony_door", "door"]
FinishKind = Literal["brick", "plaster", "panel", "boards", "stone", "metal", "tiles"]
BalconyKind = Literal["solid", "railing", "loggia", "french"]
RoofKind = Literal["flat", "gable", "hip", "shed"]


@dataclass(frozen=True)
class Finish:
    """The skin of a wall: its kind, colours and how weathered it is (0 new to 1 neglected)."""

    kind: FinishKind
    rgb: Rgb
    second_rgb: Rgb = (0.55, 0.54, 0.52)  # mortar, joints, bands
    weathering: float = 0.4
    module_m: tuple[float, float] = (3.0, 2.8)  # width and height of a panel; unused elsewhere


@dataclass(frozen=True)
class WindowStyle:
    """How the filling of an opening is divided and framed.

    Attributes
    ----------
    lights
        Widths of the casements from left to right as shares of the width; they add up to 1.
    transom
        Height of a cross bar as a share of the height, or None.
    panel
        Opaque lower share of the height (doors, balcony doors); 0 = glass all over.
    bars
        Columns and rows that thin glazing bars divide each light into; (1, 1) = none.
    frame_m
        Width of frame and casement profile together, as seen from outside.
    sill_m
        How far the outer sill stands out of the wall; 0 = none.
    surround_m
        Width of a plaster or stone band around the opening; 0 = none. Not part of the window.
    surround_depth_m
        How far the surround stands out of the wall.
    shutters
        Open shutters beside the opening.
    arch
        Rise of a round or segmental head as a share of the width; 0 = flat. The box of the opening
        includes it.
    """

    lights: tuple[float, ...] = (1.0,)
    transom: float | None = None
    panel: float = 0.0
    bars: tuple[int, int] = (1, 1)
    frame_m: float = 0.09
    frame_rgb: Rgb = (0.9, 0.9, 0.88)
    sill_m: float = 0.04
    surround_m: float = 0.0
    surround_depth_m: float = 0.02
    surround_rgb: Rgb = (0.85, 0.83, 0.78)
    shutters: bool = False
    shutter_rgb: Rgb = (0.25, 0.35, 0.28)
    arch: float = 0.0


@dataclass(frozen=True)
class Behind:
    """What is seen behind the glass: curtains from the sides, a blind from the top, a lit room."""

    curtain: float = 0.3  # share of the width that is covered, both sides together
    curtain_rgb: Rgb = (0.85, 0.84, 0.80)
    blind: float = 0.0  # share of the height that is covered
    blind_rgb: Rgb = (0.80, 0.79, 0.75)
    light: float = 0.0  # 0 dark room to 1 lamp on
    things: bool = False  # plants and lamps on the inner sill


@dataclass(frozen=True)
class Opening:
    """A window, balcony door or door; the box is the frame's outer edge, so the truth's aperture.

    ``recess_m`` is the distance from the outer face of its wall to the glass. ``depth_m`` is how
    far the surface that holds it lies behind the wall's plane: 0, or the depth of its loggia.
    """

    kind: OpeningKind
    x_m: float
    y_m: float
    width_m: float
    height_m: float
    recess_m: float
    style: WindowStyle
    behind: Behind = Behind()
    depth_m: float = 0.0


@dataclass(frozen=True)
class Balcony:
    """A balcony in front of a wall, or a loggia cut into it.

    ``x_m``, ``y_m`` is the left end and the top of the slab; ``clear_m`` the height from there to
    what is above (a loggia's opening in the wall is ``width_m`` x ``clear_m``). ``french`` is a
    guard in front of a door without a slab.
    """

    kind: BalconyKind
    x_m: float
    y_m: float
    width_m: float
    depth_m: float
    clear_m: float = 2.5
    guard_m: float = 1.0
    slab_m: float = 0.18
    rgb: Rgb = (0.75, 0.75, 0.72)
    side_walls: bool = False
    things: bool = False  # furniture and plants


@dataclass(frozen=True)
class Ornament:
    """Something that stands out of the wall: a box, or an upright pipe (round).

    ``out_m`` is its depth, ``gap_m`` the air between wall and it. ``material`` names one of the
    fixed materials of ``painting.materials``; ``rgb`` overrides its colour.
    """

    kind: Literal["box", "pipe"]
    x_m: float
    y_m: float
    width_m: float
    height_m: float
    out_m: float
    gap_m: float = 0.0
    material: str = "painted"
    rgb: Rgb = (0.6, 0.6, 0.6)


@dataclass(frozen=True)
class Wall:
    """One plane wall from ``start`` to ``end`` with the outside on its right hand.

    ``outline`` is the polygon (x, y) of the wall where it is no rectangle (gables); its bounds are
    the wall's width and height.
    """

    id: str
    start: tuple[float, float]
    end: tuple[float, float]
    height_m: float
    finish: Finish
    openings: tuple[Opening, ...] = ()
    balconies: tuple[Balcony, ...] = ()
    ornaments: tuple[Ornament, ...] = ()
    plinth_m: float = 0.0
    plinth_rgb: Rgb = (0.45, 0.44, 0.42)
    outline: tuple[tuple[float, float], ...] | None = None

    @property
    def width_m(self) -> float:
        """Length of the wall."""
        return float(np.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1]))

    @property
    def world_from_facade(self) -> Rigid3:
        """The facade's frame: lower left corner, right, up, outward."""
        along = np.array([self.end[0] - self.start[0], self.end[1] - self.start[1], 0.0])
        along /= np.linalg.norm(along)
        outward = np.array([along[1], -along[0], 0.0])
        axes = np.stack([along, [0.0, 0.0, 1.0], outward], axis=1)
        return Rigid3(axes, np.array([*self.start, 0.0]))

    @property
    def has_balconies(self) -> bool:
        """Whether it counts as a facade with balconies."""
        return bool(self.balconies)


@dataclass(frozen=True)
class Roof:
    """A roof; ``rise_m`` above the walls, ``overhang_m`` beyond them."""

    kind: RoofKind = "flat"
    rise_m: float = 0.3
    overhang_m: float = 0.0
    rgb: Rgb = (0.25, 0.25, 0.26)
    fascia_m: float = 0.25


@dataclass(frozen=True)
class Building:
    """Walls counter-clockwise seen from above, so that each one's outside is on its right."""

    id: str
    walls: tuple[Wall, ...]
    height_m: float
    storeys: int
    storey_m: float
    year: int
    roof: Roof = Roof()
    use: str = "apartments"

    @property
    def outline(self) -> FloatArray:
        """Footprint (V, 2), counter-clockwise."""
        return np.array([wall.start for wall in self.walls], np.float64)


@dataclass(frozen=True)
class Street:
    """A road along a line of points, with pavements on both sides."""

    line: tuple[tuple[float, float], ...]
    road_m: float = 6.0
    pavement_m: float = 2.0


@dataclass(frozen=True)
class Tree:
    """A tree on its place."""

    place: tuple[float, float]
    height_m: float
    crown_m: float  # diameter
    kind: Literal["round", "birch", "pine", "shrub"] = "round"


@dataclass(frozen=True)
class Hedge:
    """A clipped hedge along a line."""

    line: tuple[tuple[float, float], ...]
    width_m: float = 0.8
    height_m: float = 1.1


@dataclass(frozen=True)
class Car:
    """A parked car, seen along ``heading_deg`` (clockwise from north)."""

    place: tuple[float, float]
    heading_deg: float
    kind: Literal["saloon", "estate", "hatchback", "van"]
    rgb: Rgb


@dataclass(frozen=True)
class Lamp:
    """A street lamp."""

    place: tuple[float, float]
    height_m: float = 5.0


@dataclass(frozen=True)
class Light:
    """When the pictures were taken (UTC) and how much of the sky is cloud (0 clear, 1 overcast)."""

    date: str = "2024-06-12"
    hour_utc: float = 9.0
    cloud: float = 0.2


@dataclass(frozen=True)
class Estate:
    """A plan: buildings whose truth is known, everything around them, and the light.

    ``panorama_lines`` are where a mapping vehicle drives, on streets; panoramas show the sides of
    the buildings that face them, and the others stay unseen, as on a real street.
    """

    name: str
    seed: int
    origin: GeoOrigin
    buildings: tuple[Building, ...]
    neighbours: tuple[Building, ...] = ()
    streets: tuple[Street, ...] = ()
    trees: tuple[Tree, ...] = ()
    hedges: tuple[Hedge, ...] = ()
    cars: tuple[Car, ...] = ()
    lamps: tuple[Lamp, ...] = ()
    light: Light = Light()
    panorama_lines: tuple[tuple[tuple[float, float], ...], ...] = ()
