"""S.3, last part: where the registered views of all facades lie, from the poses that they share.

Matches fix the views of a facade to one another and leave open the motion that all of them share,
its drift. One panorama sees several facades, and its pose errs in one way for all of them. All
poses and planes of a run are therefore solved together, and with them the drift of every facade
(docs/decisions/0006-registration.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import spsolve

from si3fp.config import AlignConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Panorama
from si3fp.streetview.align import Registration
from si3fp.streetview.motion import in_metres, in_pixels, motion_matrix, moved
from si3fp.streetview.pose_motion import FLOOR, PLANE, POSE, PoseMotion, pose_sigmas

ROUNDS = 8
DRIFT = 8
"""A drift is any motion: that the mean of the views does not move is no observation."""
DRIFT_SIGMA = np.array([100.0] * 2 + [10.0] * 4 + [1.0] * 2)
"""A bound where a facade has hardly any view, not a belief."""


@dataclass(frozen=True, slots=True, eq=False)
class RegisteredFacade:
    """The registrations of the views of one facade.

    Attributes
    ----------
    grid
        Common grid on the wall's plane.
    plane_sigma
        (2,) standard deviations of that plane: outwards in metres, and its turn in radians.
    registrations
        From `si3fp.streetview.align.register`.
    """

    grid: FacadeGrid
    plane_sigma: FloatArray
    registrations: tuple[Registration, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Sighting:
    """One used view of one facade, with its slots among the unknowns."""

    facade: int
    pose_at: slice
    plane_at: slice
    drift_at: slice
    motion: PoseMotion
    observed: FloatArray
    root: FloatArray
    sigmas: FloatArray

    @property
    def slots(self) -> FloatArray:
        """Indices (16,) of pose, plane and drift among the unknowns."""
        parts = (self.pose_at, self.plane_at, self.drift_at)
        return np.concatenate([np.arange(part.start, part.stop) for part in parts])


def without_drift(
    facades: Sequence[RegisteredFacade], panoramas: Mapping[str, Panorama], config: AlignConfig
) -> tuple[tuple[Registration, ...], ...]:
    """The registrations of every facade without the motion that its views share.

    Unknown are the errors of every pose (place and turn), those of every wall's plane, and the
    drift of every facade; known are the motions of the views against one another. Poses and
    planes have their standard deviations as priors, a motion what its matches tell, and Cauchy
    weights keep a view that was registered wrongly from moving the others.

    Parameters
    ----------
    facades
        All facades of a run.
    panoramas
        By id, with the poses as they are believed.
    config
        Accuracy of the poses.
    """
    sightings, size = _sightings(facades, panoramas, config)
    if not sightings:
        return tuple(facade.registrations for facade in facades)
    state = np.zeros(size)
    drifts = [np.eye(3) for _ in facades]
    precision = np.ones(size)
    for sighting in sightings:
        precision[sighting.drift_at] = DRIFT_SIGMA**-2
    for _ in range(ROUNDS):
        step = _step(sightings, state, drifts, precision)
        state += step
        for sighting in {sighting.facade: sighting for sighting in sightings}.values():
            drifts[sighting.facade] = motion_matrix(state[sighting.drift_at])
    return tuple(
        tuple(_moved_back(one, drift, facade.grid) for one in facade.registrations)
        for facade, drift in zip(facades, drifts, strict=True)
    )


def _sightings(
    facades: Sequence[RegisteredFacade], panoramas: Mapping[str, Panorama], config: AlignConfig
) -> tuple[list[_Sighting], int]:
    """All used views, and the number of unknowns: poses, then plane and drift of each facade."""
    used = [(k, one) for k, each in enumerate(facades) for one in each.registrations if one.used]
    place = {name: k * POSE for k, name in enumerate(sorted({one.source for _, one in used}))}
    first = len(place) * POSE
    size = first + len(facades) * (PLANE + DRIFT)
    sightings = []
    for k, one in used:
        facade, start = facades[k], first + k * (PLANE + DRIFT)
        motion = PoseMotion.of(panoramas[one.source], facade.grid)
        sightings.append(
            _Sighting(
                k,
                slice(place[one.source], place[one.source] + POSE),
                slice(start, start + PLANE),
                slice(start + PLANE, start + PLANE + DRIFT),
                motion,
                in_metres(one.grid_from_view, facade.grid),
                _root(one.information),
                np.concatenate([pose_sigmas(config), facade.plane_sigma]),
            )
        )
    return sightings, size


def _root(information: FloatArray | None) -> FloatArray:
    """Square root (8, 8) of what is known of a motion, in units of `FLOOR`; None is all of it."""
    if information is None:
        return np.eye(len(FLOOR))
    values, vectors = np.linalg.eigh(information * np.outer(FLOOR, FLOOR))
    values = np.maximum(values, 0.0)
    root: FloatArray = (vectors * np.sqrt(values / (1 + values))) @ vectors.T
    return root


def _step(
    sightings: Sequence[_Sighting],
    state: FloatArray,
    drifts: Sequence[FloatArray],
    precision: FloatArray,
) -> FloatArray:
    """Gauss-Newton step of all unknowns; poses and planes are in standard deviations."""
    rows, columns, values = [], [], []
    precision = precision.copy()
    for start in {sighting.pose_at.start for sighting in sightings}:
        pose = slice(start, start + POSE)
        precision[pose] /= 1 + state[pose] @ state[pose] / POSE
    gradient = precision * state
    for one in sightings:
        errors = np.concatenate([state[one.pose_at], state[one.plane_at]]) * one.sigmas
        expected = one.motion(errors)
        found = one.motion.parameters(np.linalg.inv(drifts[one.facade]) @ one.observed)
        residual = one.root @ ((expected - found) / FLOOR)
        slope = np.zeros((len(FLOOR), POSE + PLANE + DRIFT))
        slope[:, : POSE + PLANE] = one.motion.slopes(errors, one.sigmas).T
        slope[:, POSE + PLANE :] = np.eye(DRIFT)
        slope = one.root @ (slope / FLOOR[:, None])
        weight = 1 / (1 + residual @ residual / len(FLOOR))
        slots = one.slots
        gradient[slots] += weight * (slope.T @ residual)
        values.append((weight * slope.T @ slope).ravel())
        rows.append(np.repeat(slots, len(slots)))
        columns.append(np.tile(slots, len(slots)))
    every = np.arange(len(state))
    normal = csc_array(
        (
            np.concatenate([precision, *values]),
            (np.concatenate([every, *rows]), np.concatenate([every, *columns])),
        ),
        shape=(len(state), len(state)),
    )
    step: FloatArray = -np.asarray(spsolve(normal, gradient))
    return step


def _moved_back(one: Registration, drift: FloatArray, grid: FacadeGrid) -> Registration:
    if not one.used:
        return one
    move = np.linalg.inv(drift) @ in_metres(one.grid_from_view, grid)
    shift_m = float(np.linalg.norm(moved(np.zeros((1, 2)), move)))
    return replace(one, grid_from_view=in_pixels(move, grid), shift_m=shift_m)
