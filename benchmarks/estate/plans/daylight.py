"""The light of an estate: date, hour and clouds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from benchmarks.estate.drawing import pick
from benchmarks.estate.plan import Building, Light
from benchmarks.estate.plans.sight import seen_shares
from benchmarks.estate.sun import rough_sun

from si3fp.geometry.enu import GeoOrigin


def light_on(
    buildings: Sequence[Building],
    driven: Sequence[Sequence[tuple[float, float]]],
    origin: GeoOrigin,
    rng: np.random.Generator,
) -> Light:
    """Date, hour and clouds: mostly dull, and where the sun shines it lights the walls seen."""
    day, month = int(rng.integers(1, 29)), int(rng.integers(5, 10))
    weather = rng.random()
    low, high = (0.8, 1.0) if weather < 0.5 else (0.45, 0.7) if weather < 0.75 else (0.05, 0.3)
    hours = np.arange(7.0, 14.51, 0.5)
    sun = np.array([rough_sun(month, day, float(hour), origin)[:2] for hour in hours])
    lit = np.zeros(len(hours))
    shares = seen_shares(buildings, driven)
    for building in buildings:
        for wall in building.walls:
            outward = wall.world_from_facade.rotation[:2, 2]
            lit += shares[wall.id] * wall.width_m * np.clip(sun @ outward, 0.0, 0.6)
    good = hours[lit >= 0.75 * lit.max()]
    return Light(
        f"2024-{month:02d}-{day:02d}",
        float(pick(rng, good)),
        round(float(rng.uniform(low, high)), 2),
    )
