"""Facade pictures for training: plans without overlaps, exact boxes, one picture per number."""

import json
from collections import Counter
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from benchmarks.estate.facades.facade_camera import FacadeCamera
from benchmarks.estate.facades.facade_labels import CATEGORIES, Label, labels_of
from benchmarks.estate.facades.facades_cli import coco_of
from benchmarks.estate.facades.styles import STYLES, facade_plan
from benchmarks.estate.facades.styles_draft import Draft, FacadePlan, box_of
from benchmarks.estate.meshes.opening_meshes import Joinery, filling_parts
from benchmarks.estate.plan import Balcony, Behind, Finish, Opening, Wall, WindowStyle

from si3fp.errors import Si3fpError
from si3fp.geometry.rigid import Rigid3

FRONT = Rigid3(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), np.zeros(3))
"""A wall along the x axis that looks south."""


@pytest.mark.parametrize("style", STYLES)
def test_openings_lie_inside_the_wall_and_apart(style: str) -> None:
    for number in range(12):
        wall = facade_plan(7, number, style).wall
        boxes = [box_of(opening) for opening in wall.openings]
        for x0, y0, x1, y1 in boxes:
            assert x0 >= 0
            assert y0 >= 0
            assert x1 <= wall.width_m
            assert y1 <= wall.height_m
        for one, other in combinations(boxes, 2):
            apart = max(one[0] - other[2], other[0] - one[2], one[1] - other[3], other[1] - one[3])
            assert apart >= 0


@pytest.mark.parametrize("style", STYLES)
def test_openings_behind_the_wall_lie_in_a_loggia(style: str) -> None:
    for number in range(12):
        wall = facade_plan(3, number, style).wall
        loggias = [balcony for balcony in wall.balconies if balcony.kind == "loggia"]
        for opening in wall.openings:
            middle = opening.x_m + opening.width_m / 2
            holding = [
                loggia
                for loggia in loggias
                if loggia.x_m <= middle <= loggia.x_m + loggia.width_m
                and loggia.y_m - 0.3 <= opening.y_m <= loggia.y_m + loggia.clear_m
            ]
            assert bool(holding) == (opening.depth_m > 0)


@pytest.mark.parametrize("style", ["walk_up", "terrace", "works", "gruenderzeit"])
def test_windows_with_arches_are_not_boarded_up(style: str) -> None:
    arched = 0
    for number in range(40):
        for opening in facade_plan(1, number, style).wall.openings:
            if opening.style.arch and opening.kind == "window":
                arched += 1
                parts = filling_parts(opening, Joinery(0.01, None), np.random.default_rng(0))
                panes = [mesh for mesh in parts.meshes if mesh.material == "glass"]
                cells = len(opening.style.lights) * (2 if opening.style.transom else 1)
                assert len(panes) == cells
    assert arched > 0


def test_plans_depend_on_seed_and_number_alone() -> None:
    first = [facade_plan(5, number) for number in range(6)]
    assert [facade_plan(5, number) for number in reversed(range(6))] == first[::-1]
    assert facade_plan(6, 0) != first[0]


def test_every_style_comes_and_none_rules() -> None:
    counts = Counter(facade_plan(1, number).style for number in range(400))
    assert len(counts) == len(STYLES)
    assert max(counts.values()) < 100


def test_a_draft_refuses_what_overlaps_or_leaves_the_wall() -> None:
    draft = Draft(np.random.default_rng(0), 6.0, 3.0)
    style, behind = WindowStyle(), Behind()
    assert draft.opening("window", 1.0, 1.0, 1.2, 1.4, 0.1, style, behind)
    assert not draft.opening("window", 2.1, 1.0, 1.2, 1.4, 0.1, style, behind)
    assert not draft.opening("window", 5.0, 1.0, 1.2, 1.4, 0.1, style, behind)
    assert not draft.box(0.5, 1.2, 1.0, 0.3, 0.05, (0.5, 0.5, 0.5))
    assert draft.box(2.3, 1.2, 1.0, 0.3, 0.05, (0.5, 0.5, 0.5))


def _facade(depth_m: float = 0.0) -> FacadePlan:
    window = Opening("window", 2.0, 1.0, 1.0, 1.5, 0.1, WindowStyle(), depth_m=depth_m)
    balcony = Balcony("railing", 5.0, 3.0, 2.0, 1.0, guard_m=1.0, slab_m=0.2)
    wall = Wall("w", (0.0, 0.0), (10.0, 0.0), 6.0, Finish("plaster", (0.5,) * 3), (window,))
    wall = Wall("w", wall.start, wall.end, 6.0, wall.finish, (window,), (balcony,))
    return FacadePlan("test", wall)


def _camera(eye: tuple[float, float, float] | None = None) -> FacadeCamera:
    return FacadeCamera(FRONT, 0.0, 6.0, 0.02, 500, 300, eye)


