"""M.1: a balcony's door and the window beside it that the detector boxed as one.

A balcony can be walked onto. Where what opens onto it is too wide for a door and no door stands
beside it, it is a door and a window in one frame. Where the door is, the picture tells below the
sill: the door goes on there, beside it is wall (docs/decisions/0019-what-slabs-hide.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import OrthoImage, Window
from si3fp.windows.balcony_columns import SAME_SPAN, BalconyColumn
from si3fp.windows.balcony_openings import DOOR_M, HIGHEST_DOOR_M, SLAB_M, door_foot, span_iou
from si3fp.windows.balcony_posts import door_by_posts
from si3fp.windows.measure import BALCONY_DOOR_HEIGHT_M
from si3fp.windows.regular import edges_of

WIDTH_M = (1.35, 3.2)
"""Width of a door with a window in one frame; what is narrower may be a door of two leaves."""
HEIGHT_M = (0.5, 2.4)
"""Height of it, as far as it shows."""
WIDTHS_M = np.arange(0.7, 1.051, 0.05)
"""Width of doors of one leaf."""
LEAST_WINDOW_M = 0.5
"""Width of the window beside it."""
SILL_M = (0.9, 1.7)
"""Sills lie so far below the heads."""
BELOW_SILL_M = (0.1, 0.65)
"""Where below a sill the door is told from the wall."""
BESIDE_M = (0.16, 0.4)
"""Where beside the frame the wall is looked at, at the same height: behind the same bars."""
MOST_CONTRAST = 40.0
"""A storey says no more; in 8-bit CIE Lab."""
BEST = 2
"""Storeys of a column whose mean counts: those that show the door best."""
LEAST_CONTRAST, CLEARER = 14.0, 2.0
"""How far the door stands out there, at least, and by what factor more than on the other side."""
NEAR_M, SAME_HEAD_M = 0.2, 0.3
"""Sides of one column, and heads of one storey, lie no farther apart as they show."""
LEAST_ROW = 2  # windows that tell the sill of a storey
BINS = 64
BY_SILL = "door and window in one frame, as the wall below the sill shows"
BY_POSTS = "door and window in one frame, as the panes above the rail show"


@dataclass(frozen=True, slots=True)
class SharedFrame:
    """A door and a window in one frame, one above the other on all storeys.

    Attributes
    ----------
    left_m, right_m
        Sides of the frame on the facade.
    door_m
        Width of the door.
    door_left
        Whether the door is on the left.
    slabs_m
        Where the undersides of the balconies meet the wall, as far as known, from below.
    told
        What told the door, in words.
    """

    left_m: float
    right_m: float
    door_m: float
    door_left: bool
    slabs_m: tuple[float, ...]
    told: str = BY_SILL


def shared_frames(
    boxes_px: FloatArray,
    at_balcony: NDArray[np.bool_],
    columns: Sequence[BalconyColumn],
    image: OrthoImage,
    grid: FacadeGrid,
) -> tuple[SharedFrame, ...]:
    """Frames that hold a door and a window, one per column of them where the picture tells.

    Parameters
    ----------
    boxes_px
        (N, 4) sure openings.
    at_balcony
        (N,) which stand in a column of balconies.
    columns
        Columns of balconies whose slabs are known.
    image
        The fused orthophoto.
    grid
        Its grid.

    Notes
    -----
    Columns of one width have doors of one width: they vote for it together.
    """
    step_m = grid.m_per_px
    wide = boxes_px[at_balcony & _holds_two(boxes_px, step_m)]
    lab = cv2.cvtColor(image.rgb, cv2.COLOR_RGB2LAB).astype(np.float64)
    votes = np.array([_votes(box, boxes_px, lab, image.valid, step_m) for box in wide])
    votes = votes.reshape(-1, 2, len(WIDTHS_M))
    told = []
    for column in _columns(wide):
        best = column[np.argsort(votes[column].max(axis=(1, 2)))[-BEST:]]
        vote = votes[best].sum(axis=0) / BEST
        low, high = np.sort(vote.max(axis=1)).tolist()
        if high > LEAST_CONTRAST and high > CLEARER * low:
            weights = votes[best].max(axis=(1, 2)) ** 2
            left, right = np.average(wide[best][:, [0, 2]], axis=0, weights=weights).tolist()
            told.append((left * step_m, right * step_m, vote, BY_SILL))
        elif door := door_by_posts(wide[column], lab, step_m):
            vote = np.zeros((2, len(WIDTHS_M)))
            vote[0 if door[0] else 1, np.abs(WIDTHS_M - door[1]).argmin()] = 1.0
            left, right = np.median(wide[column][:, [0, 2]], axis=0).tolist()
            told.append((left * step_m, right * step_m, vote, BY_POSTS))
    frames = []
    for left, right, vote, how in told:
        alike = [other for a, b, other, _ in told if abs((b - a) - (right - left)) < NEAR_M]
        width = float(WIDTHS_M[np.sum([each.max(axis=0) for each in alike], axis=0).argmax()])
        slabs = [
            column.slabs_m.tolist()
            for column in columns
            if column.left_m < (left + right) / 2 < column.right_m
        ]
        door_left = bool(vote[0].max() > vote[1].max())
        frames.append(
            SharedFrame(left, right, width, door_left, tuple(slabs[0] if slabs else ()), how)
        )
    return tuple(frames)


def parted(windows: Sequence[Window], frames: Sequence[SharedFrame]) -> tuple[Window, ...]:
    """The windows, doors and windows in one frame apart, top row first, left to right.

    Notes
    -----
    The door goes down to the slab, the window to the sill that its storey's other windows share;
    where these do not tell, it ends as it showed. Below the lowest balcony it stays one.
    """
    edges_m = edges_of(windows)
    result = []
    for window, edges in zip(windows, edges_m, strict=True):
        mine = [frame for frame in frames if _same_span(edges, frame)]
        door = _foot(float(edges[3]), mine[0]) if mine else None
        if door is None:
            result.append(window)
            continue
        foot, foot_sigma = door
        left, right = _usual_sides(edges, edges_m, mine[0])
        post = left + mine[0].door_m if mine[0].door_left else right - mine[0].door_m
        sides = [(left, post), (post, right)]
        (d_left, d_right), (w_left, w_right) = sides if mine[0].door_left else sides[::-1]
        sill = _sill_of_row(edges, edges_m)
        sill = window.y_m if sill is None else sill
        sigma = window.edge_sigma_m
        told = replace(window, evidence=f"{window.evidence}; {mine[0].told}")
        result += [
            replace(
                told,
                x_m=d_left,
                width_m=d_right - d_left,
                y_m=foot,
                height_m=float(edges[3]) - foot,
                label="balcony_door",
                edge_sigma_m=(sigma[0], sigma[1], round(foot_sigma, 4), sigma[3]),
            ),
            replace(
                told,
                x_m=w_left,
                width_m=w_right - w_left,
                y_m=sill,
                height_m=float(edges[3]) - sill,
                label="window",
            ),
        ]
    return tuple(sorted(result, key=lambda w: (-round(w.y_m, 1), w.x_m)))


def _foot(head_m: float, frame: SharedFrame) -> tuple[float, float] | None:
    """Foot of a door and its standard deviation; None below the lowest balcony of its column."""
    slabs = [s for s in frame.slabs_m if BALCONY_DOOR_HEIGHT_M < head_m - s < HIGHEST_DOOR_M]
    if frame.slabs_m and head_m < frame.slabs_m[0] + BALCONY_DOOR_HEIGHT_M:
        return None
    slabs.append(head_m - DOOR_M - SLAB_M)
    foot, sigma = door_foot(-slabs[0], 0.0, -head_m, 1.0)
    return -foot, sigma


def _usual_sides(
    edges_m: FloatArray, others_m: FloatArray, frame: SharedFrame
) -> tuple[float, float]:
    """Left and right side of an opening (4,), those of its column (N, 4) where they lie far off."""
    told = np.array([frame.left_m, frame.right_m])
    column = others_m[[_same_span(other, frame) for other in others_m], :2]
    near = np.abs(column - told).max(axis=1) < NEAR_M
    usual = np.median(column[near], axis=0) if near.any() else told
    sides = np.where(np.abs(edges_m[:2] - usual) < NEAR_M / 2, edges_m[:2], usual)
    return float(sides[0]), float(sides[1])


def _same_span(edges_m: FloatArray, frame: SharedFrame) -> bool:
    """Whether a window (4,) is as wide as a frame."""
    return span_iou(edges_m[:2], (frame.left_m, frame.right_m)) > SAME_SPAN


def _sill_of_row(edges_m: FloatArray, others_m: FloatArray) -> float | None:
    """Sill that the windows (N, 4) of an opening's (4,) storey share; None if less than two do."""
    heights_m = others_m[:, 3] - others_m[:, 2]
    row = np.abs(others_m[:, 3] - edges_m[3]) < SAME_HEAD_M
    row &= (heights_m > SILL_M[0]) & (heights_m < SILL_M[1]) & (others_m != edges_m).any(axis=1)
    return float(np.median(others_m[row, 2])) if row.sum() >= LEAST_ROW else None


