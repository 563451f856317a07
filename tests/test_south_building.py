"""The Camera2D path on real photos of a long building of unknown size, with wings and a bay."""

from __future__ import annotations

import json
import os
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from tests.annotated import align, annotated_facades, annotation, facades_in_truth

from si3fp import steps
from si3fp.config import PhotoConfig
from si3fp.errors import InputError
from si3fp.evaluate import evaluate
from si3fp.pipeline import run_photos
from si3fp.workspace import Workspace

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        "SI3FP_TEST_DATA" not in os.environ,
        reason="needs SI3FP_TEST_DATA, the folder with the photos of South Building",
    ),
]
MOSAIC = PhotoConfig(renderer="mosaic")


@pytest.fixture(scope="module")
def photos():
    return Path(os.environ["SI3FP_TEST_DATA"]) / "south-building" / "photos"


@pytest.fixture(scope="module")
def truth():
    return annotation("south_building_truth.json")


@pytest.fixture(scope="module")
def poses(photos, tmp_path_factory):
    """What structure from motion finds, once for all runs."""
    sources = steps.collect_photos(steps.PhotoFiles(folder=photos, unscaled=True), MOSAIC)
    workspace = Workspace(tmp_path_factory.mktemp("south") / "SFM")
    return steps.find_poses(sources, workspace, MOSAIC, lambda *_: None)


@pytest.fixture(scope="module")
def go(poses, tmp_path_factory):
    def run(files):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(steps, "find_poses", lambda *_: poses)
            return run_photos(files, tmp_path_factory.mktemp("south") / "RUN", MOSAIC)

    return run


@pytest.fixture(scope="module")
def nominal(go, photos, truth, tmp_path_factory):
    """The run at the truth's nominal scale."""
    triangle = tmp_path_factory.mktemp("triangle") / "triangle.json"
    triangle.write_text(json.dumps(truth["triangle"]))
    return go(steps.PhotoFiles(folder=photos, triangle=triangle))


@pytest.fixture(scope="module")
def found(nominal, truth):
    """The run's facades in the truth's frame."""
    alignment = align(nominal.workspace.root, truth["cameras"])
    return facades_in_truth(nominal.workspace.root, alignment)


@pytest.fixture(scope="module")
def result(found, truth):
    return evaluate(found, annotated_facades(truth))


def test_without_a_scale_the_error_names_what_gives_one(photos, tmp_path):
    with pytest.raises(InputError) as error:
        run_photos(steps.PhotoFiles(folder=photos), tmp_path / "RUN", MOSAIC)
    for option in ("--triangle", "GPS", "--cameras", "--unscaled"):
        assert option in str(error.value)


def test_unscaled_there_are_ratios_and_pictures_but_no_model(go, photos, result):
    run = go(steps.PhotoFiles(folder=photos, unscaled=True))
    assert not run.workspace.model.exists()
    true = sorted(row.wwr_found for row in result.facades)
    ratios = sorted(facade.wwr for facade in run.loose_facades)
    assert len(ratios) >= 4
    assert ratios[-3:] == pytest.approx(true[-3:], abs=0.05)  # of the wings, in any units
    for facade in run.loose_facades:
        assert run.workspace.facade(facade.id, "ortho.png").exists()


def test_cameras_stand_where_they_stood(nominal, truth):
    alignment = align(nominal.workspace.root, truth["cameras"])
    assert alignment.rms_m <= 0.1  # the truth's own reconstruction is good to centimetres
    assert alignment.scale == pytest.approx(1.0, abs=0.005)


def test_wings_bay_and_gable_are_facades_of_their_own(result):
    assert all(row.found_id for row in result.facades)
    found = [row.found_id for row in result.facades]
    assert len(set(found)) == len(found) == 4


def test_windows_against_the_annotation(result):
    windows = result.windows_total
    assert windows.f1 >= 0.90
    assert windows.mean_iou >= 0.70
    assert windows.mean_abs_position_error_m <= 0.10


def test_no_window_is_counted_twice(found, result):
    """Seen from the front, no window of a wing covers one of the bay or of the other wing."""
    names = {row.found_id for row in result.facades if row.facade_id != "gable-left"}
    boxes = [
        facade.world_from_facade.apply(
            [
                [window.x_m, window.y_m, 0.0],
                [window.x_m + window.width_m, window.y_m + window.height_m, 0.0],
            ]
        )[:, [0, 2]]  # x along the front, z up
        for facade in found
        if facade.id in names
        for window in facade.windows
    ]
    assert len(boxes) >= 30
    for one, other in combinations(boxes, 2):
        overlap = np.minimum(one[1], other[1]) - np.maximum(one[0], other[0])
        assert (overlap < 0.1).any()
