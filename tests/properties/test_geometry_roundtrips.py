"""There and back again gives the same: every pair of inverse functions of the geometry."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from si3fp.geometry.enu import GeoOrigin, geodetic_from_world, world_from_geodetic
from si3fp.geometry.equirect import (
    directions_from_pixels,
    pixels_from_directions,
    world_from_pano_rotation,
)
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3

unit = st.floats(0, 1)
angles_deg = st.floats(-180, 180)
metres = st.floats(-1000, 1000)
points = st.tuples(metres, metres, metres)


@st.composite
def poses(draw) -> Rigid3:
    rotation = world_from_pano_rotation(draw(angles_deg), draw(angles_deg), draw(angles_deg))
    return Rigid3(rotation, np.array(draw(points)))


@st.composite
def grids(draw) -> FacadeGrid:
    width_px, height_px = draw(st.integers(1, 5000)), draw(st.integers(1, 2000))
    return FacadeGrid(draw(poses()), width_px, height_px, draw(st.floats(0.002, 0.2)))


@given(unit, st.floats(0.001, 0.999), st.sampled_from([512, 8192, 16384]))
def test_pixels_to_directions_and_back(across, down, width_px):
    height_px = width_px // 2
    pixel = np.array([across * width_px, down * height_px])
    ray = directions_from_pixels(pixel, width_px, height_px)
    assert abs(np.linalg.norm(ray) - 1) < 1e-12
    back = pixels_from_directions(ray, width_px, height_px)
    assert 0 <= back[0] < width_px
    gap_x = (back[0] - pixel[0] + width_px / 2) % width_px - width_px / 2  # the seam is one line
    # Near the poles the horizontal part of a ray is small, and its rounding weighs more.
    assert abs(gap_x) < 1e-7
    assert abs(back[1] - pixel[1]) < 1e-7


@given(angles_deg, st.floats(-89.9, 89.9), st.floats(0.01, 1e4))
def test_directions_to_pixels_and_back(yaw_deg, pitch_deg, length):
    yaw, pitch = np.deg2rad([yaw_deg, pitch_deg])
    ray = np.array([np.cos(pitch) * np.sin(yaw), -np.sin(pitch), np.cos(pitch) * np.cos(yaw)])
    back = directions_from_pixels(pixels_from_directions(ray * length, 8192, 4096), 8192, 4096)
    np.testing.assert_allclose(back, ray, atol=1e-12)


@given(angles_deg, angles_deg, angles_deg)
def test_every_heading_pitch_and_roll_make_a_rotation(heading, pitch, roll):
    rotation = world_from_pano_rotation(heading, pitch, roll)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) > 0


@given(st.floats(-89, 89), angles_deg, st.floats(-100, 5000), points)
def test_world_to_geodetic_and_back(lat_deg, lon_deg, height_m, point):
    origin = GeoOrigin(lat_deg, lon_deg, height_m)
    back = world_from_geodetic(geodetic_from_world(point, origin), origin)
    np.testing.assert_allclose(back, point, atol=1e-6)  # a micrometre


@given(st.floats(-89, 89), st.floats(-179, 179), st.floats(-100, 5000), points)
def test_geodetic_to_world_and_back(lat_deg, lon_deg, height_m, offset_m):
    east_m, north_m, up_m = offset_m
    place = [lat_deg + north_m * 9e-6, lon_deg + east_m * 9e-6, height_m + up_m]
    origin = GeoOrigin(lat_deg, lon_deg, height_m)
    back = geodetic_from_world(world_from_geodetic(place, origin), origin)
    np.testing.assert_allclose(back[:2], place[:2], atol=1e-10)  # degrees: 0.01 mm
    np.testing.assert_allclose(back[2], place[2], atol=1e-6)


@given(grids(), unit, unit)
def test_grid_pixels_to_the_facade_and_back(grid, across, down):
    pixel = np.array([across * grid.width_px, down * grid.height_px])
    back = grid.pixels_from_facade(grid.facade_from_pixels(pixel))
    np.testing.assert_allclose(back, pixel, atol=1e-8)


@given(grids(), unit, unit)
def test_grid_pixels_through_the_world_and_back(grid, across, down):
    pixel = np.array([across * grid.width_px, down * grid.height_px])
    in_facade = grid.world_from_facade.inverse().apply(grid.world_from_pixels(pixel))
    assert abs(in_facade[2]) < 1e-9  # metres off the plane
    np.testing.assert_allclose(grid.pixels_from_facade(in_facade[:2]), pixel, atol=1e-6)


@given(grids(), unit, unit, unit, unit, unit, unit)
def test_a_crop_moves_no_pixel(grid, left, right, top, bottom, across, down):
    x0, x1 = sorted([int(left * (grid.width_px - 1)), int(right * (grid.width_px - 1))])
    y0, y1 = sorted([int(top * (grid.height_px - 1)), int(bottom * (grid.height_px - 1))])
    part = grid.cropped(x0, y0, x1 + 1, y1 + 1)
    pixel = np.array([across * grid.width_px, down * grid.height_px])
    np.testing.assert_allclose(
        part.world_from_pixels(pixel - [x0, y0]), grid.world_from_pixels(pixel), atol=1e-9
    )


@given(poses(), points)
def test_a_transform_and_its_inverse_cancel(b_from_a, point):
    back = b_from_a.inverse().apply(b_from_a.apply(point))
    np.testing.assert_allclose(back, point, atol=1e-9)


@given(poses(), poses(), points)
def test_a_product_is_one_transform_after_the_other(c_from_b, b_from_a, point):
    np.testing.assert_allclose(
        (c_from_b @ b_from_a).apply(point), c_from_b.apply(b_from_a.apply(point)), atol=1e-9
    )


@given(poses(), poses())
def test_the_inverse_of_a_product_is_the_product_of_the_inverses(c_from_b, b_from_a):
    one = (c_from_b @ b_from_a).inverse()
    other = b_from_a.inverse() @ c_from_b.inverse()
    np.testing.assert_allclose(one.rotation, other.rotation, atol=1e-12)
    np.testing.assert_allclose(one.translation, other.translation, atol=1e-9)
