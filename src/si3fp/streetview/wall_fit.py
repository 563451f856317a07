"""One vertical wall from the noisy planes of many panoramas and a footprint edge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from si3fp.config import ClusterConfig
from si3fp.geometry.rigid import FloatArray
from si3fp.streetview.wall_planes import WallPlane

HALF_WEIGHT_PIXELS = 200
"""Pixels at which a plane has half the weight of one that fills the view."""


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A wall in plan from its left to its right end, seen from outside.

    Attributes
    ----------
    left_in_world, right_in_world
        (2,) metres. The direction left to right and up and the outward normal are right-handed.
    """

    left_in_world: FloatArray
    right_in_world: FloatArray

    @property
    def length_m(self) -> float:
        """Distance between the ends."""
        return float(np.hypot(*(self.right_in_world - self.left_in_world)))

    @property
    def along(self) -> FloatArray:
        """(2,) unit vector from left to right."""
        direction: FloatArray = (self.right_in_world - self.left_in_world) / self.length_m
        return direction

    @property
    def outward(self) -> FloatArray:
        """(2,) outward unit normal."""
        along = self.along
        return np.array([along[1], -along[0]])

    def coordinates(self, points_in_world: FloatArray) -> FloatArray:
        """Metres along from the left end and in front of the wall (..., 2) of points (..., 2+)."""
        gap = points_in_world[..., :2] - self.left_in_world
        return np.stack([gap @ self.along, gap @ self.outward], axis=-1)


@dataclass(frozen=True, slots=True)
class WallFit:
    """How well the planes of the panoramas agree on a wall.

    Attributes
    ----------
    planes, panoramas
        Planes assigned, and panoramas whose planes agree (3 sigma).
    rms_offset_m
        Root mean square distance of the agreeing planes from the wall, each taken at the middle
        of its own support; 0 without planes.
    angle_spread_deg
        Standard deviation of their bearings.
    edge_offset_m, edge_angle_deg
        Agreeing planes, without the edge as a prior, against the footprint edge: distance at its
        middle, positive outwards, and turn, positive counter-clockwise seen from above; None
        without planes or without footprint.
    source
        ``planes`` or ``footprint``: what decided the wall.
    offset_sigma_m, angle_sigma_deg
        Standard deviations of the wall: its distance at the middle, and its bearing.
    """

    planes: int
    panoramas: int
    rms_offset_m: float
    angle_spread_deg: float
    edge_offset_m: float | None
    edge_angle_deg: float | None
    source: str
    offset_sigma_m: float
    angle_sigma_deg: float


