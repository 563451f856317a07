"""Parallel walls cut where one ends and the next begins: bays, set-backs, gaps (C.2).

Of walls that face the same way and stand less than a bay's depth before one another, a place along
them belongs to one: the one with most support there, over the height of the house. Relief, window
frames and gutters support few rows, hence lose against the wall, and a change of plane must pay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from si3fp.camera2d.wall_lines import PlanLine, WallLine, find_wall_lines, fit_line
from si3fp.camera2d.wall_points import IntArray, WallPoints
from si3fp.config import PlaneConfig
from si3fp.geometry.rigid import FloatArray

_ROBUST_REFITS = 5
_MIN_MEMBERS = 8  # points of a stretch
_MAX_BEND_DEG = 3.0
_END_COLUMN_M = 0.25
_END_SHARE = 0.25  # of the usual rows of points above one another


@dataclass(frozen=True, slots=True, eq=False)
class WallRun:
    """A stretch of one plane.

    Attributes
    ----------
    line
        The plane; its foot is the middle of the points.
    members
        Indices of the points.
    left_m, right_m
        Ends of the points along the line, from its foot.
    rms_m
        Distance of the points from the plane.
    crossed
        (N,) mask of the points beside the faces of walls that it crosses.
    """

    line: PlanLine
    members: IntArray
    left_m: float
    right_m: float
    rms_m: float
    crossed: NDArray[np.bool_]

    @property
    def width_m(self) -> float:
        """Distance between the ends."""
        return self.right_m - self.left_m

    @property
    def ends_in_world(self) -> FloatArray:
        """(2, 2) left and right end seen from above."""
        ends: FloatArray = self.line.foot_in_world + np.outer(
            [self.left_m, self.right_m], self.line.along
        )
        return ends


def find_walls(points: WallPoints, config: PlaneConfig) -> list[WallRun]:
    """Stretches of walls that share no place along them, the longest first."""
    runs = cut_into_runs(find_wall_lines(points, config), points, config)
    return [run for run in runs if _is_flat(run, points, config)]


def cut_into_runs(
    walls: Sequence[WallLine], points: WallPoints, config: PlaneConfig
) -> list[WallRun]:
    """Stretches of these lines that share no place along them, the longest first."""
    runs = []
    for group in _parallel_groups(walls, points, config):
        runs += _runs_of(group, points, config)
    runs.sort(key=lambda run: (-run.width_m, run.line.foot_in_world.tolist()))
    return runs


def _is_flat(run: WallRun, points: WallPoints, config: PlaneConfig) -> bool:
    """Whether the points lie on a plane, not about it: hedges and trees have no face."""
    along, front = run.line.coordinates(points.points_in_world).T
    height = points.points_in_world[:, 2]
    low, high = np.quantile(height[run.members], [0.05, 0.95])
    beside = (along >= run.left_m) & (along <= run.right_m) & (height >= low) & (height <= high)
    near = beside & (np.abs(front) <= config.relief_m) & ~run.crossed
    on = near & (np.abs(front) <= config.inlier_m)
    return bool(on.sum() >= config.min_flat * near.sum())


def _parallel_groups(
    walls: Sequence[WallLine], points: WallPoints, config: PlaneConfig
) -> list[list[WallLine]]:
    """Walls that face the same way, overlap or touch, and stand within a step of one another."""
    boxes = [wall.line.coordinates(points.points_in_world[wall.members])[:, 0] for wall in walls]
    spans = [(float(box.min()), float(box.max())) for box in boxes]
    label = list(range(len(walls)))
    for a, first in enumerate(walls):
        for b in range(a + 1, len(walls)):
            second = walls[b]
            if first.line.outward @ second.line.outward < np.cos(np.deg2rad(config.parallel_deg)):
                continue
            ends = second.line.foot_in_world + np.outer(spans[b], second.line.along)
            along, front = first.line.coordinates(ends).T
            apart = max(along.min() - spans[a][1], spans[a][0] - along.max())
            if apart <= 0 and np.abs(front).min() <= config.step_m:
                label = [label[a] if one == label[b] else one for one in label]
    return [
        [wall for wall, of in zip(walls, label, strict=True) if of == one]
        for one in dict.fromkeys(label)
    ]


def _runs_of(group: Sequence[WallLine], points: WallPoints, config: PlaneConfig) -> list[WallRun]:
    axis = group[0].line
    along = [axis.coordinates(points.points_in_world[wall.members])[:, 0] for wall in group]
    lowest = min(float(one.min()) for one in along)
    count = int((max(float(one.max()) for one in along) - lowest) / config.cell_m) + 1
    support = np.array([_flat_rows(wall, axis, lowest, count, points, config) for wall in group])
    support = _without_relief(support, group, points, config)
    empty = np.full((1, count), config.min_rows)
    labels = best_labels(np.concatenate([support, empty]), config.change_rows)
    runs: list[WallRun] = []
    starts = np.flatnonzero(np.diff(labels, prepend=-1))
    for start, stop in zip(starts, [*starts[1:], count], strict=True):
        if labels[start] == len(group):
            continue
        wall, position = group[labels[start]], along[labels[start]]
        left, right = lowest + start * config.cell_m, lowest + stop * config.cell_m
        members = wall.members[(position >= left) & (position < right)]
        if len(members) < _MIN_MEMBERS:
            continue
        run = _fitted(members, wall, points, config)
        if runs and _goes_on(runs[-1], run, config):
            before = runs.pop()
            larger = max(before, run, key=lambda one: len(one.members))
            run = _fitted(np.concatenate([before.members, run.members]), larger, points, config)
        runs.append(run)
    return runs


def _flat_rows(
    wall: WallLine,
    axis: PlanLine,
    lowest: float,
    count: int,
    points: WallPoints,
    config: PlaneConfig,
) -> FloatArray:
    """Rows of cells (B,) in which a wall has a face: hedges scatter their points about it."""
    front = np.abs(wall.line.coordinates(points.points_in_world)[:, 1])
    near = np.flatnonzero((front <= config.relief_m) & ~wall.crossed)
    along = axis.coordinates(points.points_in_world[near])[:, 0]
    column = np.floor((along - lowest) / config.cell_m).astype(np.int64)
    row = np.floor(points.points_in_world[near, 2] / config.cell_m).astype(np.int64)
    inside = (column >= 0) & (column < count)
    mine = np.zeros(len(points.weights), dtype=np.bool_)
    mine[wall.members] = True
    cells, cell = np.unique(np.stack([column[inside], row[inside]]), axis=1, return_inverse=True)
    every = np.bincount(cell.reshape(-1))
    own = np.bincount(cell.reshape(-1), weights=mine[near][inside])
    flat = cells[0, (own > 0) & (own >= config.min_flat * every)]
    return np.bincount(flat, minlength=count).astype(np.float64)


def _goes_on(first: WallRun, second: WallRun, config: PlaneConfig) -> bool:
    """Whether two stretches side by side are one wall: no gap, no step, no bend."""
    if first.line.outward @ second.line.outward < np.cos(np.deg2rad(_MAX_BEND_DEG)):
        return False
    a, b = first.line.coordinates(second.ends_in_world)[:, 0], second.ends_in_world
    gap = max(float(a.min()) - first.right_m, first.left_m - float(a.max()))
    nearest = b[0] if a[0] >= first.right_m - config.cell_m else b[1]
    step = abs(float(first.line.coordinates(nearest)[1]))
    return gap <= config.gap_m and step <= config.min_step_m


def _without_relief(
    support: FloatArray, group: Sequence[WallLine], points: WallPoints, config: PlaneConfig
) -> FloatArray:
    """The support (K, B) with that of frames, sills and plinths given to the wall they belong to.

    A plane is relief where it stands so near a stronger one that both can be one wall and has the
    upper hand in few of its own places.
    """
    support = support.copy()
    order = np.argsort(-support.sum(axis=1), kind="stable")
    for place, strong in enumerate(order):
        for weak in order[place + 1 :]:
            middle = points.points_in_world[group[weak].members, :2].mean(axis=0)
            distance = abs(float(group[strong].line.coordinates(middle)[1]))
            own = support[weak] >= config.min_rows
            if distance > config.relief_m or not own.any():
                continue
            if (support[weak] > support[strong])[own].mean() <= config.relief_share:
                shared = own & (support[strong] > 0)
                support[strong, shared] = np.maximum(support[strong], support[weak])[shared]
                support[weak] = 0.0
    return support


def best_labels(support: FloatArray, change_cost: float) -> NDArray[np.intp]:
    """The row of ``support`` (K, B) chosen in every column (B,), each change costing as much.

    The sum of the supports chosen minus the costs is largest (Viterbi 1967). Outside the columns
    is the last row.

    Examples
    --------
    >>> best_labels(np.array([[5.0, 5, 0, 5], [1, 1, 1, 1]]), change_cost=2.5).tolist()
    [0, 0, 0, 0]
    """
    states, columns = support.shape
    total = support[:, 0] - np.where(np.arange(states) == states - 1, 0.0, change_cost)
    came_from = np.zeros((columns, states), dtype=np.intp)
    for column in range(1, columns):
        best = int(total.argmax())
        changed = total[best] - change_cost
        came_from[column] = np.where(total >= changed, np.arange(states), best)
        total = np.maximum(total, changed) + support[:, column]
    total = total - np.where(np.arange(states) == states - 1, 0.0, change_cost)
    labels = np.zeros(columns, dtype=np.intp)
    labels[-1] = int(total.argmax())
    for column in range(columns - 1, 0, -1):
        labels[column - 1] = came_from[column, labels[column]]
    return labels


def _fitted(
    members: IntArray, start: WallLine | WallRun, points: WallPoints, config: PlaneConfig
) -> WallRun:
    """The run with its line fitted to the wall's face: frames and sills beside it count little."""
    places, weights = points.points_in_world[members], points.weights[members]
    robust, line = weights, start.line
    for _ in range(_ROBUST_REFITS):
        line, _ = fit_line(places, robust, line.outward)
        front = line.coordinates(places)[:, 1]
        scale = max(1.4826 * float(np.median(np.abs(front))), config.inlier_m / 10)
        robust = weights / (1 + (front / (2 * scale)) ** 2) ** 2  # Geman and McClure (1985)
    along, front = line.coordinates(places).T
    rms_m = float(np.sqrt(robust @ front**2 / robust.sum()))
    left, right = _ends(along, places[:, 2])
    return WallRun(line, members, left, right, rms_m, start.crossed)


def _ends(along: FloatArray, height: FloatArray) -> tuple[float, float]:
    """Ends of the points: the outermost that stand above one another, no stragglers."""
    lowest = float(along.min())
    column = np.floor((along - lowest) / _END_COLUMN_M).astype(np.int64)
    cells = np.unique(np.stack([column, np.floor(height / _END_COLUMN_M).astype(np.int64)]), axis=1)
    rows = np.bincount(cells[0])
    tall = np.flatnonzero(rows >= max(2.0, _END_SHARE * float(np.median(rows[rows > 0]))))
    if not len(tall):
        return lowest, float(along.max())
    return float(along[column == tall[0]].min()), float(along[column == tall[-1]].max())
