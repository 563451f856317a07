"""Left and right ends of walls: corners, walls that stand before them, last points (C.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from si3fp.camera2d.wall_lines import PlanLine
from si3fp.camera2d.wall_runs import WallRun
from si3fp.config import PlaneConfig

_INSIDE_M = 0.2  # points beyond a corner by more contradict it
_STEP_REACH_M = 0.5  # between the last points of a wall and the end of the one before it
_MIN_CORNER_DEG = 20.0


@dataclass(frozen=True, slots=True)
class Side:
    """One side of a rectangle.

    Attributes
    ----------
    at_m
        Along the wall's line from its foot, or world z.
    rests_on
        In words.
    """

    at_m: float
    rests_on: str


def regularised(runs: Sequence[WallRun], config: PlaneConfig) -> list[WallRun]:
    """The walls with those nearly square to the longest turned towards square.

    A turn from the right angle of `PlaneConfig.regular_deg` or less is shared between the points
    and the right angle by their variances: a long wall keeps its own bearing, a return of one
    metre takes the right angle.
    """
    if not runs:
        return []
    bearing_deg = _bearing_deg(runs[0].line)
    found = []
    for run in runs:
        off_deg = (_bearing_deg(run.line) - bearing_deg + 45.0) % 90.0 - 45.0
        if abs(off_deg) <= config.regular_deg:
            spread_m = max(run.width_m, config.cell_m) / np.sqrt(12)
            independent = max(run.width_m / config.cell_m, 1.0)
            sigma_deg = float(np.rad2deg(max(run.rms_m, 0.02) / spread_m / np.sqrt(independent)))
            share = sigma_deg**2 / (sigma_deg**2 + config.regular_sigma_deg**2)
            found.append(replace(run, line=_turned(run.line, share * off_deg)))
        else:
            found.append(run)
    return found


def wall_ends(runs: Sequence[WallRun], config: PlaneConfig) -> list[tuple[Side, Side]]:
    """Left and right end of every wall: a corner where it meets another, else its last points.

    Where a wall ends beside a parallel one that stands before it, it reaches that one's end: there
    the cameras lose sight of it.
    """
    ends = []
    for run in runs:
        others = [other for other in runs if other is not run]
        left, right = (_corner(run, end, others, config) for end in (0, 1))
        ends.append((left, right))
    stepped = []
    for number, run in enumerate(runs):
        sides = list(ends[number])
        for end in (0, 1):
            if sides[end].rests_on == "points":
                sides[end] = _step(run, end, sides[end], runs, ends, config)
        if sides[0].at_m >= sides[1].at_m:
            sides = list(ends[number])
        stepped.append((sides[0], sides[1]))
    return stepped


def _corner(run: WallRun, end: int, others: Sequence[WallRun], config: PlaneConfig) -> Side:
    """The intersection with another wall that ends there too, else the last points."""
    at_m = (run.left_m, run.right_m)[end]
    best = Side(at_m, "points")
    reach = np.inf
    for other in others:
        sine = float(run.line.along @ other.line.outward)
        if abs(sine) < np.sin(np.deg2rad(_MIN_CORNER_DEG)):
            continue
        gap = float((other.line.foot_in_world - run.line.foot_in_world) @ other.line.outward)
        meeting_m = gap / sine
        place = run.line.foot_in_world + meeting_m * run.line.along
        on_other = float(other.line.coordinates(place)[0])
        beyond = max(other.left_m - on_other, on_other - other.right_m)
        outside = (at_m - meeting_m) if end == 0 else (meeting_m - at_m)
        if -_INSIDE_M <= outside <= config.corner_m and beyond <= config.corner_m:
            distance = abs(outside) + max(beyond, 0.0)
            if distance < reach:
                bearing = _bearing_deg(other.line)
                best, reach = (
                    Side(meeting_m, f"the corner with the wall at {bearing:.0f}°"),
                    distance,
                )
    return best


def _step(
    run: WallRun,
    end: int,
    side: Side,
    runs: Sequence[WallRun],
    ends: Sequence[tuple[Side, Side]],
    config: PlaneConfig,
) -> Side:
    """The end of a parallel wall in front that begins where this one ends."""
    for other, others in zip(runs, ends, strict=True):
        parallel = run.line.outward @ other.line.outward
        if other is run or parallel < np.cos(np.deg2rad(config.parallel_deg)):
            continue
        near = others[1 - end].at_m  # its right end lies at our left one
        place = other.line.foot_in_world + near * other.line.along
        at_m, front = run.line.coordinates(place).tolist()
        if abs(at_m - side.at_m) <= _STEP_REACH_M and 0 < front <= config.step_m:
            return Side(at_m, "the end of the wall before it")
    return side


def _bearing_deg(line: PlanLine) -> float:
    return float(np.rad2deg(np.arctan2(line.outward[0], line.outward[1])) % 360)


def _turned(line: PlanLine, back_deg: float) -> PlanLine:
    """The line with its bearing less by so much."""
    turn = np.deg2rad(back_deg)  # a bearing runs clockwise, hence counter-clockwise back
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return PlanLine(line.foot_in_world, rotation @ line.outward)
