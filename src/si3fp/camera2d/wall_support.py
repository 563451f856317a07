"""Which of several parallel planes a wall belongs to, place by place along it (C.2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from si3fp.camera2d.wall_lines import PlanLine, WallLine
from si3fp.camera2d.wall_points import WallPoints
from si3fp.config import PlaneConfig
from si3fp.geometry.rigid import FloatArray


def support_along(
    group: Sequence[WallLine], lowest_m: float, count: int, points: WallPoints, config: PlaneConfig
) -> FloatArray:
    """Rows of cells (K, B) that every plane of a group occupies in every bin along the first one.

    Frames, sills and plinths count for the wall they belong to.

    Parameters
    ----------
    group
        Planes that face the same way.
    lowest_m, count
        Where the first bin begins on the first plane's line, and the number of bins of
        `PlaneConfig.cell_m`.
    points
        Of the scene.
    config
        Limits.
    """
    loose = np.ones(len(points.weights), dtype=np.bool_)
    for wall in group:
        loose[wall.members] = False
    axis = group[0].line
    rows = [_flat_rows(wall, loose, axis, lowest_m, count, points, config) for wall in group]
    return _without_relief(np.array(rows), group, points, config)


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


def _flat_rows(
    wall: WallLine,
    loose: NDArray[np.bool_],
    axis: PlanLine,
    lowest_m: float,
    count: int,
    points: WallPoints,
    config: PlaneConfig,
) -> FloatArray:
    """Rows of cells (B,) in which a wall has a face: hedges scatter loose points about it."""
    mine = np.zeros(len(points.weights), dtype=np.bool_)
    mine[wall.members] = True
    front = np.abs(wall.line.coordinates(points.points_in_world)[:, 1])
    near = np.flatnonzero(mine | ((front <= config.relief_m) & loose & ~wall.crossed))
    along = axis.coordinates(points.points_in_world[near])[:, 0]
    column = np.floor((along - lowest_m) / config.cell_m).astype(np.int64)
    row = np.floor(points.points_in_world[near, 2] / config.cell_m).astype(np.int64)
    inside = (column >= 0) & (column < count)
    cells, cell = np.unique(np.stack([column[inside], row[inside]]), axis=1, return_inverse=True)
    every = np.bincount(cell.reshape(-1))
    own = np.bincount(cell.reshape(-1), weights=mine[near][inside])
    flat = cells[0, (own > 0) & (own >= config.min_flat * every)]
    return np.bincount(flat, minlength=count).astype(np.float64)


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
