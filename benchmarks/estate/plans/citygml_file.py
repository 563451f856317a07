"""Buildings as a CityGML file surveys them: rings of ground and walls, outlines of openings."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pyproj
from numpy.typing import NDArray

from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin, world_from_geodetic

FloatArray = NDArray[np.float64]
MAX_BYTES = 64 * 1024 * 1024


@dataclass(frozen=True, eq=False)
class SurveyedOpening:
    """A window or door: its id and the rings (V, 3) that it is made of, panes and frames alike."""

    id: str
    kind: Literal["window", "door"]
    rings: tuple[FloatArray, ...]


@dataclass(frozen=True, eq=False)
class SurveyedBuilding:
    """One building: rings (V, 3) m in the world of `CityFile.origin`, without the closing point."""

    id: str
    ground: tuple[FloatArray, ...]
    walls: tuple[FloatArray, ...]
    openings: tuple[SurveyedOpening, ...]


@dataclass(frozen=True, eq=False)
class CityFile:
    """What a file holds; ``origin`` is the middle of its ground, at its lowest height."""

    origin: GeoOrigin
    buildings: tuple[SurveyedBuilding, ...]


def read_city_file(path: Path) -> CityFile:
    """The surveyed buildings of a CityGML file (1.0 to 3.0) in metres east, north and up.

    Geometry is taken as it stands in the file; references to other places (xlink) are not followed.

    Raises
    ------
    InputError
        If the file cannot be read, declares a document type (entities could grow without bound or
        read other files), names no projected reference system in metres, or has no ground.
    """
    root = _parsed(path)
    found = [_surveyed(element, path) for element in root.iter() if _name(element) == "Building"]
    corners = [ring for building in found for ring in building.ground]
    if not corners:
        raise InputError(f"{path} has no building with a GroundSurface; nothing can be placed.")
    geodetic = _geodetic_from(_reference_system(root, path), path)
    ground = np.concatenate(corners)
    middle = (ground.min(axis=0) + ground.max(axis=0)) / 2
    lat_deg, lon_deg, _ = geodetic(middle[None])[0]
    origin = GeoOrigin(
        round(float(lat_deg), 5), round(float(lon_deg), 5), round(float(ground[:, 2].min()), 3)
    )

    def moved(rings: tuple[FloatArray, ...]) -> tuple[FloatArray, ...]:
        return tuple(world_from_geodetic(geodetic(ring), origin) for ring in rings)

    return CityFile(
        origin,
        tuple(
            SurveyedBuilding(
                building.id,
                moved(building.ground),
                moved(building.walls),
                tuple(SurveyedOpening(o.id, o.kind, moved(o.rings)) for o in building.openings),
            )
            for building in found
            if building.ground
        ),
    )


def _parsed(path: Path) -> ET.Element:
    """The root; the text is decoded here, so no declared encoding hides a document type."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{path} is larger than {MAX_BYTES >> 20} MiB; split it by building.")
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise InputError(f"Could not read {path}: {error.strerror or error}.") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8; save it as UTF-8.") from error
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError(
            f"{path} declares a document type, which CityGML does not need; remove it."
        )
    try:
        return ET.fromstring(text)
    except ET.ParseError as error:
        raise InputError(f"{path} is not readable XML: {error}.") from error


def _name(element: ET.Element) -> str:
    """The tag without its namespace, which differs between versions of CityGML."""
    return element.tag.rpartition("}")[2]


def _id(element: ET.Element) -> str:
    return next((value for key, value in element.items() if key.rpartition("}")[2] == "id"), "")


def _surveyed(building: ET.Element, path: Path) -> SurveyedBuilding:
    """One building with its parts; the geometry of openings is not wall."""
    ground: list[FloatArray] = []
    walls: list[FloatArray] = []
    openings: list[SurveyedOpening] = []
    for element in building.iter():
        kind = _name(element)
        if kind == "GroundSurface":
            ground.extend(_rings(element, path))
        elif kind == "WallSurface":
            walls.extend(_rings(element, path))
        elif kind in ("Window", "WindowSurface"):
            openings.append(SurveyedOpening(_id(element), "window", tuple(_rings(element, path))))
        elif kind in ("Door", "DoorSurface"):
            openings.append(SurveyedOpening(_id(element), "door", tuple(_rings(element, path))))
    return SurveyedBuilding(
        _id(building) or path.stem, tuple(ground), tuple(walls), tuple(openings)
    )


def _rings(element: ET.Element, path: Path) -> Iterator[FloatArray]:
    """The outer rings (V, 3) below an element, openings in it left out."""
    for child in element:
        if _name(child) in ("opening", "fillingSurface"):
            continue
        if _name(child) != "exterior":
            yield from _rings(child, path)
            continue
        text = " ".join(
            e.text or "" for e in child.iter() if _name(e) in ("posList", "pos", "coordinates")
        )
        try:
            ring = np.array(text.replace(",", " ").split(), np.float64).reshape(-1, 3)
        except ValueError as error:
            raise InputError(
                f"{path} has a ring that is no list of x y z: {text[:60]!r}"
            ) from error
        if not np.isfinite(ring).all():
            raise InputError(f"{path} has a ring with a coordinate that is not finite.")
        if len(ring) > 1 and np.array_equal(ring[0], ring[-1]):
            ring = ring[:-1]
        if len(ring) >= 3:
            yield ring


def _reference_system(root: ET.Element, path: Path) -> pyproj.CRS:
    named = next((e.get("srsName") for e in root.iter() if e.get("srsName")), None)
    if named is None:
        raise InputError(f"{path} names no reference system (srsName); its place is unknown.")
    try:
        system = pyproj.CRS.from_user_input(named)
    except pyproj.exceptions.CRSError as error:
        raise InputError(f"{path} has an unknown reference system {named!r}.") from error
    if not system.is_projected or system.axis_info[0].unit_name != "metre":
        raise InputError(f"{path} is in {named}; a projected system in metres is needed.")
    return system


def _geodetic_from(system: pyproj.CRS, path: Path) -> Callable[[FloatArray], FloatArray]:
    """A function from (N, 3) x y z of the file to (N, 3) lat, lon, height."""
    transformer = pyproj.Transformer.from_crs(system.to_2d(), "EPSG:4326", always_xy=True)

    def geodetic(points: FloatArray) -> FloatArray:
        lon_deg, lat_deg = transformer.transform(points[:, 0], points[:, 1])
        found = np.stack([lat_deg, lon_deg, points[:, 2]], axis=1)
        if not np.isfinite(found).all():
            raise InputError(f"{path} has points that lie outside of its reference system.")
        return found

    return geodetic