def test_a_box_on_the_wall_is_the_same_from_everywhere() -> None:
    flat = np.zeros((300, 500), np.float32)
    straight = labels_of(_facade(), _camera(), flat)[0]
    below = labels_of(_facade(), _camera((7.0, 1.6, 10.0)), flat)[0]
    assert straight.box_px == below.box_px == (100.0, 175.0, 150.0, 250.0)
    assert straight.category == "window"


def test_what_lies_behind_the_wall_shrinks_towards_the_eye() -> None:
    # From 9 m away, 1 m behind the plane: everything is 0.9 times as far from the eye's foot.
    flat = np.zeros((300, 500), np.float32)
    found = labels_of(_facade(depth_m=1.0), _camera((4.0, 2.0, 9.0)), flat)[0]
    x0, x1 = 4.0 - 2.0 * 0.9, 4.0 - 1.0 * 0.9
    y0, y1 = 2.0 - 1.0 * 0.9, 2.0 + 0.5 * 0.9
    expected = (x0 / 0.02, (6.0 - y1) / 0.02, x1 / 0.02, (6.0 - y0) / 0.02)
    assert found.box_px == pytest.approx(expected, abs=0.01)


def test_a_balcony_is_its_guard_and_the_edge_of_its_slab() -> None:
    found = labels_of(_facade(), _camera(), np.zeros((300, 500), np.float32))[1]
    assert found.category == "balcony"
    assert found.box_px == (250.0, 100.0, 350.0, 160.0)


def test_hidden_boxes_are_ignored() -> None:
    out_m = np.zeros((300, 500), np.float32)
    out_m[:, 100:140] = 2.0  # a trunk before four fifths of the window
    found = labels_of(_facade(), _camera(), out_m)[0]
    assert found.visible == pytest.approx(0.2)
    assert found.ignore
    assert found.seen_px == (140.0, 175.0, 150.0, 250.0)
    out_m[:, 110:] = 0.0
    out_m[:180] = 2.0
    found = labels_of(_facade(), _camera(), out_m)[0]
    assert found.visible == pytest.approx((70 / 75) * 0.8, abs=1e-3)
    assert found.seen_px == (110.0, 180.0, 150.0, 250.0)
    assert not found.ignore


def test_many_facades_look_at_the_sun() -> None:
    pytest.importorskip("mitsuba")
    from benchmarks.estate.facades.facade_pictures import facade_shot
    from benchmarks.estate.sun import direction_of, sun_position_deg

    lit = 0
    for number in range(60):
        shot = facade_shot(4, number)
        sun = direction_of(*sun_position_deg(shot.light.date, shot.light.hour_utc, shot.origin))
        assert sun[2] > 0
        outward = shot.camera.world_from_facade.rotate(np.array([0.0, 0.0, 1.0]))
        lit += outward @ sun > 0
    assert 36 <= lit <= 54  # 0.45 + 0.55 / 2 of them, give or take two deviations


def test_rays_end_where_the_picture_says() -> None:
    pixels = np.array([[0.0, 0.0], [250.0, 300.0]])
    for camera in (_camera(), _camera((3.0, 1.6, 12.0))):
        origins, directions = camera.rays(pixels)
        on_wall = origins - directions * (origins[:, 1] / directions[:, 1])[:, None]
        np.testing.assert_allclose(on_wall, [[0, 0, 6], [5, 0, 0]], atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)


def test_depth_becomes_distance_from_the_wall() -> None:
    for eye in (None, (3.0, 1.6, 12.0)):
        camera = FacadeCamera(FRONT, 0.0, 6.0, 0.1, 100, 60, eye)
        rows, columns = np.mgrid[0:60, 0:100] + 0.5
        origins, directions = camera.rays(np.column_stack([columns.ravel(), rows.ravel()]))
        # The plane half a metre behind the wall, y = 0.5 in the world.
        depth_m = (0.5 - origins[:, 1]) / directions[:, 1]
        out_m = camera.out_m(depth_m.reshape(60, 100).astype(np.float32))
        np.testing.assert_allclose(out_m, -0.5, atol=1e-5)


def test_small_or_cut_boxes_and_shops_are_ignored() -> None:
    assert not Label("window", (0, 0, 30, 40), 1.0, 1.0).ignore
    assert Label("window", (0, 0, 5, 40), 1.0, 1.0).ignore
    assert Label("window", (0, 0, 30, 40), 1.0, 0.3).ignore
    assert Label("shop", (0, 0, 30, 40), 1.0, 1.0).ignore


def test_coco_is_in_the_order_of_numbers() -> None:
    records = [
        {"image": {"id": number}, "annotations": [{"id": 1000 * number, "image_id": number}]}
        for number in (3, 1, 2)
    ]
    found = coco_of(records)
    assert [image["id"] for image in found["images"]] == [1, 2, 3]
    assert [one["image_id"] for one in found["annotations"]] == [1, 2, 3]
    assert [category["name"] for category in found["categories"]] == list(CATEGORIES)


