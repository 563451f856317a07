"""Facades from the sparse points of a reconstruction: vertical rectangles on walls (C.2).

Points that stand above one another propose vertical planes (`wall_lines`), parallel planes are cut
where one ends and the next begins (`wall_runs`), corners, ground and eaves bound them
(`wall_ends`, `wall_heights`), and footprint edges name them where there are any.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from si3fp.camera2d.edge_walls import EdgeWall, assign_to_edges
from si3fp.camera2d.facade_plane import FacadePlane
from si3fp.camera2d.wall_ends import Side, regularised, wall_ends
from si3fp.camera2d.wall_heights import eaves_z, ground_z, reaches
from si3fp.camera2d.wall_points import WallPoints, select_wall_points
from si3fp.camera2d.wall_runs import WallRun, find_walls
from si3fp.config import PlaneConfig
from si3fp.errors import ReconstructionError
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Footprint, Missing, Photo, SparsePoints

_MIN_SIGHTS = 5  # points of a wall that a photo must have seen
_PLAIN_M = 2.5  # a wall may go on so far above its points; higher, the map means the roof
_MENTIONED_M = 1.0  # narrower pieces of wall are not worth a word


@dataclass(frozen=True, slots=True)
class FoundFacades:
    """The facades of a reconstruction, and what is none.

    Attributes
    ----------
    planes
        Rectangles to render; no two of one wall share a place along it.
    missing
        Footprint edges of photographed buildings on which no points lie.
    left_out
        Sentences: walls, and buildings of the map, that were left out and why.
    """

    planes: tuple[FacadePlane, ...]
    missing: tuple[Missing, ...]
    left_out: tuple[str, ...]


def find_facades(
    photos: Sequence[Photo],
    points: SparsePoints,
    footprints: Sequence[Footprint],
    config: PlaneConfig,
) -> FoundFacades:
    """The walls that the photos show, as rectangles between ground and eaves.

    Parameters
    ----------
    photos
        Photos in a metric world with z up.
    points
        Sparse points of the same world.
    footprints
        Buildings of the map in the same world. With any, a facade is named after its building and
        edge, ``<building>-<edge>``, and is the whole edge except where a parallel plane takes
        part of it; the second and third plane of one edge have the suffixes ``.2`` and ``.3``.
        Without, facades are ``wall-<n>`` by compass bearing, n from 1.
    config
        Limits.

    Raises
    ------
    InputError
        If a point is not finite.
    ReconstructionError
        If there are too few points, no wall, or none that lies on a footprint edge.
    """
    chosen = select_wall_points(photos, points, config)
    runs = regularised(find_walls(chosen, config), config)
    ends = wall_ends(runs, config)
    walls: list[_Wall] = []
    narrow: list[_Wall] = []
    left_out: list[str] = []
    for run, sides, eaves in zip(runs, ends, eaves_z(runs, chosen, config), strict=True):
        wall = _Wall(run, *sides, ground_z(run, chosen, config), eaves)
        reason = _why_not(wall, chosen, config)
        if not reason:
            (walls if wall.width_m >= config.min_width_m else narrow).append(wall)
        elif wall.width_m >= _MENTIONED_M:
            left_out.append(f"{wall}: {reason}")
    if not walls:
        raise ReconstructionError(
            f"No wall of {config.min_width_m:g} x {config.min_height_m:g} m or more was found in "
            f"{len(chosen.weights)} sparse points. {' '.join(left_out)} Photograph the facades "
            "from more places, and check scale and vertical."
        )
    if not footprints:
        left_out += _too_narrow(narrow, config)
        return FoundFacades(_named_by_bearing(walls, chosen), (), tuple(left_out))
    planes, missing, others = _named_by_edge(walls, narrow, footprints, chosen, config)
    return FoundFacades(planes, missing, (*left_out, *others))


def walls_seen_from_above(planes: Sequence[FacadePlane]) -> tuple[FloatArray, FloatArray]:
    """Ends (W, 2, 2) and outward directions (W, 2) of facades, to place them on footprints."""
    corners = np.array([plane.corners_in_world[:2, :2] for plane in planes]).reshape(-1, 2, 2)
    outward = np.array([plane.world_from_facade.rotation[:2, 2] for plane in planes])
    return corners, outward.reshape(-1, 2)


@dataclass(frozen=True, slots=True)
class _Wall:
    run: WallRun
    left: Side
    right: Side
    ground: Side
    eaves: Side

    @property
    def width_m(self) -> float:
        return self.right.at_m - self.left.at_m

    @property
    def height_m(self) -> float:
        return self.eaves.at_m - self.ground.at_m

    def __str__(self) -> str:
        middle = self.run.ends_in_world.mean(axis=0)
        return (
            f"A wall of {self.width_m:.1f} x {self.height_m:.1f} m at ({middle[0]:.1f}, "
            f"{middle[1]:.1f}) m that faces {_bearing_deg(self.run):.0f} degrees"
        )


def _why_not(wall: _Wall, points: WallPoints, config: PlaneConfig) -> str:
    """Why a wall is no facade, however wide, empty if it is one."""
    run = wall.run
    views = points.views_of(run.members)
    looking = len(_looking(run, points))
    front = run.line.coordinates(points.centres_in_world)[:, 1]
    far_m = float(np.median(np.repeat(np.abs(front), views)))
    bottom_m = float(np.quantile(points.points_in_world[run.members, 2], 0.02)) - wall.ground.at_m
    count = len(run.members)
    reasons = (
        (wall.height_m < config.min_height_m, f"lower than {config.min_height_m:g} m."),
        (
            count < config.min_points,
            f"only {count} points lie on it, {config.min_points} are needed.",
        ),
        (
            looking < config.min_photos,
            f"only {looking} photos look at it, {config.min_photos} are needed.",
        ),
        (
            far_m > config.max_distance_m,
            f"the photos stand {far_m:.0f} m away, the limit is {config.max_distance_m:g} m.",
        ),
        (
            bottom_m > config.max_bottom_m,
            f"only what lies {bottom_m:.1f} m above the ground or higher is seen of it.",
        ),
    )
    return next((reason for holds, reason in reasons if holds), "")


def _too_narrow(walls: Sequence[_Wall], config: PlaneConfig) -> list[str]:
    """What is said of walls too narrow to be facades."""
    mentioned = [wall for wall in walls if wall.width_m >= _MENTIONED_M]
    return [f"{wall}: narrower than {config.min_width_m:g} m." for wall in mentioned]


def _looking(run: WallRun, points: WallPoints) -> list[int]:
    """Indices of the photos before a wall that saw points of it."""
    front = run.line.coordinates(points.centres_in_world)[:, 1]
    seen = (points.views_of(run.members) >= _MIN_SIGHTS) & (front > 0)
    return [int(number) for number in np.flatnonzero(seen)]


def _named_by_bearing(walls: Sequence[_Wall], points: WallPoints) -> tuple[FacadePlane, ...]:
    def bearing_then_place(wall: _Wall) -> tuple[int, float]:
        place = float(wall.run.ends_in_world[0] @ wall.run.line.along)
        return round(_bearing_deg(wall.run)) % 360, place

    ordered = sorted(walls, key=bearing_then_place)
    return tuple(
        _plane(f"wall-{number}", None, None, wall, points, ())
        for number, wall in enumerate(ordered, start=1)
    )


def _named_by_edge(
    walls: Sequence[_Wall],
    narrow: Sequence[_Wall],
    footprints: Sequence[Footprint],
    points: WallPoints,
    config: PlaneConfig,
) -> tuple[tuple[FacadePlane, ...], tuple[Missing, ...], list[str]]:
    found = [*walls, *narrow]
    candidates = [EdgeWall(wall.run.line, wall.left, wall.right) for wall in found]
    pieces, homeless = assign_to_edges(candidates, footprints, config)
    if not pieces:
        raise ReconstructionError(
            f"None of the {len(found)} walls found lies on a footprint edge within "
            f"{config.edge_offset_m:g} m and {config.edge_angle_deg:g} degrees. Check that the "
            "footprints are of the buildings photographed and that position and north are right."
        )
    left_out = [
        f"{walls[index]}: no footprint edge within {config.edge_offset_m:g} m faces this way."
        for index in homeless
        if index < len(walls)
    ]
    left_out += _too_narrow([found[i] for i in homeless if i >= len(walls)], config)
    planes, missing = [], []
    seen = {piece.footprint.id for piece in pieces}
    for footprint in footprints:
        if footprint.id not in seen:
            left_out.append(f"Building {footprint.id}: no wall of it was found in the photos.")
            continue
        for edge, (start, end) in enumerate(footprint.edges()):
            own = [p for p in pieces if p.footprint.id == footprint.id and p.edge_index == edge]
            name = f"{footprint.id}-{edge}"
            if not own and np.hypot(*(end - start)) >= config.min_width_m:
                missing.append(Missing(name, "coverage", "no points of a wall lie on this edge"))
            for number, piece in enumerate(own, start=1):
                wall = found[piece.wall]
                ground, eaves = _heights(wall, footprint, points)
                cut = _Wall(wall.run, piece.left, piece.right, ground, eaves)
                suffix = f".{number}" if number > 1 else ""
                planes.append(
                    _plane(name + suffix, footprint.id, edge, cut, points, (piece.offset_note,))
                )
    return tuple(planes), tuple(missing), left_out


def _heights(wall: _Wall, footprint: Footprint, points: WallPoints) -> tuple[Side, Side]:
    """Ground and eaves with what the map tells."""
    ground, eaves = wall.ground, wall.eaves
    if footprint.ground_m is not None:
        ground = Side(footprint.ground_m, "the map")
    if footprint.height_m is not None:
        mapped = ground.at_m + footprint.height_m
        above_m = mapped - eaves.at_m
        goes_on = above_m <= _PLAIN_M or reaches(wall.run, points, eaves.at_m, mapped)
        if above_m > 0 and goes_on and "cornice" not in eaves.rests_on:
            eaves = Side(mapped, f"the map, {mapped - eaves.at_m:.1f} m above {eaves.rests_on}")
    return ground, eaves


def _plane(
    facade_id: str,
    building_id: str | None,
    edge_index: int | None,
    wall: _Wall,
    points: WallPoints,
    notes: tuple[str, ...],
) -> FacadePlane:
    line = wall.run.line
    rotation = np.zeros((3, 3))
    rotation[:2, 0], rotation[2, 1], rotation[:2, 2] = line.along, 1.0, line.outward
    corner = np.array([*(line.foot_in_world + wall.left.at_m * line.along), wall.ground.at_m])
    sides = (
        ("left end", wall.left),
        ("right end", wall.right),
        ("ground", wall.ground),
        ("eaves", wall.eaves),
    )
    return FacadePlane(
        facade_id,
        building_id,
        edge_index,
        Rigid3(rotation, corner),
        wall.width_m,
        wall.height_m,
        tuple(points.photo_ids[number] for number in _looking(wall.run, points)),
        (
            f"plane: {len(wall.run.members)} points, {wall.run.rms_m:.3f} m from it (RMS)",
            *(f"{name}: {side.rests_on}" for name, side in sides),
            *notes,
        ),
    )


def _bearing_deg(run: WallRun) -> float:
    return float(np.rad2deg(np.arctan2(run.line.outward[0], run.line.outward[1])) % 360)
