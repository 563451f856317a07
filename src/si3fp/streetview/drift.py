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
from numpy.typing import NDArray
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
MISSES = 2.0
"""A motion is known to this many times the median distance of its matches, and no better."""


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
class _Unknowns:
    """Where each unknown stands: poses by view id, then planes and drifts by facade.

    Poses and planes are in standard deviations, drifts are parameters of a motion.
    """

    poses: Mapping[str, slice]
    planes: tuple[slice, ...]
    drifts: tuple[slice, ...]
    size: int

    @classmethod
    def of(cls, facades: Sequence[RegisteredFacade]) -> _Unknowns:
        """Those of all facades and of every panorama that is used on one of them."""
        names = sorted({one.source for each in facades for one in each.registrations if one.used})
        first, each = len(names) * POSE, PLANE + DRIFT
        starts = [first + k * each for k in range(len(facades))]
        return cls(
            {name: slice(k * POSE, (k + 1) * POSE) for k, name in enumerate(names)},
            tuple(slice(start, start + PLANE) for start in starts),
            tuple(slice(start + PLANE, start + each) for start in starts),
            first + len(facades) * each,
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Sighting:
    """One used view of one facade.

    Attributes
    ----------
    facade
        Its index.
    slots
        (16,) indices of its pose, plane and drift among the unknowns.
    sigmas
        (8,) standard deviations of pose and plane.
    motion, observed, root
        What errors do, the homography in metres that registration found, and how sure it is.
    """

    facade: int
    slots: NDArray[np.int_]
    sigmas: FloatArray
    motion: PoseMotion
    observed: FloatArray
    root: FloatArray


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
    unknowns = _Unknowns.of(facades)
    if not unknowns.poses:
        return tuple(facade.registrations for facade in facades)
    sightings = _sightings(facades, unknowns, panoramas, config)
    state = np.zeros(unknowns.size)
    for _ in range(ROUNDS):
        state += _step(sightings, unknowns, state)
    drifts = [motion_matrix(state[at]) for at in unknowns.drifts]
    return tuple(
        tuple(_moved_back(one, drift, facade.grid) for one in facade.registrations)
        for facade, drift in zip(facades, drifts, strict=True)
    )


def _sightings(
    facades: Sequence[RegisteredFacade],
    unknowns: _Unknowns,
    panoramas: Mapping[str, Panorama],
    config: AlignConfig,
) -> list[_Sighting]:
    every = np.arange(unknowns.size)
    return [
        _Sighting(
            k,
            np.concatenate(
                [every[unknowns.poses[one.source]], every[unknowns.planes[k]], every[drift]]
            ),
            np.concatenate([pose_sigmas(config), facade.plane_sigma]),
            PoseMotion.of(panoramas[one.source], facade.grid),
            in_metres(one.grid_from_view, facade.grid),
            _root(one, facade.grid),
        )
        for k, (facade, drift) in enumerate(zip(facades, unknowns.drifts, strict=True))
        for one in facade.registrations
        if one.used
    ]


def _root(one: Registration, grid: FacadeGrid) -> FloatArray:
    """Square root (8, 8) of what is known of a motion, in units of `FLOOR`.

    Matches by the hundred would tell a motion to millimetres; walls that bulge and mouldings that
    stand out err alike in all of them, by as much as the view's matches miss one another.
    """
    if one.information is None or one.residual_after_px is None:
        return np.eye(len(FLOOR))
    spread = max(1.0, MISSES * one.residual_after_px * grid.m_per_px / FLOOR[0])
    values, vectors = np.linalg.eigh(one.information * np.outer(FLOOR, FLOOR))
    values = np.maximum(values, 0.0)
    root: FloatArray = (vectors * np.sqrt(values / (1 + spread**2 * values))) @ vectors.T
    return root


def _step(sightings: Sequence[_Sighting], unknowns: _Unknowns, state: FloatArray) -> FloatArray:
    """Gauss-Newton step of all unknowns."""
    precision = np.ones(unknowns.size)
    for at in unknowns.poses.values():
        precision[at] = 1 / (1 + state[at] @ state[at] / POSE)
    for at in unknowns.drifts:
        precision[at] = DRIFT_SIGMA**-2
    undo = [np.linalg.inv(motion_matrix(state[at])) for at in unknowns.drifts]
    gradient = precision * state
    rows, columns, values = [], [], []
    for one in sightings:
        errors = state[one.slots[: POSE + PLANE]] * one.sigmas
        found = one.motion.parameters(undo[one.facade] @ one.observed)
        residual = one.root @ ((one.motion(errors) - found) / FLOOR)
        by_errors = one.motion.slopes(errors, one.sigmas).T
        slope = one.root @ (np.hstack([by_errors, np.eye(DRIFT)]) / FLOOR[:, None])
        weight = 1 / (1 + residual @ residual / len(FLOOR))
        gradient[one.slots] += weight * (slope.T @ residual)
        values.append((weight * slope.T @ slope).ravel())
        rows.append(np.repeat(one.slots, len(one.slots)))
        columns.append(np.tile(one.slots, len(one.slots)))
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
