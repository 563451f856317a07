"""C.3 without a radiance field: photos rectified onto the facade and blended.

Sharp where the facade is flat; what stands out of the plane or behind it appears displaced by its
parallax, as in the StreetView path, but less: at every place only the few photos vote that look at
it straight on. Poses from bundle adjustment are exact to a fraction of a pixel, so there is no
registration.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from si3fp.blend import blend
from si3fp.camera2d.choice import best_places
from si3fp.camera2d.facade_plane import FacadePlane
from si3fp.camera2d.rectify import rectify_photo
from si3fp.camera2d.render import RenderedFacade, count_photos, covered
from si3fp.camera2d.visibility import BoolLattice, on_grid, seen_from
from si3fp.config import MosaicConfig
from si3fp.errors import FacadeError
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import FacadeViews, LoadImage, OrthoImage, Photo, SparsePoints
from si3fp.ortho import view_weight


@dataclass(frozen=True, slots=True, eq=False)
class MosaicRendering:
    """A facade as photos show it: what M.1 reads.

    Attributes
    ----------
    views
        One rectified photo each, best first, valid where it is among the best of its place.
    fused
        Their robust blend. ``seen_by`` counts all photos; ``valid`` where at least two did and two
        are in the blend.
    cameras_in_facade
        Optical centre (3,) in the facade frame by view id.
    seen_from
        By photo id the places seen, of all photos that see any, see
        `si3fp.camera2d.visibility.seen_from`.
    """

    views: FacadeViews
    fused: OrthoImage
    cameras_in_facade: Mapping[str, FloatArray]
    seen_from: Mapping[str, BoolLattice]

    @property
    def rendered(self) -> RenderedFacade:
        """The blend as any renderer hands it on."""
        return RenderedFacade(self.fused, self.seen_from)


def render_mosaic(
    plane: FacadePlane,
    grid: FacadeGrid,
    photos: Sequence[Photo],
    load: LoadImage,
    occluders: Sequence[FacadePlane],
    points: SparsePoints,
    config: MosaicConfig,
    progress: Callable[[str, int, int], None] = lambda step, done, total: None,
) -> MosaicRendering:
    """The facade, blended from the photos that show it best; one photo is in memory at a time.

    Parameters
    ----------
    plane, grid
        The facade and its grid.
    photos
        Photos of any walls.
    load
        Pixels by photo id, free of lens distortion, of the camera's size.
    occluders
        All known walls.
    points
        Sparse points; what stands in front of the wall.
    config
        Constants.
    progress
        Told how many photos are done.

    Raises
    ------
    FacadeError
        If no photo shows the facade.
    """
    sights = seen_from(plane, grid, photos, occluders, points, config)
    places = best_places(photos, sights, grid, config)
    if not places:
        raise FacadeError(
            f"None of {len(photos)} photos shows {plane.facade_id}: it lies outside of them, "
            f"behind other walls, or is seen at more than {config.max_obliqueness_deg:g} degrees "
            "to its normal."
        )
    by_id = {photo.id: photo for photo in photos}
    views = []
    progress("mosaic", 0, len(places))
    for done, (name, best) in enumerate(places.items(), start=1):
        view = rectify_photo(by_id[name], load(name), grid, config)
        views.append(replace(view, valid=view.valid & on_grid(best, grid)))
        progress("mosaic", done, len(places))
    facade_from_world = grid.world_from_facade.inverse()
    return MosaicRendering(
        FacadeViews(plane.facade_id, grid, tuple(views)),
        _blended(views, [by_id[name] for name in places], sights, grid, config),
        {name: facade_from_world.apply(by_id[name].centre_in_world) for name in places},
        {name: sight for name, sight in sights.items() if sight.any()},
    )


def _blended(
    views: Sequence[OrthoImage],
    photos: Sequence[Photo],
    sights: Mapping[str, BoolLattice],
    grid: FacadeGrid,
    config: MosaicConfig,
) -> OrthoImage:
    weights = [view_weight(p, grid) * np.float32(p.camera.fx_px * p.camera.fy_px) for p in photos]
    fused = blend(views, weights)
    used = np.sum([view.valid for view in views], axis=0)
    fused = replace(
        fused,
        source="mosaic",
        valid=used >= config.min_photos,
        seen_by=count_photos(sights, grid),
    )
    return covered(fused, config.min_photos)
