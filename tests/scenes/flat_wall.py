"""A painted wall, pinhole photos of it, and what may stand before it; every colour is known."""

from __future__ import annotations

import numpy as np

from si3fp.camera2d.facade_plane import FacadePlane
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Photo, SparsePoints

WORLD_FROM_FACADE = Rigid3(
    np.array([[0.6, 0, 0.8], [0.8, 0, -0.6], [0, 1, 0]]), np.array([100.0, 50.0, 7.0])
)
WIDTH_M, HEIGHT_M = 12.0, 9.0
PLANE = FacadePlane("wall-0", None, None, WORLD_FROM_FACADE, WIDTH_M, HEIGHT_M)
NO_POINTS = SparsePoints(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0), ())


def wall_grid(m_per_px=0.05) -> FacadeGrid:
    return FacadeGrid.covering(WORLD_FROM_FACADE, WIDTH_M, HEIGHT_M, m_per_px)


def photo(x_m, y_m, z_m, *, at=(6.0, 4.5), roll_deg=0.0, focal_px=500.0, name="p") -> Photo:
    """A photo of 800 x 600 px taken from a place in the facade's frame towards a point on it."""
    camera = Pinhole(focal_px, 1.01 * focal_px, 405.0, 296.0, 800, 600)
    centre = np.array([x_m, y_m, z_m])
    forward = np.array([*at, 0.0]) - centre
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    level = np.stack([right, np.cross(forward, right), forward])
    roll = np.deg2rad(roll_deg)
    turn = np.array([[np.cos(roll), np.sin(roll), 0], [-np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
    cam_from_facade = Rigid3(turn @ level, -(turn @ level) @ centre)
    return Photo(name, camera, cam_from_facade @ WORLD_FROM_FACADE.inverse())


def smooth(x_m, y_m):
    """Three channels of waves of at least 2.5 m: linear interpolation errs below a grey level."""
    waves = [
        np.sin(2 * np.pi * x_m / 3.1) * np.cos(2 * np.pi * y_m / 4.3),
        np.cos(2 * np.pi * (x_m + 0.7 * y_m) / 2.9),
        np.sin(2 * np.pi * (x_m - y_m) / 5.3 + 1.0),
    ]
    return np.stack([128 + 90 * wave for wave in waves], axis=-1)


def picture(taken: Photo, paint=smooth, panels=()):
    """What it shows of the painted wall, and of white panels (x0, x1, y0, y1, z) before it."""
    camera = taken.camera
    pixels = np.meshgrid(np.arange(camera.width_px) + 0.5, np.arange(camera.height_px) + 0.5)
    facade_from_cam = (taken.cam_from_world @ WORLD_FROM_FACADE).inverse()
    rays = facade_from_cam.rotate(camera.unproject(np.stack(pixels, axis=-1)))
    centre = facade_from_cam.translation
    towards = rays[..., 2] < -1e-3

    def meeting(z_m):
        reach = (z_m - centre[2]) / np.where(towards, rays[..., 2], -1.0)
        return centre[:2] + reach[..., None] * rays[..., :2]

    wall = meeting(0.0)
    colours = np.where(towards[..., None], paint(wall[..., 0], wall[..., 1]), 0)
    for x0, x1, y0, y1, z in panels:
        x, y = np.moveaxis(meeting(z), -1, 0)
        hit = towards & (z < centre[2]) & (x > x0) & (x < x1) & (y > y0) & (y < y1)
        colours = np.where(hit[..., None], 250, colours)
    return (np.clip(colours, 0, 255) + 0.5).astype(np.uint8)


def painted(grid: FacadeGrid, paint=smooth):
    pixels = np.meshgrid(np.arange(grid.width_px) + 0.5, np.arange(grid.height_px) + 0.5)
    metres = grid.facade_from_pixels(np.stack(pixels, axis=-1))
    return paint(metres[..., 0], metres[..., 1])


def lattice_metres(lattice):
    rows, columns = lattice.shape
    x = (np.arange(columns) + 0.5) / columns * WIDTH_M
    y = HEIGHT_M - (np.arange(rows) + 0.5) / rows * HEIGHT_M
    return np.meshgrid(x, y)


def standing(x_m, z0_m, z1_m, height_m=HEIGHT_M) -> FacadePlane:
    """A wall at right angles to the facade, from z0 to z1 before it, seen from the right."""
    rotation = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    frame = WORLD_FROM_FACADE @ Rigid3(rotation, np.array([x_m, 0.0, z1_m]))
    return FacadePlane("wall-1", None, None, frame, z1_m - z0_m, height_m)


def points_at(places, seen_by) -> SparsePoints:
    places = np.asarray(places, float)
    return SparsePoints(
        WORLD_FROM_FACADE.apply(places),
        np.zeros((len(places), 3), np.uint8),
        np.full(len(places), 0.5),
        (tuple(seen_by),) * len(places),
    )
