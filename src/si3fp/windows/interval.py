"""The 90 % interval of a facade's window-to-wall ratio.

Three things make a ratio uncertain, and each has its term: whether a box is a window (its score is
the probability, boxes under the threshold count with theirs, and some windows have no box at all),
where its sides are (each for itself, and all of a facade together), and what no view saw.
docs/decisions/0011-wwr-interval.md has the formula, and the measurement of every constant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from si3fp.errors import InputError
from si3fp.geometry.boxes import iou_matrix
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Facade, Window

NORMAL_90 = 1.6449
"""Standard deviations to each side that hold 90 % of a normal distribution."""
SAME_IOU = 0.5
"""Overlap from which two boxes are one box; the detector gives no two such."""
LEAST_SEEN = 0.01
"""Below this share of a facade nothing can be said."""


@dataclass(frozen=True, slots=True)
class WwrErrors:
    """How a detector errs over a whole facade, measured on pictures that it was not trained on.

    Attributes
    ----------
    correlation
        Of being a window or not between the boxes of one facade, 0 to 1: what misleads the
        detector once, such as shutters, misleads it again on the same facade.
    missed_mean, missed_sd
        Area of windows that no box tells of, over the facade's area: mean and standard deviation.
    common_sd
        Relative error of area that all windows of a facade share, standard deviation.
    part_sd
        Standard deviation between the ratio of a quarter of a facade and that of its rest.
    """

    correlation: float
    missed_mean: float
    missed_sd: float
    common_sd: float
    part_sd: float


def wwr_interval(
    windows: Sequence[Window],
    candidates: Sequence[Window],
    facade_area_m2: float,
    seen_share: float,
    errors: WwrErrors,
    beyond: Sequence[Window] = (),
) -> tuple[float, float]:
    """Lower and upper end of the 90 % interval of the window-to-wall ratio, within 0 and 1.

    Parameters
    ----------
    windows
        The windows in the part that was seen, detected or inferred; their scores are probabilities.
    candidates
        Boxes under the threshold, with theirs. Those that overlap a window stay in, because it may
        be the false one of the two; those that are the same box do not.
    facade_area_m2
        Gross area, windows included.
    seen_share
        Share of it that any view saw, 0 to 1.
    errors
        The detector's, from its calibration.
    beyond
        Windows inferred where no view saw. They belong to the ratio of the facade, but the unseen
        part is taken to be like the seen one, not like them alone.

    Raises
    ------
    InputError
        If the area is not positive or the share not within 0 and 1.

    Notes
    -----
    The sum of many uncertain areas is near to normal, so two moments are enough. The ratio of
    `windows` and `beyond` alone always lies in the interval.
    """
    if not facade_area_m2 > 0 or not 0 <= seen_share <= 1:
        raise InputError(
            f"The interval of a window-to-wall ratio needs a positive facade area and a share seen "
            f"within 0 and 1, got {facade_area_m2} m2 and {seen_share}."
        )
    if seen_share < LEAST_SEEN:
        return 0.0, 1.0
    point = sum(window.area_m2 for window in (*windows, *beyond)) / facade_area_m2
    seen_m2 = seen_share * facade_area_m2
    others = _without_same(candidates, windows)
    mean_m2, variance_m4 = window_area([*windows, *others], errors)
    mean = mean_m2 / seen_m2 + errors.missed_mean
    unseen_sd = (1 - seen_share) * errors.part_sd
    sd = float(np.sqrt(variance_m4 / seen_m2**2 + errors.missed_sd**2 + unseen_sd**2))
    low, high = mean - NORMAL_90 * sd, mean + NORMAL_90 * sd
    return max(min(low, point), 0.0), min(max(high, point), 1.0)


def joint_interval(facades: Sequence[Facade]) -> tuple[float, float] | None:
    """90 % interval of the ratio over several facades; None where one of them has none.

    The ends are weighed by area, as if all facades erred alike: one detector looked at one building
    in one light, and nothing measured tells how far its facades err apart.
    """
    total_m2 = sum(facade.width_m * facade.height_m for facade in facades)
    low = high = 0.0
    for facade in facades:
        if facade.wwr_interval is None:
            return None
        share = facade.width_m * facade.height_m / total_m2
        low += share * facade.wwr_interval[0]
        high += share * facade.wwr_interval[1]
    return (low, high) if facades else None


def window_area(boxes: Sequence[Window], errors: WwrErrors) -> tuple[float, float]:
    """Mean (m2) and variance (m4) of the total area of the boxes that are windows.

    Notes
    -----
    With areas a, probabilities p, standard deviations s of the areas and correlation r:
    mean sum(p a), variance (1 - r) sum(p (1 - p) a^2) + r sum(a sqrt(p (1 - p)))^2 + sum(p s^2)
    + (common_sd mean)^2. For r = 0 the first terms are those of a Poisson binomial distribution.
    """
    area = np.array([box.area_m2 for box in boxes])
    probability = np.clip([box.score for box in boxes], 0.0, 1.0)
    doubt = area * np.sqrt(probability * (1 - probability))
    mean = float(probability @ area)
    real_or_not = (1 - errors.correlation) * (doubt @ doubt) + errors.correlation * doubt.sum() ** 2
    sides = probability @ _area_variance(boxes)
    return mean, float(real_or_not + sides + (errors.common_sd * mean) ** 2)


def _without_same(candidates: Sequence[Window], windows: Sequence[Window]) -> list[Window]:
    overlap = iou_matrix(_corners(candidates), _corners(windows)).max(axis=1, initial=0.0)
    return [candidates[index] for index in np.flatnonzero(overlap <= SAME_IOU).tolist()]


def _corners(windows: Sequence[Window]) -> FloatArray:
    """(N, 4) left, bottom, right, top."""
    corners = [(w.x_m, w.y_m, w.x_m + w.width_m, w.y_m + w.height_m) for w in windows]
    return np.array(corners).reshape(-1, 4)


def _area_variance(windows: Sequence[Window]) -> FloatArray:
    """(N,) variance of the areas in m4 from that of the four sides."""
    size = np.array([(w.width_m, w.height_m) for w in windows]).reshape(-1, 2)
    sides = np.array([w.edge_sigma_m for w in windows]).reshape(-1, 2, 2)
    variance = (sides**2).sum(axis=2)  # of width and height
    result: FloatArray = variance[:, 0] * size[:, 1] ** 2 + variance[:, 1] * size[:, 0] ** 2
    return result
