"""Write src/si3fp/thermal/data/tabula.csv from the TABULA workbook (``pip install openpyxl``).

    python tools/extract_tabula.py tabula-values.xlsx src/si3fp/thermal/data/tabula.csv

The workbook is "tabula-values.xlsx" of IWU's EnergyProfile package (CC BY 4.0); where it comes from
and how a row is chosen stands in src/si3fp/thermal/data/README.md.
"""

from __future__ import annotations

import argparse
import csv
import re
import statistics
from pathlib import Path
from typing import Any

from openpyxl import load_workbook  # type: ignore[import-untyped]

HEADER_ROWS = 10
ELEMENTS = {"wall": ("Wall",), "roof": ("Roof", "Ceiling"), "floor": ("Floor",)}
ELEMENTS["window"] = ("Window",)
U_RANGE_W_M2K = (0.05, 7.0)
# Single panes have mostly been replaced: taken only where a class has nothing else.
SINGLE_GLAZING_U_W_M2K = 4.0
# Not the usual envelope of a heated flat, or not the building as built.
EXCLUDED = re.compile(
    r"basement wall|cellar wall|passive house|passivhaus|\bPH\b|\bNZEB\b|starting point", re.I
)
MULTI_FAMILY = re.compile(r"multi-? ?(family|unit)|apartment|\bMFH\b", re.I)
SINGLE_FAMILY = re.compile(r"single-? ?(family|unit)|\bSFH\b|terraced", re.I)

Row = dict[str, Any]


def read_sheet(workbook: Any, name: str) -> list[Row]:
    """Rows of a sheet as dictionaries by the header's codes."""
    rows = list(workbook[name].iter_rows(values_only=True))
    return [
        {key: value for key, value in zip(rows[0], row, strict=False) if key}
        for row in rows[HEADER_ROWS:]
        if row[0] and row[1] == "Typology"
    ]


def year_classes(rows: list[Row]) -> dict[str, list[Row]]:
    """Construction year classes by country in order of time, without those that merge others."""
    by_country: dict[str, list[Row]] = {}
    for row in rows:
        if int(row["ConstructionYearClass_LastYear"]) > 0:
            by_country.setdefault(row["Code_Country"], []).append(row)

    def span(row: Row) -> tuple[int, int]:
        return int(row["ConstructionYearClass_FirstYear"]), int(
            row["ConstructionYearClass_LastYear"]
        )

    for country, classes in by_country.items():
        spans = [span(row) for row in classes]
        by_country[country] = sorted(
            (
                row
                for row in classes
                if not any(
                    span(row)[0] <= first and last <= span(row)[1] and span(row) != (first, last)
                    for first, last in spans
                )
            ),
            key=span,
        )
    return by_country


def description(row: Row) -> str:
    """The English words of a construction."""
    return f"{row['Type_Construction'] or ''} {row['Description_Construction'] or ''}"


def is_usable(row: Row) -> bool:
    """Whether the row is a plausible construction of the heated envelope as built."""
    u = row["U"]
    return (
        isinstance(u, int | float)
        and U_RANGE_W_M2K[0] <= u <= U_RANGE_W_M2K[1]
        and not EXCLUDED.search(description(row))
    )


def multi_family(rows: list[Row]) -> tuple[list[Row], str]:
    """The rows of multi-family houses where the table tells, else all; and the rule's name."""
    if rows and rows[0]["Code_Country"] == "SE":
        # Sweden's variant 1 is the single-family and variant 2 the multi-family house; only the
        # walls say so in words, the other elements follow the same order.
        chosen = [row for row in rows if int(row["Number_Construction_Variant"]) == 2]
        if chosen:
            return chosen, "multi-family"
    chosen = [row for row in rows if MULTI_FAMILY.search(description(row))]
    if chosen:
        return chosen, "multi-family"
    return [row for row in rows if not SINGLE_FAMILY.search(description(row))] or rows, "all types"


