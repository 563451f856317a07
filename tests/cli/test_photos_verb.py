"""`si3fp photos`: exit codes, and what every bad input says."""

from __future__ import annotations

import json
import re
import shutil
import struct
import sys
import zlib

import pytest
from tests.scenes.photos import make_photos, write_photos

from si3fp import cli, steps
from si3fp.errors import FacadeError

FRONT, GABLE = "house-a-0", "house-a-1"


@pytest.fixture(scope="module")
def house():
    return make_photos()


@pytest.fixture(scope="module")
def clean(house, tmp_path_factory):
    folder = tmp_path_factory.mktemp("clean")
    write_photos(house, folder)
    return folder


@pytest.fixture
def folder(clean, tmp_path):
    """A copy that a test may damage."""
    path = tmp_path / "house"
    shutil.copytree(clean, path)
    return path


@pytest.fixture
def si3fp(monkeypatch, capsys):
    """Exit code, stdout and stderr of ``si3fp words``."""

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["si3fp", *map(str, words)])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return run


@pytest.fixture
def photos(si3fp, folder, tmp_path):
    """``si3fp photos`` on the folder's photos, quickly."""

    def run(*options):
        return si3fp(
            "photos", folder / "photos", "-o", tmp_path / "RUN", "--renderer", "mosaic",
            "--m-per-px", "0.05", *options,
        )  # fmt: skip

    return run


@pytest.fixture
def on_map(photos, house, folder):
    """The same with all that is known."""
    origin = house.origin

    def run(*options):
        return photos(
            "--cameras", folder / "cameras",
            "--origin", origin.lat_deg, origin.lon_deg, origin.height_m,
            "--footprints", folder / "footprints.geojson", *options,
        )  # fmt: skip

    return run


def edit(path, change):
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def fails(result, *patterns):
    """The message in one line."""
    code, out, err = result
    assert code == 1, err
    assert out == ""
    assert "Traceback" not in err
    flat = " ".join(err.split())
    assert "Error: " in flat
    for pattern in patterns:
        assert re.search(pattern, flat), f"{pattern!r} not in {flat!r}"
    return flat


def test_done_is_zero_and_results_go_to_stdout(on_map, si3fp, tmp_path):
    code, out, err = on_map()
    assert code == 0, err
    assert "house-a-0" in out
    assert "WWR" in out
    assert str(tmp_path / "RUN" / "report.html") in out
    code, out, _ = si3fp("info", tmp_path / "RUN", "--json")
    assert code == 0
    assert json.loads(out)["reconstruction"]["placed_by"] == "cameras"


def test_a_failed_facade_is_three(on_map, monkeypatch):
    real = steps.photo_facades.render_mosaic

    def fail_at_the_gable(plane, *rest):
        if plane.facade_id == GABLE:
            raise FacadeError("the wall is a mirror")
        return real(plane, *rest)

    monkeypatch.setattr(steps.photo_facades, "render_mosaic", fail_at_the_gable)
    code, out, err = on_map()
    assert code == 3, err
    assert f"{GABLE}: failed in render: the wall is a mirror" in out
    assert f"{FRONT}: 10" in out


def test_interrupted_is_130_and_says_how_to_go_on(on_map, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(steps, "find_poses", stop)
    code, _, err = on_map()
    assert code == 130
    assert "continues a run where it stopped" in err


def test_without_north_simulate_asks_for_it(photos, folder, si3fp, tmp_path):
    code, _, err = photos("--cameras", folder / "cameras")
    assert code == 0, err
    fails(si3fp("simulate", tmp_path / "RUN", "--epw", "any.epw"), "--north DEG", "no rooms")


@pytest.mark.parametrize(
    "words",
    [[], ["--renderer", "nerf", "-o", "y"], ["--origin", "57", "11", "-o", "y"],
     ["--m-per-px", "3", "-o", "y"], ["--mapper", "other", "-o", "y"]],
)  # fmt: skip
def test_wrong_usage_is_two(si3fp, clean, words):
    code, _, err = si3fp("photos", clean / "photos", *words)
    assert code == 2
    assert "Usage" in err or "Error" in err


def test_missing_folder(si3fp, tmp_path):
    fails(si3fp("photos", tmp_path / "none", "-o", tmp_path / "RUN"), r"no folder .*none")
    assert not (tmp_path / "RUN").exists()


def test_too_few_photos(photos, folder):
    for name in range(2, 9):
        (folder / "photos" / f"p{name}.jpg").unlink()
    fails(photos(), "holds 2 photos", "3 are needed")


def test_photos_that_are_cut_short_are_said_where_too_few_remain(photos, folder):
    for name in range(7):
        photo = folder / "photos" / f"p{name}.jpg"
        photo.write_bytes(photo.read_bytes()[:-4000])
    fails(photos(), r"p0\.jpg: .*truncated", "2 more")


def test_a_huge_header_is_refused_before_anything_is_decoded(photos, folder):
    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">IIBBBBB", 60000, 30000, 8, 2, 0, 0, 0)
    png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", b"") + chunk(b"IEND", b"")
    for name in range(9):
        (folder / "photos" / f"p{name}.jpg").unlink()
        (folder / "photos" / f"p{name}.png").write_bytes(png)
    fails(photos(), r"p0\.png", "60000|60,000")


def test_a_distance_from_a_photo_that_is_not_there(photos, folder):
    edit(folder / "triangle.json", lambda c: c["sides_m"][1].__setitem__(0, "P4.JPG"))
    fails(
        photos("--triangle", folder / "triangle.json"),
        r"triangle\.json", r"no photo 'P4\.JPG'", r"such as 'p4\.jpg'",
    )  # fmt: skip


