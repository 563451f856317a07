"""Images with their poses, and what is seen in them: panoramas, photos, orthographic views."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from si3fp.errors import InputError
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.planes import Planes
from si3fp.geometry.rigid import FloatArray, Rigid3

Image = NDArray[np.uint8]
LoadImage = Callable[[str], Image]
"""Reads the RGB image (H, W, 3) of a source id; source pixels are never stored in the types."""


def require(condition: bool, message: str) -> None:
    """Raise `InputError` with the message unless the condition holds."""
    if not condition:
        raise InputError(message)


@dataclass(frozen=True, slots=True, eq=False)
class Panorama:
    """An equirectangular image with its pose and, where known, the planes that it sees.

    Attributes
    ----------
    id
        Identifier of the image.
    captured
        Capture date, ``YYYY-MM`` or ISO; empty where unknown.
    pano_from_world
        Pose; frame ``pano`` is x right, y down, z forward.
    planes_in_pano
        Planes, normals pointing from the camera into the wall; None without a plane map.
    plane_index
        (h, w) int32 index into the planes in image order, -1 = none; None without a plane map.
    links
        Ids of neighbouring panoramas.
    """

    id: str
    captured: str
    pano_from_world: Rigid3
    planes_in_pano: Planes | None = None
    plane_index: NDArray[np.int32] | None = None
    links: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require(bool(self.id), "A panorama needs an id.")
        require(
            (self.planes_in_pano is None) == (self.plane_index is None),
            f"Panorama {self.id}: planes and plane index come together or not at all.",
        )
        if self.plane_index is not None and self.planes_in_pano is not None:
            require(self.plane_index.ndim == 2, f"Panorama {self.id}: the plane index is 2-D.")
            top = int(self.plane_index.max(initial=-1))
            require(
                top < len(self.planes_in_pano),
                f"Panorama {self.id}: plane index {top} but {len(self.planes_in_pano)} planes.",
            )

    @property
    def centre_in_world(self) -> FloatArray:
        """Optical centre (3,) in metres."""
        return self.pano_from_world.inverse().translation


@dataclass(frozen=True, slots=True, eq=False)
class Photo:
    """A photo with its pose.

    Attributes
    ----------
    id
        Name of the image.
    camera
        Its camera; the pixels of the photo are free of lens distortion.
    cam_from_world
        Pose; frame ``cam`` is x right, y down, z forward. Before the scale is known the world is
        the frame of the reconstruction, in its units.
    """

    id: str
    camera: Pinhole
    cam_from_world: Rigid3

    def __post_init__(self) -> None:
        require(bool(self.id), "A photo needs an id.")

    @property
    def centre_in_world(self) -> FloatArray:
        """Optical centre (3,)."""
        return self.cam_from_world.inverse().translation


@dataclass(frozen=True, slots=True)
class KnownDistance:
    """A distance measured on site between two points, which gives a reconstruction its scale.

    Attributes
    ----------
    start, end
        Names of the points: ids of the photos taken from there, or of marked points.
    distance_m
        Length measured.
    """

    start: str
    end: str
    distance_m: float

    def __post_init__(self) -> None:
        require(
            bool(self.start) and bool(self.end) and self.start != self.end,
            f"A known distance runs between two different points, got {self.start!r} and "
            f"{self.end!r}.",
        )
        require(
            bool(np.isfinite(self.distance_m)) and self.distance_m > 0,
            f"The distance from {self.start} to {self.end} is {self.distance_m} m; "
            "give the length measured, a positive number of metres.",
        )

    def __str__(self) -> str:
        return f"{self.start} - {self.end} ({self.distance_m:g} m)"


@dataclass(frozen=True, slots=True, eq=False)
class OrthoImage:
    """One source image on a facade grid.

    Attributes
    ----------
    source
        Id of the source image; ``fused`` for a blend.
    rgb
        (H, W, 3) uint8.
    valid
        (H, W) bool, False where the source did not see.
    depth_m
        (H, W) metres in front of the facade plane, towards the viewer, or None.
    seen_by
        (H, W) uint8 number of source images, or None.
    """

    source: str
    rgb: Image
    valid: NDArray[np.bool_]
    depth_m: NDArray[np.float32] | None = None
    seen_by: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        require(
            self.rgb.ndim == 3 and self.rgb.shape[2] == 3 and self.rgb.dtype == np.uint8,
            f"Orthographic image {self.source}: rgb must be (H, W, 3) uint8, got {self.rgb.shape}.",
        )
        for name in ("valid", "depth_m", "seen_by"):
            layer = getattr(self, name)
            require(
                layer is None or layer.shape == self.rgb.shape[:2],
                f"Orthographic image {self.source}: {name} and rgb differ in size.",
            )


@dataclass(frozen=True, slots=True, eq=False)
class FacadeViews:
    """What both paths hand to the merged steps: one facade, one grid, 1 or N views on it.

    Attributes
    ----------
    facade_id
        ``<building id>-<footprint edge index>``, without footprint ``wall-<n>``.
    grid
        The common grid.
    views
        Orthographic images of the grid's size.
    """

    facade_id: str
    grid: FacadeGrid
    views: tuple[OrthoImage, ...]

    def __post_init__(self) -> None:
        size = (self.grid.height_px, self.grid.width_px)
        for view in self.views:
            require(
                view.valid.shape == size,
                f"Facade {self.facade_id}: view {view.source} is {view.valid.shape}, "
                f"the grid {size}.",
            )


@dataclass(frozen=True, slots=True, eq=False)
class SparsePoints:
    """The points of a reconstruction.

    Attributes
    ----------
    points_in_world
        (P, 3) in the frame of the poses.
    rgb
        (P, 3) uint8.
    error_px
        (P,) mean reprojection error, -1 where unknown.
    photo_ids
        For each point the photos that saw it.
    """

    points_in_world: FloatArray
    rgb: NDArray[np.uint8]
    error_px: FloatArray
    photo_ids: tuple[tuple[str, ...], ...]

    def __len__(self) -> int:
        return len(self.error_px)
