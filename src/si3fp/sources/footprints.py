"""Footprints from GeoJSON or GeoPackage files, in any coordinate system that the file declares."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pyproj
import shapely
import shapely.geometry
from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, field_validator

from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin, world_from_geodetic
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Footprint
from si3fp.sources.geojson import (
    WRONG_CRS,
    explain,
    is_wgs84,
    read_feature_collection,
    require_lon_lat,
    require_numbers,
    require_unique,
)
from si3fp.sources.geopackage import read_layer

_SAME_CORNER_M = 1e-3
_MIN_AREA_M2 = 1.0  # smaller polygons are slivers left by an overlay


@dataclass(frozen=True, slots=True, eq=False)
class FootprintRecord:
    """The outline of one building as its file describes it.

    Attributes
    ----------
    id
        Unique identifier.
    outline_deg
        (V, 2) longitude, latitude (WGS 84) of the outer ring, not closed, in file order.
    courtyards
        Number of holes; facades are sought on the outer ring only.
    ground_m, height_m, storeys, year, use
        Height of the ground (datum of the cameras), height of the eaves above it, attributes; None
        where the file does not say.
    """

    id: str
    outline_deg: FloatArray
    courtyards: int = 0
    ground_m: float | None = None
    height_m: float | None = None
    storeys: int | None = None
    year: int | None = None
    use: str | None = None


_Finite = Annotated[float, Field(allow_inf_nan=False)]


class _Row(BaseModel):
    """The properties of one building; the descriptions complete "expected ..." in messages."""

    model_config = ConfigDict(coerce_numbers_to_str=True, extra="ignore")

    id: str | None = Field(None, description="a unique name")
    ground_m: _Finite | None = Field(
        None, ge=-500, le=10_000, description="the height of the ground in metres, or nothing"
    )
    height_m: _Finite | None = Field(
        None, gt=0, le=1000, description="a height above the ground in metres, or nothing"
    )
    storeys: int | None = Field(None, ge=1, le=200, description="a whole number, or nothing")
    year: int | None = Field(None, ge=1000, le=2200, description="a year, or nothing")
    use: str | None = Field(None, description="a word, or nothing")

    @field_validator("*", mode="before")
    @classmethod
    def _blank_is_absent(cls, value: Any, info: ValidationInfo) -> Any:
        if isinstance(value, str):
            value = value.strip()
        # A register writes 0 where it does not know; the ground may lie at 0.
        unknown = ("", 0, "0") if info.field_name in ("height_m", "storeys", "year") else ("",)
        return None if value in unknown else value


def read_footprints(path: Path, columns: Mapping[str, str] | None = None) -> list[FootprintRecord]:
    """The buildings of a GeoJSON or GeoPackage file, one per polygon, in file order.

    The parts of a MultiPolygon become ``<id>.1``, ``<id>.2``, ...; a building without id becomes
    ``building-<n>``, n its place in the file counted from 1.

    Parameters
    ----------
    path
        ``.geojson`` or ``.json`` (WGS 84, or the CRS of a legacy ``crs`` member), or ``.gpkg``.
    columns
        Our property name -> the file's, for example ``{"height_m": "hojd"}``.

    Raises
    ------
    InputError
        If the file, its CRS, a property or an outline is missing or wrong; the message names the
        building.
    MissingDependencyError
        For a GeoPackage without the extra ``geo``.
    """
    crs_name: str | None
    if path.suffix.lower() == ".gpkg":
        features, crs_name = read_layer(path)
    elif path.suffix.lower() in {".geojson", ".json"}:
        features, crs_name = read_feature_collection(path)
    else:
        raise InputError(
            f"{path}: footprints are read from .geojson and .gpkg files, not from "
            f"{path.suffix or 'files without suffix'}. Export them again."
        )
    if not features:
        raise InputError(f"{path} holds zero footprints; add at least one polygon.")
    mapping = _checked_columns(columns or {}, features, path)
    to_wgs84 = _transformer(crs_name, path)
    records: list[FootprintRecord] = []
    for number, feature in enumerate(features):
        records += _records_of_feature(feature, number, mapping, to_wgs84, path)
    require_unique([record.id for record in records], path, "building")
    return records


def footprints_in_world(
    records: Sequence[FootprintRecord], origin: GeoOrigin
) -> tuple[Footprint, ...]:
    """The footprints with counter-clockwise corners in metres; repeated corners are dropped.

    Raises
    ------
    InputError
        If an outline has less than 1 m2.
    """
    return tuple(_footprint(record, origin) for record in records)


def _footprint(record: FootprintRecord, origin: GeoOrigin) -> Footprint:
    lon, lat = record.outline_deg.T
    # At the origin's height, so that the outline does not shrink or grow with the ground.
    heights = np.full(len(lon), origin.height_m)
    outline = world_from_geodetic(np.stack([lat, lon, heights], axis=-1), origin)[:, :2]
    outline = outline[np.linalg.norm(outline - np.roll(outline, 1, 0), axis=1) > _SAME_CORNER_M]
    area_m2 = shapely.Polygon(outline).area if len(outline) >= 3 else 0.0
    if area_m2 < _MIN_AREA_M2:
        raise InputError(
            f"Footprint {record.id}: {len(outline)} distinct corners around {area_m2:.2g} m2 "
            "are no building. Draw the outline, or remove the feature."
        )
    if not shapely.LinearRing(outline).is_ccw:
        outline = np.roll(outline[::-1], 1, axis=0)
    return Footprint(
        id=record.id,
        outline_in_world=outline,
        ground_m=None if record.ground_m is None else _ground_in_world(record, origin),
        height_m=record.height_m,
        storeys=record.storeys,
        year=record.year,
        use=record.use,
    )


def _ground_in_world(record: FootprintRecord, origin: GeoOrigin) -> float:
    """World z of the ground at the middle of the outline: that of a camera at this height there."""
    lon_deg, lat_deg = record.outline_deg.mean(axis=0)
    return float(world_from_geodetic([lat_deg, lon_deg, record.ground_m], origin)[2])


def _records_of_feature(
    feature: dict[str, Any],
    number: int,
    mapping: Mapping[str, str],
    to_wgs84: pyproj.Transformer | None,
    path: Path,
) -> Iterator[FootprintRecord]:
    properties = feature.get("properties") or {}
    picked = {ours: properties.get(theirs) for ours, theirs in mapping.items()}
    where = f"{path}, feature {number} ({picked['id'] or 'no id'})"
    try:
        row = _Row.model_validate(picked)
    except ValidationError as error:
        raise explain(error, _Row, where) from error
    identifier = row.id or f"building-{number + 1}"
    parts = _polygons(feature.get("geometry") or {}, where)
    for part, rings in enumerate(parts, start=1):
        outline = _outline_deg(rings, to_wgs84, where)
        attributes = {
            **row.model_dump(),
            "id": identifier if len(parts) == 1 else f"{identifier}.{part}",
        }
        yield FootprintRecord(outline_deg=outline, courtyards=len(rings) - 1, **attributes)


def _polygons(geometry: Mapping[str, Any], where: str) -> list[Any]:
    """Coordinate rings of every polygon of a Polygon or MultiPolygon."""
    kind, coordinates = geometry.get("type"), geometry.get("coordinates")
    parts = [coordinates] if kind == "Polygon" else coordinates
    if kind not in {"Polygon", "MultiPolygon"}:
        raise InputError(
            f"{where}: a footprint is a Polygon or MultiPolygon, got {kind or 'no geometry'}. "
            "Draw the outline, or remove the feature."
        )
    if not (isinstance(parts, list | tuple) and parts and all(map(_holds_rings, parts))):
        raise InputError(
            f"{where}: the {kind} is empty or damaged: {coordinates!r:.80}. "
            "Draw the outline, or remove the feature."
        )
    return list(parts)


def _holds_rings(part: Any) -> bool:
    return (
        isinstance(part, list | tuple)
        and len(part) > 0
        and all(isinstance(ring, list | tuple) for ring in part)
    )


def _outline_deg(rings: Any, to_wgs84: pyproj.Transformer | None, where: str) -> FloatArray:
    """Longitude, latitude (V, 2) of the outer ring, not closed; the outline must be simple."""
    for ring in rings:
        if len(ring) < 4:
            raise InputError(
                f"{where}: a ring needs at least 4 positions, the last equal to the first, "
                f"got {ring!r:.80}."
            )
        for position in ring:
            if to_wgs84 is None:
                require_lon_lat(position, where)
            else:
                require_numbers(position, where)
    flat = [[position[:2] for position in ring] for ring in rings]
    polygon = shapely.Polygon(flat[0], flat[1:])
    if not polygon.is_valid:
        raise InputError(
            f"{where}: the outline is not a simple polygon: {shapely.is_valid_reason(polygon)}. "
            "Repair it, for example with 'Fix geometries' in QGIS."
        )
    outline: FloatArray = np.asarray(polygon.exterior.coords, np.float64)[:-1]
    if to_wgs84 is not None:
        outline = np.stack(to_wgs84.transform(outline[:, 0], outline[:, 1]), axis=-1)
        if not np.isfinite(outline).all():
            raise InputError(
                f"{where}: the coordinates {flat[0][0]} do not fit the declared coordinate system "
                f"{to_wgs84.source_crs.name if to_wgs84.source_crs else ''}; declare the right one."
            )
    return outline


def _transformer(crs_name: str | None, path: Path) -> pyproj.Transformer | None:
    """From the declared CRS to WGS 84 in longitude, latitude; None where it is that already."""
    if is_wgs84(crs_name):
        return None
    try:
        crs = pyproj.CRS.from_user_input(crs_name)
        if not (crs.is_geographic or crs.is_projected):
            raise InputError(
                f"{path}: the coordinate system {crs.name!r} has no place on Earth; {WRONG_CRS}."
            )
        return pyproj.Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
    except pyproj.exceptions.ProjError as error:
        raise InputError(
            f"{path}: the coordinate system {crs_name!r:.80} is not known ({error}). "
            "Save the file as WGS 84 (EPSG:4326)."
        ) from error


def _checked_columns(
    columns: Mapping[str, str], features: Sequence[Mapping[str, Any]], path: Path
) -> dict[str, str]:
    """Our names -> the file's, defaults included."""
    present = {name for feature in features for name in (feature.get("properties") or {})}
    for ours, theirs in columns.items():
        if ours not in _Row.model_fields:
            raise InputError(
                f"There is no footprint property {ours!r}; choose from "
                f"{', '.join(_Row.model_fields)}."
            )
        if theirs not in present:
            raise InputError(
                f"{path} has no property {theirs!r} for {ours}; it has "
                f"{', '.join(sorted(present)) or 'none'}."
            )
    return {name: columns.get(name, name) for name in _Row.model_fields}
