"""Sizes and side views of cars, and the ground that they take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.estate.plan import Car, FloatArray

CAR_SIZES_M: dict[str, tuple[float, float, float]] = {
    "saloon": (4.60, 1.78, 1.44),
    "estate": (4.68, 1.78, 1.47),
    "hatchback": (4.10, 1.74, 1.46),
    "van": (4.95, 1.92, 1.95),
}
"""Length, width, height."""


@dataclass(frozen=True)
class Shape:
    """Side view of a kind: heights in metres at shares of the length from the nose.

    ``screen`` and ``rear`` are where the windscreen and the rear window begin and end, ``windows``
    the side windows, ``doors`` the gaps of the doors, ``axles`` the wheels.
    """

    top: tuple[tuple[float, float], ...]
    belt: tuple[tuple[float, float], ...]
    screen: tuple[float, float]
    rear: tuple[float, float]
    windows: tuple[tuple[float, float], ...]
    doors: tuple[float, ...]
    axles: tuple[float, float]


_BELT = ((0, 0.60), (0.06, 0.69), (0.26, 0.86), (0.5, 0.90), (0.82, 0.95), (0.97, 0.90), (1, 0.82))
_NOSE = ((0, 0.63), (0.025, 0.71), (0.10, 0.79), (0.20, 0.88), (0.262, 0.925))
SHAPES = {
    "saloon": Shape(
        (
            *_NOSE,
            (0.41, 1.35),
            (0.48, 1.425),
            (0.58, 1.44),
            (0.69, 1.38),
            (0.83, 1.06),
            (0.9, 1.03),
            (0.98, 0.99),
            (1, 0.88),
        ),
        _BELT,
        (0.272, 0.415),
        (0.705, 0.825),
        ((0.315, 0.50), (0.525, 0.685), (0.695, 0.745)),
        (0.285, 0.51, 0.70),
        (0.185, 0.775),
    ),
    "estate": Shape(
        (
            *_NOSE,
            (0.4, 1.36),
            (0.47, 1.44),
            (0.58, 1.47),
            (0.8, 1.45),
            (0.925, 1.38),
            (0.978, 1.02),
            (0.99, 0.96),
            (1, 0.84),
        ),
        _BELT,
        (0.272, 0.405),
        (0.93, 0.977),
        ((0.315, 0.49), (0.515, 0.675), (0.705, 0.90)),
        (0.285, 0.50, 0.69),
        (0.182, 0.765),
    ),
    "hatchback": Shape(
        (
            (0, 0.66),
            (0.025, 0.74),
            (0.1, 0.83),
            (0.19, 0.91),
            (0.245, 0.965),
            (0.4, 1.37),
            (0.48, 1.45),
            (0.6, 1.46),
            (0.78, 1.42),
            (0.89, 1.33),
            (0.965, 1.02),
            (0.985, 0.95),
            (1, 0.8),
        ),
        ((0, 0.63), (0.06, 0.72), (0.25, 0.90), (0.5, 0.93), (0.82, 0.98), (0.97, 0.91), (1, 0.78)),
        (0.255, 0.405),
        (0.895, 0.963),
        ((0.305, 0.51), (0.54, 0.71), (0.745, 0.83)),
        (0.27, 0.525, 0.725),
        (0.185, 0.805),
    ),
    "van": Shape(
        (
            (0, 0.74),
            (0.03, 0.9),
            (0.1, 1.03),
            (0.17, 1.12),
            (0.215, 1.19),
            (0.33, 1.78),
            (0.4, 1.91),
            (0.55, 1.95),
            (0.93, 1.93),
            (0.975, 1.84),
            (0.988, 1.25),
            (0.995, 0.9),
            (1, 0.75),
        ),
        ((0, 0.70), (0.06, 0.86), (0.22, 1.08), (0.5, 1.10), (0.9, 1.10), (0.985, 1.05), (1, 0.73)),
        (0.222, 0.335),
        (0.977, 0.987),
        ((0.255, 0.395),),
        (0.24, 0.41, 0.62),
        (0.165, 0.80),
    ),
}


def car_outline(car: Car) -> FloatArray:
    """Corners (4, 2) of the rectangle that a car stands on."""
    length, width, _ = CAR_SIZES_M[car.kind]
    ahead, left = axes_of(car)
    steps = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    return np.array(car.place) + steps[:, :1] * length * ahead + steps[:, 1:] * width * left


def axes_of(car: Car) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (2,) ahead of and to the left of a car."""
    angle = np.deg2rad(car.heading_deg)
    ahead = np.array([np.sin(angle), np.cos(angle)])
    return ahead, np.array([-ahead[1], ahead[0]])
