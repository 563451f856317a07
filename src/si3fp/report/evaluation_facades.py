"""The facades of an evaluation: one row and one drawing each."""

from __future__ import annotations

from si3fp.evaluate import Evaluation, FacadeEvaluation
from si3fp.report.elevations import KEYS, elevation
from si3fp.report.markup import (
    ABSENT,
    Markup,
    counted,
    joined,
    number,
    percent,
    percent_interval,
    table,
    tag,
)

MOST_DRAWN = 60  # facades; more would make the page slow


def facades_part(result: Evaluation) -> Markup | None:
    """Every facade as a row, and those with windows drawn; None without facades."""
    facades = result.facades
    if not facades:
        return None
    head = ["Facade", "True", "Found", "Right", "Mean IoU", "Area err (%)", "Position err (m)",
            "Wall (m²)", "Wall err (%)", "WWR true", "WWR found", "Interval"]  # fmt: skip
    rows = [_facade_row(facade) for facade in facades]
    classes = [None if facade.found_id is not None else "muted" for facade in facades]
    legend = [
        joined([tag("span", class_="key", style=f"background:{colour}"), name])
        for colour, name in KEYS
    ]
    shown = [f for f in facades if f.true_boxes_m or f.found_boxes_m][:MOST_DRAWN]
    left_out = len(facades) - len(shown)
    note = f" Not drawn: {counted(left_out, 'facade')}, without windows or beyond "
    return tag(
        "section",
        tag("h2", "Facades"),
        table(head, rows, row_classes=classes),
        tag(
            "p",
            *legend,
            ". Dashed: the found facade.",
            f"{note}the first {MOST_DRAWN}." if left_out else None,
            class_="soft",
        ),
        tag(
            "div",
            *(
                tag("figure", elevation(facade), tag("figcaption", _caption(facade)))
                for facade in shown
            ),
            class_="pair",
        ),
    )


def _facade_row(facade: FacadeEvaluation) -> list[str]:
    windows = facade.windows
    true = windows.true_positives + windows.false_negatives
    found = windows.true_positives + windows.false_positives
    missing = facade.found_id is None
    area, wall = windows.mean_abs_relative_area_error, facade.relative_area_error
    return [
        facade.facade_id + (" (balconies)" if facade.balconies else ""),
        str(true),
        ABSENT if missing else str(found),
        ABSENT if missing else str(windows.true_positives),
        number(windows.mean_iou, 2),
        number(None if area is None else area * 100, 1),
        number(windows.mean_abs_position_error_m, 3),
        number(facade.area_m2, 1),
        number(None if wall is None else wall * 100, 1),
        percent(facade.wwr_truth),
        "missing" if missing else percent(facade.wwr_found),
        percent_interval(facade.wwr_interval) or ABSENT,
    ]


def _caption(facade: FacadeEvaluation) -> str:
    if facade.found_id is None:
        return f"{facade.facade_id}: missing"
    other = "" if facade.found_id == facade.facade_id else f", found as {facade.found_id}"
    windows = facade.windows
    return (
        f"{facade.facade_id}{other}: {windows.true_positives} right, "
        f"{windows.false_negatives} missed, {windows.false_positives} wrong"
    )
