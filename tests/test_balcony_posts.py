"""Frames of painted panes above fronts, 0.02 m per pixel: which pane is the door."""

import cv2
import numpy as np
import pytest

from si3fp.windows.balcony_posts import door_by_posts

STEP_M = 0.02
WALL, FRONT, FRAME = (150, 150, 145), (200, 160, 60), (235, 235, 230)
PANES = ((90, 95, 110), (60, 60, 70), (170, 165, 160), (120, 110, 100))
LEFT_M, HEADS_M = 1.0, (1.0, 3.8, 6.6)  # from the top of the picture
SHOWS_M = 1.0


def panes_of(widths_m, front=FRONT, seed=0):
    """(3, 4) boxes and the picture in Lab; panes of these widths with 0.16 m of frame around."""
    rng = np.random.default_rng(seed)
    rgb = np.full((500, 250, 3), WALL, np.uint8)
    right_m = LEFT_M + sum(widths_m)
    boxes = []
    for head in HEADS_M:

        def paint(x0, x1, y0, y1, colour, head=head):
            rows, columns = (
                [round(each / STEP_M) for each in pair] for pair in ((y0, y1), (x0, x1))
            )
            rgb[slice(*[r + round(head / STEP_M) for r in rows]), slice(*columns)] = colour

        paint(LEFT_M, right_m, 0, SHOWS_M, FRAME)
        left = LEFT_M
        for width in widths_m:
            colour = PANES[rng.integers(len(PANES))]
            paint(left + 0.08, left + width - 0.08, 0.08, SHOWS_M, colour)
            left += width
        paint(LEFT_M - 0.6, right_m + 0.6, SHOWS_M, SHOWS_M + 1.1, front)
        boxes.append([LEFT_M, head, right_m, head + SHOWS_M])
    noisy = rgb.astype(int) + rng.integers(-5, 6, rgb.shape)
    lab = cv2.cvtColor(noisy.clip(0, 255).astype(np.uint8), cv2.COLOR_RGB2LAB).astype(float)
    return np.array(boxes) / STEP_M, lab


@pytest.mark.parametrize(
    ("widths_m", "door"),
    [
        ((0.9, 0.6, 0.6), (True, 0.9)),  # a window of two lights
        ((0.6, 0.6, 0.9), (False, 0.9)),
        ((0.8, 1.4), (True, 0.8)),  # one as wide as a door, the other wider
        ((1.0, 0.8), (False, 0.8)),  # the narrower
        ((0.9, 0.9), None),  # a door of two leaves, or a window
        ((0.8, 0.8, 0.8), None),
        ((1.2, 1.2), None),
        ((2.0,), None),
    ],
)
def test_the_pane_as_wide_as_a_door_is_the_door(widths_m, door):
    found = door_by_posts(*panes_of(widths_m), STEP_M)
    if door is None:
        assert found is None
    else:
        assert found == (door[0], pytest.approx(door[1], abs=0.04))


def test_above_a_wall_no_pane_is_a_door():
    assert door_by_posts(*panes_of((0.9, 0.6, 0.6), front=WALL), STEP_M) is None


def test_one_storey_alone_does_not_tell():
    boxes, lab = panes_of((0.9, 0.6, 0.6))
    assert door_by_posts(boxes[:1], lab, STEP_M) is None
    assert door_by_posts(boxes[:0], lab, STEP_M) is None
    other = boxes + np.outer([0, 1, 2], [10, 0, 10, 0])  # no two with the same sides
    assert door_by_posts(other, lab, STEP_M) is None
