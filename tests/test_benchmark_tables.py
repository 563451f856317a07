"""The tables of the benchmark, from evaluations made up here."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.tables import __main__ as command
from benchmarks.tables import paper
from benchmarks.tables.cases import Case, read
from benchmarks.tables.cells import cell, verdict
from benchmarks.tables.failures import FOUND_RGB, TRUE_RGB, drawn, worst_facade, write_worst
from benchmarks.tables.plan import FOUND, MISSING, plan
from benchmarks.tables.scores import metrics, pooled, scored
from benchmarks.tables.stages import Stage, read_stage, run_stage
from benchmarks.tables.tables import BEGIN, END, block, replaced
from PIL import Image

from si3fp.errors import InputError
from si3fp.evaluate import evaluate
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Facade, Window
from si3fp.workspace import dump_json

COLUMN = {column.name: column for column in paper.COLUMNS}


def facade(name: str, edge: int, windows: list[tuple[float, float, float, float]]) -> Facade:
    """A wall of 10 x 5 m, ten metres behind the one before; windows as x, y, width, height."""
    axes = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    return Facade(
        f"{name}-{edge}",
        Rigid3(axes, np.array([0.0, 10.0 * edge, 0.0])),
        10.0,
        5.0,
        tuple(Window(*w, "window", 1.0, 1, "detected") for w in windows),
        None,
    )


def evaluation(name: str = "b1", shift_m: float = 0.1, missing: bool = True) -> dict[str, Any]:
    """Facade 0 has two windows, one found ``shift_m`` too far right and the other not.

    Facade 1 has balconies and one window, found exactly, and one found that is not there. Facade 2
    has one window and may be missing.
    """
    truth = [
        facade(name, 0, [(1, 1, 1, 1), (5, 1, 1, 1)]),
        facade(name, 1, [(1, 1, 2, 1)]),
        facade(name, 2, [(1, 1, 5, 2)]),
    ]
    found = [
        facade(name, 0, [(1 + shift_m, 1, 1, 1)]),
        facade(name, 1, [(1, 1, 2, 1), (6, 1, 1, 1)]),
        *([] if missing else [truth[2]]),
    ]
    result = evaluate(found, truth, balcony_facades={f"{name}-1"})
    return asdict(result)


def written(folder: Path, case: Case, content: dict[str, Any]) -> Case:
    """A case whose stages are all done, on disk."""
    done = Stage(True, ("made", "up"), "", "", 100.0, 2048.0, "a machine")
    for stage in ("build", case.run_name, f"{case.run_name}-scores"):
        case.record(stage).parent.mkdir(parents=True, exist_ok=True)
        case.record(stage).write_text(dump_json(asdict(done)), encoding="utf-8")
    for file, payload in (
        (case.scores_folder / "evaluation.json", content),
        (
            case.run_folder / "run.json",
            {"seconds": {"S.2 cluster": 1.5, "S.2 views": 2.5, "write": 6.0}, "si3fp_version": "1"},
        ),
    ):
        file.parent.mkdir(parents=True)
        file.write_text(dump_json(payload), encoding="utf-8")
    panoramas = case.set_folder / "panoramas"
    panoramas.mkdir(parents=True)
    for name in ("p0", "p1"):
        Image.new("RGB", (64, 32)).save(panoramas / f"{name}.jpg")
    spent = {"seconds": {"panoramas": 50.0, "photos": 9.0, "masks": 3.0, "orthophotos": 40.0}}
    (case.set_folder / "estate.json").write_text(dump_json(spent), encoding="utf-8")
    return read(case)


def test_metrics_are_those_of_the_evaluation() -> None:
    content = evaluation()
    for total in (False, True):
        suffix = "_total" if total else ""
        ours = metrics(scored(content, total=total), total=total)
        plain = content["without_balconies"]
        assert ours["f1"] == pytest.approx(content[f"windows{suffix}"]["f1"])
        assert ours["f1_plain"] == pytest.approx(plain[f"windows{suffix}"]["f1"])
        for name, key in (
            ("wwr", "mean"),
            ("wwr_absolute", "mean_absolute"),
            ("wwr_by_area", "area_weighted"),
        ):
            assert ours[name] == pytest.approx(content[f"wwr{suffix}"][key])
    # By hand: one of two, one and one wrong, 0 of 1: F1 = 2 * 2 / (2 * 2 + 1 + 2).
    assert metrics(scored(content, total=True), total=True)["f1"] == pytest.approx(4 / 7)
    # Ratios found 0.02 and 0.06, true 0.04, 0.04 and 0.2: the missing one gets 0.04.
    imputed = metrics(scored(content, total=True), total=True)["imputed"]
    assert imputed == pytest.approx((-0.02 + 0.02 - 0.16) / 3)
    assert imputed == pytest.approx(content["wwr_imputed"]["mean"])
    standard = metrics(scored(content, total=False), total=False)
    assert standard["position_m"] == pytest.approx(0.05)
    assert standard["iou"] == pytest.approx((0.9 / 1.1 + 1) / 2)
    assert standard["imputed"] is None


def test_pooling_is_micro_over_windows_and_mean_over_facades() -> None:
    parts = [
        scored(evaluation("b1", missing=False), total=False),
        scored(evaluation("b2"), total=False),
    ]
    both = metrics(pooled(parts), total=False)
    # Hits 3 and 2, wrong 1 and 1, missed 1 and 1.
    assert both["f1"] == pytest.approx(2 * 5 / (2 * 5 + 4))
    # Errors of the five facades found: -0.02, 0.02, 0 and -0.02, 0.02.
    assert both["wwr"] == pytest.approx(0.0)
    assert both["wwr_absolute"] == pytest.approx(0.08 / 5)
    assert metrics(pooled([]), total=False)["f1"] is None


def test_cells_say_mean_range_and_which_is_better() -> None:
    assert cell([0.9, 0.8], 0.75, COLUMN["f1"]) == "**0.85 (0.80 to 0.90)**"
    assert cell([0.7], 0.75, COLUMN["f1"]) == "*0.70*"
    assert cell([0.751], 0.75, COLUMN["f1"]) == "0.75"
    assert cell([0.1234], 0.171, COLUMN["area"]) == "**12.3**"
    assert cell([], 0.75, COLUMN["f1"]) == "-"
    assert cell([0.02], None, COLUMN["wwr"]) == "+0.020"
    assert cell([-0.0001], None, COLUMN["wwr"]) == "+0.000"
    # The mean of +0.1 and -0.1 is 0, but neither seed is better than 0.05.
    assert verdict([0.1, -0.1], -0.05, COLUMN["wwr"]) == "worse"
    assert verdict([0.02, -0.02], -0.05, COLUMN["wwr"]) == "better"


def test_the_papers_tables_are_whole() -> None:
    assert len(paper.TABLE_3) == 12
    for (_, method), row in paper.TABLE_3.items():
        named = {name for name, value in row.items() if value is not None}
        total = method == paper.STREET_TOTAL
        assert named == (
            {"f1", "f1_plain", "wwr", "imputed"}
            if total
            else {"f1", "f1_plain", "iou", "area", "position_m", "wwr"}
        )
    assert paper.TABLE_3["b3", paper.STREET]["f1"] == 0.28
    assert [row.missing for row in paper.TABLE_2.values()] == [3, 1, 2]


def test_tables_with_what_is_there_and_dashes_for_the_rest(tmp_path: Path) -> None:
    first = written(
        tmp_path, Case("b1", 1, "street", "radiance", tmp_path / "b1-small-1"), evaluation()
    )
    second = read(Case("b2", 1, "street", "radiance", tmp_path / "b2-small-1"))
    assert (first.problem, second.problem) == ("", "not done yet: build")
    text = block([first, second], "a command")
    rows = [[c.strip() for c in line.split("|")[1:-1]] for line in text.splitlines() if "|" in line]
    ours = {tuple(row[:2]): row[2:] for row in rows}
    assert ours["b1", "paper, StreetView"][:3] == ["0.75", "0.97", "0.70"]
    # F1 of the facades found: 2 * 2 / (2 * 2 + 1 + 1); without balconies 2 / (2 + 1).
    assert ours["b1", "ours, street"][:3] == ["*0.67*", "*0.67*", "**0.91**"]
    assert ours["b1", "ours, street (Total)"][0] == "*0.57*"
    assert set(ours["b2", "ours, street"]) == {"-"}
    assert set(ours["Total", "ours, street"]) == {"-"}
    assert not any(name.startswith("ours, photos") for _, name in ours)
    assert ours["b1", "ours"][:7] == ["5.0", "10.0", "3", "-", "-", "2", "64 x 32"]
    assert ours["b1", "ours"][7] == "1.0, 33.3 %"
    steps = {row[0]: row[1:] for row in rows}
    assert steps["S.2 (s)"] == ["< 1 min", "4.0"]
    assert steps["files, report, start-up (s)"] == ["-", "96.0"]
    assert steps["peak memory (GiB)"] == ["-", "2.0"]
    assert "- b2 seed 1 street: not done yet: build" in text
    assert "Rendering took: a panorama 25 s, the truth 43 s." in text
    assert "0 of" not in text.split("figures are better")[0].splitlines()[-1]


def test_both_renderers_of_photos_stand_below_one_row_of_the_paper(tmp_path: Path) -> None:
    shifts_m = {"mosaic": 0.0, "radiance": 0.1}
    cases = [
        written(
            tmp_path, Case("b1", 1, "photos", name, tmp_path / name), evaluation("b1", shift, False)
        )
        for name, shift in shifts_m.items()
    ]
    text = block(cases, "x")
    rows = [line.split(" | ") for line in text.splitlines() if line.startswith("| b1 |")][:3]
    assert [row[1] for row in rows] == [
        "paper, Camera2D",
        "ours, photos, mosaic",
        "ours, photos, radiance field",
    ]
    # Of three windows that are hits one is 0.1 m off: the mean position error is 0.033 m.
    assert [row[6] for row in rows] == ["0.065", "**0.000**", "**0.033**"]
    heads = [line for line in text.splitlines() if line.startswith("| step")]
    assert heads[0].endswith("| photos-mosaic | photos-radiance |")


def test_totals_are_of_all_buildings_and_only_the_papers_three_have_its_row(tmp_path: Path) -> None:
    cases = [
        written(tmp_path, Case(name, 1, "street", "radiance", tmp_path / name), evaluation(name))
        for name in ("b1", "b2", "b3")
    ]
    assert "| Total | paper, StreetView | 0.60 |" in block(cases, "x")
    two = block(cases[:2], "x")
    assert "| Total | paper" not in two
    assert "| Total | ours, street | 0.67 |" in two


def test_only_the_text_between_the_marks_is_replaced() -> None:
    page = f"# Page\n\n{BEGIN}\nold\n{END}\n\nmore\n"
    once = replaced(page, "| new |")
    assert once == f"# Page\n\n{BEGIN}\n\n| new |\n\n{END}\n\nmore\n"
    assert replaced(once, "| new |") == once
    for wrong in ("", BEGIN, f"{END}{BEGIN}", page + page):
        with pytest.raises(InputError, match="once each"):
            replaced(wrong, "new")


def test_a_done_stage_is_not_run_again_and_a_failed_one_is(tmp_path: Path) -> None:
    record, count = tmp_path / "stages" / "s.json", tmp_path / "count"
    code = (
        f"import sys, pathlib; p = pathlib.Path({str(count)!r}); "
        "n = len(p.read_text()) if p.exists() else 0; p.write_text('x' * (n + 1)); "
        "print('working'); print('no disk left'); sys.exit(1 if n == 0 else 3)"
    )
    words = [sys.executable, "-c", code]
    failed = run_stage(record, words)
    assert (failed.done, failed.reason) == (False, "exit code 1: no disk left")
    assert read_stage(record) == failed
    done = run_stage(record, words, allowed=(0, 3))
    assert done.done
    assert done.peak_mib > 1
    assert run_stage(record, words, allowed=(0, 3)) == done
    assert count.read_text() == "xx"
    run_stage(record, words, allowed=(0, 3), key="other inputs")
    assert count.read_text() == "xxx"


def test_a_stage_that_takes_too_long_is_ended(tmp_path: Path) -> None:
    words = [sys.executable, "-c", "import time; print('begun', flush=True); time.sleep(60)"]
    stage = run_stage(tmp_path / "s.json", words, limit_s=1.0)
    assert not stage.done
    assert stage.reason.startswith("stopped after 0 minutes")


def test_the_worst_facade_is_drawn_where_its_windows_are(tmp_path: Path) -> None:
    content = evaluation()
    worst = worst_facade(content)
    assert worst is not None
    # Both found facades have F1 2/3 and one error; the first by name.
    assert worst["facade_id"] == "b1-0"
    picture = drawn(worst, Image.new("RGB", (100, 50), (0, 0, 0)), (0, 0, 10, 5), "b1")
    # 11 x 6 m with margins at 50 px/m, below a caption of 48 px.
    assert picture.shape == (48 + 300, 550, 3)
    # The missed window's left side, 5 m from the left, 1.5 m up; margins 0.5 m.
    x_px, y_px = round(5.5 * 50), 48 + round((5.5 - 1.5) * 50)
    assert (picture[y_px, x_px + 1] == TRUE_RGB).all()
    # The other is found 0.1 m to the right of its place.
    assert (picture[y_px, round(1.6 * 50)] == FOUND_RGB).all()
    case = written(tmp_path, Case("b1", 1, "street", "radiance", tmp_path / "b1"), content)
    file = write_worst(case, tmp_path / "failures")
    assert file is not None
    assert file.name == "b1-seed1-street-b1-0.png"
    # The run's picture lies where the run put its facade, 0.5 m farther right and as wide.
    origin = {"lat_deg": 57.0, "lon_deg": 12.0, "height_m": 0.0}
    frame = {"rotation": np.eye(3).tolist(), "translation": [3.0, 0.0, 0.0]}
    moved = {**frame, "translation": [3.5, 0.0, 0.0]}
    shown = case.run_folder / "facades" / worst["found_id"]
    shown.mkdir(parents=True)
    Image.new("RGB", (10, 5), (0, 0, 255)).save(shown / "ortho.png")
    for file, payload in (
        (shown / "facade.json", {"width_m": 10.0, "height_m": 5.0, "world_from_facade": moved}),
        (case.set_folder / "truth" / "facades.json",
         {"facades": {worst["facade_id"]: {"world_from_facade": frame}}}),
    ):  # fmt: skip
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(dump_json({**payload, "origin": origin}), encoding="utf-8")
    file = write_worst(case, tmp_path / "failures")
    picture = np.asarray(Image.open(file))
    assert picture.shape == (48 + 300, round(11.5 * 50), 3)
    row = picture[48 + 30]
    blue = np.flatnonzero((row == (0, 0, 255)).all(axis=1))
    assert (blue.min(), blue.max() + 1) == (50, 550)
    perfect = evaluation(shift_m=0.0)
    perfect["facades"] = [f for f in perfect["facades"] if f["windows"]["f1"] == 1]
    assert worst_facade(perfect) is None


def test_the_plan_shows_which_facades_were_found_and_where_the_cameras_stood() -> None:
    axes = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    content = evaluation()["facades"]
    truth = {
        each["facade_id"]: {
            "width_m": 10.0,
            "world_from_facade": {
                "rotation": axes.tolist(),
                "translation": [0, 10.0 * int(each["facade_id"][-1]), 0],
            },
        }
        for each in content
    }
    (drawn_axes,) = plan(content, truth, [[5.0, -8.0, 2.5], [9.0, -8.0, 2.5]], "b1").axes
    cameras, *walls = drawn_axes.lines
    assert np.array(cameras.get_data()).T.tolist() == [[5.0, -8.0], [9.0, -8.0]]
    for each, wall in zip(content, walls, strict=True):
        north = 10.0 * int(each["facade_id"][-1])
        assert np.array(wall.get_data()).T.tolist() == [[0.0, north], [10.0, north]]
        assert wall.get_color() == (FOUND if each["found_id"] else MISSING)
    assert {wall.get_color() for wall in walls} == {FOUND, MISSING}
    # Labels stand outside of their walls, here to the south.
    assert drawn_axes.texts[0].get_position() == (5.0, -4.0)


def test_the_command_writes_the_page_and_says_what_failed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"{BEGIN}\n{END}\n", encoding="utf-8")
    words = ["--buildings", "b1", "--seeds", "1", "--paths", "street", "--only-tables"]
    words += ["-o", str(tmp_path / "out"), "--docs", str(page)]
    assert command.main(words) == 1
    assert "b1 seed 1 street: not done yet: build" in page.read_text(encoding="utf-8")
    assert "paper, StreetView" in capsys.readouterr().out
    page.write_text("no marks", encoding="utf-8")
    with pytest.raises(InputError, match="once each"):
        command.main(words)
