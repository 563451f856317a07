"""Balconies by depth, and doors behind their fronts."""

import numpy as np
import pytest
from tests.scenes.recessed import BALCONY_DEPTH_M, rendered

from si3fp.model import Detections, OrthoImage, Window
from si3fp.windows.balcony import find_balconies
from si3fp.windows.balcony_inferred import doors_of_columns
from si3fp.windows.balcony_openings import complete_doors
from si3fp.windows.fuse import FusedDetections

CAMERAS = {name: np.array([x, 3.0, 7.0]) for name, x in (("a", 2.0), ("b", 4.0), ("c", 6.0))}
DOOR_PX = np.array([[340.0, 180, 440, 395]])
FRONT = (2.6, 5.2, 1.8, 2.9)


def balconies(front, doors=DOOR_PX, noise_m=0.0):
    render = rendered([], 0.1, CAMERAS, balconies=[front], noise_m=noise_m)
    return find_balconies(render.ortho, doors, 0.0, render.grid.m_per_px)


def test_a_balcony_is_found_by_its_depth():
    found, (words,) = balconies(FRONT, noise_m=0.05)
    assert found.boxes_px == pytest.approx(np.array([[260, 310, 520, 420]]), abs=2)
    assert found.labels.tolist() == ["balcony"]
    assert f"{BALCONY_DEPTH_M:.1f} m in front" in words


@pytest.mark.parametrize(
    "front",
    [(3.5, 4.1, 1.8, 2.9), (2.6, 5.2, 2.4, 2.9), (2.6, 5.2, 0.2, 2.9)],
    ids=["narrow", "flat", "high"],
)
def test_what_has_not_the_size_of_a_balcony_is_none(front):
    assert len(balconies(front)[0]) == 0


@pytest.mark.parametrize(
    "doors",
    [
        np.zeros((0, 4)),
        DOOR_PX + np.array([300, 0, 300, 0]),
        DOOR_PX - np.array([0, 150, 0, 150]),
        [[340, 260, 440, 395]],
    ],
    ids=["none", "beside", "far above", "too low"],
)
def test_a_balcony_has_a_door(doors):
    assert len(balconies(FRONT, np.asarray(doors))[0]) == 0


def test_a_balcony_that_grew_together_with_a_bulge_of_the_wall_is_found():
    render = rendered([], 0.1, CAMERAS, balconies=[FRONT])
    depth = render.ortho.depth_m.copy()
    depth[330:600, 0:300] = np.maximum(depth[330:600, 0:300], 0.7)
    found, _ = find_balconies(with_depth(render, depth), DOOR_PX, 0.0, 0.01)
    assert found.boxes_px == pytest.approx(np.array([[260, 310, 520, 420]]), abs=2)


def test_a_rail_of_bars_is_a_balcony_and_a_bush_is_none():
    render = rendered([], 0.1, CAMERAS)
    bars = render.ortho.depth_m.copy()
    bars[400:420, 260:520] = BALCONY_DEPTH_M
    bars[310:400, 260:520:10] = bars[310:400, 261:520:10] = BALCONY_DEPTH_M
    bars[310:315, 260:520] = BALCONY_DEPTH_M
    found, _ = find_balconies(with_depth(render, bars), DOOR_PX, 0.0, 0.01)
    assert found.boxes_px == pytest.approx(np.array([[260, 310, 520, 420]]), abs=8)
    row, column = np.mgrid[0:600, 0:800]
    ball = (row - 370.0) ** 2 + (column - 390.0) ** 2
    bush = np.where((ball < 75**2) & (ball > 50**2), BALCONY_DEPTH_M, 0).astype(np.float32)
    assert len(find_balconies(with_depth(render, bush), DOOR_PX, 0.0, 0.01)[0]) == 0


def with_depth(render, depth_m):
    return OrthoImage("radiance", render.ortho.rgb, render.ortho.valid, depth_m)


def completed(boxes, unseen_rows=slice(0)):
    boxes = np.asarray(boxes, float).reshape(-1, 4)
    render = rendered([], 0.1, CAMERAS, balconies=[FRONT])
    valid = render.ortho.valid.copy()
    valid[unseen_rows] = False
    ortho = OrthoImage("radiance", render.ortho.rgb, valid, render.ortho.depth_m)
    found = FusedDetections(
        Detections(boxes, np.full(len(boxes), 0.9), np.full(len(boxes), "window")),
        (("a",),) * len(boxes),
    )
    balconies, _ = find_balconies(ortho, boxes, 0.0, 0.01)
    return complete_doors(found, balconies, valid & (ortho.depth_m < 0.4), 0.01)


def test_the_foot_of_a_door_that_a_front_hides_is_completed_to_the_floor():
    whole = completed([[340, 180, 440, 312]])
    assert whole.detections.boxes_px[0] == pytest.approx(
        [340, 180, 440, 400], abs=3
    )  # 0.2 m above the slab's underside
    assert "completed to its floor" in whole.notes[0]
    assert whole.detections.edge_sigma_px[0, 3] > 0


def test_a_door_of_which_the_lower_part_is_not_seen_is_completed_too():
    assert completed([[340, 180, 440, 240]], slice(240, 310)).notes != ("",)
    assert completed([[340, 180, 440, 240]]).notes == ("",)  # the wall shows between


def test_of_two_openings_above_one_balcony_none_is_changed():
    both = completed([[280, 180, 370, 312], [400, 180, 490, 312]])
    assert both.detections.boxes_px[:, 3].tolist() == [312, 312]


def test_a_door_whose_foot_shows_stays():
    assert completed([[340, 180, 440, 405]]).detections.boxes_px[0, 3] == 405


def test_an_inferred_window_above_a_balcony_is_its_door():
    render = rendered([], 0.1, CAMERAS, balconies=[FRONT])
    balconies, _ = find_balconies(render.ortho, DOOR_PX, 0.0, 0.01)
    unseen = np.zeros(render.ortho.valid.shape, bool)
    inferred = Window(3.4, 3.0, 1.0, 1.2, origin="inferred", evidence="not detected")
    beside = Window(6.0, 3.0, 1.0, 1.2, origin="inferred")
    door, other = doors_of_columns([inferred, beside], balconies, unseen, render.grid)
    assert (door.y_m, door.y_m + door.height_m) == pytest.approx((2.0, 4.2), abs=0.03)
    assert door.label == "balcony_door"
    assert "completed to its floor" in door.evidence
    assert other is beside
    detected = Window(3.4, 3.0, 1.0, 1.2)
    assert doors_of_columns([detected], balconies, unseen, render.grid) == (detected,)
    assert doors_of_columns([], balconies, unseen, render.grid) == ()


def test_a_front_above_which_nobody_saw_is_a_balcony():
    render = rendered([], 0.1, CAMERAS, balconies=[FRONT])
    valid = render.ortho.valid.copy()
    valid[200:310, 250:530] = False
    ortho = OrthoImage("radiance", render.ortho.rgb, valid, render.ortho.depth_m)
    found, (words,) = find_balconies(ortho, np.zeros((0, 4)), 0.0, 0.01)
    assert len(found) == 1
    assert "not seen" in words
