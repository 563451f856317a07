"""M.1: doors of balconies that nobody saw: of windows that were inferred, and of other storeys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from si3fp.config import MeasureConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections, Window
from si3fp.windows.balcony_openings import (
    DOOR_WIDTH_M,
    HALF,
    HIGHEST_DOOR_M,
    NEAR_M,
    SAME_M,
    door_foot,
    in_column,
    openings_behind,
)
from si3fp.windows.depth import share_within
from si3fp.windows.levels import shared_levels
from si3fp.windows.measure import BALCONY_DOOR_HEIGHT_M
from si3fp.windows.regular import edges_of

CLEAR_IOU = 0.02
"""What overlaps more with another window is not added."""
LEAST_HEADS = 2
"""Windows of a storey that tell where its heads are."""


def doors_of_columns(
    windows: Sequence[Window],
    fronts: Detections,
    wall_seen: NDArray[np.bool_],
    grid: FacadeGrid,
) -> tuple[Window, ...]:
    """The same windows; what was added behind a front as a window is its door, down to the floor.

    Parameters
    ----------
    windows
        All windows of the facade.
    fronts, wall_seen
        As in `complete_doors`.
    grid
        Grid of the facade.

    Notes
    -----
    Rows and columns add windows with the sills of a row. In a column of doors they are doors, and
    so is an inferred one alone above a balcony, but not in a column of windows that show.
    """
    boxes = _pixels(windows, grid)
    doors = boxes[[_is_door(window) for window in windows]].reshape(-1, 4)
    told = [window.label == "window" and window.origin == "detected" for window in windows]
    result = list(windows)
    for front, sigma in zip(fronts.boxes_px, fronts.edge_sigma_px, strict=True):
        behind = openings_behind(front, boxes, wall_seen, grid.m_per_px).tolist()
        for i in behind:
            window = windows[i]
            alone = len(behind) == 1 and window.origin == "inferred"
            alone &= not in_column(boxes[i], boxes[told], grid.m_per_px).any()
            if not alone and not in_column(boxes[i], doors, grid.m_per_px).any():
                continue
            foot, foot_sigma = door_foot(front[3], sigma[3], boxes[i, 1], grid.m_per_px)
            foot_m = float(grid.facade_from_pixels([front[0], foot])[1])
            whole = window.label == "balcony_door" and window.origin == "detected"
            if foot_m < window.y_m and not whole:
                left, right, _, top = window.edge_sigma_m
                result[i] = replace(
                    window,
                    y_m=foot_m,
                    height_m=window.y_m + window.height_m - foot_m,
                    label="balcony_door",
                    edge_sigma_m=(left, right, round(foot_sigma * grid.m_per_px, 4), top),
                    evidence=f"{window.evidence}; the door of a balcony, completed to its floor",
                )
    return tuple(result)


def _is_door(window: Window) -> bool:
    """Whether it is a balcony's door alone; a wider one may hold the window beside it too."""
    return window.label == "balcony_door" and window.width_m < DOOR_WIDTH_M + SAME_M


def _pixels(windows: Sequence[Window], grid: FacadeGrid) -> FloatArray:
    """Boxes (N, 4) of windows in pixels."""
    edges_m = edges_of(windows)
    corners = [grid.pixels_from_facade(edges_m[:, side]) for side in ([0, 3], [1, 2])]
    return np.concatenate(corners, axis=1)


def repeated_doors(
    windows: Sequence[Window],
    fronts: Detections,
    wall_seen: NDArray[np.bool_],
    grid: FacadeGrid,
    config: MeasureConfig,
) -> tuple[Window, ...]:
    """The windows with a door behind every front whose column has it on other storeys.

    Parameters
    ----------
    windows
        All windows of the facade.
    fronts, wall_seen
        As in `complete_doors`.
    grid
        Grid of the facade.
    config
        Least probability of a window that is added; whether to infer at all.

    Notes
    -----
    Its sides are those of the column, its head that of the other windows of the storey. The
    probability is Laplace's rule: the doors of the column among the storeys whose balcony was seen
    to have one or to have none.
    """
    result = list(windows)
    doors = [window for window in windows if _is_door(window)]
    if not config.infer or not doors:
        return tuple(result)
    columns = shared_levels(
        np.array([door.x_m + door.width_m / 2 for door in doors]),
        np.full(len(doors), SAME_M / 2),
        np.ones(len(doors), bool),
    ).index
    for number in range(columns.max() + 1):
        column = [door for door, at in zip(doors, columns, strict=True) if at == number]
        result += _missing_doors(column, result, fronts, wall_seen, grid, config)
    return tuple(sorted(result, key=lambda w: (-round(w.y_m, 1), w.x_m)))


def _missing_doors(
    column: Sequence[Window],
    windows: Sequence[Window],
    fronts: Detections,
    wall_seen: NDArray[np.bool_],
    grid: FacadeGrid,
    config: MeasureConfig,
) -> list[Window]:
    """The doors of a column that the fronts before it hide altogether."""
    left, right = np.median(edges_of(column)[:, :2], axis=0).tolist()
    height_m = float(np.median([door.height_m for door in column]))
    edges_m = edges_of(windows)
    hidden: list[float] = []
    without = 0
    for box in fronts.boxes_px:
        (x0, base), (x1, _) = grid.facade_from_pixels(np.array([[box[0], box[3]], box[[2, 1]]]))
        if not x0 < (left + right) / 2 < x1:
            continue
        heads_m = edges_m[:, 3] - base
        storey = (heads_m > BALCONY_DOOR_HEIGHT_M - NEAR_M) & (heads_m < HIGHEST_DOOR_M)
        beside = storey & (edges_m[:, 0] < right) & (edges_m[:, 1] > left)
        tops = edges_m[storey, 3]
        levels = shared_levels(tops, np.full(len(tops), 0.05), np.ones(len(tops), bool)).index
        if any(windows[i] in column for i in np.flatnonzero(beside).tolist()):
            continue
        if beside.any():
            without += 1
        elif (levels == 0).sum() >= LEAST_HEADS:
            head = float(tops[levels == 0].mean())
            corners = grid.pixels_from_facade([[left, head], [right, head - height_m]])
            if share_within(wall_seen, corners.reshape(4)) < HALF:
                hidden.append(head)
            else:
                without += 1
    probability = (len(column) + 1) / (len(column) + without + 2)
    if probability < config.min_completed:
        return []
    sigma = np.median([door.edge_sigma_m for door in column], axis=0).round(4).tolist()
    return [
        Window(
            x_m=left,
            y_m=head - height_m,
            width_m=right - left,
            height_m=height_m,
            label="balcony_door",
            score=probability,
            origin="inferred",
            edge_sigma_m=tuple(sigma),
            evidence=f"not detected; hidden by a balcony like those of {len(column)} doors of its "
            f"column (probability {probability:.2f})",
        )
        for head in hidden
    ]
