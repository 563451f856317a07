"""Names, faces and apertures as honeybee dictionaries.

Vertices are rounded to a micrometre, so that the same input always gives the same dictionary.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Sequence
from typing import Any

from si3fp.errors import ThermalModelError
from si3fp.geometry.rigid import Rigid3
from si3fp.thermal.openings import Opening

Json = dict[str, Any]
DECIMALS = 6
LONGEST_NAME = 60  # honeybee allows 100 characters; suffixes of storeys, walls and windows follow


def identifiers(ids: Sequence[str]) -> dict[str, str]:
    """Names by id that honeybee and EnergyPlus accept: short, ASCII, unique regardless of case.

    Raises
    ------
    ThermalModelError
        If an id comes twice.
    """
    names: dict[str, str] = {}
    for identifier in ids:
        if identifier in names:
            raise ThermalModelError(f"Two buildings or facades have the id {identifier!r}.")
        name = re.sub(r"[^A-Za-z0-9_.-]", "_", identifier)
        taken = {other.lower() for other in names.values()}
        if name != identifier or len(name) > LONGEST_NAME or not name or name.lower() in taken:
            digest = hashlib.sha256(identifier.encode()).hexdigest()[:8]
            name = f"{name[:LONGEST_NAME]}-{digest}".lstrip("-")
        names[identifier] = name
    return names


def vertex(point_in_world: Iterable[float]) -> list[float]:
    """A point (3,) as plain numbers; never a negative zero."""
    return [round(float(value), DECIMALS) + 0.0 for value in point_in_world]


def rectangle(
    world_from_wall: Rigid3, left_m: float, right_m: float, bottom_m: float, top_m: float
) -> list[list[float]]:
    """Corners counter-clockwise seen from outside, from the lower left."""
    corners = [(left_m, bottom_m), (right_m, bottom_m), (right_m, top_m), (left_m, top_m)]
    return [vertex(world_from_wall.apply([x, y, 0.0])) for x, y in corners]


def outdoors() -> Json:
    """The boundary condition of an outer surface."""
    return {"type": "Outdoors", "sun_exposure": True, "wind_exposure": True}


def adjacent(face_name: str, room_name: str) -> Json:
    """The boundary condition of a surface that touches a face of another room."""
    return {"type": "Surface", "boundary_condition_objects": [face_name, room_name]}


def face(
    name: str,
    face_type: str,
    boundary: list[list[float]],
    boundary_condition: Json,
    *,
    apertures: Sequence[Json] = (),
    user_data: Json | None = None,
) -> Json:
    """A ``Face``; its boundary runs counter-clockwise seen from outside the room."""
    return {
        "type": "Face",
        "identifier": name,
        "geometry": {"type": "Face3D", "boundary": boundary},
        "face_type": face_type,
        "boundary_condition": boundary_condition,
        "apertures": list(apertures),
        "properties": {
            "type": "FacePropertiesAbridged",
            "energy": {"type": "FaceEnergyPropertiesAbridged"},
        },
        "user_data": dict(user_data or {}),
    }


def wall(
    name: str,
    world_from_wall: Rigid3,
    extent_m: tuple[float, float, float],
    openings: Sequence[Opening],
    boundary_condition: Json,
    user_data: Json,
) -> Json:
    """A ``Face`` of type Wall with its apertures.

    Parameters
    ----------
    name
        Identifier; those of the apertures begin with it.
    world_from_wall
        Frame of the wall: x right seen from outside, y up, z outwards.
    extent_m
        Width, foot and head in the wall's frame.
    openings
        Openings inside this extent.
    boundary_condition, user_data
        As they are written; ``facade_id`` of the user data is repeated on every aperture.
    """
    width_m, foot_m, head_m = extent_m
    return face(
        name,
        "Wall",
        rectangle(world_from_wall, 0.0, width_m, foot_m, head_m),
        boundary_condition,
        apertures=[
            _aperture(f"{name}-a{i}", world_from_wall, opening, user_data["facade_id"])
            for i, opening in enumerate(openings)
        ],
        user_data=user_data,
    )


def _aperture(name: str, world_from_wall: Rigid3, opening: Opening, facade_id: str) -> Json:
    window = opening.window
    boundary = rectangle(
        world_from_wall, opening.left_m, opening.right_m, opening.bottom_m, opening.top_m
    )
    return {
        "type": "Aperture",
        "identifier": name,
        "geometry": {"type": "Face3D", "boundary": boundary},
        "is_operable": False,
        "boundary_condition": outdoors(),
        "properties": {
            "type": "AperturePropertiesAbridged",
            "energy": {"type": "ApertureEnergyPropertiesAbridged"},
        },
        "user_data": {
            "window_id": opening.window_id,
            "facade_id": facade_id,
            "label": window.label,
            "score": float(window.score),
            "views": list(window.views),
            "origin": window.origin,
            "evidence": window.evidence,
            "recess_m": None if window.recess_m is None else float(window.recess_m),
            "edge_sigma_m": [float(sigma) for sigma in window.edge_sigma_m],
        },
    }
