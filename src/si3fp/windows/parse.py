"""M.1 for one facade: detect in every view and on the fused image, combine, measure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from si3fp.config import FusionConfig, MeasureConfig
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections, FacadeGrid, FacadeViews, OrthoImage, Window
from si3fp.windows.balcony_columns import BalconyColumn, balcony_columns, covers
from si3fp.windows.balcony_frames import parted, shared_frames
from si3fp.windows.balcony_fronts import hidden_by, hiding_fronts, in_columns
from si3fp.windows.balcony_inferred import doors_of_columns, repeated_doors
from si3fp.windows.balcony_openings import complete_doors, feet_hidden, taken_apart
from si3fp.windows.detect import WindowDetector
from si3fp.windows.entrances import without_entrances
from si3fp.windows.fuse import FusedDetections, combine, fuse_views, views_that_saw
from si3fp.windows.interval import WwrErrors, wwr_interval
from si3fp.windows.join import join_openings
from si3fp.windows.lattice import complete_windows
from si3fp.windows.loggias import find_loggias, moved_back, on_back_walls
from si3fp.windows.low import detect_with_low, of_low
from si3fp.windows.measure import (
    EdgeLever,
    edges_from_box,
    measure_windows,
    opening_box,
    recess_depth,
    recess_lever,
)
from si3fp.windows.recess import estimate_recess
from si3fp.windows.recess_estimate import UNKNOWN_RECESS, RecessEstimate, of_the_others
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
    notes
        What else was decided about the facade, in words.
    """

    windows: tuple[Window, ...]
    per_view: Mapping[str, Detections]
    on_fused: Detections
    picture: OrthoImage
    wwr_interval: tuple[float, float] | None
    notes: tuple[str, ...] = ()


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
    grid, zero = views.grid, np.zeros(4)
    best = sorted(views.views, key=lambda view: -view.valid.mean())[: fusion.max_views]
    per_view = {view.source: detector.detect(view, grid.m_per_px) for view in best}
    on_fused = detect_with_low(detector, fused, grid.m_per_px)
    threshold = detector.thresholds["window"]

    def propose(by_view: Mapping[str, Detections], on_image: Detections) -> FusedDetections:
        windows = {name: of_label(found) for name, found in by_view.items()}
        agreed = fuse_views(windows, fusion, {view.source: view.valid for view in best})
        return combine(agreed, of_label(on_image), views.views, fusion)

    proposed = propose(per_view, on_fused)
    fronts, columns, balconies = _balconies(
        on_fused, _sure(proposed, threshold), detector, cameras_in_facade, grid
    )
    seen = wall_seen(fused, views.views)
    loggias = find_loggias(fronts, columns, views.views, cameras_in_facade, grid, measure)
    image = fused
    if len(loggias.openings_px):
        image, behind = on_back_walls(fused, views.views, loggias, cameras_in_facade, grid)
        seen = np.where(np.isfinite(behind), behind, seen)
        on_fused = detect_with_low(detector, image, grid.m_per_px)
        moved = {
            name: moved_back(found, cameras_in_facade[name], loggias, grid)
            for name, found in per_view.items()
            if name in cameras_in_facade
        }
        proposed = propose(moved, on_fused)
    sure_px = _sure(proposed, threshold)
    frames = shared_frames(sure_px, in_columns(balconies, sure_px), columns, image, grid)
    seen[hidden_by(fronts, seen.shape)] = 0
    shows = seen >= HALF_SEEN

    def recess_of(boxes: FloatArray) -> Sequence[RecessEstimate]:
        if not measure.measure_recess:
            return (UNKNOWN_RECESS,) * len(boxes)
        found = estimate_recess(boxes, views.views, cameras_in_facade, grid.m_per_px, measure)
        hidden = feet_hidden(boxes, shows, grid.m_per_px) & in_columns(fronts, boxes)
        return of_the_others(found, ~hidden & ~loggias.holds(boxes))

    def measured(
        found: FusedDetections, recesses: Sequence[RecessEstimate] | None
    ) -> tuple[Window, ...]:
        found = complete_doors(found, fronts, shows, grid.m_per_px)
        depths_m = [
            recess_depth(recess, measure)
            for recess in recesses or (UNKNOWN_RECESS,) * len(found.views)
        ]
        levers = [
            EdgeLever(lever_of(box, depth_m), zero)
            for box, depth_m in zip(found.detections.boxes_px, depths_m, strict=True)
        ]
        return measure_windows(found, balconies, grid, cameras_in_facade, measure, recesses, levers)

    def lever_of(box_px: FloatArray, depth_m: float) -> FloatArray:
        edges_m = edges_from_box(box_px, grid)
        return of_low(recess_lever(edges_m, list(cameras_of(box_px).values())), edges_m, depth_m)

    def cameras_of(box_px: FloatArray) -> Mapping[str, FloatArray]:
        """The cameras whose views show a window: the blend is made of no others there."""
        names = views_that_saw(box_px, views.views)
        return {name: cameras_in_facade[name] for name in names} or cameras_in_facade

    found = find_windows(proposed, image, seen, grid, threshold, measure, recess_of, measured)
    openings = [
        opening_box(box, grid, cameras_of(box), recess, measure)
        for box, recess in zip(found.boxes_px, found.recesses, strict=True)
    ]
    # What stands in a loggia is sharp already.
    recesses = [
        UNKNOWN_RECESS if inside else recess
        for inside, recess in zip(loggias.holds(found.boxes_px), found.recesses, strict=True)
    ]
    whole = replace(image, valid=fused.valid)
    picture = sharpen_windows(whole, views.views, openings, recesses, cameras_in_facade, grid)
    windows = parted(found.windows, frames)
    windows = doors_of_columns(windows, fronts, shows, grid)
    windows = repeated_doors(windows, fronts, shows, grid, measure)
    found = replace(found, windows=windows)
    interval = interval_of(found, fused, grid, detector.wwr_errors)
    return ParsedFacade(found.windows, per_view, on_fused, picture, interval)


