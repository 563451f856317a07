"""The coloured point cloud of the plane maps (paper, step S.2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from si3fp.config import ClusterConfig
from si3fp.errors import InputError
from si3fp.geometry.equirect import directions_from_pixels
from si3fp.geometry.planes import ray_plane_distances
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Image, Panorama

NOT_SEEN = 8
"""Near-black pixels are taken as not seen; a few points of dark glass go with them."""


def cloud_stride(panoramas: Sequence[Panorama], config: ClusterConfig) -> int:
    """The smallest stride at which all panoramas together keep to `config.cloud_points`."""
    pixels = sum(int((p.plane_index >= 0).sum()) for p in panoramas if p.plane_index is not None)
    return max(1, int(np.ceil(np.sqrt(pixels / config.cloud_points))))


def coloured_points(
    panorama: Panorama, image: Image, stride: int = 1, max_distance_m: float = 60.0
) -> tuple[FloatArray, NDArray[np.uint8]]:
    """World points (N, 3) in metres and their colours (N, 3) uint8 of one panorama.

    Every stride-th pixel of the plane map becomes a ray, the ray meets its plane, and the point
    takes the colour of the image there. Pixels without a plane, farther than `max_distance_m` or
    near-black are left out.

    Raises
    ------
    InputError
        If the image is not (H, W, 3) uint8.
    """
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
        raise InputError(
            f"Panorama {panorama.id}: colours need an RGB image (H, W, 3) uint8, "
            f"got {image.shape} {image.dtype}."
        )
    if panorama.plane_index is None or panorama.planes_in_pano is None:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.uint8)
    height_px, width_px = panorama.plane_index.shape
    rows, columns = np.nonzero(panorama.plane_index[::stride, ::stride] >= 0)
    rows, columns = rows * stride, columns * stride
    index = panorama.plane_index[rows, columns]
    rays = directions_from_pixels(
        np.stack([columns + 0.5, rows + 0.5], axis=-1), width_px, height_px
    )
    planes = panorama.planes_in_pano
    distance = ray_plane_distances(
        np.zeros(3), rays, planes.normals[index], planes.offsets_m[index]
    )
    colours: NDArray[np.uint8] = image[
        ((rows + 0.5) * image.shape[0] / height_px).astype(np.int_),
        ((columns + 0.5) * image.shape[1] / width_px).astype(np.int_),
    ]
    keep = np.nan_to_num(distance, nan=np.inf) <= max_distance_m
    keep &= colours.max(axis=1, initial=0) > NOT_SEEN
    points = panorama.pano_from_world.inverse().apply(rays[keep] * distance[keep, None])
    return points, colours[keep]


def ply_bytes(points: FloatArray, colours: NDArray[np.uint8]) -> bytes:
    """A binary little-endian PLY file of points (N, 3), stored as float32, and colours (N, 3)."""
    if points.shape != colours.shape or points.ndim != 2 or points.shape[1] != 3:
        raise InputError(
            f"A point cloud needs as many colours as points, both (N, 3), "
            f"got {points.shape} and {colours.shape}."
        )
    layout = [(name, "<f4") for name in "xyz"] + [(name, "u1") for name in ("red", "green", "blue")]
    vertices = np.empty(len(points), dtype=layout)
    for column, (name, _) in enumerate(layout):
        vertices[name] = points[:, column] if column < 3 else colours[:, column - 3]
    kinds = {"<f4": "float", "u1": "uchar"}
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(points)}",
        *(f"property {kinds[kind]} {name}" for name, kind in layout),
        "end_header\n",
    ]
    return "\n".join(header).encode("ascii") + vertices.tobytes()
