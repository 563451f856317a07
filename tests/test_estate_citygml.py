"""Surveyed buildings: a small CityGML written here, and the real files of SI3FP_TEST_DATA."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from benchmarks.estate.plans.citygml import ingolstadt_estate, read_citygml
from benchmarks.estate.plans.citygml_file import read_city_file
from benchmarks.estate.specs import survey_of
from click.testing import CliRunner

from si3fp.errors import InputError

HEAD = """<?xml version="1.0" encoding="utf-8"?>
<core:CityModel xmlns:core="http://www.opengis.net/citygml/2.0"
 xmlns:bldg="http://www.opengis.net/citygml/building/2.0"
 xmlns:gml="http://www.opengis.net/gml">
<gml:boundedBy><gml:Envelope srsName="EPSG:32632"/></gml:boundedBy>
<core:cityObjectMember><bldg:Building gml:id="house">
"""
TAIL = "</bldg:Building></core:cityObjectMember></core:CityModel>"
# On the central meridian grid north is north; the scale there is 0.9996.
EAST_M, NORTH_M, GROUND_M = 500_000.0, 5_400_000.0, 410.0
SCALE = 0.9996


def ring(*corners: tuple[float, float, float]) -> str:
    """A polygon of true metres east, north, up of the house's corner."""
    numbers = " ".join(
        f"{EAST_M + x * SCALE:.4f} {NORTH_M + y * SCALE:.4f} {GROUND_M + z:.4f}"
        for x, y, z in (*corners, corners[0])
    )
    return (
        "<gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing>"
        f'<gml:posList srsDimension="3">{numbers}</gml:posList>'
        "</gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>"
    )


def surface(kind: str, *rings: str) -> str:
    geometry = f"<gml:MultiSurface>{''.join(rings)}</gml:MultiSurface>"
    return (
        f"<bldg:boundedBy><bldg:{kind}><bldg:lod3MultiSurface>{geometry}"
        f"</bldg:lod3MultiSurface></bldg:{kind}></bldg:boundedBy>"
    )


def opening(kind: str, name: str, *rings: str) -> str:
    """As in the real files: a wall surface that holds nothing but its opening."""
    return (
        f'<bldg:boundedBy><bldg:WallSurface><bldg:opening><bldg:{kind} gml:id="{name}">'
        f"<bldg:lod3MultiSurface><gml:MultiSurface>{''.join(rings)}</gml:MultiSurface>"
        f"</bldg:lod3MultiSurface></bldg:{kind}></bldg:opening></bldg:WallSurface></bldg:boundedBy>"
    )


def upright(x0: float, x1: float, z0: float, z1: float, y: float = 0.0) -> str:
    """A rectangle that faces south."""
    return ring((x0, y, z0), (x1, y, z0), (x1, y, z1), (x0, y, z1))


# 12 m east by 8 m north, eaves 6 m, gables in the east and west that rise 3 m.
SHELL = (
    surface("GroundSurface", ring((0, 0, 0), (0, 8, 0), (12, 8, 0), (12, 0, 0), (6, 0, 0)))
    + surface("WallSurface", upright(0, 12, 0, 6))
    + surface("WallSurface", ring((12, 8, 0), (0, 8, 0), (0, 8, 6), (12, 8, 6)))
    + surface("WallSurface", ring((12, 0, 0), (12, 8, 0), (12, 8, 6), (12, 4, 9), (12, 0, 6)))
    + surface("WallSurface", ring((0, 8, 0), (0, 0, 0), (0, 0, 6), (0, 4, 9), (0, 8, 6)))
)


def written(folder: Path, body: str) -> Path:
    path = folder / "house.xml"
    path.write_text(HEAD + body + TAIL, encoding="utf-8")
    return path


