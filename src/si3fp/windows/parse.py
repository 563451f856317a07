"""M.1 for one facade: detect in every view and on the fused image, combine, measure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from si3fp.config import FusionConfig, MeasureConfig
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections, FacadeGrid, FacadeViews, OrthoImage, Window
from si3fp.windows.detect import WindowDetector
from si3fp.windows.fuse import combine, fuse_views
from si3fp.windows.interval import WwrErrors, wwr_interval
from si3fp.windows.join import join_openings
from si3fp.windows.lattice import complete_windows
from si3fp.windows.measure import (
    edges_from_box,
    measure_windows,
    opening_box,
    stands_on_ground,
)
from si3fp.windows.recess import UNKNOWN_RECESS, estimate_recess
from si3fp.windows.refine import refine_boxes
from si3fp.windows.regular import HALF_SEEN, correct_windows, edges_of
from si3fp.windows.seen import share_seen, wall_seen
from si3fp.windows.sharpen import sharpen_windows


@dataclass(frozen=True, slots=True, eq=False)
class ParsedFacade:
    """The windows of a facade and the detections that they come from.

    Attributes
    ----------
    windows
        In metres from the facade's lower left corner.
    per_view
        Detections by view id.
    on_fused
        Detections on the fused image.
    picture
        The fused image with the windows of known recess on the plane of their glass; detections
        and edges come from the fused image itself (docs/decisions/0008-recess.md).
    wwr_interval
        90 % interval of the window-to-wall ratio; None where the detector is not calibrated.
    """

    windows: tuple[Window, ...]
    per_view: Mapping[str, Detections]
    on_fused: Detections
    picture: OrthoImage
    wwr_interval: tuple[float, float] | None


def parse_facade(
    views: FacadeViews,
    fused: OrthoImage,
    cameras_in_facade: Mapping[str, FloatArray],
    detector: WindowDetector,
    fusion: FusionConfig,
    measure: MeasureConfig,
) -> ParsedFacade:
    """The windows of one facade.

    Parameters
    ----------
    views
        Registered views on the facade's grid.
    fused
        Their blend.
    cameras_in_facade
        Optical centres (3,) in the facade frame by view id.
    detector, fusion, measure
        Network and constants.
    """
    grid = views.grid
    best = sorted(views.views, key=lambda view: -view.valid.mean())[: fusion.max_views]
    per_view = {view.source: detector.detect(view, grid.m_per_px) for view in best}
    on_fused = detector.detect(fused, grid.m_per_px)
    agreed = fuse_views(
        {name: of_label(found) for name, found in per_view.items()},
        fusion,
        {view.source: view.valid for view in best},
    )
    threshold = detector.thresholds["window"]
    proposed = combine(agreed, of_label(on_fused), views.views, fusion)
    sure = proposed.detections.scores >= threshold
    together = join_openings(proposed.select(np.flatnonzero(sure)), fused, grid.m_per_px, measure)
    refined = refine_boxes(together, fused, grid.m_per_px, measure)
    balconies = of_label(on_fused, "balcony")
    balconies = balconies.select(balconies.scores >= detector.thresholds["balcony"])
    boxes = refined.detections.boxes_px
    recesses = (UNKNOWN_RECESS,) * len(boxes)
    if measure.measure_recess:
        recesses = estimate_recess(boxes, views.views, cameras_in_facade, grid.m_per_px, measure)
    windows = measure_windows(refined, balconies, grid, cameras_in_facade, measure, recesses)
    weak = proposed.select(np.flatnonzero(~sure))
    candidates = measure_windows(weak, balconies, grid, cameras_in_facade, measure)
    seen = wall_seen(fused, views.views)
    windows = correct_windows(windows, seen, grid, measure)
    entrances = [
        edges
        for edges in (edges_from_box(box, grid) for box in boxes)
        if stands_on_ground(edges, measure)
    ]
    windows = complete_windows(
        windows, candidates, np.array(entrances).reshape(-1, 4), seen, grid, threshold, measure
    )
    openings = [
        opening_box(box, grid, cameras_in_facade, recess, measure)
        for box, recess in zip(boxes, recesses, strict=True)
    ]
    picture = sharpen_windows(fused, views.views, openings, recesses, cameras_in_facade, grid)
    interval = _wwr_interval(windows, candidates, fused, grid, detector.wwr_errors)
    return ParsedFacade(windows, per_view, on_fused, picture, interval)


def _wwr_interval(
    windows: Sequence[Window],
    candidates: Sequence[Window],
    fused: OrthoImage,
    grid: FacadeGrid,
    errors: WwrErrors | None,
) -> tuple[float, float] | None:
    if errors is None:
        return None
    valid = fused.valid.astype(np.float32)
    beyond = [
        window
        for window, edges in zip(windows, edges_of(windows), strict=True)
        if window.origin == "inferred" and share_seen(valid, grid, edges) < HALF_SEEN
    ]
    within = [window for window in windows if window not in beyond]
    area_m2 = grid.width_m * grid.height_m
    return wwr_interval(within, candidates, area_m2, float(valid.mean()), errors, beyond)


def of_label(detections: Detections, label: str = "window") -> Detections:
    """The detections of one label."""
    return detections.select(np.asarray(detections.labels == label))
