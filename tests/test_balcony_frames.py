"""Doors and windows in one frame, painted on a wall of known layout, 0.02 m per pixel.

Three storeys of 2.8 m. Two frames 2.1 m wide with a door of 0.9 m, mirrored; single windows. Heads
are 2.2 m above the floors, sills 0.9 m.
"""

import numpy as np
import pytest

from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import OrthoImage, Window
from si3fp.windows.balcony_columns import BalconyColumn
from si3fp.windows.balcony_frames import SharedFrame, parted, shared_frames
from si3fp.windows.regular import edges_of

STEP_M = 0.02
GRID = FacadeGrid(Rigid3(np.eye(3), np.zeros(3)), 600, 450, STEP_M)
FLOORS_M = (0.5, 3.3, 6.1)
LEFT, RIGHT = (1.0, 3.1), (4.0, 6.1)
PLAIN = ((7.4, 8.7), (9.6, 10.9))
WALL, DARK = (170, 165, 150), (60, 50, 45)


def px(left, right, bottom, top):
    return [left / STEP_M, 450 - top / STEP_M, right / STEP_M, 450 - bottom / STEP_M]


def picture(feet=(True, True, True), bars=False):
    """Doors on the outer sides; below the sill they show on some storeys only."""
    rgb = np.full((450, 600, 3), WALL, np.uint8)

    def paint(*sides):
        x0, y0, x1, y1 = np.round(px(*sides)).astype(int)
        rgb[y0:y1, x0:x1] = DARK

    for floor, foot in zip(FLOORS_M, feet, strict=True):
        for sides in (LEFT, RIGHT, *PLAIN):
            paint(*sides, floor + 0.9, floor + 2.2)
        if foot:
            paint(LEFT[0], LEFT[0] + 0.9, floor, floor + 0.9)
            paint(RIGHT[1] - 0.9, RIGHT[1], floor, floor + 0.9)
    if bars:
        rgb[:, ::6] = (200, 90, 20)
    rgb = rgb.astype(int) + np.random.default_rng(1).integers(-6, 7, rgb.shape)
    return OrthoImage("fused", rgb.clip(0, 255).astype(np.uint8), np.ones((450, 600), bool))


def boxes():
    return np.array(
        [px(*s, f + 0.9, f + 2.2) for f in FLOORS_M for s in (LEFT, RIGHT, *PLAIN)], float
    )


AT_BALCONY = np.array([True, True, False, False] * 3)
SLABS = np.array(FLOORS_M) - 0.2
COLUMN = BalconyColumn(0.5, 6.6, SLABS, SLABS, 0.0)


def told(image, boxes_px=None, at=AT_BALCONY):
    return shared_frames(boxes() if boxes_px is None else boxes_px, at, (COLUMN,), image, GRID)


@pytest.mark.parametrize("bars", [False, True])
def test_the_side_and_width_of_the_door_show_below_the_sill(bars):
    left, right = told(picture(bars=bars))
    assert (left.door_left, right.door_left) == (True, False)
    assert [left.door_m, right.door_m] == pytest.approx([0.9, 0.9], abs=0.051)
    assert (left.left_m, left.right_m) == pytest.approx(LEFT, abs=0.01)
    assert left.slabs_m == pytest.approx(SLABS)


def test_one_storey_that_shows_it_tells_for_all():
    assert [f.door_left for f in told(picture(feet=(False, True, False)))] == [True, False]


def test_without_a_storey_that_shows_it_or_without_a_balcony_nothing_is_told():
    assert told(picture(feet=(False,) * 3)) == ()
    assert told(picture(), at=np.zeros(12, bool)) == ()
    assert told(picture(), np.zeros((0, 4)), np.zeros(0, bool)) == ()


def test_what_is_as_narrow_as_a_door_is_no_frame():
    narrow = boxes()
    narrow[:, 2] = narrow[:, 0] + 1.2 / STEP_M
    assert told(picture(), narrow) == ()


def window(sides, bottom, top, **more):
    return Window(
        sides[0], bottom, sides[1] - sides[0], top - bottom, edge_sigma_m=(0.03,) * 4, **more
    )


FRAME = SharedFrame(*LEFT, 0.9, True, tuple(SLABS))


def test_the_door_goes_down_to_its_slab_and_the_window_to_the_sill_of_its_storey():
    floor = FLOORS_M[1]
    plain = [window(s, floor + 0.9, floor + 2.2) for s in PLAIN]
    wide = window(LEFT, floor + 1.1, floor + 2.2)
    door, beside, *others = sorted(parted([wide, *plain], (FRAME,)), key=lambda w: w.x_m)
    assert edges_of([door])[0] == pytest.approx([1.0, 1.9, floor, floor + 2.2], abs=0.06)
    assert edges_of([beside])[0] == pytest.approx([1.9, 3.1, floor + 0.9, floor + 2.2])
    assert (door.label, beside.label) == ("balcony_door", "window")
    assert door.edge_sigma_m[2] == pytest.approx(0.12, abs=0.01)
    assert others == plain
    # Nothing else tells the sill: it stays as it shows.
    alone = sorted(parted([wide], (FRAME,)), key=lambda w: w.x_m)
    assert alone[1].y_m == wide.y_m


def test_a_frame_that_shows_badly_has_the_sides_of_its_column():
    storeys = [window(LEFT, f + 0.9, f + 2.2) for f in FLOORS_M[:2]]
    bad = window((0.6, 3.1), FLOORS_M[2] + 0.9, FLOORS_M[2] + 2.2)
    parts = parted([*storeys, bad], (FRAME,))
    lefts = sorted(w.x_m for w in parts if w.label == "balcony_door")
    assert lefts == pytest.approx([1.0] * 3)


def test_below_the_lowest_balcony_a_wide_window_is_one():
    upper = SharedFrame(*LEFT, 0.9, True, tuple(SLABS[1:]))
    storeys = [window(LEFT, f + 0.9, f + 2.2) for f in FLOORS_M]
    assert [w for w in parted(storeys, (upper,)) if w in storeys] == storeys[:1]
    assert len(parted(storeys, (upper,))) == 5


def test_what_was_inferred_stays_so_in_both_parts():
    wide = window(LEFT, 4.2, 5.5, origin="inferred", score=0.8, evidence="not detected")
    parts = parted([wide], (FRAME,))
    assert [(w.origin, w.score) for w in parts] == [("inferred", 0.8)] * 2
    assert all(w.evidence.startswith("not detected; door and window in one frame") for w in parts)
    mirrored = SharedFrame(*LEFT, 0.9, False, ())
    (door,) = (w for w in parted([wide], (mirrored,)) if w.label == "balcony_door")
    assert edges_of([door])[0] == pytest.approx([2.2, 3.1, 5.5 - 2.15, 5.5], abs=0.01)
