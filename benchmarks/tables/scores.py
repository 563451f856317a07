"""The paper's metrics of one evaluation or of several together, from ``evaluation.json``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any

Json = Mapping[str, Any]
Metrics = dict[str, float | None]


@dataclass(frozen=True)
class Sums:
    """Sums over windows and facades, so that adding two is pooling them.

    ``hits`` are matched windows with the sums of their IoU, magnitudes of relative area errors and
    position errors; ``facades`` come with sums of signed, absolute and area-weighted errors of the
    window-to-wall ratio, and of the signed errors after imputation.
    """

    hits: int = 0
    wrong: int = 0
    missed: int = 0
    iou: float = 0.0
    area: float = 0.0
    position_m: float = 0.0
    facades: int = 0
    wwr: float = 0.0
    wwr_absolute: float = 0.0
    wwr_area_m2: float = 0.0
    area_m2: float = 0.0
    imputed: float = 0.0

    def __add__(self, other: Sums) -> Sums:
        return Sums(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(Sums)))


@dataclass(frozen=True)
class Scored:
    """Sums over all facades and over those without balconies."""

    everything: Sums
    plain: Sums

    def __add__(self, other: Scored) -> Scored:
        return Scored(self.everything + other.everything, self.plain + other.plain)


def scored(evaluation: Json, *, total: bool) -> Scored:
    """Sums of an evaluation.

    Parameters
    ----------
    evaluation
        The content of ``evaluation.json``.
    total
        Over all true facades (a missing one has found nothing, or, imputed, has the mean ratio of
        those found in its building); else over the facades that were found.
    """
    facades = evaluation["facades"]
    ratios: dict[str, list[float]] = {}
    for facade in facades:
        if facade["wwr_found"] is not None:
            ratios.setdefault(facade["building_id"], []).append(facade["wwr_found"])
    means = {building: sum(found) / len(found) for building, found in ratios.items()}
    rows = [
        (_facade_sums(facade, means.get(facade["building_id"], 0.0)), facade["balconies"])
        for facade in facades
        if total or facade["found_id"] is not None
    ]
    return Scored(
        sum((row for row, _ in rows), Sums()),
        sum((row for row, balconies in rows if not balconies), Sums()),
    )


def pooled(parts: Iterable[Scored]) -> Scored:
    """All windows in one pot, all facades in another."""
    return sum(parts, Scored(Sums(), Sums()))


def metrics(sums: Scored, *, total: bool) -> Metrics:
    """Values of the columns of Table 3, None where there is nothing to divide by.

    As in the paper, IoU, area and position have no value over all facades, and imputation none
    over those found.
    """
    whole, plain = sums.everything, sums.plain
    return {
        "f1": _f1(whole),
        "f1_plain": _f1(plain),
        "iou": None if total else _ratio(whole.iou, whole.hits),
        "area": None if total else _ratio(whole.area, whole.hits),
        "position_m": None if total else _ratio(whole.position_m, whole.hits),
        "wwr": _ratio(whole.wwr, whole.facades),
        "imputed": _ratio(whole.imputed, whole.facades) if total else None,
        "wwr_absolute": _ratio(whole.wwr_absolute, whole.facades),
        "wwr_by_area": _ratio(whole.wwr_area_m2, whole.area_m2),
    }


def _facade_sums(facade: Json, imputed_wwr: float) -> Sums:
    windows, matches = facade["windows"], facade["matches"]
    found = facade["wwr_found"]
    error = (0.0 if found is None else found) - facade["wwr_truth"]
    return Sums(
        hits=windows["true_positives"],
        wrong=windows["false_positives"],
        missed=windows["false_negatives"],
        iou=sum(match["iou"] for match in matches),
        area=sum(abs(match["relative_area_error"]) for match in matches),
        position_m=sum(match["position_error_m"] for match in matches),
        facades=1,
        wwr=error,
        wwr_absolute=abs(error),
        wwr_area_m2=error * facade["area_m2"],
        area_m2=facade["area_m2"],
        imputed=(imputed_wwr if found is None else found) - facade["wwr_truth"],
    )


def _f1(sums: Sums) -> float | None:
    return _ratio(2 * sums.hits, 2 * sums.hits + sums.wrong + sums.missed)


def _ratio(part: float, whole: float) -> float | None:
    return part / whole if whole else None
