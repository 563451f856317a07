"""Vertical planes through sparse points: lines in plan that many points stand on, row above row."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from si3fp.camera2d.wall_points import IntArray, WallPoints, cell_weights
from si3fp.config import PlaneConfig
from si3fp.geometry.rigid import FloatArray

_REFITS = 4
_MIN_FITTED = 8
_PER_CELL = 4
_CROSSING = 0.35  # sine of the angle between lines that cross
_BAND_M = 0.3  # frames, sills and surrounds about a wall
_GROWTH = 1.5  # by which a line's reach is multiplied until it covers all points that go on


@dataclass(frozen=True, slots=True, eq=False)
class PlanLine:
    """A vertical plane seen from above.

    Attributes
    ----------
    foot_in_world
        (2,) a point on it, metres.
    outward
        (2,) unit normal to the outside.
    """

    foot_in_world: FloatArray
    outward: FloatArray

    @property
    def along(self) -> FloatArray:
        """(2,) unit vector to the right, seen from outside."""
        return np.array([-self.outward[1], self.outward[0]])

    def coordinates(self, points_in_world: FloatArray) -> FloatArray:
        """Metres right of the foot and in front of the plane (..., 2) of points (..., 2+)."""
        gap = points_in_world[..., :2] - self.foot_in_world
        return np.stack([gap @ self.along, gap @ self.outward], axis=-1)

    def flipped(self) -> PlanLine:
        """The same plane with the other side outside."""
        return PlanLine(self.foot_in_world, -self.outward)


@dataclass(frozen=True, slots=True, eq=False)
class WallLine:
    """A line with the points that stand on it.

    Attributes
    ----------
    line
        The line; outside is where the cameras are.
    members
        Indices of the points.
    crossed
        (N,) mask of the points beside the faces of walls that it crosses; none of them is a member.
    """

    line: PlanLine
    members: IntArray
    crossed: NDArray[np.bool_]


def find_wall_lines(points: WallPoints, config: PlaneConfig) -> list[WallLine]:
    """Lines in plan with the points on them, the one with most support first.

    Each place where points stand above one another proposes the line through its surroundings
    that most of them lie on (a Hough transform of the neighbourhood). The strongest proposal grows
    along itself as far as points go on without a gap, takes its points away, and the next follows.
    A point belongs to one line at most, and the relief of a wall to no line that crosses it.
    """
    places, weights = points.points_in_world, points.weights
    free = np.ones(len(weights), dtype=np.bool_)
    seeds = _seeds(places, config)
    few = _few_per_cell(places, config)
    tree = cKDTree(places[few, :2])

    def propose(seed: FloatArray) -> tuple[float, PlanLine] | None:
        near = few[np.array(tree.query_ball_point(seed, config.seed_radius_m), dtype=np.intp)]
        near = near[free[near]]
        return _proposal(places[near], cell_weights(places[near], config.cell_m), seed, config)

    waiting = [(-np.inf, number) for number in range(len(seeds))]  # a heap, the best first
    found: list[WallLine] = []
    while waiting:
        expected, number = heapq.heappop(waiting)
        proposal = propose(seeds[number])
        if proposal is None:
            continue
        if -proposal[0] > expected + 1e-9:  # not yet known, or some of its points are gone
            heapq.heappush(waiting, (-proposal[0], number))
            continue
        grown = _grown(points, seeds[number], proposal[1], free, config)
        if grown is not None:
            found.append(grown)
            free[grown.members] = False
    return _without_crossings(found, points, config)


def fit_line(
    points: FloatArray, weights: FloatArray, outward: FloatArray
) -> tuple[PlanLine, float]:
    """The line (total least squares) of points (N, 2+) and their RMS distance in metres.

    Its outside is on the side of ``outward``.
    """
    share = weights / weights.sum()
    middle: FloatArray = share @ points[:, :2]
    rest = points[:, :2] - middle
    values, vectors = np.linalg.eigh((rest * share[:, None]).T @ rest)
    normal = vectors[:, 0] * (1.0 if vectors[:, 0] @ outward >= 0 else -1.0)
    return PlanLine(middle, normal), float(np.sqrt(max(values[0], 0.0)))


def _seeds(points: FloatArray, config: PlaneConfig) -> list[FloatArray]:
    """Places (2,) in plan where points occupy enough rows above one another."""
    cells = np.unique(np.floor(points / config.cell_m).astype(np.int64), axis=0)
    columns, start, rows = np.unique(cells[:, :2], axis=0, return_index=True, return_counts=True)
    del start
    tall = columns[rows >= config.seed_rows]
    return list((tall + 0.5) * config.cell_m)


def _few_per_cell(points: FloatArray, config: PlaneConfig) -> IntArray:
    """Indices of the first points of every cube: more tell a proposal nothing."""
    cells = np.floor(points / config.cell_m).astype(np.int64)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    order = np.argsort(cell.reshape(-1), kind="stable")
    ordered = cell.reshape(-1)[order]
    first = np.flatnonzero(np.diff(ordered, prepend=-1))
    rank = np.arange(len(order)) - np.repeat(first, np.diff([*first, len(order)]))
    return np.sort(order[rank < _PER_CELL])


def _proposal(
    places: FloatArray, weights: FloatArray, seed: FloatArray, config: PlaneConfig
) -> tuple[float, PlanLine] | None:
    """Weight of the points on the best line near a seed, and the line; None where there is none."""
    if len(places) < _MIN_FITTED:
        return None
    angles = np.deg2rad(np.arange(0.0, 180.0, config.seed_step_deg))
    normals = np.stack([np.cos(angles), np.sin(angles)])
    width = 2 * config.inlier_m
    reach = int(np.ceil(config.cell_m / width)) + 1
    offset = np.floor((places[:, :2] - seed) @ normals / width).astype(np.intp)  # (n, A)
    inside = np.abs(offset + 0.5) < reach
    bins = (offset + reach) * len(angles) + np.arange(len(angles))
    weight = np.broadcast_to(weights[:, None], bins.shape)
    votes = np.bincount(bins[inside], weights=weight[inside], minlength=2 * reach * len(angles))
    best = int(votes.argmax())
    score = float(votes[best])
    if score < config.seed_rows:
        return None
    row, column = divmod(best, len(angles))
    foot = seed + (row - reach + 0.5) * width * normals[:, column]
    return score, PlanLine(foot, normals[:, column])


def _grown(
    points: WallPoints,
    seed: FloatArray,
    line: PlanLine,
    free: NDArray[np.bool_],
    config: PlaneConfig,
) -> WallLine | None:
    """The line after it took in all points that go on along it; None where too few do."""
    candidates = np.flatnonzero(free)
    places, weights = points.points_in_world[candidates], points.weights[candidates]
    reach_m, extent_m = config.seed_radius_m, np.inf
    on = np.zeros(len(candidates), dtype=np.bool_)
    while reach_m < _GROWTH * extent_m:
        for _ in range(_REFITS):
            along, front = line.coordinates(places).T
            centre = float(line.coordinates(seed)[0])
            close = np.abs(front) <= config.inlier_m
            left, right = _unbroken(along[close], centre, config.gap_m)
            extent_m = max(centre - left, right - centre)
            on = close & (along >= left) & (along <= right) & (np.abs(along - centre) <= reach_m)
            if on.sum() >= _MIN_FITTED:
                line, _ = fit_line(places[on], weights[on], line.outward)
        reach_m *= _GROWTH
    members = candidates[on]
    if len(members) < config.min_points // 2:
        return None
    if _cameras_behind(points, members, line):
        line = line.flipped()
    return WallLine(line, members, np.zeros_like(free))


def _without_crossings(
    walls: Sequence[WallLine], points: WallPoints, config: PlaneConfig
) -> list[WallLine]:
    """The walls, heaviest first, without the points beside the faces of heavier ones they cross."""
    weights = [float(points.weights[wall.members].sum()) for wall in walls]
    order = np.argsort(-np.array(weights), kind="stable")
    faces: list[tuple[PlanLine, NDArray[np.bool_]]] = []
    kept = []
    for number in order:
        line, members = walls[number].line, walls[number].members
        crossed = np.zeros(len(points.weights), dtype=np.bool_)
        for other, face in faces:
            if abs(other.along @ line.outward) > _CROSSING:
                crossed |= face
        members = members[~crossed[members]]
        if not len(members):
            continue
        kept.append(WallLine(line, members, crossed))
        along, front = line.coordinates(points.points_in_world).T
        own = along[members]
        face = (np.abs(front) <= _BAND_M) & (along >= own.min()) & (along <= own.max())
        if len(members) >= config.min_flat * face.sum():  # a hedge has no face
            faces.append((line, face))
    return kept


def _unbroken(along: FloatArray, centre: float, gap_m: float) -> tuple[float, float]:
    """Ends of the run of positions around the centre without a gap of more than gap_m."""
    order = np.sort(along)
    if not len(order):
        return centre, centre
    nearest = int(np.abs(order - centre).argmin())
    breaks = np.flatnonzero(np.diff(order) > gap_m)
    first = int(breaks[breaks < nearest].max(initial=-1)) + 1
    last = int(breaks[breaks >= nearest].min(initial=len(order) - 1))
    return float(order[first]), float(order[last])


def _cameras_behind(points: WallPoints, members: IntArray, line: PlanLine) -> bool:
    """Whether most sights of the points come from behind the line."""
    front = line.coordinates(points.centres_in_world)[:, 1]
    views = points.views_of(members)
    return bool(views @ np.sign(front) < 0)
