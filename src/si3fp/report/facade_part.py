"""The part of the report on one facade: pictures, numbers, views and windows."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from si3fp.report.drawings import residual_lines
from si3fp.report.facade_pictures import coverage_figure, fused_figure, thumbnails
from si3fp.report.markup import (
    Markup,
    bullets,
    counted,
    folded,
    is_number,
    joined,
    named_values,
    number,
    percent,
    percent_interval,
    table,
    tag,
)
from si3fp.report.records import Record, record, texts
from si3fp.report.totals import counts_by_label, faces, gross_area_m2, views_of, wwr_of
from si3fp.workspace import Workspace, safe_name

MAX_LINES = 16
SIDES = ("left", "right", "bottom", "top")


def facade_part(workspace: Workspace, facade: Record) -> Markup:
    """The section of one facade; parts without files are left out."""
    identifier = str(facade["id"])
    return tag(
        "section",
        tag("h3", f"Facade {identifier}", tag("small", faces(facade))),
        _facts(facade),
        fused_figure(workspace, facade),
        bullets([*texts(facade.get("notes")), *_recess_note(facade)], class_="notes"),
        tag("div", coverage_figure(workspace, facade), _registration(facade), class_="pair"),
        thumbnails(workspace, facade),
        _window_table(facade),
        _view_table(facade),
        _outline_table(facade),
        class_="facade",
        id=f"facade-{safe_name(identifier)}",
    )


def facts(pairs: list[tuple[str, Any]]) -> Markup:
    """A list of names with their values."""
    return tag("dl", *(tag("div", tag("dt", name), tag("dd", value)) for name, value in pairs))


def wwr_cell(facade: Record) -> Markup:
    """The window-to-wall ratio with its interval where there is one."""
    interval = percent_interval(facade.get("wwr_interval"))
    return joined([percent(wwr_of(facade)), tag("small", f" ({interval})") if interval else None])


def _facts(facade: Record) -> Markup:
    used, dropped = views_of(facade)
    seen = record(facade.get("coverage"))
    centre = record(facade.get("centre"))
    place = ", ".join(
        [number(centre.get("lat_deg"), 7, "°N"), number(centre.get("lon_deg"), 7, "°E")]
    )
    return facts(
        [
            ("Window-to-wall ratio", wwr_cell(facade)),
            ("Openings", counts_by_label([facade])),
            (
                "Width × height",
                f"{number(facade.get('width_m'))} × {number(facade.get('height_m'), 2, 'm')}",
            ),
            ("Gross area", number(gross_area_m2(facade), 1, "m²")),
            ("Views used", f"{len(used)} of {len(used) + len(dropped)}"),
            (
                "Seen",
                joined(
                    [
                        percent(seen.get("seen"), 0),
                        tag("small", f" (by two or more {percent(seen.get('seen_by_two'), 0)})"),
                    ]
                ),
            ),
            ("Resolution", number(facade.get("m_per_px"), 3, "m per pixel")),
            (
                "Centre (WGS 84)",
                joined([place, tag("small", " at height ", number(centre.get("height_m"), 1, "m"))])
                if centre
                else "not known",
            ),
        ]
    )


def _recess_note(facade: Record) -> list[str]:
    shifts = [
        max(abs(float(shift)) for shift in window["correction_m"])
        for window in facade["windows"]
        if window.get("correction_m")
    ]
    corrected = [shift for shift in shifts if shift > 0]
    if not corrected:
        return []
    return [
        f"Edges of {len(corrected)} of {counted(len(facade['windows']), 'opening')} were corrected "
        f"for the recess of the glass, by {number(max(corrected) * 100, 1, 'cm')} at most."
    ]


def _registration(facade: Record) -> Markup | None:
    used, dropped = views_of(facade)
    if not used and not dropped:
        return None
    moved = [
        (str(view.get("source")), *residuals)
        for view in used
        if (residuals := _residuals_px(view)) is not None
    ]
    sentence = f"{counted(len(used), 'view')} used."
    if moved:
        before, after = np.median([[before, after] for _, before, after in moved], axis=0)
        sentence += (
            " Median distance between matching points of two views: "
            f"{number(before, 1, 'px')} before registration (hollow), "
            f"{number(after, 1, 'px')} after (filled)."
        )
    reasons = Counter(str(view.get("reason") or "no reason given") for view in dropped)
    return tag(
        "div",
        tag("h4", "Registration of the views" if moved else "Views"),
        tag("p", sentence),
        residual_lines(moved[:MAX_LINES]) if moved else None,
        tag("p", f"{counted(len(dropped), 'view')} dropped:") if dropped else None,
        bullets(
            joined([reason, tag("span", f" ({counted(count, 'view')})", class_="soft")])
            for reason, count in reasons.most_common()
        ),
    )


def _residuals_px(view: Record) -> tuple[float, float] | None:
    before, after = view.get("residual_before_px"), view.get("residual_after_px")
    return (float(before), float(after)) if is_number(before) and is_number(after) else None


def _centimetres(values: Any) -> str:
    """Metres as ``2.0 2.0 3.0 4.0`` in centimetres."""
    items = values if isinstance(values, list) else [values]
    return " ".join(number(item * 100 if is_number(item) else None, 1) for item in items)


def _window_table(facade: Record) -> Markup | None:
    windows = facade["windows"]
    if not windows:
        return None
    head = ["No.", "Kind", "Left m", "Sill m", "Width m", "Height m", "Area m²", "Score", "Views",
            "Edge σ cm", "Recess cm", "Correction cm", "Evidence"]  # fmt: skip
    rows = [
        [
            index,
            str(window.get("label", "window")).replace("_", " ")
            + ("" if window.get("origin", "detected") == "detected" else f", {window['origin']}"),
            *(number(window.get(key)) for key in ("x_m", "y_m", "width_m", "height_m")),
            number(window["width_m"] * window["height_m"]),
            number(window.get("score")),
            len(window["views"]) if isinstance(window.get("views"), list) else number(None),
            _centimetres(window.get("edge_sigma_m")),
            _centimetres(window.get("recess_m")),
            _centimetres(window.get("correction_m")),
            window.get("evidence") or "",
        ]
        for index, window in enumerate(windows)
    ]
    return folded(
        f"Table of windows ({len(windows)})",
        tag(
            "p",
            f"Window n is {facade['id']}-wn in the thermal model and in the map layer. Positions "
            "are measured from the lower left corner of the facade; edge σ and correction are "
            "those of the left, right, bottom and top edge.",
            class_="soft",
        ),
        table(head, rows, words=(0, 1, 12)),
    )


def _view_table(facade: Record) -> Markup | None:
    used, dropped = views_of(facade)
    if not used and not dropped:
        return None
    head = ["View", "Used", "Motion", "Matches", "Residual before px", "after px", "Shift m",
            "Distance m", "Obliqueness °", "Reason"]  # fmt: skip
    rows = [
        [
            view.get("source", ""),
            "yes" if view.get("used") else "no",
            view.get("model") or number(None),
            number(view.get("inliers"), 0),
            number(view.get("residual_before_px"), 1),
            number(view.get("residual_after_px"), 1),
            number(view.get("shift_m")),
            number(view.get("distance_m"), 1),
            number(view.get("obliqueness_deg"), 0),
            view.get("reason") or "",
        ]
        for view in used + dropped
    ]
    return folded(
        f"Table of views ({len(used)} used, {len(dropped)} dropped)",
        table(
            head,
            rows,
            words=(0, 1, 2, 9),
            row_classes=[None] * len(used) + ["muted"] * len(dropped),
        ),
    )


def _outline_table(facade: Record) -> Markup | None:
    box, plane = record(facade.get("box")), record(facade.get("plane"))
    evidence = record(box.get("evidence"))
    rows = [
        [side, number(box.get(f"{side}_m")), evidence.get(side, "")]
        for side in SIDES
        if f"{side}_m" in box or side in evidence
    ]
    words = ", ".join(f"{name.lower()} {value}" for name, value in named_values(plane))
    if not rows and not words:
        return None
    return folded(
        "How the wall plane and the outline were found",
        table(["Side", "Position m", "Evidence"], rows, words=(0, 2)) if rows else None,
        tag("p", f"Wall plane: {words}.") if words else None,
    )