def _pixels(path: Path) -> np.ndarray:
    from PIL import Image

    with Image.open(path) as picture:
        return np.asarray(picture, int)


def _write_small(folder: Path, numbers: range, monkeypatch: pytest.MonkeyPatch) -> dict:
    from functools import partial

    from benchmarks.estate.facades import facade_pictures
    from benchmarks.estate.facades.facades_cli import write_picture

    small = partial(facade_pictures.facade_picture, samples=1, longest_px=96)
    monkeypatch.setattr(facade_pictures, "facade_picture", small)
    found = coco_of(write_picture(folder, 2, number) for number in numbers)
    monkeypatch.undo()
    return found


def test_pictures_are_rendered_once_and_their_boxes_are_true(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mitsuba")

    found = _write_small(tmp_path / "a", range(2), monkeypatch)
    for image in found["images"]:
        picture = _pixels(tmp_path / "a" / image["file_name"])
        assert picture.shape == (image["height"], image["width"], 3)
    sizes = {image["id"]: (image["width"], image["height"]) for image in found["images"]}
    for one in found["annotations"]:
        x, y, width, height = one["bbox"]
        assert x >= 0
        assert y >= 0
        assert x + width <= sizes[one["image_id"]][0]
        assert y + height <= sizes[one["image_id"]][1]
        assert 0 <= one["visible"] <= 1
    assert len({one["id"] for one in found["annotations"]}) == len(found["annotations"])
    # Another order and count: the same pictures. A second run: nothing is rendered again.
    path = tmp_path / "a" / found["images"][1]["file_name"]
    before = path.stat().st_mtime_ns
    assert _write_small(tmp_path / "a", range(2), monkeypatch) == found
    assert path.stat().st_mtime_ns == before
    again = _write_small(tmp_path / "b", range(1, 2), monkeypatch)
    assert again["images"] == found["images"][1:]
    assert json.dumps(again["annotations"]) == json.dumps(
        [one for one in found["annotations"] if one["image_id"] == 1]
    )
    same = _pixels(tmp_path / "b" / found["images"][1]["file_name"])
    assert np.abs(same - _pixels(path)).mean() < 1.0


def test_inside_a_window_the_rendered_depth_is_its_recess() -> None:
    pytest.importorskip("mitsuba")
    from benchmarks.estate.facades.facade_scene import Before, facade_parts, in_world
    from benchmarks.estate.plan import Light
    from benchmarks.estate.rendering.light import sky_map
    from benchmarks.estate.rendering.renderer import Renderer, mitsuba

    from si3fp.geometry.enu import GeoOrigin

    plan, origin = _facade(), GeoOrigin(57.0, 12.0, 0.0)
    parts = in_world(facade_parts(plan, Before(), 1, 1), FRONT)
    camera = FacadeCamera(FRONT, 0.0, 6.0, 0.05, 200, 120)
    sky = sky_map(mitsuba(), Light(cloud=1.0), origin, 64)
    rendered = Renderer(parts, sky, origin).render(camera, 1, 1, denoise=False)
    out_m = camera.out_m(rendered.depth_m)
    label = labels_of(plan, camera, out_m)[0]
    x0, y0, x1, y1 = (round(value) for value in label.box_px)
    assert label.visible > 0.95
    # Glass in the middle of the window, the wall's plane around it.
    assert np.median(out_m[y0 + 6 : y1 - 6, x0 + 4 : x1 - 4]) == pytest.approx(-0.1, abs=0.02)
    assert np.all(out_m[y0 + 2 : y1 - 2, x0 + 1 : x1 - 1] < -0.02)
    np.testing.assert_allclose(out_m[y0 + 2 : y1 - 2, x0 - 4 : x0 - 1], 0, atol=0.01)
    np.testing.assert_allclose(out_m[y0 + 2 : y1 - 2, x1 + 1 : x1 + 4], 0, atol=0.01)


def test_one_failed_picture_costs_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from benchmarks.estate.facades import facades_cli
    from click.testing import CliRunner

    def write(folder: Path, seed: int, number: int) -> dict:
        if number == 2:
            raise RuntimeError("no convex corner")
        record = {"image": {"id": number}, "annotations": []}
        facades_cli.write_json(folder / "records" / f"{seed}-{number:06d}.json", record)
        return record

    monkeypatch.setattr(facades_cli, "write_picture", write)
    done = CliRunner().invoke(facades_cli.facades, ["-n", "4", "-o", str(tmp_path)])
    assert isinstance(done.exception, Si3fpError)
    assert "numbers [2]" in str(done.exception)
    coco = json.loads((tmp_path / facades_cli.COCO).read_text())
    assert [image["id"] for image in coco["images"]] == [0, 1, 3]
