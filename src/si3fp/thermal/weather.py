"""EnergyPlus weather files: checked, and their mean temperatures by month."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from si3fp.errors import InputError, MissingDependencyError

HEADER_LINES = 8
DRY_BULB_COLUMN = 6
HOURS = (8760, 8784)
ABSOLUTE_ZERO_C = -273.15
DEMO_CLIMATE = "Chicago"  # about 3500 kelvin days below 18 degC, as in southern Sweden


@dataclass(frozen=True, slots=True)
class Weather:
    """One year of weather.

    Attributes
    ----------
    name
        Place as the file gives it.
    text
        Content of the file, in ASCII: EnergyPlus's tables cannot hold other letters.
    outdoor_c
        Mean dry-bulb temperature of the twelve months.
    """

    name: str
    text: str
    outdoor_c: tuple[float, ...]


def read_weather(epw: Path) -> Weather:
    """A weather file, UTF-8 or Latin-1.

    Raises
    ------
    InputError
        If the file is missing, is not an EPW, or is cut short.
    """
    try:
        content = epw.read_bytes()
    except OSError as error:
        raise InputError(
            f"Could not read the weather file {epw}: {error.strerror or error}."
        ) from error
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    lines = text.splitlines()
    if not lines or not lines[0].upper().startswith("LOCATION,"):
        raise InputError(
            f"{epw} is not an EnergyPlus weather file: its first line must begin with LOCATION, "
            f"got {lines[0][:40]!r}."
            if lines
            else f"{epw} is empty; an EnergyPlus weather file is needed."
        )
    hours = [line for line in lines[HEADER_LINES:] if line.strip()]
    if len(hours) not in HOURS:
        raise InputError(
            f"{epw} has {len(hours)} hours of weather, not the 8760 or 8784 of a year; "
            "download it again."
        )
    sums, counts = [0.0] * 12, [0] * 12
    for number, line in enumerate(hours, start=HEADER_LINES + 1):
        fields = line.split(",")
        try:
            month, dry_bulb_c = int(fields[1]), float(fields[DRY_BULB_COLUMN])
            if not (1 <= month <= 12 and ABSOLUTE_ZERO_C < dry_bulb_c < 70):
                raise ValueError
        except (ValueError, IndexError) as error:
            raise InputError(
                f"{epw}, line {number}, is not an hour of weather: {line[:60]!r}."
            ) from error
        sums[month - 1] += dry_bulb_c
        counts[month - 1] += 1
    if not all(counts):
        raise InputError(f"{epw} lacks a month; a weather file of a whole year is needed.")
    return Weather(
        name=",".join(lines[0].split(",")[1:4]),
        text=text.encode("ascii", "replace").decode("ascii"),
        outdoor_c=tuple(total / count for total, count in zip(sums, counts, strict=True)),
    )


def shipped_epw() -> Path:
    """A weather file of a cold climate that the EnergyPlus wheel of the extra ``energy`` brings.

    Raises
    ------
    MissingDependencyError
        If the wheel is not installed.
    """
    spec = find_spec("pyenergyplus")
    roots = list(spec.submodule_search_locations or []) if spec else []
    files = sorted(path for root in roots for path in Path(root).rglob("*.epw"))
    if not files:
        raise MissingDependencyError(
            "No weather file was found, as EnergyPlus is not installed. "
            "Install it with: pip install 'si3fp[energy]'"
        )
    return next((path for path in files if DEMO_CLIMATE in path.name), files[0])
