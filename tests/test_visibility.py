"""Which places of a wall a photo sees: walls and foreground with known shadows."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.scenes.flat_wall import (
    NO_POINTS,
    PLANE,
    WORLD_FROM_FACADE,
    lattice_metres,
    photo,
    points_at,
    standing,
    wall_grid,
)

from si3fp.camera2d.facade_plane import FacadePlane
from si3fp.camera2d.visibility import seen_from
from si3fp.config import MosaicConfig
from si3fp.geometry.rigid import Rigid3

CONFIG = MosaicConfig()


@pytest.mark.parametrize("side", [1, -1])
def test_a_wall_in_between_hides_exactly_its_shadow(side):
    """A wall 2 to 4 m before the facade at x = 6, the camera 8 m before it, at x = 6 +- 3."""
    taken = photo(6.0 + 3.0 * side, 4.5, 8.0, focal_px=200.0)
    sight = seen_from(
        PLANE, wall_grid(), [taken], [PLANE, standing(6.0, 2.0, 4.0)], NO_POINTS, CONFIG
    )
    x, _ = lattice_metres(sight["p"])
    # The rays over its ends meet the facade 3 * 2 / 6 and 3 * 4 / 4 m beyond it.
    shadow = (side * (6.0 - x) > 1.0) & (side * (6.0 - x) < 3.0)
    np.testing.assert_array_equal(~sight["p"], shadow)


def test_a_low_wall_hides_only_what_lies_below_its_edge():
    taken = photo(9.0, 1.6, 8.0, focal_px=200.0)
    low = standing(6.0, 2.0, 4.0, height_m=1.0)
    sight = seen_from(PLANE, wall_grid(), [taken], [low], NO_POINTS, CONFIG)["p"]
    x, y = lattice_metres(sight)
    assert (~sight).any()
    # Over its near end the view falls from 1.6 to 1 m in 6 m, and meets the facade at 0.8 m.
    assert sight[(x < 3.0) | (x > 5.0) | (y > 0.8)].all()


def test_a_wall_found_twice_does_not_hide_itself():
    taken = photo(6.0, 4.5, 8.0, focal_px=200.0)
    twin = FacadePlane(
        "wall-1",
        None,
        None,
        WORLD_FROM_FACADE @ Rigid3(np.eye(3), np.array([-1.0, 0.0, 0.3])),
        14.0,
        9.0,
    )
    assert seen_from(PLANE, wall_grid(), [taken], [twin], NO_POINTS, CONFIG)["p"].all()


def bush(x_m, y_m, z_m, count=40):
    rng = np.random.default_rng(0)
    return rng.normal([x_m, y_m, z_m], 0.2, (count, 3))


def test_a_tree_hides_from_every_photo_what_lies_behind_it():
    """Its points are those of one photo; it stands there for the others, too."""
    left, right = photo(1.0, 1.6, 9.0, name="left"), photo(11.0, 1.6, 9.0, name="right")
    past = [photo(x, 4.5, 3.5, focal_px=250.0, name=f"{x:g}") for x in (2.0, 10.0)]
    taken = [left, right, *past, *[dataclasses.replace(p, id=p.id + "b") for p in past]]
    tree = points_at(bush(6.0, 3.0, 4.0), ["left"])
    sights = seen_from(PLANE, wall_grid(), taken, [], tree, CONFIG)
    without = seen_from(PLANE, wall_grid(), taken, [], NO_POINTS, CONFIG)
    x, y = lattice_metres(sights["left"])
    # The rays from (1, 1.6, 9) and (11, 1.6, 9) through (6, 3, 4) meet the wall at (10 | 2, 4.12).
    for name, at_m in (("left", 10.0), ("right", 2.0)):
        gap = np.hypot(x - at_m, y - 4.12)
        assert without[name][gap < 0.5].any()
        assert not sights[name][gap < 0.5].any()
        np.testing.assert_array_equal(sights[name][gap > 2.5], without[name][gap > 2.5])


def test_points_on_the_wall_overrule_a_few_before_it():
    taken = photo(6.0, 1.6, 9.0)
    on_wall = np.column_stack([np.tile([6.0, 4.0], (60, 1)), np.zeros(60)])
    mixed = points_at(np.concatenate([bush(6.0, 3.0, 4.0, 5), on_wall]), ["p"])
    without = seen_from(PLANE, wall_grid(), [taken], [], NO_POINTS, CONFIG)["p"]
    sight = seen_from(PLANE, wall_grid(), [taken], [], mixed, CONFIG)["p"]
    x, y = lattice_metres(sight)
    near = np.hypot(x - 6.0, y - 4.0) < 0.3
    assert sight[near].all()
    assert without[near].all()


def test_what_all_photos_show_before_the_wall_is_kept():
    """A balcony: where they cannot see past it, they see as many places as without it."""
    names = ["a", "b", "c"]
    taken = [photo(x, 1.6, 9.0, name=name) for x, name in zip((5.0, 6.0, 7.0), names, strict=True)]
    points = points_at(bush(6.0, 4.0, 1.2, 200), names)
    sights = seen_from(PLANE, wall_grid(), taken, [], points, CONFIG)
    without = seen_from(PLANE, wall_grid(), taken, [], NO_POINTS, CONFIG)
    enough, before = (np.sum(list(s.values()), axis=0) >= 2 for s in (sights, without))
    np.testing.assert_array_equal(enough, before)


def test_a_hedge_gives_way_to_two_photos_that_see_past_it():
    """From (6, 1.6, 9) it hides the wall at (6, 2.06); the others look past it from the sides."""
    ahead = photo(6.0, 1.6, 9.0, name="ahead")
    aside = [photo(x, 1.6, 6.0, name=f"{x:g}") for x in (0.5, 11.5)]
    hedge = points_at(bush(6.0, 2.0, 1.2), ["ahead"])
    x, y = lattice_metres(seen_from(PLANE, wall_grid(), [ahead], [], hedge, CONFIG)["ahead"])
    behind = np.hypot(x - 6.0, y - 2.06) < 0.3
    for others, hidden in ((aside[:1], False), (aside, True)):
        sights = seen_from(PLANE, wall_grid(), [ahead, *others], [], hedge, CONFIG)
        assert sights["ahead"][behind].any() != hidden
        assert all(sights[p.id][behind].all() for p in others)
