"""What every renderer of the photo path hands on, its grid, and the coverage rule.

A pixel is shown as fact only where two photos saw it; a renderer may fill the rest, this rule
takes it away.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from si3fp.camera2d.facade_plane import FacadePlane
from si3fp.camera2d.visibility import BoolLattice, on_grid
from si3fp.errors import InputError
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.model import OrthoImage, Photo
from si3fp.ortho import view_distances


@dataclass(frozen=True, slots=True, eq=False)
class RenderedFacade:
    """An orthographic facade with what it rests on.

    Attributes
    ----------
    ortho
        Source ``radiance`` or ``mosaic``; ``valid`` where at least two photos saw;
        ``seen_by`` the number of photos; ``depth_m`` in front of the plane, towards the viewer,
        NaN where unknown, None from the mosaic.
    seen_from
        By photo id the places that the photo saw, (h, w) bool on the lattice of
        `si3fp.camera2d.visibility`.
    held_out_psnr_db
        How well a photo left out is predicted; None where none was.
    notes
        What a reader should know.
    """

    ortho: OrthoImage
    seen_from: Mapping[str, BoolLattice]
    held_out_psnr_db: float | None = None
    notes: tuple[str, ...] = ()


def facade_grid(plane: FacadePlane, photos: Sequence[Photo], m_per_px: float) -> FacadeGrid:
    """The grid of a facade: as fine as asked, or as the third best photo resolves it.

    Finer pixels would only be interpolated.
    """
    sizes = sorted(photo_m_per_px(photo, plane) for photo in photos)
    third = sizes[min(2, len(sizes) - 1)] if sizes else m_per_px
    if np.isfinite(third):
        # Whole millimetres keep grids of one building alike.
        m_per_px = max(m_per_px, round(third, 3))
    return FacadeGrid.covering(plane.world_from_facade, plane.width_m, plane.height_m, m_per_px)


def photo_m_per_px(photo: Photo, plane: FacadePlane) -> float:
    """Size in metres of a photo's pixel at the best seen tenth of the facade; inf if unseen."""
    coarse = FacadeGrid.covering(
        plane.world_from_facade, plane.width_m, plane.height_m, plane.height_m / 16
    )
    x, y = np.meshgrid(np.arange(coarse.width_px) + 0.5, np.arange(coarse.height_px) + 0.5)
    nodes = np.stack([x, y], axis=-1)
    distances_m, cosines = view_distances(photo, coarse, nodes)
    camera = photo.camera
    pixels = camera.project(photo.cam_from_world.apply(coarse.world_from_pixels(nodes)))
    with np.errstate(invalid="ignore"):
        inside = ((pixels >= 0) & (pixels <= [camera.width_px, camera.height_px])).all(axis=-1)
    focal_px = np.sqrt(camera.fx_px * camera.fy_px)
    usable = inside & (cosines > 0.1)
    sizes = np.where(usable, distances_m / focal_px / np.maximum(cosines, 0.1), np.inf)
    return float(np.quantile(sizes, 0.1, method="lower"))


def count_photos(seen_from: Mapping[str, BoolLattice], grid: FacadeGrid) -> NDArray[np.uint8]:
    """Number of photos (H, W) that saw each pixel of the grid."""
    total = np.zeros((grid.height_px, grid.width_px), np.uint16)
    for lattice in seen_from.values():
        total += on_grid(lattice, grid)
    return np.minimum(total, 255).astype(np.uint8)


def covered(ortho: OrthoImage, min_photos: int) -> OrthoImage:
    """The image without the pixels that fewer photos saw: black, not valid, depth NaN.

    Raises
    ------
    InputError
        If the image does not say how many photos saw its pixels.
    """
    if ortho.seen_by is None:
        raise InputError(f"The image {ortho.source} does not say how many photos saw its pixels.")
    valid = ortho.valid & (ortho.seen_by >= min_photos)
    depth_m = ortho.depth_m
    if depth_m is not None:
        depth_m = np.where(valid, depth_m, np.float32(np.nan))
    rgb = np.where(valid[..., None], ortho.rgb, np.uint8(0))
    return replace(ortho, rgb=rgb, valid=valid, depth_m=depth_m)
