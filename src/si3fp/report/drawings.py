"""SVG drawings of the report: the plan of a run and the bars of a year."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from si3fp.geometry.rigid import FloatArray
from si3fp.report.markup import Markup, counted, number, tag

Status = Literal["found", "not seen", "failed"]

STATUS_COLOURS: dict[Status, str] = {
    "found": "#1a7f64",
    "not seen": "#8b94a3",
    "failed": "#c8401f",
}
CAMERA_COLOUR = "#2b59c3"
MONTHS = "JFMAMJJASOND"
PLAN_REACH_M = 60.0
"""Cameras farther than this from every wall are counted, not drawn."""


@dataclass(frozen=True, slots=True, eq=False)
class WallLine:
    """A facade seen from above: its two ends in world metres, left to right from outside."""

    label: str
    ends_in_world: FloatArray
    status: Status


@dataclass(frozen=True, slots=True, eq=False)
class CameraPoint:
    """A camera seen from above, in world metres."""

    id: str
    position_in_world: FloatArray
    used: bool


def plan(
    footprints: Sequence[tuple[str, FloatArray]],
    walls: Sequence[WallLine],
    cameras: Sequence[CameraPoint],
    width_px: int = 1040,
    max_height_px: int = 460,
    *,
    north_known: bool = True,
    metric: bool = True,
) -> Markup | None:
    """The run seen from above, north up, with a scale bar; None where there is nothing to draw.

    Parameters
    ----------
    footprints
        Id and outline (V, 2) in world metres.
    walls, cameras
        What stands where.
    width_px, max_height_px
        Limits of the drawing; its scale follows from them.
    north_known, metric
        Whether the world's y axis is north and its unit the metre; arrow and bar say no more.
    """
    solid = [outline for _, outline in footprints] + [wall.ends_in_world for wall in walls]
    points = np.array([camera.position_in_world[:2] for camera in cameras]).reshape(-1, 2)
    if solid:
        corners = np.concatenate(solid)
        low, high = corners.min(axis=0) - PLAN_REACH_M, corners.max(axis=0) + PLAN_REACH_M
        inside = ((points >= low) & (points <= high)).all(axis=1)
        corners = np.concatenate([corners, points[inside]])
    elif len(points):
        inside, corners = np.ones(len(points), dtype=bool), points
    else:
        return None
    low, high = corners.min(axis=0), corners.max(axis=0)
    extent = np.maximum(high - low, 1.0)
    margin = 44.0
    px_per_m = float(
        min((width_px - 2 * margin) / extent[0], (max_height_px - 2 * margin - 26) / extent[1])
    )
    height_px = round(extent[1] * px_per_m + 2 * margin + 26)
    left = (width_px - extent[0] * px_per_m) / 2

    def at(point: FloatArray) -> tuple[float, float]:
        x = left + (float(point[0]) - low[0]) * px_per_m
        y = margin + (high[1] - float(point[1])) * px_per_m
        return round(float(x), 1), round(float(y), 1)

    away = int((~inside).sum())
    return tag(
        "svg",
        *(_outline(name, [at(corner) for corner in outline]) for name, outline in footprints),
        *(
            _camera(camera, *at(camera.position_in_world))
            for camera, near in zip(cameras, inside, strict=True)
            if near
        ),
        *(_wall(wall, at(wall.ends_in_world[0]), at(wall.ends_in_world[1])) for wall in walls),
        _north(width_px - 34, 40) if north_known else None,
        _scale_bar(px_per_m, 24, height_px - 18) if metric else None,
        _text(width_px - 20, height_px - 14, f"{counted(away, 'camera')} outside this plan", "end")
        if away
        else None,
        viewBox=f"0 0 {width_px} {height_px}",
        role="img",
        aria_label="Plan of buildings, facades and cameras",
        class_="plan",
    )


def _text(x: float, y: float, content: str, anchor: str = "middle", class_: str = "t") -> Markup:
    return tag("text", content, x=round(x, 1), y=round(y, 1), text_anchor=anchor, class_=class_)


def _outline(name: str, corners: Sequence[tuple[float, float]]) -> Markup:
    x, y = np.mean(corners, axis=0)
    return tag(
        "g",
        tag(
            "polygon",
            points=" ".join(f"{corner[0]},{corner[1]}" for corner in corners),
            fill="#eceff3",
            stroke="#b8c0cc",
        ),
        _text(x, y + 4, name, class_="t strong"),
    )


def _wall(wall: WallLine, start: tuple[float, float], end: tuple[float, float]) -> Markup:
    run = np.subtract(end, start)
    length = max(float(np.hypot(*run)), 1e-9)
    # The outside lies on the right of start -> end; the drawing's y axis points down.
    outward = np.array([-run[1], run[0]]) / length
    x, y = (np.add(start, end) / 2 + outward * 14).tolist()
    return tag(
        "g",
        tag("title", f"{wall.label}: {wall.status}"),
        tag(
            "line",
            x1=start[0],
            y1=start[1],
            x2=end[0],
            y2=end[1],
            stroke=STATUS_COLOURS[wall.status],
            stroke_width=5 if wall.status == "found" else 3,
            stroke_dasharray="7 4" if wall.status == "not seen" else None,
        ),
        _text(x, y + 4, wall.label) if length > 24 else None,
    )


def _camera(camera: CameraPoint, x: float, y: float) -> Markup:
    return tag(
        "circle",
        tag("title", f"{camera.id}{'' if camera.used else ' (not used)'}"),
        cx=x,
        cy=y,
        r=3.6,
        fill=CAMERA_COLOUR if camera.used else "#ffffff",
        stroke=CAMERA_COLOUR,
        stroke_width=1.2,
    )


def _north(x: float, y: float) -> Markup:
    return tag(
        "g",
        tag(
            "polygon",
            points=f"{x},{y - 20} {x + 7},{y + 6} {x},{y} {x - 7},{y + 6}",
            fill="#39424e",
        ),
        _text(x, y + 20, "N", class_="t strong"),
    )


def _scale_bar(px_per_m: float, x: float, y: float) -> Markup:
    length_m = nice_below(140 / px_per_m)
    end = round(x + length_m * px_per_m, 1)
    return tag(
        "g",
        tag("path", d=f"M{x} {y - 5}V{y}H{end}V{y - 5}", fill="none", stroke="#39424e"),
        _text(end + 6, y + 1, number(length_m, 0 if length_m >= 1 else 1, "m"), "start"),
    )


def nice_below(value: float) -> float:
    """The largest of ..., 1, 2, 5, 10, 20, 50, ... that is not above the value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= value * 1.0001))


