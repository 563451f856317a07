"""Real buildings as plans: CityGML of level of detail 3, dressed with finishes and windows.

Positions and sizes of walls and openings are the survey's, simplified to plane walls on the
outline of the ground and rectangles in them; the survey has no looks, so those are drawn.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from benchmarks.estate.drawing import millimetres, rng_of
from benchmarks.estate.plan import Building, Estate, Roof, Street, Wall
from benchmarks.estate.plans.citygml_dress import Look, drawn_look, finished_opening, wall_extras
from benchmarks.estate.plans.citygml_file import SurveyedBuilding, read_city_file
from benchmarks.estate.plans.citygml_roof import fitting, roof_of
from benchmarks.estate.plans.citygml_walls import (
    FoundOpening,
    FoundWall,
    ground_outline,
    merged,
    placed,
    walls_of,
)
from benchmarks.estate.plans.daylight import light_on
from benchmarks.estate.site.placing import with_surroundings

from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin

FOLDER = "lod3-ingolstadt"
STOREY_M = 3.1
ROAD_M = 7.0
KERB_M = 9.0  # from the building to the road
BEYOND_M = 95.0  # the road runs on past the building
SAME_SIDE = 0.94  # cosine between walls of one side
DRIVEN_BEYOND_M = 10.0  # and the vehicle


@dataclass(frozen=True)
class Survey:
    """What became of the openings of a survey.

    Attributes
    ----------
    openings, kept
        Openings in the file and in the plans.
    gone
        How many were joined with others or left out, by reason; with ``kept`` they make
        ``openings``.
    flattened
        Kept ones that were moved from a bay or a recess onto the plane of their wall.
    recess_measured
        Kept ones whose recess is the survey's; the others' is drawn.
    """

    openings: int
    kept: int
    gone: Mapping[str, int]
    flattened: int
    recess_measured: int

    def __str__(self) -> str:
        gone = ", ".join(f"{count} {reason}" for reason, count in self.gone.items())
        kept = f"The plan has {self.kept} of {self.openings} surveyed openings"
        return f"{kept}; joined or left out: {gone}." if gone else f"{kept}."


@dataclass(frozen=True)
class Reading:
    """Plans of a file's buildings, and what became of their openings; ground at z = 0."""

    origin: GeoOrigin
    buildings: tuple[Building, ...]
    survey: Survey


def read_citygml(path: Path, seed: int = 1) -> Reading:
    """The buildings of a CityGML file, and what became of its openings.

    Parameters
    ----------
    path
        A file of level of detail 3 in a projected system in metres.
    seed
        Draws finishes, windows' frames and what is behind the glass.

    Raises
    ------
    InputError
        If the file cannot be read or has no ground.
    """
    file = read_city_file(path)
    gone: Counter[str] = Counter()
    kept: list[FoundOpening] = []
    buildings = []
    for number, surveyed in enumerate(file.buildings):
        name = path.stem if len(file.buildings) == 1 else f"{path.stem}.{number + 1}"
        building, found = _building(surveyed, name, seed, gone)
        buildings.append(building)
        kept.extend(found)
    return Reading(
        file.origin,
        tuple(buildings),
        Survey(
            sum(len(surveyed.openings) for surveyed in file.buildings),
            len(kept),
            dict(sorted(gone.items())),
            sum(opening.flattened for opening in kept),
            sum(opening.recess_m is not None for opening in kept),
        ),
    )


def ingolstadt_estate(stem: str, seed: int, folder: Path | None = None) -> Estate:
    """One real building with a street along the side with most windows, and surroundings.

    Parameters
    ----------
    stem
        Name of a file without its ending.
    seed
        Of looks and surroundings.
    folder
        Folder of the files; by default ``lod3-ingolstadt`` in that of ``SI3FP_TEST_DATA``.

    Raises
    ------
    InputError
        If the folder is not known or has no such file.
    """
    reading = read_citygml(_city_file(stem, folder), seed)
    street = _street(reading.buildings)
    driven = _driven(street, reading.buildings)
    light = light_on(reading.buildings, (driven,), reading.origin, rng_of(seed, stem, "light"))
    return with_surroundings(
        f"ingolstadt-{stem}",
        seed,
        reading.origin,
        reading.buildings,
        (street,),
        (driven,),
        light=light,
        trees=0.6,
        hedges=0.4,
    )


def ingolstadt_survey(stem: str, folder: Path | None = None) -> Survey:
    """What became of the openings of that building, whatever the seed."""
    return read_citygml(_city_file(stem, folder)).survey


def _city_file(stem: str, folder: Path | None) -> Path:
    folder = folder or _data_folder()
    path = folder / f"{stem}.xml"
    if not path.is_file():
        there = ", ".join(sorted(file.stem for file in folder.glob("*.xml"))) or "no XML file"
        raise InputError(f"There is no building {stem!r} in {folder}; it has {there}.")
    return path