def is_built_in(row: Row, year_class: Row) -> bool:
    """Whether a construction belongs to the class, or its closed span of years covers the class.

    Open spans ("until now") are left out: they say that a construction still exists, not that it
    is still built.
    """
    if row["Code_Construction_ConstructionYearClass"] == year_class["Code_ConstructionYearClass"]:
        return True
    first, last = row["Year1_Construction"], row["Year2_Construction"]
    return (
        isinstance(first, int | float)
        and isinstance(last, int | float)
        and last < 9999
        and first <= year_class["ConstructionYearClass_FirstYear"]
        and last >= year_class["ConstructionYearClass_LastYear"]
    )


def choose(rows: list[Row], year_class: Row) -> tuple[list[Row], str]:
    """Constructions of one element and class: real buildings before averages of the stock."""
    mine = [row for row in rows if is_built_in(row, year_class)]
    built = [row for row in mine if row["Code_DataType_Construction"] != "SyAv"] or mine
    double = [row for row in built if row["U"] <= SINGLE_GLAZING_U_W_M2K]
    is_window = bool(built) and built[0]["Code_ElementType"] == "Window"
    return multi_family(double or built if is_window else built)


def median_row(rows: list[Row]) -> Row:
    """The construction with the median U-value, the higher of two: the lower is often a repair."""
    middle = statistics.median_high([float(row["U"]) for row in rows])
    return next(row for row in rows if float(row["U"]) == middle)


def solar_transmittance(window: Row, windows: list[Row]) -> tuple[float, str]:
    """Solar transmittance of a window, else that of the country's window with the nearest U."""
    if isinstance(window["g_gl_n"], int | float):
        return float(window["g_gl_n"]), ""
    known = [row for row in windows if isinstance(row["g_gl_n"], int | float)]
    nearest = min(known, key=lambda row: (abs(row["U"] - window["U"]), row["Code_Construction"]))
    return float(nearest["g_gl_n"]), f"g of {nearest['Code_Construction']}"


def extract(workbook: Any) -> list[list[Any]]:
    """All rows of the table."""
    constructions = [row for row in read_sheet(workbook, "Tab.Building.Constr") if is_usable(row)]
    table: list[list[Any]] = []
    for country, classes in sorted(
        year_classes(read_sheet(workbook, "Tab.ConstrYearClass")).items()
    ):
        mine = [row for row in constructions if row["Code_Country"] == country]
        by_element = {
            element: sorted(
                (row for row in mine if row["Code_ElementType"] in types),
                key=lambda row: str(row["Code_Construction"]),
            )
            for element, types in ELEMENTS.items()
        }
        if not all(by_element.values()):
            continue
        for element, rows in by_element.items():
            chosen = [choose(rows, row) for row in classes]
            first = next(i for i, (found, _) in enumerate(chosen) if found)
            for i, row in enumerate(classes):
                found, rule = chosen[i]
                if not found:  # the tables name a construction only in its first class
                    source = i - 1 if i > first else first
                    found, rule = chosen[source][0], f"{chosen[source][1].split(';')[0]}; carried"
                    chosen[i] = (found, rule)
                pick = median_row(found)
                g, note = solar_transmittance(pick, rows) if element == "window" else ("", "")
                table.append(
                    [
                        country,
                        int(row["ConstructionYearClass_FirstYear"]),
                        int(row["ConstructionYearClass_LastYear"]),
                        element,
                        round(float(pick["U"]), 3),
                        g,
                        pick["Code_Construction"],
                        "; ".join(part for part in (rule, f"median of {len(found)}", note) if part),
                    ]
                )
    return table


def main() -> None:
    """Read the arguments, write the file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("workbook", type=Path)
    parser.add_argument("output", type=Path)
    arguments = parser.parse_args()
    table = extract(load_workbook(arguments.workbook, read_only=True, data_only=True))
    with arguments.output.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(
            ["country", "year_from", "year_to", "element", "u_w_m2k", "g", "construction", "rule"]
        )
        writer.writerows(sorted(table, key=lambda row: (row[0], row[1], row[3])))


if __name__ == "__main__":
    main()
