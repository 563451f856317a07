"""The sun against positions that can be computed by hand."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.estate.sun import direction_of, rough_sun, sun_position_deg

from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin

GOTHENBURG = GeoOrigin(57.7, 11.97, 0.0)


def test_the_sun_at_gothenburg() -> None:
    """Noon heights are 90 - 57.7 +- 23.44 degrees at the solstices (almanac: 2024-06-20, -12-21).

    Local noon is 12 h UTC - 11.97 / 15 h - equation of time (-1.7 min and +2.0 min).
    """
    for date, equation_min, wanted in (("2024-06-20", -1.7, 55.74), ("2024-12-21", 2.0, 8.86)):
        noon = 12 - 11.97 / 15 - equation_min / 60
        azimuth_deg, elevation_deg = sun_position_deg(date, noon, GOTHENBURG)
        assert elevation_deg == pytest.approx(wanted, abs=0.03)
        assert azimuth_deg == pytest.approx(180, abs=0.5)


def test_the_sun_at_the_equinox_rises_in_the_east_and_passes_overhead_at_the_equator() -> None:
    """2024-03-20, 3:06 UTC; the equation of time is -7.4 min."""
    equator = GeoOrigin(0.0, 0.0, 0.0)
    noon = 12 + 7.4 / 60
    assert sun_position_deg("2024-03-20", noon, equator)[1] == pytest.approx(90, abs=0.3)
    azimuth_deg, elevation_deg = sun_position_deg("2024-03-20", noon - 6, equator)
    assert (azimuth_deg, elevation_deg) == (pytest.approx(90, abs=0.2), pytest.approx(0, abs=0.2))


def test_a_date_that_is_none_is_told() -> None:
    with pytest.raises(InputError, match="2024-13-01"):
        sun_position_deg("2024-13-01", 12.0, GOTHENBURG)


def test_the_rough_sun_of_plans_stands_within_three_degrees_of_the_true_one() -> None:
    for month in range(5, 10):
        for day in (1, 14, 28):
            for hour in np.arange(7.0, 14.6, 1.5):
                date = f"2024-{month:02d}-{day:02d}"
                true = direction_of(*sun_position_deg(date, float(hour), GOTHENBURG))
                rough = rough_sun(month, day, float(hour), GOTHENBURG)
                assert np.linalg.norm(rough) == pytest.approx(1)
                assert true @ rough > np.cos(np.deg2rad(3.0))
