"""Frames, cameras, planes and grids against numbers computed by hand."""

from __future__ import annotations

import numpy as np
import pyproj
import pytest

from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin, geodetic_from_world, world_from_geodetic
from si3fp.geometry.equirect import (
    directions_from_pixels,
    pixels_from_directions,
    world_from_pano_rotation,
)
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.planes import Planes, ray_plane_distances
from si3fp.geometry.rigid import Rigid3

QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
SOUTH_WALL = Rigid3(  # x east, y up, z south: a wall that looks south
    np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), np.array([10.0, 20.0, 3.0])
)


# rigid


def test_a_rigid_transform_rotates_and_then_translates():
    b_from_a = Rigid3(QUARTER_TURN, np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(b_from_a.apply([10.0, 0.0, 0.0]), [1.0, 12.0, 3.0])
    np.testing.assert_allclose(b_from_a.rotate([10.0, 0.0, 0.0]), [0.0, 10.0, 0.0])


def test_points_of_any_leading_shape_are_transformed():
    b_from_a = Rigid3(QUARTER_TURN, np.zeros(3))
    assert b_from_a.apply(np.ones((4, 5, 3))).shape == (4, 5, 3)


def test_the_inverse_places_the_origin_of_b_in_a():
    b_from_a = Rigid3(QUARTER_TURN, np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(b_from_a.inverse().translation, [-2.0, 1.0, -3.0])


def test_a_product_applies_the_right_factor_first():
    b_from_a = Rigid3(np.eye(3), np.array([1.0, 0.0, 0.0]))
    c_from_b = Rigid3(QUARTER_TURN, np.zeros(3))
    np.testing.assert_allclose((c_from_b @ b_from_a).apply([0.0, 0.0, 0.0]), [0.0, 1.0, 0.0])


@pytest.mark.parametrize(
    ("rotation", "translation", "message"),
    [
        (np.eye(2), np.zeros(3), r"needs a \(3, 3\) rotation"),
        (np.eye(3), np.zeros(2), r"a \(3,\) translation"),
        (np.eye(3) * np.nan, np.zeros(3), "NaN or infinity"),
        (np.eye(3), np.array([0.0, np.inf, 0.0]), "NaN or infinity"),
        (np.diag([1.0, 1.0, -1.0]), np.zeros(3), "Not a rotation matrix"),
        (np.eye(3) * 1.001, np.zeros(3), "Not a rotation matrix"),
    ],
)
def test_what_is_no_rigid_transform_is_refused(rotation, translation, message):
    with pytest.raises(InputError, match=message):
        Rigid3(rotation, translation)


# equirect


@pytest.mark.parametrize(
    ("pixel", "direction"),
    [
        ((400, 200), (0, 0, 1)),
        ((600, 200), (1, 0, 0)),
        ((200, 200), (-1, 0, 0)),
        ((0, 200), (0, 0, -1)),
        ((123, 0), (0, -1, 0)),
        ((123, 400), (0, 1, 0)),
        ((400, 100), (0, -np.sqrt(0.5), np.sqrt(0.5))),
    ],
)
def test_directions_of_the_main_pixels(pixel, direction):
    np.testing.assert_allclose(directions_from_pixels(pixel, 800, 400), direction, atol=1e-15)


def test_the_seam_is_pixel_zero_not_the_width():
    assert pixels_from_directions([-1e-20, 0.0, -1.0], 800, 400)[0] == 0.0
    assert pixels_from_directions([0.0, 0.0, -1.0], 800, 400)[0] == 0.0


def test_rays_need_no_unit_length():
    np.testing.assert_allclose(pixels_from_directions([7.0, 0.0, 7.0], 800, 400), [500.0, 200.0])


def test_roll_turns_about_the_view_that_pitch_has_raised():
    up_looking = world_from_pano_rotation(0.0, 90.0, 30.0)
    np.testing.assert_allclose(up_looking @ [0.0, 0.0, 1.0], [0.0, 0.0, 1.0], atol=1e-15)


# planes


def test_a_moved_plane_changes_its_offset_by_the_translation_along_its_normal():
    moved = Planes([[0.0, 1.0, 0.0]], [5.0]).transformed(Rigid3(QUARTER_TURN, [-7.0, 0.0, 0.0]))
    np.testing.assert_allclose(moved.normals, [[-1.0, 0.0, 0.0]], atol=1e-15)
    np.testing.assert_allclose(moved.offsets_m, [12.0])


def test_distances_along_rays_to_a_plane():
    rays = np.array([[0.0, 2.0, 0.0], [1.0, 1.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
    got = ray_plane_distances([0.0, 1.0, 0.0], rays, [0.0, 1.0, 0.0], 5.0)
    # 4 m away, in units of the ray's length; behind the start and parallel there is none.
    np.testing.assert_allclose(got, [2.0, 4.0, np.nan, np.nan])


def test_every_ray_may_have_its_own_plane():
    normals, offsets = np.eye(3), np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(
        ray_plane_distances(np.zeros(3), np.ones((3, 3)), normals, offsets), [1.0, 2.0, 3.0]
    )


@pytest.mark.parametrize(
    ("normals", "offsets", "message"),
    [
        ([[1.0, 0.0, 0.0]], [1.0, 2.0], "1 plane normals but 2 offsets"),
        ([[1.0, 0.0, 0.0]], [np.nan], "NaN or infinity"),
        ([[1.0, 1.0, 0.0]], [1.0], "unit length"),
    ],
)
def test_what_are_no_planes_is_refused(normals, offsets, message):
    with pytest.raises(InputError, match=message):
        Planes(normals, offsets)


def test_there_may_be_no_planes():
    assert len(Planes(np.zeros((0, 3)), np.zeros(0))) == 0


# facade grid


def test_pixels_of_a_facade_in_metres_and_in_the_world():
    grid = FacadeGrid(SOUTH_WALL, 300, 200, 0.02)
    assert (grid.width_m, grid.height_m) == (6.0, 4.0)
    np.testing.assert_allclose(grid.facade_from_pixels([[0, 200], [150, 50]]), [[0, 0], [3, 3]])
    np.testing.assert_allclose(grid.pixels_from_facade([3.0, 3.0]), [150.0, 50.0])
    np.testing.assert_allclose(grid.world_from_pixels([150.0, 50.0]), [13.0, 20.0, 6.0])
    np.testing.assert_allclose(grid.normal_in_world, [0.0, -1.0, 0.0])


def test_a_cropped_grid_keeps_every_pixel_where_it_was():
    grid = FacadeGrid(SOUTH_WALL, 300, 200, 0.02)
    part = grid.cropped(50, 20, 250, 180)
    assert (part.width_px, part.height_px) == (200, 160)
    np.testing.assert_allclose(part.world_from_facade.translation, [11.0, 20.0, 3.4])
    np.testing.assert_allclose(
        part.world_from_pixels([100.0, 30.0]), grid.world_from_pixels([150.0, 50.0])
    )


@pytest.mark.parametrize(
    ("width_m", "height_m", "size"), [(6.0, 4.0, (300, 200)), (6.001, 3.999, (301, 200))]
)
def test_a_covering_grid_is_the_smallest(width_m, height_m, size):
    grid = FacadeGrid.covering(SOUTH_WALL, width_m, height_m, 0.02)
    assert (grid.width_px, grid.height_px) == size


def test_grids_without_area_or_scale_are_refused():
    with pytest.raises(InputError, match="0 x 5 px is empty"):
        FacadeGrid(SOUTH_WALL, 0, 5, 0.02)
    with pytest.raises(InputError, match="must be positive, got nan"):
        FacadeGrid(SOUTH_WALL, 5, 5, np.nan)
    with pytest.raises(InputError, match=r"-1.0 x 2.0 m has no area"):
        FacadeGrid.covering(SOUTH_WALL, -1.0, 2.0, 0.02)


# enu

ORIGINS = [
    GeoOrigin(57.70887, 11.97456, 12.5),
    GeoOrigin(-33.85678, 151.21530, -3.0),
    GeoOrigin(0.0, -179.99999, 0.0),
    GeoOrigin(89.9, 45.0, 100.0),
]
AROUND_M = np.array([[0, 0, 0], [100, 0, 0], [0, 100, 0], [0, 0, 100], [-2000, 1500, 80]], float)


@pytest.mark.parametrize("origin", ORIGINS, ids=str)
def test_the_world_frame_is_projs_topocentric_frame(origin):
    """PROJ's chain geodetic -> geocentric -> topocentric, an independent implementation."""
    place = f"+lat_0={origin.lat_deg} +lon_0={origin.lon_deg} +h_0={origin.height_m}"
    topocentric = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
        "+step +proj=cart +ellps=WGS84 "
        f"+step +proj=topocentric +ellps=WGS84 {place}"
    )
    lat_lon_height = geodetic_from_world(AROUND_M, origin)
    lat, lon, height = lat_lon_height.T
    expected = np.stack(topocentric.transform(lon, lat, height), axis=-1)
    # 0.1 mm: the geocentric coordinates are 6e6 m and PROJ takes degrees as text.
    np.testing.assert_allclose(world_from_geodetic(lat_lon_height, origin), expected, atol=1e-4)
    np.testing.assert_allclose(expected, AROUND_M, atol=1e-4)


def test_a_degree_of_latitude_and_of_longitude_at_the_equator():
    origin = GeoOrigin(0.0, 0.0, 0.0)
    # Radii of curvature at the equator: a = 6378137 m, and a (1 - e2) = 6335439.3 m.
    step = 1e-3
    east = world_from_geodetic([0.0, step, 0.0], origin)
    north = world_from_geodetic([step, 0.0, 0.0], origin)
    assert east[0] == pytest.approx(6_378_137.0 * np.deg2rad(step), abs=1e-4)
    assert north[1] == pytest.approx(6_335_439.3 * np.deg2rad(step), abs=1e-4)


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ((91.0, 0.0, 0.0), "Latitude 91.0"),
        ((0.0, 181.0, 0.0), "longitude 181.0"),
        ((np.nan, 0.0, 0.0), "not on Earth"),
        ((0.0, 0.0, np.inf), "must be finite, got inf"),
    ],
)
def test_places_that_are_not_on_earth_are_refused(place, message):
    with pytest.raises(InputError, match=message):
        GeoOrigin(*place)
