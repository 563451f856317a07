"""The tables of an evaluation as rows of text, for the terminal and for the page."""

from __future__ import annotations

from collections.abc import Sequence

from si3fp.evaluate import Evaluation, Totals
from si3fp.steps import ModelEvaluation

ABSENT = "-"
PAPER_HEAD = (
    "Building", "Method", "F1", "F1\n(no balc)", "Mean\nIoU", "Area\nerr (%)", "Position\nerr (m)",
    "WWR\nerr", "WWR err\nimputed", "Mean abs\nWWR err", "WWR err\nby area",
)  # fmt: skip
COVERAGE_HEAD = (
    "Building", "Height\n(m)", "Longest\nside (m)", "Facades", "Windows", "Missing\nfacades"
)  # fmt: skip
TOTAL = "Total"


def paper_rows(result: Evaluation) -> list[tuple[str, ...]]:
    """The paper's Table 3, and on its right mean magnitude and area-weighted mean of the ratios.

    Per building and over all: one row over the facades found, one ("Total") over all.
    """
    groups = [(b.id, b.all, b.without_balconies) for b in result.buildings]
    if len(groups) != 1:
        groups.append((TOTAL, result, result.without_balconies))
    return [
        row
        for name, everything, plain in groups
        for row in (_found_row(name, everything, plain), _total_row(name, everything, plain))
    ]


def coverage_rows(result: Evaluation) -> list[tuple[str, ...]]:
    """The paper's Table 2: buildings, their size, and the facades found and missing."""
    groups = [(b.id, fixed(b.height_m, 1), fixed(b.longest_side_m, 1), b.all)
              for b in result.buildings]  # fmt: skip
    if len(groups) != 1:
        groups.append((TOTAL, "", "", result))
    return [
        (name, height, side, str(t.facade_count), str(_windows(t)), _missing(t))
        for name, height, side, t in groups
    ]


def evaluation_table(evaluation: ModelEvaluation) -> str:
    """The evaluation as text: the paper's tables, what has no partner, and the notes."""
    result = evaluation.result
    lines = [*_aligned(COVERAGE_HEAD, coverage_rows(result)), ""]
    lines += [*_aligned(PAPER_HEAD, paper_rows(result)), ""]
    lines.append(
        f"3D IoU of openings: {fixed(result.opening_iou)} on the facades found, "
        f"{fixed(result.opening_iou_total)} on all"
    )
    interval = result.interval
    if interval.facades:
        lines.append(
            f"True WWR inside its interval: {interval.covered} of {interval.facades} facades, "
            f"mean width {fixed(interval.mean_width, 3)}"
        )
    for row in evaluation.heating:
        lines.append(
            f"Heating, {row.id}: {row.found_kwh:,.0f} kWh a year against {row.true_kwh:,.0f} "
            f"({signed_percent(row.relative_error)}), {fixed(row.found_kwh_m2, 1)} kWh/m2 against "
            f"{fixed(row.true_kwh_m2, 1)} ({signed_percent(row.relative_error_per_area)})"
        )
    for unmatched in result.unmatched:
        kind = "missing" if unmatched.model == "truth" else "not in the truth"
        lines.append(
            f"{unmatched.facade_id}: {kind}, {unmatched.windows} windows; {unmatched.reason}"
        )
    lines += [f"Note: {note}" for note in evaluation.notes]
    return "\n".join(lines)


def fixed(value: float | None, digits: int = 2) -> str:
    """A number with fixed decimals, or a dash."""
    return ABSENT if value is None else f"{value:.{digits}f}"


def signed(value: float | None, digits: int = 3) -> str:
    """A number with its sign, or a dash; never a negative zero."""
    return ABSENT if value is None else f"{round(value, digits) + 0.0:+.{digits}f}"


def signed_percent(value: float | None) -> str:
    """A share as a percentage with its sign, or a dash."""
    return ABSENT if value is None else f"{signed(value * 100, 1)} %"


def _found_row(name: str, everything: Totals, plain: Totals) -> tuple[str, ...]:
    windows, wwr = everything.windows, everything.wwr
    area = windows.mean_abs_relative_area_error
    return (
        name,
        "facades found",
        fixed(windows.f1),
        fixed(plain.windows.f1),
        fixed(windows.mean_iou),
        fixed(None if area is None else area * 100, 1),
        fixed(windows.mean_abs_position_error_m, 3),
        signed(wwr.mean),
        ABSENT,
        fixed(wwr.mean_absolute, 3),
        signed(wwr.area_weighted),
    )


def _total_row(name: str, everything: Totals, plain: Totals) -> tuple[str, ...]:
    wwr = everything.wwr_total
    return (
        name,
        "all (Total)",
        fixed(everything.windows_total.f1),
        fixed(plain.windows_total.f1),
        *[ABSENT] * 3,
        signed(wwr.mean),
        signed(everything.wwr_imputed.mean),
        fixed(wwr.mean_absolute, 3),
        signed(wwr.area_weighted),
    )


def _windows(t: Totals) -> int:
    return t.windows_total.true_positives + t.windows_total.false_negatives


def _missing(t: Totals) -> str:
    share = 100 * t.missing_count / t.facade_count if t.facade_count else 0.0
    return f"{t.missing_count} ({share:.1f} %)"


def _aligned(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Head in up to two lines, a rule, rows; words to the left, numbers to the right."""
    words = 2 if head[1] == "Method" else 1
    upper, lower = zip(*(_split(name) for name in head), strict=True)
    columns = list(zip(upper, lower, *rows, strict=True))
    widths = [max(map(len, column)) for column in columns]

    def line(cells: Sequence[str]) -> str:
        return "  ".join(
            cell.ljust(width) if i < words else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(cells, widths, strict=True))
        ).rstrip()

    return [
        *(line(cells) for cells in (upper, lower) if any(cells)),
        "-" * (sum(widths) + 2 * (len(widths) - 1)),
        *(line(row) for row in rows),
    ]


def _split(name: str) -> tuple[str, str]:
    first, cut, rest = name.partition("\n")
    return (first, rest) if cut else ("", first)
