"""How a view moves on its wall where its pose, or the wall's plane, is not where it was believed.

A motion has the eight parameters of `si3fp.streetview.motion`: shift, linear and perspective part,
in metres from the middle of the grid, x right and y down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from si3fp.config import AlignConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Panorama
from si3fp.streetview.motion import motion_basis, moved

POSE = 6
"""Errors of a pose: place in metres, then turn in radians, both about the camera's axes."""
PLANE = 2
"""Errors of a plane: outwards in metres, then its turn about the vertical in radians."""
FLOOR = np.array([0.01] * 2 + [0.001] * 4 + [0.00005] * 2)
"""Standard deviations (8,) of what neither a pose nor a plane explains."""
DOWN = np.array([1.0, -1.0])
"""Facade y runs up; motions are in metres to the right and down, like pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseMotion:
    """The motion of one view on one grid as a function of errors of its pose and of the plane.

    Attributes
    ----------
    world_from_pano, facade_from_world, normal_in_world, through_in_world, along_in_world
        Pose and plane as they are believed; the plane through the middle of the grid.
    middle_m
        (2,) of the grid in the facade's frame.
    rays_in_pano
        (K, 3) to points spread over the grid.
    points_m
        (K, 2) those points, from the middle of the grid.
    fit
        (8, 2 K) parameters of a motion from the shifts of the points, x and y in turn.
    """

    world_from_pano: Rigid3
    facade_from_world: Rigid3
    normal_in_world: FloatArray
    through_in_world: FloatArray
    along_in_world: FloatArray
    middle_m: FloatArray
    rays_in_pano: FloatArray
    points_m: FloatArray
    fit: FloatArray

    @classmethod
    def of(cls, panorama: Panorama, grid: FacadeGrid) -> PoseMotion:
        """Of a panorama on a grid; what it sees at a steep angle counts most, as in matches."""
        columns = (np.arange(7) + 0.5) / 7 * grid.width_px
        rows = (np.arange(5) + 0.5) / 5 * grid.height_px
        pixels = np.stack(np.meshgrid(columns, rows, indexing="xy"), axis=-1).reshape(-1, 2)
        world = grid.world_from_pixels(pixels)
        middle_m = np.array([grid.width_m / 2, grid.height_m / 2])
        points_m = (grid.facade_from_pixels(pixels) - middle_m) * DOWN
        rays = panorama.pano_from_world.apply(world)
        distance_m = np.linalg.norm(rays, axis=1)
        steep = np.abs((world - panorama.centre_in_world) @ grid.normal_in_world) / distance_m
        weight = np.repeat(np.maximum(steep, 0.05) ** 2 / distance_m, 2)
        basis = motion_basis(points_m, "homography").reshape(-1, 8)
        fit = np.linalg.pinv(basis * weight[:, None]) * weight
        frame = grid.world_from_facade
        return cls(
            panorama.pano_from_world.inverse(),
            frame.inverse(),
            grid.normal_in_world,
            frame.apply([*middle_m, 0.0]),
            frame.rotation[:, 0],
            middle_m,
            rays,
            points_m,
            fit,
        )

    def __call__(self, errors: FloatArray) -> FloatArray:
        """Motion (8,) that takes the view to where its pixels truly lie on the wall.

        Parameters
        ----------
        errors
            (8,) those of the pose, then those of the plane: the truth less what is believed.
        """
        place, turn, (outwards_m, plane_turn) = errors[:3], errors[3:POSE], errors[POSE:]
        start = self.world_from_pano.apply(place)
        lines = self.world_from_pano.rotate(self.rays_in_pano + np.cross(turn, self.rays_in_pano))
        through = self.through_in_world + outwards_m * self.normal_in_world
        turned = self.normal_in_world + plane_turn * self.along_in_world
        reach = ((through - start) @ turned) / (lines @ turned)
        seen = self.facade_from_world.apply(start + reach[:, None] * lines)[:, :2]
        return self._fitted((seen - self.middle_m) * DOWN)

    def slopes(self, errors: FloatArray, steps: FloatArray) -> FloatArray:
        """(8, 8) change of the motion by a step (8,) of each error, one row per error."""
        here = self(errors)
        return np.array([self(errors + step) - here for step in np.diag(steps)])

    def parameters(self, matrix: FloatArray) -> FloatArray:
        """Parameters (8,) of a homography (3, 3), fitted as those of the errors are."""
        return self._fitted(moved(self.points_m, matrix))

    def _fitted(self, points_m: FloatArray) -> FloatArray:
        motion: FloatArray = self.fit @ (points_m - self.points_m).reshape(-1)
        return motion


def pose_sigmas(config: AlignConfig) -> FloatArray:
    """Standard deviations (6,) of a pose's errors in metres and radians."""
    turn = float(np.deg2rad(config.direction_sigma_deg))
    return np.array([config.position_sigma_m] * 3 + [turn] * 3)


def motion_covariance(panorama: Panorama, grid: FacadeGrid, config: AlignConfig) -> FloatArray:
    """Covariance (8, 8) of a view's motion on the wall that its pose error explains.

    An oblique view is uncertain in scale, a distant one in shift.
    """
    steps = np.concatenate([pose_sigmas(config), np.ones(PLANE)])
    root = PoseMotion.of(panorama, grid).slopes(np.zeros(POSE + PLANE), steps)[:POSE]
    covariance: FloatArray = root.T @ root + np.diag(FLOOR**2)
    return covariance
