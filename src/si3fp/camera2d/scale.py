"""Metric scale of a reconstruction from measured distances (C.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from si3fp.errors import InputError
from si3fp.geometry.rigid import FloatArray
from si3fp.model import KnownDistance

TAPE_SIGMA_M = 0.02
_OUTLIER_SIGMAS = 3.0
_GROSS_FRACTION = 0.05  # beyond any tape: exchanged photo names, a slipped digit
_OPTIONS = "give measured distances (--triangle), photos with GPS, or known cameras (--cameras)"


@dataclass(frozen=True, slots=True)
class Side:
    """A measured distance against the scaled reconstruction.

    Attributes
    ----------
    distance
        The distance measured.
    residual_m
        Scaled reconstruction minus measured.
    """

    distance: KnownDistance
    residual_m: float


@dataclass(frozen=True, slots=True)
class MetricScale:
    """Metres per unit of the reconstruction.

    Attributes
    ----------
    m_per_unit
        The scale.
    sigma_m_per_unit
        Its standard deviation from the tape's; larger where a side does not fit. The
        reconstruction's own errors are not in it, except through the residuals.
    sides
        What each distance says.
    outlier
        The side that fits worst, where its residual exceeds three standard deviations; None where
        all fit, or with two sides, which cannot tell who is wrong.
    unused
        Distances of which a point was not reconstructed.
    """

    m_per_unit: float
    sigma_m_per_unit: float
    sides: tuple[Side, ...]
    outlier: Side | None = None
    unused: tuple[KnownDistance, ...] = ()


def scale_from_distances(
    points_in_reconstruction: Mapping[str, ArrayLike],
    distances: Sequence[KnownDistance],
    sigma_m: float = TAPE_SIGMA_M,
) -> MetricScale:
    """The scale that fits measured distances best: ``s = sum(d l) / sum(l^2)``.

    d are the lengths measured and l those in the reconstruction, so that every side has the same
    standard deviation and the scale has ``sigma / sqrt(sum(l^2))``.

    Parameters
    ----------
    points_in_reconstruction
        Position (3,) of each named point: camera centres by photo id, or marked points.
    distances
        Measured distances between them; those with an unknown point are left out and listed.
    sigma_m
        Standard deviation of a measured distance.

    Raises
    ------
    InputError
        If no distance can be used, a position is not finite, two points coincide, or the sides
        contradict each other by more than 5 % of their length.
    """
    if not (np.isfinite(sigma_m) and sigma_m > 0):
        raise InputError(f"The standard deviation of a distance must be positive, got {sigma_m} m.")
    known = [d for d in distances if {d.start, d.end} <= points_in_reconstruction.keys()]
    unused = tuple(d for d in distances if d not in known)
    if not known:
        lost = sorted({p for d in unused for p in (d.start, d.end)} - set(points_in_reconstruction))
        reason = f"{', '.join(lost)} not reconstructed" if unused else "no distance given"
        raise InputError(
            f"The reconstruction has no scale ({reason}): check the names of the photos, or "
            f"{_OPTIONS}."
        )
    length = np.array([_length(points_in_reconstruction, d) for d in known])
    measured = np.array([d.distance_m for d in known])
    scale = float(measured @ length / (length @ length))
    residuals = scale * length - measured
    sides = tuple(Side(d, float(r)) for d, r in zip(known, residuals, strict=True))
    worst, normalised = _worst(length, residuals, sigma_m)
    _require_consistent(sides, worst, normalised, measured, residuals)
    doubtful = normalised > _OUTLIER_SIGMAS
    spread_m = float(np.sqrt(residuals @ residuals / max(len(known) - 1, 1)))
    return MetricScale(
        scale,
        (max(sigma_m, spread_m) if doubtful else sigma_m) / float(np.linalg.norm(length)),
        sides,
        sides[worst] if doubtful and len(known) > 2 else None,
        unused,
    )


def _length(points: Mapping[str, ArrayLike], distance: KnownDistance) -> float:
    ends = np.asarray([points[distance.start], points[distance.end]], dtype=np.float64)
    if ends.shape != (2, 3) or not np.isfinite(ends).all():
        raise InputError(
            f"{distance}: its points are at {ends.tolist()} in the reconstruction; each needs "
            "three finite coordinates."
        )
    length = float(np.linalg.norm(ends[1] - ends[0]))
    if length <= 1e-9 * max(1.0, float(np.abs(ends).max())):
        raise InputError(
            f"{distance}: both points are at the same place in the reconstruction. Choose photos "
            "taken from different places."
        )
    return length


def _worst(length: FloatArray, residuals: FloatArray, sigma_m: float) -> tuple[int, float]:
    """Index of the side that fits worst and its residual in its own standard deviations.

    A residual has the variance ``sigma^2 (1 - l^2 / sum(l^2))`` (Baarda 1968, data snooping).
    """
    if len(length) < 2:
        return 0, 0.0
    share = 1 - length**2 / (length @ length)
    normalised = np.abs(residuals) / (sigma_m * np.sqrt(share))
    worst = int(np.argmax(normalised))
    return worst, float(normalised[worst])


def _require_consistent(
    sides: tuple[Side, ...],
    worst: int,
    normalised: float,
    measured: FloatArray,
    residuals: FloatArray,
) -> None:
    gross = np.abs(residuals) > _GROSS_FRACTION * measured
    if normalised <= _OUTLIER_SIGMAS or not gross.any():
        return
    blame = f"{sides[worst].distance} fits worst" if len(sides) > 2 else "two cannot tell which"
    raise InputError(
        f"The measured distances contradict the reconstruction: {blame}; scaled minus measured: "
        + ", ".join(f"{side.distance} {side.residual_m:+.3f} m" for side in sides)
        + ". Check its photo names and its length, or leave it out."
    )
