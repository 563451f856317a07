"""Structure from motion: a rendered corner of two walls, and what happens when things go wrong."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image
from tests.corner import CAMERA, poses, render, texture

from si3fp.camera2d import colmap_job
from si3fp.camera2d.overlap import Features
from si3fp.camera2d.photo_pairs import pairs_to_match
from si3fp.camera2d.scale import scale_from_distances
from si3fp.camera2d.sfm import PhotoFile, reconstruct, triangulate_known
from si3fp.config import CaptureConfig, SfmConfig
from si3fp.errors import InputError, ReconstructionError
from si3fp.geometry.similarity import fit_similarity
from si3fp.model import Photo
from si3fp.sources.colmap_text import read_colmap_text
from si3fp.sources.triangle import read_known_distances

CONFIG = SfmConfig()


@dataclass(frozen=True)
class Scene:
    folder: Path
    photos: tuple[Photo, ...]

    @property
    def files(self):
        return [PhotoFile(photo.id) for photo in self.photos]


def write_scene(folder, seed, poses, prefix=""):
    folder.mkdir(exist_ok=True)
    textures = texture(seed), texture(seed + 1)
    photos = tuple(
        Photo(f"{prefix}photo {number}.png", CAMERA, pose) for number, pose in enumerate(poses)
    )
    for photo in photos:
        cv2.imwrite(str(folder / photo.id), render(photo.cam_from_world, textures))
    return Scene(folder, photos)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return write_scene(tmp_path_factory.mktemp("scene"), seed=3, poses=poses(6))


class Run:
    """A reconstruction with what it told on the way."""

    def __init__(self, scene, work_dir):
        self.told = []
        self.work_dir = work_dir
        self.result = reconstruct(
            scene.folder, scene.files, work_dir, CONFIG, progress=self.progress
        )

    def progress(self, *state):
        self.told.append(state)


@pytest.fixture(scope="module")
def run(scene, tmp_path_factory):
    return Run(scene, tmp_path_factory.mktemp("work"))


def test_cameras_of_a_rendered_corner(scene, run):
    model = read_colmap_text(run.result.folder)
    assert sorted(run.result.photo_ids) == sorted(photo.id for photo in scene.photos)
    assert run.result.notes == ()
    assert run.result.lost == {}
    found = {photo.id: photo for photo in model.photos}
    fit = fit_similarity(
        [found[photo.id].centre_in_world for photo in scene.photos],
        [photo.centre_in_world for photo in scene.photos],
    )
    # 0.2 px of SIFT at 11 m are 7 mm; the focal length is free and moves the cameras on.
    assert fit.distances.max() < 0.10
    assert found["photo 0.png"].camera.fx_px == pytest.approx(330, rel=0.04)
    # The points lie on the walls x = 0 and y = 0.
    points = fit.b_from_a.apply(model.points.points_in_world)
    assert len(points) > 200
    assert np.median(np.abs(points[:, :2]).min(axis=1)) < 0.03
    assert {step for step, _, _ in run.told} <= {"features", "matches", "cameras"}
    assert run.told[-1] == ("cameras", 6, 6)


def test_a_finished_model_is_not_redone(scene, run, monkeypatch):
    monkeypatch.setattr(colmap_job.subprocess, "Popen", None)
    assert Run(scene, run.work_dir).result == run.result


def test_an_interrupted_run_goes_on_where_it_stopped(scene, run):
    (run.work_dir / "report.json").unlink()
    again = Run(scene, run.work_dir)
    assert again.result == run.result
    redone = {(step, done) for step, done, total in again.told if done < total}
    assert not any(step in ("features", "matches") for step, _ in redone)


def test_photos_that_do_not_hang_together_are_named_with_what_to_do(scene, tmp_path):
    others = write_scene(tmp_path, seed=77, poses=poses(6)[:3], prefix="other ")
    cv2.imwrite(str(tmp_path / "fog.png"), np.full((240, 320), 90, np.uint8))
    (tmp_path / "torn.png").write_bytes((tmp_path / "fog.png").read_bytes()[:20])
    whole = (scene.folder / scene.photos[5].id).read_bytes()
    (tmp_path / "half.png").write_bytes(whole[: len(whole) // 2])
    for photo in scene.photos[:4]:
        (tmp_path / photo.id).write_bytes((scene.folder / photo.id).read_bytes())
    ids = [p.id for p in (*scene.photos[:4], *others.photos)] + ["fog.png", "torn.png", "half.png"]
    # Their poses are those of the others, yet nothing is in common.
    result = reconstruct(tmp_path, [PhotoFile(i) for i in ids], tmp_path / "work", CONFIG)
    assert [len(model.photo_ids) for model in result.models] == [4, 3]
    assert result.photo_ids == tuple(photo.id for photo in scene.photos[:4])
    assert set(result.lost) == {*(photo.id for photo in others.photos), *ids[-3:]}
    assert "without texture" in result.lost["fog.png"]
    assert "cannot be read" in result.lost["torn.png"]
    assert "cannot be read" in result.lost["half.png"]
    assert "model 1" in result.lost["other photo 0.png"]
    assert "Only 4 of 10 photos are connected" in result.notes[0]
    assert "other photo 0.png to other photo 2.png (3 photos) form a model" in result.notes[1]


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_process_that_dies_is_an_error_that_says_so(scene, tmp_path, monkeypatch):
    started = []

    class Recorded(subprocess.Popen):
        def __init__(self, *args, **kwargs):
            super().__init__(*args, **kwargs)
            started.append(self)

    def kill(step, done, total):
        started[-1].kill()

    monkeypatch.setattr(colmap_job.subprocess, "Popen", Recorded)
    with pytest.raises(ReconstructionError, match=r"killed by signal 9.*memory(?s:.*)run it again"):
        reconstruct(scene.folder, scene.files, tmp_path, CONFIG, progress=kill)

    def interrupt(step, done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reconstruct(scene.folder, scene.files, tmp_path, CONFIG, progress=interrupt)
    assert len(started) == 2
    assert all(process.poll() == -signal.SIGKILL for process in started)


def test_a_broken_database_is_an_error_with_the_last_lines_of_the_log(scene, run, tmp_path):
    job = json.loads((run.work_dir / "job.json").read_text())
    (tmp_path / "job.json").write_text(json.dumps(job))
    (tmp_path / "database.db").write_bytes(b"this is no database" * 100)
    with pytest.raises(ReconstructionError, match=r"exit code (?s:.*)Error(?s:.*)delete"):
        reconstruct(scene.folder, scene.files, tmp_path, CONFIG)


def test_the_process_ends_with_its_parent(scene, run, tmp_path):
    job = json.loads((run.work_dir / "job.json").read_text())
    (tmp_path / "job.json").write_text(json.dumps(job))
    command = [sys.executable, "-m", "si3fp.camera2d._colmap_process", str(tmp_path / "job.json")]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        assert process.stdout.readline() == b"features\n"
        process.stdin.close()  # as the system does for a parent that dies
        assert process.wait(timeout=20) == 3


def test_known_cameras_get_points_on_the_walls(scene, run, tmp_path):
    folder = triangulate_known(scene.folder, scene.photos, {}, tmp_path, CONFIG)
    model = read_colmap_text(folder)
    for photo, given in zip(sorted(model.photos, key=lambda p: p.id), scene.photos, strict=True):
        assert photo.camera == given.camera
        np.testing.assert_allclose(photo.centre_in_world, given.centre_in_world, atol=1e-9)
    points = model.points.points_in_world
    assert len(points) > 200
    assert np.median(np.abs(points[:, :2]).min(axis=1)) < 0.03
    assert model.points.photo_ids[0][0] in {photo.id for photo in scene.photos}

    turned = [
        replace(photo, cam_from_world=other.cam_from_world)
        for photo, other in zip(scene.photos, scene.photos[::-1], strict=True)
    ]
    with pytest.raises(ReconstructionError, match="do not fit their photos"):
        triangulate_known(scene.folder, turned, {}, tmp_path, CONFIG)
    larger = [replace(p, camera=replace(p.camera, width_px=640)) for p in scene.photos]
    with pytest.raises(InputError, match="640 x 240"):
        triangulate_known(scene.folder, larger, {}, tmp_path, CONFIG)


def test_photos_that_cannot_be_used(tmp_path):
    picture = Image.new("RGB", (32, 24))
    exif = Image.Exif()
    exif[0x0112] = 6
    picture.save(tmp_path / "turned.jpg", exif=exif)
    with pytest.raises(InputError, match=r"turned\.jpg is turned by its EXIF"):
        reconstruct(tmp_path, [PhotoFile("turned.jpg")], tmp_path / "work")
    with pytest.raises(InputError, match="No photo"):
        reconstruct(tmp_path, [PhotoFile("none.jpg")], tmp_path / "work")
    with pytest.raises(InputError, match="'glomap'"):
        reconstruct(tmp_path, [], tmp_path / "work", SfmConfig(mapper="glomap"))
    for focal_px in (0.0, -5.0, np.nan, np.inf):
        with pytest.raises(InputError, match=r"a\.jpg: a focal length"):
            PhotoFile("a.jpg", focal_px=focal_px)
    with pytest.raises(InputError, match=r"a\.jpg: its position"):
        PhotoFile("a.jpg", position_m=(0.0, np.nan, 0.0))


def test_changes_make_a_run_start_anew(tmp_path):
    job = {"photos": ["a"], "cameras": [], "seed": 0, "config": asdict(SfmConfig())}

    def kept(**changes):
        for name in ("database.db", "report.json"):
            (tmp_path / name).touch()
        (tmp_path / "job.json").write_text(json.dumps({**job, "folder": "x", "pairs": [[0, 1]]}))
        pairs = colmap_job._keep_what_holds(tmp_path, {**job, **changes})
        return pairs, [(tmp_path / name).exists() for name in ("database.db", "report.json")]

    assert kept() == ([(0, 1)], [True, True])
    assert kept(config=asdict(SfmConfig(mapper="global"))) == ([(0, 1)], [True, False])
    assert kept(poses=[1]) == ([(0, 1)], [True, False])
    assert kept(photos=["b"]) == (None, [False, False])
    assert kept(config=asdict(SfmConfig(max_side_px=99))) == (None, [False, False])
    (tmp_path / "job.json").write_text("{")
    assert colmap_job._keep_what_holds(tmp_path, job) is None


def test_pairs_of_many_photos():
    config = SfmConfig(all_pairs_up_to=10, followers=2, near_photos=1)
    places = np.full((40, 3), np.nan)
    places[[5, 30]] = [[0, 0, 0], [20, 0, 0]]
    places[[12, 33]] = [[500, 0, 0], [540, 0, 0]]
    nothing = [Features(np.zeros((0, 2)), np.zeros((0, 128), np.float32))] * 40
    pairs = pairs_to_match(places, lambda: nothing, config, CaptureConfig())
    following = {(a, b) for a in range(40) for b in range(a + 1, 40) if b - a <= 2}
    assert set(pairs) == following | {(0, 38), (0, 39), (1, 38), (1, 39), (5, 30)}
    assert pairs == sorted(pairs)
    few = pairs_to_match(places[:10], lambda: pytest.fail("not needed"), config, CaptureConfig())
    assert len(few) == 45


@pytest.mark.slow
def test_buildings_with_one_ornament_are_not_laid_on_each_other(tmp_path):
    """COLMAP does so: all 16 photos in one model, looking at one building."""
    own, other = (texture(3), texture(4)), (texture(50), texture(51))
    width = own[0].shape[1] // 5
    other[0][:, :width], other[1][:, -width:] = own[0][:, :width], own[1][:, -width:]
    ids = []
    for name, textures in (("a", own), ("b", other)):
        for number, pose in enumerate(poses(8)):
            ids.append(f"{name}{number}.png")
            cv2.imwrite(str(tmp_path / ids[-1]), render(pose, textures))
    result = reconstruct(tmp_path, [PhotoFile(i) for i in ids], tmp_path / "work", CONFIG)
    models = [{photo_id[0] for photo_id in model.photo_ids} for model in result.models]
    assert models in ([{"a"}, {"b"}], [{"b"}, {"a"}])
    assert all(len(model.photo_ids) == 8 and not model.doubts for model in result.models)
    assert "look alike" in result.notes[0]
    assert "set aside" in result.notes[0]
    left = reconstruct(
        tmp_path, [PhotoFile(i) for i in ids], tmp_path / "left", replace(CONFIG, most_folds=0)
    )
    assert len(left.models) == 1
    assert set(left.photo_ids) in [{i for i in ids if i.startswith(name)} for name in "ab"]
    assert not left.models[0].doubts
    assert left.models[0].error_px < 1.0
    assert "were left out" in left.notes[0]
    assert set(left.lost) == set(ids) - set(left.photo_ids)


@pytest.mark.slow
@pytest.mark.skipif(
    "SI3FP_TEST_DATA" not in os.environ,
    reason="needs SI3FP_TEST_DATA, the folder with the castle's photos",
)
def test_the_castle_against_its_published_cameras(tmp_path):
    castle = Path(os.environ["SI3FP_TEST_DATA"]) / "castle"
    published = {p.id: p.centre_in_world for p in read_colmap_text(castle / "cameras").photos}
    files = [PhotoFile(name) for name in sorted(published)]
    result = reconstruct(castle / "photos", files, tmp_path)
    assert len(result.photo_ids) >= 29
    assert result.models[0].doubts == ()
    model = read_colmap_text(result.folder)
    found = {photo.id: photo.centre_in_world for photo in model.photos}
    ids = sorted(found)
    fit = fit_similarity([found[i] for i in ids], [published[i] for i in ids])
    assert np.sqrt((fit.distances**2).mean()) <= 0.05
    scale = scale_from_distances(found, read_known_distances(castle / "reference_triangle.json"))
    assert scale.m_per_unit == pytest.approx(fit.b_from_a.scale, rel=0.005)
