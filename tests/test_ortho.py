"""Algorithm 1 against walls whose every point has a known colour."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from si3fp.config import OrthoConfig
from si3fp.geometry.equirect import (
    directions_from_pixels,
    pixels_from_directions,
    world_from_pano_rotation,
)
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Panorama
from si3fp.ortho import (
    MAP_ERROR_PX,
    _lattice_map,
    _source_window,
    _upsampled,
    rectify,
    source_m_per_px,
    view_distances,
    view_weight,
)

CONFIG = OrthoConfig()
SOUTH_WALL = Rigid3(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), np.array([100.0, 50.0, 7.0]))
"""x east, y up, the outward normal to the south."""

Paint = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


def wall_grid(width_m=12.0, height_m=9.0, m_per_px=0.05) -> FacadeGrid:
    return FacadeGrid.covering(SOUTH_WALL, width_m, height_m, m_per_px)


def camera(x_m: float, y_m: float, z_m: float, *, heading=0.0, pitch=0.0, roll=0.0) -> Panorama:
    """A panorama at a place in the wall's frame; with heading 0 it looks north, at the wall."""
    rotation = world_from_pano_rotation(heading, pitch, roll)
    return Panorama(
        "pano", "2026-11", Rigid3(rotation, SOUTH_WALL.apply([x_m, y_m, z_m])).inverse()
    )


def smooth(x_m, y_m):
    """Three channels of waves of at least 2.5 m: linear interpolation errs below a grey level."""
    waves = [
        np.sin(2 * np.pi * x_m / 3.1) * np.cos(2 * np.pi * y_m / 4.3),
        np.cos(2 * np.pi * (x_m + 0.7 * y_m) / 2.9),
        np.sin(2 * np.pi * (x_m - y_m) / 5.3 + 1.0),
    ]
    return np.stack([128 + 90 * wave for wave in waves], axis=-1)


def panorama_of_wall(panorama: Panorama, paint: Paint, width_px: int) -> NDArray[np.uint8]:
    """What the panorama sees of an endless painted wall: every ray cut with the plane."""
    size = (width_px, width_px // 2)
    xy = np.stack(np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5), axis=-1)
    wall_from_pano = SOUTH_WALL.inverse() @ panorama.pano_from_world.inverse()
    rays = wall_from_pano.rotate(directions_from_pixels(xy, *size))
    towards = rays[..., 2] < -1e-3
    slope = np.where(towards, rays[..., 2], -1.0)
    reach = np.where(towards, -wall_from_pano.translation[2] / slope, 0.0)
    points = wall_from_pano.translation + reach[..., None] * rays
    colours = np.where(towards[..., None], paint(points[..., 0], points[..., 1]), 0)
    return (np.clip(colours, 0, 255) + 0.5).astype(np.uint8)


def painted_on(grid: FacadeGrid, paint: Paint) -> NDArray[np.float64]:
    xy = np.stack(
        np.meshgrid(np.arange(grid.width_px) + 0.5, np.arange(grid.height_px) + 0.5), axis=-1
    )
    metres = grid.facade_from_pixels(xy)
    return paint(metres[..., 0], metres[..., 1])


def everything(image: NDArray[np.uint8]) -> NDArray[np.bool_]:
    return np.ones(image.shape[:2], bool)


POSES = {
    "level": {},
    "turned": {"heading": 37.0},
    "tilted": {"heading": -21.0, "pitch": 6.0, "roll": -4.0},
    "seam through the facade": {"heading": 180.0},
    "seam, tilted": {"heading": 172.0, "pitch": -5.0, "roll": 3.0},
}


@pytest.mark.parametrize("pose", POSES.values(), ids=list(POSES))
def test_a_wall_is_recovered_to_two_grey_levels(pose):
    panorama = camera(5.0, 2.5, 7.0, **pose)
    grid = wall_grid()
    image = panorama_of_wall(panorama, smooth, 2048)
    view = rectify(panorama, image, everything(image), grid, CONFIG)
    assert view.source == "pano"
    assert view.valid.all()
    error = np.abs(view.rgb - painted_on(grid, smooth))
    # Half a level of rounding twice, and the curvature of the waves over a source pixel of 2 to
    # 8 cm: at most 0.9 levels in the far corner.
    assert error.max() < 2.0
    assert error.mean() < 0.5


def test_a_shift_of_half_a_pixel_would_show():
    """The truth above is sharp enough to tell pixel centres from pixel corners."""
    panorama, grid = camera(5.0, 2.5, 7.0), wall_grid()
    image = panorama_of_wall(panorama, smooth, 2048)
    view = rectify(panorama, image, everything(image), grid, CONFIG)
    truth = painted_on(grid, lambda x, y: smooth(x + 0.025, y))
    assert np.abs(view.rgb - truth).max() > 4.0


