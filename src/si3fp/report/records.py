"""The files of a run as plain records for the report; absent files and keys are empty records."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin, geodetic_from_world, world_from_geodetic
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.report.markup import is_number
from si3fp.workspace import Workspace, read_json

Record = dict[str, Any]


def record(value: Any) -> Record:
    """The value where it is a JSON object, else an empty one."""
    return value if isinstance(value, dict) else {}


def records(value: Any) -> list[Record]:
    """The JSON objects of a list; empty where there is no list."""
    return [item for item in value if isinstance(item, dict)] if isinstance(value, list) else []


def texts(value: Any) -> list[str]:
    """The items of a list as text; one text alone counts as a list of one."""
    items = value if isinstance(value, list) else [value]
    return [str(item) for item in items if item not in (None, "")]


def status_of(missing: Record) -> Literal["not seen", "failed"]:
    """Whether a missing facade was not seen by any camera or failed."""
    return "not seen" if missing.get("step") == "coverage" else "failed"


@dataclass(frozen=True, slots=True)
class BuildingRecords:
    """What a run knows of one building; an empty ``id`` holds the walls without a building."""

    id: str
    building: Record
    footprint: Record
    facades: tuple[Record, ...]
    missing: tuple[Record, ...]
    simulation: Record


@dataclass(frozen=True, slots=True)
class RunRecords:
    """A run as its files tell it.

    Attributes
    ----------
    workspace
        Where the files are.
    run
        ``run.json``, empty where the run has not finished.
    buildings
        In the order of ``run.json``; walls without a building come last.
    simulation
        ``simulation/result.json``.
    """

    workspace: Workspace
    run: Record
    buildings: tuple[BuildingRecords, ...]
    simulation: Record

    @property
    def named(self) -> list[BuildingRecords]:
        """The buildings, without the loose walls."""
        return [building for building in self.buildings if building.id]

    @property
    def facades(self) -> list[Record]:
        """All facades that were found; each carries its ``windows``."""
        return [facade for building in self.buildings for facade in building.facades]

    @property
    def missing(self) -> list[Record]:
        """All facades that were not found."""
        return [missing for building in self.buildings for missing in building.missing]


def read_run(run: Path) -> RunRecords:
    """The records of a run folder.

    Raises
    ------
    InputError
        If there is no such folder, it holds no run, or one of its files is broken.
    """
    workspace = Workspace(run)
    identifiers = workspace.facade_ids()
    if not workspace.run_json.exists() and not identifiers:
        raise InputError(
            f"There is no run in {run}: neither run.json nor facades were found. "
            "Give the folder that `si3fp street` or `si3fp photos` wrote with -o."
        )
    head = _read(workspace.run_json)
    simulation = _read(workspace.simulation / "result.json")
    absent = records(head.get("missing"))
    absent_ids = {missing.get("facade_id") for missing in absent}
    facades = [
        {
            **_read(workspace.facade(identifier, "facade.json")),
            "windows": records(_read(workspace.facade(identifier, "windows.json")).get("windows")),
        }
        for identifier in identifiers
        if identifier not in absent_ids
    ]
    return RunRecords(
        workspace, head, tuple(_buildings(head, facades, absent, simulation)), simulation
    )


def _read(path: Path) -> Record:
    return record(read_json(path)) if path.exists() else {}


def _by_id(items: list[Record]) -> dict[str, Record]:
    return {str(item["id"]): item for item in items if "id" in item}


def _buildings(
    head: Record, facades: list[Record], absent: list[Record], simulation: Record
) -> Iterator[BuildingRecords]:
    buildings, footprints = (
        _by_id(records(head.get("buildings"))),
        _by_id(records(head.get("footprints"))),
    )
    simulated = _by_id(records(simulation.get("buildings")))
    owners = [str(facade.get("building_id") or "") for facade in facades]
    names = dict.fromkeys([*buildings, *footprints, *owners])
    losers = [_owner(str(missing.get("facade_id", "")), names) for missing in absent]
    for name in [*filter(None, names), ""]:
        mine = tuple(facade for facade, owner in zip(facades, owners, strict=True) if owner == name)
        gone = tuple(
            missing for missing, owner in zip(absent, losers, strict=True) if owner == name
        )
        if name or mine or gone:
            yield BuildingRecords(
                name,
                buildings.get(name, {}),
                footprints.get(name, {}),
                mine,
                gone,
                simulated.get(name, {}),
            )


def _owner(facade_id: str, names: dict[str, None]) -> str:
    """The building in a facade id ``<building id>-<edge>``, empty where it names none."""
    owner = facade_id.rpartition("-")[0]
    return owner if owner in names else ""


def cameras_of(run: Record) -> tuple[str, list[Record]]:
    """What the sources of a run are called, one of them, and their records."""
    photos = records(run.get("photos"))
    return ("photo", photos) if photos else ("panorama", records(run.get("panoramas")))


def outline_of(footprint: Record) -> FloatArray | None:
    """The outline (V, 2) of a footprint record, or None."""
    outline = footprint.get("outline_in_world")
    if not isinstance(outline, list) or len(outline) < 3:
        return None
    return np.asarray(outline, dtype=np.float64)[:, :2]


def origin_of(item: Record) -> GeoOrigin | None:
    """The origin in a record, or None."""
    origin = record(item.get("origin"))
    values = [origin.get(key) for key in ("lat_deg", "lon_deg", "height_m")]
    numbers = [float(value) for value in values if is_number(value)]
    return GeoOrigin(*numbers) if len(numbers) == 3 else None


def pose_of(facade: Record) -> Rigid3 | None:
    """``world_from_facade`` of a facade record, or None."""
    pose = record(facade.get("world_from_facade"))
    if "rotation" not in pose or "translation" not in pose:
        return None
    return Rigid3(np.asarray(pose["rotation"]), np.asarray(pose["translation"]))


def foot_of(facade: Record, origin: GeoOrigin | None) -> FloatArray | None:
    """The foot (2, 2) of a facade in the world of ``origin``, left to right from outside."""
    pose, own = pose_of(facade), origin_of(facade)
    if pose is None or not is_number(facade.get("width_m")):
        return None
    ends = pose.apply([[0.0, 0.0, 0.0], [facade["width_m"], 0.0, 0.0]])
    if own is not None and origin is not None and own != origin:
        ends = world_from_geodetic(geodetic_from_world(ends, own), origin)
    return ends[:, :2]
