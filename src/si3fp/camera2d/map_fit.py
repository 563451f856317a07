"""North, place and, where wanted, scale of a levelled reconstruction from its cameras' GPS (C.2).

Only seen from above: heights by GPS are poor, and photos along a street leave the turn about the
street open. The vertical is known better from the cameras and the walls.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from si3fp.errors import InputError
from si3fp.geometry.rigid import FloatArray

_HUBER_SIGMAS = 2.0
_REWEIGHTINGS = 50
_MIN_CENTRES = 3  # two fit always


@dataclass(frozen=True, slots=True, eq=False)
class MapFit:
    """A turn, a shift and a scale that lay points seen from above on the map.

    Attributes
    ----------
    scale
        Metres per unit, and its standard deviation.
    sigma_scale
        Zero where the scale was given.
    heading_deg
        Compass bearing of the y axis of the points' frame.
    heading_sigma_deg
        Its standard deviation.
    offset_m
        (2,) east and north of the origin of the points' frame.
    centre_sigma_m
        Standard deviation of either coordinate at the middle of the points.
    distances_m
        (N,) of each point on the map from its known place.
    """

    scale: float
    sigma_scale: float
    heading_deg: float
    heading_sigma_deg: float
    offset_m: FloatArray
    centre_sigma_m: float
    distances_m: FloatArray


def fit_to_map(
    points_in_level: ArrayLike,
    points_in_world: ArrayLike,
    sigma_m: float,
    scale: float | None = None,
) -> MapFit:
    """The turn and shift, and the scale where it is not given, with the least squared distances.

    Points more than two standard deviations off count less (Huber weights).

    Parameters
    ----------
    points_in_level
        (N, 2) seen from above, N >= 3.
    points_in_world
        (N, 2) east and north in metres.
    sigma_m
        Standard deviation of a coordinate in the world. The uncertainties take the larger of it
        and what the distances show.
    scale
        Metres per unit where it is known.

    Raises
    ------
    InputError
        If there are fewer than three points, a value is not finite, or all are at one place.

    Notes
    -----
    With points as complex numbers about their means, ``s exp(i a) = sum(w conj(p) q) /
    sum(w |p|^2)``: Umeyama's problem in the plane, without its reflection.
    """
    source, target = (_complex(points) for points in (points_in_level, points_in_world))
    if len(source) != len(target) or len(source) < _MIN_CENTRES:
        raise InputError(
            f"Place and north need {_MIN_CENTRES} photos with a known position, got "
            f"{min(len(source), len(target))}."
        )
    limit_m = _HUBER_SIGMAS * np.sqrt(2) * sigma_m
    weights = np.ones(len(source))
    for _ in range(_REWEIGHTINGS):
        middle, middle_in_world = (weights @ points / weights.sum() for points in (source, target))
        rest, rest_in_world = source - middle, target - middle_in_world
        spread = float(weights @ np.abs(rest) ** 2)
        product = complex(weights @ (rest.conj() * rest_in_world))
        if spread <= 1e-12 * float(weights @ np.abs(source) ** 2) or product == 0:
            raise InputError(
                "All photos have the same position; their GPS tells neither scale nor north."
            )
        found = abs(product) / spread if scale is None else scale
        turn = found * product / abs(product)
        residuals = turn * rest - rest_in_world
        updated = np.minimum(1.0, limit_m / np.maximum(np.abs(residuals), limit_m))
        if np.abs(updated - weights).max() < 1e-6:
            break
        weights = updated
    freedom = max(2 * len(source) - (4 if scale is None else 3), 1)
    observed_m = float(np.sqrt(weights @ np.abs(residuals) ** 2 / freedom))
    sigma = max(sigma_m, observed_m)
    offset = middle_in_world - turn * middle
    return MapFit(
        float(found),
        sigma / float(np.sqrt(spread)) if scale is None else 0.0,
        float(-np.rad2deg(np.angle(turn)) % 360.0),
        float(np.rad2deg(sigma / (found * np.sqrt(spread)))),
        np.array([offset.real, offset.imag]),
        sigma / float(np.sqrt(weights.sum())),
        np.abs(residuals),
    )


def _complex(points: ArrayLike) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
    pairs = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    if not np.isfinite(pairs).all():
        raise InputError("A position seen from above is NaN or infinite; leave the photo out.")
    return np.asarray(pairs[:, 0] + 1j * pairs[:, 1], dtype=np.complex128)
