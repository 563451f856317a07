"""An estate on disk: the readers of both paths read it, and a second call leaves it alone."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("mitsuba")

from benchmarks.estate.build import build
from benchmarks.estate.capture import pictures
from benchmarks.estate.capture.pictures import Size
from benchmarks.estate.parts import Parts
from benchmarks.estate.plan import (
    Balcony,
    Behind,
    Building,
    Estate,
    Finish,
    Light,
    Opening,
    Street,
    Wall,
    WindowStyle,
)
from benchmarks.estate.record import code_sha256
from benchmarks.estate.rendering import renderer
from benchmarks.estate.rendering.light import sky_map

from si3fp.errors import InputError, MissingDependencyError
from si3fp.evaluate import read_facades
from si3fp.geometry.enu import GeoOrigin
from si3fp.sources.colmap_text import read_colmap_text
from si3fp.sources.footprints import read_footprints
from si3fp.sources.local import image_loader, panoramas_in_world, read_panorama_records
from si3fp.sources.photos import read_photo_records
from si3fp.sources.triangle import read_known_distances

ORIGIN = GeoOrigin(57.69, 11.98, 14.0)
PHOTOS = 8
TINY = Size(256, 2, 48, PHOTOS, 2, 1, 0.2, 0.2)
RECESS_M = 0.2


def an_estate() -> Estate:
    """8 x 6 x 3 m, one window, a balcony beside it, nothing around but a street."""
    finish = Finish("plaster", (0.8, 0.75, 0.6))
    corners = [(0.0, 0.0), (8.0, 0.0), (8.0, 6.0), (0.0, 6.0)]
    window = Opening("window", 1.0, 0.8, 2.0, 1.6, RECESS_M, WindowStyle(), Behind(curtain=0.0))
    balcony = Balcony("solid", 4.6, 1.0, 2.4, 1.0, clear_m=1.9)
    walls = tuple(
        Wall(
            f"house-{i}",
            corners[i],
            corners[(i + 1) % 4],
            3.0,
            finish,
            (window,) if i == 0 else (),
            (balcony,) if i == 0 else (),
        )
        for i in range(4)
    )
    line = ((-6.0, -9.0), (14.0, -9.0))
    return Estate(
        "tiny",
        5,
        ORIGIN,
        (Building("house", walls, 3.0, 1, 3.0, 1968),),
        streets=(Street(((-40.0, -9.0), (50.0, -9.0))),),
        light=Light("2024-06-12", 11.0, 0.9),
        panorama_lines=(line,),
    )


@pytest.fixture(scope="module", autouse=True)
def quick() -> Iterator[None]:
    """Few rays at once, a coarse sky, and nothing around the house."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(renderer, "BATCH_RAYS", 1 << 14)
        patch.setattr(renderer, "sky_map", partial(sky_map, height_px=64))
        patch.setattr(pictures, "surroundings_parts", lambda estate: Parts())
        yield


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("estate") / "tiny"
    try:
        build(an_estate(), folder, TINY)
    except MissingDependencyError as error:
        pytest.skip(str(error))
    return folder


def test_the_street_path_reads_panoramas_planes_and_footprints(built: Path) -> None:
    records = read_panorama_records(built / "panoramas.geojson")
    assert 1 <= len(records) <= 3
    panoramas = panoramas_in_world(records, ORIGIN)
    poses = json.loads((built / "truth/poses.json").read_text())["poses"]
    for panorama in panoramas:
        assert panorama.planes_in_pano is not None and panorama.captured == "2024-06"
        image = image_loader(records)(panorama.id)
        assert image.shape == (128, 256, 3)
        assert (image.max(axis=2) < 8).mean() > 0.5  # only towards the house is there a picture
        assert image.max() > 100
        place = panorama.pano_from_world.inverse().translation
        shift = np.linalg.norm(place - poses[panorama.id]["place_in_world_m"])
        assert 0.09 < shift < 0.16
    (footprint,) = read_footprints(built / "footprints.geojson")
    assert (footprint.id, footprint.height_m, footprint.storeys) == ("house", 3.0, 1)


