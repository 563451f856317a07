"""The StreetView path as a whole: same files twice, resumption, failures that stay local."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.scenes import make_street, write_street

from si3fp import steps
from si3fp.config import StreetConfig
from si3fp.errors import FacadeError, InputError, ReconstructionError
from si3fp.pipeline import run_street
from si3fp.report.map_layer import write_map_layer
from si3fp.report.run_report import write_report
from si3fp.workspace import Workspace


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    folder = tmp_path_factory.mktemp("street")
    write_street(make_street(5, "tiny"), folder)
    return folder


def go(street, out, **options):
    run = run_street(street / "panoramas.geojson", street / "footprints.geojson", out, **options)
    write_map_layer(run)
    write_report(out)
    return run


@pytest.fixture(scope="module")
def first(street, tmp_path_factory):
    out = tmp_path_factory.mktemp("first") / "RUN"
    return go(street, out)


def files_of(root: Path) -> dict[str, bytes]:
    """Every file but the one with times."""
    return {
        str(path.relative_to(root)): path.read_bytes()
        for path in sorted(root.rglob("*"))
        if path.is_file() and path.name != "run.json"
    }


def test_a_run_has_the_files_that_are_promised(first):
    names = files_of(first.workspace.root).keys()
    facade = "facades/house-a-0/"
    for name in (
        "model.hbjson", "buildings/house-a.hbjson", "windows.geojson", "cloud.ply",
        facade + "facade.json", facade + "windows.json", facade + "detections.json",
        facade + "ortho.png", facade + "coverage.png", facade + "overlay.png",
    ):  # fmt: skip
        assert name in names
    assert any(name.startswith(facade + "views/") for name in names)


def test_every_json_names_schema_version_config_and_inputs(first):
    for name in ("facade.json", "windows.json", "detections.json"):
        content = json.loads(first.workspace.facade("house-a-0", name).read_text())
        assert content["schema"].startswith("si3fp/")
        assert content["si3fp_version"]
        assert content["config"]["seed"] == 0
        assert all(len(sha256) == 64 for sha256 in content["inputs"].values())
        # Poses come from the list of panoramas, the wall from the footprints.
        assert {
            "panoramas.geojson (panoramas)", "footprints.geojson (footprints)",
            "pano-00 image", "pano-00 plane map",
        } <= content["inputs"].keys()  # fmt: skip


def test_the_same_input_gives_the_same_files(street, first, tmp_path):
    second = go(street, tmp_path / "RUN")
    assert files_of(second.workspace.root) == files_of(first.workspace.root)


@pytest.mark.parametrize("cut_after", [("views", 1), ("views", 3), ("facades", 1)])
def test_a_run_that_is_cut_off_continues_to_the_same_files(street, first, tmp_path, cut_after):
    def cut(step, done, total):
        if (step, done) == cut_after:
            raise KeyboardInterrupt

    out = tmp_path / "RUN"
    with pytest.raises(KeyboardInterrupt):
        go(street, out, progress=cut)
    assert not (out / "model.hbjson").exists()
    resumed = go(street, out)
    assert files_of(resumed.workspace.root) == files_of(first.workspace.root)


def test_finished_steps_are_not_done_again(street, first, tmp_path, monkeypatch):
    out = tmp_path / "RUN"
    shutil.copytree(first.workspace.root, out)

    def refuse(*_):
        raise AssertionError("decoded again")

    monkeypatch.setattr(steps.rectified, "image_loader", lambda *_: refuse)
    monkeypatch.setattr(steps.facades, "align_views", refuse)
    go(street, out)
    assert files_of(out) == files_of(first.workspace.root)


def test_a_folder_of_another_run_is_not_touched(street, first, tmp_path):
    out = tmp_path / "RUN"
    shutil.copytree(first.workspace.root, out)
    other = replace(StreetConfig(), seed=1)
    with pytest.raises(InputError, match=r"another folder with -o, or .*--overwrite"):
        go(street, out, config=other)
    assert files_of(out) == files_of(first.workspace.root)
    go(street, out, config=other, overwrite=True)


def test_other_columns_are_another_run(street, first, tmp_path):
    out = tmp_path / "RUN"
    shutil.copytree(first.workspace.root, out)
    with pytest.raises(InputError, match="holds a run of other inputs"):
        go(street, out, columns={"height_m": "ground_m"})


def test_lists_of_the_same_name_are_told_apart(street, tmp_path):
    cameras, houses = tmp_path / "cameras", tmp_path / "houses"
    shutil.copytree(street, cameras)
    houses.mkdir()
    shutil.copy(street / "footprints.geojson", houses / "map.geojson")
    (cameras / "panoramas.geojson").rename(cameras / "map.geojson")
    lists = cameras / "map.geojson", houses / "map.geojson"
    before = steps.collect(*lists, StreetConfig())
    lists[0].write_text(lists[0].read_text() + "\n")
    after = steps.collect(*lists, StreetConfig())
    assert after.hashes != before.hashes


def test_a_courtyard_that_is_left_out_is_said(street, tmp_path):
    houses = json.loads((street / "footprints.geojson").read_text())
    rings = houses["features"][0]["geometry"]["coordinates"]
    outer = np.array(rings[0])
    rings.append((outer.mean(axis=0) + 0.3 * (outer - outer.mean(axis=0)))[::-1].tolist())
    path = tmp_path / "footprints.geojson"
    path.write_text(json.dumps(houses))
    notes = steps.collect(street / "panoramas.geojson", path, StreetConfig()).notes
    assert any("house-a: 1 courtyard is filled" in note for note in notes)


def test_a_folder_of_other_files_is_never_replaced(street, tmp_path):
    out = tmp_path / "RUN"
    (out / "buildings").mkdir(parents=True)
    (out / "buildings" / "mine.txt").write_text("mine")
    for overwrite in (False, True):
        with pytest.raises(InputError, match="not of a run"):
            go(street, out, overwrite=overwrite)
    assert (out / "buildings" / "mine.txt").read_text() == "mine"


def test_a_finished_run_is_known_without_its_cache(street, first, tmp_path, monkeypatch):
    def refuse(*_):
        raise AssertionError("decoded again")

    out = tmp_path / "RUN"
    shutil.copytree(first.workspace.root, out)
    shutil.rmtree(out / "cache")
    monkeypatch.setattr(steps.rectified, "image_loader", lambda *_: refuse)
    go(street, out)
    kept = {n: c for n, c in files_of(first.workspace.root).items() if not n.startswith("cache/")}
    assert {n: c for n, c in files_of(out).items() if not n.startswith("cache/")} == kept


def test_one_facades_failure_is_a_missing_row_and_costs_nothing_else(street, tmp_path, monkeypatch):
    def fail(*_):
        raise FacadeError("the wall is a mirror")

    monkeypatch.setattr(steps.facades, "crop_to_facade", fail)
    with pytest.raises(ReconstructionError, match="the wall is a mirror"):
        go(street, tmp_path / "RUN")  # it was the only facade
    about = json.loads((tmp_path / "RUN" / "run.json").read_text())
    rows = {row["facade_id"]: row for row in about["missing"]}
    assert rows["house-a-0"] == {
        "facade_id": "house-a-0", "step": "facade_box", "reason": "the wall is a mirror",
    }  # fmt: skip
    assert rows["house-a-1"]["step"] == "coverage"


def test_a_wall_of_which_no_picture_shows_enough_was_not_seen(street, tmp_path):
    dark = tmp_path / "street"
    shutil.copytree(street, dark)
    for image in (dark / "panoramas").iterdir():
        pixels = cv2.imread(str(image))
        cv2.imwrite(str(image), np.zeros_like(pixels))
    with pytest.raises(ReconstructionError, match="No facade was found"):
        go(dark, tmp_path / "RUN")
    missing = json.loads((tmp_path / "RUN" / "run.json").read_text())["missing"]
    assert {row["step"] for row in missing} == {"coverage"}
    (reason,) = [row["reason"] for row in missing if row["facade_id"] == "house-a-0"]
    assert "of 3 panoramas none shows 5% of it" in reason


def test_without_footprints_walls_become_faces_without_a_building(street, tmp_path):
    run = run_street(street / "panoramas.geojson", None, tmp_path / "RUN")
    assert not run.buildings
    assert run.loose_facades[0].id.startswith("wall-")
    model = json.loads(run.workspace.model.read_text())
    assert model["rooms"] == []
    assert model["orphaned_faces"][0]["face_type"] == "Wall"


def test_windows_lie_in_their_wall_and_near_the_truth(street, first):
    truth = json.loads((street / "truth.json").read_text())["facades"]["house-a-0"]
    (facade,) = first.buildings[0].facades
    assert len(facade.windows) == len(truth["windows"])
    for window in facade.windows:
        assert 0 <= window.x_m < window.x_m + window.width_m <= facade.width_m
        assert 0 <= window.y_m < window.y_m + window.height_m <= facade.height_m
        assert len(window.views) >= 1
        gap = min(
            np.hypot(
                window.x_m + window.width_m / 2 - true["x_m"] - true["width_m"] / 2,
                window.y_m + window.height_m / 2 - true["y_m"] - true["height_m"] / 2,
            )
            for true in truth["windows"]
        )
        assert gap < 0.4  # three panoramas with 0.15 m and 0.3 degrees of pose noise


def test_facade_json_places_the_facade_on_earth(first):
    record = json.loads(first.workspace.facade("house-a-0", "facade.json").read_text())
    origin, centre = record["origin"], record["centre"]
    assert abs(centre["lat_deg"] - origin["lat_deg"]) < 0.001
    assert abs(centre["lon_deg"] - origin["lon_deg"]) < 0.001
    assert record["m_per_px"] >= 0.02
    assert record["grid_px"][0] * record["m_per_px"] == pytest.approx(record["width_m"])


def test_the_run_knows_its_facades(first):
    assert Workspace(first.workspace.root).facade_ids() == ["house-a-0"]
