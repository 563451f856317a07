"""Planes moved between frames stay the same planes."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from si3fp.geometry.equirect import world_from_pano_rotation
from si3fp.geometry.planes import Planes, ray_plane_distances
from si3fp.geometry.rigid import Rigid3

angles_deg = st.floats(-180, 180)
metres = st.floats(-1000, 1000)


@st.composite
def poses(draw) -> Rigid3:
    rotation = world_from_pano_rotation(draw(angles_deg), draw(angles_deg), draw(angles_deg))
    return Rigid3(rotation, [draw(metres), draw(metres), draw(metres)])


@st.composite
def planes(draw) -> Planes:
    yaw, pitch = np.deg2rad([draw(angles_deg), draw(st.floats(-89, 89))])
    normal = [np.cos(pitch) * np.sin(yaw), -np.sin(pitch), np.cos(pitch) * np.cos(yaw)]
    return Planes([normal], [draw(metres)])


@given(planes(), poses())
def test_moving_there_and_back_gives_the_same_plane(plane, b_from_a):
    back = plane.transformed(b_from_a).transformed(b_from_a.inverse())
    np.testing.assert_allclose(back.normals, plane.normals, atol=1e-12)
    np.testing.assert_allclose(back.offsets_m, plane.offsets_m, atol=1e-9)


@given(planes(), poses(), metres, metres)
def test_points_of_a_plane_lie_on_the_moved_plane(plane, b_from_a, u, v):
    normal = plane.normals[0]
    across = np.linalg.svd(normal[None])[2][1:]
    point = plane.offsets_m[0] * normal + u * across[0] + v * across[1]
    moved = plane.transformed(b_from_a)
    gap = float(moved.normals[0] @ b_from_a.apply(point) - moved.offsets_m[0])
    assert abs(gap) < 1e-8  # metres, at kilometres from the origin


@given(planes(), poses(), poses())
def test_two_moves_are_their_product(plane, b_from_a, c_from_b):
    twice = plane.transformed(b_from_a).transformed(c_from_b)
    once = plane.transformed(c_from_b @ b_from_a)
    np.testing.assert_allclose(once.normals, twice.normals, atol=1e-12)
    np.testing.assert_allclose(once.offsets_m, twice.offsets_m, atol=1e-8)


@given(planes(), poses(), angles_deg, st.floats(-89, 89))
def test_a_ray_meets_a_plane_at_the_same_distance_in_every_frame(plane, b_from_a, yaw, pitch):
    yaw, pitch = np.deg2rad([yaw, pitch])
    ray = np.array([np.cos(pitch) * np.sin(yaw), -np.sin(pitch), np.cos(pitch) * np.cos(yaw)])
    if abs(float(plane.normals[0] @ ray)) < 1e-3 or abs(plane.offsets_m[0]) < 1e-3:
        return  # parallel, or through the camera
    here = ray_plane_distances(np.zeros(3), ray, plane.normals[0], plane.offsets_m[0])
    moved = plane.transformed(b_from_a)
    there = ray_plane_distances(
        b_from_a.translation, b_from_a.rotate(ray), moved.normals[0], moved.offsets_m[0]
    )
    np.testing.assert_allclose(there, here, rtol=1e-6, atol=1e-5)
