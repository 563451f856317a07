"""M.1: loggias, whose doors and windows stand in a wall of their own behind the facade.

On the wall plane every view shows that back wall at another place, so that the blend smears it and
all that is measured there is shifted. Where its depth is known, the views are blended on it
instead (docs/decisions/0019-what-slabs-hide.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from si3fp.blend import blend, exposure_gains
from si3fp.config import MeasureConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections, OrthoImage
from si3fp.windows.agreement import agreement, prepared_view, views_of
from si3fp.windows.balcony_columns import BalconyColumn
from si3fp.windows.depth import part_of
from si3fp.windows.parallax import seen_from, widest_views
from si3fp.windows.seen import ONE_OF_MANY
from si3fp.windows.sharpen import view_behind, weight_within

FLUSH_M = 0.3
"""Fronts of loggias stand out of the wall by no more, as balconies tell it."""
DEPTHS_M = np.arange(0.0, 2.41, 0.1)
"""How far back walls may lie behind the facade."""
LEAST_DEPTH_M = 0.6
"""Loggias are at least so deep: one can stand in them."""
LEAST_RISE = 0.5
"""Agreement at the depth of the back wall rises above its low tenth by this share of itself, or
of what the low tenth leaves to full agreement: rails and slabs agree somewhat at every depth."""
JAMB_M = 0.1
"""Left out inside the border of a loggia's opening."""
NEAR_M = 0.5
"""A front so near to a slab's edge stands on it."""


@dataclass(frozen=True, slots=True, eq=False)
class Loggias:
    """The openings in front of loggias that lie one depth behind the wall.

    Attributes
    ----------
    openings_px
        (N, 4) x0 y0 x1 y1 from the front's rail to the slab above.
    depth_m
        Depth of their back walls behind the facade plane.
    """

    openings_px: FloatArray
    depth_m: float

    def holds(self, boxes_px: FloatArray) -> NDArray[np.bool_]:
        """(N,) whether the centres of boxes (N, 4) lie in an opening of a loggia."""
        middle = (boxes_px[:, None, :2] + boxes_px[:, None, 2:]) / 2
        inside = (middle > self.openings_px[:, :2]) & (middle < self.openings_px[:, 2:])
        return np.asarray(np.any(np.all(inside, axis=2), axis=1))


NO_LOGGIAS = Loggias(np.zeros((0, 4)), 0.0)


def find_loggias(
    fronts: Detections,
    columns: Sequence[BalconyColumn],
    views: Sequence[OrthoImage],
    cameras_in_facade: Mapping[str, FloatArray],
    grid: FacadeGrid,
    config: MeasureConfig,
) -> Loggias:
    """Loggias above solid fronts in the plane of the wall, if the views agree on a wall behind.

    Parameters
    ----------
    fronts
        Solid fronts of balconies.
    columns
        Columns of balconies; those that stand out have no loggias.
    views, cameras_in_facade
        Registered views; optical centres (3,) in the facade frame by view id.
    grid
        Grid of the views.
    config
        How views are compared: fields ``recess_*``.
    """
    openings = [
        opening
        for column in columns
        if column.ahead_m <= FLUSH_M
        for opening in _openings(fronts.boxes_px, column, grid)
    ]
    loggias = Loggias(np.array(openings).reshape(-1, 4), 0.0)
    depth_m = _depth(loggias.openings_px, views, cameras_in_facade, grid.m_per_px, config)
    return NO_LOGGIAS if depth_m is None else replace(loggias, depth_m=depth_m)


def _openings(fronts_px: FloatArray, column: BalconyColumn, grid: FacadeGrid) -> list[FloatArray]:
    """Openings (4,) of a column: from the rail of each front to the slab above or the eaves."""
    edges_m = np.append(column.edges_m, grid.height_m)
    edges = grid.pixels_from_facade(np.stack([edges_m, edges_m], axis=1))[:, 1]
    sides = grid.pixels_from_facade([[column.left_m, 0.0], [column.right_m, 0.0]])[:, 0]
    middle = (fronts_px[:, 0] + fronts_px[:, 2]) / 2
    found = []
    for lower, upper in pairwise(edges):
        on_it = np.abs(fronts_px[:, 3] - lower) * grid.m_per_px < NEAR_M
        for top in fronts_px[on_it & (middle > sides[0]) & (middle < sides[1]), 1][:1]:
            if top - upper > LEAST_DEPTH_M / grid.m_per_px:
                found.append(np.array([sides[0], upper, sides[1], top]))
    return found


