"""M.1: a balcony's door and the window beside it that the detector boxed as one.

A balcony can be walked onto. Where what opens onto it is too wide for a door and no door stands
beside it, it is a door and a window in one frame. Where the door is, the picture tells below the
sill (``balcony_sills``) or, where a front hides that, above its rail (``balcony_posts``); columns
of one width agree on the door's (docs/decisions/0019-what-slabs-hide.md).
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
from si3fp.windows.balcony_sills import WIDTHS_M, sill_of_row, votes_by_sill
from si3fp.windows.measure import BALCONY_DOOR_HEIGHT_M
from si3fp.windows.regular import edges_of

WIDTH_M = (1.35, 3.2)
"""Width of a door with a window in one frame; what is narrower may be a door of two leaves."""
HEIGHT_M = (0.5, 2.4)
"""Height of it, as far as it shows."""
BEST = 2
"""Storeys of a column whose mean counts: those that show the door best."""
LEAST_CONTRAST, CLEARER = 14.0, 2.0
"""How far the door stands out there, at least, and by what factor more than on the other side."""
NEAR_M = 0.2
"""Sides of one column lie no farther apart as they show."""
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
    votes = np.array([votes_by_sill(box, boxes_px, lab, image.valid, step_m) for box in wide])
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
        sill = sill_of_row(edges, edges_m)
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
