"""M.1: from boxes in pixels to windows in metres on the wall, the recess corrected.

Glass lies behind the wall plane. A camera below sees its upper edge through the opening at a
lower place of the wall plane, while the lower edge is hidden by the sill, which lies in the wall
plane: seen from below, windows look too low at the top and right at the bottom (METHOD decision
12). The same holds for each side that a camera looks past.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from si3fp.config import MeasureConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections, Window, WindowLabel
from si3fp.ortho import wall_resolution
from si3fp.windows.fuse import FusedDetections
from si3fp.windows.recess_estimate import UNKNOWN_RECESS, RecessEstimate

BALCONY_DOOR_HEIGHT_M = 1.8
MIN_DISTANCE_M = 0.5
"""Cameras nearer to the wall plane tell nothing about it."""
LEAST_SIGMA_PX = 0.5
"""No side is known better than this."""
OUTWARD = np.array([-1.0, 1.0, -1.0, 1.0])
"""Sign of an outward move of the left, right, bottom and top edge."""


@dataclass(frozen=True, slots=True, eq=False)
class EdgeLever:
    """How far the edges of a window appear moved inwards per metre of recess.

    Attributes
    ----------
    per_m, sigma_per_m
        (4,) left, right, bottom and top, and their standard deviations.
    """

    per_m: FloatArray
    sigma_per_m: FloatArray


def measure_windows(
    fused: FusedDetections,
    balconies: Detections,
    grid: FacadeGrid,
    cameras_in_facade: Mapping[str, FloatArray],
    config: MeasureConfig,
    recesses: Sequence[RecessEstimate] | None = None,
    levers: Sequence[EdgeLever] | None = None,
) -> tuple[Window, ...]:
    """Windows in metres from the facade's lower left corner, top row first, left to right.

    Parameters
    ----------
    fused
        Windows in pixels of the grid with the views that saw them.
    balconies
        Balcony boxes on the same grid: what stands behind one and reaches its floor is a door.
    grid
        Grid of the facade.
    cameras_in_facade
        Optical centres (3,) in the facade frame by view id.
    config
        Assumed recess, its uncertainty, smallest window.
    recesses
        Recess of every window; where it is not known, the assumed one is corrected.
    levers
        How the recess moves the edges of every window; without them, as on a blend of views that
        were rectified onto the wall plane.
    """
    cameras = list(cameras_in_facade.values())
    if levers is None:
        edges = [edges_from_box(box_px, grid) for box_px in fused.detections.boxes_px]
        levers = [EdgeLever(recess_lever(each, cameras), np.zeros(4)) for each in edges]
    windows = []
    for box_px, score, told, views, sigma_px, note, recess, lever in zip(
        fused.detections.boxes_px,
        fused.detections.scores,
        fused.detections.labels,
        fused.views,
        fused.detections.edge_sigma_px,
        fused.notes,
        [UNKNOWN_RECESS] * len(fused.views) if recesses is None else recesses,
        levers,
        strict=True,
    ):
        edges_m = edges_from_box(box_px, grid)
        width_m, height_m = edges_m[1] - edges_m[0], edges_m[3] - edges_m[2]
        if min(width_m, height_m) < config.min_size_m:
            continue
        own_m = np.maximum(sigma_px[[0, 2, 3, 1]], LEAST_SIGMA_PX) * grid.m_per_px
        own_m = np.where(sigma_px[[0, 2, 3, 1]] > 0, own_m, config.box_sigma_m)
        recess_sigma_m = config.recess_sigma_m if recess.recess_m is None else recess.sigma_m
        sigma_m = np.hypot(own_m, lever.per_m * recess_sigma_m)
        sigma_m = np.hypot(sigma_m, lever.sigma_per_m * recess_depth(recess, config))
        correction_m = recess_correction(lever.per_m, recess, config)
        left, right, bottom, top = np.clip(
            edges_m + correction_m, 0, [grid.width_m, grid.width_m, grid.height_m, grid.height_m]
        )
        windows.append(
            Window(
                x_m=float(left),
                y_m=float(bottom),
                width_m=float(right - left),
                height_m=float(top - bottom),
                label="balcony_door" if told == "balcony_door" else _label(box_px, balconies, grid),
                score=float(score),
                views=views,
                edge_sigma_m=_four(sigma_m),
                recess_m=None if recess.recess_m is None else round(recess.recess_m, 3),
                correction_m=_four(correction_m),
                evidence=_evidence(len(views), recess, note, config),
            )
        )
    return tuple(sorted(windows, key=lambda w: (-round(w.y_m, 1), w.x_m)))


def edges_from_box(box_px: FloatArray, grid: FacadeGrid) -> FloatArray:
    """Left, right, bottom, top (4,) in metres of a pixel box x0 y0 x1 y1."""
    corners = grid.facade_from_pixels(np.array([[box_px[0], box_px[3]], [box_px[2], box_px[1]]]))
    return np.array([corners[0, 0], corners[1, 0], corners[0, 1], corners[1, 1]])


def opening_box(
    box_px: FloatArray,
    grid: FacadeGrid,
    cameras_in_facade: Mapping[str, FloatArray],
    recess: RecessEstimate,
    config: MeasureConfig,
) -> FloatArray:
    """The pixel box (4,) of an opening as it is, from the box on the fused image."""
    edges_m = edges_from_box(box_px, grid)
    lever = recess_lever(edges_m, list(cameras_in_facade.values()))
    left, right, bottom, top = edges_m + recess_correction(lever, recess, config)
    corners: FloatArray = grid.pixels_from_facade([[left, top], [right, bottom]])
    return corners.reshape(4)


def recess_lever(edges_m: FloatArray, cameras_in_facade: Sequence[FloatArray]) -> FloatArray:
    """How far each edge (4,) appears moved inwards per metre of recess on the fused image.

    A camera that looks at an edge from inside the opening's span sees it through the opening,
    at ``gap / distance`` per metre of recess; from beyond the edge the reveal hides the glass and
    the edge is that of the wall. The cameras weigh by their resolution on the wall: between the
    median that anchors the blend, where all count alike, and its mean, where the best dominates.
    """
    cameras = [camera for camera in cameras_in_facade if camera[2] > MIN_DISTANCE_M]
    if not cameras:
        return np.zeros(4)
    middle = np.array([edges_m[:2].mean(), edges_m[2:].mean()])
    levers, weights = [], []
    for camera in cameras:
        gap = np.clip(OUTWARD * (edges_m - camera[[0, 0, 1, 1]]), 0, None)
        levers.append(gap / camera[2])
        across, up = middle - camera[:2]
        weights.append(float(wall_resolution(across, up, float(camera[2]))))
    lever: FloatArray = np.average(levers, axis=0, weights=weights)
    return lever


def recess_correction(
    lever: FloatArray, recess: RecessEstimate, config: MeasureConfig
) -> FloatArray:
    """What to add to left, right, bottom and top (4,) in metres; 0 where switched off."""
    if not config.correct_recess:
        return np.zeros(4)
    correction: FloatArray = OUTWARD * lever * recess_depth(recess, config)
    return correction


def recess_depth(recess: RecessEstimate, config: MeasureConfig) -> float:
    """The measured or else the assumed recess in metres, never negative."""
    depth_m = config.assumed_recess_m if recess.recess_m is None else recess.recess_m
    return max(depth_m, 0.0)


def _label(box_px: FloatArray, balconies: Detections, grid: FacadeGrid) -> WindowLabel:
    """``balcony_door`` where a tall opening stands behind a balcony that covers its foot."""
    left, top, right, bottom = box_px
    if (bottom - top) * grid.m_per_px < BALCONY_DOOR_HEIGHT_M:
        return "window"
    for b_left, b_top, b_right, b_bottom in balconies.boxes_px:
        covered = min(right, b_right) - max(left, b_left)
        if covered > 0.5 * (right - left) and b_top < bottom < b_bottom + 0.3 / grid.m_per_px:
            return "balcony_door"
    return "window"


def _evidence(views: int, recess: RecessEstimate, note: str, config: MeasureConfig) -> str:
    if recess.recess_m is None:
        depth = f"assumed recess of {config.assumed_recess_m:.2f} m"
    else:
        told_by = recess.told_by or f"parallax of {recess.views} views"
        depth = f"recess of {recess.recess_m:.2f} +- {recess.sigma_m:.2f} m from {told_by}"
    corrected = "corrected" if config.correct_recess else "not corrected"
    seen = f"seen in {views} view{'s' if views != 1 else ''}"
    return "; ".join(part for part in (seen, note, f"{depth} {corrected}") if part)


def _four(values: FloatArray) -> tuple[float, float, float, float]:
    left, right, bottom, top = (round(float(value), 4) for value in values)
    return left, right, bottom, top
