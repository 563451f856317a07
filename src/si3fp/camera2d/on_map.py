"""Place and north of a levelled reconstruction, by GPS and by the footprints (C.2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from si3fp.camera2d.map_fit import fit_to_map
from si3fp.camera2d.placed import PlacedReconstruction
from si3fp.camera2d.placement import Placement, place_on_footprints, placement_hypotheses
from si3fp.config import WorldConfig
from si3fp.errors import InputError, ReconstructionError
from si3fp.geometry.enu import GeoOrigin, world_from_geodetic
from si3fp.geometry.rigid import FloatArray, Rigid3

GpsPosition = tuple[float, float, float | None]
"""Latitude and longitude in degrees (WGS 84), height in metres where it is known."""

_SIGMAS = 3.0


def places_in_plan(
    gps: Mapping[str, GpsPosition], origin: GeoOrigin | None
) -> dict[str, FloatArray]:
    """East and north (2,) by photo id of the origin, or of the middle of the positions."""
    if not gps:
        return {}
    frame = origin or middle_of(gps)
    return {
        name: world_from_geodetic([lat_deg, lon_deg, height_m or frame.height_m], frame)[:2]
        for name, (lat_deg, lon_deg, height_m) in gps.items()
    }


def middle_of(gps: Mapping[str, GpsPosition], above_ground_m: float = 0.0) -> GeoOrigin:
    """The middle of the positions to 1e-5 degrees, at the height of the ground; 0 if unknown."""
    lat_deg, lon_deg = np.mean([place[:2] for place in gps.values()], axis=0)
    heights = [place[2] for place in gps.values() if place[2] is not None]
    height_m = float(np.median(heights)) - above_ground_m if heights else 0.0
    return GeoOrigin(round(float(lat_deg), 5), round(float(lon_deg), 5), round(height_m, 3))


def place_by_gps(
    level: PlacedReconstruction,
    gps: Mapping[str, GpsPosition],
    origin: GeoOrigin | None,
    config: WorldConfig,
) -> PlacedReconstruction:
    """The reconstruction turned and shifted to where GPS saw its cameras; its heights stay.

    Parameters
    ----------
    level
        In metres, the ground at z = 0.
    gps
        Positions by photo id, of photos of ``level``.
    origin
        Of the world; None for the middle of the positions at the height of the ground.
    config
        Limits.

    Returns
    -------
    The reconstruction as it was, with a note, where GPS tells no north.
    """
    centres = {photo.id: photo.centre_in_world for photo in level.photos}
    if origin is None:
        above_m = float(np.median([centres[name][2] for name in gps]))
        origin = middle_of(gps, above_m)
    places = places_in_plan(gps, origin)
    try:
        fit = fit_to_map(
            [centres[name][:2] for name in places], list(places.values()), config.gps_sigma_m, 1.0
        )
    except InputError as error:
        return replace(level, notes=(*level.notes, f"GPS tells no place: {error}"))
    if fit.heading_sigma_deg > config.max_heading_sigma_deg:
        note = (
            f"GPS tells north only within {fit.heading_sigma_deg:.0f} degrees, which is not used: "
            f"the {len(places)} photos with GPS stand too near to one another."
        )
        return replace(level, notes=(*level.notes, note))
    turn = np.deg2rad(-fit.heading_deg)
    rotation = np.array(
        [
            [np.cos(turn), -np.sin(turn), 0.0],
            [np.sin(turn), np.cos(turn), 0.0],
            [0.0, 0.0, 1.0],
        ]
    )
    fact = (
        f"Place and north: by the GPS of {len(places)} photos, +- {fit.centre_sigma_m:.1f} m and "
        f"{fit.heading_sigma_deg:.1f} degrees; the photos lie {np.median(fit.distances_m):.1f} m "
        "(median) from where GPS saw them."
    )
    return level.moved(
        Rigid3(rotation, np.array([*fit.offset_m, 0.0])),
        placed_by="GPS",
        heading_sigma_deg=fit.heading_sigma_deg,
        position_sigma_m=fit.centre_sigma_m,
        origin=origin,
        facts=(*level.facts, fact),
    )


def place_on_map(
    level: PlacedReconstruction,
    walls_in_world: ArrayLike,
    outward_in_world: ArrayLike,
    edges_in_world: ArrayLike,
    origin: GeoOrigin,
    config: WorldConfig | None = None,
) -> PlacedReconstruction:
    """The reconstruction on the footprints whose edges its walls fit, its ground at z = 0.

    Parameters
    ----------
    level
        In metres. Where GPS placed it only ways near that place count, and it stays there if none
        fits; where known cameras placed it, it stays.
    walls_in_world, outward_in_world
        (W, 2, 2) ends of the walls in the frame of ``level`` seen from above, and (W, 2) their
        outsides.
    edges_in_world
        (E, 2, 2) edges of the footprints in the frame of ``origin``, outside on the right.
    origin
        Of the footprints, at the height of their lowest ground; that of ``level`` where GPS placed
        it.
    config
        Limits; the defaults where left out.

    Raises
    ------
    InputError
        If a wall or an edge has no length or a value is not finite.
    ReconstructionError
        If the units are no metres, no way fits or several fit equally well; they are listed.
    """
    config = config or WorldConfig()
    if level.placed_by == "cameras":
        return level
    if not level.metric:
        raise ReconstructionError(
            "A reconstruction without metres cannot be laid on footprints. Give measured distances "
            "(--triangle FILE), or leave out --footprints."
        )
    placement: Placement | None
    if level.placed_by == "GPS":
        placement = _near_gps(level, walls_in_world, outward_in_world, edges_in_world, config)
        if placement is None:
            note = "No way to lay the walls on the footprints agrees with GPS; its place is kept."
            return replace(level, notes=(*level.notes, note))
    else:
        placement = place_on_footprints(walls_in_world, outward_in_world, edges_in_world)
    sigma_m = float(np.max(placement.offset_sigma_m))
    on_edges = sum(edge >= 0 for edge in placement.edge_of_wall)
    fact = (
        f"Place and north: {on_edges} of {len(placement.edge_of_wall)} walls lie on edges of the "
        f"footprints, +- {sigma_m:.2f} m and {placement.heading_sigma_deg:.2f} degrees."
    )
    shift = placement.world_from_level.translation - [0.0, 0.0, level.ground_z_m]
    return level.moved(
        Rigid3(placement.world_from_level.rotation, shift),
        placed_by="footprints",
        heading_sigma_deg=placement.heading_sigma_deg,
        position_sigma_m=sigma_m,
        origin=origin,
        facts=(*level.facts, fact),
    )


def _near_gps(
    level: PlacedReconstruction,
    walls: ArrayLike,
    outward: ArrayLike,
    edges: ArrayLike,
    config: WorldConfig,
) -> Placement | None:
    """The best way that turns and moves the walls no farther than GPS may be wrong."""
    centre = np.zeros(3)
    centre[:2] = np.asarray(walls, dtype=np.float64).reshape(-1, 2).mean(axis=0)
    reach_m = _SIGMAS * float(np.hypot(level.position_sigma_m or 0.0, config.gps_sigma_m))
    reach_deg = max(_SIGMAS * (level.heading_sigma_deg or 0.0), config.max_heading_sigma_deg)
    for one in placement_hypotheses(walls, outward, edges):  # best first
        turn_deg = abs((one.heading_deg + 180) % 360 - 180)
        moved_m = float(np.linalg.norm(one.world_from_level.apply(centre)[:2] - centre[:2]))
        if one.score >= config.min_fit and turn_deg <= reach_deg and moved_m <= reach_m:
            return one
    return None
