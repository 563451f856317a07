"""`si3fp evaluate`: files in and out, notes, heating, text and page."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path
from typing import Any

import pytest
from tests.test_evaluate_models import aperture, model, wall

from si3fp import cli
from si3fp.errors import InputError, MissingDependencyError, SimulationError
from si3fp.evaluate.heating import compare_heating
from si3fp.report.evaluation_report import evaluation_report
from si3fp.report.evaluation_table import evaluation_table
from si3fp.steps import evaluate_model, evaluation
from si3fp.thermal.energyplus import BuildingDemand, SimulationResult

Json = dict[str, Any]
WINDOWS = (aperture(1, 2, 1, 3), aperture(4, 5, 1, 3), aperture(7, 8, 3.4, 4.4))


def named(index: int, *windows: Json, **data: object) -> Json:
    """Wall ``a-<index>``, 20 m behind the one before."""
    face = wall(f"w{index}", *windows, user_data={"facade_id": f"a-{index}", **data})
    text = json.dumps(face).replace(", 0.0, ", f", {20.0 * index}, ")
    moved: Json = json.loads(text)
    return moved


def write(path: Path, content: Json) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))
    return path


@pytest.fixture
def truth(tmp_path: Path) -> Path:
    return write(
        tmp_path / "truth.hbjson",
        model(named(0, *WINDOWS), named(1), named(2, WINDOWS[0], balconies=True)),
    )


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run that found two facades, one window of them wrong, and says an interval."""
    lost = {"missing": "coverage: a tree"}
    write(
        tmp_path / "RUN" / "model.hbjson",
        model(named(0, *WINDOWS[:2], aperture(8, 9, 1, 2)), named(1), named(2, si3fp=lost)),
    )
    write(tmp_path / "RUN/facades/a-0/facade.json", {"id": "a-0", "wwr_interval": [0.08, 0.12]})
    return tmp_path / "RUN"


def test_a_run_folder_with_everything_it_says(run: Path, truth: Path, tmp_path: Path) -> None:
    known = evaluate_model(run, truth, tmp_path / "out")
    result = known.result
    assert result.windows.f1 == pytest.approx(4 / 6)
    assert result.windows_total.f1 == pytest.approx(4 / 7)
    assert result.without_balconies.windows_total.f1 == pytest.approx(4 / 6)
    assert (result.interval.facades, result.interval.covered) == (1, 1)
    assert result.unmatched[0].reason == "the run says coverage: a tree"
    written = json.loads((tmp_path / "out" / "evaluation.json").read_text())
    assert list(written)[:2] == ["schema", "si3fp_version"]
    assert written["schema"] == "si3fp/evaluation/1"
    assert written["windows"]["f1"] == round(4 / 6, 6)
    assert written["heating"] is None
    assert set(written["inputs"]) == {"found", "truth"}
    assert not list((tmp_path / "out").glob("*.part"))
    again = evaluate_model(run, truth, tmp_path / "out2")
    assert evaluation_report(again) == evaluation_report(known)
    assert (tmp_path / "out2/evaluation.json").read_bytes() == (
        tmp_path / "out/evaluation.json"
    ).read_bytes()


def test_an_earlier_evaluation_stays_unless_told(run: Path, truth: Path, tmp_path: Path) -> None:
    evaluate_model(run, truth, tmp_path / "out")
    with pytest.raises(InputError, match="--overwrite"):
        evaluate_model(run, truth, tmp_path / "out")
    evaluate_model(run, truth, tmp_path / "out", overwrite=True)


def test_the_table_has_the_papers_columns(run: Path, truth: Path) -> None:
    text = evaluation_table(evaluate_model(run, truth))
    rows = [line.split() for line in text.splitlines()]
    assert ["a", "5.0", "10.0", "3", "4", "1", "(33.3", "%)"] in rows
    # F1 and without balconies, IoU, area, position, then WWR: (0.5 - 0.5) / 2 found facades ...
    assert ["a", "facades", "found", "0.67", "0.67", "1.00", "0.0", "0.000",
            "+0.000", "-", "0.000", "+0.000"] in rows  # fmt: skip
    # ... a missing 2 of 50 m2 is -0.04 / 3; imputed: 0.05, the mean of 0.10 and 0.
    assert ["a", "all", "(Total)", "0.57", "0.67", "-", "-", "-",
            "-0.013", "+0.003", "0.013", "-0.013"] in rows  # fmt: skip
    assert "a-2: missing, 1 windows; the run says coverage: a tree" in text
    assert "Note: Facades with balconies: a-2." in text


def test_the_page_is_self_contained_and_shows_the_five_plots(run: Path, truth: Path) -> None:
    page = evaluation_report(evaluate_model(run, truth))
    assert page.count("data:image/svg+xml;base64,") == 5
    assert "http" not in page.replace("http://www.w3.org", "")
    assert page.count("<svg") == 2  # a-1 has no windows to draw
    assert "the run says coverage: a tree" in page


def test_a_page_without_anything_found(truth: Path, tmp_path: Path) -> None:
    nothing = write(tmp_path / "empty.hbjson", model())
    known = evaluate_model(nothing, truth)
    assert "The found model has no facades." in known.notes
    assert "all (Total)" in evaluation_table(known)
    assert evaluation_report(known).count("data:image/svg+xml;base64,") == 2


