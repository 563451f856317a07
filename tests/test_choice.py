"""Which photos a facade is rendered from."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.scenes.flat_wall import (
    NO_POINTS,
    PLANE,
    WIDTH_M,
    lattice_metres,
    photo,
    wall_grid,
)

from si3fp.camera2d.choice import best_places, choose_photos
from si3fp.camera2d.visibility import seen_from
from si3fp.config import MosaicConfig

CONFIG = MosaicConfig()


def ring(count):
    return [
        photo(x, 1.6, 9.0, at=(x, 3.0), focal_px=900.0, name=f"{i:03d}")
        for i, x in enumerate(np.linspace(0.0, WIDTH_M, count))
    ]


def test_the_first_photos_cover_the_facade():
    taken = ring(25)
    sights = seen_from(PLANE, wall_grid(), taken, [], NO_POINTS, CONFIG)
    chosen = choose_photos(taken, sights, wall_grid(), dataclasses.replace(CONFIG, max_views=4))
    together = np.any([sights[p.id] for p in chosen], axis=0)
    everything = np.any([sights[p.id] for p in taken], axis=0)
    assert len(chosen) == 4
    assert together.sum() > 0.9 * everything.sum()


@pytest.mark.parametrize("choose", [choose_photos, best_places])
def test_the_choice_does_not_depend_on_the_order_given(choose):
    taken = ring(25)
    sights = seen_from(PLANE, wall_grid(), taken, [], NO_POINTS, CONFIG)
    config = dataclasses.replace(CONFIG, max_views=8)
    forth = choose(taken, sights, wall_grid(), config)
    back = choose(taken[::-1], sights, wall_grid(), config)
    assert len(forth) == 8
    assert [str(getattr(p, "id", p)) for p in forth] == [str(getattr(p, "id", p)) for p in back]


@pytest.mark.parametrize("choose", [choose_photos, best_places])
def test_the_nearer_of_two_photos_comes_first(choose):
    near, far = photo(6.0, 4.5, 12.0, name="z"), photo(6.0, 4.5, 40.0, focal_px=600.0, name="a")
    sights = seen_from(PLANE, wall_grid(), [near, far], [], NO_POINTS, CONFIG)
    first = next(iter(choose([far, near], sights, wall_grid(0.01), CONFIG)))
    assert getattr(first, "id", first) == "z"


def test_places_belong_to_the_photos_that_look_straight_at_them():
    """Two stand for a place: those nearest to it."""
    row = (1.0, 3.07, 6.23, 9.0, 11.0)
    taken = [photo(x, 4.5, 9.0, at=(x, 4.5), name=f"{x:g}") for x in row]
    grid = wall_grid()
    sights = seen_from(PLANE, grid, taken, [], NO_POINTS, CONFIG)
    config = dataclasses.replace(CONFIG, photos_per_place=2)
    places = best_places(taken, sights, grid, config)
    assert (np.sum(list(places.values()), axis=0) == 2).all()
    x, _ = lattice_metres(sights["9"])
    for name, mine in places.items():
        gaps = np.sort([np.abs(x - float(other)) for other in places], axis=0)
        np.testing.assert_array_equal(mine, np.abs(x - float(name)) <= gaps[1] + 1e-9)


def test_a_photo_that_adds_nothing_is_left_out():
    taken = [photo(6.0, 4.5, 9.0, name=name) for name in "dacb"]
    taken.append(photo(6.0, 4.5, 12.0, name="farther"))
    grid = wall_grid(0.01)
    sights = seen_from(PLANE, grid, taken[:4], [], NO_POINTS, CONFIG)
    sights["farther"] = sights["a"]
    config = dataclasses.replace(CONFIG, photos_per_place=3)
    assert list(best_places(taken, sights, grid, config)) == ["a", "b", "c"]
