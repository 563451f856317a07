"""Box edges on painted windows: stone surrounds are left out, blank walls leave boxes alone."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from si3fp.config import MeasureConfig
from si3fp.model import Detections, OrthoImage
from si3fp.windows.fuse import FusedDetections
from si3fp.windows.refine import refine_boxes

WALL, STONE, FRAME, GLASS = (205, 195, 180), (180, 110, 90), (235, 235, 235), (40, 45, 55)


def facade(windows, surround_px=0, mullion=False, noise=6.0, frame=FRAME, glass=GLASS, wall=WALL):
    """A wall with windows (x0, y0, x1, y1): stone surround, frame 4 px wide, muntins, glass."""
    rng = np.random.default_rng(3)
    rgb = np.empty((300, 900, 3))
    rgb[:] = wall
    for x0, y0, x1, y1 in windows:
        s = surround_px
        rgb[y0 - s : y1 + s, x0 - s : x1 + s] = STONE
        rgb[y0:y1, x0:x1] = frame
        middle_x, middle_y = (x0 + x1) // 2, (y0 + y1) // 2
        for left, right in ((x0 + 4, middle_x - 2), (middle_x + 2, x1 - 4)):
            for top, bottom in ((y0 + 4, middle_y - 1), (middle_y + 1, y1 - 4)):
                rgb[top:bottom, left:right] = glass
        if mullion:
            rgb[y0:y1, middle_x - 6 : middle_x + 6] = STONE
    rgb += rng.normal(0, noise, rgb.shape)
    return OrthoImage("fused", np.clip(rgb, 0, 255).astype(np.uint8), np.ones((300, 900), bool))


def boxes(*rows):
    found = Detections(
        np.array(rows, float), np.full(len(rows), 0.8), np.array(["window"] * len(rows))
    )
    return FusedDetections(found, tuple(("a",) for _ in rows))


TRUE = [(100, 80, 160, 180), (300, 80, 360, 180), (500, 80, 560, 180), (700, 80, 760, 180)]


def error_px(refined, true):
    return np.abs(refined.detections.boxes_px - np.array(true)).max()


@pytest.mark.parametrize("mullion", [False, True])
def test_surrounds_are_not_part_of_the_window(mullion):
    image = facade(TRUE, surround_px=10, mullion=mullion)
    loose = boxes(*[(x0 - 8, y0 - 9, x1 + 7, y1 + 8) for x0, y0, x1, y1 in TRUE])
    refined = refine_boxes(loose, image, 0.02, MeasureConfig())
    assert error_px(refined, TRUE) < 2.5


def test_sides_in_the_glass_move_out_to_the_frame():
    image = facade(TRUE)
    tight = boxes(*[(x0 + 8, y0 + 8, x1 - 8, y1 - 8) for x0, y0, x1, y1 in TRUE])
    # Whether the frame itself is reached depends on how it differs from the wall.
    assert error_px(refine_boxes(tight, image, 0.02, MeasureConfig()), TRUE) < 4.5


def test_good_boxes_stay():
    refined = refine_boxes(boxes(*TRUE), facade(TRUE), 0.02, MeasureConfig())
    assert error_px(refined, TRUE) < 1.5


def test_dark_frames_stay_in_the_box():
    # A blend of views is as soft as this: the frame has no colour of its own, only mixtures.
    sharp = facade(TRUE, noise=3.0, frame=(60, 40, 30), glass=(90, 120, 160), wall=(145, 145, 140))
    image = replace(sharp, rgb=np.asarray(cv2.GaussianBlur(sharp.rgb, (0, 0), 1.5), np.uint8))
    refined = refine_boxes(boxes(*TRUE), image, 0.02, MeasureConfig())
    assert error_px(refined, TRUE) < 1.5


def test_a_blank_wall_gives_no_reason_to_move():
    image = facade([])
    start = boxes(*TRUE)
    refined = refine_boxes(start, image, 0.02, MeasureConfig())
    assert error_px(refined, TRUE) < 6


def test_scores_views_and_number_are_kept_and_it_can_be_switched_off():
    image, start = facade(TRUE, 10), boxes(*TRUE)
    refined = refine_boxes(start, image, 0.02, MeasureConfig())
    assert refined.views == start.views
    assert np.array_equal(refined.detections.scores, start.detections.scores)
    assert refine_boxes(start, image, 0.02, MeasureConfig(refine=False)) is start
    empty = boxes()
    assert len(refine_boxes(empty, image, 0.02, MeasureConfig()).detections) == 0


def test_windows_at_the_edge_of_the_image_and_of_what_was_seen():
    windows = [(2, 3, 62, 103), (836, 190, 896, 290)]
    image = facade(windows)
    refined = refine_boxes(boxes(*windows), image, 0.02, MeasureConfig())
    assert np.isfinite(refined.detections.boxes_px).all()
    assert error_px(refined, windows) < 6


def test_a_network_that_knows_its_sides_is_believed_and_the_sides_say_how_sure_they_are():
    image = facade(TRUE, surround_px=10)
    rows = [(x0 - 8, y0 - 9, x1 + 7, y1 + 8) for x0, y0, x1, y1 in TRUE]
    loose = boxes(*rows).detections
    told = Detections(loose.boxes_px, loose.scores, loose.labels, np.full((4, 4), 0.5))
    sure = refine_boxes(FusedDetections(told, boxes(*rows).views), image, 0.02, MeasureConfig())
    unsure = refine_boxes(boxes(*rows), image, 0.02, MeasureConfig())
    assert error_px(sure, rows) < 1.0
    assert error_px(unsure, rows) > 5.0
    assert (sure.detections.edge_sigma_px < 1).all()
    assert (unsure.detections.edge_sigma_px > sure.detections.edge_sigma_px).mean() > 0.9
