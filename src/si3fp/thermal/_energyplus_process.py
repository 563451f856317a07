"""The process that runs EnergyPlus: ``python -m si3fp.thermal._energyplus_process JOB.json``.

Only this process imports honeybee-energy and pyenergyplus (licences of their own); it is started by
`si3fp.thermal.energyplus` and talks to it through files and lines on stdout. The job is
``{"hbjson", "epw", "folder", "ground_c": 12 monthly temperatures below the lowest floor}``.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

HEATING = "Zone Ideal Loads Supply Air Total Heating Energy"
IDEAL_LOADS_SUFFIX = "..si3fp ideal loads"


def _object(kind: str, *values: object) -> str:
    return f"{kind},\n  " + ",\n  ".join(str(value) for value in values) + ";\n"


def _run_objects(version: str, ground_c: list[float]) -> list[str]:
    """Objects of one annual run with monthly heating as output."""
    return [
        _object("Version", version),
        _object("Timestep", 4),
        _object("SimulationControl", "No", "No", "No", "No", "Yes"),
        _object("Building", "si3fp", 0, "Suburbs", 0.04, 0.4, "FullExterior", 25, 6),
        _object("GlobalGeometryRules", "UpperLeftCorner", "Counterclockwise", "Relative"),
        _object("RunPeriod", "year", 1, 1, "", 12, 31, "", "Monday", "No", "No", "No"),
        _object("Site:GroundTemperature:BuildingSurface", *(f"{t:.3f}" for t in ground_c)),
        _object("Output:Variable", "*", HEATING, "Monthly"),
        _object("Output:SQLite", "Simple"),
        _object("ScheduleTypeLimits", "si3fp control type", 0, 4, "Discrete"),
        _object("Schedule:Constant", "si3fp heating only", "si3fp control type", 1),
    ]


def _ideal_heating(zone: str, setpoint_schedule: str, outdoor_air: str) -> list[str]:
    """Thermostat and unlimited ideal heating of one zone; it supplies its outdoor air always."""
    system = f"{zone}{IDEAL_LOADS_SUFFIX}"
    equipment, supply, node = f"{zone}..list", f"{zone}..supply", f"{zone}..air"
    back, outside = f"{zone}..return", f"{zone}..outside"
    limits = ["NoLimit", "", "", "NoLimit", "", ""]
    return [
        _object("ThermostatSetpoint:SingleHeating", f"{zone}..setpoint", setpoint_schedule),
        _object(
            "ZoneControl:Thermostat",
            f"{zone}..thermostat",
            zone,
            "si3fp heating only",
            "ThermostatSetpoint:SingleHeating",
            f"{zone}..setpoint",
        ),
        _object("ZoneHVAC:EquipmentConnections", zone, equipment, supply, "", node, back),
        _object(
            "ZoneHVAC:EquipmentList",
            equipment,
            "SequentialLoad",
            "ZoneHVAC:IdealLoadsAirSystem",
            system,
            1,
            1,
        ),
        _object(
            "ZoneHVAC:IdealLoadsAirSystem",
            *(system, "", supply, "", "", 50, 13, 0.0156, 0.0077),
            *(*limits, "", "", "None", 0.7, "None"),
            *(outdoor_air, outside if outdoor_air else "", "None", "NoEconomizer", "None"),
        ),
        *([_object("OutdoorAir:Node", outside)] if outdoor_air else []),
    ]


def write_idf(model: Any, version: str, ground_c: list[float]) -> str:
    """The IDF of a honeybee model; its rooms with ideal air and a setpoint are heated."""
    heated = []
    for room in model.rooms:
        energy = room.properties.energy
        if energy.is_conditioned and energy.setpoint is not None:
            air = energy.ventilation
            outdoor_air = "" if air is None else f"{air.identifier}..{room.identifier}"
            schedule = energy.setpoint.heating_schedule.identifier
            heated += _ideal_heating(room.identifier, schedule, outdoor_air)
        energy.hvac = None  # honeybee would write templates that EnergyPlus cannot read
    if not heated:
        raise SystemExit("No room of the model has heating and a setpoint.")
    return "\n".join([*_run_objects(version, ground_c), model.to.idf(model), *heated])


def main(job_path: Path) -> int:
    """EnergyPlus's exit code."""
    import honeybee_energy  # noqa: F401, PLC0415 - extends honeybee's models
    from honeybee.model import Model  # noqa: PLC0415 - only this process may import it
    from pyenergyplus.api import EnergyPlusAPI  # type: ignore[import-untyped] # noqa: PLC0415

    job = json.loads(job_path.read_text(encoding="utf-8"))
    folder = Path(job["folder"])
    _say("writing the input file")
    api = EnergyPlusAPI()
    version = api.functional.ep_version()
    idf = folder / "in.idf"
    idf.write_text(
        write_idf(
            Model.from_hbjson(job["hbjson"]),
            f"{version.ep_version_major}.{version.ep_version_minor}",
            job["ground_c"],
        ),
        encoding="utf-8",
    )
    state = api.state_manager.new_state()
    api.runtime.set_console_output_status(state, False)
    api.runtime.callback_progress(state, lambda percent: _say(f"EnergyPlus {percent} %"))
    return int(api.runtime.run_energyplus(state, ["-d", str(folder), "-w", job["epw"], str(idf)]))


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
