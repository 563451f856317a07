"""Doors and windows behind solid fronts: a facade in pixels of 0.02 m, whose truth is drawn here.

Three storeys of 2.8 m. Left to right: a window 1.4 m and a door 0.8 m wide, 0.2 m apart, behind a
front; two windows without one. Heads are 2.2 m above the floors, sills 0.85 m, fronts reach from
0.2 m below to 1.0 m above the floor.
"""

import numpy as np
import pytest

from si3fp.config import MeasureConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Detections, Window
from si3fp.windows.balcony_fronts import hidden_by, hiding_fronts, in_columns
from si3fp.windows.balcony_inferred import doors_of_columns, repeated_doors
from si3fp.windows.balcony_openings import complete_doors, taken_apart
from si3fp.windows.fuse import FusedDetections
from si3fp.windows.lattice import complete_windows
from si3fp.windows.regular import correct_windows, edges_of

STEP_M = 0.02
GRID = FacadeGrid(Rigid3(np.eye(3), np.zeros(3)), 500, 450, STEP_M)
SHAPE = (450, 500)
FLOORS_M = (0.4, 3.2, 6.0)
WINDOW, DOOR, FRONT = (1.0, 2.4), (2.6, 3.4), (0.8, 3.6)
PLAIN = ((5.0, 6.4), (7.5, 8.9))
CONFIG = MeasureConfig()


def px(left, right, bottom, top):
    return [left / STEP_M, 450 - top / STEP_M, right / STEP_M, 450 - bottom / STEP_M]


def shown(sides, floor_m):
    """What shows of an opening above a front."""
    return px(*sides, floor_m + 1.0, floor_m + 2.2)


def fronts(floors=FLOORS_M, scores=None):
    boxes = np.array([px(*FRONT, floor - 0.2, floor + 1.0) for floor in floors]).reshape(-1, 4)
    found = np.full(len(boxes), 0.8) if scores is None else np.array(scores)
    return Detections(boxes, found, np.full(len(boxes), "balcony"))


def found(boxes, scores=None):
    boxes = np.array(boxes, float).reshape(-1, 4)
    scores = np.full(len(boxes), 0.9) if scores is None else np.array(scores)
    return FusedDetections(
        Detections(boxes, scores, np.full(len(boxes), "window"), np.full(boxes.shape, 1.0)),
        (("a",),) * len(boxes),
    )


def shows(floors=FLOORS_M):
    return ~hidden_by(fronts(floors), SHAPE)


def window(sides, bottom, top, **more):
    return Window(
        sides[0], bottom, sides[1] - sides[0], top - bottom, edge_sigma_m=(0.03,) * 4, **more
    )


def test_the_narrow_one_of_two_openings_reaches_down_to_the_slab_and_the_wide_one_stays():
    floor = FLOORS_M[1]
    boxes = [shown(WINDOW, floor), shown(DOOR, floor)]
    whole = complete_doors(found(boxes), fronts([floor]), shows([floor]), STEP_M)
    wide, narrow = whole.detections.boxes_px
    assert wide.tolist() == boxes[0]
    # The slab's underside says 2.2 m below the head, doors are 2.15 m high.
    assert (450 - narrow[3]) * STEP_M == pytest.approx(floor, abs=0.05)
    assert whole.detections.labels.tolist() == ["window", "balcony_door"]
    assert whole.detections.edge_sigma_px[1, 3] * STEP_M == pytest.approx(0.12, abs=0.01)
    assert whole.notes[0] == ""
    assert "completed to its floor" in whole.notes[1]


def test_the_wide_one_gets_the_sill_of_its_row():
    floor = FLOORS_M[1]
    sill, head = floor + 0.85, floor + 2.2
    windows = [window(WINDOW, floor + 1.0, head)] + [window(s, sill, head) for s in PLAIN]
    windows.append(window((9.0, 9.9), sill, head))
    seen = shows([floor]).astype(np.float32)
    low = correct_windows(windows, seen, GRID, CONFIG)[0]
    assert low.y_m == pytest.approx(sill, abs=0.02)
    assert low.edge_sigma_m[2] > 0.03
    assert correct_windows(windows, np.ones_like(seen), GRID, CONFIG)[0].y_m > sill + 0.05


