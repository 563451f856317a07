"""GeoJSON files: features, the coordinate reference system they declare, longitude and latitude."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from si3fp.errors import InputError

_WGS84 = re.compile(r"^(urn:(x-)?ogc:def:crs:)?(OGC:[\d.]*:?CRS84h?|EPSG:[\d.]*:?(4326|4979))$")
WRONG_CRS = (
    "the file seems to be in another coordinate reference system: "
    "save it as WGS 84 (EPSG:4326), in degrees, longitude first"
)


def read_feature_collection(path: Path) -> tuple[list[dict[str, Any]], str | None]:
    """Features and the name of the declared CRS (None where the file declares none).

    Raises
    ------
    InputError
        If the file is missing, no JSON, no FeatureCollection, or a feature is no object.
    """
    try:
        collection = json.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError as error:
        raise InputError(f"There is no file {path}.") from error
    except (ValueError, RecursionError, OSError) as error:
        raise InputError(
            f"{path} is not a readable GeoJSON file: {error}. Export it again."
        ) from error
    kind = collection.get("type") if isinstance(collection, dict) else type(collection).__name__
    if kind != "FeatureCollection" or not isinstance(collection.get("features"), list):
        raise InputError(
            f"{path} is not a GeoJSON FeatureCollection, its type is {kind!r}. "
            "Save it as a FeatureCollection, for example from QGIS."
        )
    for number, feature in enumerate(collection["features"]):
        if not (
            isinstance(feature, dict)
            and isinstance(feature.get("properties") or {}, dict)
            and isinstance(feature.get("geometry") or {}, dict)
        ):
            raise InputError(f"{path}, feature {number}: not a GeoJSON feature: {feature!r:.80}.")
    return collection["features"], _crs_name(collection.get("crs"), path)


def is_wgs84(crs_name: str | None) -> bool:
    """True for WGS 84 in longitude and latitude, and for files that declare nothing (RFC 7946)."""
    return crs_name is None or _WGS84.match(crs_name) is not None


def require_lon_lat(position: Sequence[Any], where: str) -> None:
    """Refuse a position that is not longitude and latitude in degrees.

    Raises
    ------
    InputError
        If a value is no number, NaN, or beyond 180 and 90 degrees.
    """
    require_numbers(position, where)
    lon_deg, lat_deg = position[:2]
    if abs(lon_deg) > 180 or abs(lat_deg) > 90:
        raise InputError(
            f"{where}: [{lon_deg}, {lat_deg}] is not a longitude and a latitude; {WRONG_CRS}."
        )


def require_numbers(position: Any, where: str) -> None:
    """Refuse a position that does not hold at least two finite numbers."""
    if not (
        isinstance(position, list | tuple)
        and len(position) >= 2
        and all(isinstance(value, int | float) and math.isfinite(value) for value in position)
    ):
        raise InputError(f"{where}: coordinates must be finite numbers, got {position!r}.")


def require_unique(ids: Sequence[str], path: Path, what: str) -> None:
    """Raise an InputError that names the first id that occurs twice."""
    seen: set[str] = set()
    for identifier in ids:
        if identifier in seen:
            raise InputError(
                f"{path}: the id {identifier!r} occurs twice; give every {what} its own."
            )
        seen.add(identifier)


def explain(error: ValidationError, model: type[BaseModel], where: str) -> InputError:
    """One sentence per wrong field: where, the field, the value got, what is expected."""
    sentences = []
    for item in error.errors(include_url=False):
        name = str(item["loc"][0])
        expected = model.model_fields[name].description or item["msg"]
        got = "missing" if item["type"] == "missing" else repr(item["input"])
        sentences.append(f"`{name}` is {got}, expected {expected}")
    return InputError(f"{where}: {'; '.join(sentences)}.")


def _crs_name(member: Any, path: Path) -> str | None:
    if member is None:
        return None
    properties = member.get("properties") if isinstance(member, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not isinstance(name, str):
        raise InputError(
            f"{path}: the member `crs` names no coordinate reference system: {member!r:.80}. "
            "Save the file as WGS 84 and remove the member."
        )
    return name
