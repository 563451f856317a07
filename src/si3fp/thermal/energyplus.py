"""M.2: heating demand of a thermal model with EnergyPlus, which runs in a process of its own.

honeybee-energy writes the building, si3fp the ideal heating; see docs/decisions/0005.
"""

from __future__ import annotations

import json
import re
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from si3fp.errors import InputError, MissingDependencyError, SimulationError, SourceError
from si3fp.thermal._energyplus_process import HEATING, IDEAL_LOADS_SUFFIX
from si3fp.thermal.constructions import HEATING_SETPOINT_C
from si3fp.thermal.weather import read_weather, shipped_epw

__all__ = ["BuildingDemand", "SimulationResult", "shipped_epw", "simulate"]

SOIL_FACTOR = 0.5  # TABULA Tab.Const.ConstrBorder "Soil", b_Transmission
JOULE_PER_KWH = 3.6e6


@dataclass(frozen=True, slots=True)
class BuildingDemand:
    """Useful heat that a building needs in a year.

    Attributes
    ----------
    id
        The building.
    floor_area_m2
        Gross floor area of all storeys.
    heating_kwh_by_month
        January to December.
    heating_kwh, heating_kwh_m2
        Sum, and per floor area.
    """

    id: str
    floor_area_m2: float
    heating_kwh_by_month: tuple[float, ...]
    heating_kwh: float
    heating_kwh_m2: float


@dataclass(frozen=True, slots=True)
class SimulationResult:
    """Heating demand of the buildings of a model.

    Attributes
    ----------
    buildings
        One row per building, in the model's order.
    weather
        Place of the weather file.
    energyplus
        EnergyPlus's version.
    warnings
        Severe errors and warnings of eplusout.err in spite of which the year was completed, such as
        that concave roofs cast inexact shadows; one line each.
    """

    buildings: tuple[BuildingDemand, ...]
    weather: str
    energyplus: str
    warnings: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return asdict(self)


def simulate(
    hbjson: Path, epw: Path, folder: Path, progress: Callable[[str], None] | None = None
) -> SimulationResult:
    """Heating demand of every building of a model in a year of weather.

    Parameters
    ----------
    hbjson
        A model of `si3fp.thermal.assemble`, or another honeybee model in metres.
    epw
        EnergyPlus weather file.
    folder
        EnergyPlus's files go here: ``in.idf``, ``eplusout.err``, ``eplusout.sql`` and others.
    progress
        Gets a line of text whenever there is news.

    Raises
    ------
    MissingDependencyError
        If the extra ``energy`` is not installed.
    InputError
        If the model or the weather file cannot be read.
    SimulationError
        If EnergyPlus stops; with its severe and fatal errors.
    """
    for package in ("honeybee_energy", "pyenergyplus"):
        if find_spec(package) is None:
            raise MissingDependencyError(
                f"A simulation needs the package {package}. "
                "Install it with: pip install 'si3fp[energy]'"
            )
    rooms = _read_rooms(hbjson)
    weather = read_weather(epw)
    folder = folder.resolve()
    weather_copy, job = folder / "weather.epw", folder / "job.json"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("eplusout.*"):
            old.unlink()
        weather_copy.write_text(weather.text, encoding="ascii")
        job.write_text(
            json.dumps(
                {
                    "hbjson": str(hbjson.resolve()),
                    "epw": str(weather_copy),
                    "folder": str(folder),
                    "ground_c": [
                        SOIL_FACTOR * outdoor_c + (1 - SOIL_FACTOR) * HEATING_SETPOINT_C
                        for outdoor_c in weather.outdoor_c
                    ],
                }
            ),
            encoding="utf-8",
        )
    except OSError as error:
        raise SourceError(f"Could not write to {folder}: {error.strerror or error}.") from error
    _run(job, folder, progress or (lambda line: None))
    heating_j, version = _read_heating(folder / "eplusout.sql")
    return SimulationResult(
        buildings=tuple(_demands(rooms, heating_j)),
        weather=weather.name,
        energyplus=version,
        warnings=tuple(
            f"{kind}: {message}"
            for kind in ("Severe", "Warning")
            for message in _messages(folder / "eplusout.err", kind)
        ),
    )


def _run(job: Path, folder: Path, progress: Callable[[str], None]) -> None:
    """Run the process to its end; it is killed when this one is interrupted."""
    command = [sys.executable, "-P", "-m", "si3fp.thermal._energyplus_process", str(job)]
    log = folder / "process.log"
    with (
        log.open("w", encoding="utf-8") as errors,
        subprocess.Popen(  # noqa: S603 - our own interpreter and module
            command, stdout=subprocess.PIPE, stderr=errors, text=True, cwd=folder
        ) as process,
    ):
        try:
            for line in process.stdout or ():
                progress(line.strip())
            code = process.wait()
        except BaseException:
            process.kill()
            raise
    errors_file = folder / "eplusout.err"
    fatal = _messages(errors_file, "Fatal")
    if code != 0 or fatal:
        said = [*_messages(errors_file, "Severe"), *fatal]
        source = errors_file if said else log
        if not said:
            said = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()[-5:]
        raise SimulationError(
            f"EnergyPlus failed (exit code {code}) in {folder}:\n  "
            + "\n  ".join(said or ["it said nothing"])
            + f"\nSee {source}."
        )