def test_a_single_wide_opening_behind_a_front_is_no_door_and_one_in_a_column_of_windows_neither():
    wide = (1.0, 2.8)
    alone = complete_doors(
        found([shown(wide, FLOORS_M[1])]), fronts(FLOORS_M[1:2]), shows(FLOORS_M[1:2]), STEP_M
    )
    assert alone.notes == ("",)
    boxes = [shown(s, FLOORS_M[1]) for s in (WINDOW, DOOR)] + [shown(WINDOW, FLOORS_M[2])]
    whole = complete_doors(found(boxes), fronts(), shows(), STEP_M)
    assert [bool(note) for note in whole.notes] == [False, True, False]


def test_below_a_door_stands_a_door_if_nobody_saw_what_is_under_it():
    boxes = [shown(sides, floor) for floor in FLOORS_M[:2] for sides in (WINDOW, DOOR)]
    behind_one = fronts(FLOORS_M[1:2])
    hidden = complete_doors(found(boxes), behind_one, shows(FLOORS_M[:2]), STEP_M)
    assert hidden.detections.labels.tolist() == ["window", "balcony_door"] * 2
    feet = 450 - hidden.detections.boxes_px[[1, 3], 3]
    assert (feet[1] - feet[0]) * STEP_M == pytest.approx(2.8, abs=0.01)
    bare = complete_doors(found(boxes), behind_one, shows(FLOORS_M[1:2]), STEP_M)
    assert bare.detections.labels.tolist() == ["window", "window", "window", "balcony_door"]


def test_a_door_and_a_window_boxed_as_one_are_two_as_on_another_storey():
    both = shown((WINDOW[0], DOOR[1]), FLOORS_M[0])
    apart = [shown(sides, FLOORS_M[1]) for sides in (WINDOW, DOOR)]
    parts = taken_apart(found([both, *apart]), STEP_M)
    cut = parts.detections.boxes_px
    assert len(cut) == 4
    assert sorted(cut[cut[:, 1] == both[1], 0]) == [apart[0][0], apart[1][0]]
    assert sum("taken apart" in note for note in parts.notes) == 2
    alone = found([both, shown(PLAIN[0], FLOORS_M[1])])
    assert (
        taken_apart(alone, STEP_M).detections.boxes_px.tolist()
        == alone.detections.boxes_px.tolist()
    )


def test_weak_balconies_count_above_sure_ones_of_the_same_width():
    openings = np.array([shown(WINDOW, FLOORS_M[0])])
    strong = fronts(scores=[0.8, 0.15, 0.05])
    assert hiding_fronts(strong, openings, 0.3, STEP_M).scores.tolist() == [0.8, 0.15]
    weak = fronts(scores=[0.2, 0.15, 0.05])
    assert len(hiding_fronts(weak, openings, 0.3, STEP_M)) == 0


def test_a_balcony_through_which_openings_show_hides_nothing():
    through = np.array([px(*DOOR, FLOORS_M[0], FLOORS_M[0] + 2.2)])
    cut = np.array([shown(DOOR, FLOORS_M[0])])
    assert len(hiding_fronts(fronts(), through, 0.3, STEP_M)) == 0
    assert len(hiding_fronts(fronts(), cut, 0.3, STEP_M)) == 3
    assert len(hiding_fronts(fronts(), np.zeros((0, 4)), 0.3, STEP_M)) == 0


def test_a_door_and_window_boxed_as_one_on_every_storey_stay_as_they_show():
    both = (WINDOW[0], DOOR[1])
    boxes = [shown(both, floor) for floor in FLOORS_M]
    whole = complete_doors(found(boxes), fronts(), shows(), STEP_M)
    assert whole.detections.boxes_px.tolist() == boxes
    wide = [window(both, f + 0.2, f + 2.2, label="balcony_door") for f in FLOORS_M[:2]]
    high = window(both, FLOORS_M[2] + 1.0, FLOORS_M[2] + 2.2)
    result = doors_of_columns([*wide, high], fronts(), shows(), GRID)
    assert result[2] is high


