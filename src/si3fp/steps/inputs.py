"""S.1 with its files: inputs are read, checked and filtered, and the run's folder is claimed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from si3fp.config import StreetConfig
from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin
from si3fp.model import Footprint, Panorama
from si3fp.records import rounded
from si3fp.sources.footprints import FootprintRecord, footprints_in_world, read_footprints
from si3fp.sources.local import PanoramaRecord, panoramas_in_world, read_panorama_records
from si3fp.sources.selection import run_origin, select_panoramas, within_radius
from si3fp.streetview.assign import Unassigned
from si3fp.streetview.views import ViewPlan
from si3fp.thermal.archetypes import archetype
from si3fp.workspace import (
    Workspace,
    dump_json,
    key_of,
    read_json,
    sha256_of,
    write_text,
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RunInputs:
    """What a run of either path rests on.

    Attributes
    ----------
    origin
        Origin of the world frame; None where its place and north are unknown.
    footprints
        The buildings; empty without a map.
    hashes
        SHA-256 of every input file by name and kind.
    notes
        What the filters did.
    """

    origin: GeoOrigin | None
    footprints: tuple[Footprint, ...]
    hashes: Mapping[str, str]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StreetInputs(RunInputs):
    """What S.1 found; hashes are named ``<id> image`` and ``<id> plane map``.

    Attributes
    ----------
    panoramas
        The panoramas used, by id.
    records
        Their files, by id.
    by_building
        Ids of the panoramas to use for every building.
    columns
        Other spellings of the footprints' properties, under which they were read.
    """

    panoramas: Mapping[str, Panorama]
    records: Mapping[str, PanoramaRecord]
    by_building: Mapping[str, frozenset[str]]
    columns: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Circle:
    """A place and a radius that limit which panoramas are used."""

    lat_deg: float
    lon_deg: float
    radius_m: float


def collect(
    panoramas: Path,
    footprints: Path | None,
    config: StreetConfig,
    *,
    circle: Circle | None = None,
    columns: Mapping[str, str] | None = None,
) -> StreetInputs:
    """S.1: the panoramas and footprints of a run, checked and filtered.

    Raises
    ------
    InputError
        If an input cannot be used, or the thermal tables do not know the country: that must not
        show after minutes of work.
    """
    archetype(config.thermal.country, None, config.thermal.default_year)
    records = read_panorama_records(panoramas, config.collect.max_pixels)
    outlines = read_footprints(footprints, columns) if footprints else []
    notes = [_courtyard_note(outline) for outline in outlines if outline.courtyards]
    if circle is not None:
        kept = within_radius(records, circle.lat_deg, circle.lon_deg, circle.radius_m)
        notes.append(
            f"{len(kept)} of {len(records)} panoramas lie within {circle.radius_m:g} m of "
            f"{circle.lat_deg}, {circle.lon_deg}."
        )
        if not kept:
            raise InputError(f"{panoramas}: {notes[-1]} Give a larger radius or another place.")
        records = kept
    origin = run_origin(outlines, records)
    buildings = tuple(footprints_in_world(outlines, origin))
    selection = select_panoramas(records, buildings, origin, config.collect)
    chosen = selection.records
    # Both lists may have one file name; a folder of panoramas is known by its images.
    files = {f"{panoramas.name} (panoramas)": panoramas} if panoramas.is_file() else {}
    files |= {f"{footprints.name} (footprints)": footprints} if footprints else {}
    for record in chosen:
        files[f"{record.id} image"] = record.image
        if record.plane_map:
            files[f"{record.id} plane map"] = record.plane_map
    return StreetInputs(
        origin=origin,
        footprints=buildings,
        hashes={name: sha256_of(file) for name, file in sorted(files.items())},
        notes=(*notes, *selection.notes),
        panoramas={panorama.id: panorama for panorama in panoramas_in_world(chosen, origin)},
        records={record.id: record for record in chosen},
        by_building=selection.by_building,
        columns=dict(columns or {}),
    )


def _courtyard_note(footprint: FootprintRecord) -> str:
    many = footprint.courtyards > 1
    return (
        f"{footprint.id}: {footprint.courtyards} courtyard{'s are' if many else ' is'} filled: "
        "the walls there are not modelled, and floor area and volume are too large."
    )


def claim(workspace: Workspace, key: str, overwrite: bool) -> None:
    """Make sure that the run's folder is empty or holds this very run, finished or not.

    Raises
    ------
    InputError
        If it holds a run of other inputs or settings and ``overwrite`` is not set, or files that
        no run wrote.
    """
    held = ""
    if workspace.root.exists() and not workspace.root.is_dir():
        raise InputError(f"{workspace.root} is a file; give a folder for the run with -o.")
    for file in (workspace.key, workspace.run_json):  # the cache may have been deleted
        if not held and file.exists():
            held = str(read_json(file).get("key", ""))
    if not held and workspace.root.exists() and any(workspace.root.iterdir()):
        raise InputError(
            f"{workspace.root} holds files that are not of a run of si3fp; choose another folder "
            "with -o. They are never replaced."
        )
    if overwrite:
        workspace.clear()
    elif held not in ("", key):
        raise InputError(
            f"{workspace.root} holds a run of other inputs, settings or another version. Choose "
            "another folder with -o, or replace it with --overwrite."
        )
    write_text(workspace.key, dump_json({"key": key}))


def run_key(
    inputs: StreetInputs, config: StreetConfig, detector_fingerprint: str, version: str
) -> str:
    """Names a run: the same key means the same results."""
    return key_of(
        dict(inputs.hashes), dict(inputs.columns), config.as_dict(), detector_fingerprint, version
    )


def street_record(
    inputs: StreetInputs, plans: Sequence[ViewPlan], unassigned: Sequence[Unassigned]
) -> dict[str, Any]:
    """What ``run.json`` says of the panoramas and of planes that belong to no wall."""
    used = {name for plan in plans for name in plan.panorama_ids}
    return {
        "panoramas": [
            {
                "id": panorama.id,
                "captured": panorama.captured,
                "position_in_world": rounded(panorama.centre_in_world, 3),
                "used": panorama.id in used,
            }
            for panorama in inputs.panoramas.values()
        ],
        "unassigned": [
            {
                "panorama": plane.panorama_id,
                "plane": plane.plane_index,
                "nearest": plane.nearest,
                "reason": plane.reason,
            }
            for plane in unassigned
        ],
    }
