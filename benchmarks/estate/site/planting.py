"""Where trees and hedges grow: along pavements, on lawns and in front of walls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from benchmarks.estate.drawing import millimetres, rng_of
from benchmarks.estate.plan import Building, FloatArray, Hedge, Street, Tree
from benchmarks.estate.site.layout import doors_of
from numpy.typing import NDArray
from shapely import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

Line = tuple[tuple[float, float], ...]

SAMPLE_M = 3.0
"""Distance of the points on walls whose sight is kept."""
IN_SIGHT = 0.5
"""Share of the places looking at a point of a wall that crowns never take away."""
SIGHT_M = 40.0
STEEPEST_DEG = 60.0
SPACING_M = 4.0


class Sight:
    """Which lines of sight from places to points of walls are still free."""

    def __init__(self, buildings: Sequence[Building], places: FloatArray) -> None:
        points, outward = _wall_samples(buildings)
        offsets = places[None] - points[:, None]
        distance = np.linalg.norm(offsets, axis=2)
        ahead = np.einsum("spc,sc->sp", offsets, outward) / np.maximum(distance, 1e-9)
        wanted = (distance < SIGHT_M) & (ahead > np.cos(np.deg2rad(STEEPEST_DEG)))
        outlines = shapely.union_all([Polygon(b.outline).buffer(-0.05) for b in buildings])
        rows, columns = np.nonzero(wanted)
        lines = shapely.linestrings(
            np.stack([points[rows] + outward[rows] * 0.1, places[columns]], 1)
        )
        free = ~shapely.intersects(lines, outlines)
        self._start, self._end = points[rows[free]], places[columns[free]]
        self._sample = rows[free]
        self._hidden = np.zeros(int(free.sum()), bool)
        self._views = np.bincount(self._sample, minlength=len(points))

    def allows(self, place: FloatArray, radius_m: float) -> bool:
        """Whether a crown may stand there; if it may, it is taken note of."""
        hidden = self._hidden | self._crossing(place, radius_m)
        share = np.bincount(self._sample, ~hidden, len(self._views))
        if np.any((self._views > 0) & (share < IN_SIGHT * self._views)):
            return False
        self._hidden = hidden
        return True

    def _crossing(self, place: FloatArray, radius_m: float) -> NDArray[np.bool_]:
        along = self._end - self._start
        share = np.sum((place - self._start) * along, axis=1) / np.sum(along**2, axis=1)
        nearest = self._start + np.clip(share, 0, 1)[:, None] * along
        return np.linalg.norm(nearest - place, axis=1) < radius_m


def planted(
    buildings: Sequence[Building],
    neighbours: Sequence[Building],
    streets: Sequence[Street],
    panorama_lines: Sequence[Line],
    rings: Sequence[Line],
    reserved: BaseGeometry,
    pavement: BaseGeometry,
    density: tuple[float, float],
    seed: int,
) -> tuple[tuple[Tree, ...], tuple[Hedge, ...]]:
    """Trees and hedges; ``reserved`` stays free of trunks, shrubs and hedges.

    ``density`` is that of trees and of hedges. ``pavement`` is free of hedges and of trees of the
    lawn; trees of the street stand at its outer edge.
    """
    trees, hedges = density
    walls = shapely.union_all([Polygon(b.outline) for b in (*buildings, *neighbours)])
    clipped = _hedges(buildings, reserved.union(pavement), hedges, seed)
    for hedge in clipped:
        reserved = reserved.union(LineString(hedge.line).buffer(hedge.width_m / 2 + 0.6))
    places = np.concatenate(
        [
            shapely.get_coordinates(shapely.segmentize(LineString(line), 4.0))
            for line in (*panorama_lines, *rings)
        ]
    )
    sight = Sight(buildings, places)
    stems: list[FloatArray] = []
    grown = []

    def settle(tree: Tree) -> None:
        place = np.array(tree.place)
        point = Point(tree.place)
        room = tree.crown_m / 2 if tree.kind == "shrub" else 0.35
        near = 1.3 if tree.kind == "shrub" else SPACING_M
        if any(np.hypot(*(stem - place)) < near for stem in stems):
            return
        if reserved.distance(point) < room or walls.distance(point) < tree.crown_m * 0.42 + 0.4:
            return
        if tree.kind != "shrub" and not sight.allows(place, tree.crown_m * 0.45):
            return
        stems.append(place)
        grown.append(tree)

    for tree in _street_trees(streets, trees, seed):
        settle(tree)
    for tree in _lawn_trees(buildings, pavement, trees, seed):
        settle(tree)
    return tuple(grown), clipped


def _street_trees(streets: Sequence[Street], density: float, seed: int) -> list[Tree]:
    """One kind per street, evenly spaced behind the pavements, with gaps."""
    found = []
    for number, street in enumerate(streets):
        rng = rng_of(seed, "street trees", number)
        line = LineString(street.line)
        birch = rng.uniform() < 0.35
        pitch = rng.uniform(11, 15)
        height = rng.uniform(7.5, 10.5)
        for side in (-1, 1):
            offset = street.road_m / 2 + street.pavement_m + rng.uniform(0.9, 1.6)
            edge = line.offset_curve(-side * offset)
            for distance in np.arange(rng.uniform(2, pitch), edge.length, pitch):
                spot = np.array(edge.interpolate(distance + rng.uniform(-0.8, 0.8)).coords[0])
                tall = height * rng.uniform(0.85, 1.15)
                wide = tall * (rng.uniform(0.42, 0.5) if birch else rng.uniform(0.55, 0.7))
                if rng.uniform() < 0.5 * density:
                    found.append(_tree(spot, tall, wide, "birch" if birch else "round"))
    return found


def _lawn_trees(
    buildings: Sequence[Building], pavement: BaseGeometry, density: float, seed: int
) -> list[Tree]:
    """Mixed trees and groups of shrubs on the lawns within 75 m of the targets."""
    rng = rng_of(seed, "lawn trees")
    targets = shapely.union_all([Polygon(building.outline) for building in buildings])
    x0, y0, x1, y1 = targets.buffer(75).bounds
    found = []
    for _ in range(int(density * (x1 - x0) * (y1 - y0) / 130)):
        spot = rng.uniform([x0, y0], [x1, y1])
        kind = ("round", "birch", "pine", "shrub")[int(rng.choice(4, p=[0.34, 0.26, 0.14, 0.26]))]
        tall = {
            "round": rng.uniform(6, 13),
            "birch": rng.uniform(8, 15),
            "pine": rng.uniform(9, 16),
        }
        share = {"round": rng.uniform(0.55, 0.75), "birch": rng.uniform(0.38, 0.5), "pine": 0.42}
        group = int(rng.integers(2, 6)) if kind == "shrub" else 1
        spots = spot + rng.normal(0, 1.6, (group, 2)) * (group > 1)
        sizes = rng.uniform(1.0, 2.2, group)
        if pavement.distance(Point(spot)) < 1.2:
            continue
        for place, size in zip(spots, sizes, strict=True):
            if kind == "shrub":
                found.append(_tree(place, size, size * 1.1, kind))
            else:
                found.append(_tree(place, tall[kind], tall[kind] * share[kind], kind))
    return found


def _tree(place: FloatArray, height_m: float, crown_m: float, kind: str) -> Tree:
    return Tree(
        (millimetres(place[0]), millimetres(place[1])),
        millimetres(height_m),
        millimetres(crown_m),
        kind,  # type: ignore[arg-type]
    )


def _hedges(
    buildings: Sequence[Building], blocked: BaseGeometry, share: float, seed: int
) -> tuple[Hedge, ...]:
    """Hedges in front of walls between their entrances."""
    found = []
    for building in buildings:
        doors = [foot for foot, _, _ in doors_of(building)]
        for wall in building.walls:
            rng = rng_of(seed, "hedge", wall.id)
            if wall.width_m < 6 or rng.uniform() > 0.6 * share:
                continue
            frame = wall.world_from_facade
            right, outward = frame.rotation[:2, 0], frame.rotation[:2, 2]
            reach = max((b.depth_m for b in wall.balconies if b.y_m < 2.5), default=0.0)
            away = rng.uniform(1.4, 2.4) + reach
            width, height = rng.uniform(0.6, 0.9), rng.uniform(0.8, 1.25)
            foot = frame.translation[:2] + outward * away
            whole = LineString([foot + right * 0.8, foot + right * (wall.width_m - 0.8)])
            gaps = [Point(door).buffer(3.2) for door in doors]
            clear = whole.difference(shapely.union_all([blocked.buffer(width / 2 + 0.1), *gaps]))
            for piece in shapely.get_parts(clear):
                if piece.length > 2.5 and rng.uniform() < 0.8:
                    line = tuple((millimetres(x), millimetres(y)) for x, y in piece.coords)
                    found.append(Hedge(line, millimetres(width), millimetres(height)))
    return tuple(found)


def _wall_samples(buildings: Sequence[Building]) -> tuple[FloatArray, FloatArray]:
    points, outward = [], []
    for building in buildings:
        for wall in building.walls:
            frame = wall.world_from_facade
            count = max(int(wall.width_m / SAMPLE_M), 1)
            steps = (np.arange(count) + 0.5) / count * wall.width_m
            points.append(frame.translation[:2] + steps[:, None] * frame.rotation[:2, 0])
            outward.append(np.repeat(frame.rotation[None, :2, 2], count, axis=0))
    return np.concatenate(points), np.concatenate(outward)