def _messages(errors_file: Path, kind: str) -> list[str]:
    """Messages of one kind in eplusout.err, each with its continuation lines joined."""
    if not errors_file.exists():
        return []
    messages: list[str] = []
    open_message = False
    for line in errors_file.read_text(encoding="utf-8", errors="replace").splitlines():
        found = re.match(r"\s*\*+\s*(Warning|Severe|Fatal|~~~)\s*\*+\s*(.*)", line)
        if not found:
            open_message = False
        elif found[1] != "~~~":
            open_message = found[1] == kind
            if open_message:
                messages.append(found[2].strip())
        elif open_message:
            messages[-1] += f" {found[2].strip()}"
    return messages


def _read_rooms(hbjson: Path) -> dict[str, tuple[str, float]]:
    """Building id and floor area (m2) by the upper-case identifier of a room."""
    try:
        model = json.loads(hbjson.read_text(encoding="utf-8"))
        rooms = {
            room["identifier"].upper(): (_building_of(room), _floor_area_m2(room))
            for room in model.get("rooms") or ()
        }
        units = model.get("units", "Meters")
    except OSError as error:
        raise InputError(f"Could not read {hbjson}: {error.strerror or error}.") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{hbjson} is not a honeybee model: {error!r}.") from error
    if units != "Meters":
        raise InputError(f"{hbjson} is in {units}; convert it to Meters.")
    if not rooms:
        raise InputError(
            f"{hbjson} has no rooms to heat: without footprints there are only loose walls. "
            "Give the footprints of the buildings."
        )
    return rooms


def _building_of(room: dict[str, Any]) -> str:
    """The building that si3fp wrote; in other models every room counts for itself."""
    return str((room.get("user_data") or {}).get("building_id", room["identifier"]))


def _floor_area_m2(room: dict[str, Any]) -> float:
    area_m2 = 0.0
    for face in room["faces"]:
        if face["face_type"] == "Floor":
            for sign, ring in (
                (1, face["geometry"]["boundary"]),
                *((-1, hole) for hole in face["geometry"].get("holes") or ()),
            ):
                area_m2 += sign * abs(_shoelace_m2(ring))
    return area_m2


def _shoelace_m2(ring: list[list[float]]) -> float:
    pairs = zip(ring, ring[1:] + ring[:1], strict=True)
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs) / 2


def _read_heating(sql: Path) -> tuple[dict[str, list[float]], str]:
    """Heating in joules of the twelve months by the upper-case name of a zone, and the version."""
    query = """
        SELECT names.KeyValue, time.Month, data.Value
        FROM ReportData AS data
        JOIN ReportDataDictionary AS names
          ON names.ReportDataDictionaryIndex = data.ReportDataDictionaryIndex
        JOIN Time AS time ON time.TimeIndex = data.TimeIndex
        WHERE names.Name = ?
    """
    heating_j: dict[str, list[float]] = {}
    try:
        with closing(sqlite3.connect(f"file:{sql}?mode=ro", uri=True)) as database:
            for key, month, value in database.execute(query, (HEATING,)):
                zone = key.upper().removesuffix(IDEAL_LOADS_SUFFIX.upper())
                heating_j.setdefault(zone, [0.0] * 12)[month - 1] += value
            (version,) = database.execute("SELECT EnergyPlusVersion FROM Simulations").fetchone()
    except (sqlite3.Error, TypeError) as error:
        raise SimulationError(f"EnergyPlus's results in {sql} cannot be read: {error}.") from error
    return heating_j, str(version).split(", YMD")[0]


def _demands(
    rooms: dict[str, tuple[str, float]], heating_j: dict[str, list[float]]
) -> Iterable[BuildingDemand]:
    """Rooms summed by building."""
    for building_id in dict.fromkeys(building_id for building_id, _ in rooms.values()):
        own = {name: area for name, (owner, area) in rooms.items() if owner == building_id}
        months = [
            sum(heating_j.get(name, [0.0] * 12)[month] for name in own) / JOULE_PER_KWH
            for month in range(12)
        ]
        area_m2 = sum(own.values())
        yield BuildingDemand(
            id=building_id,
            floor_area_m2=area_m2,
            heating_kwh_by_month=tuple(months),
            heating_kwh=sum(months),
            heating_kwh_m2=sum(months) / area_m2 if area_m2 else 0.0,
        )
