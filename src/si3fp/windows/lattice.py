"""M.1: windows that rows and columns want where the detector saw little or nothing.

Rows are windows that share bottom and top, columns such that share left and right. Where a row
crosses a column and there is no window, a prior (how complete row and column are) meets a
likelihood (what the detector said there, and whether it could see the place).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from si3fp.config import MeasureConfig
from si3fp.geometry.boxes import iou_matrix
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Window
from si3fp.windows.levels import Levels
from si3fp.windows.regular import HALF_SEEN, LEAST_WINDOWS, Frames, edges_of, frames_of
from si3fp.windows.seen import share_seen

MISSED = 0.02
"""Probability that the detector gives a window that it fully sees no score at all."""
MOST_REGULAR = 0.9
"""No row and column tell more: facades have blind bays."""
MOST_REGULAR_BELOW = 0.75
"""Nor in the lowest row, where entrances take the place of windows."""
ENTRANCE_M = 1.0
"""What starts less than this above the lowest cell may be an entrance."""
SAME_PLACE_IOU = 0.4
"""Overlap from which a weak detection speaks for a cell."""
CLEARANCE_M = 0.05
"""Two windows are at least so far apart."""


@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """A place of the lattice: row and column number, box, and what is known of it.

    Attributes
    ----------
    row, column
        Numbers.
    edges_m
        (4,) left, right, bottom, top.
    seen
        Share of it that was seen.
    taken, blocked
        A window of both row and column is there; something else is.
    """

    row: int
    column: int
    edges_m: FloatArray
    seen: float
    taken: bool
    blocked: bool


def complete_windows(
    windows: Sequence[Window],
    candidates: Sequence[Window],
    occupied_m: FloatArray,
    seen: NDArray[np.float32],
    grid: FacadeGrid,
    threshold: float,
    config: MeasureConfig,
) -> tuple[Window, ...]:
    """The windows with those that the lattice adds, top row first, left to right.

    Parameters
    ----------
    windows
        From `correct_windows`.
    candidates
        Detections below the threshold, measured alike, scores as probabilities.
    occupied_m
        (M, 4) left, right, bottom, top of what is no window but was detected: doors, gates.
    seen
        (H, W) from `wall_seen`.
    grid
        Grid of the facade.
    threshold
        Recommended score of the detector.
    config
        Least probability of a window that the lattice adds; whether to infer at all.

    Notes
    -----
    What was detected weakly and fits stays ``detected``; what nothing was detected of is
    ``inferred``. A place that was well seen and where the detector was silent stays wall.
    """
    if len(windows) < LEAST_WINDOWS:
        return tuple(windows)
    edges_m = edges_of(windows)
    sigma_m = np.array([window.edge_sigma_m for window in windows])
    frames = frames_of(edges_m, sigma_m, np.ones(edges_m.shape, bool))
    rows = _lines(frames.levels[2], frames.levels[3])
    columns = _lines(frames.levels[0], frames.levels[1])
    cells = _cells(rows, columns, frames, occupied_m, seen, grid)
    prior = _Regularity(cells)
    candidate_m = edges_of(candidates)
    added: list[tuple[float, Window]] = []
    for cell in cells:
        if cell.taken or cell.blocked:
            continue
        expected = prior.probability(cell)
        near = iou_matrix(_corners(cell.edges_m[None]), _corners(candidate_m))[0]
        # Silence is certain where there is no window, and where there is one but hidden.
        silence = 1 - (1 - MISSED) * cell.seen
        if (near >= SAME_PLACE_IOU).any():
            best = int(
                np.argmax(np.where(near >= SAME_PLACE_IOU, [c.score for c in candidates], 0))
            )
            weak = candidates[best]
            told = weak.score / (1 - min(weak.score, 0.999))
            # Where little of it was seen, a weak score says no more against it than none.
            if told >= silence or not config.infer:
                sure = _updated(expected, told)
                if sure >= max(threshold, config.min_completed):
                    added.append((sure, _raised(weak, sure, prior.words(cell))))
                continue
        sure = _updated(expected, silence)
        if config.infer and sure >= config.min_completed:
            mates = np.flatnonzero((rows == cell.row) | (columns == cell.column))
            added.append((sure, _inferred(cell, windows, mates, sure, prior.words(cell))))
    chosen = list(windows)
    for _, window in sorted(added, key=lambda each: -each[0]):
        if not _touches(edges_of([window]), edges_of(chosen))[0].any():
            chosen.append(window)
    return tuple(sorted(chosen, key=lambda w: (-round(w.y_m, 1), w.x_m)))


def _lines(first: Levels, second: Levels) -> NDArray[np.int_]:
    """(N,) number of the row or column of each window; what shares not both sides is alone."""
    both = np.stack([first.index, second.index], axis=1)
    alone = (both < 0).any(axis=1)
    both[alone] = np.stack([-1 - np.flatnonzero(alone)] * 2, axis=1)
    number: NDArray[np.int_] = np.unique(both, axis=0, return_inverse=True)[1].ravel()
    return number


def _cells(
    rows: NDArray[np.int_],
    columns: NDArray[np.int_],
    frames: Frames,
    occupied_m: FloatArray,
    seen: NDArray[np.float32],
    grid: FacadeGrid,
) -> list[Cell]:
    """Where every row of two windows or more crosses every column with a window in such a row."""
    found = []
    in_rows = np.bincount(rows)[rows] >= 2
    for row in range(rows.max(initial=-1) + 1):
        for column in range(columns.max(initial=-1) + 1):
            in_row, in_column = rows == row, columns == column
            box = np.concatenate(
                [
                    np.median(frames.edges_m[in_column, :2], axis=0),
                    np.median(frames.edges_m[in_row, 2:], axis=0),
                ]
            )
            if not ((in_row & in_rows).any() and (in_column & in_rows).any()):
                continue
            if not _inside(box, grid):
                continue
            touched = _touches(box[None], frames.edges_m)[0]
            taken = bool((in_row & in_column).any())
            blocked = bool(touched.any()) or bool(_touches(box[None], occupied_m).any())
            found.append(
                Cell(row, column, box, share_seen(seen, grid, box), taken, blocked and not taken)
            )
    return found


def _inside(box: FloatArray, grid: FacadeGrid) -> bool:
    return bool(box[0] >= 0 and box[2] >= 0 and box[1] <= grid.width_m and box[3] <= grid.height_m)


def _touches(first: FloatArray, second: FloatArray) -> NDArray[np.bool_]:
    """(N, M) whether boxes left, right, bottom, top come nearer than two windows do."""
    one, other = first[:, None], second.reshape(-1, 4)[None]
    apart: NDArray[np.bool_] = (
        (one[..., 0] >= other[..., 1] + CLEARANCE_M)
        | (one[..., 1] <= other[..., 0] - CLEARANCE_M)
        | (one[..., 2] >= other[..., 3] + CLEARANCE_M)
        | (one[..., 3] <= other[..., 2] - CLEARANCE_M)
    )
    return ~apart


class _Regularity:
    """How complete the row and the column of a cell are, of the places that could be seen."""

    def __init__(self, cells: Sequence[Cell]) -> None:
        self._entrances_m = min((c.edges_m[2] for c in cells), default=0.0) + ENTRANCE_M
        self._told = [c for c in cells if c.taken or (not c.blocked and c.seen >= HALF_SEEN)]

    def probability(self, cell: Cell) -> float:
        """Prior probability of a window in a cell that says nothing itself.

        Row and column count as two witnesses with even odds before (Laplace's rule for each).
        """
        odds = 1.0
        for full, among in self._counts(cell):
            odds *= (full + 1) / (among - full + 1)
        below = cell.edges_m[2] < self._entrances_m
        return min(odds / (1 + odds), MOST_REGULAR_BELOW if below else MOST_REGULAR)

    def words(self, cell: Cell) -> str:
        """The counts that the prior rests on."""
        (in_row, row), (in_column, column) = self._counts(cell)
        return f"{in_row} of {row} places of its row and {in_column} of {column} of its column"

    def _counts(self, cell: Cell) -> tuple[tuple[int, int], tuple[int, int]]:
        """Full and all other cells of the row and of the column."""
        row = [c.taken for c in self._told if c.row == cell.row and c is not cell]
        column = [c.taken for c in self._told if c.column == cell.column and c is not cell]
        return (sum(row), len(row)), (sum(column), len(column))


def _updated(probability: float, ratio: float) -> float:
    odds = probability / (1 - probability) * ratio
    return odds / (1 + odds)


def _corners(edges_m: FloatArray) -> FloatArray:
    """Boxes x0 y0 x1 y1 of left, right, bottom, top."""
    return edges_m[:, [0, 2, 1, 3]]


def _raised(window: Window, probability: float, words: str) -> Window:
    return replace(
        window,
        score=probability,
        evidence=f"{window.evidence}; score {window.score:.2f} raised: {words} are windows",
    )


def _inferred(
    cell: Cell,
    windows: Sequence[Window],
    mates: NDArray[np.intp],
    probability: float,
    words: str,
) -> Window:
    left, right, bottom, top = (float(value) for value in cell.edges_m)
    labels = [windows[i].label for i in mates]
    one, two, three, four = np.median([windows[i].edge_sigma_m for i in mates], axis=0).round(4)
    return Window(
        x_m=left,
        y_m=bottom,
        width_m=right - left,
        height_m=top - bottom,
        label=max(sorted(set(labels)), key=labels.count),
        score=probability,
        origin="inferred",
        edge_sigma_m=(float(one), float(two), float(three), float(four)),
        evidence=(
            f"not detected; {words} are windows, {cell.seen:.0%} of the place was seen "
            f"(probability {probability:.2f})"
        ),
    )
