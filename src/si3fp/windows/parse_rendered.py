"""M.1 for one facade that was rendered with depth: one image, of which depth tells more."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.config import FusionConfig, MeasureConfig
from si3fp.geometry.boxes import iou_matrix
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections, OrthoImage, Window
from si3fp.windows.balcony import find_balconies
from si3fp.windows.balcony_inferred import doors_of_columns
from si3fp.windows.balcony_openings import complete_doors
from si3fp.windows.bias import render_lever
from si3fp.windows.depth import (
    IN_FRONT_M,
    depth_recesses,
    in_front,
    part_of,
    share_within,
    wall_depth,
)
from si3fp.windows.depth_edges import edges_by_depth
from si3fp.windows.detect import WindowDetector
from si3fp.windows.fuse import FusedDetections
from si3fp.windows.low import detect_with_low
from si3fp.windows.measure import edges_from_box, measure_windows
from si3fp.windows.parse import ParsedFacade, find_windows, interval_of, of_label
from si3fp.windows.recess_estimate import UNKNOWN_RECESS, RecessEstimate, score_by_depth

HALF = 0.5
"""Share of a window that a photo must see to count as a view of it."""
SPECK_M = 0.1
"""Unseen places that are narrower are painted over before windows are looked for."""
MOSTLY = 0.7
"""Share of a box that stands in front of the wall from which it is no window of it; a front hides
the lower half of a door."""


def parse_rendered(
    ortho: OrthoImage,
    cameras_in_facade: Mapping[str, FloatArray],
    seen_from: Mapping[str, NDArray[np.bool_]],
    detector: WindowDetector,
    fusion: FusionConfig,
    measure: MeasureConfig,
    grid: FacadeGrid,
) -> ParsedFacade:
    """The windows of one facade from one render with depth.

    Parameters
    ----------
    ortho
        The render; valid where at least two photos saw, with depth.
    cameras_in_facade
        Optical centres (3,) in the facade frame by photo id.
    seen_from
        By photo id, (h, w) which places it sees; a lattice over the whole grid, as fine or coarser.
    detector, fusion, measure
        Network and constants.
    grid
        Grid of the render.

    Raises
    ------
    InputError
        If the image has no depth.

    Notes
    -----
    The paper's filter of single scores, ``fusion.min_score``, decides what may be a window at all;
    from the detector's own threshold on it is one, between the two where row and column ask for it
    (`si3fp.windows.lattice`). Nothing needs to be found twice: ``fusion.min_views`` counts images
    that were searched, and here the photos agreed before the image was made. The weaker boxes still
    count for the interval of the window-to-wall ratio, whose calibration includes them.
    """
    wall_m = wall_depth(ortho)
    picture = without_specks(ortho, grid.m_per_px)
    found = detect_with_low(detector, picture, grid.m_per_px)
    hides = in_front(ortho, wall_m)
    boxes, left_out = _on_the_wall(of_label(found), hides, grid, fusion)
    openings_px = boxes.boxes_px[boxes.scores >= fusion.min_score]
    deep, told = find_balconies(ortho, openings_px, wall_m, grid.m_per_px)
    balconies = _joined(deep, of_label(found, "balcony"), fusion)
    sure = balconies.scores >= detector.thresholds["balcony"]
    sure[: len(deep)] = True
    # Only a balcony's front hides for sure: a wall without texture may bulge in a render, and
    # nothing must be inferred where it shows.
    shows = ortho.valid.copy()
    for box in deep.boxes_px:
        shows[part_of(box)] &= ~hides[part_of(box)]

    def recess_of(boxes_px: FloatArray) -> Sequence[RecessEstimate]:
        if not measure.measure_recess:
            return (UNKNOWN_RECESS,) * len(boxes_px)
        return depth_recesses(ortho, boxes_px, wall_m, grid.m_per_px, measure)

    def measured(
        these: FusedDetections, recesses: Sequence[RecessEstimate] | None
    ) -> tuple[Window, ...]:
        depths = (UNKNOWN_RECESS,) * len(these.views) if recesses is None else recesses
        if recesses is not None:
            these, depths = _believed(these, recesses, detector.thresholds["window"])
        if measure.refine:
            these = edges_by_depth(these, depths, ortho, grid.m_per_px)
        these = complete_doors(these, deep, shows, grid.m_per_px)
        levers = [
            render_lever(box, recess, ortho, wall_m, _at(views, cameras_in_facade), grid, measure)
            for box, recess, views in zip(
                these.detections.boxes_px, depths, these.views, strict=True
            )
        ]
        return measure_windows(
            these, balconies.select(sure), grid, cameras_in_facade, measure, depths, levers
        )

    openings = find_windows(
        FusedDetections(boxes, tuple(_views(box, seen_from, grid) for box in boxes.boxes_px)),
        picture,
        shows.astype(np.float32),
        grid,
        detector.thresholds["window"],
        measure,
        recess_of,
        measured,
        fusion.min_score,
    )
    windows = doors_of_columns(openings.windows, deep, shows, grid)
    interval = interval_of(replace(openings, windows=windows), ortho, grid, detector.wwr_errors)
    return ParsedFacade(
        windows,
        per_view={},
        on_fused=_together(found.select(found.labels != "balcony"), balconies),
        picture=ortho,
        wwr_interval=interval,
        notes=(*told, *left_out),
    )


def without_specks(ortho: OrthoImage, m_per_px: float) -> OrthoImage:
    """The image with small unseen places painted from around them, to look for windows in.

    What is wider than `SPECK_M` stays unseen.
    """
    side = max(2, round(SPECK_M / m_per_px)) + 1
    kernel = np.ones((side, side), np.uint8)
    border = side
    # A border of seen pixels would close what touches the image's edge.
    padded = cv2.copyMakeBorder(
        ortho.valid.view(np.uint8), border, border, border, border, cv2.BORDER_REPLICATE
    )
    closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, kernel)
    seen = closed[border:-border, border:-border].astype(np.bool_)
    specks = seen & ~ortho.valid
    if not specks.any():
        return ortho
    rgb = cv2.inpaint(ortho.rgb, specks.view(np.uint8), 2, cv2.INPAINT_TELEA)
    return replace(ortho, rgb=np.asarray(rgb, np.uint8), valid=seen)


def _on_the_wall(
    boxes: Detections, hides: NDArray[np.bool_], grid: FacadeGrid, fusion: FusionConfig
) -> tuple[Detections, tuple[str, ...]]:
    """The boxes that do not lie on something in front of the wall, and which were left out."""
    share = np.array([share_within(hides, box) for box in boxes.boxes_px])
    ahead = share > MOSTLY
    notes = []
    for box in boxes.boxes_px[ahead & (boxes.scores >= fusion.min_score)]:
        left, right, bottom, top = edges_from_box(box, grid)
        notes.append(
            f"box of {right - left:.2f} x {top - bottom:.2f} m at x {left:.2f}, y {bottom:.2f} m "
            f"left out: it lies on something more than {IN_FRONT_M} m in front of the wall"
        )
    return boxes.select(~ahead), tuple(notes)


def _believed(
    found: FusedDetections, recesses: Sequence[RecessEstimate], threshold: float
) -> tuple[FusedDetections, Sequence[RecessEstimate]]:
    """The boxes that are windows by picture and depth together, and their recesses."""
    scores = np.array(
        [
            score_by_depth(float(score), recess)
            for score, recess in zip(found.detections.scores, recesses, strict=True)
        ]
    )
    weighed = replace(found, detections=replace(found.detections, scores=scores))
    kept = np.flatnonzero(scores >= threshold)
    return weighed.select(kept), [recesses[index] for index in kept.tolist()]


def _views(
    box_px: FloatArray, seen_from: Mapping[str, NDArray[np.bool_]], grid: FacadeGrid
) -> tuple[str, ...]:
    """Ids of the photos that see at least half of a box."""
    size = np.array([grid.width_px, grid.height_px])
    return tuple(
        sorted(
            name
            for name, seen in seen_from.items()
            if share_within(seen, box_px * np.tile(np.array(seen.shape[::-1]) / size, 2)) >= HALF
        )
    )


def _at(views: Sequence[str], cameras: Mapping[str, FloatArray]) -> list[FloatArray]:
    return [cameras[name] for name in views if name in cameras]


def _joined(deep: Detections, drawn: Detections, fusion: FusionConfig) -> Detections:
    """Balconies by depth, then those that only the detector found."""
    if not len(deep):
        return drawn
    overlap = iou_matrix(drawn.boxes_px, deep.boxes_px).max(axis=1, initial=0.0)
    return _together(deep, drawn.select(overlap <= fusion.group_iou))


def _together(first: Detections, second: Detections) -> Detections:
    return Detections(
        np.concatenate([first.boxes_px, second.boxes_px]),
        np.concatenate([first.scores, second.scores]),
        np.concatenate([first.labels, second.labels]),
        np.concatenate([first.edge_sigma_px, second.edge_sigma_px]),
    )
