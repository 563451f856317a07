"""Totals of facade records: areas, ratios, counts and directions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from si3fp.report.map_layer import compass_bearing_deg
from si3fp.report.markup import counted, is_number
from si3fp.report.records import Record, pose_of, records

BEARINGS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")
LABELS = {"window": ("window", "windows"), "balcony_door": ("balcony door", "balcony doors")}


def faces(facade: Record) -> str:
    """Where a facade looks, for example ``faces SW (225°)``; empty without a pose or north."""
    pose = pose_of(facade)
    if pose is None or facade.get("origin", {}) is None:
        return ""
    bearing_deg = compass_bearing_deg(pose.rotation[:, 2])
    return f"faces {BEARINGS[round(bearing_deg / 45) % 8]} ({bearing_deg:.0f}°)"


def counts_by_label(facades: list[Record], separator: str = ", ") -> str:
    """``23 windows, 2 balcony doors`` of some facades."""
    counts = Counter(
        str(window.get("label", "window")) for facade in facades for window in facade["windows"]
    )
    counts.setdefault("window", 0)
    order = [*LABELS, *sorted(set(counts) - set(LABELS))]
    return separator.join(
        counted(counts[label], *LABELS.get(label, (label.replace("_", " "),)))
        for label in order
        if label in counts
    )


def gross_area_m2(facade: Record) -> float | None:
    """Width times height, or None where one is unknown."""
    width_m, height_m = facade.get("width_m"), facade.get("height_m")
    return width_m * height_m if is_number(width_m) and is_number(height_m) else None


def windows_area_m2(facade: Record) -> float:
    """Area of all windows and balcony doors."""
    return float(
        sum(window.get("width_m", 0) * window.get("height_m", 0) for window in facade["windows"])
    )


def wwr_of(facade: Record) -> float | None:
    """The window-to-wall ratio as written, else from the windows, else None."""
    if is_number(facade.get("wwr")):
        return float(facade["wwr"])
    area_m2 = gross_area_m2(facade)
    return windows_area_m2(facade) / area_m2 if area_m2 else None


def views_of(facade: Record) -> tuple[list[Record], list[Record]]:
    """The views used and the views dropped."""
    views = records(facade.get("views"))
    return [v for v in views if v.get("used")], [v for v in views if not v.get("used")]


def wwr_of_building(facades: Sequence[Record], building: Record | None = None) -> float | None:
    """The ratio as the run states it, else of all facades found; None without facades."""
    stated = (building or {}).get("wwr")
    if is_number(stated):
        return float(stated)
    areas = [(windows_area_m2(f), area) for f in facades if (area := gross_area_m2(f)) is not None]
    gross_m2 = sum(area for _, area in areas)
    return sum(windows for windows, _ in areas) / gross_m2 if gross_m2 else None