def _holds_two(boxes_px: FloatArray, m_per_px: float) -> NDArray[np.bool_]:
    """(N,) which openings are as large as a door with a window."""
    width_m, height_m = ((boxes_px[:, 2:] - boxes_px[:, :2]) * m_per_px).T
    fits = (width_m > WIDTH_M[0]) & (width_m < WIDTH_M[1])
    return np.asarray(fits & (height_m > HEIGHT_M[0]) & (height_m < HEIGHT_M[1]))


def _columns(boxes_px: FloatArray) -> list[NDArray[np.intp]]:
    """Indices of the boxes (N, 4) that stand one above the other, column by column."""
    columns = []
    free = np.ones(len(boxes_px), bool)
    for index, box in enumerate(boxes_px):
        if free[index]:
            alike = [span_iou(box[[0, 2]], other[[0, 2]]) > SAME_SPAN for other in boxes_px]
            mine = free & np.array(alike)
            free &= ~mine
            columns.append(np.flatnonzero(mine))
    return columns


def _votes(
    box: FloatArray,
    boxes_px: FloatArray,
    lab: FloatArray,
    valid: NDArray[np.bool_],
    m_per_px: float,
) -> FloatArray:
    """(2, widths) how much more the door's part below the sill differs from the wall.

    First for a door on the left, then on the right; 0 where the picture ends.
    """
    upwards = np.array([1, 1, -1, -1]) * m_per_px
    sill_m = _sill_of_row(box[[0, 2, 3, 1]] * upwards, boxes_px[:, [0, 2, 3, 1]] * upwards)
    sill = float(box[3]) if sill_m is None else -sill_m / m_per_px
    profile = _profile(float(box[0]), float(box[2]), sill, lab, valid, m_per_px)
    if profile is None:
        return np.zeros((2, len(WIDTHS_M)))
    wide_m = float(box[2] - box[0]) * m_per_px
    return np.array([_steps(profile, wide_m), _steps(profile[::-1], wide_m)])


