"""Photos blended on a facade whose every point has a known colour."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.scenes.flat_wall import (
    NO_POINTS,
    PLANE,
    painted,
    photo,
    picture,
    standing,
    wall_grid,
)

from si3fp.camera2d.mosaic import render_mosaic
from si3fp.config import MosaicConfig
from si3fp.errors import FacadeError

CONFIG = MosaicConfig()


def album(panels=()):
    taken = [photo(x, 1.6, 9.0, name=f"{x:g}") for x in (2.0, 4.0, 6.0, 8.0, 10.0)]
    return taken, {p.id: picture(p, panels=panels) for p in taken}


def test_what_stands_before_the_wall_vanishes_from_the_blend():
    """A panel of 1 x 2 m, 3 m before the wall: in every photo it hides another part of it."""
    taken, images = album([(5.5, 6.5, 0.0, 2.0, 3.0)])
    grid = wall_grid()
    loaded = []

    def load(name):
        loaded.append(name)
        return images[name]

    rendering = render_mosaic(PLANE, grid, taken, load, [PLANE], NO_POINTS, CONFIG)
    fused = rendering.fused
    assert fused.source == "mosaic"
    assert sorted(loaded) == sorted(images)
    three = fused.seen_by >= 4
    assert three.mean() > 0.4
    assert np.abs(fused.rgb - painted(grid))[three].max() < 12
    assert np.abs(fused.rgb - painted(grid))[three].mean() < 1


def test_what_one_photo_alone_saw_is_masked_and_counted():
    taken, images = album()
    narrow = [
        dataclasses.replace(p, camera=dataclasses.replace(p.camera, width_px=100, cx_px=50.0))
        for p in taken
    ]
    grid = wall_grid()
    rendering = render_mosaic(
        PLANE, grid, narrow, lambda name: images[name][:, 355:455].copy(), [], NO_POINTS, CONFIG
    )
    fused = rendering.fused
    count = np.sum([view.valid for view in rendering.views.views], axis=0)
    # Counted on the lattice, so that a cell's rim may differ.
    assert (fused.seen_by == count).mean() > 0.95
    assert (fused.seen_by == 1).any()
    np.testing.assert_array_equal(fused.valid, (count >= 2) & (fused.seen_by >= 2))
    assert not fused.rgb[~fused.valid].any()


def test_cameras_are_given_in_the_frame_of_the_facade():
    taken, images = album()
    rendering = render_mosaic(PLANE, wall_grid(), taken, images.__getitem__, [], NO_POINTS, CONFIG)
    for p in taken:
        np.testing.assert_allclose(
            rendering.cameras_in_facade[p.id], [float(p.id), 1.6, 9.0], atol=1e-9
        )


def test_no_photo_of_the_facade_is_an_error_that_says_why():
    _, images = album()
    hidden = standing(6.0, 2.0, 4.0)
    behind = [photo(6.0, 4.5, -8.0)]
    with pytest.raises(FacadeError, match="None of 1 photos shows wall-0"):
        render_mosaic(PLANE, wall_grid(), behind, images.__getitem__, [hidden], NO_POINTS, CONFIG)


def test_rendering_twice_gives_the_same_bits():
    taken, images = album([(5.5, 6.5, 0.0, 2.0, 3.0)])
    first, second = (
        render_mosaic(PLANE, wall_grid(), taken, images.__getitem__, [], NO_POINTS, CONFIG).fused
        for _ in range(2)
    )
    np.testing.assert_array_equal(first.rgb, second.rgb)
