"""The map layer of a run: footprints, facades and windows as GeoJSON (RFC 7946, WGS 84).

One geometry type per kind, so that a GIS opens three clean layers, told apart by ``kind``:

footprint
    Polygon at the height of the ground, counter-clockwise.
facade
    LineString, the foot of the facade from left to right seen from outside. Facades that were not
    found are there too (``found`` false, with step and reason), along their footprint edge.
window
    Point at the centre of the window, on the wall plane. Its id is the ``window_id`` of the
    thermal model.

Every position has three coordinates: longitude, latitude and the height in metres in the datum of
the run's origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from si3fp.geometry.enu import GeoOrigin, geodetic_from_world
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Building, Facade, Missing, Window
from si3fp.pipeline import Run
from si3fp.workspace import read_json

Feature = dict[str, Any]

DEGREE_DIGITS = 9  # 0.1 mm
METRE_DIGITS = 3


def windows_geojson(
    buildings: Sequence[Building], origin: GeoOrigin, loose_facades: Sequence[Facade] = ()
) -> dict[str, Any]:
    """A FeatureCollection of footprints, facades and windows (see the module's text).

    Parameters
    ----------
    buildings
        Each in the world frame of its own ``origin``.
    origin
        Origin of the world frame of the loose facades.
    loose_facades
        Facades without a building.

    Returns
    -------
    Plain dictionaries, in the order of the arguments; degrees rounded to 1e-9, metres to 1e-3.
    """
    features: list[Feature] = []
    for building in buildings:
        features.append(_footprint(building))
        for facade in building.facades:
            features.extend(_facade_and_windows(facade, building.id, building.origin))
        features.extend(_missing(missing, building) for missing in building.missing)
    for facade in loose_facades:
        features.extend(_facade_and_windows(facade, None, origin))
    return {"type": "FeatureCollection", "features": features}


def compass_bearing_deg(direction_in_world: ArrayLike) -> float:
    """Compass bearing in [0, 360) of a direction (2,) or (3,): 0 north, 90 east."""
    direction: FloatArray = np.asarray(direction_in_world, dtype=np.float64)
    return float(np.rad2deg(np.arctan2(direction[0], direction[1])) % 360)


def footprint_edge(facade_id: str, building_id: str, corners: int) -> int | None:
    """Index of the footprint edge in an id ``<building id>-<edge>``, None where it names none."""
    prefix, _, index = facade_id.rpartition("-")
    if prefix != building_id or not index.isdecimal() or int(index) >= corners:
        return None
    return int(index)


def _positions(points_in_world: ArrayLike, origin: GeoOrigin) -> list[list[float]]:
    """GeoJSON positions [lon, lat, height] of world points (N, 3)."""
    return [
        [round(lon, DEGREE_DIGITS), round(lat, DEGREE_DIGITS), round(height, METRE_DIGITS)]
        for lat, lon, height in geodetic_from_world(points_in_world, origin).tolist()
    ]


def _feature(kind: str, geometry: str, coordinates: Any, properties: dict[str, Any]) -> Feature:
    rounded = {
        key: round(value, METRE_DIGITS) if isinstance(value, float) else value
        for key, value in properties.items()
    }
    return {
        "type": "Feature",
        "id": f"{kind}/{properties['id']}",
        "geometry": None if coordinates is None else {"type": geometry, "coordinates": coordinates},
        "properties": {"kind": kind, **rounded},
    }


def _ground(points: FloatArray, building: Building) -> FloatArray:
    return np.column_stack([points, np.full(len(points), building.base_z_m)])


def _footprint(building: Building) -> Feature:
    outline = np.asarray(building.footprint_in_world, dtype=np.float64)
    ring = _positions(_ground(outline, building), building.origin)
    gross_m2 = sum(facade.width_m * facade.height_m for facade in building.facades)
    windows_m2 = sum(facade.wwr * facade.width_m * facade.height_m for facade in building.facades)
    return _feature(
        "footprint",
        "Polygon",
        [[*ring, ring[0]]],
        {
            "id": building.id,
            "height_m": float(building.height_m),
            "storeys": building.storeys,
            "year": building.year,
            "use": building.use,
            "facades_found": len(building.facades),
            "facades_missing": len(building.missing),
            "facade_area_m2": float(gross_m2),
            "wwr": float(windows_m2 / gross_m2) if gross_m2 else None,
        },
    )


def _facade_and_windows(
    facade: Facade, building_id: str | None, origin: GeoOrigin
) -> list[Feature]:
    foot = facade.world_from_facade.apply([[0.0, 0.0, 0.0], [facade.width_m, 0.0, 0.0]])
    interval = facade.wwr_interval
    line = _feature(
        "facade",
        "LineString",
        _positions(foot, origin),
        {
            "id": facade.id,
            "building": building_id,
            "found": True,
            "width_m": float(facade.width_m),
            "height_m": float(facade.height_m),
            "bearing_deg": compass_bearing_deg(facade.world_from_facade.rotation[:, 2]),
            "wwr": float(facade.wwr),
            "wwr_low": None if interval is None else float(interval[0]),
            "wwr_high": None if interval is None else float(interval[1]),
            "windows": len(facade.windows),
            "step": None,
            "reason": None,
        },
    )
    return [
        line,
        *(
            _window(f"{facade.id}-w{index}", window, facade, building_id, origin)
            for index, window in enumerate(facade.windows)
        ),
    ]


def _window(
    name: str, window: Window, facade: Facade, building_id: str | None, origin: GeoOrigin
) -> Feature:
    centre = [window.x_m + window.width_m / 2, window.y_m + window.height_m / 2, 0.0]
    return _feature(
        "window",
        "Point",
        _positions([facade.world_from_facade.apply(centre)], origin)[0],
        {
            "id": name,
            "facade": facade.id,
            "building": building_id,
            "label": window.label,
            "x_m": float(window.x_m),
            "sill_height_m": float(window.y_m),
            "width_m": float(window.width_m),
            "height_m": float(window.height_m),
            "area_m2": float(window.area_m2),
            "bearing_deg": compass_bearing_deg(facade.world_from_facade.rotation[:, 2]),
            "score": float(window.score),
            "views": len(window.views),
            "origin": window.origin,
        },
    )


def _missing(missing: Missing, building: Building) -> Feature:
    outline = np.asarray(building.footprint_in_world, dtype=np.float64)
    edge = footprint_edge(missing.facade_id, building.id, len(outline))
    line, width_m, bearing_deg = None, None, None
    if edge is not None:
        ends = outline[[edge, (edge + 1) % len(outline)]]
        run = ends[1] - ends[0]
        line = _positions(_ground(ends, building), building.origin)
        width_m = float(np.hypot(*run))
        bearing_deg = compass_bearing_deg([run[1], -run[0]])  # the outside is on the right
    return _feature(
        "facade",
        "LineString",
        line,
        {
            "id": missing.facade_id,
            "building": building.id,
            "found": False,
            "width_m": width_m,
            "height_m": float(building.height_m),
            "bearing_deg": bearing_deg,
            "wwr": None,
            "wwr_low": None,
            "wwr_high": None,
            "windows": None,
            "step": missing.step,
            "reason": missing.reason,
        },
    )


def write_map_layer(run: Run) -> Path:
    """Write ``RUN/windows.geojson``; its path. Not written where the run's place is unknown."""
    if run.origin is None:
        return run.workspace.windows_geojson
    layer = windows_geojson(run.buildings, run.origin, run.loose_facades)
    known = read_json(run.workspace.run_json)
    about = {"config": known["config"], "inputs": known["inputs"]}
    run.workspace.write_json(run.workspace.windows_geojson, "windows-layer", {**about, **layer})
    return run.workspace.windows_geojson
