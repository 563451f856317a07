"""Which found facade is which true one, and why one has no partner."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin, geodetic_from_world, world_from_geodetic
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Facade

MAX_ANGLE_DEG = 15.0  # decision: facades match within this angle,
MAX_PLANE_DISTANCE_M = 1.0  # this distance of the planes,
MIN_OVERLAP = 0.1  # and this share of the smaller facade's area;
SAME_ID_ANGLE_DEG = 30.0  # where both have one id, within this angle
SAME_ID_PLANE_DISTANCE_M = 3.0  # and this distance
APART_M = 10.0  # decision: models with a gap wider than this are not of one place


@dataclass(frozen=True, slots=True)
class _Fit:
    """How a facade lies to another: angle, distance of the planes, share of the smaller area."""

    angle_deg: float
    distance_m: float
    overlap: float

    def close(self, same_id: bool) -> bool:
        angle_deg = SAME_ID_ANGLE_DEG if same_id else MAX_ANGLE_DEG
        distance_m = SAME_ID_PLANE_DISTANCE_M if same_id else MAX_PLANE_DISTANCE_M
        return (
            self.angle_deg <= angle_deg
            and self.distance_m <= distance_m
            and self.overlap > MIN_OVERLAP
        )


def truth_from_found_world(found_origin: GeoOrigin, truth_origin: GeoOrigin) -> Rigid3:
    """The move between two east-north-up worlds, their slight turn included."""
    reach_m = 1000.0
    points = np.concatenate([np.zeros((1, 3)), reach_m * np.eye(3)])
    moved = world_from_geodetic(geodetic_from_world(points, found_origin), truth_origin)
    left, _, right = np.linalg.svd(((moved[1:] - moved[0]) / reach_m).T)
    return Rigid3(left @ right, moved[0])


def paired_facades(found: Sequence[Facade], truth: Sequence[Facade]) -> dict[str, Facade]:
    """The found facade of each true facade's id: those with one id first, then by overlap."""
    by_id = {facade.id: facade for facade in found}
    pairs = {
        true.id: by_id[true.id]
        for true in truth
        if true.id in by_id and _fit(by_id[true.id], true).close(same_id=True)
    }
    candidates = []
    for true in truth:
        for candidate in found:
            if true.id not in pairs and candidate.id not in pairs:
                fit = _fit(candidate, true)
                if fit.close(same_id=False):
                    candidates.append((-fit.overlap, true.id, candidate.id))
    used: set[str] = set()
    for _, true_id, candidate_id in sorted(candidates):
        if true_id not in pairs and candidate_id not in used:
            pairs[true_id] = by_id[candidate_id]
            used.add(candidate_id)
    return pairs


def require_one_place(
    found: Sequence[Facade],
    truth: Sequence[Facade],
    found_origin: GeoOrigin | None,
    truth_origin: GeoOrigin | None,
) -> None:
    """Nothing, where the boxes around two models (in one world) lie within 10 m of each other.

    Raises
    ------
    InputError
        If they do not: a wrong origin, unit or file.
    """
    if not found or not truth:
        return
    (low, high), (true_low, true_high) = (
        (corners.min(axis=0), corners.max(axis=0)) for corners in (_corners(found), _corners(truth))
    )
    gaps_m = np.maximum(np.maximum(low - true_high, true_low - high), 0.0)
    if np.linalg.norm(gaps_m) > APART_M:
        shift = in_words((low + high - true_low - true_high) / 2)
        raise InputError(
            f"The two models do not overlap: {np.linalg.norm(gaps_m):,.1f} m lie between them "
            f"(from the true centre to the found one: {shift}). Their origins are "
            f"{_place(found_origin)} (found) and {_place(truth_origin)} (truth): check "
            "user_data.si3fp.origin and the units of both files, and that they show one building."
        )