def _data_folder() -> Path:
    data = os.environ.get("SI3FP_TEST_DATA")
    if not data:
        raise InputError(
            "Where the CityGML files are is not known: set SI3FP_TEST_DATA to the folder that "
            f"holds {FOLDER}."
        )
    return Path(data) / FOLDER


def _building(
    surveyed: SurveyedBuilding, name: str, seed: int, gone: Counter[str]
) -> tuple[Building, list[FoundOpening]]:
    walls = walls_of(surveyed, ground_outline(surveyed))
    on_walls: list[list[FoundOpening]] = [[] for _ in walls]
    for opening in surveyed.openings:
        place = placed(opening, walls, surveyed.walls)
        if isinstance(place, str):
            gone[place] += 1
        else:
            on_walls[place[0]].append(place[1])
    joined = [merged(openings, gone) for openings in on_walls]
    eaves_m, roof, gables = roof_of(walls, joined)
    kept = [
        fitting(wall, eaves_m, roof.rise_m if i in gables else 0.0, openings, gone)
        for i, (wall, openings) in enumerate(zip(walls, joined, strict=True))
    ]
    look = drawn_look(rng_of(seed, name, "look"), [o for openings in kept for o in openings])
    storeys = max(1, round(eaves_m / STOREY_M))
    return (
        Building(
            id=name,
            walls=tuple(
                _wall(f"{name}-{i}", wall, eaves_m, roof.rise_m, i in gables, found, look, seed)
                for i, (wall, found) in enumerate(zip(walls, kept, strict=True))
            ),
            height_m=eaves_m,
            storeys=storeys,
            storey_m=millimetres(eaves_m / storeys),
            year=look.year,
            roof=Roof(roof.kind, roof.rise_m, roof.overhang_m, look.roof_rgb, roof.fascia_m),
        ),
        [opening for openings in kept for opening in openings],
    )


def _wall(
    name: str,
    wall: FoundWall,
    eaves_m: float,
    rise_m: float,
    gable: bool,
    openings: Sequence[FoundOpening],
    look: Look,
    seed: int,
) -> Wall:
    start, end = (tuple(millimetres(v) for v in point) for point in (wall.start, wall.end))
    width_m = float(np.hypot(end[0] - start[0], end[1] - start[1]))
    outline = None
    if gable:
        peak = (width_m / 2, eaves_m + rise_m)
        outline = ((0.0, 0.0), (width_m, 0.0), (width_m, eaves_m), peak, (0.0, eaves_m))
    finished = tuple(
        finished_opening(opening, look, rng_of(seed, name, number))
        for number, opening in enumerate(openings)
    )
    return Wall(
        id=name,
        start=start,
        end=end,
        height_m=millimetres(eaves_m + rise_m) if gable else eaves_m,
        finish=look.finish,
        openings=finished,
        ornaments=wall_extras(width_m, eaves_m, finished, look),
        plinth_m=look.plinth_m,
        plinth_rgb=look.plinth_rgb,
        outline=outline,
    )


def _street(buildings: Sequence[Building]) -> Street:
    """A road along the side with most window area, in front of all that stands out farther."""
    walls = [wall for building in buildings for wall in building.walls]
    outward = np.array([wall.world_from_facade.rotation[:2, 2] for wall in walls])
    areas_m2 = [sum(o.width_m * o.height_m for o in wall.openings) for wall in walls]
    per_side_m2 = (outward @ outward.T > SAME_SIDE) @ np.array(areas_m2)
    # Rounded, so that a front's own walls stand equal and the widest of them decides.
    keys = [
        (round(float(side), 6), wall.width_m, wall.id)
        for side, wall in zip(per_side_m2, walls, strict=True)
    ]
    wall = walls[keys.index(max(keys))]
    start, end = np.array(wall.start), np.array(wall.end)
    along = (end - start) / wall.width_m
    front = np.array([along[1], -along[0]])
    corners = np.concatenate([building.outline for building in buildings]) - start
    away_m = (corners @ front).max() + KERB_M + ROAD_M / 2
    reach = corners @ along
    ends = (
        start + along * x + front * away_m for x in (reach.min() - BEYOND_M, reach.max() + BEYOND_M)
    )
    first, last = (tuple(millimetres(v) for v in point) for point in ends)
    return Street((first, last), ROAD_M)


def _driven(street: Street, buildings: Sequence[Building]) -> tuple[tuple[float, float], ...]:
    """The part of a straight street along the buildings."""
    start, end = (np.array(point) for point in street.line)
    along = (end - start) / np.linalg.norm(end - start)
    reach = (np.concatenate([building.outline for building in buildings]) - start) @ along
    ends = (reach.min() - DRIVEN_BEYOND_M, reach.max() + DRIVEN_BEYOND_M)
    points = (start + along * x for x in ends)
    return tuple((millimetres(x), millimetres(y)) for x, y in points)
