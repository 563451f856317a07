"""Heating demand by EnergyPlus: plausible, sensitive to the windows, errors surface."""

import dataclasses
import importlib.util
import json
import subprocess
import sys

import numpy as np
import pytest

from si3fp.config import ThermalConfig
from si3fp.errors import InputError, MissingDependencyError, SimulationError
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Building, Facade, GeoOrigin, Window
from si3fp.thermal import energyplus
from si3fp.thermal.archetypes import archetype
from si3fp.thermal.assemble import assemble
from si3fp.thermal.energyplus import simulate
from si3fp.thermal.weather import read_weather, shipped_epw

needs_energyplus = pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in ("honeybee_energy", "pyenergyplus")),
    reason="the extra `energy` is not installed",
)
HEADER = ["LOCATION,Köln,NW,DEU,made up,0,50.9,7.0,1.0,50.0", *["COMMENTS,-"] * 7]


def make_model(**changes):
    """A two-storey box of 12 x 9 m with 15 % glass in its long walls, without its files."""
    outline = np.array([(0.0, 0.0), (12.0, 0.0), (12.0, 9.0), (0.0, 9.0)])
    facades = []
    for index, (start, along) in {0: ((0, 0), 1), 2: ((12, 9), -1)}.items():
        pose = Rigid3(
            np.array([[along, 0, 0], [0, 0, -along], [0, 1, 0]], float), np.array([*start, 0.0])
        )
        windows = [Window(x, z, 1.2, 1.25) for z in (1.0, 3.8) for x in (1.0, 4.0, 7.0)]
        facades.append(Facade(f"b-{index}", pose, 12.0, 5.6, tuple(windows)))
    building = Building(
        "b", GeoOrigin(57.7, 12.0, 0), outline, 0.0, 5.6, 2, tuple(facades), year=1970
    )
    kind = dataclasses.replace(archetype("SE", 1970, 1970), **changes)
    return assemble([building], {"b": kind}, ThermalConfig()).hbjson


def run(folder, hbjson, progress=None):
    path = folder / "model.hbjson"
    path.write_text(json.dumps(hbjson), encoding="utf-8")
    return simulate(path, shipped_epw(), folder / "simulation", progress)


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    lines = []
    return run(tmp_path_factory.mktemp("base"), make_model(), lines.append), lines


@needs_energyplus
def test_a_box_needs_a_plausible_amount_of_heat_in_winter(simulated):
    result, lines = simulated
    (demand,) = result.buildings
    assert demand.id == "b"
    assert demand.floor_area_m2 == pytest.approx(2 * 12 * 9)
    # A steady-state balance of this box by hand. Loss in W/K: walls, windows, roof, half of the
    # floor (soil), air; over the heating season, less the heat of people and appliances.
    glass, walls = 12 * 1.2 * 1.25, 2 * (12 + 9) * 5.6
    loss_w_k = (walls - glass) * 0.41 + glass * 2.22 + 108 * (0.2 + 0.5 * 0.28)
    loss_w_k += 0.6 * 2.5 * 216 * 0.34
    outdoor_c = read_weather(shipped_epw()).outdoor_c
    season_kwh = sum(730.5 / 1000 * max(0.0, 21 - t) * loss_w_k for t in outdoor_c if t < 12)
    gains_kwh = sum(730.5 / 1000 * 3.0 * 216 for t in outdoor_c if t < 12)
    # The sun through 18 m2 of glass is left out: it may take up to a third of the rest.
    assert 0.65 * (season_kwh - gains_kwh) < demand.heating_kwh < season_kwh - gains_kwh
    assert demand.heating_kwh_m2 == pytest.approx(demand.heating_kwh / 216)
    months = demand.heating_kwh_by_month
    assert len(months) == 12
    assert sum(months) == pytest.approx(demand.heating_kwh)
    assert min(months) >= 0
    assert min(months[0], months[11]) > 10 * max(months[6], months[7])
    assert "25.2" in result.energyplus
    assert result.weather.startswith("Chicago")
    assert json.loads(json.dumps(result.as_dict()))["buildings"][0]["id"] == "b"
    assert any("%" in line for line in lines)


@needs_energyplus
def test_worse_windows_need_more_heat(simulated, tmp_path):
    base = simulated[0].buildings[0]
    worse = run(tmp_path, make_model(u_window_w_m2k=4.5)).buildings[0]
    # 18 m2 of glass lose 2.28 W/(m2K) more; EnergyPlus's surfaces make it some 30 % less.
    outdoor_c = read_weather(shipped_epw()).outdoor_c
    steady_kwh = sum(730.5 / 1000 * max(0.0, 21 - t) * 18 * 2.28 for t in outdoor_c if t < 12)
    assert 0.5 * steady_kwh < worse.heating_kwh - base.heating_kwh < 1.1 * steady_kwh


@needs_energyplus
def test_a_concave_building_beside_another_simulates(tmp_path):
    def building(name, outline, storeys, base_z_m):
        corners = np.array(outline, float)
        return Building(name, GeoOrigin(57.7, 12.0, 0), corners, base_z_m, 3.0 * storeys, storeys)

    court = building("court", [(0, 0), (6, 0), (12, 0), (12, 5), (6, 5), (6, 10), (0, 10)], 2, 0.5)
    house = building("house", [(12, 0), (20, 0), (20, 5), (12, 5)], 1, 0.0)
    kinds = {"court": archetype("SE", 1970, 1970), "house": archetype("SE", 1950, 1970)}
    result = run(tmp_path, assemble([court, house], kinds, ThermalConfig()).hbjson)
    areas = {row.id: row.floor_area_m2 for row in result.buildings}
    assert areas == pytest.approx({"court": 2 * 90, "house": 40})
    assert all(30 < row.heating_kwh_m2 < 250 for row in result.buildings)


