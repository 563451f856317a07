"""From a footprint and its facades to a building: ground, height and storeys, and why."""

import numpy as np
import pytest

from si3fp.config import ThermalConfig
from si3fp.model import Facade, Footprint, GeoOrigin, Rigid3, Window
from si3fp.thermal.building import make_building

BOX = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 8.0], [0.0, 8.0]])
FRONT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def facade(height_m, rows=(), width_m=10.0, base_z_m=0.0, edge=0):
    """A facade with two windows in each row; a row is the height of its windows' centres."""
    windows = tuple(Window(x, y - 0.6, 1.0, 1.2) for y in rows for x in (1.0, 4.0))
    pose = Rigid3(FRONT, np.array([0.0, 0.0, base_z_m]))
    return Facade(f"b-{edge}", pose, width_m, height_m, windows)


def built(facades=(), default_height_m=9.0, **attributes):
    footprint = Footprint("b", BOX, **attributes)
    origin = GeoOrigin(57.7, 12.0, 0.0)
    return make_building(footprint, facades, (), origin, default_height_m, ThermalConfig())


def test_the_eaves_of_the_facades_decide_the_height_by_their_width():
    # Two blank gables at the mapped height do not pull the front, which is wider than both.
    facades = [facade(8.0, edge=1), facade(12.0, width_m=30.0), facade(8.2, edge=3)]
    building, notes = built(facades, ground_m=0.5, height_m=8.0)
    assert building.base_z_m == 0.5
    assert building.height_m == pytest.approx(12.0 - 0.5)
    assert any("eaves of 3 facades" in note for note in notes)


def test_without_facades_the_footprint_and_then_the_default_give_the_height():
    building, notes = built(height_m=7.0)
    assert building.height_m == 7.0
    assert "height from the footprint" in notes
    building, notes = built(default_height_m=9.0)
    assert building.height_m == 9.0
    assert any("height assumed 9 m" in note for note in notes)


def test_the_storeys_of_the_map_are_taken():
    building, notes = built([facade(9.0, rows=(1.5, 4.5, 7.5))], storeys=2)
    assert building.storeys == 2
    assert not any("storeys" in note for note in notes)


def test_storeys_of_the_map_that_nobody_could_stand_in_are_not_taken():
    building, notes = built([facade(6.4, rows=(1.5, 4.7))], storeys=50)
    assert building.storeys == 2
    assert any("50 storeys" in note and "0.13 m" in note for note in notes)


def test_rows_of_windows_count_storeys_where_the_height_agrees():
    assert built([facade(8.0, rows=(1.5, 4.2))])[0].storeys == 2  # by height it would be 3
    assert built([facade(12.0, rows=(1.5,))])[0].storeys == 4  # blind storeys are storeys
    assert built([facade(8.9)])[0].storeys == 3
