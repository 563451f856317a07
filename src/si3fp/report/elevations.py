"""Drawings of facades with their true and found windows, for evaluations."""

from __future__ import annotations

from collections.abc import Sequence

from si3fp.evaluate import FacadeEvaluation
from si3fp.report.drawings import nice_below
from si3fp.report.markup import Markup, number, tag

WALL = "#f1f3f6"
RIGHT, MISSED, WRONG = "#1a7f64", "#e08a00", "#c8401f"
KEYS = (
    ("#c9ced6", "true window"),
    (RIGHT, "found, right"),
    (MISSED, "true, missed"),
    (WRONG, "found, wrong"),
)
MARGIN_PX = 16.0

Box = Sequence[float]


def elevation(facade: FacadeEvaluation, width_px: float = 520.0) -> Markup:
    """The true facade seen from outside, with its windows and those found, and a scale bar."""
    outline = facade.found_outline_m
    whole = (0.0, 0.0, facade.width_m, facade.height_m)
    boxes = [whole, *([outline] if outline else []), *facade.found_boxes_m]
    left, bottom = min(box[0] for box in boxes), min(box[1] for box in boxes)
    right, top = max(box[2] for box in boxes), max(box[3] for box in boxes)
    # High facades are not drawn higher than wide.
    px_per_m = (width_px - 2 * MARGIN_PX) / max(right - left, (top - bottom) * 1.1)
    drawn_px = (right - left) * px_per_m + 2 * MARGIN_PX
    height_px = (top - bottom) * px_per_m + 2 * MARGIN_PX + 18

    def rect(box: Box, **style: object) -> Markup:
        return tag(
            "rect",
            x=round(MARGIN_PX + (box[0] - left) * px_per_m, 1),
            y=round(MARGIN_PX + (top - box[3]) * px_per_m, 1),
            width=round((box[2] - box[0]) * px_per_m, 1),
            height=round((box[3] - box[1]) * px_per_m, 1),
            **style,
        )

    matched_true = {match.truth for match in facade.matches}
    matched_found = {match.found for match in facade.matches}
    marks = [rect(whole, fill=WALL, stroke="#8b94a3")]
    if outline:
        marks.append(rect(outline, fill="none", stroke="#8b94a3", stroke_dasharray="5 4"))
    for index, box in enumerate(facade.true_boxes_m):
        missed = index not in matched_true
        marks.append(
            rect(
                box,
                fill="#fbe9c8" if missed else "#c9ced6",
                stroke=MISSED if missed else None,
                stroke_width=1.4,
            )
        )
    for index, box in enumerate(facade.found_boxes_m):
        colour = RIGHT if index in matched_found else WRONG
        marks.append(rect(box, fill=colour, fill_opacity=0.16, stroke=colour, stroke_width=1.4))
    bar_m = nice_below(90 / px_per_m)
    y, end = round(height_px - 8, 1), round(MARGIN_PX + bar_m * px_per_m, 1)
    marks.append(
        tag("path", d=f"M{MARGIN_PX} {y - 4}V{y}H{end}V{y - 4}", fill="none", stroke="#39424e")
    )
    digits = 0 if bar_m >= 1 else 1
    marks.append(tag("text", number(bar_m, digits, "m"), x=end + 6, y=y + 1, class_="t"))
    return tag(
        "svg",
        *marks,
        viewBox=f"0 0 {drawn_px:.1f} {height_px:.1f}",
        role="img",
        aria_label=f"Windows of facade {facade.facade_id}",
        style=f"max-width:{drawn_px:.0f}px",
    )
