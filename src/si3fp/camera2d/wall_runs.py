"""Parallel walls cut where one ends and the next begins: bays, set-backs, gaps (C.2).

Of walls that face the same way and stand less than a bay's depth before one another, a place along
them belongs to one: the one with most support there, over the height of the house. Relief, window
frames and gutters support few rows, hence lose against the wall, and a change of plane must pay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from si3fp.camera2d.wall_lines import PlanLine, WallLine, find_wall_lines, fit_line
from si3fp.camera2d.wall_points import IntArray, WallPoints
from si3fp.camera2d.wall_support import best_labels, support_along
from si3fp.config import PlaneConfig
from si3fp.geometry.rigid import FloatArray

_ROBUST_REFITS = 5
_MAX_BEND_DEG = 1.5  # of a long wall in a bent reconstruction
_PARALLEL_SINE = 0.1  # of two lines whose intersection says nothing
_CROSSED_M = 0.3  # by which walls cross that do not just meet
_MIN_MEMBERS = 8  # points of a stretch
_MIN_STRETCH_M = 0.25
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
    """Stretches of walls that share no place along them and cross none, the longest first."""
    runs = cut_into_runs(find_wall_lines(points, config), points, config)
    kept: list[WallRun] = []
    for run in sorted(runs, key=lambda run: -len(run.members)):
        rest = _uncrossed(run, kept, points)
        if len(rest.members) >= _MIN_MEMBERS and rest.width_m >= _MIN_STRETCH_M:
            kept.append(rest)
    return sorted(kept, key=lambda run: (-run.width_m, run.line.foot_in_world.tolist()))


def cut_into_runs(
    walls: Sequence[WallLine], points: WallPoints, config: PlaneConfig
) -> list[WallRun]:
    """Stretches of these lines, of which no two parallel ones share a place along them."""
    groups = _parallel_groups(walls, points, config)
    return [run for group in groups for run in _runs_of(group, points, config)]


def _uncrossed(run: WallRun, others: Sequence[WallRun], points: WallPoints) -> WallRun:
    """The longer part of a wall on one side of the stronger ones that it crosses."""
    for other in others:
        sine = float(run.line.along @ other.line.outward)
        if abs(sine) < _PARALLEL_SINE:
            continue
        gap = other.line.foot_in_world - run.line.foot_in_world
        at_m = float(gap @ other.line.outward) / sine
        on_other = other.line.coordinates(run.line.foot_in_world + at_m * run.line.along)[0]
        inside = min(at_m - run.left_m, run.right_m - at_m)
        if min(inside, on_other - other.left_m, other.right_m - on_other) < _CROSSED_M:
            continue
        if at_m - run.left_m > run.right_m - at_m:
            run = replace(run, right_m=at_m)
        else:
            run = replace(run, left_m=at_m)
        along = run.line.coordinates(points.points_in_world[run.members])[:, 0]
        run = replace(run, members=run.members[(along >= run.left_m) & (along <= run.right_m)])
    return run


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
    support = support_along(group, lowest, count, points, config)
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
        if not _is_flat(run, points, config):
            continue
        if runs and _goes_on(runs[-1], run, config):
            run = _joined(runs.pop(), run, points, config)
        runs.append(run)
    return runs


def _joined(first: WallRun, second: WallRun, points: WallPoints, config: PlaneConfig) -> WallRun:
    """One wall of two stretches, on the plane of the longer one."""
    longer = max(first, second, key=lambda run: run.width_m)
    members = np.concatenate([first.members, second.members])
    front = longer.line.coordinates(points.points_in_world[members])[:, 1]
    run = _fitted(members[np.abs(front) <= config.inlier_m], longer, points, config)
    ends = np.concatenate([first.ends_in_world, second.ends_in_world])
    along = run.line.coordinates(ends)[:, 0]
    return replace(run, members=members, left_m=float(along.min()), right_m=float(along.max()))


def _goes_on(first: WallRun, second: WallRun, config: PlaneConfig) -> bool:
    """Whether two stretches side by side are one wall: no gap, and no step or bend to speak of."""
    shorter, longer = sorted((first, second), key=lambda run: run.width_m)
    along, front = longer.line.coordinates(shorter.ends_in_world).T
    gap = max(float(along.min()) - longer.right_m, longer.left_m - float(along.max()))
    straight = first.line.outward @ second.line.outward >= np.cos(np.deg2rad(_MAX_BEND_DEG))
    step = np.abs(front).min() if straight else np.abs(front).max()
    return bool(gap <= config.gap_m and step <= config.min_step_m)


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
    usual = float(np.quantile(rows[rows > 0], 0.75))
    tall = np.flatnonzero(rows >= max(2.0, _END_SHARE * usual))
    if not len(tall):
        return lowest, float(along.max())
    return float(along[column == tall[0]].min()), float(along[column == tall[-1]].max())
