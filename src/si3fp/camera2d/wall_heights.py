"""Ground and eaves of walls, from the rows of points on them and before them (C.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from si3fp.camera2d.wall_ends import Side
from si3fp.camera2d.wall_points import WallPoints
from si3fp.camera2d.wall_runs import WallRun
from si3fp.config import PlaneConfig
from si3fp.geometry.rigid import FloatArray

_ROW_M = 0.25
_GROUND_FRONT_M = 3.0
_RELIEF_M = 0.12  # a cornice or gutter stands at least so far before the wall
_OVERHANG_M = 1.2  # and at most so far
_CORNICE_SHARE = 0.5  # of the columns of cells
_DENSE_SHARE = 0.4  # of the usual share of occupied columns
_MIN_EAVES_SHARE = 0.6  # of the height over which the wall has points
_OVER_TOP_ROWS = 4  # a cornice may lie so far above the last dense row
_GABLE_SPREAD = 0.87  # places on a triangle spread 0.71 times as much as on its rectangle
_STRAY_SHARE = 0.01  # of a wall's points may lie above it, on chimneys and dormers
_FEW = 4
_BESIDE_M = 3.0  # walls that end so near one another are of one building
_MIN_GABLE_M, _MAX_GABLE_M = 1.0, 2.5  # dense rows of a gable above the cornice of its neighbour
_SAME_EAVES_M = 1.2  # points of a plain wall end so far below its eaves
_NEAR_TOP_M = 2.5  # and any way below where its points are few, but go on up to here
_THIN_POINTS = 10
_THIN_SPREAD = 0.15  # of the wall's width, their standard deviation along it; not a chimney
_AS_WIDE = 0.5  # share of a wall's width that its neighbour must have to know better


def ground_z(run: WallRun, points: WallPoints, config: PlaneConfig) -> Side:
    """World z of the ground at a wall: the lowest points before it, or below the cameras."""
    along, front = run.line.coordinates(points.points_in_world).T
    before = (along >= run.left_m) & (along <= run.right_m)
    before &= (front >= -_RELIEF_M) & (front <= _GROUND_FRONT_M)
    before[run.members] = True
    lowest = float(np.quantile(points.points_in_world[before, 2], 0.01))
    views = points.views_of(run.members).astype(np.float64)
    order = np.argsort(points.centres_in_world[:, 2], kind="stable")
    middle = int(np.searchsorted(np.cumsum(views[order]), views.sum() / 2))
    below = float(points.centres_in_world[order[middle], 2]) - config.camera_height_m
    if lowest <= below:
        return Side(lowest, "the lowest points before it")
    return Side(below, f"the cameras, {config.camera_height_m:g} m above the ground")


def eaves_z(runs: Sequence[WallRun], points: WallPoints, config: PlaneConfig) -> list[Side]:
    """World z of the eaves of every wall: under the cornice, else where its rows of points end.

    A cornice or gutter is a row of points before the wall along half of it or more, with at most a
    gable above it. The points of roofs do not count: they lie behind the wall. Where a wall has no
    cornice of its own, that of the wall beside it goes on if only a gable is above, and a plain
    wall whose points end a little lower than those of a wide wall of the same building, or get few
    and go on up to its eaves, has the same eaves.
    """
    profiles = [_profile(run, points, config) for run in runs]
    own = [_own_eaves(profile) for profile in profiles]
    beside = _beside(runs)
    turned = []
    for number, (run, profile) in enumerate(zip(runs, profiles, strict=True)):
        wide = [n for n in beside[number] if runs[n].width_m >= _AS_WIDE * run.width_m]
        turned.append(_under_gable(own[number], profile, [own[n] for n in wide]))
    eaves = []
    for number, run in enumerate(runs):
        side, near = turned[number], _reached(number, beside)
        others = [turned[n].at_m for n in near if runs[n].width_m >= _AS_WIDE * run.width_m]
        eaves.append(_as_others(side, run, points, others))
    return eaves


def reaches(run: WallRun, points: WallPoints, from_z: float, top_z: float) -> bool:
    """Whether a wall whose dense rows of points end at a height goes on up to a higher top.

    It does where points, few but all along it, lie right below the top: the upper storeys of a
    tower are seen at a slant and match seldom. A chimney, the tip of a gable and the half of a wall
    that is higher than the rest are narrower.
    """
    on_wall = points.points_in_world[run.members]
    near = on_wall[:, 2] > top_z - min(_NEAR_TOP_M, (top_z - from_z) / 2)
    along, _ = run.line.coordinates(on_wall[near]).T
    return len(along) >= _THIN_POINTS and bool(np.std(along) >= _THIN_SPREAD * run.width_m)


@dataclass(frozen=True, slots=True, eq=False)
class _Profile:
    """Rows of points of a wall from the lowest up.

    Attributes
    ----------
    lowest_m
        World z at which the first row begins.
    wall_shares, front_shares
        (R,) share of the columns of cells that points on the wall, and before it, occupy.
    wall_along_m, wall_z, front_z
        Places along the wall and heights of these points.
    """

    lowest_m: float
    wall_shares: FloatArray
    front_shares: FloatArray
    wall_along_m: FloatArray
    wall_z: FloatArray
    front_z: FloatArray

    def is_gable_above(self, z_m: float) -> bool:
        """Whether the wall above a height is none, or narrower than the wall."""
        above = self.wall_z > z_m + _ROW_M
        if above.sum() < max(_STRAY_SHARE * len(self.wall_z), _FEW):
            return True
        along = self.wall_along_m
        return bool(np.std(along[above]) < _GABLE_SPREAD * np.std(along[self.wall_z <= z_m]))


def _profile(run: WallRun, points: WallPoints, config: PlaneConfig) -> _Profile:
    along, front = run.line.coordinates(points.points_in_world).T
    height = points.points_in_world[:, 2]
    beside = (along >= run.left_m) & (along <= run.right_m)
    wall = np.zeros(len(height), dtype=np.bool_)
    wall[run.members] = True
    before = beside & (front >= _RELIEF_M) & (front <= _OVERHANG_M)
    lowest = float(np.quantile(height[wall], 0.02))
    count = int((float(height[wall].max()) - lowest) / _ROW_M) + 1 + _OVER_TOP_ROWS
    columns = max(round(run.width_m / config.cell_m), 1)

    def shares(chosen: NDArray[np.bool_]) -> FloatArray:
        row = np.floor((height[chosen] - lowest) / _ROW_M).astype(np.int64)
        column = np.floor((along[chosen] - run.left_m) / run.width_m * columns).astype(np.int64)
        inside = (row >= 0) & (row < count) & (column >= 0) & (column < columns)
        cells = np.unique(np.stack([row[inside], column[inside]]), axis=1)
        return np.bincount(cells[0], minlength=count) / columns

    return _Profile(lowest, shares(wall), shares(before), along[wall], height[wall], height[before])


def _own_eaves(profile: _Profile) -> Side:
    """The eaves that a wall shows by itself."""
    usual = float(np.median(profile.wall_shares[profile.wall_shares > 0]))
    dense = np.flatnonzero(profile.wall_shares >= _DENSE_SHARE * usual)
    if len(dense) > 1 and dense[-1] - dense[-2] > 4:
        dense = dense[:-1]  # a row by itself: the edge of a chimney or dormer
    top = int(dense[-1]) + 1
    lines = np.flatnonzero(profile.front_shares >= _CORNICE_SHARE)
    lines = lines[(lines >= _MIN_EAVES_SHARE * top) & (lines <= top + _OVER_TOP_ROWS)]
    if len(lines):
        bottom = profile.lowest_m + float(lines[0]) * _ROW_M
        row = profile.front_z[(profile.front_z >= bottom) & (profile.front_z < bottom + _ROW_M)]
        cornice = float(np.quantile(row, 0.1))
        if profile.is_gable_above(cornice):
            wall_z = profile.wall_z
            under = wall_z[(wall_z > cornice - 4 * _ROW_M) & (wall_z <= cornice + 0.05)]
            return Side(float(under.max()) if len(under) else cornice, "the cornice or gutter")
    upper = profile.lowest_m + top * _ROW_M
    last = profile.wall_z[np.abs(profile.wall_z - upper) <= _ROW_M]
    return Side(float(np.quantile(last, 0.95)), "points")


def _under_gable(side: Side, profile: _Profile, neighbours: Sequence[Side]) -> Side:
    """The cornice of a wall beside it that goes on under a gable, else the side itself."""
    if side.rests_on != "points":
        return side
    for other in sorted(neighbours, key=lambda one: abs(one.at_m - side.at_m)):
        gable = _MIN_GABLE_M <= side.at_m - other.at_m <= _MAX_GABLE_M
        if "cornice" in other.rests_on and gable and profile.is_gable_above(other.at_m):
            return Side(other.at_m, "the cornice of the wall beside it, a gable is above")
    return side


def _as_others(side: Side, run: WallRun, points: WallPoints, others: Sequence[float]) -> Side:
    """The eaves of other walls of the building where this one goes on to them, else the side."""
    if side.rests_on != "points":
        return side
    higher = [
        z
        for z in others
        if 0 < z - side.at_m <= _SAME_EAVES_M
        or (z > side.at_m and reaches(run, points, side.at_m, z))
    ]
    if not higher:
        return side
    gap_m = max(higher) - side.at_m
    return Side(max(higher), f"the walls beside it; its own points end {gap_m:.1f} m lower")


def _beside(runs: Sequence[WallRun]) -> list[list[int]]:
    """For every wall the ones that end near its ends."""
    ends = np.array([run.ends_in_world for run in runs]).reshape(-1, 2, 2)
    gaps = np.linalg.norm(ends[:, None, :, None] - ends[None, :, None, :], axis=-1)
    near = gaps.min(axis=(2, 3)) <= _BESIDE_M
    return [[int(b) for b in np.flatnonzero(row) if b != a] for a, row in enumerate(near)]


def _reached(start: int, beside: Sequence[Sequence[int]]) -> list[int]:
    """The walls of the same building, from neighbour to neighbour."""
    found, waiting = {start}, [start]
    while waiting:
        for other in beside[waiting.pop()]:
            if other not in found:
                found.add(other)
                waiting.append(other)
    return sorted(found - {start})
