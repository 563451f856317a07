"""The Camera2D path as a whole: same files twice, resumption, failures that stay local."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import cv2
import honeybee_schema.model as honeybee
import numpy as np
import pytest
from tests.scenes.photos import make_photos, write_photos

from si3fp import steps
from si3fp.config import OrthoConfig, PhotoConfig, RadianceConfig
from si3fp.errors import FacadeError, InputError, ReconstructionError
from si3fp.evaluate import evaluate, facades_from_hbjson
from si3fp.model import Missing
from si3fp.pipeline import run_photos
from si3fp.report.map_layer import write_map_layer
from si3fp.report.run_report import write_report
from si3fp.sources.colmap_text import read_colmap_text
from si3fp.steps.photo_scene import Poses

FINE = PhotoConfig(renderer="mosaic")
COARSE = replace(FINE, ortho=OrthoConfig(m_per_px=0.05))
FRONT, GABLE = "house-a-0", "house-a-1"
NORTH_ARROW, SCALE_BAR = ">N</text>", r">\d+\sm</text>"
FRONT_PHOTOS = [f"p{n}.jpg" for n in range(6)]


@pytest.fixture(scope="module")
def house():
    return make_photos()


@pytest.fixture(scope="module")
def folder(house, tmp_path_factory):
    path = tmp_path_factory.mktemp("house")
    write_photos(house, path)
    return path


@pytest.fixture(scope="module")
def on_map(house, folder):
    """Everything known: cameras with their origin, footprints."""
    return steps.PhotoFiles(
        folder=folder / "photos",
        cameras=folder / "cameras",
        camera_origin=house.origin,
        footprints=folder / "footprints.geojson",
    )


@pytest.fixture
def reconstructed(folder, monkeypatch):
    """Structure from motion with a result that is known, in a frame and scale of its own."""
    model = read_colmap_text(folder / "cameras")
    monkeypatch.setattr(steps, "find_poses", lambda *_: Poses(model, {}))


def go(files, out, config=FINE, **options):
    run = run_photos(files, out, config, **options)
    write_map_layer(run)
    write_report(out)
    return run


@pytest.fixture(scope="module")
def first(on_map, tmp_path_factory):
    return go(on_map, tmp_path_factory.mktemp("first") / "RUN")


def files_of(root: Path) -> dict[str, bytes]:
    """Every file but the one with times."""
    return {
        str(path.relative_to(root)): path.read_bytes()
        for path in sorted(root.rglob("*"))
        if path.is_file() and path.name != "run.json"
    }


def about(run_or_folder) -> dict:
    root = run_or_folder if isinstance(run_or_folder, Path) else run_or_folder.workspace.root
    return json.loads((root / "run.json").read_text())


def test_a_run_has_the_files_that_are_promised(first):
    names = files_of(first.workspace.root).keys()
    expected = {
        "model.hbjson", "buildings/house-a.hbjson", "windows.geojson", "cloud.ply", "report.html",
    } | {
        f"facades/{facade}/{name}"
        for facade in (FRONT, GABLE)
        for name in ("facade.json", "windows.json", "detections.json", "ortho.png",
                     "coverage.png", "overlay.png")
    }  # fmt: skip
    assert expected <= names
    assert any(name.startswith(f"facades/{FRONT}/views/") for name in names)
    assert first.workspace.run_json.exists()


def test_every_json_names_schema_version_config_and_inputs(first):
    for name in ("facade.json", "windows.json", "detections.json"):
        content = json.loads(first.workspace.facade(FRONT, name).read_text())
        assert content["schema"].startswith("si3fp/")
        assert content["si3fp_version"]
        assert content["config"]["renderer"] == "mosaic"
        assert all(len(sha256) == 64 for sha256 in content["inputs"].values())
        assert {
            "p0.jpg (photo)", "cameras.txt (cameras)", "images.txt (cameras)",
            "points3D.txt (cameras)", "footprints.geojson (footprints)",
        } <= content["inputs"].keys()  # fmt: skip


def test_windows_against_the_truth(house, first):
    origin, found = facades_from_hbjson(json.loads(first.workspace.model.read_text()))
    seen = [facade for facade in house.truth if facade.id in (FRONT, GABLE)]
    result = evaluate(found, seen, origin, house.origin).windows_total
    assert result.f1 == 1.0
    assert result.mean_iou >= 0.85
    assert result.mean_abs_position_error_m <= 0.03  # a pixel and a half


def test_what_no_photo_shows_is_coverage_and_no_failure(first):
    rows = {row.facade_id: row.step for row in first.missing}
    assert rows == {"house-a-2": "coverage", "house-a-3": "coverage"}
    assert first.failed == ()


def test_the_models_are_valid(first):
    for file in (first.workspace.model, first.workspace.building("house-a")):
        content = json.loads(file.read_text())
        honeybee.Model.model_validate(content)
        assert content["rooms"]
        assert content["user_data"]["si3fp"]["origin"]["lat_deg"] == pytest.approx(57.6886)


def test_the_run_tells_which_photos_it_used_and_where_they_stood(house, first):
    rows = {row["id"]: row for row in about(first)["photos"]}
    assert rows.keys() == set(house.images)
    for photo in house.photos:
        assert rows[photo.id]["used"]
        assert rows[photo.id]["position_in_world"] == pytest.approx(photo.centre_in_world, abs=1e-3)
    reconstruction = about(first)["reconstruction"]
    assert reconstruction["scaled_by"] == "cameras"
    assert reconstruction["north_known"]
    assert about(first)["north_known"]


def test_the_report_knows_north_and_metres(first):
    page = first.workspace.report.read_text()
    assert re.search(NORTH_ARROW, page)
    assert re.search(SCALE_BAR, page)
    assert re.search("faces [NESW]", page)


def test_an_interrupted_run_goes_on_to_the_same_files(on_map, first, tmp_path):
    def cut(step, done, total):
        if (step, done) == ("facades", 1):
            raise KeyboardInterrupt

    out = tmp_path / "RUN"
    with pytest.raises(KeyboardInterrupt):
        go(on_map, out, progress=cut)
    assert not (out / "model.hbjson").exists()
    (finished,) = (out / "facades").glob("*/facade.json")
    written = finished.stat().st_mtime_ns
    go(on_map, out)
    assert finished.stat().st_mtime_ns == written
    assert files_of(out) == files_of(first.workspace.root)


@pytest.mark.parametrize("without_cache", [False, True])
def test_finished_facades_are_not_done_again(on_map, first, tmp_path, monkeypatch, without_cache):
    def refuse(*_):
        raise AssertionError("rendered again")

    out = tmp_path / "RUN"
    shutil.copytree(first.workspace.root, out)
    if without_cache:
        shutil.rmtree(out / "cache")
    monkeypatch.setattr(steps.photo_facades, "render_mosaic", refuse)
    go(on_map, out)
    assert files_of(out) == files_of(first.workspace.root)


def test_a_folder_of_another_run_is_not_touched(on_map, folder, first, tmp_path):
    out = tmp_path / "RUN"
    shutil.copytree(first.workspace.root, out)
    others = [
        (replace(on_map, triangle=folder / "triangle.json"), FINE),
        (replace(on_map, camera_origin=replace(on_map.camera_origin, height_m=15.0)), FINE),
        (on_map, replace(FINE, renderer="radiance")),
    ]
    for files, config in others:
        with pytest.raises(InputError, match=r"another folder with -o, or .*--overwrite"):
            go(files, out, config)
    assert files_of(out) == files_of(first.workspace.root)


def test_without_footprints_and_origin_walls_are_faces_of_a_model_without_north(folder, tmp_path):
    files = steps.PhotoFiles(
        folder=folder / "photos", cameras=folder / "cameras", triangle=folder / "triangle.json"
    )
    run = go(files, tmp_path / "RUN", COARSE)
    assert run.buildings == ()
    assert run.origin is None
    assert sorted(facade.id for facade in run.loose_facades) == ["wall-1", "wall-2"]
    content = json.loads(run.workspace.model.read_text())
    honeybee.Model.model_validate(content)
    assert content["rooms"] == []
    assert {face["user_data"]["facade_id"] for face in content["orphaned_faces"]} == {
        "wall-1", "wall-2",
    }  # fmt: skip
    assert content["user_data"]["si3fp"]["north_known"] is False
    assert "lat_deg" not in json.dumps(content["user_data"])
    assert about(run)["north_known"] is False
    assert about(run)["origin"] is None
    assert not (run.workspace.root / "windows.geojson").exists()  # no place on a map
    page = run.workspace.report.read_text()
    assert not re.search(NORTH_ARROW, page)
    assert not re.search("faces [NESW]", page)
    assert re.search(SCALE_BAR, page)
    with pytest.raises(InputError, match=r"--north DEG"):
        steps.simulate_run(run.workspace, tmp_path / "any.epw")


def test_one_facades_failure_is_a_missing_row_and_costs_nothing_else(on_map, tmp_path, monkeypatch):
    real = steps.photo_facades.render_mosaic

    def fail_at_the_gable(plane, *rest):
        if plane.facade_id == GABLE:
            raise FacadeError("the wall is a mirror")
        return real(plane, *rest)

    monkeypatch.setattr(steps.photo_facades, "render_mosaic", fail_at_the_gable)
    run = go(on_map, tmp_path / "RUN", COARSE)
    assert run.failed == (Missing(GABLE, "render", "the wall is a mirror"),)
    assert [facade.id for facade in run.buildings[0].facades] == [FRONT]
    assert {"facade_id": GABLE, "step": "render", "reason": "the wall is a mirror"} in about(run)[
        "missing"
    ]


def test_no_facade_at_all_is_an_error_that_says_why(on_map, tmp_path, monkeypatch):
    def fail(*_):
        raise FacadeError("the wall is a mirror")

    monkeypatch.setattr(steps.photo_facades, "render_mosaic", fail)
    with pytest.raises(ReconstructionError, match=r"No facade was found in 9 photos .*mirror"):
        go(on_map, tmp_path / "RUN")
    assert len(about(tmp_path / "RUN")["missing"]) == 4


def test_without_a_scale_there_are_ratios_and_pictures_but_no_model(
    folder, first, tmp_path, reconstructed
):
    files = steps.PhotoFiles(folder=folder / "photos", unscaled=True)
    run = go(files, tmp_path / "RUN", COARSE)
    assert not run.workspace.model.exists()
    assert not (run.workspace.root / "buildings").exists()
    assert about(run)["reconstruction"]["metric"] is False
    ratios = sorted(facade.wwr for facade in run.loose_facades)
    exact = sorted(facade.wwr for facade in first.buildings[0].facades)
    assert ratios == pytest.approx(exact, abs=0.02)  # coarser pixels
    for facade in run.loose_facades:
        assert run.workspace.facade(facade.id, "ortho.png").exists()
        assert run.workspace.facade(facade.id, "overlay.png").exists()
        notes = json.loads(run.workspace.facade(facade.id, "facade.json").read_text())["notes"]
        assert any("no scale" in note for note in notes)
    page = run.workspace.report.read_text()
    assert "size of the building is not known" in page
    assert not re.search(NORTH_ARROW, page)
    assert not re.search(SCALE_BAR, page)
    with pytest.raises(InputError, match=r"no model\.hbjson"):
        steps.simulate_run(run.workspace, tmp_path / "any.epw")


def test_no_scale_is_said_before_the_work_and_names_what_gives_one(folder, tmp_path, monkeypatch):
    def never(*_):
        raise AssertionError("poses were sought")

    monkeypatch.setattr(steps, "find_poses", never)
    with pytest.raises(InputError) as error:
        go(steps.PhotoFiles(folder=folder / "photos"), tmp_path / "RUN")
    for option in ("--triangle", "GPS", "--cameras", "--unscaled"):
        assert option in str(error.value)


def triangle_of(folder):
    return json.loads((folder / "triangle.json").read_text(encoding="utf-8"))["sides_m"]


def test_a_triangle_gives_the_scale(folder):
    """The unit of the reconstruction does not show in what follows."""
    model = read_colmap_text(folder / "cameras")
    small = replace(
        model,
        photos=tuple(
            replace(
                photo,
                cam_from_world=replace(
                    photo.cam_from_world, translation=photo.cam_from_world.translation / 7
                ),
            )
            for photo in model.photos
        ),
        points=replace(model.points, points_in_world=model.points.points_in_world / 7),
    )
    files = steps.PhotoFiles(folder=folder / "photos", triangle=folder / "triangle.json")
    sources = steps.collect_photos(files, COARSE)
    scene = steps.make_scene(sources, Poses(small, {"p9.jpg": "lost"}), COARSE)
    record = steps.photos_record(scene)
    assert record["reconstruction"]["scaled_by"] == "distances"
    assert record["reconstruction"]["m_per_unit"] == pytest.approx(7.0, rel=1e-3)
    assert max(abs(side["residual_m"]) for side in record["reconstruction"]["sides"]) < 0.01
    assert sorted(plane.width_m for plane in scene.planes) == pytest.approx([8.0, 10.0], abs=0.15)
    assert {"id": "p9.jpg", "used": False, "reason": "lost"} in record["photos"]


def test_why_the_measured_photos_are_missing_is_told_with_the_missing_scale(folder):
    model = read_colmap_text(folder / "cameras")
    measured = {name for side in triangle_of(folder) for name in side[:2]}
    part = replace(model, photos=tuple(p for p in model.photos if p.id not in measured))
    files = steps.PhotoFiles(folder=folder / "photos", triangle=folder / "triangle.json")
    sources = steps.collect_photos(files, COARSE)
    lost = dict.fromkeys(sorted(measured), "is in model 1")
    notes = ("Others form a model of their own.", *(f"{n}: {why}." for n, why in lost.items()))
    with pytest.raises(InputError) as error:
        steps.make_scene(sources, Poses(part, lost, notes), COARSE)
    first, *rest = str(error.value).splitlines()
    assert "has no scale" in first
    assert rest == ["Of the reconstruction:", "  Others form a model of their own."]


def test_a_photo_that_is_cut_short_is_listed_and_costs_nothing_else(on_map, folder, tmp_path):
    photos = tmp_path / "photos"
    shutil.copytree(folder / "photos", photos)
    cut = photos / "p2.jpg"
    cut.write_bytes(cut.read_bytes()[:-4000])
    run = go(replace(on_map, folder=photos), tmp_path / "RUN", COARSE)
    (row,) = [row for row in about(run)["photos"] if row["id"] == "p2.jpg"]
    assert not row["used"]
    assert "truncated" in row["reason"]
    assert {facade.id for facade in run.buildings[0].facades} == {FRONT, GABLE}


def test_the_radiance_field_writes_depth_and_coverage(on_map, tmp_path):
    """Coarse and short: what is checked is the way through, not the picture."""
    short = RadianceConfig(m_per_px=0.1, samples_per_px=60.0, batch_samples=8192, threads=1)
    run = go(on_map, tmp_path / "RUN", replace(COARSE, renderer="radiance", radiance=short))
    facade = run.workspace.facade(FRONT, "facade.json")
    record = json.loads(facade.read_text())
    assert record["renderer"] == "radiance"
    assert len(json.loads(facade.with_name("windows.json").read_text())["windows"]) == 5
    depth_m = np.load(facade.with_name("depth.npy"))
    seen_by = cv2.imread(str(facade.with_name("coverage.png")), cv2.IMREAD_UNCHANGED)
    width_px, height_px = record["grid_px"]
    assert depth_m.shape == seen_by.shape == (height_px, width_px)
    assert np.isnan(depth_m[seen_by < 2]).all()
    assert abs(np.nanmedian(depth_m)) < 0.15  # mostly wall, in cells of 10 cm


def test_photos_and_a_triangle_are_enough(house, folder, tmp_path):
    photos = tmp_path / "photos"
    photos.mkdir()
    for name in FRONT_PHOTOS:
        shutil.copy(folder / "photos" / name, photos)
    centres = {photo.id: photo.centre_in_world for photo in house.photos}
    corners = FRONT_PHOTOS[0], FRONT_PHOTOS[2], FRONT_PHOTOS[5]
    sides = [
        [one, other, float(np.linalg.norm(centres[one] - centres[other]))]
        for one, other in combinations(corners, 2)
    ]
    triangle = tmp_path / "triangle.json"
    triangle.write_text(json.dumps({"sides_m": sides}))
    run = go(steps.PhotoFiles(folder=photos, triangle=triangle), tmp_path / "RUN", COARSE)
    (facade,) = run.loose_facades
    (truth,) = (each for each in house.truth if each.id == FRONT)
    assert facade.width_m == pytest.approx(truth.width_m, abs=0.2)
    assert len(facade.windows) == len(truth.windows)
    assert facade.wwr == pytest.approx(truth.wwr, abs=0.02)


@pytest.mark.slow  # points are sought by COLMAP
def test_known_cameras_need_no_points(on_map, folder, tmp_path, first):
    cameras = tmp_path / "cameras"
    shutil.copytree(folder / "cameras", cameras)
    (cameras / "points3D.txt").unlink()
    run = go(replace(on_map, cameras=cameras), tmp_path / "RUN", COARSE)
    found = {facade.id: facade for facade in run.buildings[0].facades}
    assert found.keys() == {FRONT, GABLE}
    for facade in first.buildings[0].facades:
        assert len(found[facade.id].windows) == len(facade.windows)
