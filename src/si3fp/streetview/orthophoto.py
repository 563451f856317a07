"""Steps S.3 and S.4 for one wall: register its views, find the facade in them, crop, fuse."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from si3fp.blend import blend
from si3fp.config import StreetConfig
from si3fp.errors import FacadeError
from si3fp.geometry.rigid import FloatArray
from si3fp.model import FacadeViews, OrthoImage, Panorama
from si3fp.ortho import pose_sigma_m, view_weight
from si3fp.streetview.align import Registration, register, registered
from si3fp.streetview.facade_box import BoxPrior, FacadeBox, find_facade_box
from si3fp.streetview.views import ViewPlan, moved_to


@dataclass(frozen=True, slots=True, eq=False)
class FacadeOrthophoto:
    """A facade between ground and eaves: its registered views and their blend.

    Attributes
    ----------
    views
        Registered views on the facade's own grid.
    fused
        Their robust blend with ``seen_by``.
    registrations
        One per view that was made, the dropped ones included.
    box
        The facade's borders on the wall's grid, with the evidence for each.
    cameras_in_facade
        Optical centre (3,) in the facade frame by view id.
    """

    views: FacadeViews
    fused: OrthoImage
    registrations: tuple[Registration, ...]
    box: FacadeBox
    cameras_in_facade: Mapping[str, FloatArray]


def make_orthophoto(
    plan: ViewPlan,
    views: Sequence[OrthoImage],
    panoramas: Mapping[str, Panorama],
    config: StreetConfig,
    rng: np.random.Generator,
) -> FacadeOrthophoto:
    """The registered, cropped and fused views of one wall.

    Parameters
    ----------
    plan
        The wall and its grid.
    views
        Views on the plan's grid, from `si3fp.streetview.views.make_view`.
    panoramas
        Poses by view id.
    config, rng
        Constants and randomness of the steps.

    Raises
    ------
    FacadeError
        If no view shows the wall or no borders can be found.
    """
    if not views:
        raise FacadeError(
            f"None of {len(plan.panorama_ids)} panoramas shows at least "
            f"{config.ortho.min_seen:.0%} of the wall."
        )
    weights = [view_weight(panoramas[view.source], plan.grid) for view in views]
    quality = [
        float((np.sqrt(weight) * view.valid).mean())
        for weight, view in zip(weights, views, strict=True)
    ]
    sigmas = [
        pose_sigma_m(
            panoramas[view.source],
            plan.grid,
            config.align.position_sigma_m,
            config.align.direction_sigma_deg,
        )
        for view in views
    ]
    registrations = register(
        FacadeViews(plan.wall.facade_id, plan.grid, tuple(views)), quality, sigmas, config.align
    )
    moved = [
        registered(view, registration, plan.grid)
        for view, registration in zip(views, registrations, strict=True)
        if registration.used
    ]
    box = find_facade_box(moved, plan.grid, _prior(plan), config.facade_box, rng)
    left, bottom = plan.grid.pixels_from_facade([box.left_m, box.bottom_m]).round().astype(int)
    right, top = plan.grid.pixels_from_facade([box.right_m, box.top_m]).round().astype(int)
    left, top = max(left, 0), max(top, 0)
    right, bottom = min(right, plan.grid.width_px), min(bottom, plan.grid.height_px)
    grid = plan.grid.cropped(left, top, right, bottom)
    cropped = tuple(moved_to(view, slice(top, bottom), slice(left, right)) for view in moved)
    return FacadeOrthophoto(
        FacadeViews(plan.wall.facade_id, grid, cropped),
        blend(cropped, [view_weight(panoramas[view.source], grid) for view in cropped]),
        registrations,
        box,
        {
            view.source: grid.world_from_facade.inverse().apply(
                panoramas[view.source].centre_in_world
            )
            for view in cropped
        },
    )


def _prior(plan: ViewPlan) -> BoxPrior:
    """The wall as map and planes have it, on the plan's grid."""
    margin_m, wall = plan.margin_m, plan.wall
    has_edge = wall.edge_index is not None
    return BoxPrior(
        left_m=margin_m if has_edge else None,
        right_m=margin_m + wall.width_m if has_edge else None,
        ground_m=margin_m,
        eaves_m=margin_m + wall.height_m,
    )