def _depth(
    openings_px: FloatArray,
    views: Sequence[OrthoImage],
    cameras_in_facade: Mapping[str, FloatArray],
    m_per_px: float,
    config: MeasureConfig,
) -> float | None:
    """Depth of the one wall that shows through openings (N, 4); None where views do not tell.

    Openings through which it cannot be seen at every depth, as from far below, do not count.
    """
    known = [view for view in views if view.source in cameras_in_facade]
    chosen = widest_views(known, cameras_in_facade, config.recess_max_views)
    if not len(openings_px) or len(chosen) < config.recess_min_views:
        return None
    scale = min(1.0, m_per_px / config.recess_m_per_px)
    step_m = m_per_px / scale
    prepared = [prepared_view(v, cameras_in_facade[v.source], m_per_px, scale) for v in chosen]
    curves = []
    for box in openings_px * scale:
        hole = box + JAMB_M / step_m * np.array([1, 1, -1, -1])
        seeing = views_of(box, prepared, step_m, config)
        curve = [agreement(seeing, box, hole, d / step_m, in_hole=True) for d in DEPTHS_M]
        if np.isfinite(curve).all():
            curves.append(curve)
    if not curves:
        return None
    mean = np.mean(curves, axis=0)
    best, low = int(mean.argmax()), float(np.quantile(mean, 0.1))
    clear = mean[best] - low > LEAST_RISE * min(mean[best], 1 - low)
    deep = DEPTHS_M[best] >= LEAST_DEPTH_M and best < len(DEPTHS_M) - 1
    return float(DEPTHS_M[best]) if clear and deep else None


def on_back_walls(
    fused: OrthoImage,
    views: Sequence[OrthoImage],
    loggias: Loggias,
    cameras_in_facade: Mapping[str, FloatArray],
    grid: FacadeGrid,
) -> tuple[OrthoImage, NDArray[np.float32]]:
    """The fused image with the back walls of loggias where they are, and how far they were seen.

    Places on them that no camera sees are not valid. The second, (H, W), is 1 there where at least
    two cameras see a back wall, half that of one and 0 of none; NaN beside loggias.
    """
    known = [view for view in views if view.source in cameras_in_facade]
    gains = exposure_gains(known)
    rgb, valid = fused.rgb.copy(), fused.valid.copy()
    seen = np.full(fused.valid.shape, np.nan, np.float32)
    limit = np.array([grid.width_px, grid.height_px] * 2)
    for box in loggias.openings_px:
        left, top, right, bottom = np.clip(np.round(box), 0, limit).astype(int).tolist()
        area = (left, top, right, bottom)
        if right - left < 2 or bottom - top < 2:
            continue
        cameras = [cameras_in_facade[view.source] for view in known]
        depth_px = loggias.depth_m / grid.m_per_px
        parts = [
            view_behind(view, box, area, camera, depth_px, grid)
            for view, camera in zip(known, cameras, strict=True)
        ]
        inside = blend(parts, [weight_within(area, camera, grid) for camera in cameras], gains)
        count = np.sum([part.valid for part in parts], axis=0)
        rgb[part_of(box)] = np.where(inside.valid[..., None], inside.rgb, rgb[part_of(box)])
        valid[part_of(box)] = inside.valid
        seen[part_of(box)] = np.select([count > 1, count == 1], [1.0, ONE_OF_MANY], 0.0)
    return OrthoImage(fused.source, rgb, valid, fused.depth_m, fused.seen_by), seen


def moved_back(
    found: Detections, camera: FloatArray, loggias: Loggias, grid: FacadeGrid
) -> Detections:
    """The detections of one view, those in loggias where they are on the back wall.

    What would lie beside the loggia there is none of its openings and goes.
    """
    inside = loggias.holds(found.boxes_px)
    foot = grid.pixels_from_facade(camera[:2])
    shrink, shift = seen_from(
        foot, float(camera[2]) / grid.m_per_px, loggias.depth_m / grid.m_per_px
    )
    boxes = np.where(inside[:, None], (found.boxes_px - np.tile(shift, 2)) / shrink, found.boxes_px)
    sigma = np.where(inside[:, None], found.edge_sigma_px / shrink, found.edge_sigma_px)
    boxes = np.clip(boxes, 0, [grid.width_px, grid.height_px] * 2)
    moved = replace(found, boxes_px=boxes, edge_sigma_px=sigma)
    return moved.select(np.flatnonzero(~inside | loggias.holds(boxes)))
