"""Facades of a honeybee model: a survey modelled in a CAD program, or a run's own model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Facade, Window

Json = Mapping[str, Any]

COPLANAR_M = 0.05  # decision: parts of one wall lie this close to one plane,
COPLANAR_DEG = 1.0  # within this angle,
TOUCHING_M = 0.1  # and, without a common facade id, this close together
MAX_TILT_DEG = 45.0  # decision: a wall that leans more is a roof
METRES_PER_UNIT = {
    "Meters": 1.0,
    "Centimeters": 0.01,
    "Millimeters": 0.001,
    "Feet": 0.3048,
    "Inches": 0.0254,
}


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """One wall face: its facade id, frame, corners (V, 2) in the frame, and its openings."""

    facade_id: str | None
    name: str
    world_from_plane: Rigid3
    corners_m: FloatArray
    openings: tuple[tuple[str, Literal["window", "balcony_door"], FloatArray], ...]


def facades_from_hbjson(model: Json) -> tuple[GeoOrigin | None, list[Facade]]:
    """The origin that si3fp wrote, or None, and the facades of a parsed honeybee model.

    Outer walls of rooms and orphaned walls that lie in one plane and share
    ``user_data.facade_id`` are one facade; walls without such an id are joined where they touch.
    Apertures and glazed doors are its windows, parts with one ``user_data.window_id`` are one
    window. Facades and windows become their bounding rectangles. Walls that a run marked as
    missing are left out: nothing was found there.

    Parameters
    ----------
    model
        The dictionary of a honeybee ``Model`` in any of its units.

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
    parts = [_part(face, METRES_PER_UNIT[unit]) for face in _outer_walls(model)]
    groups: list[list[_Part]] = []
    for part in sorted(parts, key=lambda part: (part.name, part.facade_id or "")):
        joined = [group for group in groups if any(_same_wall(part, other) for other in group)]
        groups = [group for group in groups if group not in joined]
        groups.append([*(other for group in joined for other in group), part])
    facades: list[Facade] = []
    for group in groups:
        facade = _facade(group)
        taken = sum(other.id.split("#")[0] == facade.id for other in facades)
        facades.append(facade if not taken else _facade(group, f"{facade.id}#{taken + 1}"))
    return _origin(model), facades


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


def _outer_walls(model: Json) -> Iterator[Json]:
    rooms = [face for room in model.get("rooms") or [] for face in room.get("faces") or []]
    for face in [*rooms, *(model.get("orphaned_faces") or [])]:
        inside = (face.get("boundary_condition") or {}).get("type") == "Surface"
        own = (face.get("user_data") or {}).get("si3fp") or {}
        if face.get("face_type") == "Wall" and not inside and "missing" not in own:
            yield face


def _corners(thing: Json, metres_per_unit: float) -> FloatArray:
    """Outline (V, 3) of a face, aperture or door in metres."""
    name = thing.get("identifier", "without identifier")
    try:
        corners = np.array(thing["geometry"]["boundary"], np.float64) * metres_per_unit
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{name} in the honeybee model has no readable geometry.boundary."
        ) from error
    if corners.ndim != 2 or corners.shape[1] != 3 or len(corners) < 3:
        raise InputError(f"{name} in the honeybee model needs at least 3 corners x, y, z.")
    if not np.isfinite(corners).all():
        raise InputError(f"{name} in the honeybee model has a corner that is not finite.")
    return corners


def _part(face: Json, metres_per_unit: float) -> _Part:
    corners = _corners(face, metres_per_unit)
    name = str(face.get("identifier", ""))
    # Newell's normal: twice the area vector, for any planar polygon.
    normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    length = np.linalg.norm(normal)
    if length < 1e-9:
        raise InputError(f"The wall {name} in the honeybee model has no area.")
    normal = normal / length
    if abs(normal[2]) > np.sin(np.deg2rad(MAX_TILT_DEG)):
        raise InputError(f"The wall {name} in the honeybee model lies flat: normal {normal}.")
    up = np.array([0.0, 0.0, 1.0]) - normal[2] * normal
    up /= np.linalg.norm(up)
    axes = np.column_stack([np.cross(up, normal), up, normal])
    world_from_plane = Rigid3(axes, corners[0])
    plane_from_world = world_from_plane.inverse()

    def flat(thing: Json) -> FloatArray:
        return plane_from_world.apply(_corners(thing, metres_per_unit))[:, :2]

    openings: list[tuple[str, Literal["window", "balcony_door"], FloatArray]] = []
    doors = [door for door in face.get("doors") or [] if door.get("is_glass")]
    for thing in [*(face.get("apertures") or []), *doors]:
        data = thing.get("user_data") or {}
        glazed_door = thing.get("type") == "Door" or data.get("label") == "balcony_door"
        key = str(data.get("window_id") or thing.get("identifier", ""))
        openings.append((key, "balcony_door" if glazed_door else "window", flat(thing)))
    facade_id = (face.get("user_data") or {}).get("facade_id")
    return _Part(
        None if facade_id is None else str(facade_id),
        name,
        world_from_plane,
        flat(face),
        tuple(openings),
    )


def _same_wall(a: _Part, b: _Part) -> bool:
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


def _facade(parts: list[_Part], facade_id: str | None = None) -> Facade:
    """The bounding rectangle of coplanar parts, in the frame of the first."""
    first = parts[0].world_from_plane

    def in_first(part: _Part, corners_m: FloatArray) -> FloatArray:
        flat = np.column_stack([corners_m, np.zeros(len(corners_m))])
        return (first.inverse() @ part.world_from_plane).apply(flat)[:, :2]

    corners = np.concatenate([in_first(part, part.corners_m) for part in parts])
    low, high = corners.min(axis=0), corners.max(axis=0)
    pieces: dict[str, list[FloatArray]] = {}
    labels: dict[str, Literal["window", "balcony_door"]] = {}
    for part in parts:
        for key, label, outline in part.openings:
            pieces.setdefault(key, []).append(in_first(part, outline) - low)
            labels[key] = label
    windows = []
    for key, outlines in pieces.items():
        outline = np.concatenate(outlines)
        (left, bottom), (width, height) = outline.min(axis=0), np.ptp(outline, axis=0)
        windows.append(Window(float(left), float(bottom), float(width), float(height), labels[key]))
    return Facade(
        facade_id or parts[0].facade_id or parts[0].name,
        Rigid3(first.rotation, first.apply([low[0], low[1], 0.0])),
        float(high[0] - low[0]),
        float(high[1] - low[1]),
        tuple(windows),
    )
