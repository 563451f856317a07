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
_CLEAR_LEAD = 0.1  # in score, as of a placement without GPS


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
    """The reconstruction turned and shifted to where GPS saw its cameras, its ground at z = 0.

    Parameters
    ----------
    level
        In metres.
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
        above_m = float(np.median([centres[name][2] for name in gps])) - level.ground_z_m
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
        Rigid3(rotation, np.array([*fit.offset_m, -level.ground_z_m])),
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
        If a wall or an edge has no length, a value is not finite, or the footprints are elsewhere
        by GPS or known cameras.
    ReconstructionError
        If the units are no metres, no way fits or several fit equally well; they are listed.
    """
    config = config or WorldConfig()
    if level.placed_by == "cameras":
        _require_near(level, edges_in_world, "their cameras and --origin", config)
        return level
    if not level.metric:
        raise ReconstructionError(
            "A reconstruction without metres cannot be laid on footprints. Give measured distances "
            "(--triangle FILE), or leave out --footprints."
        )
    if level.placed_by == "GPS":
        _require_near(level, edges_in_world, "GPS", config)
        near = _near_gps(level, walls_in_world, outward_in_world, edges_in_world, config)
        if not near:
            note = "No way to lay the walls on the footprints agrees with GPS; its place is kept."
            return replace(level, notes=(*level.notes, note))
        placement, *others = near
    else:
        placement, others = (
            place_on_footprints(walls_in_world, outward_in_world, edges_in_world),
            [],
        )
    sigma_m = float(np.max(placement.offset_sigma_m))
    on_edges = sum(edge >= 0 for edge in placement.edge_of_wall)
    fact = (
        f"Place and north: {on_edges} of {len(placement.edge_of_wall)} walls lie on edges of the "
        f"footprints, +- {sigma_m:.2f} m and {placement.heading_sigma_deg:.2f} degrees."
    )
    notes = [
        f"GPS cannot tell the place used from this one, nearly as good: {one}." for one in others
    ]
    shift = placement.world_from_level.translation - [0.0, 0.0, level.ground_z_m]
    return level.moved(
        Rigid3(placement.world_from_level.rotation, shift),
        placed_by="footprints",
        heading_sigma_deg=placement.heading_sigma_deg,
        position_sigma_m=sigma_m,
        origin=origin,
        facts=(*level.facts, fact),
        notes=(*level.notes, *notes),
    )


def _require_near(
    level: PlacedReconstruction, edges: ArrayLike, by: str, config: WorldConfig
) -> None:
    corners = np.asarray(edges, dtype=np.float64).reshape(-1, 1, 2)
    centres = np.stack([photo.centre_in_world[:2] for photo in level.photos])
    nearest_m = float(np.linalg.norm(corners - centres, axis=2).min())
    if nearest_m > config.max_footprint_distance_m:
        raise InputError(
            f"By {by} the photos were taken {nearest_m:,.0f} m from the nearest corner of the "
            "footprints. Check that both are of the same building."
        )


def _near_gps(
    level: PlacedReconstruction,
    walls: ArrayLike,
    outward: ArrayLike,
    edges: ArrayLike,
    config: WorldConfig,
) -> list[Placement]:
    """The ways that turn and move the walls no farther than GPS may be wrong, best first.

    Those that fit clearly worse than the best are left out.
    """
    centre = np.zeros(3)
    centre[:2] = np.asarray(walls, dtype=np.float64).reshape(-1, 2).mean(axis=0)
    reach_m = _SIGMAS * float(np.hypot(level.position_sigma_m or 0.0, config.gps_sigma_m))
    reach_deg = max(_SIGMAS * (level.heading_sigma_deg or 0.0), config.max_heading_sigma_deg)
    near = [
        one
        for one in placement_hypotheses(walls, outward, edges)
        if one.score >= config.min_fit
        and abs((one.heading_deg + 180) % 360 - 180) <= reach_deg
        and np.linalg.norm(one.world_from_level.apply(centre)[:2] - centre[:2]) <= reach_m
    ]
    return [one for one in near if one.score >= near[0].score - _CLEAR_LEAD]