def test_a_camera_behind_the_plane_sees_nothing():
    panorama, grid = camera(5.0, 2.5, -7.0, heading=180.0), wall_grid()
    image = np.full((512, 1024, 3), 200, np.uint8)
    assert not rectify(panorama, image, everything(image), grid, CONFIG).valid.any()
    assert not view_weight(panorama, grid).any()


def test_a_camera_in_the_plane_sees_nothing():
    grid = wall_grid(2.0, 2.0, 0.25)
    x_m, y_m = grid.facade_from_pixels([3.5, 2.5])
    panorama = camera(x_m, y_m, 0.0)
    image = np.full((64, 128, 3), 200, np.uint8)
    assert not rectify(panorama, image, everything(image), grid, CONFIG).valid.any()


def test_what_the_image_does_not_show_is_not_valid():
    """A square hole in the panorama is a hole in the view, one grid pixel wider at most."""
    panorama, grid = camera(6.0, 3.0, 8.0, heading=15.0), wall_grid()
    image = np.full((1024, 2048, 3), 200, np.uint8)
    rows, columns = slice(440, 520), slice(850, 1000)
    seen = everything(image)
    seen[rows, columns] = False
    image[~seen] = 0
    view = rectify(panorama, image, seen, grid, CONFIG)

    xy = np.stack(
        np.meshgrid(np.arange(grid.width_px) + 0.5, np.arange(grid.height_px) + 0.5), axis=-1
    )
    exact = pixels_from_directions(
        panorama.pano_from_world.apply(grid.world_from_pixels(xy)), 2048, 1024
    )
    beyond = np.max(
        [
            columns.start - exact[..., 0],
            exact[..., 0] - columns.stop,
            rows.start - exact[..., 1],
            exact[..., 1] - rows.stop,
        ],
        axis=0,
    )
    assert (beyond < 0).sum() > 1000
    assert not view.valid[beyond < 0.4].any()
    assert view.valid[beyond > 0.6].all()
    assert (view.rgb[view.valid] == 200).all()


def test_the_rim_of_the_image_counts_as_unseen():
    """The zenith of a camera tilted by 60 degrees, on the wall: no valid pixel borrows from
    beyond the image's upper border."""
    panorama = camera(1.0, 0.0, 4.0, pitch=-60.0)
    grid = wall_grid(2.0, 5.0, 0.005)
    image = np.full((256, 512, 3), 200, np.uint8)
    view = rectify(panorama, image, everything(image), grid, CONFIG)
    assert 0.9 < view.valid.mean() < 1
    assert (view.rgb[view.valid] == 200).all()


@pytest.mark.parametrize("limit_deg", [30.0, 55.0, 72.0])
def test_the_obliqueness_limit_is_exact(limit_deg):
    panorama, grid = camera(4.0, 3.5, 1.9, heading=200.0, pitch=3.0), wall_grid()
    image = np.full((512, 1024, 3), 200, np.uint8)
    config = dataclasses.replace(CONFIG, max_obliqueness_deg=limit_deg)
    view = rectify(panorama, image, everything(image), grid, config)
    xy = np.stack(
        np.meshgrid(np.arange(grid.width_px) + 0.5, np.arange(grid.height_px) + 0.5), axis=-1
    )
    _, cosines = view_distances(panorama, grid, xy)
    np.testing.assert_array_equal(view.valid, cosines >= np.cos(np.deg2rad(limit_deg)))
    assert 0 < view.valid.mean() < 1


