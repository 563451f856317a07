"""Algorithm 3: every panorama's orthographic view of a wall, on the wall's one common grid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from si3fp.config import ClusterConfig, OrthoConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Footprint, Image, OrthoImage, Panorama
from si3fp.ortho import rectify, source_m_per_px, view_distances
from si3fp.streetview.cluster import Wall
from si3fp.streetview.occlusion import hidden_part

EAVES_REACH_M = 27.0
"""The grid reaches this far above the ground where nothing tells the eaves: nine storeys."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewPlan:
    """Which panoramas are resampled onto which grid.

    Attributes
    ----------
    wall
        The wall.
    grid
        Common grid: the wall with a margin on all sides, so that step S.4 can move its borders.
    margin_m
        That margin; the wall's lower left corner lies at (margin, margin) on the grid.
    panorama_ids
        The views to make, best first.
    """

    wall: Wall
    grid: FacadeGrid
    margin_m: float
    panorama_ids: tuple[str, ...]


def plan_views(
    wall: Wall,
    panoramas: Mapping[str, Panorama],
    width_px: Mapping[str, int],
    config: OrthoConfig,
) -> ViewPlan:
    """The common grid of a wall and the panoramas that see it well enough, best first.

    The grid is as fine as ``config.m_per_px``, or as the third best panorama resolves the wall
    where that is coarser: finer pixels would only be interpolated.

    Parameters
    ----------
    wall
        From the clustering.
    panoramas
        By id.
    width_px
        Width of the full equirectangular image by panorama id.
    config
        Resolution, margin, largest obliqueness, number of views.
    """
    corner = wall.world_from_facade.apply([-config.margin_m, -config.margin_m, 0.0])
    frame = Rigid3(wall.world_from_facade.rotation, corner)
    width_m = wall.width_m + 2 * config.margin_m
    reach_m = EAVES_REACH_M if wall.height_is_assumed else wall.height_m + config.headroom_m
    height_m = config.margin_m + reach_m
    coarse = FacadeGrid.covering(frame, width_m, height_m, 0.25)
    least_cosine = np.cos(np.deg2rad(config.max_obliqueness_deg))
    sizes = {}
    for name in wall.panorama_ids:
        _, cosines = view_distances(panoramas[name], coarse, _coarse_pixels(coarse))
        if (cosines > least_cosine).mean() >= config.min_seen:
            sizes[name] = source_m_per_px(panoramas[name], coarse, width_px[name])
    order = sorted(sizes, key=lambda name: (sizes[name], name))[: config.max_views]
    third = sizes[order[min(2, len(order) - 1)]] if order else config.m_per_px
    m_per_px = max(config.m_per_px, round(third, 3))
    grid = FacadeGrid.covering(frame, width_m, height_m, m_per_px)
    return ViewPlan(wall, grid, config.margin_m, tuple(order))


def make_view(
    plan: ViewPlan,
    panorama: Panorama,
    image: Image,
    seen: NDArray[np.bool_],
    footprints: Sequence[Footprint],
    config: OrthoConfig,
    cluster: ClusterConfig,
) -> OrthoImage:
    """One view of a plan (see `si3fp.ortho.rectify`), without what other buildings hide."""
    view = rectify(panorama, image, seen, plan.grid, config)
    hidden = hidden_part(panorama, plan.wall, plan.grid, footprints, cluster)
    return replace(view, valid=view.valid & ~hidden)


def enough_seen(views: Sequence[OrthoImage], config: OrthoConfig) -> list[OrthoImage]:
    """The views that cover at least ``config.min_seen`` of the grid."""
    return [view for view in views if view.valid.mean() >= config.min_seen]


def moved_to(view: OrthoImage, rows: slice, columns: slice) -> OrthoImage:
    """The part of a view inside a pixel box, with all of its layers."""
    depth_m, seen_by = view.depth_m, view.seen_by
    return replace(
        view,
        rgb=view.rgb[rows, columns],
        valid=view.valid[rows, columns],
        depth_m=None if depth_m is None else depth_m[rows, columns],
        seen_by=None if seen_by is None else seen_by[rows, columns],
    )


def _coarse_pixels(grid: FacadeGrid) -> NDArray[np.float64]:
    x, y = np.meshgrid(np.arange(grid.width_px) + 0.5, np.arange(grid.height_px) + 0.5)
    return np.stack([x, y], axis=-1)
