"""What is true of an estate: the model with every aperture, and what the cameras could see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
from benchmarks.estate.capture.cameras import Equirect, LensCamera, Pose
from benchmarks.estate.plan import Building, Estate, Opening, Wall
from numpy.typing import NDArray

from si3fp.config import ThermalConfig
from si3fp.geometry.enu import GeoOrigin, geodetic_from_world
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.model import Building as ModelBuilding
from si3fp.model import Facade, Window
from si3fp.thermal.archetypes import archetype
from si3fp.thermal.assemble import assemble
from si3fp.thermal.hbjson import outdoors, wall
from si3fp.thermal.openings import Opening as Part

FloatArray = NDArray[np.float64]
Json = dict[str, Any]
Visible = Callable[[FloatArray, FloatArray], NDArray[np.bool_]]

SLAB_GAP_M = 0.001  # between the parts of a window that a slab of the model cuts
OFF_WALL_M = 0.05  # a point this far in front of a wall is taken for a point on it
DECIMALS = 6


def facade_id(building: Building, edge: int) -> str:
    """The id of the facade on a footprint edge."""
    return f"{building.id}-{edge}"


def facades_of(building: Building) -> list[Facade]:
    """The true facades: rectangles from the ground to the eaves, doors left out.

    Openings of a loggia lie on the plane of their wall, where they are seen from the front. Where
    a gable has windows above the eaves, its facade reaches up to its peak.
    """
    return [
        Facade(
            facade_id(building, edge),
            wall.world_from_facade,
            wall.width_m,
            _top_m(building, wall),
            tuple(_window(opening) for opening in _glazed(wall)),
        )
        for edge, wall in enumerate(building.walls)
    ]


def _glazed(wall: Wall) -> list[Opening]:
    return [opening for opening in wall.openings if opening.kind != "door"]


def _top_m(building: Building, wall: Wall) -> float:
    tops = [opening.y_m + opening.height_m for opening in _glazed(wall)]
    return wall.height_m if max(tops, default=0.0) > building.height_m else building.height_m


def _window(opening: Opening) -> Window:
    return Window(
        opening.x_m,
        opening.y_m,
        opening.width_m,
        opening.height_m,
        "balcony_door" if opening.kind == "balcony_door" else "window",
        recess_m=opening.recess_m + opening.depth_m,
    )


def truth_model(estate: Estate) -> Json:
    """The honeybee model of the buildings with their exact apertures.

    Rooms, constructions and loads are those of `si3fp.thermal.assemble`, so that heating demands of
    a found model and of this one differ by their geometry alone. The apertures are exact: nothing
    is clipped or merged; one that a slab crosses has a part in either storey. Walls carry
    ``user_data.facade_id`` and ``user_data.balcony``.
    """
    config = ThermalConfig()
    neighbours = [_thermal(each, estate) for each in estate.neighbours]
    known = [_thermal(each, estate) for each in estate.buildings]
    kinds = {b.id: archetype(config.country, b.year, config.default_year) for b in known}
    model = assemble(known, kinds, config, neighbours=neighbours).hbjson
    facades = {f.id: f for building in estate.buildings for f in facades_of(building)}
    balconies = {
        facade_id(building, edge): wall.has_balconies
        for building in estate.buildings
        for edge, wall in enumerate(building.walls)
    }
    for room in model["rooms"]:
        room["faces"] = [
            _with_apertures(face, facades, balconies) if face["face_type"] == "Wall" else face
            for face in room["faces"]
        ]
    for building in estate.buildings:
        for facade in facades_of(building):
            if facade.height_m > building.height_m:
                model["orphaned_faces"].append(_gable(facade, building.height_m, balconies))
    model["identifier"] = f"{estate.name}-{estate.seed}-truth"
    model["display_name"] = f"Truth of estate {estate.name}, seed {estate.seed}"
    return model


def _thermal(building: Building, estate: Estate) -> ModelBuilding:
    """The building with bare facades, for the rooms."""
    facades = tuple(
        Facade(each.id, each.world_from_facade, each.width_m, building.height_m)
        for each in facades_of(building)
    )
    return ModelBuilding(
        id=building.id,
        origin=estate.origin,
        footprint_in_world=building.outline,
        base_z_m=0.0,
        height_m=building.height_m,
        storeys=building.storeys,
        facades=facades,
        year=building.year,
        use=building.use,
    )


def _with_apertures(face: Json, facades: dict[str, Facade], balconies: dict[str, bool]) -> Json:
    """A wall of a room with the parts of its facade's windows that lie on it."""
    facade = facades[face["user_data"]["facade_id"]]
    heights = [corner[2] for corner in face["geometry"]["boundary"]]
    foot_m, head_m = min(heights), max(heights)
    parts = _parts(facade, foot_m, head_m)
    return wall(
        face["identifier"],
        facade.world_from_facade,
        (facade.width_m, foot_m, head_m),
        parts,
        outdoors() if parts else face["boundary_condition"],
        {**face["user_data"], "balcony": balconies[facade.id]},
    )


def _gable(facade: Facade, eaves_m: float, balconies: dict[str, bool]) -> Json:
    """The wall above the eaves: a face without a room behind."""
    return wall(
        f"{facade.id}-gable",
        facade.world_from_facade,
        (facade.width_m, eaves_m, facade.height_m),
        _parts(facade, eaves_m, facade.height_m),
        outdoors(),
        {"facade_id": facade.id, "balcony": balconies[facade.id]},
    )