def month_bars(monthly_kwh: Sequence[float], width_px: int = 560, height_px: int = 210) -> Markup:
    """Bars of twelve monthly heating demands in kWh with a labelled axis."""
    top, bottom, left = 22.0, height_px - 24.0, 58.0
    most = max([*monthly_kwh, 0.0])
    step = nice_below(most / 2) if most > 0 else 1.0
    ceiling = step * max(1, int(np.ceil(most / step - 1e-9)))
    pitch = (width_px - left - 8) / len(monthly_kwh)

    def height_at(value: float) -> float:
        return round(bottom - (bottom - top) * value / ceiling, 1)

    levels = [step * index for index in range(round(ceiling / step) + 1)]
    marks: list[Markup] = [_text(left - 8, 12, "kWh", "end")]
    for level in levels:
        y = height_at(level)
        marks.append(tag("line", x1=left, x2=width_px, y1=y, y2=y, stroke="#e1e5ea"))
        marks.append(_text(left - 8, y + 4, number(level, 0 if step >= 1 else 2), "end"))
    for month, value in enumerate(monthly_kwh):
        x, y = left + pitch * month + pitch * 0.16, height_at(max(value, 0.0))
        name = MONTHS[month % 12]
        marks.append(
            tag(
                "rect",
                tag("title", f"{name}: {number(value, 0, 'kWh')}"),
                x=round(x, 1),
                y=y,
                width=round(pitch * 0.68, 1),
                height=round(bottom - y, 1),
                fill="#c8401f",
            )
        )
        marks.append(_text(x + pitch * 0.34, bottom + 16, name))
    return tag(
        "svg",
        *marks,
        viewBox=f"0 0 {width_px} {height_px}",
        role="img",
        aria_label="Heating demand per month",
        class_="bars",
    )


def residual_lines(
    views: Sequence[tuple[str, float, float]], width_px: int = 560, row_px: int = 19
) -> Markup:
    """One line per view from its residual before to the one after registration, in pixels."""
    left, top, right = 150.0, 8.0, width_px - 16.0
    bottom = top + row_px * len(views)
    most = max([max(before, after) for _, before, after in views] + [0.1])
    step = nice_below(most / 3)
    ceiling = step * int(np.ceil(most / step - 1e-9))

    def across(value: float) -> float:
        return round(left + (right - left) * value / ceiling, 1)

    marks: list[Markup] = []
    for level in range(round(ceiling / step) + 1):
        x = across(level * step)
        marks.append(tag("line", x1=x, x2=x, y1=top, y2=bottom, stroke="#e1e5ea"))
        marks.append(_text(x, bottom + 15, number(level * step, 0 if step >= 1 else 1)))
    marks.append(_text(left - 10, bottom + 15, "pixels", "end"))
    for index, (name, before, after) in enumerate(views):
        y = round(top + row_px * (index + 0.5), 1)
        short = name if len(name) <= 20 else f"{name[:8]}…{name[-10:]}"
        start, end = across(before), across(after)
        colour = STATUS_COLOURS["found"]
        marks += [
            _text(left - 10, y + 4, short, "end"),
            tag("line", x1=start, x2=end, y1=y, y2=y, stroke="#b8c0cc", stroke_width=2),
            tag(
                "circle", cx=start, cy=y, r=3.6, fill="#ffffff", stroke="#8b94a3", stroke_width=1.4
            ),
            tag("circle", cx=end, cy=y, r=4, fill=colour),
        ]
    return tag(
        "svg",
        *marks,
        viewBox=f"0 0 {width_px} {round(bottom + 22)}",
        role="img",
        aria_label="Residuals before and after registration",
        class_="residuals",
    )
