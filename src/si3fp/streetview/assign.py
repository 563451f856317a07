"""Planes to footprint edges, or to one another where there are no footprints."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from sklearn.cluster import AgglomerativeClustering

from si3fp.config import ClusterConfig
from si3fp.geometry.rigid import FloatArray
from si3fp.streetview.wall_fit import Line, fit_wall
from si3fp.streetview.wall_planes import WallPlane

BIN_M = 0.25
"""Step in which the lateral extent of walls without footprint is counted."""


@dataclass(frozen=True, slots=True)
class Unassigned:
    """A wall plane that became part of no facade.

    Attributes
    ----------
    panorama_id, plane_index
        The plane.
    nearest
        Facade id of the nearest edge, of those that face the same way if there are any; empty
        without footprints.
    distance_m
        Median distance of the plane's supporting points from that edge; NaN without.
    angle_deg
        Angle between the outward normals; NaN without.
    reason
        In words.
    """

    panorama_id: str
    plane_index: int
    nearest: str
    distance_m: float
    angle_deg: float
    reason: str


def assign_to_edges(
    planes: Sequence[WallPlane], edges: Mapping[str, Line], config: ClusterConfig
) -> tuple[dict[str, list[WallPlane]], list[Unassigned]]:
    """The planes of each edge, cut down to their support on it, and the planes that fit none.

    An edge takes a supporting point if the plane's outward normal agrees with the edge's within
    `config.angle_deg`, the point lies beside the edge (between its ends) and within
    `config.offset_m` of its line; of several such edges the nearest. An edge takes a plane with
    at least `config.min_pixels` pixels on it.
    """
    members: dict[str, list[WallPlane]] = {facade_id: [] for facade_id in edges}
    unassigned: list[Unassigned] = []
    ids, lines = list(edges), list(edges.values())
    outward = np.array([line.outward for line in lines])
    for plane in planes:
        if plane.pixels < config.min_pixels:
            unassigned.append(_too_small(plane, config))
            continue
        angles = np.rad2deg(np.arccos(np.clip(outward @ plane.outward, -1.0, 1.0)))
        facing = np.flatnonzero(angles <= config.angle_deg)
        gaps = np.full((len(plane.support_in_world), len(lines)), np.inf)
        for edge in facing:
            along, front = lines[edge].coordinates(plane.support_in_world).T
            beside = (along >= 0) & (along <= lines[edge].length_m)
            fits = beside & (np.abs(front) <= config.offset_m)
            gaps[fits, edge] = np.abs(front[fits])
        nearest = np.where(np.isfinite(gaps).any(axis=1), np.argmin(gaps, axis=1), -1)
        taken = False
        for edge in facing:
            part = _part(plane, nearest == edge)
            if part.pixels >= config.min_pixels:
                members[ids[edge]].append(part)
                taken = True
        if not taken:
            unassigned.append(_unassigned(plane, ids, lines, angles, config))
    return members, unassigned


def _part(plane: WallPlane, mask: NDArray[np.bool_]) -> WallPlane:
    return replace(
        plane,
        pixels=round(plane.pixels * float(mask.mean())),
        support_in_world=plane.support_in_world[mask],
    )


def _too_small(plane: WallPlane, config: ClusterConfig) -> Unassigned:
    reason = f"{plane.pixels} pixels, fewer than {config.min_pixels}"
    return Unassigned(plane.panorama_id, plane.plane_index, "", np.nan, np.nan, reason)


def _unassigned(
    plane: WallPlane,
    ids: Sequence[str],
    lines: Sequence[Line],
    angles: FloatArray,
    config: ClusterConfig,
) -> Unassigned:
    facing = np.flatnonzero(angles <= config.angle_deg)
    distances = []
    for line in [lines[int(edge)] for edge in facing] or lines:
        along, front = line.coordinates(plane.support_in_world).T
        beside = np.maximum(np.maximum(-along, along - line.length_m), 0.0)
        distances.append(float(np.median(np.hypot(front, beside))))
    best = int(np.argmin(distances))
    edge = int(facing[best]) if len(facing) else best
    if not len(facing):
        reason = f"no edge faces this way within {config.angle_deg:g} degrees"
    else:
        reason = (
            f"the nearest edge facing this way is {distances[best]:.1f} m away, "
            f"the limit is {config.offset_m:g} m"
            if distances[best] > config.offset_m
            else f"fewer than {config.min_pixels} of its pixels lie on the edge"
        )
    return Unassigned(
        plane.panorama_id,
        plane.plane_index,
        ids[edge],
        distances[best],
        float(angles[edge]),
        reason,
    )


def group_without_footprints(
    planes: Sequence[WallPlane], config: ClusterConfig
) -> tuple[dict[str, Line], dict[str, list[WallPlane]], list[Unassigned]]:
    """Walls ``wall-<n>`` ordered by bearing, their planes, and the planes too small for a wall.

    The distance of two planes is the larger of their angle and of their offset, each over its
    tolerance, the offset taken between their supports and not at the world's origin; average
    linkage joins planes below 1. Where no two panoramas (or, of a single one, none) see support
    for more than `config.gap_m`, a wall ends and another begins.
    """
    large = [plane for plane in planes if plane.pixels >= config.min_pixels]
    small = [_too_small(plane, config) for plane in planes if plane.pixels < config.min_pixels]
    found: list[tuple[Line, list[WallPlane]]] = []
    labels = _labels(large, config)
    for label in sorted(set(labels)):
        group = [plane for plane, of in zip(large, labels, strict=True) if of == label]
        for line, parts in _split_at_gaps(group, config):
            if line.length_m >= config.min_width_m:
                found.append((line, parts))
                continue
            reason = f"its wall of {line.length_m:.2f} m is shorter than {config.min_width_m:g} m"
            small += [
                Unassigned(part.panorama_id, part.plane_index, "", np.nan, np.nan, reason)
                for part in parts
            ]

    def bearing_then_place(item: tuple[Line, list[WallPlane]]) -> tuple[int, float]:
        east, north = item[0].outward
        bearing = float(np.rad2deg(np.arctan2(east, north)) % 360)
        return (round(bearing) % 360, float(item[0].left_in_world @ item[0].along))

    found.sort(key=bearing_then_place)
    lines = {f"wall-{n}": line for n, (line, _) in enumerate(found)}
    members = {f"wall-{n}": group for n, (_, group) in enumerate(found)}
    return lines, members, small


def _labels(planes: Sequence[WallPlane], config: ClusterConfig) -> list[int]:
    if len(planes) < 2:
        return [0] * len(planes)
    outward = np.array([plane.outward for plane in planes])
    feet = np.array([plane.foot_in_world for plane in planes])
    middles = np.array([np.median(plane.support_in_world[:, :2], axis=0) for plane in planes])
    angle = np.rad2deg(np.arccos(np.clip(outward @ outward.T, -1.0, 1.0)))
    between = (middles[:, None] + middles[None]) / 2
    gap = np.einsum("ijk,ik->ij", feet[:, None] - between, outward)
    offset = np.abs(gap - gap.T)
    distance = np.maximum(angle / config.cluster_angle_deg, offset / config.cluster_offset_m)
    np.fill_diagonal(distance, 0.0)
    model = AgglomerativeClustering(
        n_clusters=None, metric="precomputed", linkage="average", distance_threshold=1.0
    )
    return [int(label) for label in model.fit_predict(distance)]


def _split_at_gaps(
    group: Sequence[WallPlane], config: ClusterConfig
) -> list[tuple[Line, list[WallPlane]]]:
    """Walls of one group of coplanar planes: where enough panoramas have support."""
    heaviest = max(group, key=lambda plane: plane.pixels)
    along = np.array([-heaviest.outward[1], heaviest.outward[0]])
    start = Line(heaviest.foot_in_world, heaviest.foot_in_world + along)
    positions = [start.coordinates(plane.support_in_world)[:, 0] for plane in group]
    lowest = min(float(position.min()) for position in positions)
    bins = [np.unique(((position - lowest) / BIN_M).astype(np.int_)) for position in positions]
    count = max(int(b.max()) for b in bins) + 1
    seen: dict[str, NDArray[np.bool_]] = {}
    for plane, used in zip(group, bins, strict=True):
        row = seen.setdefault(plane.panorama_id, np.zeros(count, dtype=np.bool_))
        row[used[0] : used[-1] + 1] |= _closed(used, used[0], used[-1], config.gap_m)
    occupied = np.flatnonzero(np.sum(list(seen.values()), axis=0) >= min(2, len(seen)))
    if not len(occupied):
        occupied = np.flatnonzero(np.sum(list(seen.values()), axis=0) >= 1)

    walls = []
    breaks = np.flatnonzero(np.diff(occupied) * BIN_M > config.gap_m + BIN_M)
    for run in np.split(occupied, breaks + 1):
        left, right = lowest + run[0] * BIN_M, lowest + (run[-1] + 1) * BIN_M
        line = Line(
            start.left_in_world + left * start.along, start.left_in_world + right * start.along
        )
        parts = [
            _part(plane, (position >= left) & (position <= right))
            for plane, position in zip(group, positions, strict=True)
        ]
        parts = [part for part in parts if part.pixels >= config.min_pixels]
        if parts:
            walls.append((fit_wall(parts, line, False, config)[0], parts))
    return walls


def _closed(
    used: NDArray[np.int_], first: np.int_, last: np.int_, gap_m: float
) -> NDArray[np.bool_]:
    """Bins first..last, True where used or in a gap of at most gap_m between used ones."""
    row = np.zeros(int(last - first) + 1, dtype=np.bool_)
    for left, right in itertools.pairwise(used):
        if (right - left - 1) * BIN_M <= gap_m:
            row[left - first : right - first] = True
    row[used - first] = True
    return row