@pytest.mark.parametrize("distance_m", [3.0, 8.0, 20.0, 60.0])
@pytest.mark.parametrize("width_px", [2048, 16384])
def test_the_interpolated_map_is_within_its_stated_error(distance_m, width_px):
    grid = wall_grid(30.0, 15.0, 0.02)
    panorama = camera(8.0, 2.5, distance_m, heading=170.0, pitch=4.0, roll=-3.0)
    lattice, step, shrink = _lattice_map(panorama, grid, width_px, width_px // 2)
    rng = np.random.default_rng(0)
    columns, rows = rng.integers(grid.width_px, size=4000), rng.integers(grid.height_px, size=4000)
    ours = np.stack(
        [
            _upsampled(axis, step, (grid.height_px, grid.width_px))
            for axis in lattice.astype(np.float32)
        ],
        axis=-1,
    )[rows, columns]
    pixels = np.stack([columns, rows], axis=-1) + 0.5
    exact = pixels_from_directions(
        panorama.pano_from_world.apply(grid.world_from_pixels(pixels)), width_px, width_px // 2
    )
    error = ours - exact
    error[:, 0] = (error[:, 0] + width_px / 2) % width_px - width_px / 2
    assert np.abs(error).max() < MAP_ERROR_PX * shrink + 0.002  # float32 at x = 16384
    if width_px < 8192 or distance_m > 3:
        assert step >= 4  # else the map would cost more than the remap


@pytest.mark.parametrize("band_px", [1, 64, 100, 10_000])
def test_the_height_of_the_bands_does_not_change_a_bit(band_px):
    panorama = camera(5.0, 2.5, 5.0, heading=160.0, pitch=6.0, roll=-4.0)
    grid = wall_grid(12.0, 9.0, 0.03)
    image = np.random.default_rng(0).integers(0, 256, (512, 1024, 3), dtype=np.uint8)
    seen = everything(image)
    seen[300:330, 100:400] = False
    whole = rectify(panorama, image, seen, grid, dataclasses.replace(CONFIG, band_px=256))
    banded = rectify(panorama, image, seen, grid, dataclasses.replace(CONFIG, band_px=band_px))
    np.testing.assert_array_equal(whole.rgb, banded.rgb)
    np.testing.assert_array_equal(whole.valid, banded.valid)


def test_detail_finer_than_the_grid_becomes_its_mean():
    """A checkerboard of 8 x 8 source pixels per grid pixel is grey, not a moire."""
    panorama, grid = camera(5.0, 4.5, 12.0), wall_grid(10.0, 9.0, 0.2)
    image = np.indices((2048, 4096)).sum(axis=0) % 2 * np.uint8(255)
    image = np.repeat(image[..., None], 3, axis=-1).astype(np.uint8)
    view = rectify(panorama, image, everything(image), grid, CONFIG)
    assert np.abs(view.rgb.astype(int) - 127).max() <= 2


def test_averaging_down_keeps_places():
    """A source 8 times finer than the grid; half an averaged pixel off: 5 grey levels."""

    def long_waves(x_m, y_m):
        return smooth(x_m / 3, y_m / 3)

    panorama, grid = camera(5.0, 2.5, 7.0, heading=175.0, roll=2.0), wall_grid(12.0, 9.0, 0.3)
    image = panorama_of_wall(panorama, long_waves, 2048)
    *_, shrink = _lattice_map(panorama, grid, 2048, 1024)
    assert shrink == 8
    view = rectify(panorama, image, everything(image), grid, CONFIG)
    # The mean over an oblique averaged pixel is up to 2 levels flatter than the wave.
    assert np.abs(view.rgb - painted_on(grid, long_waves)).max() < 2.5


@pytest.mark.parametrize("heading", [0.0, 90.0, 180.0, 270.0])
def test_the_source_window_fits_into_cv2(heading):
    """The largest panorama: the window is a strip of the image, so that remap's 16 bit sizes
    and float32 coordinates (2**-10 px at 16384) suffice; x is unwrapped, never beyond twice."""
    grid = wall_grid(70.0, 20.0, 0.02)
    panorama = camera(20.0, 2.5, 4.0, heading=heading, pitch=4.0)
    lattice, _, shrink = _lattice_map(panorama, grid, 16384, 8192)
    left, top, right, bottom = _source_window(lattice, shrink, 16384, 8192)
    assert right - left <= 16384
    assert 0 <= top < bottom <= 8192
    assert left < lattice[0].min() < lattice[0].max() < right


def test_weight_falls_with_distance_and_obliqueness():
    grid = wall_grid(20.0, 3.0, 0.5)
    middle = (3, 10)
    near, far = (view_weight(camera(5.25, 1.25, z), grid) for z in (5.0, 10.0))
    # Solid angle of a pixel straight ahead: 1 / d**2.
    assert near[middle] / far[middle] == pytest.approx(4.0, rel=1e-5)
    assert near[middle] == pytest.approx(1 / 25, rel=1e-5)
    assert (np.diff(near[middle[0], 10:]) < 0).all()
    # 5 m to the side at 5 m: cos 45 degrees over a squared distance of 50 m2.
    assert near[3, 20] == pytest.approx(np.sqrt(0.5) / 50, rel=1e-5)


def test_source_resolution_by_hand():
    """Straight ahead of a far camera, a source pixel is 2 pi d / W wide."""
    grid = wall_grid(2.0, 2.0, 0.05)
    expected = 2 * np.pi * 20.0 / 4096
    assert source_m_per_px(camera(1.0, 1.0, 20.0), grid, 4096) == pytest.approx(expected, rel=5e-3)
    # Seen at 60 degrees: twice the distance, half the cosine.
    oblique = camera(1.0 + 20.0 * np.sqrt(3), 1.0, 20.0)
    assert source_m_per_px(oblique, grid, 4096) == pytest.approx(4 * expected, rel=0.06)


def test_a_camera_behind_the_wall_resolves_nothing():
    assert source_m_per_px(camera(1.0, 1.0, -5.0), wall_grid(2.0, 2.0), 4096) == np.inf