def test_windows_in_the_columns_of_fronts_are_told():
    boxes = np.array([shown(WINDOW, FLOORS_M[0]), shown(PLAIN[0], FLOORS_M[0])])
    assert in_columns(fronts(FLOORS_M[1:2]), boxes).tolist() == [True, False]
    assert in_columns(fronts([]), boxes).tolist() == [False, False]


def storeys(*floors):
    """Windows of all storeys, doors of some."""
    plain = [window(s, f + 0.85, f + 2.2) for f in FLOORS_M for s in PLAIN]
    return plain + [
        part
        for f in floors
        for part in (
            window(WINDOW, f + 0.85, f + 2.2),
            window(DOOR, f, f + 2.2, label="balcony_door"),
        )
    ]


def test_what_a_front_hides_is_inferred_from_the_storeys_below():
    windows = storeys(*FLOORS_M[:2])
    # Seen from far below, the highest front lies before all of its door and window.
    before = fronts()
    before.boxes_px[2] = px(*FRONT, FLOORS_M[2] + 0.1, FLOORS_M[2] + 2.2)
    bare = ~hidden_by(before, SHAPE)
    lattice = complete_windows(
        windows, [], np.zeros((0, 4)), bare.astype(np.float32), GRID, 0.4, CONFIG
    )
    completed = doors_of_columns(lattice, before, bare, GRID)
    whole = repeated_doors(completed, before, bare, GRID, CONFIG)
    added = [w for w in whole if w.origin == "inferred"]
    assert sorted(w.label for w in added) == ["balcony_door", "window"]
    (door,) = (w for w in added if w.label == "balcony_door")
    assert edges_of([door])[0] == pytest.approx([*DOOR, FLOORS_M[2], FLOORS_M[2] + 2.2], abs=0.06)
    assert "probability 0." in door.evidence


def test_a_door_is_inferred_from_two_others_and_not_from_one_or_where_the_switch_is_off():
    nothing, all_of_it = np.zeros(SHAPE, bool), np.ones(SHAPE, bool)

    def doors(windows, config=CONFIG, seen=nothing):
        whole = repeated_doors(windows, fronts(), seen, GRID, config)
        return [w for w in whole if w.origin == "inferred"]

    (door,) = doors(storeys(*FLOORS_M[:2]))
    assert door.score == pytest.approx(3 / 4)
    assert doors(storeys(FLOORS_M[0])) == []
    assert doors(storeys(*FLOORS_M[:2]), MeasureConfig(infer=False)) == []
    assert doors(storeys(*FLOORS_M)) == []
    # Bare wall shows where the door would be.
    assert doors(storeys(*FLOORS_M[:2]), seen=all_of_it) == []
    # A window is where the door would be: that balcony has none.
    other = [*storeys(*FLOORS_M[:2]), window((2.5, 3.6), 6.9, 8.2)]
    assert doors(other) == []


def test_an_inferred_window_alone_above_a_balcony_is_its_door_but_not_in_a_column_of_windows():
    floor = FLOORS_M[2]
    below = storeys(*FLOORS_M[:2])
    nothing = np.zeros(SHAPE, bool)
    alone = window(WINDOW, floor + 0.85, floor + 2.2, origin="inferred")
    assert doors_of_columns([*below, alone], fronts(), nothing, GRID)[-1] is alone
    elsewhere = window((1.4, 2.8), floor + 0.85, floor + 2.2, origin="inferred")
    (*_, door) = doors_of_columns([*below, elsewhere], fronts(), nothing, GRID)
    assert door.label == "balcony_door"
    assert door.y_m == pytest.approx(floor, abs=0.06)


def test_an_inferred_door_with_the_sill_of_its_row_goes_down_to_the_floor():
    floor = FLOORS_M[2]
    door = window(DOOR, floor + 0.85, floor + 2.2, origin="inferred", label="balcony_door")
    windows = [*storeys(*FLOORS_M[:2]), door]
    (*_, whole) = doors_of_columns(windows, fronts(), np.zeros(SHAPE, bool), GRID)
    assert whole.y_m == pytest.approx(floor, abs=0.06)