def fit_wall(
    members: Sequence[WallPlane], reference: Line, is_edge: bool, config: ClusterConfig
) -> tuple[Line, WallFit]:
    """The wall in plan, and how well its members agree.

    Each member measures an offset where its camera stands (the foot, which an error of bearing
    leaves in place) and, independently, a slope. Weighted medians start the fit; members within
    three standard deviations then enter a least-squares line, together with the footprint edge as
    one more observation of offset and slope. Where fewer than `config.min_agreeing` panoramas
    agree, nothing tells a right plane from a wrong one and the edge is kept as it is.

    Parameters
    ----------
    members
        Planes of this wall.
    reference
        The footprint edge, or any line near the members where there is no footprint.
    is_edge
        Whether the reference is a footprint edge, that is, evidence.
    """
    sigma_edge_slope = config.edge_corner_sigma_m * np.sqrt(2) / reference.length_m
    edge_sigma = np.array([config.edge_offset_sigma_m, sigma_edge_slope])
    if not members:
        return reference, WallFit(0, 0, 0.0, 0.0, None, None, "footprint", *_told(edge_sigma))
    middle = (reference.left_in_world + reference.right_in_world) / 2
    feet = np.array([member.foot_in_world for member in members]) - middle
    outward = np.array([member.outward for member in members])
    along, front = feet @ reference.along, feet @ reference.outward
    # A line with outward normal o runs along (-o_y, o_x): its slope against the reference.
    runs = np.stack([-outward[:, 1], outward[:, 0]], axis=-1)
    slope = (runs @ reference.outward) / (runs @ reference.along)
    weight = np.array([m.pixels / (m.pixels + HALF_WEIGHT_PIXELS) for m in members])

    sigma_slope = np.tan(np.deg2rad(config.member_bearing_sigma_deg)) / np.sqrt(weight)
    sigma_front = config.member_offset_sigma_m / np.sqrt(weight)
    sigma_middle = np.hypot(sigma_front, sigma_slope * along)
    start = np.array(
        [
            _weighted_median(front - slope * along, sigma_middle**-2),
            _weighted_median(slope, sigma_slope**-2),
        ]
    )

    def agreeing(line: FloatArray) -> FloatArray:
        offset_error = np.abs(front - slope * along - line[0]) / sigma_middle
        return np.asarray((offset_error < 3) & (np.abs(slope - line[1]) / sigma_slope < 3))

    def solved(inlier: FloatArray, with_edge: bool) -> tuple[FloatArray, FloatArray]:
        rows = [np.stack([1 / sigma_front, along / sigma_front], axis=-1)[inlier]]
        rows.append(np.stack([np.zeros_like(along), 1 / sigma_slope], axis=-1)[inlier])
        values = [(front / sigma_front)[inlier], (slope / sigma_slope)[inlier]]
        if with_edge:
            rows.append(np.diag(1 / edge_sigma))
            values.append(np.zeros(2))
        every = np.vstack(rows)
        solution: FloatArray = np.linalg.lstsq(every, np.concatenate(values), rcond=None)[0]
        return solution, np.sqrt(np.diag(np.linalg.inv(every.T @ every)))

    inlier = agreeing(start)
    if inlier.any():
        inlier = agreeing(solved(inlier, False)[0])
    if not inlier.any():
        inlier = np.ones(len(members), dtype=np.bool_)
    measured, _ = solved(inlier, False)
    ids = {member.panorama_id for member, good in zip(members, inlier, strict=True) if good}
    use_planes = len(ids) >= config.min_agreeing or not is_edge
    final, sigma = solved(inlier, is_edge) if use_planes else (np.zeros(2), edge_sigma)

    support = np.array([np.median(m.support_in_world[:, :2], axis=0) for m in members]) - middle
    at = support @ reference.along
    residual = front + slope * (at - along) - (final[0] + final[1] * at)
    line = _moved(reference, float(final[0]), float(final[1]))
    return line, WallFit(
        len(members),
        len(ids),
        float(np.sqrt(np.mean(residual[inlier] ** 2))),
        float(np.std(np.rad2deg(np.arctan(slope[inlier])))),
        float(measured[0]) if is_edge else None,
        # A slope leads from the edge towards its normal, which lies clockwise of it.
        -float(np.rad2deg(np.arctan(measured[1]))) if is_edge else None,
        "planes" if use_planes else "footprint",
        *_told(sigma),
    )


def _told(sigma: FloatArray) -> tuple[float, float]:
    """Standard deviations of offset and slope as metres and degrees."""
    return float(sigma[0]), float(np.rad2deg(sigma[1]))


def _weighted_median(values: FloatArray, weights: FloatArray) -> float:
    order = np.argsort(values, kind="stable")
    share = np.cumsum(weights[order]) / np.sum(weights)
    return float(values[order][np.searchsorted(share, 0.5)])


def _moved(line: Line, offset_m: float, slope: float) -> Line:
    """The ends of a line dropped onto the line offset + slope * s about its middle."""
    middle = (line.left_in_world + line.right_in_world) / 2
    through = middle + offset_m * line.outward
    direction = line.along + slope * line.outward
    direction = direction / np.hypot(*direction)
    left = through + ((line.left_in_world - through) @ direction) * direction
    right = through + ((line.right_in_world - through) @ direction) * direction
    return Line(left, right)
