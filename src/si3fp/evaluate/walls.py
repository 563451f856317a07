"""The walls of a honeybee model that are facades, with their openings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from si3fp.errors import InputError
from si3fp.evaluate.metrics import building_of
from si3fp.evaluate.openings import Opening
from si3fp.geometry.rigid import FloatArray, Rigid3

Json = Mapping[str, Any]

MAX_TILT_DEG = 45.0  # decision: a wall that leans more is a roof


@dataclass(frozen=True, slots=True, eq=False)
class WallPart:
    """One wall face of a facade.

    Attributes
    ----------
    facade_id
        The facade that the model names, or None.
    building_id, name
        Its building and its own identifier.
    world_from_plane
        Frame of the plane: x right seen from outside, y up, z outwards.
    corners_m
        (V, 2) on the plane.
    openings
        Apertures and glazed doors.
    balconies, wwr_interval
        What the model says of its facade, or None.
    """

    facade_id: str | None
    building_id: str
    name: str
    world_from_plane: Rigid3
    corners_m: FloatArray
    openings: tuple[Opening, ...]
    balconies: bool | None
    wwr_interval: tuple[float, float] | None


def wall_parts(
    model: Json, metres_per_unit: float, left_out: Counter[str], missing: dict[str, str]
) -> Iterator[WallPart]:
    """The walls that are facades; counts what is not, and keeps what a run marked as missing."""
    whole = str(model.get("display_name") or model.get("identifier") or "all")
    faces = [
        (face, (room.get("user_data") or {}).get("building_id"))
        for room in model.get("rooms") or []
        for face in room.get("faces") or []
    ]
    faces += [(face, None) for face in model.get("orphaned_faces") or []]
    left_out["apertures without a wall, left out"] += len(model.get("orphaned_apertures") or [])
    for face, building_id in faces:
        boundary = (face.get("boundary_condition") or {}).get("type", "Outdoors")
        data = face.get("user_data") or {}
        own = data.get("si3fp") or {}
        if face.get("face_type") != "Wall":
            left_out["apertures in roofs and floors, left out"] += len(face.get("apertures") or [])
        elif "missing" in own:
            missing[str(data.get("facade_id"))] = str(own["missing"])
        elif boundary == "Outdoors":
            part = _part(face, metres_per_unit, building_id, whole)
            if abs(part.world_from_plane.rotation[2, 2]) > np.sin(np.deg2rad(MAX_TILT_DEG)):
                left_out["walls that lean more than 45 degrees, left out"] += 1
            else:
                yield part
        elif boundary != "Surface":
            left_out["walls against the ground or without heat flow, left out"] += 1
    for what in [what for what, count in left_out.items() if not count]:
        del left_out[what]


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


def _part(face: Json, metres_per_unit: float, building_id: str | None, whole: str) -> WallPart:
    corners = _corners(face, metres_per_unit)
    name = str(face.get("identifier", ""))
    # Newell's normal: twice the area vector, for any planar polygon.
    normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    length = np.linalg.norm(normal)
    if length < 1e-9:
        raise InputError(f"The wall {name} in the honeybee model has no area.")
    normal = normal / length
    up = np.array([0.0, 0.0, 1.0]) - normal[2] * normal
    if np.linalg.norm(up) < 1e-6:
        up = np.array([0.0, 1.0, 0.0])
    up /= np.linalg.norm(up)
    world_from_plane = Rigid3(np.column_stack([np.cross(up, normal), up, normal]), corners[0])
    plane_from_world = world_from_plane.inverse()
    openings = []
    doors = [door for door in face.get("doors") or [] if door.get("is_glass")]
    for thing in [*(face.get("apertures") or []), *doors]:
        data = thing.get("user_data") or {}
        door = thing.get("type") == "Door" or data.get("label") == "balcony_door"
        window_id = data.get("window_id")
        openings.append(
            Opening(
                None if window_id is None else str(window_id),
                "balcony_door" if door else "window",
                plane_from_world.apply(_corners(thing, metres_per_unit))[:, :2],
            )
        )
    data = face.get("user_data") or {}
    facade_id = data.get("facade_id")
    owner = whole if facade_id is None else building_of(str(facade_id), whole)
    balconies = data.get("balcony", data.get("balconies"))
    return WallPart(
        None if facade_id is None else str(facade_id),
        str(building_id) if building_id is not None else owner,
        name,
        world_from_plane,
        plane_from_world.apply(corners)[:, :2],
        tuple(openings),
        None if balconies is None else bool(balconies),
        _interval(data.get("wwr_interval"), name),
    )


def _interval(written: Any, name: str) -> tuple[float, float] | None:
    if written is None:
        return None
    try:
        low, high = (float(value) for value in written)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"user_data.wwr_interval of the wall {name} needs two numbers, got {written!r}."
        ) from error
    return low, high
