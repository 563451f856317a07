"""Steps S.3 and S.4 for one wall: register its views, find the facade in them, crop, fuse."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from si3fp.blend import blend
from si3fp.config import AlignConfig, FacadeBoxConfig
from si3fp.errors import FacadeError
from si3fp.geometry.rigid import FloatArray
from si3fp.model import FacadeViews, OrthoImage, Panorama
from si3fp.ortho import view_weight
from si3fp.streetview.align import Registration, register, registered
from si3fp.streetview.drift import RegisteredFacade
from si3fp.streetview.facade_box import FacadeBox, PriorBox, find_facade_box
from si3fp.streetview.pose_motion import motion_covariance
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
    box
        The facade's borders on the wall's grid, with the evidence for each.
    cameras_in_facade
        Optical centre (3,) in the facade frame by view id.
    """

    views: FacadeViews
    fused: OrthoImage
    box: FacadeBox
    cameras_in_facade: Mapping[str, FloatArray]


def align_views(
    plan: ViewPlan,
    views: Sequence[OrthoImage],
    panoramas: Mapping[str, Panorama],
    config: AlignConfig,
) -> RegisteredFacade:
    """S.3 of one facade: its views against one another, one registration each.

    Parameters
    ----------
    plan
        The wall and its grid.
    views
        Views on the plan's grid, from `si3fp.streetview.views.make_view`.
    panoramas
        Poses by view id.
    config
        Constants of the registration.

    Raises
    ------
    FacadeError
        If there is no view.
    """
    if not views:
        raise FacadeError(
            f"None of {len(plan.panorama_ids)} panoramas shows enough of the wall to be used."
        )
    quality, covariances = [], []
    for view in views:
        panorama = panoramas[view.source]
        sharpness = np.sqrt(view_weight(panorama, plan.grid))
        quality.append(float((sharpness * view.valid).mean()))
        covariances.append(motion_covariance(panorama, plan.grid, config))
    registrations = register(
        FacadeViews(plan.wall.facade_id, plan.grid, tuple(views)), quality, covariances, config
    )
    fit = plan.wall.fit
    plane_sigma = np.array([fit.offset_sigma_m, np.deg2rad(fit.angle_sigma_deg)])
    return RegisteredFacade(plan.grid, plane_sigma, registrations)


def moved_views(
    plan: ViewPlan, views: Sequence[OrthoImage], registrations: Sequence[Registration]
) -> tuple[OrthoImage, ...]:
    """The views that are used, moved onto the plan's grid by their registrations."""
    return tuple(
        registered(view, registration, plan.grid)
        for view, registration in zip(views, registrations, strict=True)
        if registration.used
    )


def crop_to_facade(
    plan: ViewPlan,
    moved: Sequence[OrthoImage],
    panoramas: Mapping[str, Panorama],
    config: FacadeBoxConfig,
    rng: np.random.Generator,
) -> FacadeOrthophoto:
    """S.4: the facade between its borders, and the blend of its views.

    Parameters
    ----------
    plan
        The wall and its grid.
    moved
        Registered views on the plan's grid.
    panoramas
        Poses by view id.
    config, rng
        Constants and randomness of the step.

    Raises
    ------
    FacadeError
        If no borders can be found.
    """
    box = _at_shared_corners(find_facade_box(moved, plan.grid, _prior(plan), config, rng), plan)
    left, bottom = plan.grid.pixels_from_facade([box.left_m, box.bottom_m]).round().astype(int)
    right, top = plan.grid.pixels_from_facade([box.right_m, box.top_m]).round().astype(int)
    left, top = max(left, 0), max(top, 0)
    right, bottom = min(right, plan.grid.width_px), min(bottom, plan.grid.height_px)
    grid = plan.grid.cropped(left, top, right, bottom)
    cropped = tuple(moved_to(view, slice(top, bottom), slice(left, right)) for view in moved)
    facade_from_world = grid.world_from_facade.inverse()
    return FacadeOrthophoto(
        FacadeViews(plan.wall.facade_id, grid, cropped),
        blend(cropped, [view_weight(panoramas[view.source], grid) for view in cropped]),
        box,
        {
            view.source: facade_from_world.apply(panoramas[view.source].centre_in_world)
            for view in cropped
        },
    )


def _at_shared_corners(box: FacadeBox, plan: ViewPlan) -> FacadeBox:
    """The box with its ends at the footprint's corners where the wall goes on beyond them."""
    ends = {"left": plan.margin_m, "right": plan.margin_m + plan.wall.width_m}
    for side, (name, place_m) in enumerate(ends.items()):
        if plan.wall.goes_on[side]:
            evidence = tuple("footprint" if k == side else e for k, e in enumerate(box.evidence))
            note = f"{name} side from the footprint: the wall goes on beyond it"
            box = replace(
                box,
                left_m=place_m if name == "left" else box.left_m,
                right_m=place_m if name == "right" else box.right_m,
                evidence=evidence,
                notes=(*(n for n in box.notes if not n.startswith(f"{name} side")), note),
            )
    return box


def _prior(plan: ViewPlan) -> PriorBox:
    """The wall as map and planes have it, on the plan's grid."""
    margin_m, wall = plan.margin_m, plan.wall
    return PriorBox(
        left_m=margin_m,
        right_m=margin_m + wall.width_m,
        bottom_m=margin_m,
        top_m=margin_m + wall.height_m,
        top_is_assumed=wall.height_is_assumed,
    )
