"""Exit codes and messages of the command line, and what every bad input says."""

from __future__ import annotations

import json
import re
import shutil
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from tests.scenes import make_street, write_street

from si3fp import cli, steps
from si3fp.config import StreetConfig
from si3fp.errors import FacadeError, MissingDependencyError
from si3fp.model import Missing


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    folder = tmp_path_factory.mktemp("clean")
    write_street(make_street(5, "tiny"), folder)
    return folder


@pytest.fixture
def street(clean, tmp_path):
    folder = tmp_path / "street"
    shutil.copytree(clean, folder)
    return folder


def run(monkeypatch, capsys, *words):
    """Exit code, stdout and stderr of ``si3fp words``."""
    monkeypatch.setattr(sys, "argv", ["si3fp", *map(str, words)])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    out, err = capsys.readouterr()
    return stop.value.code, out, err


@pytest.fixture
def si3fp(monkeypatch, capsys):
    return lambda *words: run(monkeypatch, capsys, *words)


@pytest.fixture
def on_street(si3fp, street, tmp_path):
    def go(*options):
        return si3fp(
            "street", street / "panoramas.geojson", "--footprints", street / "footprints.geojson",
            "-o", tmp_path / "RUN", *options,
        )  # fmt: skip

    return go


def edit(path: Path, change) -> None:
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def first_image(street):
    return street / "panoramas" / "pano-00.jpg"


def fails(result, *patterns):
    code, out, err = result
    assert code == 1, err
    assert out == ""
    assert err.splitlines()[-1].startswith("Error: ") or "\nError: " in "\n" + err
    assert "Traceback" not in err
    for pattern in patterns:
        assert re.search(pattern, err), f"{pattern!r} not in {err!r}"


def test_done_is_zero_and_results_go_to_stdout(on_street, tmp_path, si3fp):
    code, out, err = on_street()
    assert code == 0, err
    assert "house-a-0" in out
    assert "WWR" in out
    assert str(tmp_path / "RUN" / "report.html") in out
    code, out, _ = si3fp("info", tmp_path / "RUN", "--json")
    assert code == 0
    assert json.loads(out)["schema"] == "si3fp/run/1"
    code, out, _ = si3fp("info", tmp_path / "RUN")
    assert code == 0
    assert "house-a: 2 storeys" in out


@pytest.mark.parametrize(
    "words",
    [["street"], ["nonsense"], ["street", "x", "-o", "y", "--lat", "3"],
     ["street", "x", "-o", "y", "--column", "height"],
     ["street", "x", "-o", "y", "--m-per-px", "3"],
     ["street", "x", "-o", "y", "--seed", "-1"]],
)  # fmt: skip
def test_wrong_usage_is_two(si3fp, words):
    code, _, err = si3fp(*words)
    assert code == 2
    assert "Usage" in err or "Error" in err


def test_a_failed_facade_is_three(on_street, monkeypatch):
    real = steps.find_facade
    calls = []

    def sometimes(plan, *rest):
        calls.append(plan)
        return real(plan, *rest)

    real_plan = steps.plan

    def with_a_bad_one(*rest):
        plans, missing = real_plan(*rest)
        return plans, [*missing, Missing("house-a-9", "align", "the wall is a mirror")]

    monkeypatch.setattr(steps, "find_facade", sometimes)
    monkeypatch.setattr(steps, "plan", with_a_bad_one)
    code, out, _ = on_street()
    assert code == 3
    assert "house-a-9: failed in align: the wall is a mirror" in out
    assert "house-a-0" in out


def test_interrupted_is_130_and_says_how_to_go_on(on_street, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(steps, "make_views", stop)
    code, _, err = on_street("--overwrite")
    assert code == 130
    assert "without --overwrite continues a run where it stopped" in err


def test_the_demo_can_replace_the_run_of_another_version(si3fp, tmp_path, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(steps, "make_views", stop)
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "key.json").write_text('{"key": "that of another version"}')
    fails(si3fp("demo", "-o", tmp_path), "another version", "--overwrite")
    code, _, err = si3fp("demo", "-o", tmp_path, "--overwrite")
    assert code == 130, err  # it has begun


def test_truncated_image(on_street, street):
    image = first_image(street)
    image.write_bytes(image.read_bytes()[:-4000])
    fails(on_street(), r"pano-00\.jpg", "truncated", "again|remove")


def test_a_bad_image_costs_no_finished_work(on_street, street, tmp_path):
    inputs = steps.collect(
        street / "panoramas.geojson", street / "footprints.geojson", StreetConfig()
    )
    *before, last = inputs.panoramas
    image = street / "panoramas" / f"{last}.jpg"
    image.write_bytes(image.read_bytes()[:-4000])
    fails(on_street(), last)
    for name in before:
        assert list((tmp_path / "RUN" / "cache" / "views").rglob(f"{name}.png"))


def test_empty_image(on_street, street):
    first_image(street).write_bytes(b"")
    fails(on_street(), r"pano-00\.jpg", "empty")


def test_no_image(on_street, street):
    first_image(street).write_bytes(b"<html>404 not found</html>" * 100)
    fails(on_street(), r"pano-00\.jpg", "(no|not an?) .*image|image")


def test_huge_image_is_refused_by_its_header(on_street, street):
    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">IIBBBBB", 60000, 30000, 8, 2, 0, 0, 0)
    png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", b"") + chunk(b"IEND", b"")
    (street / "panoramas" / "huge.png").write_bytes(png)
    edit(
        street / "panoramas.geojson",
        lambda c: c["features"][0]["properties"].update(image="panoramas/huge.png"),
    )
    fails(on_street(), r"huge\.png", "60000|60,000")


