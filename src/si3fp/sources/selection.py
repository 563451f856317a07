"""Step S.1: the origin of a run, and which panoramas it uses. Pure functions on records.

Nothing is dropped silently: every filter says in a note what it left out, or why it kept all.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from si3fp.config import ClusterConfig, CollectConfig
from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin, world_from_geodetic
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Footprint
from si3fp.sources.footprints import FootprintRecord
from si3fp.sources.local import PanoramaRecord

CAMERA_HEIGHT_M = ClusterConfig().camera_height_m
"""Typical height of a mapping vehicle's camera: the ground where no footprint gives it."""


@dataclass(frozen=True, slots=True)
class Selection:
    """The panoramas that a run uses.

    Attributes
    ----------
    records
        The origin view first, then its neighbours in the order in which the links reach them, then
        those that no link reaches.
    by_building
        Ids of the panoramas to use for every building (in range, of the chosen date); without
        footprints empty.
    notes
        What was left out or kept against a rule, in words, for the report.
    """

    records: tuple[PanoramaRecord, ...]
    by_building: Mapping[str, frozenset[str]]
    notes: tuple[str, ...]


def run_origin(
    footprints: Sequence[FootprintRecord], panoramas: Sequence[PanoramaRecord]
) -> GeoOrigin:
    """Centroid of the footprints (else of the cameras) to 1e-5 degrees, at the lowest ground.

    Where no footprint gives its ground, it is taken 2.5 m below the lowest camera.
    """
    if footprints:
        centre = shapely.MultiPolygon([shapely.Polygon(f.outline_deg) for f in footprints]).centroid
        lon_deg, lat_deg = centre.x, centre.y
    elif panoramas:
        lon_deg, lat_deg = np.mean([(p.lon_deg, p.lat_deg) for p in panoramas], axis=0)
    else:
        raise InputError("A run needs at least one panorama or footprint to place its origin.")
    grounds = [f.ground_m for f in footprints if f.ground_m is not None]
    cameras = [p.height_m - CAMERA_HEIGHT_M for p in panoramas]
    lowest = min(grounds or cameras or [0.0])
    return GeoOrigin(round(float(lat_deg), 5), round(float(lon_deg), 5), round(lowest, 3))


def within_radius(
    records: Sequence[PanoramaRecord], lat_deg: float, lon_deg: float, radius_m: float
) -> list[PanoramaRecord]:
    """The panoramas whose horizontal distance to a place is at most ``radius_m``, in order."""
    centre = GeoOrigin(lat_deg, lon_deg, 0.0)
    distances = np.linalg.norm(_positions_in_world(records, centre)[:, :2], axis=1)
    return [record for record, d in zip(records, distances, strict=True) if d <= radius_m]


def origin_view(records: Sequence[PanoramaRecord], distances_m: Sequence[float]) -> PanoramaRecord:
    """The most recently captured panorama; of several the nearest, then the first by id."""
    pairs = zip(records, distances_m, strict=True)
    latest = max(record.captured for record in records)
    return min((d, r.id, r) for r, d in pairs if r.captured == latest)[2]


def traverse_links(records: Sequence[PanoramaRecord], start: PanoramaRecord) -> list[str]:
    """Ids reached from ``start`` by links in either direction, breadth first, ``start`` first."""
    known = {record.id for record in records}
    neighbours: dict[str, list[str]] = {identifier: [] for identifier in known}
    for record in records:
        for link in record.links:
            if link in known:
                neighbours[record.id].append(link)
                neighbours[link].append(record.id)
    reached, queue = {start.id: None}, deque([start.id])
    while queue:
        for neighbour in neighbours[queue.popleft()]:
            if neighbour not in reached:
                reached[neighbour] = None
                queue.append(neighbour)
    return list(reached)


def most_recent_date(
    records: Sequence[PanoramaRecord], min_panoramas: int
) -> tuple[str, list[PanoramaRecord]]:
    """The most recent date on which at least ``min_panoramas`` were captured, and those.

    The date is "" and the list holds all panoramas where no date has enough.
    """
    for date in sorted({record.captured for record in records} - {""}, reverse=True):
        chosen = [record for record in records if record.captured == date]
        if len(chosen) >= min_panoramas:
            return date, chosen
    return "", list(records)