def test_the_photo_path_reads_photos_poses_and_triangle(built: Path) -> None:
    folder = read_photo_records(built / "photos")
    assert len(folder.records) == PHOTOS and not folder.unreadable
    for record in folder.records:
        assert (record.width_px, record.height_px, record.focal_35mm) == (48, 36, 26)
        assert record.gps is not None and record.captured == "2024-06-12"
    names = {record.id for record in folder.records}
    assert {photo.id for photo in read_colmap_text(built / "truth/cameras").photos} == names
    known = read_known_distances(built / "reference_triangle.json")
    assert len(known) == 3


def test_the_truth_is_read_and_its_orthophotos_have_its_depth(built: Path) -> None:
    truth = read_facades(json.loads((built / "truth/model.hbjson").read_text()))
    assert truth.origin == ORIGIN
    assert {f.id for f in truth.facades} == {f"house-{i}" for i in range(4)}
    depth_m = np.load(built / "truth/ortho/house-0.npy")
    rgb = np.asarray(Image.open(built / "truth/ortho/house-0.png"))
    assert depth_m.shape == rgb.shape[:2] == (15, 40)

    def at(x_m: float, y_m: float) -> float:
        return float(depth_m[int(15 - y_m / 0.2), int(x_m / 0.2)])

    assert at(0.5, 2.5) == pytest.approx(0.0, abs=0.02)  # wall
    assert at(1.5, 1.9) == pytest.approx(-RECESS_M, abs=0.05)  # glass
    assert at(5.9, 1.5) == pytest.approx(1.0, abs=0.1)  # the guard of the balcony


def test_masks_tell_which_facades_a_picture_could_show(built: Path) -> None:
    cameras = sorted(path.name for path in (built / "truth/seen").iterdir())
    assert len(cameras) == PHOTOS + len(list((built / "panoramas").iterdir()))
    front = np.asarray(Image.open(built / "truth/seen/pano-00/house-0.png"))
    assert front.dtype == bool and front.shape == (30, 80)
    assert front[5, 5] and front[:, :40].mean() > 0.9
    assert not front[18:, 48:68].all()  # behind the balcony
    assert not (built / "truth/seen/pano-00/house-2.png").exists()


def test_a_second_call_makes_what_is_gone_and_nothing_else(built: Path) -> None:
    kept = {path: path.stat().st_mtime_ns for path in built.rglob("*.jpg")}
    gone = built / "photos/photo-003.jpg"
    before = np.asarray(Image.open(gone), float)
    gone.unlink()
    said: list[str] = []
    build(an_estate(), built, TINY, say=said.append)
    again = {path: path.stat().st_mtime_ns for path in built.rglob("*.jpg")}
    assert {path for path in kept if again[path] != kept[path]} == {gone}
    assert any("photo-003.jpg" in line and "min left" in line for line in said)
    assert np.abs(np.asarray(Image.open(gone), float) - before).mean() < 2.0
    assert not list(built.rglob(".*"))