def test_missing_files(on_street, si3fp, street, tmp_path):
    first_image(street).unlink()
    fails(on_street(), r"pano-00\.jpg")
    fails(si3fp("street", tmp_path / "none.geojson", "-o", tmp_path / "R"), r"none\.geojson")
    fails(
        si3fp("street", street / "panoramas.geojson", "--footprints", tmp_path / "no.geojson",
              "-o", tmp_path / "R"),
        r"(no|pano-00)\.(geojson|jpg)",
    )  # fmt: skip


def test_missing_field(on_street, street):
    edit(street / "panoramas.geojson", lambda c: c["features"][1]["properties"].pop("heading_deg"))
    fails(on_street(), "heading_deg", "pano-01|feature 1")


@pytest.mark.parametrize("value", [float("nan"), 400.0, "north"])
def test_impossible_poses(on_street, street, value):
    edit(
        street / "panoramas.geojson",
        lambda c: c["features"][0]["properties"].update(pitch_deg=value),
    )
    fails(on_street(), "pitch_deg|NaN|nan", "pano-00|feature 0|JSON")


def test_projected_coordinates_are_a_wrong_crs(on_street, street):
    edit(
        street / "panoramas.geojson",
        lambda c: c["features"][0]["geometry"].update(coordinates=[319500.0, 6399000.0, 12.0]),
    )
    fails(on_street(), "319500", "(?i)longitude|coordinate")


def test_a_declared_foreign_crs(on_street, street):
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3006"}}
    edit(street / "panoramas.geojson", lambda c: c.update(crs=crs))
    fails(on_street(), "3006")


def test_plane_map_cut_short(on_street, street):
    path = street / "depth" / "pano-00.b64"
    path.write_text(path.read_text()[:3000])
    fails(on_street(), r"pano-00", "plane map|short|bytes")


def test_plane_map_of_another_size_is_read(on_street, street):
    import base64

    path = street / "depth" / "pano-00.b64"
    raw = base64.urlsafe_b64decode(path.read_text() + "==")
    planes = struct.unpack_from("<H", raw, 1)[0]
    index = np.frombuffer(raw, np.uint8, 512 * 256, 8).reshape(256, 512)[::2, ::2]
    small = struct.pack("<BHHHB", 8, planes, 256, 128, 8) + index.tobytes() + raw[8 + 512 * 256 :]
    path.write_text(base64.urlsafe_b64encode(small).decode().rstrip("="))
    code, out, err = on_street()
    assert code == 0, err
    assert "house-a-0" in out


def test_self_intersecting_footprint(on_street, street):
    def cross(content):
        ring = content["features"][0]["geometry"]["coordinates"][0]
        ring[1], ring[2] = ring[2], ring[1]

    edit(street / "footprints.geojson", cross)
    fails(on_street(), "house-a", "(?i)self-intersect|cross")


def test_zero_panoramas(on_street, street):
    edit(street / "panoramas.geojson", lambda c: c.update(features=[]))
    fails(on_street(), "zero panoramas")


def test_zero_panoramas_within_the_radius(on_street):
    fails(on_street("--lat", "10", "--lon", "10", "--radius-m", "50"), "0 of 3", "radius")


def test_zero_facades(on_street, monkeypatch):
    def fail(*_):
        raise FacadeError("the wall is a mirror")

    monkeypatch.setattr(steps.facades, "align_views", fail)
    fails(on_street(), "No facade was found", "the wall is a mirror", r"run\.json")


def test_an_unknown_country_is_said_before_the_work(on_street, tmp_path):
    fails(on_street("--country", "SWE"), "no TABULA archetype for country 'SWE'", "SE")
    assert not (tmp_path / "RUN").exists()


def test_full_disk(on_street, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    fails(on_street(), "No space left on device", "Free space")


def test_a_file_as_output_folder(si3fp, street, tmp_path):
    (tmp_path / "file").write_text("x")
    fails(si3fp("street", street / "panoramas.geojson", "-o", tmp_path / "file"), "file")


def test_info_of_no_run(si3fp, tmp_path):
    fails(si3fp("info", tmp_path), "run.json")


def test_simulate_without_a_model(si3fp, tmp_path):
    fails(si3fp("simulate", tmp_path, "--epw", "x.epw"), r"no model\.hbjson", "si3fp street")


def test_simulate_without_the_extra_names_it(si3fp, tmp_path, monkeypatch):
    def missing(*_, **__):
        raise MissingDependencyError("Install it with: pip install 'si3fp[energy]'")

    monkeypatch.setattr(steps.models, "simulate", missing)
    (tmp_path / "model.hbjson").write_text("{}")
    fails(si3fp("simulate", tmp_path, "--epw", "x.epw"), r"pip install 'si3fp\[energy\]'")


def test_the_installed_command_answers():
    result = subprocess.run(
        [sys.executable, "-m", "si3fp.cli", "--version"], capture_output=True, text=True, check=True
    )
    assert "si3fp" in result.stdout


def test_windows_that_only_rows_and_columns_tell_can_be_left_out(monkeypatch, on_street):
    asked = []

    def note(_panoramas, _footprints, _out, config, **_options):
        asked.append(config.measure.infer)
        raise FacadeError("far enough")

    monkeypatch.setattr(cli, "run_street", note)
    on_street()
    on_street("--no-inferred")
    assert asked == [True, False]