def _profile(
    left: float,
    right: float,
    sill: float,
    lab: FloatArray,
    valid: NDArray[np.bool_],
    m_per_px: float,
) -> FloatArray | None:
    """(BINS,) from left to right, how far what is below a sill differs from the wall beside."""
    rows = slice(*(round(sill + each / m_per_px) for each in BELOW_SILL_M))
    near, far = (each / m_per_px for each in BESIDE_M)
    if rows.stop > len(lab):
        return None

    def colours(first: float, last: float) -> FloatArray:
        """(W, 3) median colour of each column of pixels."""
        part = slice(max(round(first), 0), max(round(last), 0))
        seen = valid[rows, part].mean(axis=0) > 0.5
        return np.asarray(np.median(lab[rows, part], axis=0)[seen])

    wall = np.concatenate([colours(left - far, left - near), colours(right + near, right + far)])
    inside = colours(left, right)
    if not len(wall) or len(inside) < BINS // 2:
        return None
    off = np.linalg.norm(inside - np.median(wall, axis=0), axis=1).clip(0, MOST_CONTRAST)
    at = (np.arange(BINS) + 0.5) / BINS * len(off) - 0.5
    return np.asarray(np.interp(at, np.arange(len(off)), off))


def _steps(profile: FloatArray, wide_m: float) -> FloatArray:
    """(widths,) how far the first part of a profile lies above the rest, by the door's width."""
    ends = np.round(WIDTHS_M / wide_m * BINS).astype(int)
    return np.array(
        [
            profile[:end].mean() - profile[end:].mean()
            if wide_m - door_m >= LEAST_WINDOW_M
            else 0.0
            for end, door_m in zip(ends, WIDTHS_M, strict=True)
        ]
    )