def test_a_distance_from_a_photo_that_is_cut_short(photos, folder):
    photo = folder / "photos" / "p4.jpg"
    photo.write_bytes(photo.read_bytes()[:-4000])
    fails(
        photos("--triangle", folder / "triangle.json"), r"triangle\.json", r"p4\.jpg", "truncated"
    )


def test_a_distance_of_the_wrong_length(photos, folder):
    def stretch(content):
        content["sides_m"][1][2] *= 1.3

    edit(folder / "triangle.json", stretch)
    fails(
        photos("--cameras", folder / "cameras", "--triangle", folder / "triangle.json"),
        "distances contradict the reconstruction", r"p4\.jpg.*p7\.jpg", "(?i)check",
    )  # fmt: skip


def test_distances_in_feet_beside_cameras_in_metres(photos, folder):
    def in_feet(content):
        for side in content["sides_m"]:
            side[2] /= 0.3048

    edit(folder / "triangle.json", in_feet)
    fails(
        photos("--cameras", folder / "cameras", "--triangle", folder / "triangle.json"),
        r"--triangle.* contradict .*--cameras", r"3\.28 m",
    )  # fmt: skip


def test_a_pose_that_is_not_a_number(photos, folder):
    images = folder / "cameras" / "images.txt"
    lines = images.read_text().splitlines()
    fields = lines[4].split()
    lines[4] = " ".join([*fields[:5], "nan", *fields[6:]])
    images.write_text("\n".join(lines))
    fails(photos("--cameras", folder / "cameras"), r"images\.txt, line 5", r"p2\.jpg", "not finite")


def test_cameras_of_another_size_than_their_photos(photos, folder, tmp_path):
    cameras = folder / "cameras" / "cameras.txt"
    cameras.write_text("1 PINHOLE 2304 1536 2000 2000 1152 768\n")
    fails(
        photos("--cameras", folder / "cameras"),
        r"p0\.jpg has 2304 x 1536 px, the photo 640 x 480 px", "same size",
    )  # fmt: skip
    assert not (tmp_path / "RUN").exists()


def test_cameras_of_photos_that_are_not_there(photos, folder):
    (folder / "photos" / "p3.jpg").rename(folder / "photos" / "q3.jpg")
    fails(photos("--cameras", folder / "cameras"), r"no photo 'p3\.jpg'", r"such as '[pq]\d\.jpg'")


def test_no_cameras_where_they_should_be(photos, folder):
    fails(photos("--cameras", folder / "photos"), r"no file .*cameras\.txt", "model_converter")


def test_an_origin_without_cameras(photos):
    fails(photos("--origin", "57", "11", "14"), r"--origin", "--cameras DIR")


def test_an_origin_that_is_not_on_earth(photos, folder):
    fails(photos("--cameras", folder / "cameras", "--origin", "570", "11", "14"), "570")


def test_unscaled_photos_cannot_be_laid_on_footprints(photos, folder):
    fails(photos("--unscaled", "--footprints", folder / "footprints.geojson"), "--footprints")


def test_unscaled_beside_what_gives_a_scale(photos, folder):
    fails(photos("--unscaled", "--triangle", folder / "triangle.json"), "--unscaled", "--triangle")


def test_no_scale(photos):
    fails(photos(), "no scale", "--triangle", "GPS", "--cameras", "--unscaled")


def test_walls_that_fit_the_footprints_in_two_ways(photos, folder):
    """A front and one gable of an oblong house fit it again after half a turn."""
    message = fails(
        photos("--cameras", folder / "cameras", "--footprints", folder / "footprints.geojson"),
        "in 2 ways", r"\(1\) heading", r"\(2\) heading", "--origin",
    )  # fmt: skip
    first, second = (float(v) for v in re.findall(r"heading ([\d.]+)", message))
    assert abs(first - second) == pytest.approx(180, abs=2)


def test_footprints_of_another_place(on_map, folder):
    def move(content):
        for feature in content["features"]:
            for ring in feature["geometry"]["coordinates"]:
                for position in ring:
                    position[1] += 0.1

    edit(folder / "footprints.geojson", move)
    fails(on_map(), r"11,1\d\d m from", "same building")


def test_footprints_of_another_building(photos, folder):
    def stretch(content):
        ring = content["features"][0]["geometry"]["coordinates"][0]
        for position in ring:
            for axis in (0, 1):
                position[axis] = ring[0][axis] + 3 * (position[axis] - ring[0][axis])

    edit(folder / "footprints.geojson", stretch)
    fails(
        photos("--cameras", folder / "cameras", "--footprints", folder / "footprints.geojson"),
        "footprints", "--origin",
    )  # fmt: skip


def test_footprints_in_projected_coordinates(on_map, folder):
    def project(content):
        for position in content["features"][0]["geometry"]["coordinates"][0]:
            position[:] = [319_500.0 + 1e4 * position[0], 6_399_000.0 + 1e4 * position[1]]

    edit(folder / "footprints.geojson", project)
    fails(on_map(), r"house-a", "(?i)longitude|coordinate")


def test_an_unknown_country_is_said_before_the_work(photos, tmp_path):
    fails(photos("--country", "SWE"), "no TABULA archetype for country 'SWE'", "SE")
    assert not (tmp_path / "RUN").exists()


def test_options_reach_the_run(monkeypatch, photos):
    asked = []

    def note(files, _out, config, **_options):
        asked.append((files.unscaled, config.renderer, config.sfm.mapper, config.measure.infer))
        raise FacadeError("far enough")

    monkeypatch.setattr(cli, "run_photos", note)
    photos()
    photos("--unscaled", "--mapper", "global", "--no-inferred")
    assert asked == [
        (False, "mosaic", "incremental", True), (True, "mosaic", "global", False),
    ]  # fmt: skip