def test_walls_windows_and_gables_are_the_surveys(tmp_path: Path) -> None:
    body = SHELL + (
        opening("Window", "plain", upright(2, 3.2, 1, 2.5, y=0.12))
        + opening("Door", "door", upright(5, 6, 0, 2.1, y=0.12))
        + opening(
            "Window", "gable", ring((12, 3.5, 6.5), (12, 4.5, 6.5), (12, 4.5, 7.5), (12, 3.5, 7.5))
        )
    )
    reading = read_citygml(written(tmp_path, body))
    (building,) = reading.buildings
    survey = reading.survey
    assert (survey.openings, survey.kept, survey.recess_measured) == (3, 3, 2)
    assert str(survey) == "The plan has 3 of 3 surveyed openings."
    assert building.roof.kind == "gable"
    assert building.height_m == pytest.approx(6.0, abs=0.002)
    assert building.roof.rise_m == pytest.approx(3.0, abs=0.002)
    south = next(wall for wall in building.walls if len(wall.openings) == 2)
    east = next(wall for wall in building.walls if len(wall.openings) == 1)
    # True metres: the scale of the map, 0.9996, is taken out. Rounding: a millimetre.
    assert south.width_m == pytest.approx(12.0, abs=0.003)
    assert south.world_from_facade.rotation[:, 2] == pytest.approx([0, -1, 0], abs=1e-3)
    window, door = south.openings
    assert (window.x_m, window.y_m) == pytest.approx((2, 1), abs=0.003)
    assert (window.width_m, window.height_m) == pytest.approx((1.2, 1.5), abs=0.003)
    assert window.recess_m == pytest.approx(0.12, abs=0.003)
    assert (door.kind, door.x_m) == ("door", pytest.approx(5, abs=0.003))
    assert east.outline is not None
    assert east.height_m == pytest.approx(9.0, abs=0.002)
    assert east.openings[0].x_m == pytest.approx(3.5, abs=0.003)
    # The recess of the gable's window is not in the survey (it lies in the wall's face).
    assert 0.05 < east.openings[0].recess_m < 0.25


