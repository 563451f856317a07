"""Time of step S.3 for one facade: ``python benchmarks/speed/align.py``.

Twelve views of a painted facade of 30 x 15 m with pose errors of decimetres, as street panoramas
give them, are registered on one grid at 0.02 m per pixel. CPU time above wall time is the second
core; wall time above CPU time is waiting for other programs.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.config import AlignConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import FacadeViews, OrthoImage, Panorama
from si3fp.streetview.align import register, registered
from si3fp.streetview.pose_motion import motion_covariance

SOUTH_WALL = Rigid3(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), np.zeros(3))
GRID = FacadeGrid.covering(SOUTH_WALL, 30.0, 15.0, 0.02)
ERROR_PX = 10.0
"""Shift of a view, standard deviation per axis: 0.2 m."""


def painted_facade(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Plaster with stains and 4 x 10 windows."""
    shape = (GRID.height_px, GRID.width_px)
    picture = np.full(shape, 160.0, np.float32)
    for sigma in (1.5, 5.0, 15.0):
        noise = cv2.GaussianBlur(rng.normal(size=shape).astype(np.float32), (0, 0), sigma)
        picture += 12 * noise / noise.std()
    for left in range(50, shape[1] - 70, 145):
        for top in range(60, shape[0] - 90, 170):
            picture[top : top + 90, left : left + 60] = 225
            picture[top + 6 : top + 84, left + 6 : left + 27] = 40 + 50 * rng.random()
            picture[top + 6 : top + 84, left + 33 : left + 54] = 40 + 50 * rng.random()
    picture = cv2.GaussianBlur(picture, (0, 0), 1.0)
    return np.clip(np.stack([picture, 0.95 * picture, 0.85 * picture], -1), 0, 255).astype(np.uint8)


def moved_views(count: int, rng: np.random.Generator) -> tuple[list[OrthoImage], list[Panorama]]:
    """Views with noise and small similarities, and the cameras along the street."""
    facade = painted_facade(rng)
    size = (GRID.width_px, GRID.height_px)
    views, panoramas = [], []
    for index in range(count):
        shift, (scale, turn) = rng.normal(scale=ERROR_PX, size=2), rng.normal(scale=0.005, size=2)
        matrix = np.array([[1 + scale, -turn, shift[0]], [turn, 1 + scale, shift[1]]])
        rgb = cv2.warpAffine(facade, matrix, size, borderMode=cv2.BORDER_REFLECT)
        noisy = np.clip(rgb + rng.normal(scale=4.0, size=rgb.shape), 0, 255).astype(np.uint8)
        place = SOUTH_WALL.apply([30.0 * index / max(count - 1, 1), 2.5, 9.0])
        pose = Rigid3(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), place).inverse()
        panoramas.append(Panorama(f"view-{index}", "", pose))
        views.append(OrthoImage(f"view-{index}", noisy, np.ones(rgb.shape[:2], np.bool_)))
    return views, panoramas


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=12)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--profile", action="store_true", help="print where the time goes")
    arguments = parser.parse_args()
    views, panoramas = moved_views(arguments.views, np.random.default_rng(0))
    config = AlignConfig()
    covariances = [motion_covariance(panorama, GRID, config) for panorama in panoramas]
    facade = FacadeViews("house-0", GRID, tuple(views))
    times: list[tuple[float, float, float]] = []
    profile = cProfile.Profile()
    for _ in range(arguments.runs):
        wall, cpu = time.perf_counter(), time.process_time()
        if arguments.profile:
            profile.enable()
        registrations = register(facade, [1.0] * len(views), covariances, config)
        profile.disable()
        found = time.perf_counter() - wall, time.process_time() - cpu
        wall = time.perf_counter()
        for view, registration in zip(views, registrations, strict=True):
            registered(view, registration, GRID)
        times.append((*found, time.perf_counter() - wall))
    wall_s, cpu_s, warp_s = np.median(times, axis=0)
    after = [r.residual_after_px for r in registrations if r.residual_after_px is not None]
    print(
        f"{len(views)} views of {GRID.width_px} x {GRID.height_px} px, medians of "
        f"{arguments.runs} runs: register {wall_s:.2f} s wall, {cpu_s:.2f} s CPU; moving the "
        f"views {warp_s:.2f} s\n{sum(r.used for r in registrations)} used, "
        f"{registrations[0].model}, {sum(r.inliers for r in registrations)} inliers, median "
        f"residual {np.median(after):.2f} px"
    )
    if arguments.profile:
        pstats.Stats(profile).sort_stats("tottime").print_stats(14)


if __name__ == "__main__":
    main()
