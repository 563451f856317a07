"""Plain dictionaries of the domain types, as the JSON files of a run hold them, and back."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from si3fp.geometry.enu import geodetic_from_world
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections, Facade, GeoOrigin, Missing, Rigid3, Window

Record = dict[str, Any]


def rounded(values: Any, digits: int = 6) -> Any:
    """Nested lists of rounded plain numbers."""
    return np.asarray(values, dtype=np.float64).round(digits).tolist()


def rigid_record(pose: Rigid3) -> Record:
    """Rotation (3, 3) and translation (3,)."""
    return {"rotation": rounded(pose.rotation, 12), "translation": rounded(pose.translation)}


def origin_record(origin: GeoOrigin | None) -> Record | None:
    """Latitude, longitude and height; None where the place is unknown."""
    return None if origin is None else asdict(origin)


def place_record(point_in_world: FloatArray, origin: GeoOrigin | None) -> Record | None:
    """Latitude, longitude (1e-9 degrees) and height of a world point; None without a place."""
    if origin is None:
        return None
    lat_deg, lon_deg, height_m = geodetic_from_world(point_in_world, origin)
    return {
        "lat_deg": round(float(lat_deg), 9),
        "lon_deg": round(float(lon_deg), 9),
        "height_m": round(float(height_m), 4),
    }


def facade_record(facade: Facade, origin: GeoOrigin | None) -> Record:
    """A facade without its windows: frame, size, window-to-wall ratio, centre on Earth."""
    interval = facade.wwr_interval
    return {
        "id": facade.id,
        "origin": origin_record(origin),
        "world_from_facade": rigid_record(facade.world_from_facade),
        "width_m": round(facade.width_m, 4),
        "height_m": round(facade.height_m, 4),
        "wwr": round(facade.wwr, 5),
        "wwr_interval": None if interval is None else rounded(interval, 5),
        "centre": place_record(facade.centre_in_world, origin),
    }


def window_record(window: Window) -> Record:
    """All fields of a window, lengths rounded to 0.1 mm."""
    record = asdict(window)
    for name in ("x_m", "y_m", "width_m", "height_m", "score"):
        record[name] = round(record[name], 4)
    return record


def facade_from_records(facade: Record, windows: Record) -> Facade:
    """The facade of `facade_record` and the windows of a ``windows.json``."""
    pose = facade["world_from_facade"]
    interval = facade.get("wwr_interval")
    return Facade(
        facade["id"],
        Rigid3(np.array(pose["rotation"]), np.array(pose["translation"])),
        facade["width_m"],
        facade["height_m"],
        tuple(_window(record) for record in windows["windows"]),
        tuple(interval) if interval else None,
    )


def _window(record: Record) -> Window:
    fields = dict(record)
    for name in ("views", "edge_sigma_m", "correction_m"):
        fields[name] = tuple(fields[name])
    return Window(**fields)


def detections_record(detections: Detections) -> Record:
    """Boxes (0.01 px), scores and labels."""
    return {
        "boxes_px": rounded(detections.boxes_px, 2),
        "scores": rounded(detections.scores, 4),
        "labels": detections.labels.tolist(),
    }


def missing_record(missing: Missing) -> Record:
    """Facade, step and reason."""
    return asdict(missing)
