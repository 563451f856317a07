"""Algorithm 1 for photos, against a wall whose every point has a known colour."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.scenes.flat_wall import (
    painted,
    photo,
    picture,
    smooth,
    wall_grid,
)

from si3fp.camera2d.rectify import rectify_photo
from si3fp.config import MosaicConfig
from si3fp.errors import InputError
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Photo

CONFIG = MosaicConfig()


def exact_pixels(taken: Photo, grid: FacadeGrid):
    pixels = np.meshgrid(np.arange(grid.width_px) + 0.5, np.arange(grid.height_px) + 0.5)
    world = grid.world_from_pixels(np.stack(pixels, axis=-1))
    return taken.camera.project(taken.cam_from_world.apply(world))


POSES = {
    "frontal": photo(6.0, 4.5, 12.0),
    "from below": photo(5.0, 1.6, 8.0),
    "oblique": photo(16.0, 1.6, 7.0),
    "portrait": photo(7.0, 2.0, 9.0, roll_deg=90.0),
    "rolled": photo(2.0, 2.0, 9.0, roll_deg=20.0),
}


@pytest.mark.parametrize("taken", POSES.values(), ids=list(POSES))
def test_a_wall_is_recovered_to_two_grey_levels(taken):
    grid = wall_grid()
    view = rectify_photo(taken, picture(taken), grid, CONFIG)
    assert view.source == "p"
    assert view.valid.mean() > 0.5
    error = np.abs(view.rgb - painted(grid))[view.valid]
    # Half a level of rounding twice, and the waves' curvature over a source pixel.
    assert error.max() < 2.5
    assert error.mean() < 0.5


def test_a_shift_of_half_a_pixel_would_show():
    grid = wall_grid()
    view = rectify_photo(POSES["frontal"], picture(POSES["frontal"]), grid, CONFIG)
    moved = painted(grid, lambda x, y: smooth(x + 0.025, y))
    assert np.abs(view.rgb - moved)[view.valid].max() > 4.0


def test_the_rim_of_the_photo_is_exact_and_nothing_beyond_it_is_shown():
    taken, grid = photo(3.0, 1.6, 9.0, at=(4.0, 2.5), focal_px=700.0), wall_grid(0.02)
    image = np.full((600, 800, 3), 200, np.uint8)
    view = rectify_photo(taken, image, grid, CONFIG)
    exact = exact_pixels(taken, grid)
    inside = ((exact >= 0.5) & (exact <= [799.5, 599.5])).all(axis=-1)
    np.testing.assert_array_equal(view.valid, inside)
    assert 0.1 < view.valid.mean() < 0.9
    assert (view.rgb[view.valid] == 200).all()
    assert not view.rgb[~view.valid].any()


def test_what_lies_behind_the_camera_or_the_wall_is_not_seen():
    grid = wall_grid()
    image = np.full((600, 800, 3), 200, np.uint8)
    away = photo(6.0, 4.5, 5.0, at=(40.0, 4.5))
    turned = dataclasses.replace(
        away,
        cam_from_world=Rigid3(np.diag([-1.0, 1.0, -1.0]), np.zeros(3)) @ away.cam_from_world,
    )
    behind = photo(6.0, 4.5, -8.0)
    for taken in (turned, behind):
        assert not rectify_photo(taken, image, grid, CONFIG).valid.any()


def test_the_obliqueness_limit_holds():
    taken, grid = photo(17.0, 4.5, 4.0), wall_grid()
    config = dataclasses.replace(CONFIG, max_obliqueness_deg=60.0)
    view = rectify_photo(taken, np.zeros((600, 800, 3), np.uint8), grid, config)
    x_m = (np.arange(grid.width_px) + 0.5) * grid.m_per_px
    beyond = np.hypot(17.0 - x_m, 0.0) > 4.0 * np.tan(np.deg2rad(60.0))
    assert not view.valid[:, beyond].any()
    assert view.valid.any()


def test_detail_finer_than_the_grid_becomes_its_mean():
    """A checkerboard of about 6 x 6 source pixels per grid pixel is grey, not a moire."""
    taken = photo(6.0, 4.5, 12.0, focal_px=360.0)
    image = np.indices((600, 800)).sum(axis=0) % 2 * np.uint8(255)
    image = np.repeat(image[..., None], 3, axis=-1).astype(np.uint8)
    view = rectify_photo(taken, image, wall_grid(0.2), CONFIG)
    assert np.abs(view.rgb[view.valid].astype(int) - 127).max() <= 2


@pytest.mark.parametrize("m_per_px", [0.05, 0.15, 0.4])
def test_averaging_down_keeps_places(m_per_px):
    """Photo pixels are 1.5 cm here; half a pixel of the coarsest grid off: 15 grey levels."""

    def long_waves(x_m, y_m):
        return smooth(x_m / 3, y_m / 3)

    taken, grid = photo(9.0, 2.0, 7.0, roll_deg=3.0), wall_grid(m_per_px)
    view = rectify_photo(taken, picture(taken, long_waves), grid, CONFIG)
    # The mean over an oblique averaged pixel is flatter than the wave.
    assert np.abs(view.rgb - painted(grid, long_waves))[view.valid].max() < 4.0


def test_a_photo_of_another_size_than_its_camera_is_an_error():
    with pytest.raises(InputError, match="400 x 300 px, its camera 800 x 600"):
        rectify_photo(POSES["frontal"], np.zeros((300, 400, 3), np.uint8), wall_grid(), CONFIG)
