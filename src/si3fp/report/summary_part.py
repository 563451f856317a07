"""The run in a few numbers and plain words."""

from __future__ import annotations

from collections.abc import Iterator

from si3fp.report.markup import Markup, counted, is_number, number, percent, percent_interval, tag
from si3fp.report.records import RunRecords, cameras_of, records, status_of
from si3fp.report.totals import counts_by_label, wwr_of_building


def _heating(known: RunRecords) -> tuple[float, float] | None:
    """Heating demand of all simulated buildings in kWh and kWh/m2, or None."""
    rows = [
        (row["heating_kwh"], row["floor_area_m2"])
        for row in records(known.simulation.get("buildings"))
        if is_number(row.get("heating_kwh")) and is_number(row.get("floor_area_m2"))
    ]
    area_m2 = sum(area for _, area in rows)
    total_kwh = sum(energy for energy, _ in rows)
    return (total_kwh, total_kwh / area_m2) if area_m2 > 0 else None


def tiles(known: RunRecords) -> Markup:
    """The key figures of a run."""
    found, missing = len(known.facades), len(known.missing)
    heating = _heating(known)
    values = [
        (str(len(known.named)), "building" if len(known.named) == 1 else "buildings"),
        (f"{found} of {found + missing}", "facades found"),
        (str(sum(len(facade["windows"]) for facade in known.facades)), "windows and balcony doors"),
        (percent(wwr_of_building(known.facades)), "window-to-wall ratio of the facades found"),
    ]
    if heating:
        values.append((number(heating[1], 0, "kWh/m²"), "heating demand per year, simulated"))
    return tag(
        "div",
        *(tag("div", tag("b", value), tag("span", name), class_="tile") for value, name in values),
        class_="tiles",
    )


def summary(known: RunRecords) -> str:
    """What went in and what came out, in sentences."""
    return " ".join(_sentences(known))


def _sentences(known: RunRecords) -> Iterator[str]:
    noun, cameras = cameras_of(known.run)
    used = [camera for camera in cameras if camera.get("used", True)]
    dates = sorted(str(camera["captured"]) for camera in used if camera.get("captured"))
    found, missing = known.facades, known.missing
    if cameras:
        span = f" taken {_span(dates)}" if dates else ""
        part = "" if len(used) == len(cameras) else f" ({len(used)} of them used)"
        yield f"The input was {counted(len(cameras), noun)}{part}{span}."
    if not found:
        yield "No facade could be reconstructed."
    else:
        loose = sum(not facade.get("building_id") for facade in found)
        owners = f" of {counted(len(known.named), 'building')}" if known.named else ""
        apart = f" ({loose} without a building)" if loose and owners else ""
        yield (
            f"{len(found)} of {counted(len(found) + len(missing), 'facade')}"
            f"{'' if apart else owners} {_was(len(found))} reconstructed{apart}, "
            f"with {counts_by_label(found, ' and ')}."
        )
    unseen = sum(status_of(item) == "not seen" for item in missing)
    failed = len(missing) - unseen
    if unseen:
        yield f"{counted(unseen, 'facade')} {_was(unseen)} not seen by any camera."
    if failed:
        yield f"{counted(failed, 'facade')} {_was(failed)} seen but could not be reconstructed."
    ratios = [
        f"{percent(ratio)}"
        + (f" (90 % interval {interval})" if interval else "")
        + (f" at {building.id}" if len(known.named) > 1 else "")
        for building in known.named
        if (ratio := wwr_of_building(building.facades, building.building)) is not None
        for interval in [percent_interval(building.building.get("wwr_interval"))]
    ]
    if 0 < len(ratios) <= 5:
        yield f"Windows take up {_listed(ratios)} of the facade area found, windows included."
    heating = _heating(known)
    if heating:
        yield (
            f"The simulated heating demand is {number(heating[0], 0, 'kWh')} per year, "
            f"{number(heating[1], 0, 'kWh')} per m² of floor."
        )


def _was(count: int) -> str:
    return "was" if count == 1 else "were"


def _listed(items: list[str]) -> str:
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}"


def _span(dates: list[str]) -> str:
    return f"in {dates[0]}" if dates[0] == dates[-1] else f"from {dates[0]} to {dates[-1]}"
