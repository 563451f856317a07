"""Numbers that a facade repeats: noisy values grouped into levels that members share.

The bottoms of a row of windows are one level, and so are the widths of windows of one kind. Every
value is a Gaussian of known standard deviation around its own truth; the truths of one level
scatter by a spread that the data tell. What the others of a level say about one value is a prior
for it (empirical Bayes, Efron and Morris 1975, doi:10.1080/01621459.1975.10479864); what fits no
level gets none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from si3fp.geometry.rigid import FloatArray

ALONE = 0.1
"""Prior probability that a value belongs to no level."""
RANGE_M = 1.0
"""Values that belong to no level are spread evenly over this length around any level."""
GROUP_SPREAD_M = 0.03
"""Spread within a level while levels are sought; afterwards the data tell it."""
LEAST_SPREAD_M = 0.02
"""Nobody builds, and no facade is rectified, more accurately than this."""
MOST_SPREAD_M = 0.2
POOLED_WEIGHT = 4.0
"""Values that the spread of all levels counts for in the spread of one."""
STEPS = 30


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """Which level each of N values shares.

    Attributes
    ----------
    index
        (N,) number of the level, or -1 alone.
    belongs
        (N,) probability of that; 0 alone.
    """

    index: NDArray[np.int_]
    belongs: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """What others say about each of N values.

    Attributes
    ----------
    mean, variance
        (N,) of a Gaussian; the variance is infinite where nobody says anything.
    """

    mean: FloatArray
    variance: FloatArray


def shared_levels(values_m: FloatArray, sigma_m: FloatArray, known: NDArray[np.bool_]) -> Levels:
    """The levels of values (N,) with standard deviations (N,); densest first.

    Parameters
    ----------
    values_m, sigma_m
        Values and their standard deviations.
    known
        (N,) where False, a value belongs to no level.
    """
    index = np.full(len(values_m), -1)
    belongs = np.zeros(len(values_m))
    free = known.copy()
    while free.sum() >= 2:
        at = np.flatnonzero(free)
        at = at[np.lexsort((sigma_m[at], values_m[at]))]
        values, variance = values_m[at], sigma_m[at] ** 2 + GROUP_SPREAD_M**2
        apart = (values[:, None] - values[None]) ** 2 / (variance[:, None] + variance[None])
        seed = int(np.exp(-0.5 * apart).sum(axis=1).round(9).argmax())
        centre, member = values[seed], np.zeros(len(at))
        for _ in range(STEPS):
            near = np.exp(-0.5 * (values - centre) ** 2 / variance) / np.sqrt(2 * np.pi * variance)
            member = (1 - ALONE) * near / ((1 - ALONE) * near + ALONE / RANGE_M)
            centre = np.average(values, weights=np.maximum(member, 1e-12) / variance)
        inside = at[member > 0.5]
        if len(inside) >= 2:
            index[inside] = index.max() + 1
            belongs[inside] = member[member > 0.5]
        free[inside] = False
        free[at[seed]] = False
    return Levels(index, belongs)


def prior_from_others(
    values_m: FloatArray,
    sigma_m: FloatArray,
    levels: Levels,
    related: NDArray[np.bool_] | None = None,
) -> Prior:
    """What the others of its level say about each value (N,).

    Parameters
    ----------
    values_m, sigma_m
        Values and their standard deviations.
    levels
        From `shared_levels`.
    related
        (N, N) where True, the column's value says nothing about the row's, because they already
        met in another way.

    Notes
    -----
    The variance holds the spread of the level, the uncertainty of the others' mean, and the
    doubt whether the value belongs to the level at all.
    """
    count = len(values_m)
    mean, variance = np.zeros(count), np.full(count, np.inf)
    groups = [np.flatnonzero(levels.index == k) for k in range(levels.index.max(initial=-1) + 1)]
    if not groups:
        return Prior(mean, variance)
    pooled = _spread(groups, values_m, sigma_m, levels.belongs)
    for members in groups:
        spread = _spread([members], values_m, sigma_m, levels.belongs, pooled)
        for i in members:
            others = members[members != i]
            if related is not None:
                others = others[~related[i, others]]
            if not len(others):
                continue
            weight = levels.belongs[others] / (sigma_m[others] ** 2 + spread**2)
            mean[i] = np.average(values_m[others], weights=weight)
            variance[i] = (spread**2 + 1 / weight.sum()) / levels.belongs[i]
    return Prior(mean, variance)


def _spread(
    groups: list[NDArray[np.intp]],
    values: FloatArray,
    sigma: FloatArray,
    belongs: FloatArray,
    pooled: float | None = None,
) -> float:
    """Standard deviation of the truths around their levels (Paule and Mandel 1982).

    It makes the weighted squares as large as their degrees of freedom. With ``pooled``, some
    values of that spread are added, so that few values do not decide alone.
    """
    typical = float(np.mean(np.concatenate([sigma[members] for members in groups]) ** 2))

    def too_small(spread: float) -> bool:
        excess = 0.0
        for members in groups:
            total = sigma[members] ** 2 + spread**2
            weight = belongs[members] / total
            centre = np.average(values[members], weights=weight)
            excess += float((weight * (values[members] - centre) ** 2).sum())
            excess -= float(belongs[members].sum()) - 1
        if pooled is not None:
            excess += POOLED_WEIGHT * ((typical + pooled**2) / (typical + spread**2) - 1)
        return excess > 0

    low, high = LEAST_SPREAD_M, MOST_SPREAD_M
    if not too_small(low):
        return low
    for _ in range(STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if too_small(middle) else (low, middle)
    return (low + high) / 2
