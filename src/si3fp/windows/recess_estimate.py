"""M.1: the depth of a window's glass as it is known, and what windows of one kind tell of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from si3fp.geometry.rigid import FloatArray

ALIKE = 0.25
"""Windows whose log width and log height differ by less are of one kind."""

WINDOW_RECESS_M, WINDOW_SPREAD_M = 0.15, 0.10
"""Depth of the glass of windows: mean and standard deviation, flush windows included."""
FLUSH_SPREAD_M = 0.05
"""What is painted on a wall or hangs on it lies in its plane, give or take this."""
LEAST_OTHERS, LEAST_SPREAD_M = 3, 0.03
"""So many windows tell the depth of another, and scatter no less."""


@dataclass(frozen=True, slots=True)
class RecessEstimate:
    """Depth of the glass of one window.

    Attributes
    ----------
    recess_m
        Depth behind the wall around the window, or None where it cannot be told.
    sigma_m
        Its standard deviation; 0 where it cannot be told.
    glass_m
        Depth behind the facade plane at which the views agree on the inside of the window.
    views
        Number of views compared.
    told_by
        What told it, if not the parallax of the views.
    """

    recess_m: float | None
    sigma_m: float
    glass_m: float
    views: int
    told_by: str = ""


UNKNOWN_RECESS = RecessEstimate(None, 0.0, 0.0, 0)


def drawn_to_kind(
    kind_m: float, told_m: FloatArray, own_m: float | None, sigma_m: float, floor_m: float
) -> tuple[float, float]:
    """Depth of one window and its standard deviation, drawn towards its kind.

    Parameters
    ----------
    kind_m, told_m
        Depth of its kind, and the depths (N,) that windows of this kind tell by themselves.
    own_m, sigma_m
        What the window itself tells, or None, and its standard deviation.
    floor_m
        Systematic error: neither spread nor result is known better.

    Notes
    -----
    A normal prior with the kind's depth and the spread of what its windows tell.
    """
    spread_m = 1.4826 * float(np.median(np.abs(told_m - kind_m))) if len(told_m) else 0.0
    spread_m = max(spread_m, floor_m)
    share = 0.0 if own_m is None else spread_m**2 / (spread_m**2 + sigma_m**2)
    value_m = kind_m + share * ((kind_m if own_m is None else own_m) - kind_m)
    left_m = np.hypot(spread_m * np.sqrt(1 - share), floor_m)
    return value_m, float(left_m)


def of_the_others(
    estimates: Sequence[RecessEstimate], stands_free: NDArray[np.bool_]
) -> tuple[RecessEstimate, ...]:
    """The recesses; windows that do not stand free have that of the facade's other windows.

    The front of a balcony passes for the wall in the ring around a window that is compared, and so
    does the window on the other side of a door's jamb.

    Parameters
    ----------
    estimates
        Recess of every window.
    stands_free
        (N,) whether the wall around each was seen.
    """
    told = [
        one.recess_m
        for one, free in zip(estimates, stands_free, strict=True)
        if free and one.recess_m is not None
    ]
    if len(told) < LEAST_OTHERS:
        return tuple(estimates)
    usual_m = float(np.median(told))
    spread_m = max(1.4826 * float(np.median(np.abs(np.array(told) - usual_m))), LEAST_SPREAD_M)
    return tuple(
        one
        if free
        else replace(one, recess_m=usual_m, sigma_m=spread_m, told_by=f"{len(told)} other windows")
        for one, free in zip(estimates, stands_free, strict=True)
    )


def score_by_depth(score: float, recess: RecessEstimate) -> float:
    """The probability of a window after its depth: a panel or a capital lies in the wall's plane.

    Depth only speaks against a window: doors, niches and shadows lie as deep as one.

    Parameters
    ----------
    score
        Probability by the picture.
    recess
        Depth of the glass; without one the score stays.

    Notes
    -----
    Bayes' rule with normal densities of the depth of windows and of what is none.
    """
    if recess.recess_m is None:
        return score
    window = np.hypot(WINDOW_SPREAD_M, recess.sigma_m)
    flush = np.hypot(FLUSH_SPREAD_M, recess.sigma_m)
    log_odds = (
        0.5 * (recess.recess_m / flush) ** 2
        - 0.5 * ((recess.recess_m - WINDOW_RECESS_M) / window) ** 2
        + np.log(flush / window)
    )
    odds = float(np.exp(min(log_odds, 0.0)))
    return score * odds / (score * odds + 1 - score)
