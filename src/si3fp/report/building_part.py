"""The part of the report on one building: totals, facades, thermal archetype and simulation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import PurePath
from typing import Any

import numpy as np

from si3fp.report.drawings import STATUS_COLOURS, Status, month_bars
from si3fp.report.facade_part import facts, wwr_cell
from si3fp.report.markup import (
    Markup,
    bullets,
    is_number,
    joined,
    named_values,
    number,
    percent,
    percent_interval,
    table,
    tag,
)
from si3fp.report.records import BuildingRecords, Record, record, status_of, texts
from si3fp.report.totals import (
    counts_by_label,
    faces,
    gross_area_m2,
    views_of,
    windows_area_m2,
    wwr_of_building,
)
from si3fp.workspace import safe_name


def building_part(building: BuildingRecords, simulation: Record) -> Markup:
    """The section of one building without its facades."""
    if not building.id:
        return joined([tag("h2", "Walls without a building"), _facade_table(building)])
    known = {**building.footprint, **building.building}
    return joined(
        [
            tag("h2", f"Building {building.id}", id=f"building-{safe_name(building.id)}"),
            _facts(building, known),
            bullets(texts(known.get("notes")), class_="notes"),
            _facade_table(building),
            tag("div", _archetype(known), _simulation(building, simulation), class_="pair"),
        ]
    )


def _facts(building: BuildingRecords, known: Record) -> Markup:
    interval = percent_interval(known.get("wwr_interval"))
    found, total = len(building.facades), len(building.facades) + len(building.missing)
    areas_m2 = [gross_area_m2(facade) or 0.0 for facade in building.facades]
    pairs: list[tuple[str, Any]] = [
        ("Window-to-wall ratio", joined([
            percent(wwr_of_building(building.facades, building.building)),
            tag("small", f" (90 % interval {interval})") if interval else None])),
        ("Facades found", f"{found} of {total}"),
        ("Facade area found", number(sum(areas_m2), 1, "m²")),
        ("Area of openings", number(sum(map(windows_area_m2, building.facades)), 1, "m²")),
        ("Openings", counts_by_label(list(building.facades))),
        ("Ground to eaves", number(known.get("height_m"), 1, "m")),
        ("Storeys", number(known.get("storeys"), 0)),
        ("Built", str(known.get("year") or "unknown")),
    ]  # fmt: skip
    return facts(pairs)


def _status(status: Status) -> Markup:
    return joined([tag("span", class_="dot", style=f"background:{STATUS_COLOURS[status]}"), status])


def _facade_table(building: BuildingRecords) -> Markup | None:
    rows = [list(row) for row in _facade_rows(building)]
    if not rows:
        return tag("p", "No facade of this building is in the run.", class_="soft")
    classes: list[str | None] = [None] * len(rows)
    if len(building.facades) > 1:
        gross = [gross_area_m2(facade) or 0.0 for facade in building.facades]
        rows.insert(
            len(building.facades),
            [
                "Facades found", "", "", "", number(sum(gross), 1),
                number(sum(map(windows_area_m2, building.facades)), 1),
                percent(wwr_of_building(building.facades)),
                sum(len(facade["windows"]) for facade in building.facades), "", "",
            ],
        )  # fmt: skip
        classes.insert(len(building.facades), "total")
    head = ["Facade", "Status", "Looks", "Width × height m", "Area m²", "Windows m²", "WWR",
            "Openings", "Views", "Seen"]  # fmt: skip
    return table(head, rows, words=(0, 1, 2), row_classes=classes)


def _facade_rows(building: BuildingRecords) -> Iterator[Sequence[Any]]:
    for facade in building.facades:
        used, dropped = views_of(facade)
        yield (
            tag("a", str(facade["id"]), href=f"#facade-{safe_name(str(facade['id']))}"),
            _status("found"),
            faces(facade).removeprefix("faces "),
            f"{number(facade.get('width_m'), 1)} × {number(facade.get('height_m'), 1)}",
            number(gross_area_m2(facade), 1),
            number(windows_area_m2(facade), 1),
            wwr_cell(facade),
            len(facade["windows"]),
            f"{len(used)} of {len(used) + len(dropped)}",
            percent(record(facade.get("coverage")).get("seen"), 0),
        )
    for missing in building.missing:
        yield (missing.get("facade_id", ""), _status(status_of(missing)), *[""] * 8)


def _archetype(known: Record) -> Markup | None:
    archetype = record(known.get("archetype"))
    rows = list(named_values(archetype))
    notes = texts(archetype.get("notes"))
    if not rows and not notes:
        return None
    return tag(
        "div",
        tag("h4", "Thermal archetype"),
        table(["Property", "Value"], rows) if rows else None,
        bullets(notes, class_="soft"),
    )


def _simulation(building: BuildingRecords, simulation: Record) -> Markup | None:
    result = building.simulation
    if not result:
        return None
    monthly = result.get("heating_kwh_by_month")
    drawable = isinstance(monthly, list) and len(monthly) == 12 and all(map(is_number, monthly))
    weather = simulation.get("weather")
    return tag(
        "div",
        tag("h4", "Heating demand, simulated with EnergyPlus"),
        facts(
            [
                ("Per year", number(result.get("heating_kwh"), 0, "kWh")),
                ("Per m² of floor", number(result.get("heating_kwh_m2"), 1, "kWh/m²")),
                ("Floor area", number(result.get("floor_area_m2"), 0, "m²")),
            ]
        ),
        month_bars(np.asarray(monthly, dtype=float).tolist()) if drawable else None,
        tag("p", f"Weather: {PurePath(str(weather)).name}", class_="soft") if weather else None,
    )