def select_panoramas(
    records: Sequence[PanoramaRecord],
    footprints: Sequence[Footprint],
    origin: GeoOrigin,
    config: CollectConfig,
) -> Selection:
    """The panoramas of a run by distance, capture date and links.

    Parameters
    ----------
    records
        All panoramas that were read.
    footprints
        Buildings in the world frame of ``origin``. With them, panoramas within ``max_distance_m``
        of a building are used, and for every building those of the most recent date that leaves
        ``min_panoramas``, else all. Without them all panoramas count as near one building.
    origin
        Origin of the world frame.
    config
        ``max_distance_m`` and ``min_panoramas``.

    Raises
    ------
    InputError
        If there are no panoramas, or none lies near any building.
    """
    if not records:
        raise InputError("There are zero panoramas to choose from.")
    positions = _positions_in_world(records, origin)[:, :2]
    distances = _distances_to(footprints, positions)
    near: NDArray[np.bool_] = distances <= config.max_distance_m
    if not near.any():
        raise InputError(
            f"No panorama lies within {config.max_distance_m:g} m of a footprint, the nearest is "
            f"{distances.min():,.0f} m away. Check that both files show the same place, and that "
            "coordinates are [longitude, latitude]."
        )
    notes = []
    far = [r.id for r, is_near in zip(records, near.max(axis=1), strict=True) if not is_near]
    if far:
        notes.append(
            f"{len(far)} of {len(records)} panoramas lie more than {config.max_distance_m:g} m "
            f"from every footprint and are not used: {_listed(far)}."
        )
    names = [footprint.id for footprint in footprints] or ["the whole set"]
    chosen: dict[str, frozenset[str]] = {}
    for name, column in zip(names, near.T, strict=True):
        candidates = [record for record, is_near in zip(records, column, strict=True) if is_near]
        date, kept = most_recent_date(candidates, config.min_panoramas)
        chosen[name] = frozenset(record.id for record in kept)
        notes += _date_notes(name, date, candidates, kept, config)
    used = frozenset[str]().union(*chosen.values())
    ordered, link_notes = _by_links(records, distances.min(axis=1), used)
    return Selection(ordered, chosen if footprints else {}, (*notes, *link_notes))


def _by_links(
    records: Sequence[PanoramaRecord], distances_m: FloatArray, used: frozenset[str]
) -> tuple[tuple[PanoramaRecord, ...], list[str]]:
    """The used panoramas in the order of the links, and a note on those that no link reaches."""
    pairs = [(r, float(d)) for r, d in zip(records, distances_m, strict=True) if r.id in used]
    start = origin_view(*zip(*pairs, strict=True))
    # Links may lead through panoramas that are not used themselves.
    rank = {identifier: n for n, identifier in enumerate(traverse_links(records, start))}
    ordered = sorted((r for r, _ in pairs), key=lambda record: rank.get(record.id, len(rank)))
    unreached = [record.id for record in ordered if record.id not in rank]
    if not unreached or not any(record.links for record in records):
        return tuple(ordered), []
    return tuple(ordered), [
        f"{len(unreached)} of {len(ordered)} panoramas are not linked to the origin view "
        f"{start.id}; they are used all the same: {_listed(unreached)}."
    ]


def _date_notes(
    name: str,
    date: str,
    candidates: Sequence[PanoramaRecord],
    kept: Sequence[PanoramaRecord],
    config: CollectConfig,
) -> list[str]:
    if not candidates:
        return [f"{name}: no panorama lies within {config.max_distance_m:g} m."]
    if len(kept) < len(candidates):
        return [
            f"{name}: the {len(kept)} of {len(candidates)} panoramas captured {date} are used, the "
            f"most recent date with at least {config.min_panoramas}."
        ]
    dates = sorted({record.captured or "unknown" for record in candidates})
    if not date and len(dates) > 1:
        return [
            f"{name}: no single capture date has {config.min_panoramas} panoramas; all "
            f"{len(candidates)} are used ({', '.join(dates)})."
        ]
    return []


def _distances_to(footprints: Sequence[Footprint], positions: FloatArray) -> FloatArray:
    """(N, B) metres from the panoramas to the buildings; one column of zeros without footprints."""
    if not footprints:
        return np.zeros((len(positions), 1))
    outlines = [shapely.Polygon(footprint.outline_in_world) for footprint in footprints]
    cameras = np.asarray(shapely.points(positions), dtype=object)
    return np.stack([shapely.distance(cameras, outline) for outline in outlines], axis=1)


def _positions_in_world(records: Sequence[PanoramaRecord], origin: GeoOrigin) -> FloatArray:
    """Optical centres (N, 3) in metres."""
    geodetic = [[record.lat_deg, record.lon_deg, record.height_m] for record in records]
    return world_from_geodetic(np.array(geodetic, np.float64).reshape(-1, 3), origin)


def _listed(ids: Sequence[str], limit: int = 10) -> str:
    shown = ", ".join(ids[:limit])
    return shown if len(ids) <= limit else f"{shown} and {len(ids) - limit} more"