@pytest.fixture(scope="module")
def flown(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same set, for which a drone was asked later."""
    folder = tmp_path_factory.mktemp("flown") / "tiny"
    shutil.copytree(built, folder)
    build(an_estate(), folder, TINY, drone=True)
    return folder


def test_a_drone_comes_later_and_its_photos_stay(built: Path, flown: Path) -> None:
    def poses_and_files() -> tuple[dict, dict[Path, int]]:
        poses = json.loads((flown / "truth/poses.json").read_text())["poses"]
        return poses, {path: path.stat().st_mtime_ns for path in pictures_in(flown)}

    before, after = (json.loads((f / "estate.json").read_text())["counts"] for f in (built, flown))
    assert (before["photos"], before["drone"]) == (PHOTOS, 0)
    assert (after["photos"], after["drone"]) == (PHOTOS, 2)
    new = {path.relative_to(flown) for path in pictures_in(flown)}
    new -= {path.relative_to(built) for path in pictures_in(built)}
    flight = {"drone-000", "drone-001"}
    assert {path.stem for path in new if path.parts[0] == "photos"} == flight
    assert {path.parts[2] for path in new if path.parts[0] == "truth"} == flight
    made = poses_and_files()
    assert {f"{name}.jpg" for name in flight} < set(made[0])
    said: list[str] = []
    build(an_estate(), flown, TINY, say=said.append)
    assert poses_and_files() == made
    assert len(said) == 1 and "there already" in said[0]


def pictures_in(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.suffix in (".jpg", ".png", ".npy")]


def test_equal_plans_give_equal_files(flown: Path, tmp_path: Path) -> None:
    """Every byte, in one go or in two; what is drawn from global randomness is not drawn again."""
    again = tmp_path / "again"
    build(an_estate(), again, TINY, drone=True)
    names = {path.relative_to(flown) for path in flown.rglob("*") if path.is_file()}
    assert names == {path.relative_to(again) for path in again.rglob("*") if path.is_file()}
    assert len(names) > 40
    record = Path("estate.json")
    assert [n for n in names - {record} if digest(flown / n) != digest(again / n)] == []
    records = [json.loads((folder / record).read_text()) for folder in (flown, again)]
    assert all(set(each.pop("seconds")) for each in records)
    assert records[0] == records[1]


def digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


@pytest.mark.parametrize("drone", [0, 2])
def test_a_folder_made_before_the_code_was_recorded_goes_on(
    built: Path, flown: Path, tmp_path: Path, drone: int
) -> None:
    """Such records count the photos by drone among the photos too."""
    folder = tmp_path / "old"
    shutil.copytree(flown if drone else built, folder)
    record = json.loads((folder / "estate.json").read_text())
    (code,) = record.pop("code_sha256")
    assert record["counts"] == {"panoramas": 2, "photos": PHOTOS, "drone": drone}
    record["counts"]["photos"] += drone
    (folder / "estate.json").write_text(json.dumps(record))
    for _ in range(2):
        record = build(an_estate(), folder, TINY)
        assert record["counts"] == {"panoramas": 2, "photos": PHOTOS, "drone": drone}
        assert record["code_sha256"] == [None, code]
        assert record == json.loads((folder / "estate.json").read_text())


def test_another_version_of_the_code_goes_on_and_is_recorded(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "set"
    shutil.copytree(built, folder)
    (code,) = json.loads((folder / "estate.json").read_text())["code_sha256"]
    assert code == code_sha256()
    monkeypatch.setattr("benchmarks.estate.record.code_sha256", lambda: "another")
    for _ in range(2):
        assert build(an_estate(), folder, TINY, only=())["code_sha256"] == [code, "another"]


def test_what_became_of_surveyed_openings_is_recorded(tmp_path: Path) -> None:
    survey = {"openings": 9, "kept": 8, "gone": {"in a slanted surface": 1}}
    build(an_estate(), tmp_path / "tiny", TINY, only=(), survey=survey)
    build(an_estate(), tmp_path / "tiny", TINY, only=())
    assert json.loads((tmp_path / "tiny/estate.json").read_text())["survey"] == survey


def test_a_folder_of_another_estate_is_an_error(built: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="seed 5, not 6"):
        build(replace(an_estate(), seed=6), built, TINY)
    with pytest.raises(InputError, match="size"):
        build(an_estate(), built, replace(TINY, samples=2))
    other = json.loads((built / "estate.json").read_text())
    other["counts"]["panoramas"] += 1
    (tmp_path / "other").mkdir()
    (tmp_path / "other/estate.json").write_text(json.dumps(other))
    with pytest.raises(InputError, match="counts"):
        build(an_estate(), tmp_path / "other", TINY)
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(InputError, match="not empty"):
        build(an_estate(), tmp_path, TINY)
