"""Algorithm 5: a facade rendered orthographically from a radiance field of its photos (C.3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import cv2
import numpy as np

from si3fp.camera2d.choice import choose_photos
from si3fp.camera2d.facade_plane import FacadePlane
from si3fp.camera2d.radiance import RadianceField
from si3fp.camera2d.render import RenderedFacade, count_photos, covered
from si3fp.camera2d.visibility import BoolLattice, seen_from
from si3fp.config import MosaicConfig, RadianceConfig
from si3fp.errors import FacadeError
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.model import LoadImage, OrthoImage, Photo, SparsePoints

COVERAGE_PX = 2
"""Cell of the coverage in pixels: the strip that a sill hides is 0.1 m high on a first floor."""
_NO_POINTS = SparsePoints(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0), ())


def render_radiance(
    plane: FacadePlane,
    grid: FacadeGrid,
    photos: Sequence[Photo],
    load: LoadImage,
    occluders: Sequence[FacadePlane],
    points: SparsePoints,
    mosaic: MosaicConfig,
    radiance: RadianceConfig,
    rng: np.random.Generator,
    progress: Callable[[str, int, int], None] = lambda step, done, total: None,
) -> RenderedFacade:
    """The facade as a camera at infinity would see it, trees and cars in front of it cut away.

    Parameters
    ----------
    plane, grid
        The facade and its grid.
    photos
        Photos of any walls; those that show the facade are used.
    load
        Pixels by photo id, free of lens distortion, of the camera's size.
    occluders
        All known walls.
    points
        Sparse points.
    mosaic
        How photos are chosen, and how many must have seen a pixel.
    radiance
        The field.
    rng
        Source of randomness.
    progress
        Told the samples done.

    Raises
    ------
    FacadeError
        If too few photos show the facade.
    KeyboardInterrupt
        If the fit was interrupted: a field cut short must not pass for a finished one.

    Notes
    -----
    Rays start in front of the balconies and look at the wall (`RadianceField.render_ortho`). A
    photo saw a place where neither the field nor another wall hides it.
    """
    sights = seen_from(plane, grid, photos, occluders, _NO_POINTS, mosaic)
    chosen = choose_photos(photos, sights, grid, replace(mosaic, max_views=radiance.max_photos))
    if len(chosen) < mosaic.min_photos:
        raise FacadeError(
            f"{len(chosen)} of {len(photos)} photos show {plane.facade_id}, {mosaic.min_photos} "
            "are needed. Take photos of it from several places."
        )
    field = RadianceField.fit(
        chosen,
        load,
        grid.world_from_facade,
        grid.width_m,
        grid.height_m,
        points.points_in_world,
        replace(radiance, m_per_px=grid.m_per_px),
        rng,
        progress,
    )
    if field.report.stopped == "interrupted":
        raise KeyboardInterrupt
    seen = field.render_ortho(grid, radiance.slab_front_m, radiance.slab_behind_m)
    lattices = {
        name: lattice & _resized(sights[name], lattice.shape)
        for name, lattice in field.coverage(
            chosen, grid, seen.depth_m, COVERAGE_PX * grid.m_per_px
        ).items()
    }
    ortho = OrthoImage(
        "radiance",
        seen.rgb,
        np.isfinite(seen.depth_m),
        seen.depth_m,
        count_photos(lattices, grid),
    )
    report = field.report
    notes = [
        f"radiance field: {len(report.photos)} photos, {report.samples / 1e6:.1f} million samples, "
        f"stopped by {report.stopped}"
    ]
    psnr_db = report.held_out_psnr_db
    if psnr_db is not None and not np.isfinite(psnr_db):  # no ray of that photo meets the field
        psnr_db = None
    return RenderedFacade(covered(ortho, mosaic.min_photos), lattices, psnr_db, tuple(notes))


def _resized(lattice: BoolLattice, shape: tuple[int, ...]) -> BoolLattice:
    full = cv2.resize(lattice.view(np.uint8), shape[::-1], interpolation=cv2.INTER_NEAREST)
    return np.asarray(full, np.uint8) > 0