def _parts(facade: Facade, foot_m: float, head_m: float) -> list[Part]:
    parts = []
    for number, window in enumerate(facade.windows):
        low, high = window.y_m, window.y_m + window.height_m
        bottom = low if low >= foot_m else foot_m + SLAB_GAP_M
        top = high if high <= head_m else head_m - SLAB_GAP_M
        if top > bottom:
            name = f"{facade.id}-w{number}"
            right = window.x_m + window.width_m
            parts.append(Part(window.x_m, right, bottom, top, window, name))
    return parts


def facades_record(estate: Estate) -> Json:
    """``facades.json``: every facade and everything in it, doors and balconies too."""
    facades = {}
    for building in estate.buildings:
        for edge, facade in enumerate(facades_of(building)):
            wall = building.walls[edge]
            pose = facade.world_from_facade
            facades[facade.id] = {
                "building": building.id,
                "width_m": round(facade.width_m, DECIMALS),
                "height_m": round(facade.height_m, DECIMALS),
                "world_from_facade": {
                    "rotation": pose.rotation.round(12).tolist(),
                    "translation": pose.translation.round(DECIMALS).tolist(),
                },
                "finish": wall.finish.kind,
                "balcony": wall.has_balconies,
                "wwr": round(facade.wwr, DECIMALS),
                "openings": [
                    {key: value for key, value in asdict(opening).items() if key != "behind"}
                    for opening in wall.openings
                ],
                "balconies": [asdict(balcony) for balcony in wall.balconies],
            }
    buildings = {
        b.id: {
            "height_m": b.height_m,
            "storeys": b.storeys,
            "year": b.year,
            "longest_side_m": round(max(wall.width_m for wall in b.walls), DECIMALS),
            "facades": len(b.walls),
        }
        for b in estate.buildings
    }
    return {
        "schema": "estate-facades",
        "name": estate.name,
        "seed": estate.seed,
        "origin": asdict(estate.origin),
        "note": "Boxes are metres from the facade's lower left corner as seen from outside. "
        "Openings with depth_m > 0 lie in a loggia; their boxes are projected onto the wall's "
        "plane. Doors are no apertures of model.hbjson.",
        "buildings": buildings,
        "facades": facades,
    }


def poses_record(poses: dict[str, Pose], origin: GeoOrigin) -> Json:
    """``poses.json``: the exact poses by picture."""
    return {
        "schema": "estate-poses",
        "origin": asdict(origin),
        "note": "Metres in the world (east, north, up) and degrees; exact, not as reported.",
        "poses": {
            name: {
                "place_in_world_m": [round(value, DECIMALS) for value in pose.place],
                "heading_deg": round(pose.heading_deg, DECIMALS),
                "pitch_deg": round(pose.pitch_deg, DECIMALS),
                "roll_deg": round(pose.roll_deg, DECIMALS),
            }
            for name, pose in poses.items()
        },
    }


def footprints_geojson(estate: Estate) -> Json:
    """The outlines of the buildings as a map has them, edge i the facade ``<id>-<i>``."""
    features = []
    for building in estate.buildings:
        ring = np.concatenate([building.outline, building.outline[:1]])
        places = geodetic_from_world(np.column_stack([ring, np.zeros(len(ring))]), estate.origin)
        features.append(
            {
                "type": "Feature",
                "geometry": {
                    "type": "Polygon",
                    "coordinates": [[[round(lon, 9), round(lat, 9)] for lat, lon, _ in places]],
                },
                "properties": {
                    "id": building.id,
                    "ground_m": estate.origin.height_m,
                    "height_m": building.height_m,
                    "storeys": building.storeys,
                    "year": building.year,
                    "use": building.use,
                },
            }
        )
    return {"type": "FeatureCollection", "features": features}


def facade_grid(facade: Facade, m_per_px: float) -> FacadeGrid:
    """The grid of a facade's orthophotos and masks, from its lower left corner."""
    return FacadeGrid.covering(facade.world_from_facade, facade.width_m, facade.height_m, m_per_px)


def seen_on(grid: FacadeGrid, camera: Equirect | LensCamera, visible: Visible) -> NDArray[np.bool_]:
    """Where (H, W) a camera could see the plane of a facade; a hole in the wall counts as wall."""
    x, y = np.meshgrid(np.arange(grid.width_px) + 0.5, np.arange(grid.height_px) + 0.5)
    points = grid.world_from_pixels(np.stack([x, y], axis=-1).reshape(-1, 2))
    points += OFF_WALL_M * grid.normal_in_world
    place = camera.world_from_cam.translation
    seen = (place - points) @ grid.normal_in_world > 0
    pixels = camera.pixels(points)
    seen &= np.isfinite(pixels).all(axis=-1)
    if camera.seen is not None:
        column, row = np.where(seen[:, None], pixels, 0).astype(int).T
        height, width = camera.seen.shape
        seen &= camera.seen[np.minimum(row, height - 1), np.minimum(column, width - 1)]
    index = np.flatnonzero(seen)
    if len(index):
        seen[index] = visible(np.broadcast_to(place, (len(index), 3)), points[index])
    return seen.reshape(grid.height_px, grid.width_px)
