"""Algorithm 1 against a bare remap: ``python benchmarks/speed/rectify.py``.

`si3fp.ortho.rectify` for one facade and one panorama, and one `cv2.remap` of the same panorama to
the same size with float32 maps that are ready; the two alternate, so that both see the same load.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.config import OrthoConfig
from si3fp.geometry.equirect import pixels_from_directions, world_from_pano_rotation
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Panorama
from si3fp.ortho import rectify

SOUTH_WALL = Rigid3(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), np.zeros(3))


def textured(width_px: int) -> NDArray[np.uint8]:
    """A textured 2:1 panorama with a black nadir."""
    tile = np.random.default_rng(0).integers(0, 256, (512, 512, 3), dtype=np.uint8)
    tile = cv2.GaussianBlur(tile, (0, 0), 1.0)
    image = np.tile(tile, (width_px // 1024, width_px // 512, 1))
    image[-image.shape[0] // 8 :] = 0
    return image


def exact_maps(
    panorama: Panorama, grid: FacadeGrid, width_px: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """float32 maps of cv2.remap at every pixel of the grid."""
    xy = np.stack(
        np.meshgrid(np.arange(grid.width_px) + 0.5, np.arange(grid.height_px) + 0.5), axis=-1
    )
    rays = panorama.pano_from_world.apply(grid.world_from_pixels(xy))
    source = pixels_from_directions(rays, width_px, width_px // 2).astype(np.float32) - 0.5
    return np.ascontiguousarray(source[..., 0]), np.ascontiguousarray(source[..., 1])


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--width-px", type=int, default=8192, help="a multiple of 1024")
    parser.add_argument("--runs", type=int, default=31)
    arguments = parser.parse_args()
    image = textured(arguments.width_px)
    all_seen = np.ones(image.shape[:2], bool)
    grid = FacadeGrid.covering(SOUTH_WALL, 30.0, 15.0, 0.02)
    config = OrthoConfig()
    print(
        f"{arguments.width_px} x {arguments.width_px // 2} px -> "
        f"{grid.width_px} x {grid.height_px} px, medians of {arguments.runs} alternating runs"
    )
    for distance_m in (4.0, 8.0, 16.0, 32.0):
        place = SOUTH_WALL.apply([13.0, 2.5, distance_m])
        rotation = world_from_pano_rotation(20.0, 2.0, -1.0)
        panorama = Panorama("pano", "", Rigid3(rotation, place).inverse())
        # What a carriageway does: something unseen in the middle of the wall.
        with_hole = all_seen.copy()
        x, y = pixels_from_directions(
            panorama.pano_from_world.apply(grid.world_from_pixels([700.0, 600.0])),
            arguments.width_px,
            arguments.width_px // 2,
        ).astype(int)
        with_hole[y : y + 100, x : x + 100] = False
        maps = exact_maps(panorama, grid, arguments.width_px)
        target = np.empty((grid.height_px, grid.width_px, 3), np.uint8)
        works = {
            "remap": lambda maps=maps, target=target: cv2.remap(
                image, *maps, cv2.INTER_LINEAR, dst=target
            ),
            "rectify": lambda panorama=panorama: rectify(panorama, image, all_seen, grid, config),
            "hole": lambda panorama=panorama, with_hole=with_hole: rectify(
                panorama, image, with_hole, grid, config
            ),
        }
        times: dict[str, list[float]] = {name: [] for name in works}
        for _ in range(arguments.runs):
            for name, work in works.items():
                times[name].append(seconds(work))
        bare, ours, hole = (float(np.median(times[name])) * 1e3 for name in works)
        print(
            f"{distance_m:4.0f} m: bare remap {bare:5.1f} ms, rectify {ours:5.1f} ms "
            f"(ratio {ours / bare:.2f}), partly unseen {hole:5.1f} ms (ratio {hole / bare:.2f})"
        )


if __name__ == "__main__":
    main()
