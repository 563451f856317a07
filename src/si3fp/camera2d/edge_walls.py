"""Walls cut to the footprint edges that they stand on (C.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from si3fp.camera2d.wall_ends import Side
from si3fp.camera2d.wall_lines import PlanLine
from si3fp.config import PlaneConfig
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Footprint

_NARROW_SHARE = 1 / 3  # of an edge, that a wall too narrow for a facade must stand beside
_MAP_SIGMA_M = 0.6  # of a footprint's corner; a corner of the points so near is better


@dataclass(frozen=True, slots=True)
class EdgeWall:
    """A wall with its ends, before it is known whose it is."""

    line: PlanLine
    left: Side
    right: Side


@dataclass(frozen=True, slots=True)
class EdgePiece:
    """A wall, or part of one, on a footprint edge.

    Attributes
    ----------
    wall
        Index of the wall.
    footprint, edge_index
        The edge.
    left, right
        Ends along the wall's line.
    offset_note
        Where the wall stands against the map, in words.
    """

    wall: int
    footprint: Footprint
    edge_index: int
    left: Side
    right: Side
    offset_note: str

    @property
    def width_m(self) -> float:
        """Distance between the ends."""
        return self.right.at_m - self.left.at_m


@dataclass(frozen=True, slots=True, eq=False)
class _Edge:
    footprint: Footprint
    index: int
    start: FloatArray
    end: FloatArray


def assign_to_edges(
    walls: Sequence[EdgeWall], footprints: Sequence[Footprint], config: PlaneConfig
) -> tuple[list[EdgePiece], list[int]]:
    """The walls on each edge, the widest first, and the indices of the walls on none.

    A wall stands on an edge that faces the same way within `PlaneConfig.edge_angle_deg`, runs
    within `PlaneConfig.edge_offset_m` of it and beside at least half of it or of
    `PlaneConfig.min_width_m`. A wall in front of several edges is cut at their ends; of edges
    beside the same part the nearest has it. A wall narrower than `PlaneConfig.min_width_m` is a
    return or a pier, unless it is all that was seen of a wider edge: a third of it or more. The
    outermost walls of an edge reach its corners, unless the walls themselves have a corner as near
    as maps are right.
    """
    edges = [
        _Edge(footprint, index, start, end)
        for footprint in footprints
        for index, (start, end) in enumerate(footprint.edges())
    ]
    by_edge: dict[int, list[EdgePiece]] = {}
    homeless = []
    narrow = [wall.right.at_m - wall.left.at_m < config.min_width_m for wall in walls]
    bare = set(range(len(edges)))
    for number in np.argsort(narrow, kind="stable").tolist():
        found = _edges_of(walls[number], edges, config)
        if narrow[number]:
            found = [each for each in found if each[0] in bare and _shows(each, edges, config)]
        else:
            bare -= {index for index, _, _ in found}
        if not found:
            homeless.append(number)
        for index, left_m, right_m in found:
            piece = _cut(number, walls[number], edges[index], left_m, right_m)
            by_edge.setdefault(index, []).append(piece)
    pieces = []
    for index in sorted(by_edge):
        own = _to_corners(by_edge[index], walls, edges[index])
        pieces += sorted(own, key=lambda piece: -piece.width_m)
    return pieces, homeless


def _shows(found: tuple[int, float, float], edges: Sequence[_Edge], config: PlaneConfig) -> bool:
    """Whether part of a narrow wall is enough of an edge that is long enough for a facade."""
    index, left_m, right_m = found
    length_m = float(np.hypot(*(edges[index].end - edges[index].start)))
    return length_m >= config.min_width_m and right_m - left_m >= _NARROW_SHARE * length_m


def _edges_of(
    wall: EdgeWall, edges: Sequence[_Edge], config: PlaneConfig
) -> list[tuple[int, float, float]]:
    """Index, left and right end on the wall of every edge that it stands on, without overlaps."""
    candidates = []
    for index, edge in enumerate(edges):
        span = edge.end - edge.start
        length_m = float(np.hypot(*span))
        if length_m < 1e-6:
            continue
        outward = np.array([span[1], -span[0]]) / length_m
        if outward @ wall.line.outward < np.cos(np.deg2rad(config.edge_angle_deg)):
            continue
        corners = wall.line.coordinates(np.stack([edge.start, edge.end]))
        left_m = max(float(corners[0, 0]), wall.left.at_m)
        right_m = min(float(corners[1, 0]), wall.right.at_m)
        wanted = min(config.min_width_m, (wall.right.at_m - wall.left.at_m) / 2)
        if right_m - left_m < wanted:
            continue
        at = np.interp([left_m, right_m], corners[:, 0], corners[:, 1])
        distance = float(np.abs(at).mean())
        if distance <= config.edge_offset_m:
            candidates.append((distance, index, left_m, right_m))
    taken: list[tuple[int, float, float]] = []
    for _, index, left_m, right_m in sorted(candidates):
        shared = sum(max(0.0, min(right_m, right) - max(left_m, left)) for _, left, right in taken)
        if shared <= 0.5 * (right_m - left_m):
            taken.append((index, left_m, right_m))
    return taken


def _cut(number: int, wall: EdgeWall, edge: _Edge, left_m: float, right_m: float) -> EdgePiece:
    corners = wall.line.coordinates(np.stack([edge.start, edge.end]))
    front_m = -float(np.interp((left_m + right_m) / 2, corners[:, 0], corners[:, 1]))
    turn_deg = float(np.rad2deg(np.arctan2(*(corners[1] - corners[0])[::-1])))
    place = "before" if front_m >= 0 else "behind"
    return EdgePiece(
        number,
        edge.footprint,
        edge.index,
        wall.left if left_m == wall.left.at_m else Side(left_m, "the end of the footprint edge"),
        wall.right
        if right_m == wall.right.at_m
        else Side(right_m, "the end of the footprint edge"),
        f"footprint: {abs(front_m):.2f} m {place} its edge, turned by {turn_deg:+.1f} degrees",
    )


def _to_corners(
    pieces: Sequence[EdgePiece], walls: Sequence[EdgeWall], edge: _Edge
) -> list[EdgePiece]:
    """The pieces of one edge, the outermost ones reaching its corners."""
    first = min(pieces, key=lambda piece: _on_edge(piece, walls, edge, piece.left))
    last = max(pieces, key=lambda piece: _on_edge(piece, walls, edge, piece.right))
    found = []
    for piece in pieces:
        corners = walls[piece.wall].line.coordinates(np.stack([edge.start, edge.end]))[:, 0]
        left, right = piece.left, piece.right
        if piece is first:
            left = _corner(left, float(corners[0]))
        if piece is last:
            right = _corner(right, float(corners[1]))
        found.append(
            EdgePiece(piece.wall, piece.footprint, piece.edge_index, left, right, piece.offset_note)
        )
    return found


def _corner(side: Side, corner_m: float) -> Side:
    if "corner" in side.rests_on and abs(side.at_m - corner_m) <= _MAP_SIGMA_M:
        return side
    gap_m = abs(side.at_m - corner_m)
    return Side(corner_m, f"the footprint's corner, {gap_m:.1f} m from {side.rests_on}")


def _on_edge(piece: EdgePiece, walls: Sequence[EdgeWall], edge: _Edge, side: Side) -> float:
    line = walls[piece.wall].line
    along = (edge.end - edge.start) / np.hypot(*(edge.end - edge.start))
    return float((line.foot_in_world + side.at_m * line.along - edge.start) @ along)
