"""Numbers as cells of a table: mean and range over seeds, bold where better than the paper's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from benchmarks.tables.paper import Column

ABSENT = "-"
Verdict = Literal["better", "worse", "same"]


def number(value: float | None, column: Column) -> str:
    """One value as the column prints it, or a dash."""
    if value is None:
        return ABSENT
    value = round(value * 100 if column.percent else value, column.digits) + 0.0
    return f"{value:{'+' if column.signed else ''}.{column.digits}f}"


def verdict(values: Sequence[float], paper: float | None, column: Column) -> Verdict | None:
    """How the mean stands to the paper's value at the digits shown; None without a value of both.

    Signed errors are judged by the mean of their magnitudes: seeds must not cancel each other.
    """
    if not values or paper is None:
        return None
    if column.signed:
        values, paper = [abs(value) for value in values], abs(paper)
    digits = column.digits + (2 if column.percent else 0)
    ours, theirs = round(sum(values) / len(values), digits), round(paper, digits)
    if ours == theirs:
        return "same"
    return "better" if (ours > theirs) == column.higher else "worse"


def cell(values: Sequence[float], paper: float | None, column: Column) -> str:
    """Mean and range, **bold** where better than the paper, *slanted* where worse."""
    if not values:
        return ABSENT
    text = number(sum(values) / len(values), column)
    lowest, highest = number(min(values), column), number(max(values), column)
    if lowest != highest:
        text += f" ({lowest} to {highest})"
    judged = verdict(values, paper, column)
    return f"**{text}**" if judged == "better" else f"*{text}*" if judged == "worse" else text


def spread(values: Sequence[float], digits: int) -> str:
    """Mean and range without judgement."""
    return cell(values, None, Column("", "", digits))


def lines_of(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A Markdown table."""
    table = [head, ["---"] * len(head), *rows]
    return ["| " + " | ".join(text.replace("|", "/") for text in row) + " |" for row in table]
