"""TABULA archetypes: values, periods, notes, errors."""

import dataclasses
import itertools

import pytest

from si3fp.errors import InputError
from si3fp.thermal.archetypes import OPEN_END_YEAR, _table, archetype, countries


def test_swedish_multi_family_house_of_1970_has_tabulas_values():
    found = archetype("se", 1970, 1950)
    assert found.country == "SE"
    assert found.period == (1961, 1975)
    assert found.name == "SE-1961-1975"
    assert found.u_wall_w_m2k == 0.41  # SE.Wall.ReEx.02.02, multi-family house
    assert found.u_roof_w_m2k == 0.20  # SE.Ceiling.ReEx.02.02
    assert found.u_floor_w_m2k == 0.28  # SE.Floor.ReEx.02.02
    assert found.u_window_w_m2k == 2.22  # SE.Window.ReEx.02.02
    assert found.g_window == 0.8
    assert found.notes == ()


@pytest.mark.parametrize(
    ("year", "first"), [(1700, 0), (1960, 0), (1961, 1961), (1975, 1961), (1976, 1976)]
)
def test_both_ends_of_a_period_belong_to_it(year, first):
    assert archetype("SE", year, 1970).period[0] == first


def test_missing_year_uses_the_default_and_says_so():
    found = archetype("SE", None, 1988)
    assert found.period == (1986, 1995)
    assert any("1988" in note for note in found.notes)


def test_year_after_the_last_class_uses_it_and_says_so():
    found = archetype("SE", 2020, 1970)
    assert found.period == (1996, 2005)
    assert any("2020" in note and "1996-2005" in note for note in found.notes)
    assert archetype("DE", 2024, 1970).notes == ()  # Germany's last class is open


def test_unknown_country_lists_the_known_ones():
    with pytest.raises(InputError, match=r"'XQ'.*AT, BE.*SE"):
        archetype("XQ", 1970, 1970)


@pytest.mark.parametrize("year", [-5, 0, 12345])
def test_impossible_year_is_refused(year):
    with pytest.raises(InputError, match="not a construction year"):
        archetype("SE", year, 1970)


def test_archetypes_are_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        archetype("SE", 1970, 1970).g_window = 0.5


@pytest.mark.parametrize("country", countries())
def test_every_country_is_complete_without_gaps_and_plausible(country):
    periods = sorted(_table()[country])
    assert periods[0][0] == 0
    for earlier, later in itertools.pairwise(periods):
        assert later[0] == earlier[1] + 1
    assert periods[-1][1] == OPEN_END_YEAR or periods[-1][1] >= 2005
    for first, _ in periods:
        found = archetype(country, max(first, 1), 1970)
        for element in ("wall", "roof", "floor", "window"):
            assert 0.05 <= getattr(found, f"u_{element}_w_m2k") <= 7.0
        assert 0.3 <= found.g_window <= 0.9
        # The envelope must be buildable: layers remain when the surface resistances are taken off.
        assert 1 / found.u_wall_w_m2k > 0.17
