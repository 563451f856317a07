"""The energy view: heating demand of the found model against that of the true one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from si3fp.evaluate.totals import ratio

ALL = "all"


@dataclass(frozen=True, slots=True)
class HeatingErrors:
    """Heat that one building, or all together, needs in a year, in both models.

    Attributes
    ----------
    id
        The building, or ``all``.
    found_kwh, true_kwh
        Useful heat in a year.
    found_kwh_m2, true_kwh_m2
        Per gross floor area of each model; None without floors.
    relative_error, relative_error_per_area
        (found - true) / true of both; None where nothing is needed.
    """

    id: str
    found_kwh: float
    true_kwh: float
    found_kwh_m2: float | None
    true_kwh_m2: float | None
    relative_error: float | None
    relative_error_per_area: float | None


def compare_heating(
    found: Mapping[str, tuple[float, float]], truth: Mapping[str, tuple[float, float]]
) -> tuple[HeatingErrors, ...]:
    """All buildings in one row, then a row for each that both models name.

    Where they share names, buildings that only one of them has are left out of the sum.

    Parameters
    ----------
    found, truth
        Demand in kWh a year and gross floor area in m2, by building.
    """
    common = [name for name in truth if name in found]
    sums = [
        [sum(model[name][i] for name in (common or model)) for i in (0, 1)]
        for model in (found, truth)
    ]
    rows = [_errors(ALL, (sums[0][0], sums[0][1]), (sums[1][0], sums[1][1]))]
    if len(truth) > 1:
        rows += [_errors(name, found[name], truth[name]) for name in common]
    return tuple(rows)


def _errors(name: str, found: tuple[float, float], truth: tuple[float, float]) -> HeatingErrors:
    found_kwh_m2, true_kwh_m2 = ratio(*found), ratio(*truth)
    per_area = None
    if found_kwh_m2 is not None and true_kwh_m2 is not None:
        per_area = ratio(found_kwh_m2 - true_kwh_m2, true_kwh_m2)
    return HeatingErrors(
        name,
        found[0],
        truth[0],
        found_kwh_m2,
        true_kwh_m2,
        ratio(found[0] - truth[0], truth[0]),
        per_area,
    )
