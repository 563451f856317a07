"""Position and north of a reconstruction, by fitting its walls to the edges of footprints (C.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from si3fp.camera2d.edge_fit import (
    CUT_SIGMAS,
    END_FACTOR,
    Segments,
    directed,
    proposals,
    rotations,
    scored,
)
from si3fp.errors import InputError, ReconstructionError
from si3fp.geometry.rigid import FloatArray, Rigid3

_SHORT_FACTOR = 8.0  # ends before the edge's are less sure than planes, by this factor
_SAME_CORNER_M, _CORNER_SINE = 0.01, 0.5  # edges that meet at a corner
WALL_SIGMA_M = 0.3  # of a wall against the map: eaves, plinths, digitising
_MAX_HYPOTHESES = 40
_MIN_SCORE = 0.6
_CLEAR_LEAD = 0.1  # in score
_LISTED = 8
_SAME_PLACE_M = 1.0
_BATCH = 500


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """One way to put the reconstruction on the map.

    Attributes
    ----------
    world_from_level
        A turn about up and an offset in x and y; heights stay.
    heading_deg
        Compass bearing of the level frame's y axis.
    score
        1 where every wall lies on an edge and ends where it ends, 0 where none fits.
    edge_of_wall
        Index of the edge of each wall, -1 where none fits.
    heading_sigma_deg
        Standard deviation of the heading.
    offset_sigma_m
        (2,) standard deviation of the position, east and north, at the middle of the walls.
    """

    world_from_level: Rigid3
    heading_deg: float
    score: float
    edge_of_wall: tuple[int, ...]
    heading_sigma_deg: float
    offset_sigma_m: FloatArray

    def __str__(self) -> str:
        east, north, _ = self.world_from_level.translation
        pairs = ", ".join(f"{w} on {e}" for w, e in enumerate(self.edge_of_wall) if e >= 0)
        return (
            f"heading {self.heading_deg:.1f} degrees, offset {east:.1f} m east {north:.1f} m "
            f"north, score {self.score:.2f} (walls on edges: {pairs or 'none'})"
        )


def place_on_footprints(
    walls_in_level: ArrayLike,
    outward_in_level: ArrayLike,
    edges_in_world: ArrayLike,
    sigma_m: float = WALL_SIGMA_M,
) -> Placement:
    """The one placement that puts reconstructed walls on footprint edges.

    Parameters
    ----------
    walls_in_level
        (W, 2, 2) both ends of each wall seen from above, in metres, in a frame with z up; which
        end comes first does not matter, and a wall may be seen in part.
    outward_in_level
        (W, 2) direction from each wall to its outside.
    edges_in_world
        (E, 2, 2) start and end of the edges of one or more footprints, outside on the right.
    sigma_m
        Standard deviation of a wall against its edge; its ends have twice as much.

    Raises
    ------
    InputError
        If shapes are wrong, a value is not finite, or a wall has no length or outside.
    ReconstructionError
        If no placement fits, or several fit about equally well: they are listed.
    """
    found = placement_hypotheses(walls_in_level, outward_in_level, edges_in_world, sigma_m)
    if found[0].score < _MIN_SCORE:
        raise ReconstructionError(
            f"The reconstructed walls do not fit the footprints: the best is {found[0]}. Check "
            "the scale and that the footprints are of this building, or give photos with GPS or "
            "known cameras (--cameras with --origin)."
        )
    equal = [one for one in found if one.score >= found[0].score - _CLEAR_LEAD]
    if len(equal) > 1:
        more = f"; and {len(equal) - _LISTED} more" if len(equal) > _LISTED else ""
        listed = "; ".join(f"({n}) {one}" for n, one in enumerate(equal[:_LISTED], start=1))
        raise ReconstructionError(
            f"The walls fit the footprints in {len(equal)} ways: {listed}{more}. Photograph more "
            "sides of the building, or give photos with GPS or known cameras (--cameras with "
            "--origin)."
        )
    return found[0]


def placement_hypotheses(
    walls_in_level: ArrayLike,
    outward_in_level: ArrayLike,
    edges_in_world: ArrayLike,
    sigma_m: float = WALL_SIGMA_M,
) -> tuple[Placement, ...]:
    """All distinct placements that pairs of walls and edges propose, refined, best first.

    Parameters and errors as in `place_on_footprints`, which picks the one that stands out.

    Notes
    -----
    Each wall is laid on each edge with the outsides on the same side and one end on its end, or
    with a second wall on the line of a second edge. A placement scores by the truncated squared
    distances of each wall to its best edge, weighted by length; a wall that runs past its edge
    costs twice as much as one that ends short of it, as it may have been seen in part.
    """
    if not (np.isfinite(sigma_m) and sigma_m > 0):
        raise InputError(f"The standard deviation of a wall must be positive, got {sigma_m} m.")
    walls = directed(walls_in_level, outward_in_level, "wall")
    edges = directed(edges_in_world, None, "edge")
    turns_deg, offsets = proposals(walls, edges)
    scores = np.concatenate(
        [
            scored(walls, edges, turns_deg[i : i + _BATCH], offsets[i : i + _BATCH], sigma_m)[0]
            for i in range(0, len(turns_deg), _BATCH)
        ]
    )
    order = np.argsort(-scores, kind="stable")
    seeds = _distinct(walls, turns_deg[order], offsets[order])
    refined = [
        _refined(walls, edges, turns_deg[order[i]], offsets[order[i]], sigma_m) for i in seeds
    ]
    refined.sort(key=lambda one: -one.score)
    turns_deg = np.array([-one.heading_deg for one in refined])
    shifts = np.stack([one.world_from_level.translation[:2] for one in refined])
    return tuple(refined[i] for i in _distinct(walls, turns_deg, shifts))


def _distinct(walls: Segments, turns_deg: FloatArray, offsets: FloatArray) -> list[int]:
    """Indices of placements that move some end of a wall by more than a metre, in their order."""
    kept: list[int] = []
    ends = walls.ends.reshape(-1, 2)
    places = np.einsum("kij,nj->kni", rotations(turns_deg), ends) + offsets[:, None]
    for i in range(len(places)):
        moved = np.linalg.norm(places[kept] - places[i], axis=2).max(axis=1)
        if not (moved < _SAME_PLACE_M).any():
            kept.append(i)
        if len(kept) == _MAX_HYPOTHESES:
            break
    return kept


def _refined(
    walls: Segments, edges: Segments, turn_deg: float, offset: FloatArray, sigma_m: float
) -> Placement:
    """The placement after least squares on the walls that lie on an edge."""
    centre = walls.ends.reshape(-1, 2).mean(axis=0)
    middle = rotations(turn_deg) @ centre + offset
    _, assigned = scored(walls, edges, np.array([turn_deg]), offset[None], sigma_m)
    for _ in range(10):
        turn = rotations(turn_deg)
        rows, values = _equations(walls, edges, turn, middle, centre, assigned[0], sigma_m)
        normal_matrix = rows.T @ rows + 1e-9 * np.eye(3)
        step = np.linalg.solve(normal_matrix, -rows.T @ values)
        turn_deg, middle = turn_deg + float(np.rad2deg(step[0])), middle + step[1:]
        if np.abs(step).max() < 1e-9:
            break
    turn = rotations(turn_deg)
    offset = middle - turn @ centre
    score, assigned = scored(walls, edges, np.array([turn_deg]), offset[None], sigma_m)
    spread = max(1.0, float(values @ values) / max(len(values) - 3, 1))
    sigma = np.sqrt(spread * np.diag(np.linalg.inv(normal_matrix)))
    rotation = np.eye(3)
    rotation[:2, :2] = turn
    return Placement(
        Rigid3(rotation, np.array([*offset, 0.0])),
        float(-turn_deg % 360.0),
        float(score[0]),
        tuple(assigned[0].tolist()),
        float(np.rad2deg(sigma[0])),
        sigma[1:],
    )


def _equations(
    walls: Segments,
    edges: Segments,
    turn: FloatArray,
    middle: FloatArray,
    centre: FloatArray,
    assigned: NDArray[np.int_],
    sigma_m: float,
) -> tuple[FloatArray, FloatArray]:
    """Derivatives (N, 3) by angle and middle, and normalised distances (N,), the angle in radians.

    Both ends of a wall lie on its edge's line. An end near the edge's end lies at it, unless
    another wall meets it there: the plane of that one tells the corner better, as the points of
    a wall may end before the corner, or go on past it on the side of a balcony. Ends before the
    edge's count little, as one gable seen in part would move the house.
    """
    rows, values = [np.zeros(3)], [0.0]
    told = _corners_told(edges, assigned)
    for w in np.flatnonzero(assigned >= 0).tolist():
        e = int(assigned[w])
        for end in (0, 1):
            arm = turn @ (walls.ends[w, end] - centre)
            gap = arm + middle - edges.ends[e, end]
            swing = np.array([-arm[1], arm[0]])
            short = float(edges.along[e] @ gap) * (1 if end == 0 else -1) > 0
            sights = [(edges.outward[e], sigma_m)]
            if not told[e, end]:
                factor = _SHORT_FACTOR if short else END_FACTOR
                sights.append((edges.along[e], factor * sigma_m))
            for direction, sigma in sights:
                distance = float(direction @ gap) / sigma
                if abs(distance) < CUT_SIGMAS:
                    rows.append(np.array([direction @ swing, *direction]) / sigma)
                    values.append(distance)
    return np.stack(rows), np.array(values)


def _corners_told(edges: Segments, assigned: NDArray[np.int_]) -> NDArray[np.bool_]:
    """(E, 2) at which ends of edges another edge begins, at an angle, on which a wall lies."""
    held = np.unique(assigned[assigned >= 0])
    gaps_m = np.linalg.norm(edges.ends[:, :, None, None] - edges.ends[held], axis=-1).min(axis=-1)
    angled = np.abs(edges.along @ edges.outward[held].T) > _CORNER_SINE
    return np.asarray(((gaps_m < _SAME_CORNER_M) & angled[:, None]).any(axis=-1))
