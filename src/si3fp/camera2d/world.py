"""From a reconstruction to the world: metres, z up and, where they can be known, place and north.

`level_and_scale` takes what structure from motion gives, `known_cameras` what the user knows
already; `on_map.place_on_map` lays the result on footprints once walls are found in it (C.2).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from si3fp.camera2d.metres import choose_scale, require_metres, tape_notes
from si3fp.camera2d.on_map import GpsPosition, place_by_gps, places_in_plan
from si3fp.camera2d.placed import (
    PlacedReconstruction,
    transformed_photo,
    transformed_points,
)
from si3fp.camera2d.scale import Side, scale_from_distances
from si3fp.camera2d.usable import usable
from si3fp.camera2d.vertical import Vertical, find_vertical
from si3fp.config import WorldConfig
from si3fp.errors import InputError, ReconstructionError
from si3fp.geometry.enu import GeoOrigin
from si3fp.geometry.rigid import FloatArray
from si3fp.geometry.similarity import Similarity3
from si3fp.model import KnownDistance, Photo, SparsePoints

_LOW_SHARE = 0.02  # of the points may lie below the ground: wrong matches, basements
_LISTED = 10


def level_and_scale(
    photos: Sequence[Photo],
    distortion: Mapping[str, ArrayLike],
    points: SparsePoints,
    *,
    distances: Sequence[KnownDistance] = (),
    gps: Mapping[str, GpsPosition] | None = None,
    origin: GeoOrigin | None = None,
    unscaled: bool = False,
    config: WorldConfig | None = None,
) -> PlacedReconstruction:
    """The reconstruction in metres with z up and the ground at z = 0; with GPS also on the map.

    Measured distances give the scale, else GPS. Without place and north x and y run anywhere, from
    the middle of the cameras.

    Parameters
    ----------
    photos, distortion, points
        As reconstructed: poses in any frame; k1, k2, p1, p2 by photo id.
    distances
        Measured between the places from which photos were taken.
    gps
        Positions by photo id; those of photos that were not reconstructed are ignored.
    origin
        Of the world where footprints give it; else GPS does.
    unscaled
        Go on where nothing gives the scale, in arbitrary units.
    config
        Limits; the defaults where left out.

    Raises
    ------
    InputError
        If ids repeat, a number is not finite, no photo of any distance was reconstructed, or
        distances contradict the reconstruction or the GPS.
    ReconstructionError
        If nothing gives the scale, cameras and walls tell no vertical, or fewer than three photos
        can be used.
    """
    config = config or WorldConfig()
    known = usable(photos, distortion, points)
    distance = known.typical_distance()
    vertical = find_vertical(known.photos, points, config.wall_tolerance * distance)
    turn = vertical.level_from_reconstruction
    plan = {name: (turn @ centre)[:2] for name, centre in known.centres.items()}
    positions = {name: place for name, place in (gps or {}).items() if name in plan}
    scale = choose_scale(
        known.centres,
        distances,
        plan,
        places_in_plan(positions, origin),
        config.unscaled_distance_m / distance if unscaled else None,
        config,
    )
    turned = Similarity3(scale.m_per_unit, turn, np.zeros(3))
    centres = turned.apply(np.stack(list(known.centres.values())))
    ground_z_m, notes = _ground_z_m(centres, turned.apply(points.points_in_world), config)
    middle = centres.mean(axis=0)
    level_from_reconstruction = Similarity3(
        scale.m_per_unit, turn, -np.array([middle[0], middle[1], ground_z_m])
    )
    level = PlacedReconstruction(
        photos=tuple(transformed_photo(p, level_from_reconstruction) for p in known.photos),
        lenses=known.lenses,
        points=transformed_points(points, level_from_reconstruction),
        m_per_unit=scale.m_per_unit,
        sigma_m_per_unit=scale.sigma_m_per_unit,
        scaled_by=scale.scaled_by,
        sides=scale.sides,
        left_out=known.left_out,
        facts=(
            f"{len(known.photos)} photos, {len(points)} points.",
            scale.fact,
            f"Vertical: +- {vertical.sigma_deg:.1f} degrees, by the cameras and "
            f"{vertical.walls} walls.",
        ),
        notes=(*scale.notes, *_tilted(vertical), *notes),
    )
    if not (level.metric and positions):
        return level
    return place_by_gps(level, positions, origin, config)


def known_cameras(
    photos: Sequence[Photo],
    distortion: Mapping[str, ArrayLike],
    points: SparsePoints,
    *,
    distances: Sequence[KnownDistance] = (),
    origin: GeoOrigin | None = None,
    config: WorldConfig | None = None,
) -> PlacedReconstruction:
    """The reconstruction in the frame of the user's cameras: metres, z up; on the map by an origin.

    Parameters
    ----------
    photos, distortion, points
        Poses in metres with z up, kept as they are: east, north and up of ``origin`` where that is
        given, else x and y run anywhere. k1, k2, p1, p2 by photo id.
    distances
        Measured between the places from which photos were taken: a check of the metres.
    origin
        Place of the frame's zero.
    config
        Limits; the defaults where left out.

    Raises
    ------
    InputError
        If ids repeat, a number is not finite, z is not up or the units are not metres.
    ReconstructionError
        If fewer than three photos can be used.
    """
    config = config or WorldConfig()
    known = usable(photos, distortion, points)
    notes: list[str] = []
    sides: tuple[Side, ...] = ()
    if distances:
        tape = scale_from_distances(known.centres, distances, config.tape_sigma_m)
        require_metres(tape)
        notes += tape_notes(tape)
        sides = tape.sides
    try:
        tolerance_m = config.wall_tolerance * config.unscaled_distance_m
        up_in_world = find_vertical(known.photos, points, tolerance_m).level_from_reconstruction[2]
    except ReconstructionError as error:
        notes.append(f"Whether z is up cannot be checked. {error}")
    else:
        _require_z_up(up_in_world, config)
    centres = np.stack(list(known.centres.values()))
    ground_z_m, ground_notes = _ground_z_m(centres, points.points_in_world, config)
    return PlacedReconstruction(
        photos=known.photos,
        lenses=known.lenses,
        points=points,
        m_per_unit=1.0,
        sigma_m_per_unit=0.0,
        scaled_by="cameras",
        placed_by="nothing" if origin is None else "cameras",
        origin=origin,
        ground_z_m=ground_z_m,
        sides=sides,
        left_out=known.left_out,
        facts=(
            f"{len(known.photos)} photos, {len(points)} points.",
            f"Known cameras give the scale, the vertical{'' if origin is None else ', the place'}.",
        ),
        notes=(*notes, *ground_notes),
    )


def _require_z_up(up_in_world: FloatArray, config: WorldConfig) -> None:
    lean_deg = float(np.rad2deg(np.arccos(np.clip(up_in_world[2], -1, 1))))
    if lean_deg > config.max_lean_deg:
        raise InputError(
            f"The frame of the known cameras (--cameras) has no z axis that points up: by cameras "
            f"and walls it leans by {lean_deg:.0f} degrees. Turn the model so that z points up, or "
            "let the photos be reconstructed."
        )


def _ground_z_m(
    centres: FloatArray, points: FloatArray, config: WorldConfig
) -> tuple[float, list[str]]:
    """World z of the ground, and what to know about it: a hand's height below the cameras.

    Where many points lie far below that, the cameras were in the air or on an upper floor.
    """
    by_hand_m = float(np.median(centres[:, 2])) - config.camera_height_m
    if not len(points):
        return by_hand_m, []
    lowest_m = float(np.quantile(points[:, 2], _LOW_SHARE))
    if lowest_m > by_hand_m - config.min_high_m:
        return by_hand_m, []
    return lowest_m, [
        f"Points lie {by_hand_m + config.camera_height_m - lowest_m:.1f} m below the cameras, so "
        "the ground is taken from the points, not from the height at which cameras are held."
    ]


def _tilted(vertical: Vertical) -> list[str]:
    if not vertical.tilted:
        return []
    more = len(vertical.tilted) - _LISTED
    listed = ", ".join(vertical.tilted[:_LISTED]) + (f" and {more} more" if more > 0 else "")
    return [f"Photos that were not held level tell nothing of the vertical: {listed}."]
