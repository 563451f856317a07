"""The StreetView path on real panoramas of a castle court, against windows annotated by eye."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from tests.annotated import annotated_facades, annotation

from si3fp.evaluate import evaluate, facades_from_hbjson
from si3fp.geometry.enu import GeoOrigin
from si3fp.pipeline import run_street

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        "SI3FP_TEST_DATA" not in os.environ,
        reason="needs SI3FP_TEST_DATA, the folder with the castle panoramas",
    ),
]
FACADES = {"wing-a-3", "wing-b-3", "wing-c-3"}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    castle = Path(os.environ["SI3FP_TEST_DATA"]) / "castle"
    return run_street(
        castle / "street" / "panoramas.geojson",
        castle / "footprints.geojson",
        tmp_path_factory.mktemp("castle") / "RUN",
    )


@pytest.fixture(scope="module")
def truth():
    content = annotation("castle_truth.json")
    return GeoOrigin(**content["origin"]), annotated_facades(content)


@pytest.fixture(scope="module")
def result(run, truth):
    origin, facades = facades_from_hbjson(json.loads(run.workspace.model.read_text()))
    return evaluate(facades, truth[1], origin, truth[0])


def test_three_facades_are_found_and_the_others_are_not_seen(run):
    found = {facade.id for building in run.buildings for facade in building.facades}
    assert found == FACADES
    assert run.failed == ()
    assert len(run.missing) == 9


def test_windows_against_the_annotation(result):
    # The paper's StreetView: F1 0.60, mean IoU 0.71, position error 0.165 m.
    assert result.windows.f1 >= 0.90
    assert result.windows.mean_iou >= 0.75
    assert result.windows.mean_abs_position_error_m <= 0.15


def test_window_to_wall_ratio(result):
    assert result.wwr.mean_absolute <= 0.03


def test_eaves_are_where_the_wall_meets_the_cornice(run, truth):
    tops = {facade.id: facade.height_m for facade in truth[1]}
    for building in run.buildings:
        for facade in building.facades:
            top = facade.world_from_facade.translation[2] + facade.height_m
            assert top == pytest.approx(tops[facade.id], abs=0.6)


def test_registration_removes_decimetres(run):
    for name in FACADES:
        views = json.loads(run.workspace.facade(name, "facade.json").read_text())["views"]
        used = [view for view in views if view["used"]]
        assert len(used) >= 10
        before = np.median([view["residual_before_px"] for view in used])
        after = np.median([view["residual_after_px"] for view in used])
        assert before > 5
        assert after < 2
