"""The report of a run: one HTML file with everything inside, for a reader who was not there."""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from string import Template

import numpy as np

from si3fp.report.building_part import building_part
from si3fp.report.drawings import CAMERA_COLOUR, STATUS_COLOURS, CameraPoint, WallLine, plan
from si3fp.report.facade_part import facade_part
from si3fp.report.facade_pictures import facade_overlay
from si3fp.report.map_layer import footprint_edge
from si3fp.report.markup import (
    Markup,
    bullets,
    counted,
    folded,
    joined,
    table,
    tag,
)
from si3fp.report.reconstruction_part import reconstruction_part
from si3fp.report.records import (
    BuildingRecords,
    Record,
    RunRecords,
    cameras_of,
    foot_of,
    origin_of,
    outline_of,
    read_run,
    record,
    records,
    status_of,
    texts,
)
from si3fp.report.summary_part import summary, tiles
from si3fp.workspace import write_png, write_text

ATTRIBUTIONS = (
    "Thermal archetypes: tabula-values.xlsx of EnergyProfile-XL, Institut Wohnen und Umwelt (IWU), "
    "collected by the partners of TABULA and EPISCOPE, CC BY 4.0; selected and rounded.",
    "Window detector: weights trained on the building-facade-segmentation data of Lucerne "
    "University of Applied Sciences (CC BY 4.0) and on the Saint Petersburg facades (CC0 1.0).",
)

STEP_WORDS = {
    "views": "failed at rectifying its views",
    "align": "failed at registering its views",
    "render": "failed at rendering",
    "facade_box": "failed at finding its outline",
    "windows": "failed at finding its windows",
}


def run_report(run: Path) -> str:
    """The report of a run folder as one self-contained HTML document.

    The text depends on the files of the run alone: dates come from ``run.json``.

    Raises
    ------
    InputError, SourceError
        If the folder holds no run or one of its files is broken.
    """
    known = read_run(run)
    title = _title(known)
    body = joined(
        [
            _header(known, title),
            tiles(known),
            tag("p", summary(known), class_="lead"),
            bullets(texts(known.run.get("notes")), class_="notes"),
            _plan(known),
            reconstruction_part(record(known.run.get("reconstruction"))),
            _not_found(known),
            *(_building(known, building) for building in known.buildings),
            _about(known),
        ]
    )
    files = resources.files("si3fp.report")
    return Template(files.joinpath("report.html").read_text("utf-8")).substitute(
        title=joined([title]),
        generator=joined([f"si3fp {known.run.get('si3fp_version', '')}".strip()]),
        style=files.joinpath("report.css").read_text("utf-8"),
        body=body,
    )


def write_report(run: Path) -> Path:
    """Write ``RUN/report.html`` and every facade's ``overlay.png``; the path of the report."""
    known = read_run(run)
    for facade in known.facades:
        drawn = facade_overlay(known.workspace, facade)
        if drawn is not None:
            write_png(known.workspace.facade(str(facade["id"]), "overlay.png"), drawn)
    write_text(known.workspace.report, run_report(run))
    return known.workspace.report


def _title(known: RunRecords) -> str:
    names = [building.id for building in known.named]
    if not names:
        return "Facades and windows"
    return "Facades and windows of " + (
        ", ".join(names) if len(names) <= 3 else f"{len(names)} buildings"
    )


def _header(known: RunRecords, title: str) -> Markup:
    run = known.run
    # No date of the run: the same input gives the same report.
    when = (
        _span(known) if run.get("finished") else "The run has not finished; this is what there is."
    )
    return tag(
        "header",
        tag("p", "si3fp report", class_="kicker"),
        tag("h1", title),
        tag("p", when, class_="soft") if when else None,
    )


def _span(known: RunRecords) -> str:
    dates = sorted({str(p["captured"]) for p in cameras_of(known.run)[1] if p.get("captured")})
    if not dates:
        return ""
    return f"Imagery of {dates[0]}" + (f" to {dates[-1]}" if len(dates) > 1 else "")


def _walls(known: RunRecords) -> Iterator[WallLine]:
    origin = origin_of(known.run)
    for building in known.buildings:
        for facade in building.facades:
            ends = foot_of(facade, origin)
            if ends is not None:
                yield WallLine(_short(str(facade["id"]), building.id), ends, "found")
        outline = outline_of(building.footprint)
        if outline is None:
            continue
        for missing in building.missing:
            name = str(missing.get("facade_id", ""))
            edge = footprint_edge(name, building.id, len(outline))
            if edge is not None:
                ends = outline[[edge, (edge + 1) % len(outline)]]
                yield WallLine(_short(name, building.id), ends, status_of(missing))


