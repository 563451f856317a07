"""A surveyed building on the walls of its ground: tops, gables, and openings in the walls' frames.

The ground's outline becomes a ring of plane walls. An opening belongs to the wall that it faces and
lies nearest to; one in a bay or behind a recess of the wall is moved onto its plane.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from benchmarks.estate.plans.citygml_file import FloatArray, SurveyedBuilding, SurveyedOpening
from shapely.geometry.polygon import orient

SIMPLE_M = 0.25  # bays and steps of the ground that are smaller are smoothed away
SHORTEST_M = 0.5  # of a wall
NEAR_M = 0.7  # a wall of the survey lies this near to the ground's outline
BAY_M = 1.5  # an opening this far from its wall is moved onto it; farther, it is left out
UPRIGHT = 0.2  # largest vertical part of the normal of an upright surface
FACING = 0.85  # cosine between an opening and its wall
MARGIN_M = 0.08  # of wall that is left at its ends and its top
GAP_M = 0.06  # parts of one window lie closer
RECESS_M = (0.02, 0.45)  # believable, from the wall's face to the glass


@dataclass(frozen=True)
class FoundOpening:
    """An opening in its wall's frame (m); ``recess_m`` is None where the survey has none.

    ``arch`` is the rise of its head as a share of the width; ``flattened`` tells that it was moved.
    """

    id: str
    kind: str
    x_m: float
    y_m: float
    width_m: float
    height_m: float
    recess_m: float | None
    arch: float = 0.0
    flattened: bool = False


@dataclass(frozen=True, eq=False)
class FoundWall:
    """An edge of the ground with its surveyed surfaces in its frame.

    Attributes
    ----------
    start, end
        (2,) m in the world; the outside is on the right.
    surface
        Everything that the survey has of it, x right and y up (shapely).
    rings
        The same as rings (V, 3): x, y and the distance in front of the edge.
    """

    start: FloatArray
    end: FloatArray
    surface: shapely.Geometry
    rings: tuple[FloatArray, ...]

    @property
    def width_m(self) -> float:
        return float(np.linalg.norm(self.end - self.start))

    @property
    def tops_m(self) -> FloatArray:
        """Height of the wall at eleven places from its left to its right end, 0 where none is."""
        places = np.linspace(0.03, 0.97, 11) * self.width_m
        lines = [shapely.LineString([(x, -1.0), (x, 200.0)]) for x in places]
        cuts = [self.surface.intersection(line) for line in lines]
        return np.array([0.0 if cut.is_empty else cut.bounds[3] for cut in cuts])

    @property
    def peak_m(self) -> float:
        """Top of the surface."""
        return 0.0 if self.surface.is_empty else float(self.surface.bounds[3])

    def local(self, points: FloatArray) -> FloatArray:
        """World points (N, 3) as x along the wall, y up, and metres in front of it."""
        along = (self.end - self.start) / self.width_m
        flat = points[:, :2] - self.start
        return np.stack(
            [flat @ along, points[:, 2], flat @ np.array([along[1], -along[0]])], axis=1
        )


def ground_outline(building: SurveyedBuilding) -> FloatArray:
    """The simplified outline (V, 2) of the largest part of the ground, counter-clockwise."""
    parts = [shapely.Polygon(ring[:, :2]).buffer(0) for ring in building.ground]
    whole = shapely.union_all(parts).buffer(0.05, join_style="mitre")
    whole = whole.buffer(-0.05, join_style="mitre")  # closes the slits between touching parts
    largest = max(getattr(whole, "geoms", [whole]), key=lambda part: part.area)
    ring = shapely.Polygon(largest.exterior).simplify(SIMPLE_M)
    corners = np.array(orient(ring).exterior.coords)[:-1]
    # The first corner is never simplified away: begin at another, then again.
    again = shapely.Polygon(np.roll(corners, 1, axis=0)).simplify(SIMPLE_M)
    corners = np.array(orient(again).exterior.coords)[:-1]
    while len(corners) > 4:
        lengths = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
        if lengths.min() >= SHORTEST_M:
            break
        i = int(lengths.argmin())
        corners[i] = (corners[i] + corners[(i + 1) % len(corners)]) / 2
        corners = np.delete(corners, (i + 1) % len(corners), axis=0)
    return corners


def walls_of(building: SurveyedBuilding, outline: FloatArray) -> tuple[FoundWall, ...]:
    """The outline's edges with the surveyed walls that lie on them."""
    walls = []
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        wall = FoundWall(start, end, shapely.Polygon(), ())
        rings = []
        for ring in building.walls:
            normal, _ = _plane(ring)
            local = wall.local(ring)
            if abs(normal[2]) > UPRIGHT or abs(normal[:2] @ _outward(wall)) < FACING:
                continue
            inside = np.clip(local[:, 0], 0, wall.width_m)
            if np.abs(local[:, 2]).max() < NEAR_M and np.ptp(inside) > 0.3 * np.ptp(local[:, 0]):
                rings.append(local)
        shapes = [shapely.Polygon(ring[:, :2]).buffer(0) for ring in rings]
        box = shapely.box(0.0, 0.0, wall.width_m, 200.0)
        surface = shapely.union_all(shapes).intersection(box)
        walls.append(replace(wall, surface=surface, rings=tuple(rings)))
    return tuple(walls)


