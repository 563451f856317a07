"""M.2: buildings with windows become a honeybee model (HBJSON), written without honeybee.

One room per storey, one wall per footprint edge and storey; the ground floor touches the ground,
the top one the sky, storeys touch each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise

import numpy as np

from si3fp.config import ThermalConfig
from si3fp.errors import ThermalModelError
from si3fp.geometry.enu import GeoOrigin
from si3fp.model import Building, Facade
from si3fp.thermal.archetypes import Archetype
from si3fp.thermal.constructions import HVAC, PROGRAM, energy_properties
from si3fp.thermal.hbjson import Json, adjacent, face, identifiers, outdoors, vertex, wall
from si3fp.thermal.openings import Opening, fit, project, split
from si3fp.thermal.outline import PARTY_SHARE, Edge, edges_of, party_share


@dataclass(frozen=True, slots=True)
class AssembledModel:
    """A thermal model and what had to be assumed or repaired.

    Attributes
    ----------
    hbjson
        The model as a honeybee ``Model`` dictionary.
    notes
        One line for every assumption and repair, with its size; also in the model's user data.
    """

    hbjson: Json
    notes: tuple[str, ...]


def assemble(
    buildings: Sequence[Building],
    archetypes: Mapping[str, Archetype],
    config: ThermalConfig,
    loose_facades: Sequence[Facade] = (),
    *,
    origin: GeoOrigin | None = None,
    neighbours: Sequence[Building] = (),
) -> AssembledModel:
    """The thermal model of buildings, in the world frame.

    Parameters
    ----------
    buildings
        Buildings with their facades; the id of a facade ends in its footprint edge's index.
    archetypes
        Archetype by building id.
    config
        Tolerance and inset.
    loose_facades
        Facades without a building: they become faces without a room.
    origin
        Origin of the world frame; needed only where there is no building. None where place and
        north are unknown: the model says so.
    neighbours
        Further buildings that may share walls with these, such as the rest of the street; those
        that are in `buildings` too are not counted twice.

    Raises
    ------
    ThermalModelError
        If a footprint is not a polygon, ids clash, an archetype is missing, the buildings' origins
        differ or there is nothing.
    """
    names = identifiers([b.id for b in buildings] + [f.id for f in loose_facades])
    origins: set[GeoOrigin | None] = {b.origin for b in buildings}
    if origin is not None or not buildings:
        origins.add(origin)
    if not names or len(origins) != 1:
        raise ThermalModelError(
            f"A thermal model needs a building or facade and one origin; got {len(buildings)} "
            f"buildings, {len(loose_facades)} facades without one and the origins {origins}."
        )
    (frame,) = origins
    notes: list[str] = []
    rooms: list[Json] = []
    used: list[Archetype] = []
    for building in buildings:
        if building.id not in archetypes:
            raise ThermalModelError(f"Building {building.id} has no archetype.")
        used.append(archetypes[building.id])
        notes += [f"{building.id}: {note}" for note in used[-1].notes]
        walls, edges, wall_notes = _walls(
            building, names[building.id], config, [*buildings, *neighbours]
        )
        rooms += _rooms(building, names[building.id], used[-1], edges, walls)
        notes += wall_notes
    faces: list[Json] = []
    for facade in loose_facades:
        openings, _ = project(facade, facade.world_from_facade)
        openings, fit_notes = fit(openings, facade.width_m, facade.height_m, config.inset_m)
        extent_m = (facade.width_m, 0.0, facade.height_m)
        user_data: Json = {"facade_id": facade.id, **_stated(facade)}
        faces.append(
            wall(
                names[facade.id],
                facade.world_from_facade,
                extent_m,
                openings,
                outdoors(),
                user_data,
            )
        )
        notes += fit_notes
    only = next(iter(names)) if len(names) == 1 else None
    hbjson: Json = {
        "type": "Model",
        "identifier": names[only] if only else "si3fp-model",
        "display_name": only or "si3fp model",
        "units": "Meters",
        "tolerance": config.tolerance_m,
        "angle_tolerance": 1.0,
        "rooms": rooms,
        "orphaned_faces": faces,
        "properties": {"type": "ModelProperties", "energy": energy_properties(used)},
        "user_data": {
            "si3fp": {
                "origin": None if frame is None else asdict(frame),
                "north_known": frame is not None,
                "buildings": [_summary(b, a) for b, a in zip(buildings, used, strict=True)],
                "notes": list(notes),
            }
        },
    }
    return AssembledModel(hbjson, tuple(notes))


def _stated(facade: Facade) -> Json:
    """What is known of a facade as a whole, for the user data of its walls."""
    interval = facade.wwr_interval
    return {} if interval is None else {"wwr_interval": [float(end) for end in interval]}


def _summary(building: Building, archetype: Archetype) -> Json:
    return {
        "id": building.id,
        "year": building.year,
        "storeys": building.storeys,
        "height_m": building.height_m,
        "archetype": {
            "source": "TABULA",
            "country": archetype.country,
            "period": list(archetype.period),
            "u_wall_w_m2k": archetype.u_wall_w_m2k,
            "u_roof_w_m2k": archetype.u_roof_w_m2k,
            "u_floor_w_m2k": archetype.u_floor_w_m2k,
            "u_window_w_m2k": archetype.u_window_w_m2k,
            "g_window": archetype.g_window,
        },
    }


def _facades_by_edge(building: Building) -> dict[int, Facade]:
    """Facades by the footprint edge in which their id ends."""
    by_edge: dict[int, Facade] = {}
    for facade in building.facades:
        prefix, _, index = facade.id.rpartition("-")
        if prefix != building.id or not index.isdigit():
            raise ThermalModelError(
                f"Facade {facade.id} does not name an edge of building {building.id}; "
                f"its id should be {building.id}-<edge index>."
            )
        if int(index) >= len(building.footprint_in_world) or int(index) in by_edge:
            raise ThermalModelError(
                f"Facade {facade.id}: building {building.id} has no such edge, or it comes twice."
            )
        by_edge[int(index)] = facade
    return by_edge


def _levels_m(building: Building) -> list[float]:
    """Heights of the slabs above the ground, from 0 to the eaves."""
    return [float(z) for z in np.linspace(0.0, building.height_m, building.storeys + 1)]


def _walls(
    building: Building, name: str, config: ThermalConfig, street: Sequence[Building]
) -> tuple[list[list[Json]], list[Edge], list[str]]:
    """Walls of a building by storey, the edges they stand on, and notes."""
    edges, notes = edges_of(building, config.tolerance_m)
    facades = _facades_by_edge(building)
    missing = {row.facade_id: f"{row.step}: {row.reason}" for row in building.missing}
    others = [other for other in street if other.id != building.id]
    levels_m = _levels_m(building)
    walls: list[list[Json]] = [[] for _ in range(building.storeys)]
    for edge in edges:
        facade_id = f"{building.id}-{edge.index}"
        world_from_wall = edge.world_from_wall(building.base_z_m)
        user_data: Json = {"facade_id": facade_id}
        facade = facades.pop(edge.index, None)
        openings: list[Opening] = []
        if facade is None:
            reason = missing.get(facade_id, "coverage: no facade was found on this edge")
            user_data["si3fp"] = {"missing": reason}
        else:
            openings, project_notes = project(facade, world_from_wall)
            openings, fit_notes = fit(openings, edge.length_m, building.height_m, config.inset_m)
            notes += project_notes + fit_notes
            user_data |= _stated(facade)
        by_storey, split_notes = split(openings, levels_m, config.inset_m)
        notes += split_notes
        party: list[int] = []
        for k, (foot_m, head_m) in enumerate(pairwise(levels_m)):
            foot_z_m, head_z_m = building.base_z_m + foot_m, building.base_z_m + head_m
            if party_share(edge, foot_z_m, head_z_m, others) > PARTY_SHARE:
                party.append(k)
            closed = k in party and not by_storey[k]
            walls[k].append(
                wall(
                    f"{name}-s{k}-w{edge.index}",
                    world_from_wall,
                    (edge.length_m, foot_m, head_m),
                    by_storey[k],
                    {"type": "Adiabatic"} if closed else outdoors(),
                    user_data,
                )
            )
        notes += _party_notes(facade_id, party, by_storey)
    notes += [
        f"{facade.id}: its {len(facade.windows)} windows are dropped with their wall."
        for facade in facades.values()
    ]
    return walls, edges, notes


def _party_notes(
    facade_id: str, party: Sequence[int], by_storey: Sequence[Sequence[object]]
) -> list[str]:
    """Notes on the storeys where a neighbour stands against a wall."""
    adiabatic = ", ".join(str(k) for k in party if not by_storey[k])
    kept = ", ".join(str(k) for k in party if by_storey[k])
    notes = []
    if adiabatic:
        notes.append(f"{facade_id}: party wall, adiabatic in the storeys {adiabatic}.")
    if kept:
        notes.append(
            f"{facade_id}: a neighbour stands against it, but windows were found; "
            f"the storeys {kept} stay outdoors."
        )
    return notes


def _rooms(
    building: Building,
    name: str,
    archetype: Archetype,
    edges: Sequence[Edge],
    walls: Sequence[Sequence[Json]],
) -> list[Json]:
    """One room per storey, from the ground up."""
    levels_m = _levels_m(building)
    corners = [edge.start for edge in edges]
    rooms = []
    for k in range(building.storeys):
        foot_z_m, head_z_m = building.base_z_m + levels_m[k], building.base_z_m + levels_m[k + 1]
        room = f"{name}-s{k}"
        below, above = f"{name}-s{k - 1}", f"{name}-s{k + 1}"
        floor = face(
            f"{room}-floor",
            "Floor",
            [vertex([*corner, foot_z_m]) for corner in reversed(corners)],
            adjacent(f"{below}-ceiling", below) if k > 0 else {"type": "Ground"},
        )
        ceiling = face(
            f"{room}-ceiling",
            "RoofCeiling",
            [vertex([*corner, head_z_m]) for corner in corners],
            adjacent(f"{above}-floor", above) if k + 1 < building.storeys else outdoors(),
        )
        rooms.append(
            {
                "type": "Room",
                "identifier": room,
                "display_name": f"{building.id} storey {k}",
                "story": room,
                "faces": [floor, *walls[k], ceiling],
                "properties": {
                    "type": "RoomPropertiesAbridged",
                    "energy": {
                        "type": "RoomEnergyPropertiesAbridged",
                        "construction_set": archetype.name,
                        "program_type": PROGRAM,
                        "hvac": HVAC,
                    },
                },
                "user_data": {"building_id": building.id, "storey": k},
            }
        )
    return rooms
