"""Slabs that stand out of a wall, as cameras on the road see them: truth by similar triangles.

Seven storeys of 2.8 m, two columns of balconies. Heads are 2.2 m above the floors, the slabs'
undersides 0.2 m below.
"""

import numpy as np
import pytest

from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Detections
from si3fp.windows.balcony_columns import balcony_columns, covers

STEP_M = 0.05
GRID = FacadeGrid(Rigid3(np.eye(3), np.zeros(3)), 480, 440, STEP_M)
CAMERAS = [np.array([x, 2.5, 13.0]) for x in (2.0, 10.0, 18.0)]
FLOORS_M = 0.8 + 2.8 * np.arange(7)
SLABS_M = FLOORS_M - 0.2
SPANS = ((3.0, 6.0), (14.0, 17.0))


def px(left, right, bottom, top):
    return [left / STEP_M, 440 - top / STEP_M, right / STEP_M, 440 - bottom / STEP_M]


def openings(floors=FLOORS_M):
    lefts = (1.0, 4.0, 8.0, 15.0)
    return np.array([px(x, x + 1.2, f + 0.9, f + 2.2) for f in floors for x in lefts])


def edges_of_slabs(ahead_m, slabs=SLABS_M):
    """Where lines of sight over the slabs' lower edges meet the wall."""
    return 2.5 + (slabs - 2.5) * 13.0 / (13.0 - ahead_m)


def balconies(ahead_m, storeys=range(7), scores=0.8, noise=0.0):
    rng = np.random.default_rng(3)
    boxes = [
        px(*span, edge, edge + 1.1)
        for span in SPANS
        for edge in edges_of_slabs(ahead_m)[list(storeys)]
    ]
    boxes = np.array(boxes) + rng.normal(0, noise / STEP_M, (len(boxes), 4))
    return Detections(boxes, np.full(len(boxes), scores), np.full(len(boxes), "balcony"))


@pytest.mark.parametrize("ahead_m", [0.0, 0.9, 1.4, 1.8])
def test_how_far_slabs_stand_out_follows_from_where_their_edges_appear(ahead_m):
    columns = balcony_columns(balconies(ahead_m, noise=0.05), openings(), 0.3, CAMERAS, GRID)
    assert len(columns) == 2
    for column, (left, right) in zip(columns, SPANS, strict=True):
        assert (column.left_m, column.right_m) == pytest.approx((left, right), abs=0.1)
        assert column.slabs_m == pytest.approx(SLABS_M, abs=0.15)
        assert column.edges_m == pytest.approx(edges_of_slabs(ahead_m), abs=0.2)


def test_a_storey_between_two_with_a_balcony_has_one_and_one_above_the_highest_has_none():
    (first, _) = balcony_columns(
        balconies(1.4, storeys=(0, 1, 3, 4)), openings(), 0.3, CAMERAS, GRID
    )
    assert first.slabs_m == pytest.approx(SLABS_M[:5], abs=0.15)


def test_a_slab_whose_edge_would_lie_above_the_picture_is_there():
    # The eaves are 0.3 m above the highest heads: that slab's edge appears 0.2 m above them.
    low = FacadeGrid(GRID.world_from_facade, 480, 394, STEP_M)
    up = np.array([0, 46, 0, 46])
    seen = balconies(1.8, storeys=range(6))
    seen.boxes_px[:] -= up
    (first, _) = balcony_columns(seen, openings() - up, 0.3, CAMERAS, low)
    assert first.edges_m[-1] > low.height_m
    assert len(first.slabs_m) == 7


def test_two_storeys_weak_balconies_or_none_tell_nothing():
    assert balcony_columns(balconies(1.4, (0, 1)), openings(), 0.3, CAMERAS, GRID) == ()
    weak = balconies(1.4, scores=0.2)
    assert balcony_columns(weak, openings(), 0.3, CAMERAS, GRID) == ()
    assert balcony_columns(weak.select(np.zeros(0, int)), openings(), 0.3, CAMERAS, GRID) == ()
    assert balcony_columns(balconies(1.4), np.zeros((0, 4)), 0.3, CAMERAS, GRID) == ()


def test_a_slab_hides_the_wall_up_to_where_its_edge_appears():
    found = balconies(1.4)
    columns = balcony_columns(found, openings(), 0.3, CAMERAS, GRID)
    nothing = found.select(np.zeros(0, int))
    hidden = covers(nothing, columns, GRID).boxes_px
    first = hidden[hidden[:, 0] < 240]
    # The lowest lies below the cameras: they see what is above it.
    assert len(first) == 6
    bottoms_m, tops_m = (np.sort((440 - first[:, side]) * STEP_M) for side in (3, 1))
    assert bottoms_m == pytest.approx(SLABS_M[1:], abs=0.15)
    assert tops_m == pytest.approx(edges_of_slabs(1.4)[1:] + 0.2, abs=0.2)


def test_a_solid_front_hides_down_to_where_its_slab_meets_the_wall_and_one_more_is_like_it():
    found = balconies(1.4)
    columns = balcony_columns(found, openings(), 0.3, CAMERAS, GRID)
    fronts = found.select(np.arange(6))
    hidden = covers(fronts, columns[:1], GRID)
    assert len(hidden) == 7
    heights_m = (440 - hidden.boxes_px[:, [3, 1]]) * STEP_M
    edges = edges_of_slabs(1.4)
    assert heights_m[1:, 0] == pytest.approx(SLABS_M[1:], abs=0.15)
    assert heights_m[:, 1] == pytest.approx(edges + 1.1, abs=0.2)
    # In the plane of the wall, what shows is what there is.
    flush = balconies(0.0)
    plane = balcony_columns(flush, openings(), 0.3, CAMERAS, GRID)
    same = covers(flush, plane, GRID).boxes_px
    assert same == pytest.approx(flush.boxes_px, abs=2)
