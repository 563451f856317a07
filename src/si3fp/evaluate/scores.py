"""Sums over windows and facades; plain frozen values, None where a denominator is zero."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class WindowScores:
    """Counts and errors over windows; None where a denominator is zero.

    Attributes
    ----------
    true_positives, false_positives, false_negatives
        Counts at IoU > 0.5.
    precision, recall, f1
        In [0, 1].
    mean_iou, mean_abs_relative_area_error, mean_abs_position_error_m
        Over the matched pairs.
    """

    true_positives: int
    false_positives: int
    false_negatives: int
    precision: float | None
    recall: float | None
    f1: float | None
    mean_iou: float | None
    mean_abs_relative_area_error: float | None
    mean_abs_position_error_m: float | None


@dataclass(frozen=True, slots=True)
class WwrErrors:
    """Errors of the window-to-wall ratio, found - true, over facades; None without facades.

    Attributes
    ----------
    mean
        Signed mean, as the paper reports it; errors of opposite sign cancel.
    mean_absolute
        Mean of the magnitudes.
    area_weighted
        Signed mean weighted by the true facades' gross areas: the error of the total glazed area.
    """

    mean: float | None
    mean_absolute: float | None
    area_weighted: float | None


@dataclass(frozen=True, slots=True)
class Distribution:
    """Quantiles of a sample, linearly interpolated; None where it is empty."""

    count: int
    mean: float | None
    minimum: float | None
    lower_quartile: float | None
    median: float | None
    upper_quartile: float | None
    percentile_90: float | None
    maximum: float | None


@dataclass(frozen=True, slots=True)
class HeightBand:
    """Windows whose centres lie between two heights above the foot of the true facade.

    Attributes
    ----------
    from_m, to_m
        The band, half-open.
    true, found
        Windows in the band on facades that were found.
    true_total
        True windows in the band, those of missing facades included.
    right_true, right_found
        Matched windows, by the height of the true and of the found one.
    precision, recall
        right_found / found and right_true / true.
    recall_total
        right_true / true_total.
    """

    from_m: float
    to_m: float
    true: int
    found: int
    true_total: int
    right_true: int
    right_found: int
    precision: float | None
    recall: float | None
    recall_total: float | None


@dataclass(frozen=True, slots=True)
class IntervalCoverage:
    """How often the stated interval of the window-to-wall ratio holds the true one.

    Attributes
    ----------
    facades, covered
        Found facades that state an interval, and those whose true ratio lies in it.
    share
        covered / facades.
    mean_width
        Mean width of the intervals.
    """

    facades: int
    covered: int
    share: float | None
    mean_width: float | None


@dataclass(frozen=True, slots=True)
class Totals:
    """The metrics over a set of true facades.

    Attributes
    ----------
    facade_count, missing_count
        True facades, and those that were not found.
    windows, wwr
        Over the facades that were found ("standard" in the paper).
    windows_total, wwr_total
        Over all true facades; a missing facade has no windows ("total").
    wwr_imputed
        Over all true facades; a missing one gets the mean ratio of those found ("total imputed").
    opening_iou, opening_iou_total
        Intersection over union of all openings as bodies 0.5 m deep, over the facades found and
        over all; it needs no matching.
    window_area_errors, position_errors_m
        Relative (magnitudes) and in metres, over the matched windows.
    facade_area_errors
        Magnitudes of the relative errors of the gross areas, over the facades found.
    wwr_errors
        Signed errors of the facades found.
    by_height
        Bands of 3 m from the foot of the facades upwards.
    interval
        Of the window-to-wall ratio.
    """

    facade_count: int
    missing_count: int
    windows: WindowScores
    windows_total: WindowScores
    wwr: WwrErrors
    wwr_total: WwrErrors
    wwr_imputed: WwrErrors
    opening_iou: float | None
    opening_iou_total: float | None
    window_area_errors: Distribution
    position_errors_m: Distribution
    facade_area_errors: Distribution
    wwr_errors: Distribution
    by_height: tuple[HeightBand, ...]
    interval: IntervalCoverage
