"""What an evaluation reports; plain frozen values."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class WindowMatch:
    """A found window and the true one that it is.

    Attributes
    ----------
    found, truth
        Indices into the two facades' windows.
    iou
        Intersection over union on the true facade's plane.
    relative_area_error
        (found - true) / true area.
    position_error_m
        Distance of the centres on the true facade's plane.
    """

    found: int
    truth: int
    iou: float
    relative_area_error: float
    position_error_m: float


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
class FacadeEvaluation:
    """One true facade and what was found of it.

    Attributes
    ----------
    facade_id, found_id
        Ids of the true facade and of the found one; `found_id` is None where it is missing.
    area_m2
        Gross area of the true facade.
    windows
        Scores of its windows; those of a missing facade are all false negatives.
    matches
        The true positives.
    wwr_truth, wwr_found, wwr_error
        Window-to-wall ratios and found - true; None where the facade is missing.
    """

    facade_id: str
    found_id: str | None
    area_m2: float
    windows: WindowScores
    matches: tuple[WindowMatch, ...]
    wwr_truth: float
    wwr_found: float | None
    wwr_error: float | None


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
class Evaluation:
    """A run against the truth.

    Attributes
    ----------
    facades
        One entry per true facade, in its order.
    extra
        Ids of found facades that the truth does not know; they are not scored.
    windows, wwr
        Over the facades that were found ("standard" in the paper).
    windows_total, wwr_total
        Over all true facades; a missing facade has no windows ("total").
    wwr_imputed
        Over all true facades; a missing one gets the mean ratio of those found ("total imputed").
    """

    facades: tuple[FacadeEvaluation, ...]
    extra: tuple[str, ...]
    windows: WindowScores
    windows_total: WindowScores
    wwr: WwrErrors
    wwr_total: WwrErrors
    wwr_imputed: WwrErrors
