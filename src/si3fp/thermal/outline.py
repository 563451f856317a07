"""Footprint edges as walls: degenerate edges removed, party walls found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from shapely import Polygon
from shapely.validation import explain_validity

from si3fp.errors import ThermalModelError
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Building

MIN_AREA_M2 = 1.0  # decision: a smaller footprint is not a building
PARTY_DISTANCE_M = 0.3  # decision: two footprints of one wall may gape or overlap by this
PARTY_SHARE = 0.9  # decision: of length and height that the neighbour must cover


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """A footprint edge; the outside lies on its right.

    Attributes
    ----------
    index
        Index of the edge in the building's footprint, as in facade ids.
    start, end
        (2,) world x, y in metres.
    """

    index: int
    start: FloatArray
    end: FloatArray

    @property
    def length_m(self) -> float:
        """Length."""
        return float(np.linalg.norm(self.end - self.start))

    def world_from_wall(self, base_z_m: float) -> Rigid3:
        """Frame of the wall on this edge: x along it, y up, z outwards, origin at its start."""
        along = (self.end - self.start) / self.length_m
        rotation = np.array(
            [[along[0], 0.0, along[1]], [along[1], 0.0, -along[0]], [0.0, 1.0, 0.0]]
        )
        return Rigid3(rotation, np.array([*self.start, base_z_m]))


def edges_of(building: Building, tolerance_m: float) -> tuple[list[Edge], list[str]]:
    """Edges of a building's footprint without those shorter than the tolerance, and notes.

    Collinear corners stay: a map has them where a neighbour begins, and each side has its facade.

    Raises
    ------
    ThermalModelError
        If less than a polygon remains, or it crosses itself.
    """
    corners = np.asarray(building.footprint_in_world, dtype=np.float64)
    kept: list[tuple[int, FloatArray]] = []
    for index, corner in enumerate(corners):
        if kept and np.linalg.norm(corner - kept[-1][1]) < tolerance_m:
            kept[-1] = (index, kept[-1][1])  # the edge between them vanishes
        else:
            kept.append((index, corner))
    while len(kept) > 1 and np.linalg.norm(kept[-1][1] - kept[0][1]) < tolerance_m:
        kept.pop()
    where = f"Building {building.id}: its footprint"
    if len(kept) < 3:
        raise ThermalModelError(
            f"{where} has only {len(kept)} corners farther apart than {tolerance_m} m."
        )
    polygon = Polygon([corner for _, corner in kept])
    if not polygon.is_valid:
        raise ThermalModelError(
            f"{where} is not a simple polygon: {explain_validity(polygon)}. Repair the map."
        )
    if polygon.area < MIN_AREA_M2 or not polygon.exterior.is_ccw:
        raise ThermalModelError(
            f"{where} must run counter-clockwise around at least {MIN_AREA_M2} m2, "
            f"got {polygon.area:.2f} m2."
        )
    edges = [
        Edge(index, corner, kept[(k + 1) % len(kept)][1]) for k, (index, corner) in enumerate(kept)
    ]
    gone = sorted(set(range(len(corners))) - {edge.index for edge in edges})
    notes = [
        f"{building.id}-{index}: no wall, the edge is shorter than {tolerance_m} m."
        for index in gone
    ]
    return edges, notes


def party_share(
    edge: Edge, foot_z_m: float, head_z_m: float, neighbours: Sequence[Building]
) -> float:
    """Share (0 to 1) of an edge's length along which neighbours stand within `PARTY_DISTANCE_M`.

    Only neighbours that reach over `PARTY_SHARE` of the height between the two levels count.
    """
    along = (edge.end - edge.start) / edge.length_m
    outward = np.array([along[1], -along[0]])
    spans: list[tuple[float, float]] = []
    for neighbour in neighbours:
        top_z_m = neighbour.base_z_m + neighbour.height_m
        common_m = min(top_z_m, head_z_m) - max(neighbour.base_z_m, foot_z_m)
        if common_m < PARTY_SHARE * (head_z_m - foot_z_m):
            continue
        corners = np.asarray(neighbour.footprint_in_world, dtype=np.float64) - edge.start
        for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            span = _span_beside(start @ along, start @ outward, end @ along, end @ outward)
            if span is not None:
                spans.append((max(span[0], 0.0), min(span[1], edge.length_m)))
    covered_m, reached_m = 0.0, 0.0
    for first, last in sorted(span for span in spans if span[1] > span[0]):
        covered_m += max(0.0, last - max(first, reached_m))
        reached_m = max(reached_m, last)
    return covered_m / edge.length_m


def _span_beside(
    start_x: float, start_y: float, end_x: float, end_y: float
) -> tuple[float, float] | None:
    """Range of x where a segment runs backwards within `PARTY_DISTANCE_M` of the x axis, or None.

    A neighbour's edge that faces this one runs the other way, as both are counter-clockwise.
    """
    if end_x >= start_x or abs(end_y - start_y) > 0.2 * (start_x - end_x):
        return None
    t = np.array([0.0, 1.0])
    rise = end_y - start_y
    if abs(rise) > 1e-12:
        at = sorted(((-PARTY_DISTANCE_M - start_y) / rise, (PARTY_DISTANCE_M - start_y) / rise))
        t = np.clip(at, 0.0, 1.0)
    elif abs(start_y) > PARTY_DISTANCE_M:
        return None
    x = start_x + t * (end_x - start_x)
    return float(x[1]), float(x[0])
