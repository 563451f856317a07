"""Thermal archetypes: U-values and g by country and construction year, from the TABULA tables.

Source: TABULA / EPISCOPE, Institut Wohnen und Umwelt, CC BY 4.0; see ``data/README.md``.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from importlib import resources

from si3fp.errors import InputError

OPEN_END_YEAR = 9999


@dataclass(frozen=True, slots=True)
class Archetype:
    """The envelope of a typical multi-family house of one country and period.

    Attributes
    ----------
    country
        ISO 3166-1 alpha-2.
    period
        First and last construction year of the class, inclusive; 0 and 9999 are open ends.
    u_wall_w_m2k, u_roof_w_m2k, u_floor_w_m2k, u_window_w_m2k
        Thermal transmittances, W/(m2K), surface resistances included.
    g_window
        Total solar transmittance of the glazing (without the frame) at normal incidence.
    notes
        What was assumed: a missing year, a year after the last class.
    """

    country: str
    period: tuple[int, int]
    u_wall_w_m2k: float
    u_roof_w_m2k: float
    u_floor_w_m2k: float
    u_window_w_m2k: float
    g_window: float
    notes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Short name, for example ``SE-1961-1975``; open ends are left out."""
        first, last = self.period
        return "-".join(
            [self.country, "until" if first == 0 else str(first)]
            + ([] if last == OPEN_END_YEAR else [str(last)])
        )


@cache
def _table() -> dict[str, dict[tuple[int, int], dict[str, dict[str, str]]]]:
    table: dict[str, dict[tuple[int, int], dict[str, dict[str, str]]]] = {}
    text = (resources.files("si3fp.thermal") / "data" / "tabula.csv").read_text(encoding="utf-8")
    for row in csv.DictReader(text.splitlines()):
        period = int(row["year_from"]), int(row["year_to"])
        table.setdefault(row["country"], {}).setdefault(period, {})[row["element"]] = row
    return table


def countries() -> tuple[str, ...]:
    """Codes of the countries that have archetypes, sorted."""
    return tuple(sorted(_table()))


def archetype(country: str, year: int | None, default_year: int) -> Archetype:
    """The archetype of a construction year.

    Parameters
    ----------
    country
        ISO 3166-1 alpha-2, in either case.
    year
        Construction year; None where unknown.
    default_year
        Used, and noted, where the year is unknown.

    Raises
    ------
    InputError
        If the tables do not have the country, or the year is not one.

    Examples
    --------
    >>> archetype("SE", 1968, 1970).name
    'SE-1961-1975'
    >>> archetype("SE", 2019, 1970).notes
    ('Built in 2019, after the last TABULA class of SE: the class 1996-2005 is used.',)
    """
    code = country.strip().upper()
    if code not in _table():
        raise InputError(
            f"There is no TABULA archetype for country {country!r}. "
            f"Choose one of: {', '.join(countries())}."
        )
    used_year = default_year if year is None else year
    if not 0 < used_year < OPEN_END_YEAR:
        raise InputError(f"{used_year} is not a construction year.")
    notes = []
    if year is None:
        notes.append(f"The construction year is unknown: {default_year} is assumed.")
    periods = sorted(_table()[code])
    period = next((span for span in periods if span[0] <= used_year <= span[1]), None)
    if period is None:
        period = periods[-1]
        notes.append(
            f"Built in {used_year}, after the last TABULA class of {code}: "
            f"the class {period[0]}-{period[1]} is used."
        )
    rows = _table()[code][period]
    return Archetype(
        country=code,
        period=period,
        u_wall_w_m2k=float(rows["wall"]["u_w_m2k"]),
        u_roof_w_m2k=float(rows["roof"]["u_w_m2k"]),
        u_floor_w_m2k=float(rows["floor"]["u_w_m2k"]),
        u_window_w_m2k=float(rows["window"]["u_w_m2k"]),
        g_window=float(rows["window"]["g"]),
        notes=tuple(notes),
    )
