"""What views agree on is the wall; what stands before it lies elsewhere in every view."""

import numpy as np
import pytest

from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import OrthoImage
from si3fp.windows.seen import share_seen, wall_seen

GRID = FacadeGrid(Rigid3(np.eye(3), np.zeros(3)), 200, 100, 0.02)


def view(name, van_at=None, valid=None):
    rgb = np.full((100, 200, 3), 180, np.uint8)
    if van_at is not None:
        rgb[40:, van_at : van_at + 80] = (30, 40, 120)
    seen = np.ones((100, 200), bool) if valid is None else valid
    return OrthoImage(name, rgb, seen)


def fused(views):
    stack = np.stack([v.rgb for v in views])
    valid = np.stack([v.valid for v in views]).any(axis=0)
    return OrthoImage("fused", np.median(stack, axis=0).astype(np.uint8), valid)


def test_what_most_views_agree_on_is_seen():
    views = [view("a", 20), view("b"), view("c")]
    assert wall_seen(fused(views), views).min() == 1


def test_what_moves_from_view_to_view_hides_the_wall():
    views = [view("a", 0), view("b", 40), view("c", 80), view("d", 120)]
    seen = wall_seen(fused(views), views)
    assert seen[:36].min() == 1
    assert seen[44:, 60:140].mean() < 0.3


def test_nothing_was_seen_where_no_view_looked_and_little_by_one_of_many():
    left = np.zeros((100, 200), bool)
    left[:, :100] = True
    most = left.copy()
    most[:, :160] = True
    views = [view("a", valid=left), view("b", valid=left), view("c", valid=most)]
    seen = wall_seen(fused(views), views)
    assert seen[:, :96].min() == 1
    assert seen[:, 104:156] == pytest.approx(0.5)
    assert seen[:, 164:].max() == 0


def test_a_single_view_is_believed():
    one = view("a", 20)
    assert wall_seen(one, [one]).min() == 1


def test_share_of_a_rectangle():
    seen = np.zeros((100, 200), np.float32)
    seen[50:, :100] = 1
    assert share_seen(seen, GRID, np.array([0, 4, 0, 2.0])) == pytest.approx(0.25)
    assert share_seen(seen, GRID, np.array([0, 2, 0, 1.0])) == 1
    assert np.isnan(share_seen(seen, GRID, np.array([5, 6, 0, 1.0])))
