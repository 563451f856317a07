"""Lights of one opening become one box; windows with a pier between them stay two."""

from itertools import pairwise

import numpy as np
import pytest

from si3fp.config import MeasureConfig
from si3fp.model import Detections, OrthoImage
from si3fp.windows.fuse import FusedDetections
from si3fp.windows.join import join_openings

WALL, GLASS, FRAME = (205, 195, 180), (40, 45, 55), (240, 240, 240)
M_PER_PX = 0.02


def painted(*windows, between=WALL):
    """A wall with panes x0 y0 x1 y1 in white frames; ``between`` fills gaps up to 20 px."""
    rgb = np.empty((300, 900, 3), np.uint8)
    rgb[:] = WALL
    for one, other in pairwise(windows):
        if other[0] - one[2] <= 20:
            rgb[one[1] : other[3], one[0] : other[2]] = between
    for x0, y0, x1, y1 in windows:
        rgb[y0:y1, x0:x1] = FRAME
        rgb[y0 + 3 : y1 - 3, x0 + 3 : x1 - 3] = GLASS
    return OrthoImage("fused", rgb, np.ones((300, 900), bool))


def boxes(*rows, scores=None, sigma_px=1.0):
    found = Detections(
        np.array(rows, float).reshape(-1, 4),
        np.full(len(rows), 0.8) if scores is None else scores,
        np.full(len(rows), "window"),
        np.full((len(rows), 4), sigma_px),
    )
    return FusedDetections(found, tuple((f"v{i}",) for i in range(len(rows))))


def joined(found, image):
    return join_openings(found, image, M_PER_PX, MeasureConfig())


HALVES = ((100, 80, 130, 180), (134, 80, 164, 180))


@pytest.mark.parametrize("swap", [False, True])
def test_halves_beside_a_mullion_are_one_opening(swap):
    rows = HALVES[::-1] if swap else HALVES
    one = joined(boxes(*rows), painted(*HALVES, between=FRAME))
    assert one.detections.boxes_px.tolist() == [[100, 80, 164, 180]]
    assert one.views == (("v0", "v1"),)
    assert one.notes == ("lights joined across a mullion of 0.08 m",)


def test_a_light_above_a_transom_belongs_to_its_window():
    rows = ((100, 80, 160, 110), (100, 114, 160, 180))
    one = joined(boxes(*rows), painted(*rows, between=FRAME))
    assert one.detections.boxes_px.tolist() == [[100, 80, 160, 180]]
    assert "transom" in one.notes[0]


def test_three_lights_are_one_opening():
    rows = ((100, 80, 130, 180), (133, 80, 163, 180), (166, 80, 196, 180))
    one = joined(boxes(*rows), painted(*rows, between=FRAME))
    assert one.detections.boxes_px.tolist() == [[100, 80, 196, 180]]


LIGHTS = ((100, 80, 130, 180), (133, 80, 183, 180), (186, 80, 216, 180))
BLURRED = (117, 79, 192, 181)
"""The middle light, or all three: the network is not sure."""


@pytest.mark.parametrize("scores", [(0.8, 0.7, 0.6), (0.6, 0.8, 0.7)])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_blurred_box_between_two_lights_shows_the_lights_between_them(scores, mirrored):
    rows = [LIGHTS[0], BLURRED, LIGHTS[2]]
    painted_lights = list(LIGHTS)
    if mirrored:
        rows = [(900 - x1, y0, 900 - x0, y1) for x0, y0, x1, y1 in rows]
        painted_lights = [(900 - x1, y0, 900 - x0, y1) for x0, y0, x1, y1 in LIGHTS[::-1]]
    found = boxes(*rows, scores=np.array(scores))
    found.detections.edge_sigma_px[1, [0, 2]] = 10.0
    order = np.argsort(-found.detections.scores)
    one = joined(found.select(order), painted(*painted_lights, between=FRAME))
    low, high = (684, 800) if mirrored else (100, 216)
    assert one.detections.boxes_px.tolist() == [[low, 79, high, 181]]


def test_a_blurred_box_on_the_pier_between_two_windows_is_no_window():
    found = boxes(LIGHTS[0], BLURRED, LIGHTS[2])
    found.detections.edge_sigma_px[1, [0, 2]] = 10.0
    two = joined(found, painted(LIGHTS[0], LIGHTS[2]))
    assert two.detections.boxes_px.tolist() == [list(LIGHTS[0]), list(LIGHTS[2])]


def test_a_sharp_box_over_two_others_is_not_cut():
    found = boxes(LIGHTS[0], BLURRED, LIGHTS[2], scores=np.array([0.8, 0.7, 0.6]))
    two = joined(found, painted(*LIGHTS, between=FRAME))
    assert two.detections.boxes_px.tolist() == [list(LIGHTS[0]), list(LIGHTS[2])]


def test_a_pier_keeps_two_windows_apart():
    rows = ((100, 80, 130, 180), (145, 80, 175, 180))
    assert len(joined(boxes(*rows), painted(*rows)).detections) == 2


def test_wall_that_shows_between_keeps_even_near_ones_apart():
    assert len(joined(boxes(*HALVES), painted(*HALVES, between=WALL)).detections) == 2


def test_unlike_heights_are_a_door_and_its_window():
    rows = ((100, 80, 130, 180), (133, 80, 163, 220))
    assert len(joined(boxes(*rows), painted(*rows, between=FRAME)).detections) == 2


def test_repetition_decides_where_the_gap_does_not():
    halves = ((100, 80, 130, 180), (137, 80, 167, 180))  # 0.14 m apart
    wide = tuple((x, 80, x + 67, 180) for x in (300, 450, 600, 750))
    narrow = tuple((x, 80, x + 30, 180) for x in (300, 450, 600, 750))
    alone = joined(boxes(*halves, sigma_px=2), painted(*halves, between=FRAME))
    among_wide = joined(boxes(*halves, *wide, sigma_px=2), painted(*halves, *wide, between=FRAME))
    among_narrow = joined(
        boxes(*halves, *narrow, sigma_px=2), painted(*halves, *narrow, between=FRAME)
    )
    assert len(alone.detections) == 2
    assert len(among_wide.detections) == 5
    assert len(among_narrow.detections) == 6


def test_the_lights_inside_a_window_go_unless_it_is_much_less_certain():
    rows = ((100, 80, 164, 180), HALVES[0], HALVES[1])
    image = painted(*HALVES, between=WALL)
    outer = joined(boxes(*rows, scores=np.array([0.7, 0.8, 0.6])), image)
    assert outer.detections.boxes_px.tolist() == [[100, 80, 164, 180]]
    inner = joined(boxes(*rows, scores=np.array([0.3, 0.8, 0.6])), image)
    assert len(inner.detections) == 2


def test_a_window_that_is_there_twice_stays_once():
    rows = ((100, 80, 160, 180), (135, 90, 200, 185))
    once = joined(boxes(*rows, scores=np.array([0.6, 0.8])), painted())
    assert once.detections.scores.tolist() == [0.8]


@pytest.mark.parametrize("rows", [(), ((100, 80, 160, 180),)])
def test_nothing_and_one_stay(rows):
    assert len(joined(boxes(*rows), painted()).detections) == len(rows)
