"""Metres per unit of a reconstruction, from what the user has: distances, GPS, or neither (C.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from si3fp.camera2d.map_fit import MapFit, fit_to_map
from si3fp.camera2d.placed import ScaledBy
from si3fp.camera2d.scale import MetricScale, Side, scale_from_distances
from si3fp.config import WorldConfig
from si3fp.errors import InputError, ReconstructionError
from si3fp.geometry.rigid import FloatArray
from si3fp.model import KnownDistance

_GROSS_SIGMAS = 3.0
_KNOWN_SHARE = 0.05  # by which distances may differ from known cameras: beyond any tape


@dataclass(frozen=True, slots=True)
class ChosenScale:
    """The scale and what it rests on.

    Attributes
    ----------
    m_per_unit, sigma_m_per_unit
        Scale and its standard deviation, 0 where the units stay arbitrary.
    scaled_by
        "nothing" where the units stay arbitrary.
    sides
        What each measured distance says.
    fact, notes
        How it was found, and what to check, in words.
    """

    m_per_unit: float
    sigma_m_per_unit: float
    scaled_by: ScaledBy
    sides: tuple[Side, ...]
    fact: str
    notes: tuple[str, ...]


def choose_scale(
    centres: Mapping[str, FloatArray],
    distances: Sequence[KnownDistance],
    plan: Mapping[str, FloatArray],
    places: Mapping[str, FloatArray],
    unscaled: float | None,
    config: WorldConfig,
) -> ChosenScale:
    """The scale by measured distances, else by GPS, else the one for arbitrary units.

    Parameters
    ----------
    centres
        Optical centres (3,) by photo id, in units of the reconstruction.
    distances
        Measured between them.
    plan
        The centres (2,) seen from above.
    places
        East and north (2,) of those with GPS.
    unscaled
        Metres per unit to take where nothing tells it; None where that is an error.
    config
        Limits.

    Raises
    ------
    InputError
        If distances contradict the reconstruction or the GPS.
    ReconstructionError
        If nothing tells the scale and ``unscaled`` is None.
    """
    by_tape = None
    if distances:
        by_tape = scale_from_distances(centres, distances, config.tape_sigma_m)
    by_gps, why_not = _gps_scale(plan, places, config)
    if by_tape is not None:
        notes = [*tape_notes(by_tape), *_agreement(by_tape, by_gps, config)]
        scale, sigma = by_tape.m_per_unit, by_tape.sigma_m_per_unit
        return ChosenScale(
            scale, sigma, "distances", by_tape.sides, _tape_fact(by_tape), tuple(notes)
        )
    if by_gps is not None:
        fact = (
            f"Scale: {by_gps.scale:.4g} +- {by_gps.sigma_scale:.2g} m per unit "
            f"({by_gps.sigma_scale / by_gps.scale:.1%}), by the GPS of {len(places)} photos."
        )
        note = "The scale rests on GPS alone; a measured distance (--triangle) is far better."
        return ChosenScale(by_gps.scale, by_gps.sigma_scale, "GPS", (), fact, (note,))
    if unscaled is None:
        raise ReconstructionError(
            f"The reconstruction has no scale: no measured distances are given, and {why_not}. "
            "Give measured distances (--triangle FILE), photos with GPS, or known cameras "
            "(--cameras DIR); or go on without metres (--unscaled), to window-to-wall ratios and "
            "pictures but no thermal model."
        )
    note = (
        "The size of the building is not known: a typical distance from camera to wall counts as "
        f"{config.unscaled_distance_m:g} m. Ratios hold, such as that of window to wall; lengths "
        "and areas do not."
    )
    return ChosenScale(unscaled, 0.0, "nothing", (), "Scale: arbitrary.", (note,))


def tape_notes(scale: MetricScale) -> list[str]:
    """What to check about measured distances."""
    notes = []
    if scale.outlier is not None:
        side = scale.outlier
        notes.append(
            f"The distance {side.distance} fits worst: it is {abs(side.residual_m):.3f} m "
            f"{'longer' if side.residual_m > 0 else 'shorter'} in the model. Measure it again."
        )
    if scale.unused:
        lost = "; ".join(map(str, scale.unused))
        notes.append(f"Distances whose photos were not reconstructed are not used: {lost}.")
    return notes


def require_metres(scale: MetricScale) -> None:
    """Raise `InputError` where measured distances contradict the metres of known cameras."""
    off = abs(scale.m_per_unit - 1)
    if off > max(_KNOWN_SHARE, _GROSS_SIGMAS * scale.sigma_m_per_unit):
        raise InputError(
            "The measured distances (--triangle) contradict the known cameras (--cameras): by them "
            f"one unit of the cameras is {scale.m_per_unit:.3g} m. Give the cameras in metres, or "
            "leave one of the two out."
        )


def _tape_fact(scale: MetricScale) -> str:
    worst = max(abs(side.residual_m) for side in scale.sides)
    return (
        f"Scale: {scale.m_per_unit:.4g} +- {scale.sigma_m_per_unit:.2g} m per unit "
        f"({scale.sigma_m_per_unit / scale.m_per_unit:.2%}), by {len(scale.sides)} measured "
        f"distances, which the model fits within {100 * worst:.1f} cm."
    )


def _gps_scale(
    plan: Mapping[str, FloatArray], places: Mapping[str, FloatArray], config: WorldConfig
) -> tuple[MapFit | None, str]:
    """The fit of the scale by GPS, or why there is none."""
    if not places:
        return None, "the reconstructed photos have no GPS"
    try:
        fit = fit_to_map([plan[name] for name in places], list(places.values()), config.gps_sigma_m)
    except InputError as error:
        return None, f"GPS gives none ({str(error).rstrip('.')})"
    if fit.sigma_scale > config.max_scale_sigma * fit.scale:
        return None, (
            f"the GPS of {len(places)} photos spans too little for its accuracy of "
            f"{config.gps_sigma_m:g} m (it would be uncertain by {fit.sigma_scale / fit.scale:.0%})"
        )
    return fit, ""


def _agreement(tape: MetricScale, gps: MapFit | None, config: WorldConfig) -> list[str]:
    """How far GPS and distances agree.

    Raises
    ------
    InputError
        If they differ by more than a factor that neither explains.
    """
    if gps is None:
        return []
    ratio = gps.scale / tape.m_per_unit
    sigma = gps.sigma_scale / tape.m_per_unit
    off = float(np.exp(abs(np.log(ratio))))
    if off > config.max_scale_factor and abs(ratio - 1) > _GROSS_SIGMAS * sigma:
        raise InputError(
            f"Measured distances and GPS contradict each other: by GPS the building is {ratio:.2f} "
            f"+- {sigma:.2f} times as large. Check the unit of the distances (metres) and their "
            "photo names, or leave the distances out."
        )
    return [
        f"By GPS the building would be {ratio:.2f} +- {sigma:.2f} times as large as by the "
        "measured distances, which are used."
    ]