def test_walls_run_counter_clockwise_and_close(tmp_path: Path) -> None:
    (building,) = read_citygml(written(tmp_path, SHELL)).buildings
    x, y = building.outline.T
    signed_area = (x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    assert len(building.walls) == 4  # the corner halfway along the south is none
    assert signed_area == pytest.approx(96.0, abs=0.1)
    for wall, after in zip(building.walls, [*building.walls[1:], building.walls[0]], strict=True):
        assert wall.end == after.start


def test_every_opening_is_kept_or_has_a_reason(tmp_path: Path) -> None:
    slanted = ring((5, 1, 6.8), (6, 1, 6.8), (6, 1.7, 7.4), (5, 1.7, 7.4))
    body = SHELL + (
        opening("Window", "left part", upright(1, 2, 1, 2.5))
        + opening("Window", "right part", upright(2.03, 3, 1, 2.5))
        + opening("Window", "in the left part", upright(1.2, 1.6, 1.2, 2))
        + opening("Window", "bay", upright(5, 6, 3, 4.5, y=-0.9))
        + opening("Window", "dormer", upright(5, 6, 6.8, 7.6))
        + opening("Window", "set back", upright(8, 9, 3, 4.5, y=2.5))
        + opening("Window", "roof", slanted)
        + opening("Window", "nowhere")
        + opening("Window", "slit", upright(9, 9.1, 3, 4.5))
    )
    reading = read_citygml(written(tmp_path, body))
    survey = reading.survey
    assert (survey.openings, survey.kept, survey.flattened) == (9, 2, 1)
    assert survey.kept + sum(survey.gone.values()) == survey.openings
    assert survey.gone == {
        "joined with another part of the same opening": 1,
        "inside another opening": 1,
        "above the eaves (dormers)": 1,
        "far from the ground's outline (dormers, set-back storeys)": 1,
        "in a slanted surface": 1,
        "without geometry": 1,
        "smaller than 0.3 m": 1,
    }
    assert str(survey).startswith("The plan has 2 of 9 surveyed openings; joined or left out: 1 ")
    assert all(f"1 {reason}" in str(survey) for reason in survey.gone)
    openings = [o for wall in reading.buildings[0].walls for o in wall.openings]
    whole = min(openings, key=lambda o: o.x_m)
    assert (whole.x_m, whole.width_m) == pytest.approx((1, 2), abs=0.003)


def test_a_round_head_becomes_an_arch_in_its_bounding_rectangle(tmp_path: Path) -> None:
    angles = np.linspace(0, np.pi, 25)
    head = [(3 + 0.5 * np.cos(a), 0.0, 2.5 + 0.5 * np.sin(a)) for a in angles]
    round_headed = ring((2.5, 0, 1), (3.5, 0, 1), *head)
    path = written(tmp_path, SHELL + opening("Window", "w", round_headed))
    (building,) = read_citygml(path).buildings
    (found,) = [o for wall in building.walls for o in wall.openings]
    assert (found.width_m, found.height_m) == pytest.approx((1.0, 2.0), abs=0.003)
    assert found.style.arch == pytest.approx(0.5, abs=0.02)


def test_a_seed_gives_one_plan_and_another_seed_another_look(tmp_path: Path) -> None:
    path = written(tmp_path, SHELL + opening("Window", "w", upright(2, 3, 1, 2.5)))
    first, again, other = (read_citygml(path, seed).buildings for seed in (1, 1, 2))
    assert first == again
    assert first != other
    assert [w.start for w in first[0].walls] == [w.start for w in other[0].walls]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("<core:CityModel", '<!DOCTYPE a [<!ENTITY b "c">]><core:CityModel', 1), "document type"),  # noqa: E501
        (lambda text: text.replace("</core:CityModel>", ""), "not readable XML"),
        (lambda text: text.replace("GroundSurface", "RoofSurface"), "no building with a Ground"),
        (lambda text: text.replace("EPSG:32632", "EPSG:4326"), "projected system in metres"),
        (lambda text: text.replace("EPSG:32632", "EPSG:99999999"), "unknown reference system"),
        (lambda text: text.replace(' srsName="EPSG:32632"', ""), "names no reference system"),
        (lambda text: text.replace("500000.0000", "nan", 1), "not finite"),
        (lambda text: text.replace("500000.0000", "east", 1), "no list of x y z"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_said(tmp_path: Path, change, message: str) -> None:
    path = written(tmp_path, SHELL)
    path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        read_city_file(path)


def test_a_declared_encoding_hides_no_document_type(tmp_path: Path) -> None:
    path = tmp_path / "house.xml"
    path.write_bytes('<?xml version="1.0" encoding="utf-16"?><!DOCTYPE a><a/>'.encode("utf-16"))
    with pytest.raises(InputError, match="UTF-8"):
        read_city_file(path)


def test_an_estate_has_its_street_in_front_of_the_windows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written(tmp_path, SHELL + opening("Window", "w", upright(2, 3, 1, 2.5)))
    estate = ingolstadt_estate("house", 1, tmp_path)
    (line,) = estate.panorama_lines
    # The south wall lies half the depth of the building south of the origin; then 9 m and half a
    # road of 7 m. The origin is rounded to 1e-5 degrees, about a metre.
    assert [y for _, y in line] == pytest.approx([-4 - 9 - 3.5] * 2, abs=1.2)
    monkeypatch.delenv("SI3FP_TEST_DATA", raising=False)
    with pytest.raises(InputError, match="SI3FP_TEST_DATA"):
        ingolstadt_estate("house", 1)
    with pytest.raises(InputError, match="it has house"):
        ingolstadt_estate("barn", 1, tmp_path)


def test_the_command_says_and_records_what_became_of_the_openings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mitsuba")
    from benchmarks.estate.__main__ import main

    asked: dict[str, object] = {}
    monkeypatch.setattr(
        "benchmarks.estate.build.build", lambda *_, **options: asked.update(options)
    )
    body = opening("Window", "w", upright(2, 3, 1, 2.5)) + opening("Window", "nowhere")
    written(tmp_path, SHELL + body)
    arguments = ["build", "ingolstadt:house", "--data", str(tmp_path), "-o", str(tmp_path / "set")]
    result = CliRunner().invoke(main, arguments, catch_exceptions=False)
    line = "The plan has 1 of 2 surveyed openings; joined or left out: 1 without geometry."
    assert line in result.stderr
    assert asked["survey"] == {
        "openings": 2,
        "kept": 1,
        "gone": {"without geometry": 1},
        "flattened": 0,
        "recess_measured": 0,
    }
    assert survey_of("small") is None


@pytest.mark.slow
def test_the_real_buildings_keep_nine_openings_in_ten() -> None:
    data = os.environ.get("SI3FP_TEST_DATA")
    if not data:
        pytest.skip("SI3FP_TEST_DATA is not set")
    files = sorted((Path(data) / "lod3-ingolstadt").glob("*.xml"))
    readings = [read_citygml(file) for file in files]
    assert len(files) == 32
    assert sum(r.survey.openings for r in readings) == 761
    assert sum(r.survey.kept for r in readings) == 691
    assert all(s.kept + sum(s.gone.values()) == s.openings for s in (r.survey for r in readings))
    for building in (b for r in readings for b in r.buildings):
        for wall in building.walls:
            assert all(o.x_m > 0 and o.x_m + o.width_m < wall.width_m for o in wall.openings)
            assert all(o.y_m >= 0 and o.y_m + o.height_m < wall.height_m for o in wall.openings)
