"""The report of a run: complete, self-contained, well-formed, and drawn where it should be."""

import json
import re
from dataclasses import asdict
from html.parser import HTMLParser

import numpy as np
import pytest

from si3fp.config import StreetConfig
from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin, geodetic_from_world
from si3fp.model import Window
from si3fp.report.drawings import CameraPoint, WallLine, month_bars, nice_below, plan
from si3fp.report.figures import (
    NOT_SEEN,
    SEEN_ONCE,
    box_colour,
    coverage_palette,
    coverage_picture,
    opaque,
    overlay,
)
from si3fp.report.markup import VOID, Markup, number, percent_interval, tag
from si3fp.report.records import read_run
from si3fp.report.run_report import run_report, write_report
from si3fp.report.totals import wwr_of_building
from si3fp.workspace import Workspace, read_png, write_bytes, write_png

ORIGIN = {"lat_deg": 59.349, "lon_deg": 18.072, "height_m": 12.0}
OUTLINE = [[0.0, 0.0], [24.0, 0.0], [24.0, 11.0], [0.0, 11.0]]


def windows_of(width_m, height_m):
    """A regular grid of windows with a balcony door and an inferred one."""
    columns, rows = max(1, int(width_m // 2.6)), max(1, int(height_m // 3.1))
    return [
        Window(
            x_m=0.8 + 2.6 * column,
            y_m=0.9 + 3.0 * row,
            width_m=1.25,
            height_m=1.45,
            label="balcony_door" if column == 1 and row == 1 else "window",
            score=0.97 - 0.05 * ((column * 3 + row * 5) % 9),
            views=("p01", "p02", "p03")[: 1 + (column + row) % 3],
            origin="inferred" if column == 3 and row == 0 else "detected",
            edge_sigma_m=(0.02, 0.02, 0.03, 0.04),
            recess_m=0.12,
            correction_m=(0.0, 0.0, 0.0, 0.031),
            evidence="fused image, edges from gradients",
        )
        for row in range(rows)
        for column in range(columns)
    ]


def wall_picture(width_m, height_m, windows, m_per_px, seed):
    """RGBA: plaster with dark glass, and a corner that no camera saw."""
    rng = np.random.default_rng(seed)
    shape = (round(height_m / m_per_px), round(width_m / m_per_px))
    grain = rng.normal(0, 5, shape)[..., None]
    shade = np.linspace(12, -12, shape[1])[None, :, None]
    rgb = np.clip(np.array([206, 188, 160]) + grain + shade, 0, 255).astype(np.uint8)
    for window in windows:
        rows = slice(
            round((height_m - window.y_m - window.height_m) / m_per_px),
            round((height_m - window.y_m) / m_per_px),
        )
        columns = slice(
            round(window.x_m / m_per_px), round((window.x_m + window.width_m) / m_per_px)
        )
        rgb[rows, columns] = (238, 236, 230)
        frame = max(1, round(0.07 / m_per_px))
        rgb[
            rows.start + frame : rows.stop - frame, columns.start + frame : columns.stop - frame
        ] = (62, 78, 96)
    alpha = np.full(shape, 255, np.uint8)
    alpha[: shape[0] // 7, : shape[1] // 9] = 0
    return np.dstack([rgb, alpha])


def write_facade(workspace, name, building, start, bearing_deg, size_m, m_per_px):
    """One finished facade whose foot starts at ``start``, looking along the bearing."""
    width_m, height_m = size_m
    windows = windows_of(width_m, height_m)
    normal = np.array([np.sin(np.deg2rad(bearing_deg)), np.cos(np.deg2rad(bearing_deg)), 0.0])
    right = np.cross([0.0, 0.0, 1.0], normal)
    rotation = np.column_stack([right, [0.0, 0.0, 1.0], normal])
    picture = wall_picture(width_m, height_m, windows, m_per_px, seed=len(name))
    height_px, width_px = picture.shape[:2]
    middle = np.array([*start, 0.0]) + right * width_m / 2 + [0.0, 0.0, height_m / 2]
    lat, lon, height = geodetic_from_world(middle, GeoOrigin(**ORIGIN)).tolist()
    views = [
        {
            "source": f"p{index:02d}",
            "used": index < 9,
            "reason": "" if index < 9 else "too oblique" if index < 13 else "too few matches",
            "model": "similarity" if index < 9 else "none",
            "inliers": 400 - 23 * index if index < 9 else 0,
            "residual_before_px": 6.2 + 0.3 * index if index < 13 else None,
            "residual_after_px": 0.7 if index < 9 else None,
            "shift_m": 0.11 + 0.01 * index,
            "distance_m": 12.5 + index,
            "obliqueness_deg": 8.0 + 4 * index,
        }
        for index in range(15)
    ]
    gross = width_m * height_m
    wwr = sum(window.area_m2 for window in windows) / gross
    facade = {
        "id": name,
        "building_id": building,
        "edge": 0,
        "origin": ORIGIN,
        "world_from_facade": {"rotation": rotation, "translation": [*start, 0.0]},
        "width_m": width_m,
        "height_m": height_m,
        "wwr": wwr,
        "wwr_interval": [wwr - 0.021, wwr + 0.018],
        "centre": {"lat_deg": lat, "lon_deg": lon, "height_m": height},
        "m_per_px": m_per_px,
        "grid_px": [width_px, height_px],
        "views": views,
        "coverage": {"seen": 0.984, "seen_by_two": 0.93},
        "box": {
            "left_m": 0.12,
            "right_m": width_m + 0.12,
            "bottom_m": 0.0,
            "top_m": height_m,
            "evidence": {
                "left": "footprint corner and 4 lines",
                "right": "footprint corner",
                "bottom": "ground of the footprint",
                "top": "eaves line in 6 views",
            },
        },
        "plane": {"members": 14, "rms_m": 0.053, "angle_deg": 0.8},
        "notes": ["Recess of 0.12 m assumed: no depth was available."],
        "config": StreetConfig().as_dict(),
    }
    workspace.write_json(workspace.facade(name, "facade.json"), "facade", facade)
    workspace.write_json(
        workspace.facade(name, "windows.json"), "windows", {"windows": [asdict(w) for w in windows]}
    )
    write_png(workspace.facade(name, "ortho.png"), picture)
    rows, columns = np.indices((height_px, width_px))
    seen_by = 1 + 8 * np.sin(np.pi * columns / width_px) * (0.5 + 0.5 * rows / height_px)
    seen_by = np.where(picture[..., 3] > 0, seen_by, 0).astype(np.uint8)
    write_png(workspace.facade(name, "coverage.png"), seen_by)
    for index in range(4):
        write_png(
            workspace.facade(name, f"views/p{index:02d}.png"),
            np.roll(picture, 40 * index, axis=1)[::2, ::2],
        )


def write_run(root, m_per_px=0.1, building="west <wing> & co"):
    """A run with one building of four facades, two of them found, one wall without a building."""
    workspace = Workspace(root)
    write_facade(workspace, f"{building}-0", building, (0.0, 0.0), 180.0, (24.0, 9.6), m_per_px)
    write_facade(workspace, f"{building}-1", building, (24.0, 0.0), 90.0, (11.0, 9.4), m_per_px)
    write_facade(workspace, "wall-1", None, (-14.0, -22.0), 0.0, (9.0, 6.0), m_per_px)
    archetype = {
        "country": "SE",
        "period": [1961, 1975],
        "u_wall_w_m2k": 0.41,
        "u_roof_w_m2k": 0.22,
        "u_floor_w_m2k": 0.36,
        "u_window_w_m2k": 2.3,
        "g_window": 0.76,
        "notes": ["The footprint has no year: 1970 is assumed."],
    }
    cameras = [
        {
            "id": f"p{index:02d}",
            "captured": "2021-06" if index % 3 else "2022-09",
            "position_in_world": [-8.0 + 2.9 * index, -11.0 - (index % 3), 2.4],
            "used": index != 7,
        }
        for index in range(15)
    ]
    cameras.append(
        {"id": "far", "captured": "", "position_in_world": [900.0, 0.0, 2.4], "used": False}
    )
    head = {
        "started": "2024-03-05T09:14:00+00:00",
        "finished": "2024-03-05T09:15:12+00:00",
        "command": "si3fp street panoramas.geojson --footprints footprints.geojson -o run",
        "seconds": {"read": 3.1, "planes": 1.4, "views": 21.9, "align": 14.2, "detect": 18.8},
        "inputs": {"panoramas.geojson": "ab" * 32, "footprints.geojson": "cd" * 32},
        "origin": ORIGIN,
        "panoramas": cameras,
        "footprints": [
            {"id": building, "outline_in_world": OUTLINE, "ground_m": 0.0, "height_m": 9.6,
             "storeys": 3, "year": None},
        ],
        "buildings": [
            {"id": building, "storeys": 3, "height_m": 9.6, "wwr": 0.1934,
             "wwr_interval": [0.172, 0.211], "facades": [f"{building}-0", f"{building}-1"],
             "year": None, "archetype": archetype, "notes": ["Storeys come from the footprint."]},
        ],
        "missing": [
            {"facade_id": f"{building}-2", "step": "coverage", "reason": "No camera faces it."},
            {"facade_id": f"{building}-3", "step": "align", "reason": "2 views share 5 matches."},
        ],
        "unassigned": [
            {"panorama": "p03", "plane": 4, "reason": "6.1 m from the nearest footprint edge"},
        ],
        "notes": ["All capture dates were used: the latest alone gives 5 panoramas of 15."],
    }  # fmt: skip
    workspace.write_json(workspace.run_json, "run", head)
    months = [9100, 7800, 6900, 4100, 1800, 300, 60, 120, 900, 3600, 6300, 8600]
    floor_area_m2 = 792.0
    simulation = {
        "weather": "Stockholm",
        "buildings": [
            {"id": building, "floor_area_m2": floor_area_m2, "heating_kwh": sum(months),
             "heating_kwh_m2": sum(months) / floor_area_m2, "heating_kwh_by_month": months},
        ],
    }  # fmt: skip
    workspace.write_json(workspace.simulation / "result.json", "simulation", simulation)
    return workspace


class Outline(HTMLParser):
    """Open tags, attributes and text of a document; fails on a tag that does not balance."""

    def __init__(self, document):
        super().__init__(convert_charrefs=True)
        self.open, self.tags, self.text = [], [], []
        self.feed(document)
        self.close()
        assert not self.open, f"not closed: {self.open}"

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID | {"link", "input"}:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open and self.open[-1] == tag, f"</{tag}> closes {self.open[-3:]}"
        self.open.pop()

    def handle_data(self, data):
        if not self.open or self.open[-1] != "style":
            self.text.append(data)

    @property
    def words(self):
        return " ".join(" ".join(self.text).replace("\u00a0", " ").split())

    def count(self, name, class_=None):
        return sum(
            tag == name and (class_ is None or attributes.get("class") == class_)
            for tag, attributes in self.tags
        )


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    root = tmp_path_factory.mktemp("report") / "run"
    write_run(root)
    return root


@pytest.fixture(scope="module")
def document(run):
    return run_report(run)


@pytest.fixture(scope="module")
def outline(document):
    return Outline(document)


def test_document_is_well_formed_and_self_contained(document, outline):
    assert document.startswith("<!DOCTYPE html>")
    assert outline.count("script") == outline.count("link") == 0
    for _, attributes in outline.tags:
        for key in ("src", "href", "srcset", "xlink:href"):
            assert re.match(r"data:image/(png|jpeg);base64,|#", attributes.get(key, "#"))
    assert "http" not in document
    assert "url(" not in document


def test_links_lead_to_sections(outline):
    targets = {attributes["id"] for _, attributes in outline.tags if "id" in attributes}
    links = {attributes["href"] for _, attributes in outline.tags if "href" in attributes}
    assert links
    assert {link.removeprefix("#") for link in links} <= targets


def test_ids_are_escaped(document, outline):
    assert "west <wing> & co-0" in outline.words
    assert "<wing>" not in document
    assert not any(tag == "wing" for tag, _ in outline.tags)


def test_report_tells_what_was_found(outline):
    words = outline.words
    assert "Imagery of 2021-06 to" in words
    assert "16 panoramas (14 of them used) taken from 2021-06 to 2022-09" in words
    assert "3 of 5 facades were reconstructed (1 without a building)" in words
    assert "Windows take up 19.3 % (90 % interval 17.2–21.1 %)" in words
    assert "U-value window 2.30 W/(m²K)" in words
    assert "Construction period 1961–1975" in words
    assert "49 580 kWh" in words
    assert "7.4 px before registration (hollow), 0.7 px after" in words
    assert "too oblique (4 views)" in words
    assert "faces S (180°)" in words
    assert outline.count("section", "facade") == 3
    assert outline.count("svg", "bars") == outline.count("svg", "plan") == 1


def test_report_tells_what_is_missing_and_why(outline):
    words = outline.words
    assert "west <wing> & co-2 not seen by any camera No camera faces it." in words
    assert "west <wing> & co-3 failed at registering its views 2 views share 5 matches." in words
    assert "6.1 m from the nearest footprint edge" in words


def test_openings_are_counted_by_label(run, outline):
    facade = read_run(run).facades[0]
    doors = sum(window["label"] == "balcony_door" for window in facade["windows"])
    assert doors == 1
    assert f"{len(facade['windows']) - doors} windows, 1 balcony door" in outline.words


def test_sources_of_data_are_named(outline):
    assert "TABULA" in outline.words
    assert "CC BY 4.0" in outline.words


def test_writing_twice_gives_the_same_files(run):
    path = write_report(run)
    first = path.read_bytes()
    overlays = {p: p.read_bytes() for p in run.glob("facades/*/overlay.png")}
    assert len(overlays) == 3
    assert write_report(run).read_bytes() == first
    assert all(p.read_bytes() == content for p, content in overlays.items())


def test_a_few_megabytes_at_most(document):
    assert len(document) < 3_000_000


@pytest.mark.parametrize(
    "absent",
    ["simulation/result.json", "run.json", "facades/*/ortho.png", "facades/*/coverage.png",
     "facades/*/windows.json", "facades/*/views/*.png", "facades/*/facade.json"],
)  # fmt: skip
def test_absent_files_are_left_out(tmp_path, absent):
    write_run(tmp_path, m_per_px=0.2)
    for path in tmp_path.glob(absent):
        path.unlink()
    Outline(run_report(tmp_path))


def test_empty_records_are_tolerated(tmp_path):
    workspace = Workspace(tmp_path)
    workspace.write_json(workspace.run_json, "run", {})
    assert "No facade could be reconstructed." in Outline(run_report(tmp_path)).words
    workspace.write_json(workspace.facade("a-0", "facade.json"), "facade", {"id": "a-0"})
    write_png(workspace.facade("a-0", "ortho.png"), np.zeros((20, 30, 3), np.uint8))
    assert "Facade a-0" in Outline(run_report(tmp_path)).words


def test_every_key_of_a_facade_may_be_absent(tmp_path):
    workspace = write_run(tmp_path, m_per_px=0.2)
    path = workspace.facade("wall-1", "facade.json")
    whole = json.loads(path.read_text())
    for key in sorted(set(whole) - {"id"}):
        write_bytes(path, json.dumps({k: v for k, v in whole.items() if k != key}).encode())
        Outline(run_report(tmp_path))


def test_a_folder_without_a_run_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match="There is no run in"):
        run_report(tmp_path)


def test_a_facade_in_the_list_of_missing_is_not_shown_as_found(tmp_path):
    workspace = write_run(tmp_path, m_per_px=0.2, building="a")
    head = json.loads(workspace.run_json.read_text())
    head["missing"].append({"facade_id": "a-1", "step": "windows", "reason": "Too dark."})
    write_bytes(workspace.run_json, json.dumps(head).encode())
    known = read_run(tmp_path)
    assert [facade["id"] for facade in known.facades] == ["a-0", "wall-1"]
    assert len(known.missing) == 3


def test_overlay_file_has_its_box_around_the_window(run):
    workspace = Workspace(run)
    drawn = read_png(workspace.facade("wall-1", "overlay.png"))
    plain = opaque(read_png(workspace.facade("wall-1", "ortho.png")))
    changed = (drawn != plain).any(axis=2)
    # Window 0: x 0.8 m, y 0.9 m, 1.25 x 1.45 m on a 9 x 6 m wall at 0.1 m per pixel.
    rows, columns = np.nonzero(changed[:, :25])
    # Line, halo and anti-aliasing reach up to 4 pixels beyond the edge.
    assert abs(columns.min() - 8) <= 4
    assert abs(columns.max() - 20.5) <= 4
    assert abs(rows.max() - 51) <= 4
    assert abs(rows.min() - 36.5) <= 4
    assert not changed[:30].any()


def test_overlay_draws_lines_on_the_edges_and_nothing_elsewhere():
    blank = np.full((200, 300, 3), 128, np.uint8)
    drawn = overlay(blank, [[40.0, 60.0, 140.0, 160.0]], ["window"], [0.9])
    assert (blank == 128).all(), "the input must stay"
    blue = np.array(box_colour("window"))
    for row, column in [(110, 40), (110, 140), (160, 90)]:
        near = drawn[row - 1 : row + 1, column - 1 : column + 1].reshape(-1, 3).astype(int)
        assert np.abs(near - blue).max(axis=1).min() < 80
    assert (drawn[110, 60:120] == 128).all(), "inside"
    outside = drawn.copy()
    outside[56:165, 36:145] = 128
    assert (outside == 128).all(), "outside"


def test_overlay_colours_by_label_and_origin():
    blank = np.full((200, 300, 3), 255, np.uint8)
    boxes = [[20.0, 20.0, 120.0, 180.0], [160.0, 20.0, 260.0, 180.0]]
    drawn = overlay(blank, boxes, ["balcony_door"] * 2, [0.8] * 2, origins=["detected", "inferred"])
    middles = drawn[100, [20, 160]].astype(int)
    assert np.abs(middles[0] - box_colour("balcony_door")).max() < 140
    assert np.abs(middles[1] - box_colour("window", "inferred")).max() < 140
    assert box_colour("balcony_door") != box_colour("balcony_door", "inferred")


def test_overlay_writes_the_score_into_its_box():
    blank = np.full((200, 300, 3), 128, np.uint8)
    drawn = overlay(blank, [[40.0, 60.0, 140.0, 160.0]], ["window"], [0.37])
    other = overlay(blank, [[40.0, 60.0, 140.0, 160.0]], ["window"], [0.84])
    rows, columns = np.nonzero((drawn != other).any(axis=2))
    assert len(rows) > 20
    assert (rows.min() >= 60, rows.max() < 85) == (True, True)
    assert (columns.min() >= 40, columns.max() < 90) == (True, True)


def test_overlay_without_boxes_and_with_too_few_scores():
    blank = np.zeros((10, 10, 3), np.uint8)
    assert (overlay(blank, [], [], []) == blank).all()
    with pytest.raises(InputError, match="1 boxes, 1 labels, 0 scores"):
        overlay(blank, [[1, 1, 5, 5]], ["window"], [])


def test_coverage_picture_has_one_colour_per_number_of_views():
    seen_by = np.repeat(np.arange(6, dtype=np.uint8), 60)[None].repeat(50, axis=0)
    picture = coverage_picture(seen_by)
    palette = coverage_palette(5)
    assert picture.shape[1] == 360
    assert picture.shape[0] > 50
    assert (picture[:50] == palette[seen_by]).all()
    assert tuple(palette[0]) == NOT_SEEN
    assert tuple(palette[1]) == SEEN_ONCE
    assert len({tuple(colour) for colour in palette.tolist()}) == 6
    # The legend repeats every colour.
    legend = {tuple(pixel) for pixel in picture[50:].reshape(-1, 3).tolist()}
    assert {tuple(colour) for colour in palette.tolist()} <= legend


@pytest.mark.parametrize("shape", [(1, 1), (3, 700)])
def test_coverage_picture_of_nothing(shape):
    assert (coverage_picture(np.zeros(shape, np.uint8))[: shape[0]] == NOT_SEEN).all()


def test_opaque_keeps_seen_pixels():
    image = np.full((40, 40, 4), 255, np.uint8)
    image[..., :3] = (10, 20, 30)
    image[:, 20:, 3] = 0
    assert (opaque(image)[:, :20] == (10, 20, 30)).all()
    assert (opaque(image)[:, 20:] > 200).all()
    assert opaque(image[..., 0]).shape == (40, 40, 3)


def coordinates(markup, name):
    found = re.search(rf'<{name} [^>]*x1="([^"]+)" y1="([^"]+)" x2="([^"]+)" y2="([^"]+)"', markup)
    return [float(value) for value in found.groups()]


def test_plan_is_north_up_and_true_to_scale():
    wall = WallLine("0", np.array([[0.0, 0.0], [20.0, 0.0]]), "found")
    camera = CameraPoint("c", np.array([10.0, -10.0, 2.0]), used=True)
    drawing = plan([("b", np.array([[0.0, 0], [20, 0], [20, 10], [0, 10]]))], [wall], [camera])
    x1, y1, x2, y2 = coordinates(drawing, "line")
    assert y1 == y2
    px_per_m = (x2 - x1) / 20
    cx, cy = map(float, re.search(r'cx="([^"]+)" cy="([^"]+)"', drawing).groups())
    assert cx == pytest.approx((x1 + x2) / 2, abs=0.2)
    assert (cy - y1) / px_per_m == pytest.approx(10.0, abs=0.02)
    start, end = map(float, re.search(r'd="M([\d.]+) [\d.]+V[\d.]+H([\d.]+)V', drawing).groups())
    metres = float(re.search(r">(\d+)\u00a0m<", drawing)[1])
    assert (end - start) / px_per_m == pytest.approx(metres, abs=0.05)
    label_y = float(re.search(r'y="([\d.]+)"[^>]*>0</text>', drawing)[1])
    assert label_y > y1, "the label stands outside, here to the south"


def test_plan_of_nothing_is_left_out():
    assert plan([], [], []) is None
    one = [CameraPoint("c", np.zeros(3), used=False)]
    assert plan([], [], one) is not None


def test_month_bars_are_proportional():
    heights = [
        float(height)
        for height in re.findall(
            r'<rect [^>]*height="([^"]+)"', month_bars([100.0, 50.0, *[0.0] * 10])
        )
    ]
    assert heights[0] == pytest.approx(2 * heights[1], abs=0.2)
    assert heights[2] == 0
    assert month_bars([0.0] * 12).count("<rect") == 12


@pytest.mark.parametrize(("value", "nice"), [(7.0, 5.0), (20.0, 20.0), (0.3, 0.2), (1999, 1000)])
def test_nice_below(value, nice):
    assert nice_below(value) == pytest.approx(nice)


def test_markup_escapes_text_and_attributes():
    assert tag("i", '<"&', title='"') == '<i title="&quot;">&lt;&quot;&amp;</i>'
    assert tag("b", Markup("<i></i>"), None) == "<b><i></i></b>"


def test_numbers():
    assert number(float("nan")) == number(None) == number(True) == "–"
    assert number(-0.0004) == "0.00"
    assert percent_interval([0.1, 0.2]) == "10.0–20.0\u00a0%"
    assert percent_interval([0.1]) == percent_interval(None) == ""


def test_ratio_of_a_building_is_weighted_by_area():
    window = {"width_m": 2.0, "height_m": 5.0}
    facades = [
        {"width_m": 10.0, "height_m": 10.0, "windows": [window, window]},
        {"width_m": 30.0, "height_m": 10.0, "windows": []},
    ]
    assert wwr_of_building(facades) == pytest.approx(20 / 400)
    assert wwr_of_building(facades, {"wwr": 0.3}) == 0.3
    assert wwr_of_building([]) is None
