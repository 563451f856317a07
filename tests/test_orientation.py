"""A model whose north is unknown is turned, not guessed."""

from __future__ import annotations

import json

import numpy as np
import pytest

from si3fp.config import ThermalConfig
from si3fp.errors import InputError
from si3fp.evaluate import facades_from_hbjson
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Facade, GeoOrigin, Window
from si3fp.steps import simulate_run
from si3fp.thermal.assemble import assemble
from si3fp.thermal.orientation import north_is_known, turned
from si3fp.workspace import Workspace

# Outward normal along -y: the facade looks where the model's y axis comes from.
LOOKS_BACK = Rigid3(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), np.array([2.0, 3.0, 0.0]))
WALL = Facade("wall-1", LOOKS_BACK, 8.0, 6.0, (Window(1.0, 1.0, 1.2, 1.5),))


def model(origin):
    return assemble([], {}, ThermalConfig(), [WALL], origin=origin).hbjson


def test_a_model_without_a_place_says_so():
    assert not north_is_known(model(None))
    assert model(None)["user_data"]["si3fp"]["origin"] is None
    assert north_is_known(model(GeoOrigin(57.7, 11.97, 3.0)))


@pytest.mark.parametrize(
    ("north_deg", "normal"), [(0, [0, -1, 0]), (90, [-1, 0, 0]), (180, [0, 1, 0])]
)
def test_the_y_axis_turns_to_the_bearing(north_deg, normal):
    # With y towards east (90), what looked along -y looks west.
    moved = turned(model(None), north_deg)
    _, (facade,) = facades_from_hbjson(moved)
    np.testing.assert_allclose(facade.world_from_facade.rotation[:, 2], normal, atol=1e-6)
    assert facade.wwr == pytest.approx(WALL.wwr, abs=1e-6)
    assert north_is_known(moved)


def test_simulate_asks_for_north(tmp_path):
    workspace = Workspace(tmp_path)
    workspace.model.write_text(json.dumps(model(None)))
    with pytest.raises(InputError, match=r"--north DEG.*footprints"):
        simulate_run(workspace, tmp_path / "x.epw")


def test_simulate_refuses_a_north_where_it_is_known(tmp_path):
    workspace = Workspace(tmp_path)
    workspace.model.write_text(json.dumps(model(GeoOrigin(57.7, 11.97, 3.0))))
    with pytest.raises(InputError, match="leave out --north"):
        simulate_run(workspace, tmp_path / "x.epw", north_deg=10.0)
