"""Walls laid on the edges of footprints: what pairs of them propose, and how well each fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from si3fp.errors import InputError
from si3fp.geometry.rigid import FloatArray

CUT_SIGMAS = 3.0  # a larger distance costs no more
END_FACTOR = 2.0  # the ends of walls are less sure than their planes, by this factor
_MAX_TURN_DEG = 15.0  # between the outward normals of a wall and its edge
_SEED_WALLS = 6  # the longest; they and pairs of them propose the placements


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """Directed segments with their outside on the right.

    Attributes
    ----------
    ends
        (N, 2, 2) start and end, metres.
    along, outward
        (N, 2) unit vectors.
    length
        (N,) metres.
    """

    ends: FloatArray
    along: FloatArray
    outward: FloatArray
    length: FloatArray


def directed(ends: ArrayLike, outward: ArrayLike | None, what: str) -> Segments:
    """Segments in the order that puts their outside on the right.

    Parameters
    ----------
    ends
        (N, 2, 2) both ends.
    outward
        (N, 2) directions to the outside; None where the ends are in order already.
    what
        Name of a segment in messages.

    Raises
    ------
    InputError
        If shapes are wrong, a value is not finite, or a segment has no length or outside.
    """
    points = np.asarray(ends, dtype=np.float64)
    if points.ndim != 3 or points.shape[1:] != (2, 2) or not len(points):
        raise InputError(f"Needed are {what}s as (N, 2, 2) with N >= 1, got {points.shape}.")
    if not np.isfinite(points).all():
        raise InputError(f"An end of a {what} is NaN or infinite; leave it out.")
    if outward is not None:
        sides = np.asarray(outward, dtype=np.float64)
        if sides.shape != (len(points), 2):
            raise InputError(f"{len(points)} {what}s need as many outward directions, got {sides}.")
        across = np.sum(_right_of(points[:, 1] - points[:, 0]) * sides, axis=1)
        if not (np.abs(across) > 0).all():
            raise InputError(f"An outward direction lies along its {what} or is not finite.")
        points = np.where((across < 0)[:, None, None], points[:, ::-1], points)
    along = points[:, 1] - points[:, 0]
    length = np.linalg.norm(along, axis=1)
    if (length < 1e-6).any():
        raise InputError(f"The {what}s {np.flatnonzero(length < 1e-6).tolist()} have no length.")
    along = along / length[:, None]
    return Segments(points, along, _right_of(along), length)


def _right_of(directions: FloatArray) -> FloatArray:
    return np.stack([directions[..., 1], -directions[..., 0]], axis=-1)


def rotations(turns_deg: ArrayLike) -> FloatArray:
    """Counter-clockwise rotations (..., 2, 2)."""
    turns = np.deg2rad(np.asarray(turns_deg, dtype=np.float64))
    cos, sin = np.cos(turns), np.sin(turns)
    return np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=-2)


def proposals(walls: Segments, edges: Segments) -> tuple[FloatArray, FloatArray]:
    """Turns (K,) in degrees and offsets (K, 2) in metres that lay a wall on an edge."""
    turns_deg: list[float] = []
    offsets: list[FloatArray] = []
    seeds: list[int] = np.argsort(-walls.length, kind="stable")[:_SEED_WALLS].tolist()
    wall_deg = np.rad2deg(np.arctan2(walls.along[:, 1], walls.along[:, 0]))
    edge_deg = np.rad2deg(np.arctan2(edges.along[:, 1], edges.along[:, 0]))
    line = np.sum(edges.ends.mean(axis=1) * edges.outward, axis=1)  # outward . x of each edge
    for w in seeds:
        for e in range(len(edges.length)):
            turn_deg = float(edge_deg[e] - wall_deg[w])
            turn = rotations(turn_deg)
            turned, outward = walls.ends @ turn.T, walls.outward @ turn.T
            found = [edges.ends[e, end] - turned[w, end] for end in (0, 1)]
            for other in seeds:
                same_side = edges.outward @ outward[other] >= np.cos(np.deg2rad(_MAX_TURN_DEG))
                crosses = np.abs(edges.along @ edges.outward[e]) > 0.5
                for f in np.flatnonzero(same_side & crosses).tolist():
                    lines = edges.outward[[e, f]]
                    middles = turned[[w, other]].mean(axis=1)
                    gaps = line[[e, f]] - np.sum(lines * middles, axis=1)
                    found.append(np.linalg.solve(lines, gaps))
            turns_deg += [turn_deg] * len(found)
            offsets += found
    return np.array(turns_deg), np.array(offsets)


def scored(
    walls: Segments, edges: Segments, turns_deg: FloatArray, offsets: FloatArray, sigma_m: float
) -> tuple[FloatArray, NDArray[np.int_]]:
    """Scores (K,) of placements and the best edge (K, W) of each wall, -1 where none fits."""
    turn = rotations(turns_deg)
    ends = np.einsum("kij,wpj->kwpi", turn, walls.ends) + offsets[:, None, None]
    outward = np.einsum("kij,wj->kwi", turn, walls.outward)
    across = np.einsum("kwpi,ei->kwep", ends, edges.outward)
    across -= np.sum(edges.ends[:, 0] * edges.outward, axis=1)[:, None]
    along = np.einsum("kwpi,ei->kwep", ends, edges.along)
    along -= np.sum(edges.ends[:, 0] * edges.along, axis=1)[:, None]
    inside = np.stack([along[..., 0], edges.length - along[..., 1]], axis=-1)
    end_cost = _truncated(inside, END_FACTOR * sigma_m) * np.where(inside < 0, 1.0, 0.5)
    line_cost = _truncated(across, sigma_m).mean(axis=-1)
    cost = (line_cost + end_cost.mean(axis=-1)) / 2
    same_side = np.einsum("kwi,ei->kwe", outward, edges.outward) >= np.cos(
        np.deg2rad(_MAX_TURN_DEG)
    )
    overlaps = (along[..., 1] > 0) & (along[..., 0] < edges.length)
    cost[~same_side | ~overlaps | (line_cost > 0.99)] = 1.0
    best = cost.argmin(axis=2)
    least = cost.min(axis=2)
    score = 1 - least @ walls.length / walls.length.sum()
    return score, np.where(least < 1.0, best, -1)


def _truncated(distances_m: FloatArray, sigma_m: float) -> FloatArray:
    """Squared distances, 1 from the cut on."""
    return np.minimum((distances_m / (CUT_SIGMAS * sigma_m)) ** 2, 1.0)