MESSAGES = """Program Version,EnergyPlus
   ** Warning ** Some values
   **   ~~~   ** may be odd.
   ** Severe  ** A casting surface
   **   ~~~   ** is non-convex.
   ************* Testing Individual Branch Integrity
"""


@pytest.mark.parametrize(("ending", "code"), [("", 0), ("   **  Fatal  ** Stopped.\n", 0), ("", 1)])
@pytest.mark.skipif(sys.platform == "win32", reason="the stand-in for Python is a shell script")
def test_only_a_run_that_stops_is_an_error(tmp_path, monkeypatch, ending, code):
    (tmp_path / "said").write_text(MESSAGES + ending)
    stand_in = tmp_path / "python"
    stand_in.write_text(f"#!/bin/sh\necho news\ncp said eplusout.err\nexit {code}\n")
    stand_in.chmod(0o755)
    monkeypatch.setattr(energyplus.sys, "executable", str(stand_in))
    lines = []
    if ending or code:
        with pytest.raises(SimulationError, match="A casting surface is non-convex") as caught:
            energyplus._run(tmp_path / "job.json", tmp_path, lines.append)
        assert "may be odd" not in str(caught.value)
    else:
        energyplus._run(tmp_path / "job.json", tmp_path, lines.append)
        severe = energyplus._messages(tmp_path / "eplusout.err", "Severe")
        assert severe == ["A casting surface is non-convex."]
    assert lines == ["news"]


@needs_energyplus
def test_errors_of_energyplus_surface_with_its_words(tmp_path):
    model = make_model()
    wall = model["rooms"][0]["faces"][1]
    for x, corner in zip(
        (-50, 50, 50, -50), wall["apertures"][0]["geometry"]["boundary"], strict=True
    ):
        corner[0] = x  # a window much larger than its wall
    with pytest.raises(SimulationError, match=r"(?s)EnergyPlus failed.*eplusout\.err"):
        run(tmp_path, model)


@needs_energyplus
def test_an_error_of_the_writing_process_surfaces(tmp_path):
    model = make_model()
    model["rooms"][0]["properties"]["energy"]["construction_set"] = "nowhere"
    with pytest.raises(SimulationError, match=r"(?s)nowhere.*process\.log"):
        run(tmp_path, model)


@needs_energyplus
def test_a_model_without_heating_says_so(tmp_path):
    model = make_model()
    for room in model["rooms"]:
        del room["properties"]["energy"]["hvac"]
    with pytest.raises(SimulationError, match="No room of the model has heating"):
        run(tmp_path, model)


@needs_energyplus
def test_an_interrupt_ends_the_process(tmp_path):
    def interrupt(line):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, make_model(), interrupt)
    listing = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True, check=True)
    assert str(tmp_path) not in listing.stdout


@needs_energyplus
def test_the_shipped_weather_is_cold():
    weather = read_weather(shipped_epw())
    assert weather.outdoor_c[0] < 0 < weather.outdoor_c[6]


def test_a_missing_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(energyplus, "find_spec", lambda name: None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'si3fp\[energy\]'"):
        simulate(tmp_path / "m.hbjson", tmp_path / "w.epw", tmp_path)


def test_importing_the_package_does_not_import_the_extra():
    code = (
        "import sys, si3fp.thermal.energyplus\n"
        "bad = {'honeybee', 'honeybee_energy', 'ladybug', 'pyenergyplus'} & set(sys.modules)\n"
        "sys.exit(len(bad))"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


@needs_energyplus
@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "Could not read"),
        ("{", "not a honeybee model"),
        ("[1]", "not a honeybee model"),
        ('{"rooms": [{}]}', "not a honeybee model"),
        ('{"rooms": []}', "has no rooms to heat"),
        ('{"units": "Feet", "rooms": [{"identifier": "r", "faces": []}]}', "convert it to Meters"),
    ],
)
def test_an_unreadable_model_is_named(tmp_path, content, message):
    path = tmp_path / "model.hbjson"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=message):
        simulate(path, shipped_epw(), tmp_path / "simulation")


def year(dry_bulb_c=float):
    days = [31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31]
    return [
        f"2005,{month},{day},{hour},0,?9,{dry_bulb_c(month)},3.4,85"
        for month, length in enumerate(days, start=1)
        for day in range(1, length + 1)
        for hour in range(1, 25)
    ]


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-8-sig"])
def test_a_weather_file_may_be_utf8_or_latin1(tmp_path, encoding):
    path = tmp_path / "w.epw"
    path.write_text("\n".join([*HEADER, *year()]), encoding=encoding)
    weather = read_weather(path)
    assert weather.name == "Köln,NW,DEU"
    assert weather.outdoor_c == pytest.approx(range(1, 13))
    assert weather.text.isascii()


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (None, "Could not read the weather file"),
        ([], "is empty"),
        (["<html>", "404"], "must begin with LOCATION"),
        ([*HEADER, *year()[:5000]], "has 5000 hours"),
        ([*HEADER, *year()[:-1], "2005,12,31,24,0,?9,ice,3.4"], "line 8768, is not an hour"),
        ([*HEADER, *year()[:-1], "2005,12"], "line 8768, is not an hour"),
        ([*HEADER, *year(lambda month: 99.9)], "line 9, is not an hour"),
        ([*HEADER, *[year()[0]] * 8760], "lacks a month"),
    ],
)
def test_a_bad_weather_file_is_refused_by_name(tmp_path, lines, message):
    path = tmp_path / "bad.epw"
    if lines is not None:
        path.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputError, match=rf"bad\.epw.*{message}|{message}.*bad\.epw"):
        read_weather(path)
