"""Facades of a honeybee model: a survey modelled in a CAD program, or a run's own model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from si3fp.errors import InputError
from si3fp.evaluate.openings import RECTANGULAR, area_m2, windows_of
from si3fp.evaluate.walls import Json, WallPart, wall_parts
from si3fp.geometry.enu import GeoOrigin
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Facade

COPLANAR_M = 0.05  # decision: parts of one wall lie this close to one plane,
COPLANAR_DEG = 1.0  # within this angle,
TOUCHING_M = 0.1  # and, without a common facade id, this close together
METRES_PER_UNIT = {
    "Meters": 1.0,
    "Centimeters": 0.01,
    "Millimeters": 0.001,
    "Feet": 0.3048,
    "Inches": 0.0254,
}


@dataclass(frozen=True, slots=True, eq=False)
class ModelFacades:
    """What a honeybee model says of its facades.

    Attributes
    ----------
    origin
        That si3fp wrote, or None.
    facades
        In the model's world, in metres.
    buildings
        The building of every facade, by facade id.
    balcony_facades
        Ids of facades whose walls say ``user_data.balcony``, or else that have a balcony door.
    missing
        Walls that a run marked as missing, with its reason, by facade id; they are no facades.
    notes
        What was joined, left out or simplified.
    """

    origin: GeoOrigin | None
    facades: tuple[Facade, ...]
    buildings: Mapping[str, str]
    balcony_facades: frozenset[str]
    missing: Mapping[str, str]
    notes: tuple[str, ...]


def facades_from_hbjson(model: Json) -> tuple[GeoOrigin | None, list[Facade]]:
    """The origin and the facades of `read_facades`."""
    known = read_facades(model)
    return known.origin, list(known.facades)


def read_facades(model: Json, *, join_touching: bool = False) -> ModelFacades:
    """The facades of a parsed honeybee model.

    Outdoor walls of rooms and orphaned walls that lie in one plane and share
    ``user_data.facade_id`` are one facade; walls without such an id are joined where they touch.
    Apertures and glazed doors are its windows, parts with one ``user_data.window_id`` are one
    window. Facades and windows become their bounding rectangles. Walls that a run marked as
    missing are left out: nothing was found there.

    Parameters
    ----------
    model
        The dictionary of a honeybee ``Model`` in any of its units.
    join_touching
        Apertures without ``window_id`` that share an edge are one window too.

    Raises
    ------
    InputError
        If the dictionary is no honeybee model or a face has no usable geometry.
    """
    if not isinstance(model, Mapping) or model.get("type") != "Model":
        raise InputError('This is not a honeybee model: its "type" must be "Model".')
    unit = model.get("units", "Meters")
    if unit not in METRES_PER_UNIT:
        raise InputError(
            f"The honeybee model has the unit {unit!r}; known are {', '.join(METRES_PER_UNIT)}."
        )
    left_out: Counter[str] = Counter()
    missing: dict[str, str] = {}
    parts = list(wall_parts(model, METRES_PER_UNIT[unit], left_out, missing))
    groups: list[list[WallPart]] = []
    for part in sorted(parts, key=lambda part: (part.name, part.facade_id or "")):
        joined = [group for group in groups if any(_same_wall(part, other) for other in group)]
        groups = [group for group in groups if group not in joined]
        groups.append([*(other for group in joined for other in group), part])
    facades: list[Facade] = []
    buildings: dict[str, str] = {}
    balconies: set[str] = set()
    counts: Counter[str] = Counter()
    for group in groups:
        facade = _facade(group, join_touching, counts)
        taken = sum(other.id.split("#")[0] == facade.id for other in facades)
        facade = replace(facade, id=f"{facade.id}#{taken + 1}") if taken else facade
        facades.append(facade)
        buildings[facade.id] = group[0].building_id
        said = [part.balconies for part in group if part.balconies is not None]
        if any(said) if said else any(w.label == "balcony_door" for w in facade.windows):
            balconies.add(facade.id)
    notes = [f"{what}: {count}" for what, count in [*counts.items(), *left_out.items()]]
    return ModelFacades(
        _origin(model),
        tuple(facades),
        buildings,
        frozenset(balconies),
        {name: missing[name] for name in missing if name not in buildings},
        tuple(notes),
    )


def _origin(model: Json) -> GeoOrigin | None:
    written = ((model.get("user_data") or {}).get("si3fp") or {}).get("origin")
    if written is None:
        return None
    try:
        return GeoOrigin(*(float(written[key]) for key in ("lat_deg", "lon_deg", "height_m")))
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            "The model's user_data.si3fp.origin needs the numbers lat_deg, lon_deg and height_m, "
            f"got {written!r}."
        ) from error


def _same_wall(a: WallPart, b: WallPart) -> bool:
    if a.facade_id != b.facade_id:
        return False
    a_from_b = a.world_from_plane.inverse() @ b.world_from_plane
    if a_from_b.rotation[2, 2] < np.cos(np.deg2rad(COPLANAR_DEG)):
        return False
    corners = a_from_b.apply(np.column_stack([b.corners_m, np.zeros(len(b.corners_m))]))
    if np.abs(corners[:, 2]).max() > COPLANAR_M:
        return False
    if a.facade_id is not None:
        return True
    gaps = np.maximum(
        a.corners_m.min(axis=0) - corners[:, :2].max(axis=0),
        corners[:, :2].min(axis=0) - a.corners_m.max(axis=0),
    )
    return bool(gaps.max() < TOUCHING_M)


def _facade(parts: Sequence[WallPart], join_touching: bool, counts: Counter[str]) -> Facade:
    """The bounding rectangle of coplanar parts, in the frame of the first; counts its liberties."""
    first = parts[0].world_from_plane

    def in_first(part: WallPart, corners_m: FloatArray) -> FloatArray:
        flat = np.column_stack([corners_m, np.zeros(len(corners_m))])
        return (first.inverse() @ part.world_from_plane).apply(flat)[:, :2]

    outlines = [in_first(part, part.corners_m) for part in parts]
    corners = np.concatenate(outlines)
    low, high = corners.min(axis=0), corners.max(axis=0)
    openings = [
        replace(opening, outline_m=in_first(part, opening.outline_m) - low)
        for part in parts
        for opening in part.openings
    ]
    windows, joined = windows_of(openings, join_touching)
    if sum(map(area_m2, outlines)) < RECTANGULAR * float((high - low).prod()):
        counts["facades that do not fill their rectangle, whose area counts"] += 1
    bent = sum(
        area_m2(o.outline_m) < RECTANGULAR * float(np.ptp(o.outline_m, axis=0).prod())
        for o in openings
    )
    if bent:
        counts["openings that are not rectangular, whose bounding rectangle counts"] += bent
    if joined:
        counts["openings that touch others, joined into windows"] += joined
    return Facade(
        parts[0].facade_id or parts[0].name,
        Rigid3(first.rotation, first.apply([low[0], low[1], 0.0])),
        float(high[0] - low[0]),
        float(high[1] - low[1]),
        tuple(windows),
        next((part.wwr_interval for part in parts if part.wwr_interval is not None), None),
    )