def _sure(proposed: FusedDetections, threshold: float) -> FloatArray:
    """Boxes (N, 4) of what scores at least as much."""
    return proposed.detections.boxes_px[proposed.detections.scores >= threshold]


def _balconies(
    found: Detections,
    openings_px: FloatArray,
    detector: WindowDetector,
    cameras_in_facade: Mapping[str, FloatArray],
    grid: FacadeGrid,
) -> tuple[Detections, tuple[BalconyColumn, ...], Detections]:
    """What balconies hide before openings (N, 4), their columns, and the sure ones."""
    balconies, least = of_label(found, "balcony"), detector.thresholds["balcony"]
    cameras = list(cameras_in_facade.values())
    columns = balcony_columns(balconies, openings_px, least, cameras, grid)
    fronts = hiding_fronts(balconies, openings_px, least, grid.m_per_px)
    sure = balconies.select(np.flatnonzero(balconies.scores >= least))
    return covers(fronts, columns, grid), columns, sure


@dataclass(frozen=True, slots=True, eq=False)
class FoundWindows:
    """The windows of one image and what they come from.

    Attributes
    ----------
    boxes_px, recesses
        (N, 4) sure openings after joining and refining, and the depth of their glass.
    windows
        Measured, corrected and completed.
    candidates
        Measured boxes below the threshold.
    """

    boxes_px: FloatArray
    recesses: tuple[RecessEstimate, ...]
    windows: tuple[Window, ...]
    candidates: tuple[Window, ...]


def find_windows(
    proposed: FusedDetections,
    image: OrthoImage,
    seen: NDArray[np.float32],
    grid: FacadeGrid,
    threshold: float,
    config: MeasureConfig,
    recess_of: Callable[[FloatArray], Sequence[RecessEstimate]],
    measured: Callable[[FusedDetections, Sequence[RecessEstimate] | None], tuple[Window, ...]],
    least_score: float = 0.0,
) -> FoundWindows:
    """The windows among what is proposed on one image, measured, corrected and completed.

    Parameters
    ----------
    proposed
        Boxes of windows with their scores, best first.
    image, grid
        Image on which they lie.
    seen
        (H, W) how sure it is that a pixel shows the wall or what is set into it.
    threshold
        Score from which a box is a window.
    config
        Constants of the measurement.
    recess_of
        Recesses of boxes (N, 4).
    measured
        Windows in metres of boxes and their recesses, None where these are assumed.
    least_score
        What scores less cannot be raised by its row and column.
    """
    sure = proposed.detections.scores >= threshold
    apart = taken_apart(proposed.select(np.flatnonzero(sure)), grid.m_per_px)
    together = join_openings(apart, image, grid.m_per_px, config)
    refined = refine_boxes(together, image, grid.m_per_px, config)
    boxes = refined.detections.boxes_px
    recesses = tuple(recess_of(boxes))
    windows = measured(refined, recesses)
    windows, entrances_m = without_entrances(windows, windows, config)
    weak = measured(proposed.select(np.flatnonzero(~sure)), None)
    candidates, _ = without_entrances(weak, windows, config)
    windows = correct_windows(windows, seen, grid, config)
    raisable = [window for window in candidates if window.score >= least_score]
    windows = complete_windows(windows, raisable, entrances_m, seen, grid, threshold, config)
    return FoundWindows(boxes, recesses, windows, candidates)


def interval_of(
    found: FoundWindows, image: OrthoImage, grid: FacadeGrid, errors: WwrErrors | None
) -> tuple[float, float] | None:
    """90 % interval of the window-to-wall ratio; None where the detector is not calibrated."""
    if errors is None:
        return None
    valid = image.valid.astype(np.float32)
    beyond = [
        window
        for window, edges in zip(found.windows, edges_of(found.windows), strict=True)
        if window.origin == "inferred" and share_seen(valid, grid, edges) < HALF_SEEN
    ]
    within = [window for window in found.windows if window not in beyond]
    area_m2 = grid.width_m * grid.height_m
    return wwr_interval(within, found.candidates, area_m2, float(valid.mean()), errors, beyond)


def of_label(detections: Detections, label: str = "window") -> Detections:
    """The detections of one label."""
    return detections.select(np.asarray(detections.labels == label))