def test_origins_and_shifts_are_said(run: Path, truth: Path, tmp_path: Path) -> None:
    place = {"lat_deg": 57.0, "lon_deg": 12.0, "height_m": 0.0}

    def at(name: str, **change: float) -> Path:
        content = json.loads(truth.read_text())
        content["user_data"] = {"si3fp": {"origin": {**place, **change}}}
        return write(tmp_path / name, content)

    here = at("here.hbjson")
    assert any("The truth states no origin" in note for note in evaluate_model(here, truth).notes)
    notes = evaluate_model(at("up.hbjson", height_m=2.0), here).notes
    assert any("origins differ" in note and "2.00 m (found)" in note for note in notes)
    assert any("2.0 m up of the true ones" in note for note in notes)
    with pytest.raises(InputError, match="do not overlap"):
        evaluate_model(at("away.hbjson", lat_deg=57.1), here)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda folder: folder / "nothing.hbjson", "no file"),
        (lambda folder: folder, "holds no model.hbjson"),
        (lambda folder: write(folder / "x.json", {"type": "Room"}), "x.json: This is not a honey"),
    ],
)
def test_bad_runs_are_refused(make: Any, words: str, truth: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words):
        evaluate_model(make(tmp_path), truth)


def test_a_truth_without_walls_is_refused(run: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no outdoor walls"):
        evaluate_model(run, write(tmp_path / "empty.hbjson", model()))


def test_heating_by_hand() -> None:
    rows = compare_heating(
        {"a": (900.0, 10.0), "b": (500.0, 10.0), "x": (7.0, 1.0)},
        {"a": (1000.0, 10.0), "b": (400.0, 8.0)},
    )
    assert [row.id for row in rows] == ["all", "a", "b"]
    assert (rows[0].found_kwh, rows[0].true_kwh, rows[0].relative_error) == (1400, 1400, 0)
    assert rows[0].relative_error_per_area == pytest.approx(18 / 20 - 1)
    assert rows[1].relative_error == pytest.approx(-0.1)
    assert (rows[2].found_kwh_m2, rows[2].true_kwh_m2) == (50.0, 50.0)
    (row,) = compare_heating({"a": (5.0, 0.0)}, {"b": (0.0, 2.0)})
    assert row.relative_error is None
    assert row.found_kwh_m2 is None


def test_heating_is_compared_or_its_lack_explained(
    run: Path, truth: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    demands = iter([100.0, 110.0])  # the true one first: it lacks rooms more often

    def simulated(model: Path, epw: Path, folder: Path, say: object) -> SimulationResult:
        demand = BuildingDemand("a", 10.0, (0.0,) * 12, next(demands), 0.0)
        return SimulationResult((demand,), "Gothenburg", "25.2")

    def failing(error: Exception) -> Any:
        def simulate(*_: object) -> None:
            raise error

        return simulate

    monkeypatch.setattr(evaluation, "read_weather", lambda epw: None)
    monkeypatch.setattr(evaluation, "simulate", simulated)
    epw = write(tmp_path / "year.epw", {})
    known = evaluate_model(run, truth, epw=epw)
    assert known.heating[0].relative_error == pytest.approx(0.1)
    assert known.weather == "Gothenburg"
    assert "110 kWh a year against 100 (+10.0 %), 11.0 kWh/m2" in evaluation_table(known)
    assert "Heating demand of a year" in evaluation_report(known)
    for error in (MissingDependencyError("needs si3fp[energy]"), SimulationError("it froze")):
        monkeypatch.setattr(evaluation, "simulate", failing(error))
        known = evaluate_model(run, truth, epw=epw)
        assert known.heating == ()
        assert any(str(error) in note for note in known.notes)
    assert any("--epw" in note for note in evaluate_model(run, truth).notes)


def test_a_wrong_weather_file_is_an_error(run: Path, truth: Path) -> None:
    with pytest.raises(InputError, match="weather file"):
        evaluate_model(run, truth, epw=truth)


@pytest.mark.slow
@pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in ("honeybee_energy", "pyenergyplus")),
    reason="the extra `energy` is not installed",
)
def test_more_glass_changes_the_demand_of_heat(tmp_path: Path) -> None:
    from tests.test_energyplus import make_model

    from si3fp.thermal.weather import shipped_epw

    true = make_model()
    found = json.loads(json.dumps(true))
    for face in (face for room in found["rooms"] for face in room["faces"]):
        face["apertures"] = []
    known = evaluate_model(
        write(tmp_path / "found.hbjson", found),
        write(tmp_path / "true.hbjson", true),
        tmp_path / "out",
        epw=shipped_epw(),
    )
    assert known.result.windows_total.recall == 0.0
    (row,) = known.heating
    assert row.relative_error is not None
    assert 0.01 < abs(row.relative_error) < 0.5
    assert (tmp_path / "out" / "simulation" / "found" / "eplusout.sql").exists()


def test_the_verb(
    run: Path,
    truth: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ["evaluate", run, "--truth", truth, "-o", tmp_path / "out", "--join-touching"]
    monkeypatch.setattr(sys, "argv", ["si3fp", *map(str, words)])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert stop.value.code == 0
    out, _ = capsys.readouterr()
    assert "facades found" in out
    assert f"report: {tmp_path / 'out' / 'evaluation.html'}" in out
    assert (tmp_path / "out" / "evaluation.html").stat().st_size > 10_000
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert stop.value.code == 1
