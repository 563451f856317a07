"""S.2: which planes of which panoramas are one facade (paper, Algorithm 2, and our default)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from sklearn.cluster import AgglomerativeClustering

from si3fp.config import ClusterConfig
from si3fp.errors import ReconstructionError
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Footprint, Missing, Panorama
from si3fp.streetview.assign import Unassigned, assign_to_edges, group_without_footprints
from si3fp.streetview.visibility import Sight, footprint_edges, goes_on, visible_walls
from si3fp.streetview.wall_fit import Line, WallFit, fit_wall
from si3fp.streetview.wall_planes import (
    Ground,
    WallPlane,
    ground_of,
    planes_in_world,
    wall_indices,
    wall_planes,
)


@dataclass(frozen=True, slots=True)
class PaperClustering:
    """Algorithm 2 as the paper has it: reachable and tested, but not the default.

    Its threshold of 1e-5 asks one wall's planes to agree within 1 mm or 0.26 degrees, and its
    offsets are distances from the world's origin; measured poses give neither
    (docs/decisions/0002-plane-clustering.md).
    """

    config: ClusterConfig

    def clusters(self, panoramas: Sequence[Panorama]) -> list[list[tuple[str, int]]]:
        """Groups of (panorama id, plane index) of the same facade, in the order of the input.

        Horizontal and zero planes are dropped. D(i, j) = (1 - ni . nj) + 0.01 |di - dj| (paper,
        equation 1), agglomerative clustering with average linkage and a distance threshold.
        """
        labels: list[tuple[str, int]] = []
        rows: list[FloatArray] = []
        for panorama in panoramas:
            planes = planes_in_world(panorama)
            for index in wall_indices(panorama, self.config.horizontal_normal):
                labels.append((panorama.id, int(index)))
                rows.append(np.append(planes.normals[index], planes.offsets_m[index]))
        if not rows:
            return []
        table = np.array(rows)
        normals, offsets = table[:, :3], table[:, 3]
        distance = (1 - normals @ normals.T) + self.config.paper_offset_weight * np.abs(
            offsets[:, None] - offsets
        )
        np.fill_diagonal(distance, 0.0)
        return _grouped(labels, _average_linkage(distance, self.config.paper_threshold))


@dataclass(frozen=True, slots=True, eq=False)
class Wall:
    """A facade to be looked at: where it is, who sees it, and how well that is known.

    Attributes
    ----------
    facade_id
        ``<building id>-<edge index>``, without footprint ``wall-<n>`` by bearing.
    building_id, edge_index
        Its footprint edge; None without footprints.
    world_from_facade
        Frame at the lower left corner seen from outside, on the ground: x right, y up, z out.
    width_m
        Length of the edge on the wall, without footprint the extent of the supports.
    height_m
        Prior of the height of the eaves above the ground.
    height_is_assumed
        Whether nothing told that height.
    members
        (panorama id, plane index) of its planes.
    panorama_ids
        Panoramas that see it: by a plane of theirs, without plane map by sight in plan.
    fit
        How well the planes agree with one another and with the edge.
    notes
        In words: where plane, ground and height come from.
    goes_on
        Whether another wall of the map continues it beyond its left and right end.
    """

    facade_id: str
    building_id: str | None
    edge_index: int | None
    world_from_facade: Rigid3
    width_m: float
    height_m: float
    members: tuple[tuple[str, int], ...]
    panorama_ids: tuple[str, ...]
    fit: WallFit
    notes: tuple[str, ...] = ()
    height_is_assumed: bool = False
    goes_on: tuple[bool, bool] = (False, False)


@dataclass(frozen=True, slots=True)
class WallClusters:
    """Walls that a panorama sees, planes that fit no footprint edge, edges that no camera sees."""

    walls: tuple[Wall, ...]
    unassigned: tuple[Unassigned, ...]
    missing: tuple[Missing, ...]


def cluster_walls(
    panoramas: Sequence[Panorama],
    footprints: Sequence[Footprint],
    config: ClusterConfig,
) -> WallClusters:
    """The walls that the panoramas see, one per footprint edge or, without footprints, per plane.

    Planes of all panoramas come into one world frame. With footprints, each supporting point of
    a plane goes to the nearest edge that faces the same way within `config.angle_deg` and lies
    within `config.offset_m`, so a plane along two buildings is split where they meet; a plane
    that fits no edge is reported, not made a wall. Without footprints planes are grouped by
    bearing and offset near their supports and split at gaps. Decision 4 and
    docs/decisions/0002-plane-clustering.md.

    Parameters
    ----------
    panoramas
        With or without plane maps; those without see a wall by sight in plan.
    footprints
        Footprints in the same world; may be empty.

    Raises
    ------
    ReconstructionError
        If there are neither plane maps nor footprints.
    """
    if not footprints and not any(panorama.plane_index is not None for panorama in panoramas):
        raise ReconstructionError(
            f"Found no walls: none of the {len(panoramas)} panoramas has a plane map and there "
            "are no footprints. Give footprints or panoramas with plane maps."
        )
    planes = wall_planes(panoramas, config)
    if footprints:
        edges = footprint_edges(footprints)
        members, unassigned = assign_to_edges(planes, edges, config)
    else:
        edges, members, unassigned = group_without_footprints(planes, config)

    sights = {
        panorama.id: visible_walls(panorama.centre_in_world, edges, config)
        for panorama in panoramas
        if panorama.plane_index is None
    }
    owners = {
        f"{footprint.id}-{index}": (footprint, index)
        for footprint in footprints
        for index in range(len(footprint.outline_in_world))
    }
    ground = ground_of(panoramas, config)
    order = [panorama.id for panorama in panoramas]

    walls: list[Wall] = []
    missing: list[Missing] = []
    for facade_id, edge in edges.items():
        seen_by = {plane.panorama_id for plane in members[facade_id]}
        seen_by |= {pano for pano, sight in sights.items() if sight[facade_id] == "seen"}
        if edge.length_m < config.min_width_m or not seen_by:
            reason = _why_missing(edge, facade_id, sights, len(panoramas), config)
            missing.append(Missing(facade_id, "coverage", reason))
            continue
        footprint, index = owners.get(facade_id, (None, None))
        wall = _wall(facade_id, edge, members[facade_id], footprint, ground, config)
        walls.append(
            replace(
                wall,
                edge_index=index,
                panorama_ids=tuple(pano for pano in order if pano in seen_by),
                goes_on=goes_on(facade_id, edges) if footprints else (False, False),
            )
        )
    return WallClusters(tuple(walls), tuple(unassigned), tuple(missing))


def _wall(
    facade_id: str,
    edge: Line,
    members: Sequence[WallPlane],
    footprint: Footprint | None,
    ground: Ground,
    config: ClusterConfig,
) -> Wall:
    line, fit = fit_wall(members, edge, footprint is not None, config)
    if fit.source == "planes":
        notes = [f"plane from {fit.panoramas} panoramas that agree"]
    else:
        notes = [f"plane from the footprint: only {fit.panoramas} panoramas agree on a plane"]

    if footprint is not None and footprint.ground_m is not None:
        ground_m = footprint.ground_m
        notes.append("ground from the footprint")
    else:
        middle = (line.left_in_world + line.right_in_world) / 2
        ground_m, note = ground.height_m(middle)
        notes.append(note)

    tops = [
        float(np.percentile(m.support_in_world[:, 2], 98)) - ground_m
        for m in members
        if m.pixels >= config.min_pixels
    ]
    if footprint is not None and footprint.height_m is not None:
        height_m, is_assumed = footprint.height_m, False
        notes.append("height from the footprint")
    elif tops and np.median(tops) > 2.0:
        height_m, is_assumed = float(np.median(tops)), False
        notes.append("height from the extent of the planes")
    else:
        height_m, is_assumed = config.default_height_m, True
        notes.append("neither map nor planes tell the height: the eaves are sought in the images")

    along, outward = np.append(line.along, 0.0), np.append(line.outward, 0.0)
    rotation = np.stack([along, [0.0, 0.0, 1.0], outward], axis=-1)
    return Wall(
        facade_id,
        footprint.id if footprint is not None else None,
        None,
        Rigid3(rotation, np.append(line.left_in_world, ground_m)),
        line.length_m,
        height_m,
        tuple((member.panorama_id, member.plane_index) for member in members),
        (),
        fit,
        tuple(notes),
        is_assumed,
    )


def _why_missing(
    edge: Line,
    facade_id: str,
    sights: Mapping[str, Mapping[str, Sight]],
    panoramas: int,
    config: ClusterConfig,
) -> str:
    if edge.length_m < config.min_width_m:
        return f"the edge of {edge.length_m:.2f} m is shorter than {config.min_width_m} m"
    words = {
        "behind": "stand behind it",
        "far": f"are farther than {config.max_distance_m:g} m",
        "oblique": f"see it at more than {config.max_obliqueness_deg:g} degrees",
        "hidden": "are hidden by other walls",
    }
    with_map = panoramas - len(sights)
    counts = [(sum(s[facade_id] == key for s in sights.values()), words[key]) for key in words]
    counts.append((with_map, "have no plane on it"))
    parts = [f"{count} {what}" for count, what in counts if count]
    return f"no camera sees it: of {panoramas} panoramas {', '.join(parts)}"


def _average_linkage(distance: FloatArray, threshold: float) -> list[int]:
    if len(distance) == 1:
        return [0]
    model = AgglomerativeClustering(
        n_clusters=None, metric="precomputed", linkage="average", distance_threshold=threshold
    )
    return [int(label) for label in model.fit_predict(distance)]


def _grouped(
    items: Sequence[tuple[str, int]], labels: Sequence[int]
) -> list[list[tuple[str, int]]]:
    groups: dict[int, list[tuple[str, int]]] = {}
    for item, label in zip(items, labels, strict=True):
        groups.setdefault(label, []).append(item)
    return list(groups.values())
