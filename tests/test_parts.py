"""A bay and its wings on one footprint edge become one facade, and no window counts twice."""

from __future__ import annotations

import numpy as np
import pytest

from si3fp.camera2d.parts import merge_parts
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Facade, Window

# Looks south: x east, y up, z (outward) towards -y of the world.
SOUTH = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


def part(name, x_m, y_world_m, width_m, windows=(), height_m=10.0, ground_m=0.0):
    pose = Rigid3(SOUTH, np.array([x_m, y_world_m, ground_m]))
    return Facade(name, pose, width_m, height_m, tuple(windows))


def window(x_m, y_m, score=0.9):
    return Window(x_m, y_m, 1.0, 1.5, score=score)


def test_wings_and_bay_are_joined_on_the_largest_plane():
    left = part("house-2", 0.0, 0.0, 12.0, [window(1.0, 1.0)])
    bay = part("house-2.2", 12.0, -0.8, 5.0, [window(2.0, 4.0)])
    right = part("house-2.3", 17.0, 0.0, 8.0, [window(3.0, 1.0)])
    other = part("house-3", 40.0, 0.0, 5.0)
    joined, rest = merge_parts([left, bay, right, other])
    assert rest is other
    assert (joined.id, joined.width_m, joined.height_m) == ("house-2", 25.0, 10.0)
    assert [(w.x_m, w.y_m) for w in joined.windows] == [(1.0, 1.0), (14.0, 4.0), (20.0, 1.0)]
    np.testing.assert_allclose(joined.world_from_facade.translation, [0.0, 0.0, 0.0])
    for before, after in zip([left, bay, right], joined.windows, strict=True):
        old = before.world_from_facade.apply([before.windows[0].x_m, before.windows[0].y_m, 0.0])
        new = joined.world_from_facade.apply([after.x_m, after.y_m, 0.0])
        np.testing.assert_allclose(new[[0, 2]], old[[0, 2]], atol=1e-9)


def test_a_window_at_a_seam_counts_once():
    left = part("house-2", 0.0, 0.0, 12.0, [window(11.0, 1.0, score=0.7)])
    bay = part("house-2.2", 11.0, -0.5, 5.0, [window(0.1, 1.0, score=0.8)])
    (joined,) = merge_parts([left, bay])
    assert [w.score for w in joined.windows] == [0.8]


def test_the_lowest_ground_and_the_highest_eaves_bound_the_facade():
    (joined,) = merge_parts(
        [
            part("house-2", 0.0, 0.0, 12.0, ground_m=0.5),
            part("house-2.2", 12.0, -0.5, 5.0, height_m=12.0),
        ]
    )
    assert joined.height_m == pytest.approx(12.0)
    assert joined.world_from_facade.translation[2] == pytest.approx(0.0)


def test_a_part_alone_takes_the_name_of_its_edge():
    assert [f.id for f in merge_parts([part("house-2.2", 0.0, 0.0, 3.0)])] == ["house-2"]