def _is_used(camera: Record) -> bool:
    return bool(camera.get("used", True))


def _short(facade_id: str, building_id: str) -> str:
    return facade_id.removeprefix(f"{building_id}-") if building_id else facade_id


def _plan(known: RunRecords) -> Markup | None:
    outlines = [
        (building.id, outline)
        for building in known.buildings
        if (outline := outline_of(building.footprint)) is not None
    ]
    cameras = [
        CameraPoint(
            str(camera.get("id", "")), np.asarray(position, float), bool(camera.get("used", True))
        )
        for camera in cameras_of(known.run)[1]
        if isinstance(position := camera.get("position_in_world"), list)
    ]
    drawing = plan(
        outlines,
        list(_walls(known)),
        cameras,
        north_known=bool(known.run.get("north_known", True)),
        metric=bool(record(known.run.get("reconstruction")).get("metric", True)),
    )
    if drawing is None:
        return None
    keys = [*((colour, f"facade {status}") for status, colour in STATUS_COLOURS.items()),
            (CAMERA_COLOUR, "camera (hollow: not used)")]  # fmt: skip
    legend = [
        joined([tag("span", class_="key", style=f"background:{colour}"), name])
        for colour, name in keys
    ]
    note = ". Numbers are footprint edges." if outlines else None
    return tag("figure", drawing, tag("figcaption", *legend, note))


def _not_found(known: RunRecords) -> Markup | None:
    unassigned = records(known.run.get("unassigned"))
    left_out = texts(known.run.get("left_out"))
    if not known.missing and not unassigned and not left_out:
        return None
    parts: list[Markup] = [tag("h2", "What is missing and why")]
    if known.missing:
        rows = [
            [item.get("facade_id", ""), _stage(item), item.get("reason", "")]
            for item in known.missing
        ]
        parts.append(table(["Facade", "What happened", "Reason"], rows, words=(0, 1, 2)))
    if unassigned:
        rows = [
            [p.get("panorama", ""), p.get("plane", ""), p.get("reason", "")] for p in unassigned
        ]
        parts.append(
            folded(
                f"Walls seen that belong to no facade ({counted(len(unassigned), 'plane')})",
                table(["Panorama", "Plane", "Reason"], rows, words=(0, 1, 2)),
            )
        )
    if left_out:
        parts.append(
            folded(f"Walls left out ({counted(len(left_out), 'plane')})", bullets(left_out))
        )
    return tag("section", *parts)


def _stage(missing: Record) -> str:
    if status_of(missing) == "not seen":
        return "not seen by any camera"
    step = str(missing.get("step") or "unknown")
    return STEP_WORDS.get(step, f"failed in step {step}")


def _building(known: RunRecords, building: BuildingRecords) -> Markup:
    return tag(
        "section",
        building_part(building, known.simulation),
        *(facade_part(known.workspace, facade) for facade in building.facades),
        class_="building",
    )


def _about(known: RunRecords) -> Markup:
    run = known.run
    inputs = record(run.get("inputs"))
    config = run.get("config") or next(
        (facade["config"] for facade in known.facades if facade.get("config")), None
    )
    noun, cameras = cameras_of(run)
    return tag(
        "section",
        tag("h2", "About this report"),
        tag("p", "The window-to-wall ratio is the area of windows and balcony doors over the gross "
            "facade area, windows included. Positions are measured from the lower left corner of "
            "the facade seen from outside."),
        tag("p", "Command: ", tag("code", run["command"])) if run.get("command") else None,
        folded(f"{noun.capitalize()}s ({len(cameras)})", table(
            [noun.capitalize(), "Captured", "Used", "Note"],
            [[p.get("id", ""), p.get("captured") or "", "yes" if _is_used(p) else "no",
              p.get("reason") or ""] for p in cameras], words=(0, 1, 2, 3))) if cameras else None,
        folded("Input files", table(["File", "SHA-256"], [
            [name, tag("code", str(digest))] for name, digest in inputs.items()
        ], words=(0, 1))) if inputs else None,
        folded("Settings", tag("pre", json.dumps(config, indent=1, ensure_ascii=False)))
        if config else None,
        tag("p", f"Made with si3fp {run.get('si3fp_version', '')}. ", " ".join(ATTRIBUTIONS),
            class_="foot"),
    )  # fmt: skip
