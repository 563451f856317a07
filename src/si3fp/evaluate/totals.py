"""Sums of evaluated facades: scores, ratios, quantiles, bands of height, bodies of openings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from si3fp.evaluate.results import Box, FacadeEvaluation, WindowMatch
from si3fp.evaluate.scores import (
    Distribution,
    HeightBand,
    IntervalCoverage,
    Totals,
    WindowScores,
    WwrErrors,
)
from si3fp.geometry.rigid import FloatArray

HEIGHT_BAND_M = 3.0  # decision: about a storey
OPENING_DEPTH_M = 0.5  # decision: as a body, an opening is as deep as a thick wall


def totals(facades: Sequence[FacadeEvaluation]) -> Totals:
    """The metrics over a set of true facades, micro over windows and mean over facades (WWR)."""
    seen = [facade for facade in facades if facade.found_id is not None]
    ratios = [facade.wwr_found for facade in seen if facade.wwr_found is not None]
    imputed = float(np.mean(ratios)) if ratios else None
    matches = [match for facade in seen for match in facade.matches]
    return Totals(
        facade_count=len(facades),
        missing_count=len(facades) - len(seen),
        windows=_summed(seen),
        windows_total=_summed(facades),
        wwr=_wwr_errors(seen, None),
        wwr_total=_wwr_errors(facades, 0.0),
        wwr_imputed=_wwr_errors(facades, imputed),
        opening_iou=_opening_iou(seen),
        opening_iou_total=_opening_iou(facades),
        window_area_errors=distribution([abs(match.relative_area_error) for match in matches]),
        position_errors_m=distribution([match.position_error_m for match in matches]),
        facade_area_errors=distribution(
            [abs(f.relative_area_error) for f in seen if f.relative_area_error is not None]
        ),
        wwr_errors=distribution([f.wwr_error for f in seen if f.wwr_error is not None]),
        by_height=_by_height(facades),
        interval=_coverage(seen),
    )


def scores(matches: Sequence[WindowMatch], found_count: int, true_count: int) -> WindowScores:
    """Precision, recall and mean errors of matched windows among so many found and true ones."""
    hits = len(matches)
    return WindowScores(
        hits,
        found_count - hits,
        true_count - hits,
        ratio(hits, found_count),
        ratio(hits, true_count),
        ratio(2 * hits, found_count + true_count),
        _mean([match.iou for match in matches]),
        _mean([abs(match.relative_area_error) for match in matches]),
        _mean([match.position_error_m for match in matches]),
    )


def ratio(part: float, whole: float) -> float | None:
    """Part over whole, or None where whole is zero."""
    return part / whole if whole else None


def distribution(values: Sequence[float]) -> Distribution:
    """Mean and quantiles of a sample."""
    if not values:
        return Distribution(0, None, None, None, None, None, None, None)
    quantiles = np.quantile(values, [0.0, 0.25, 0.5, 0.75, 0.9, 1.0])
    return Distribution(len(values), float(np.mean(values)), *(float(q) for q in quantiles))


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


def _summed(facades: Sequence[FacadeEvaluation]) -> WindowScores:
    """Micro scores: all windows of all facades in one pot."""
    matches = [match for facade in facades for match in facade.matches]
    wrong = sum(facade.windows.false_positives for facade in facades)
    missed = sum(facade.windows.false_negatives for facade in facades)
    return scores(matches, len(matches) + wrong, len(matches) + missed)


def _wwr_errors(facades: Sequence[FacadeEvaluation], missing_wwr: float | None) -> WwrErrors:
    """Errors over facades; a missing one counts with ``missing_wwr``."""
    found = [missing_wwr if f.wwr_found is None else f.wwr_found for f in facades]
    known = [value for value in found if value is not None]
    if not facades or len(known) < len(facades):
        return WwrErrors(None, None, None)
    errors = np.array(known) - np.array([facade.wwr_truth for facade in facades])
    areas = np.array([facade.area_m2 for facade in facades])
    return WwrErrors(
        float(errors.mean()), float(np.abs(errors).mean()), float(errors @ areas / areas.sum())
    )


def _coverage(seen: Sequence[FacadeEvaluation]) -> IntervalCoverage:
    stated = [(f.wwr_interval, f.wwr_truth) for f in seen if f.wwr_interval is not None]
    # Half a unit of the fifth decimal: files hold ratios rounded to it.
    covered = sum(low - 5e-6 <= truth <= high + 5e-6 for (low, high), truth in stated)
    return IntervalCoverage(
        len(stated),
        covered,
        ratio(covered, len(stated)),
        _mean([high - low for (low, high), _ in stated]),
    )


def _by_height(facades: Sequence[FacadeEvaluation]) -> tuple[HeightBand, ...]:
    """Bands from the foot of the facades to the highest window."""
    kinds = ("true", "found", "true_total", "right_true", "right_found")
    counts: dict[str, dict[int, int]] = {kind: {} for kind in kinds}

    def count(kind: str, box: Box) -> None:
        band = max(0, int((box[1] + box[3]) / 2 // HEIGHT_BAND_M))
        counts[kind][band] = counts[kind].get(band, 0) + 1

    for facade in facades:
        for box in facade.true_boxes_m:
            count("true_total", box)
            if facade.found_id is not None:
                count("true", box)
        for box in facade.found_boxes_m:
            count("found", box)
        for match in facade.matches:
            count("right_true", facade.true_boxes_m[match.truth])
            count("right_found", facade.found_boxes_m[match.found])
    highest = max((band for kind in kinds for band in counts[kind]), default=-1)
    bands = []
    for band in range(highest + 1):
        true, found, true_total, right_true, right_found = (
            counts[kind].get(band, 0) for kind in kinds
        )
        bands.append(
            HeightBand(
                band * HEIGHT_BAND_M,
                (band + 1) * HEIGHT_BAND_M,
                true,
                found,
                true_total,
                right_true,
                right_found,
                ratio(right_found, found),
                ratio(right_true, true),
                ratio(right_true, true_total),
            )
        )
    return tuple(bands)


def _opening_iou(facades: Sequence[FacadeEvaluation]) -> float | None:
    """Shared over united volume of all openings as bodies around their planes."""
    shared = united = 0.0
    for facade in facades:
        both = [*facade.true_boxes_m, *facade.found_boxes_m]
        x_m = np.unique([x for box in both for x in (box[0], box[2])])
        y_m = np.unique([y for box in both for y in (box[1], box[3])])
        cells_m2 = np.outer(np.diff(y_m), np.diff(x_m))
        full = [1.0] * len(both)
        kept = [max(0.0, 1 - abs(z_m) / OPENING_DEPTH_M) for z_m in facade.found_offsets_m]
        true = _cover(facade.true_boxes_m, full, x_m, y_m)
        found = _cover(facade.found_boxes_m, full, x_m, y_m)
        overlap = np.minimum(_cover(facade.found_boxes_m, kept, x_m, y_m), true)
        shared += float((cells_m2 * overlap).sum())
        united += float((cells_m2 * (true + found - overlap)).sum())
    return ratio(shared, united)


def _cover(
    boxes: Sequence[Box], weights: Sequence[float], x_m: FloatArray, y_m: FloatArray
) -> FloatArray:
    """The largest weight of the boxes over every cell between the given lines."""
    covered = np.zeros((max(0, len(y_m) - 1), max(0, len(x_m) - 1)))
    for (left, bottom, right, top), weight in zip(boxes, weights, strict=False):
        columns = slice(*np.searchsorted(x_m, [left, right]))
        rows = slice(*np.searchsorted(y_m, [bottom, top]))
        covered[rows, columns] = np.maximum(covered[rows, columns], weight)
    return covered
