"""M.1: what the rows and columns of a facade say about its windows, as probabilities.

Windows of one row share top and bottom, those of one column left and right, those of one kind their
size. Each side is a Gaussian that the others of its row or column, and windows of its size
elsewhere, draw as far as the evidence says (`levels`); what stands off, like a stairwell's
window, shares no level and stays. A side that ends where the wall could not be seen goes on to its
full size. `lattice` adds whole windows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from si3fp.config import MeasureConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Window
from si3fp.windows.levels import Levels, Prior, prior_from_others, shared_levels
from si3fp.windows.measure import OUTWARD
from si3fp.windows.seen import share_seen

LEAST_WINDOWS = 3
"""Fewer show no regularity."""
BESIDE_M = (0.06, 0.26)
"""Where outside a side its surroundings are looked at."""
HALF_SEEN = 0.5
"""Share of a place below which it counts as hidden."""
TOUCH_M = 0.2
"""Boxes of two windows side by side overlap by no more."""
TOLD_M = 0.005
"""Smaller corrections are not worth a word."""
OPPOSITE = (1, 0, 3, 2)
SIDES = ("left", "right", "bottom", "top")


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """The sides of N windows: left, right, bottom, top in metres.

    Attributes
    ----------
    edges_m, sigma_m
        (N, 4) positions and their own standard deviations, without what errs alike in all.
    levels
        Per side, which windows share it.
    """

    edges_m: FloatArray
    sigma_m: FloatArray
    levels: tuple[Levels, ...]


def correct_windows(
    windows: Sequence[Window],
    seen: NDArray[np.float32],
    grid: FacadeGrid,
    config: MeasureConfig,
) -> tuple[Window, ...]:
    """The same windows, hidden parts completed and sides drawn to those of rows and columns.

    Parameters
    ----------
    windows
        From `measure_windows`.
    seen
        (H, W) from `wall_seen`.
    grid
        Grid of the facade.
    config
        Uncertainty of the assumed recess, which is common to all windows.
    """
    if len(windows) < LEAST_WINDOWS:
        return tuple(windows)
    common_m = np.array([_common_sigma(window, config) for window in windows])
    sigma_m = np.array([window.edge_sigma_m for window in windows])
    own_m = np.sqrt(np.maximum(sigma_m**2 - common_m**2, 1e-6))
    edges_m = edges_of(windows)
    hidden = _hidden_sides(edges_m, seen, grid)
    frames = frames_of(edges_m, own_m, ~hidden)
    labels = np.array([window.label for window in windows])
    frames, completed, words = _completed(frames, hidden, labels, seen, grid)
    moved = _drawn(frames, completed)
    limit = np.array([grid.width_m, grid.width_m, grid.height_m, grid.height_m])
    moved = replace(moved, edges_m=np.clip(moved.edges_m, 0, limit))
    return tuple(
        _window(window, edges, np.hypot(own, common), shift, said)
        for window, edges, own, common, shift, said in zip(
            windows,
            moved.edges_m,
            moved.sigma_m,
            common_m,
            np.where(completed, 0, moved.edges_m - edges_m),
            words,
            strict=True,
        )
    )


def edges_of(windows: Sequence[Window]) -> FloatArray:
    """Left, right, bottom and top (N, 4) in metres."""
    return np.array(
        [(w.x_m, w.x_m + w.width_m, w.y_m, w.y_m + w.height_m) for w in windows]
    ).reshape(-1, 4)


def frames_of(edges_m: FloatArray, sigma_m: FloatArray, known: NDArray[np.bool_]) -> Frames:
    """Sides (N, 4) with the levels that those which are known (N, 4) share."""
    levels = tuple(
        shared_levels(edges_m[:, side], sigma_m[:, side], known[:, side]) for side in range(4)
    )
    return Frames(edges_m, sigma_m, levels)


def _common_sigma(window: Window, config: MeasureConfig) -> FloatArray:
    """What an error of the assumed recess does to each side (4,): the same in all windows."""
    if window.recess_m is not None or config.assumed_recess_m <= 0:
        return np.zeros(4)
    lever = np.abs(np.array(window.correction_m)) / config.assumed_recess_m
    common: FloatArray = np.minimum(lever * config.recess_sigma_m, window.edge_sigma_m)
    return common


def _hidden_sides(
    edges_m: FloatArray, seen: NDArray[np.float32], grid: FacadeGrid
) -> NDArray[np.bool_]:
    """(N, 4) whether the wall right outside a side was not seen: the window may go on there."""
    hidden = np.zeros(edges_m.shape, bool)
    for i, edges in enumerate(edges_m):
        for side in range(4):
            strip = edges.copy()
            across = slice(2, 4) if side < 2 else slice(0, 2)
            strip[across] += np.array([0.15, -0.15]) * (edges[across][1] - edges[across][0])
            near, far = edges[side] + OUTWARD[side] * np.array(BESIDE_M)
            strip[[side, OPPOSITE[side]]] = far, near
            hidden[i, side] = share_seen(seen, grid, strip) < HALF_SEEN
    return hidden


def _completed(
    frames: Frames,
    hidden: NDArray[np.bool_],
    labels: NDArray[np.str_],
    seen: NDArray[np.float32],
    grid: FacadeGrid,
) -> tuple[Frames, NDArray[np.bool_], list[str]]:
    """Windows that go on behind what hides them, (N, 4) which sides moved, and words about it.

    The size comes from windows that share the opposite side, or else from those of its row (its
    column); most of them must agree. Doors do not tell the size of a window,
    nor windows the width of a door.
    """
    edges, sigma = frames.edges_m.copy(), frames.sigma_m.copy()
    completed = np.zeros(edges.shape, bool)
    words = [""] * len(edges)
    for i, side in np.argwhere(hidden & ~hidden[:, OPPOSITE]).tolist():
        opposite = OPPOSITE[side]
        across = (2, 3) if side < 2 else (0, 1)
        whole = ~hidden[:, side] & ~hidden[:, opposite]
        if side < 2 or labels[i] == "window":
            whole &= labels == labels[i]
        aligned = whole & _together(frames.levels[opposite], i)
        if aligned.sum() < 2:
            aligned |= whole & _together(frames.levels[across[0]], i)
            aligned |= whole & _together(frames.levels[across[1]], i)
        sizes = np.abs(frames.edges_m[aligned, side] - frames.edges_m[aligned, opposite])
        spread = np.hypot(frames.sigma_m[aligned, side], frames.sigma_m[aligned, opposite])
        shared = shared_levels(sizes, spread, np.ones(len(sizes), bool)).index
        if not (shared == 0).any():
            continue
        agreeing = shared == 0
        probability = (agreeing.sum() + 1) / (len(sizes) + 2)
        size_m = float(sizes[agreeing].mean())
        full = edges[i, opposite] + OUTWARD[side] * size_m
        rest = edges[i].copy()
        rest[[side, opposite]] = full, edges[i, side]
        grows = OUTWARD[side] * (full - edges[i, side]) > BESIDE_M[0]
        grows &= not _meets_another(rest, frames.edges_m, i)
        if not grows or probability <= HALF_SEEN or share_seen(seen, grid, rest) > HALF_SEEN:
            continue
        edges[i, side] = full
        sigma[i, side] = np.hypot(sigma[i, opposite], spread[agreeing].mean())
        completed[i, side] = True
        words[i] += (
            f"; {SIDES[side]} hidden, completed to the size of {agreeing.sum()} others "
            f"(probability {probability:.2f})"
        )
    return replace(frames, edges_m=edges, sigma_m=sigma), completed, words


def _meets_another(part: FloatArray, edges: FloatArray, i: int) -> bool:
    """Whether a part (4,) of window i lies on another of the windows (N, 4), not just at it."""
    low = [np.maximum(part[k : k + 2].min(), edges[:, k]) for k in (0, 2)]
    high = [np.minimum(part[k : k + 2].max(), edges[:, k + 1]) for k in (0, 2)]
    common = np.min(np.subtract(high, low), axis=0)
    common[i] = 0
    return bool((common > TOUCH_M).any())


def _together(levels: Levels, i: int) -> NDArray[np.bool_]:
    """(N,) whether others share the level of value i."""
    together: NDArray[np.bool_] = (levels.index == levels.index[i]) & (levels.index >= 0)
    together[i] = False
    return together


def _drawn(frames: Frames, fixed: NDArray[np.bool_]) -> Frames:
    """Posterior mean and standard deviation of all sides; fixed ones (N, 4) say nothing."""
    edges, sigma = frames.edges_m.copy(), frames.sigma_m.copy()
    for low, high in ((0, 1), (2, 3)):
        ends = [
            prior_from_others(frames.edges_m[:, side], frames.sigma_m[:, side], frames.levels[side])
            for side in (low, high)
        ]
        sizes = frames.edges_m[:, high] - frames.edges_m[:, low]
        size_sigma = np.hypot(frames.sigma_m[:, low], frames.sigma_m[:, high])
        whole = ~fixed[:, low] & ~fixed[:, high]
        # Those of the same row or column are heard through their sides already.
        related = _same(frames.levels[low]) | _same(frames.levels[high])
        size = prior_from_others(
            sizes, size_sigma, shared_levels(sizes, size_sigma, whole), related
        )
        for i in np.flatnonzero(whole).tolist():
            edges[i, [low, high]], sigma[i, [low, high]] = _posterior(
                frames.edges_m[i, [low, high]],
                frames.sigma_m[i, [low, high]],
                (ends[0], ends[1]),
                size,
                i,
            )
    return replace(frames, edges_m=edges, sigma_m=sigma)


def _same(levels: Levels) -> NDArray[np.bool_]:
    same: NDArray[np.bool_] = (levels.index[:, None] == levels.index[None]) & (
        levels.index[:, None] >= 0
    )
    return same


def _posterior(
    ends_m: FloatArray, sigma_m: FloatArray, priors: tuple[Prior, Prior], size: Prior, i: int
) -> tuple[FloatArray, FloatArray]:
    """Mean and standard deviation (2,) of the two ends of one window in one direction."""
    precision = np.diag(
        [1 / s**2 + 1 / p.variance[i] for s, p in zip(sigma_m, priors, strict=True)]
    )
    right = np.array(
        [
            x / s**2 + p.mean[i] / p.variance[i]
            for x, s, p in zip(ends_m, sigma_m, priors, strict=True)
        ]
    )
    precision += np.array([[1.0, -1.0], [-1.0, 1.0]]) / size.variance[i]
    right += np.array([-1.0, 1.0]) * size.mean[i] / size.variance[i]
    covariance = np.linalg.inv(precision)
    return covariance @ right, np.sqrt(np.diag(covariance))


def _window(
    window: Window, edges_m: FloatArray, sigma_m: FloatArray, shift_m: FloatArray, said: str
) -> Window:
    left, right, bottom, top = (float(value) for value in edges_m)
    furthest = float(np.abs(shift_m).max())
    if furthest > TOLD_M:
        said += f"; sides drawn to its row and column by up to {furthest:.2f} m"
    one, two, three, four = (round(float(value), 4) for value in sigma_m)
    return replace(
        window,
        x_m=left,
        y_m=bottom,
        width_m=right - left,
        height_m=top - bottom,
        edge_sigma_m=(one, two, three, four),
        evidence=window.evidence + said,
    )
