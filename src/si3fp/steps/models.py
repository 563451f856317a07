"""M.2 with its files: the thermal models, the record of the run, the simulation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from si3fp.config import RunConfig
from si3fp.errors import InputError
from si3fp.model import Building, Facade, Missing
from si3fp.records import (
    missing_record,
    origin_record,
    rounded,
)
from si3fp.steps.inputs import RunInputs
from si3fp.thermal.archetypes import Archetype, archetype
from si3fp.thermal.assemble import assemble
from si3fp.thermal.building import make_building
from si3fp.thermal.energyplus import SimulationResult, simulate
from si3fp.thermal.orientation import north_is_known, turned
from si3fp.windows.interval import joint_interval
from si3fp.workspace import (
    Workspace,
    dump_json,
    read_json,
    sha256_of,
    stamp,
    write_text,
)


def build_models(
    inputs: RunInputs,
    found: Sequence[Facade],
    missing: Sequence[Missing],
    default_height_m: float,
    workspace: Workspace,
    config: RunConfig,
) -> tuple[list[Building], list[Facade], list[dict[str, Any]]]:
    """M.2: ``model.hbjson``, ``buildings/*.hbjson``; buildings, loose facades, their records."""
    buildings, archetypes, rows = [], {}, []
    edges = {f"{f.id}-{i}": f.id for f in inputs.footprints for i in range(len(f.edges()))}
    # Without a place and north there are no footprints in the world.
    placed = [] if inputs.origin is None else [(one, inputs.origin) for one in inputs.footprints]
    for footprint, origin in placed:
        mine = [facade for facade in found if edges.get(facade.id) == footprint.id]
        lost = [row for row in missing if edges.get(row.facade_id) == footprint.id]
        building, notes = make_building(
            footprint, mine, lost, origin, default_height_m, config.thermal
        )
        kind = archetype(config.thermal.country, building.year, config.thermal.default_year)
        buildings.append(building)
        archetypes[building.id] = kind
        rows.append(_building_row(building, kind, notes))
    loose = [facade for facade in found if facade.id not in edges]
    if not buildings and not loose:
        return [], [], []
    whole = assemble(buildings, archetypes, config.thermal, loose, origin=inputs.origin)
    about = {**stamp("model"), "config": config.as_dict(), "inputs": dict(inputs.hashes)}
    write_text(workspace.model, dump_json(_stamped(whole.hbjson, about)))
    for building, row in zip(buildings, rows, strict=True):
        single = assemble([building], archetypes, config.thermal, neighbours=buildings)
        write_text(workspace.building(building.id), dump_json(_stamped(single.hbjson, about)))
        row["notes"] += single.notes
    return buildings, loose, rows


def _stamped(hbjson: dict[str, Any], about: dict[str, Any]) -> dict[str, Any]:
    """The model with what made it in its user data: honeybee's schema has no other place."""
    user_data = hbjson["user_data"]
    return {**hbjson, "user_data": {**user_data, "si3fp": {**about, **user_data["si3fp"]}}}


def _building_row(building: Building, kind: Archetype, notes: Sequence[str]) -> dict[str, Any]:
    area = sum(facade.width_m * facade.height_m for facade in building.facades)
    glass = sum(w.area_m2 for facade in building.facades for w in facade.windows)
    interval = joint_interval(building.facades)
    return {
        "id": building.id,
        "storeys": building.storeys,
        "height_m": round(building.height_m, 3),
        "year": building.year,
        "facades": [facade.id for facade in building.facades],
        "wwr": round(glass / area, 5) if area else None,
        "wwr_interval": None if interval is None else rounded(interval, 5),
        "archetype": {"name": kind.name, **asdict(kind)},
        "notes": list(notes),
    }


def write_run(
    workspace: Workspace,
    inputs: RunInputs,
    missing: Sequence[Missing],
    buildings: Sequence[dict[str, Any]],
    about: Mapping[str, Any],
) -> None:
    """``run.json``: the only file with times and dates; ``about`` is particular to the path."""
    payload = {
        **about,
        "inputs": dict(inputs.hashes),
        "origin": origin_record(inputs.origin),
        "north_known": inputs.origin is not None,
        "footprints": [
            {
                "id": footprint.id,
                "outline_in_world": rounded(footprint.outline_in_world, 3),
                "ground_m": footprint.ground_m,
                "height_m": footprint.height_m,
                "storeys": footprint.storeys,
                "year": footprint.year,
            }
            for footprint in inputs.footprints
        ],
        "buildings": list(buildings),
        "missing": [missing_record(row) for row in missing],
        "notes": list(inputs.notes),
    }
    workspace.write_json(workspace.run_json, "run", payload)


def simulate_run(
    workspace: Workspace,
    epw: Path,
    say: Callable[[str], None] | None = None,
    north_deg: float | None = None,
) -> SimulationResult:
    """EnergyPlus on the run's model; ``simulation/result.json`` with the heating demand.

    Parameters
    ----------
    workspace
        The run.
    epw
        Weather file.
    say
        Gets a line of text whenever there is news.
    north_deg
        Compass bearing of the model's y axis, where the run could not tell it.

    Raises
    ------
    InputError
        If there is no model, or north is neither known nor given, or both.
    """
    if not workspace.model.exists():
        raise InputError(
            f"{workspace.root} holds no model.hbjson; run `si3fp street ... -o "
            f"{workspace.root}` or `si3fp photos ... -o {workspace.root}` first (a run without a "
            "scale has none)."
        )
    model = workspace.model
    if not north_is_known(_read_model(model)):
        model = _towards_north(workspace, north_deg)
    elif north_deg is not None:
        raise InputError(f"{model} knows where north is; leave out --north.")
    result = simulate(model, epw, workspace.simulation, progress=say)
    inputs = {"model": sha256_of(workspace.model), "weather": sha256_of(epw)}
    workspace.write_json(
        workspace.simulation_result,
        "simulation",
        {"inputs": inputs, "north_deg": north_deg, **result.as_dict()},
    )
    return result


def _read_model(file: Path) -> dict[str, Any]:
    content = read_json(file)
    if not isinstance(content, dict):
        raise InputError(f"{file} is not a honeybee model.")
    return content


def _towards_north(workspace: Workspace, north_deg: float | None) -> Path:
    hbjson = _read_model(workspace.model)
    if north_deg is None:
        rooms = (
            ""
            if hbjson.get("rooms")
            else (" Its walls also enclose no rooms to heat: a run with footprints has both.")
        )
        raise InputError(
            f"{workspace.model} does not know where north is: give --north DEG, the compass "
            f"bearing of its y axis, clockwise from north.{rooms}"
        )
    file = workspace.simulation / "model.hbjson"
    write_text(file, dump_json(turned(hbjson, north_deg)))
    return file