def placed(
    opening: SurveyedOpening, walls: Sequence[FoundWall], surveyed: Sequence[FloatArray]
) -> tuple[int, FoundOpening] | str:
    """The opening's wall and place on it, or why it has none.

    Parameters
    ----------
    opening, surveyed
        The opening and all walls of the survey, in the world.
    walls
        The walls of the plan.
    """
    if not opening.rings:
        return "without geometry"
    points = np.concatenate(opening.rings)
    pane = max(opening.rings, key=lambda ring: _plane(ring)[1])
    normal, _ = _plane(pane)
    if abs(normal[2]) > UPRIGHT:
        return "in a slanted surface"
    nearest = _nearest(normal, points, walls)
    if nearest is None:
        return "facing no wall of the ground's outline"
    away, index = nearest
    if away > BAY_M:
        return "far from the ground's outline (dormers, set-back storeys)"
    wall = walls[index]
    local = wall.local(points)
    low, high = local.min(axis=0), local.max(axis=0)
    left, right = max(low[0], MARGIN_M), min(high[0], wall.width_m - MARGIN_M)
    bottom, top = max(low[1], 0.0), high[1]
    if (right - left) * (top - bottom) < 0.8 * (high[0] - low[0]) * (high[1] - low[1]):
        return "across a corner or below the ground"
    face_m, recess_m = _recess(wall.local(pane), [wall.local(ring) for ring in surveyed])
    found = FoundOpening(
        opening.id,
        opening.kind,
        float(left),
        float(bottom),
        float(right - left),
        float(top - bottom),
        recess_m,
        _arch(opening.rings, wall, float((right - left) * (top - bottom)), float(right - left)),
        abs(face_m) > NEAR_M / 2,
    )
    return index, found


def _nearest(
    normal: FloatArray, points: FloatArray, walls: Sequence[FoundWall]
) -> tuple[float, int] | None:
    """Distance and number of the wall that an opening faces and lies nearest to."""
    found = []
    for i, wall in enumerate(walls):
        local = wall.local(points)
        middle = (local.min(axis=0) + local.max(axis=0)) / 2
        if abs(normal[:2] @ _outward(wall)) > FACING and -0.3 < middle[0] < wall.width_m + 0.3:
            found.append((abs(float(middle[2])), i))
    return min(found, default=None)