def why_unpaired(facade: Facade, others: Sequence[Facade], partners: Mapping[str, str]) -> str:
    """Why a facade has no partner among the facades of the other model.

    Parameters
    ----------
    facade
        The facade without partner.
    others
        All facades of the other model.
    partners
        The partner of each of the others that has one.
    """
    if not others:
        return "the other model has no walls"
    same = [other for other in others if other.id == facade.id]
    if same:
        return f"the wall of the same id lies elsewhere: {_apart(facade, same[0])}"
    taken = [o for o in others if o.id in partners and _fit(o, facade).close(same_id=False)]
    if taken:
        name = taken[0].id
        return f"the wall there, {name}, is already the partner of {partners[name]}"
    centre = facade.centre_in_world
    nearest = min(others, key=lambda o: (float(np.linalg.norm(o.centre_in_world - centre)), o.id))
    return f"no wall there; the nearest, {nearest.id}: {_apart(facade, nearest)}"


def mean_shift_m(pairs: Sequence[tuple[Facade, Facade]]) -> tuple[float, float, float] | None:
    """Mean way from the second facades' centres to the first ones', in their world."""
    if not pairs:
        return None
    ways = [first.centre_in_world - second.centre_in_world for first, second in pairs]
    east, north, up = (float(value) for value in np.mean(ways, axis=0))
    return east, north, up


def in_words(shift_m: FloatArray | Sequence[float]) -> str:
    """``4.0 m east, 0.2 m south, 1.0 m up`` of a way in an east-north-up world."""
    names = (("east", "west"), ("north", "south"), ("up", "down"))
    return ", ".join(
        f"{abs(value):,.1f} m {positive if value >= 0 else negative}"
        for value, (positive, negative) in zip(shift_m, names, strict=True)
    )


def box_in(b_from_a: Rigid3, x_m: float, y_m: float, width_m: float, height_m: float) -> FloatArray:
    """x0, y0, x1, y1 in plane b of a rectangle in plane a."""
    corners = [
        [x_m + across * width_m, y_m + up * height_m, 0.0] for across in (0, 1) for up in (0, 1)
    ]
    moved = b_from_a.apply(corners)[:, :2]
    return np.concatenate([moved.min(axis=0), moved.max(axis=0)])


def _fit(found: Facade, truth: Facade) -> _Fit:
    truth_from_found = truth.world_from_facade.inverse() @ found.world_from_facade
    angle_deg = np.rad2deg(np.arccos(np.clip(truth_from_found.rotation[2, 2], -1.0, 1.0)))
    centre = truth_from_found.apply([found.width_m / 2, found.height_m / 2, 0.0])
    box = box_in(truth_from_found, 0.0, 0.0, found.width_m, found.height_m)
    whole = np.array([0.0, 0.0, truth.width_m, truth.height_m])
    shared = np.clip(np.minimum(box[2:], whole[2:]) - np.maximum(box[:2], whole[:2]), 0, None)
    smaller = min(found.width_m * found.height_m, truth.width_m * truth.height_m)
    return _Fit(float(angle_deg), float(abs(centre[2])), float(shared.prod() / smaller))


def _apart(facade: Facade, other: Facade) -> str:
    fit = _fit(other, facade)
    if fit.angle_deg > 90:
        return f"it faces the other way ({fit.angle_deg:.0f} degrees)"
    return (
        f"turned by {fit.angle_deg:.0f} degrees, {fit.distance_m:.1f} m off its plane, "
        f"overlap {fit.overlap * 100:.0f} %"
    )


def _corners(facades: Sequence[Facade]) -> FloatArray:
    return np.concatenate(
        [
            facade.world_from_facade.apply(
                [[x, y, 0.0] for x in (0.0, facade.width_m) for y in (0.0, facade.height_m)]
            )
            for facade in facades
        ]
    )


def _place(origin: GeoOrigin | None) -> str:
    if origin is None:
        return "not given"
    return f"{origin.lat_deg:.5f}, {origin.lon_deg:.5f}, {origin.height_m:.1f} m"
