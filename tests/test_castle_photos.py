"""The Camera2D path on real photos of a castle court, against published cameras and annotation."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from tests.annotated import align, annotated_facades, annotation, facades_in_truth

from si3fp import steps
from si3fp.config import PhotoConfig
from si3fp.evaluate import evaluate
from si3fp.geometry.enu import GeoOrigin, world_from_geodetic
from si3fp.pipeline import run_photos
from si3fp.sources.colmap_text import read_colmap_text

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        "SI3FP_TEST_DATA" not in os.environ,
        reason="needs SI3FP_TEST_DATA, the folder with the castle photos",
    ),
]
FACADES = {"wing-a-3", "wing-b-3", "wing-c-3"}


@pytest.fixture(scope="module")
def castle():
    return Path(os.environ["SI3FP_TEST_DATA"]) / "castle"


@pytest.fixture(scope="module")
def files(castle):
    return steps.PhotoFiles(
        folder=castle / "photos",
        triangle=castle / "reference_triangle.json",
        footprints=castle / "footprints.geojson",
    )


@pytest.fixture(scope="module")
def photos_alone(files, tmp_path_factory):
    """The run with the radiance field, and what structure from motion found in it."""
    found = []
    real = steps.find_poses

    def noted(*arguments):
        found.append(real(*arguments))
        return found[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(steps, "find_poses", noted)
        out = tmp_path_factory.mktemp("castle") / "RUN"
        return run_photos(files, out, PhotoConfig(renderer="radiance")), found[0]


@pytest.fixture(scope="module")
def run(photos_alone):
    return photos_alone[0]


@pytest.fixture(scope="module")
def mosaic(files, photos_alone, tmp_path_factory):
    """The same poses with photos blended on the walls' planes."""
    out = tmp_path_factory.mktemp("mosaic") / "RUN"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(steps, "find_poses", lambda *_: photos_alone[1])
        return run_photos(files, out, PhotoConfig(renderer="mosaic"))


@pytest.fixture(scope="module")
def true_centres(castle):
    """Published centres by photo, in the annotation's frame: see tests/data/README.md."""
    published = {p.id: p.centre_in_world for p in read_colmap_text(castle / "cameras").photos}
    origin = GeoOrigin(**annotation("castle_truth.json")["origin"])
    features = json.loads((castle / "street" / "panoramas.geojson").read_text())["features"]
    panoramas = {}
    for feature in features:
        lon, lat, height = feature["geometry"]["coordinates"]
        panoramas[feature["properties"]["id"]] = world_from_geodetic([lat, lon, height], origin)
    pairs = zip(sorted(published), sorted(panoramas), strict=True)  # one panorama from each photo
    shift = np.mean([panoramas[there] - published[here] for here, there in pairs], axis=0)
    return {name: centre + shift for name, centre in published.items()}


@pytest.fixture(scope="module")
def alignment(run, true_centres):
    return align(run.workspace.root, true_centres)


def scores(run, alignment):
    truth = annotated_facades(annotation("castle_truth.json"))
    return evaluate(facades_in_truth(run.workspace.root, alignment), truth)


def test_photos_are_registered_where_they_were_taken(run, alignment):
    rows = json.loads(run.workspace.run_json.read_text())["photos"]
    assert sum("position_in_world" in row for row in rows) >= 29
    assert alignment.rms_m <= 0.05
    assert alignment.scale == pytest.approx(1.0, abs=0.005)


def test_the_court_lies_on_its_footprints(run, true_centres):
    about = json.loads(run.workspace.run_json.read_text())
    assert about["north_known"]
    origin = GeoOrigin(**about["origin"])
    truth = GeoOrigin(**annotation("castle_truth.json")["origin"])
    here = world_from_geodetic([truth.lat_deg, truth.lon_deg, truth.height_m], origin)[:2]
    gaps = [
        np.subtract(row["position_in_world"][:2], here) - true_centres[row["id"]][:2]
        for row in about["photos"]
        if "position_in_world" in row
    ]
    assert np.linalg.norm(np.mean(gaps, axis=0)) < 0.3  # footprints are drawn to decimetres


def test_three_facades_are_found_and_the_others_are_not_seen(run):
    assert {facade.id for building in run.buildings for facade in building.facades} == FACADES
    assert run.failed == ()


def test_windows_against_the_annotation(run, alignment):
    # The paper's Camera2D: F1 0.76, mean IoU 0.78, position error 0.095 m.
    result = scores(run, alignment)
    assert result.windows_total.f1 >= 0.95
    assert result.windows_total.mean_iou >= 0.85
    assert result.windows_total.mean_abs_position_error_m <= 0.07
    assert result.wwr.mean_absolute <= 0.02


def test_depth_tells_how_deep_windows_lie(run):
    for name, truth in annotation("castle_truth.json")["facades"].items():
        windows = json.loads(run.workspace.facade(name, "windows.json").read_text())["windows"]
        found_m = [w["recess_m"] for w in windows if w["recess_m"] is not None]
        true_m = np.median([w["recess_m"] for w in truth["windows"]])
        assert len(found_m) > len(windows) / 2
        assert np.median(found_m) == pytest.approx(true_m, abs=0.03)


def test_a_photo_left_out_is_predicted(run):
    for name in FACADES:
        record = json.loads(run.workspace.facade(name, "facade.json").read_text())
        assert record["held_out_psnr_db"] >= 22


def test_windows_of_the_mosaic_against_the_annotation(mosaic, alignment):
    # Frames appear displaced by the recess, and their lower edges are hidden by the sills.
    result = scores(mosaic, alignment)
    assert result.windows_total.f1 >= 0.90
    assert result.windows_total.mean_iou >= 0.80
    assert result.windows_total.mean_abs_position_error_m <= 0.10
    assert result.wwr.mean_absolute <= 0.02