def merged(openings: Sequence[FoundOpening], gone: Counter[str]) -> list[FoundOpening]:
    """Openings of one wall that do not overlap: parts of one become one, the rest yield to larger.

    ``gone`` counts what was joined or left out.
    """
    kept: list[FoundOpening] = []
    waiting = sorted(openings, key=lambda o: (-o.width_m * o.height_m, o.x_m, o.y_m))
    while waiting:
        one = waiting.pop(0)
        other = next((o for o in kept if _touching(one, o)), None)
        if other is None:
            kept.append(one)
            continue
        whole = _around(one, other)
        parts = one.width_m * one.height_m + other.width_m * other.height_m
        if _overlap(one, other) > 0.8 * one.width_m * one.height_m:
            gone["inside another opening"] += 1
        elif whole.width_m * whole.height_m < 1.12 * parts:
            gone["joined with another part of the same opening"] += 1
            kept.remove(other)
            waiting.insert(0, whole)
        else:
            gone["touching a larger opening"] += 1
    return sorted(kept, key=lambda o: (o.x_m, o.y_m))


def _outward(wall: FoundWall) -> FloatArray:
    along = (wall.end - wall.start) / wall.width_m
    return np.array([along[1], -along[0]])


def _plane(ring: FloatArray) -> tuple[FloatArray, float]:
    """Unit normal (Newell) and area of a ring (V, 3)."""
    centred = ring - ring[0]
    normal = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0) / 2
    area = float(np.linalg.norm(normal))
    return normal / max(area, 1e-12), area


def _recess(pane: FloatArray, walls: Sequence[FloatArray]) -> tuple[float, float | None]:
    """Where the wall's face around a pane lies (m in front of the edge), and the pane behind it."""
    x, y, out = pane.mean(axis=0)
    faces = []
    for ring in walls:
        near = (ring[:, :2].min(axis=0) - 0.2 < (x, y)) & ((x, y) < ring[:, :2].max(axis=0) + 0.2)
        if near.all() and np.ptp(ring[:, 2]) < 0.1 and abs(ring[:, 2].mean() - out) < 0.6:
            faces.append((_plane(ring)[1], float(ring[:, 2].mean())))
    if not faces:
        return float(out), None
    face_m = max(faces)[1]
    recess_m = face_m - float(out)
    return face_m, recess_m if RECESS_M[0] <= recess_m <= RECESS_M[1] else None


def _arch(
    rings: Sequence[FloatArray], wall: FoundWall, rectangle_m2: float, width_m: float
) -> float:
    """Rise of the head as a share of the width, by the area that the rectangle's corners lack."""
    flat = [shapely.Polygon(wall.local(ring)[:, :2]).buffer(0.03) for ring in rings]
    lacking = 1 - shapely.union_all(flat).buffer(-0.03).area / rectangle_m2
    if not 0.015 < lacking < 0.2:
        return 0.0
    # Half an ellipse of rise r over the width w leaves r w (1 - pi / 4) of its rectangle empty.
    return round(min(lacking * rectangle_m2 / (1 - np.pi / 4) / width_m**2, 0.5), 3)


def _overlap(a: FoundOpening, b: FoundOpening, grown_m: float = 0.0) -> float:
    width = min(a.x_m + a.width_m, b.x_m + b.width_m) - max(a.x_m, b.x_m) + grown_m
    height = min(a.y_m + a.height_m, b.y_m + b.height_m) - max(a.y_m, b.y_m) + grown_m
    return max(width, 0.0) * max(height, 0.0)


def _touching(a: FoundOpening, b: FoundOpening) -> bool:
    return _overlap(a, b, GAP_M) > GAP_M**2


def _around(part: FoundOpening, larger: FoundOpening) -> FoundOpening:
    """The rectangle around two parts, otherwise like the larger; a door stays a door."""
    x, y = min(part.x_m, larger.x_m), min(part.y_m, larger.y_m)
    kinds = {part.kind, larger.kind}
    return replace(
        larger,
        kind="door" if "door" in kinds else larger.kind,
        x_m=x,
        y_m=y,
        width_m=max(part.x_m + part.width_m, larger.x_m + larger.width_m) - x,
        height_m=max(part.y_m + part.height_m, larger.y_m + larger.height_m) - y,
        arch=0.0,
    )
