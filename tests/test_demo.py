"""The whole path on a street that was rendered for this test and seen by nobody before."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from tests.scenes import make_street, write_street

from si3fp.demo import run_demo
from si3fp.demo.run import evaluate_run

SEED = 11  # another than the demo's; no constant was chosen on it


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("street")
    write_street(make_street(SEED, "small"), folder)
    return folder


@pytest.fixture(scope="module")
def run(street: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    out = tmp_path_factory.mktemp("run") / "RUN"
    return out, run_demo(out, street)


def test_the_demo_finds_the_windows_of_another_street(street: Path, run: tuple[Path, int]) -> None:
    out, code = run
    result = evaluate_run(out / "model.hbjson", street / "truth.hbjson")
    assert code == 0
    assert result.windows_total.f1 is not None
    assert result.windows_total.f1 >= 0.8
    assert result.wwr.area_weighted == pytest.approx(0.0, abs=0.03)
    # The poses are 0.10-0.15 m off, each in its own direction.
    assert result.windows_total.mean_abs_position_error_m is not None
    assert result.windows_total.mean_abs_position_error_m < 0.25


def test_the_demo_leaves_a_report_a_map_layer_and_a_model(run: tuple[Path, int]) -> None:
    out, _ = run
    assert (out / "report.html").stat().st_size > 10_000
    assert json.loads((out / "windows.geojson").read_text())["features"]
    assert json.loads((out / "model.hbjson").read_text())["rooms"]


def test_the_demo_fails_where_the_truth_is_another(
    street: Path,
    run: tuple[Path, int],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out, _ = run
    other = tmp_path / "street"
    other.mkdir()
    for name in ("panoramas", "depth", "panoramas.geojson", "footprints.geojson"):
        (other / name).symlink_to(street / name)
    truth = json.loads((street / "truth.hbjson").read_text())
    for face in truth["orphaned_faces"]:
        face["apertures"] = face["apertures"][:2]
    (other / "truth.hbjson").write_text(json.dumps(truth))

    def without(package: str) -> None:
        return None

    monkeypatch.setattr("si3fp.thermal.energyplus.find_spec", without)
    monkeypatch.setattr("si3fp.thermal.weather.find_spec", without)
    assert run_demo(out, other) == 1  # finished steps are skipped
    printed = capsys.readouterr().out
    assert "NOT GOOD" in printed
    assert "No simulation" in printed
    assert "si3fp[energy]" in printed
