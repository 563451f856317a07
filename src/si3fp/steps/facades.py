"""S.3, S.4 and M.1 with their files: every wall becomes a facade or a `Missing` row."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

import numpy as np

from si3fp.config import StreetConfig
from si3fp.errors import FacadeError, InputError
from si3fp.model import Facade, Missing, OrthoImage
from si3fp.records import facade_from_records, rounded
from si3fp.steps.facade_files import place_of_view, plain, write_facade
from si3fp.steps.inputs import StreetInputs
from si3fp.steps.rectified import Progress
from si3fp.streetview.align import Registration
from si3fp.streetview.drift import RegisteredFacade, without_drift
from si3fp.streetview.orthophoto import (
    FacadeOrthophoto,
    align_views,
    crop_to_facade,
    moved_views,
)
from si3fp.streetview.views import ViewPlan, enough_seen
from si3fp.windows.detect import WindowDetector
from si3fp.windows.parse import parse_facade
from si3fp.workspace import Workspace, read_json, read_png


def register_facades(
    plans: Sequence[ViewPlan],
    inputs: StreetInputs,
    workspace: Workspace,
    config: StreetConfig,
    progress: Progress,
) -> dict[str, tuple[Registration, ...] | Missing]:
    """S.3 of all walls, by their names; a failure is a `Missing` row.

    All walls, because one panorama sees several and its pose errs in one way for all of them.
    Nothing is done where a former run has finished every wall.
    """
    if all(workspace.facade(plan.wall.facade_id, "facade.json").exists() for plan in plans):
        return {}
    found: dict[str, RegisteredFacade] = {}
    missing: dict[str, Missing] = {}
    for done, plan in enumerate(plans):
        progress("registration", done, len(plans))
        name = plan.wall.facade_id
        try:
            views = _raw_views(plan, workspace, config)
            if views:
                found[name] = align_views(plan, views, inputs.panoramas, config.align)
            else:
                missing[name] = _not_seen(plan, config)
        except (FacadeError, InputError) as error:
            missing[name] = Missing(name, "align", str(error))
    progress("registration", len(plans), len(plans))
    placed = without_drift(tuple(found.values()), inputs.panoramas, config.align)
    return {**dict(zip(found, placed, strict=True)), **missing}


def find_facade(
    plan: ViewPlan,
    registered: Mapping[str, tuple[Registration, ...] | Missing],
    inputs: StreetInputs,
    detector: WindowDetector,
    workspace: Workspace,
    config: StreetConfig,
    timed: Callable[[str], AbstractContextManager[None]],
) -> Facade | Missing:
    """S.4 and M.1 of one wall, with its files; a failure is a `Missing` row.

    ``registered`` comes from `register_facades`; ``timed`` is a context that counts the time of a
    step.
    """
    name = plan.wall.facade_id
    if not workspace.facade(name, "facade.json").exists():
        registrations = registered[name]
        if isinstance(registrations, Missing):
            return registrations
        step = "facade_box"
        try:
            with timed("S.4 facade"):
                moved = moved_views(plan, _raw_views(plan, workspace, config), registrations)
                rng = np.random.default_rng([config.seed, *name.encode()])
                photo = crop_to_facade(plan, moved, inputs.panoramas, config.facade_box, rng)
            step = "windows"
            with timed("M.1 windows"):
                parsed = parse_facade(
                    photo.views,
                    photo.fused,
                    photo.cameras_in_facade,
                    detector,
                    config.fusion,
                    config.measure,
                )
        except (FacadeError, InputError) as error:
            return Missing(name, step, str(error))
        with timed("write"):
            write_facade(
                name,
                photo,
                parsed,
                _about(plan, registrations, photo),
                _used_inputs(plan, inputs),
                inputs,
                workspace,
                config,
            )
    return facade_from_records(
        read_json(workspace.facade(name, "facade.json")),
        read_json(workspace.facade(name, "windows.json")),
    )


def _not_seen(plan: ViewPlan, config: StreetConfig) -> Missing:
    return Missing(
        plan.wall.facade_id,
        "coverage",
        f"no camera sees enough: of {len(plan.panorama_ids)} panoramas none shows "
        f"{config.ortho.min_seen:.0%} of it",
    )


def _raw_views(plan: ViewPlan, workspace: Workspace, config: StreetConfig) -> list[OrthoImage]:
    """The views of a wall that show enough of it, as they were made."""
    views = [_raw_view(plan, each, workspace) for each in plan.panorama_ids]
    return enough_seen(views, config.ortho)


def _raw_view(plan: ViewPlan, panorama_id: str, workspace: Workspace) -> OrthoImage:
    pixels = read_png(workspace.raw_view(plan.wall.facade_id, panorama_id))
    return OrthoImage(panorama_id, np.ascontiguousarray(pixels[..., :3]), pixels[..., 3] == 255)


def _about(
    plan: ViewPlan, registrations: Sequence[Registration], photo: FacadeOrthophoto
) -> dict[str, Any]:
    return {
        "building_id": plan.wall.building_id,
        "edge": plan.wall.edge_index,
        "views": [_view_record(registration, photo) for registration in registrations],
        "plane": plain(plan.wall.fit),
        "notes": plan.wall.notes,
    }


def _used_inputs(plan: ViewPlan, inputs: StreetInputs) -> set[str]:
    """All input files but those of panoramas that the facade does not use."""
    others = {
        f"{panorama} {kind}"
        for panorama in inputs.records.keys() - set(plan.panorama_ids)
        for kind in ("image", "plane map")
    }
    return inputs.hashes.keys() - others


def _view_record(registration: Registration, photo: FacadeOrthophoto) -> dict[str, Any]:
    return {
        "source": registration.source,
        "used": registration.used,
        "reason": registration.reason,
        "model": registration.model,
        "inliers": registration.inliers,
        "residual_before_px": _rounded_or_none(registration.residual_before_px),
        "residual_after_px": _rounded_or_none(registration.residual_after_px),
        "shift_m": round(registration.shift_m, 4),
        "grid_from_view": rounded(registration.grid_from_view, 9),
        **place_of_view(registration.source, photo),
    }


def _rounded_or_none(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
