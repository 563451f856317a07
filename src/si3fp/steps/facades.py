"""S.3, S.4 and M.1 with their files: one wall becomes a facade or a `Missing` row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict
from typing import Any

import numpy as np

from si3fp.config import StreetConfig
from si3fp.errors import FacadeError, InputError
from si3fp.model import Facade, Missing, OrthoImage
from si3fp.records import (
    detections_record,
    facade_from_records,
    facade_record,
    rounded,
    window_record,
)
from si3fp.steps.inputs import StreetInputs
from si3fp.streetview.align import Registration
from si3fp.streetview.orthophoto import FacadeOrthophoto, align_views, crop_to_facade
from si3fp.streetview.views import ViewPlan, enough_seen
from si3fp.windows.detect import WindowDetector
from si3fp.windows.parse import ParsedFacade, parse_facade
from si3fp.workspace import (
    Workspace,
    read_json,
    read_png,
    safe_name,
    write_png,
)

WELL_SEEN = 0.95


def find_facade(
    plan: ViewPlan,
    inputs: StreetInputs,
    detector: WindowDetector,
    workspace: Workspace,
    config: StreetConfig,
    timed: Callable[[str], AbstractContextManager[None]],
) -> Facade | Missing:
    """S.3, S.4 and M.1 of one wall, with its files; a failure is a `Missing` row.

    ``timed`` is a context that counts the time of a step.
    """
    name = plan.wall.facade_id
    if not workspace.facade(name, "facade.json").exists():
        step = "align"
        try:
            with timed("S.3 align"):
                views = enough_seen(
                    [_raw_view(plan, each, workspace) for each in plan.panorama_ids], config.ortho
                )
                if not views:
                    return _not_seen(plan, config)
                registrations, moved = align_views(plan, views, inputs.panoramas, config.align)
            step = "facade_box"
            with timed("S.4 facade"):
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
            _write_facade(plan, registrations, photo, parsed, inputs, workspace, config)
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


def _raw_view(plan: ViewPlan, panorama_id: str, workspace: Workspace) -> OrthoImage:
    pixels = read_png(workspace.raw_view(plan.wall.facade_id, panorama_id))
    return OrthoImage(panorama_id, np.ascontiguousarray(pixels[..., :3]), pixels[..., 3] == 255)


def _write_facade(
    plan: ViewPlan,
    registrations: Sequence[Registration],
    photo: FacadeOrthophoto,
    parsed: ParsedFacade,
    inputs: StreetInputs,
    workspace: Workspace,
    config: StreetConfig,
) -> None:
    """The folder of one facade; ``facade.json`` comes last and says that it is complete."""
    name, grid = plan.wall.facade_id, photo.views.grid
    others = {
        f"{panorama} {kind}"
        for panorama in inputs.records.keys() - set(plan.panorama_ids)
        for kind in ("image", "plane map")
    }
    head = {
        "config": config.as_dict(),
        "inputs": {key: value for key, value in inputs.hashes.items() if key not in others},
    }
    for view in photo.views.views:
        write_png(workspace.facade(name, f"views/{safe_name(view.source)}.png"), _rgba(view))
    write_png(workspace.facade(name, "ortho.png"), _rgba(parsed.picture))
    seen_by = photo.fused.seen_by
    if seen_by is not None:
        write_png(workspace.facade(name, "coverage.png"), seen_by)
    detections = {
        "m_per_px": grid.m_per_px,
        "fused": detections_record(parsed.on_fused),
        "views": {view: detections_record(found) for view, found in parsed.per_view.items()},
    }
    workspace.write_json(workspace.facade(name, "detections.json"), "detections", head | detections)
    windows = {"facade_id": name, "windows": [window_record(w) for w in parsed.windows]}
    workspace.write_json(workspace.facade(name, "windows.json"), "windows", head | windows)
    facade = Facade(
        name,
        grid.world_from_facade,
        grid.width_m,
        grid.height_m,
        parsed.windows,
        parsed.wwr_interval,
    )
    about = {
        "building_id": plan.wall.building_id,
        "edge": plan.wall.edge_index,
        "m_per_px": grid.m_per_px,
        "grid_px": [grid.width_px, grid.height_px],
        "views": [_view_record(registration, photo) for registration in registrations],
        "coverage": {
            "seen": round(float(photo.fused.valid.mean()), 4),
            "seen_by_two": round(float((seen_by >= 2).mean()), 4) if seen_by is not None else None,
        },
        "box": _plain(photo.box),
        "plane": _plain(plan.wall.fit),
        "notes": [
            *plan.wall.notes,
            *photo.box.notes,
            *_coverage_notes(photo),
            _recess_note(parsed, config),
        ],
    }
    record = head | facade_record(facade, inputs.origin) | about
    workspace.write_json(workspace.facade(name, "facade.json"), "facade", record)


def _rgba(view: OrthoImage) -> Any:
    return np.dstack([view.rgb, view.valid.view(np.uint8) * np.uint8(255)])


def _plain(value: Any) -> dict[str, Any]:
    """Fields of a result dataclass, numbers rounded to 0.1 mm."""
    return {
        key: round(item, 4) if isinstance(item, float) else item
        for key, item in asdict(value).items()
    }


def _view_record(registration: Registration, photo: FacadeOrthophoto) -> dict[str, Any]:
    camera = photo.cameras_in_facade.get(registration.source)
    grid = photo.views.grid
    place: dict[str, float] = {}
    if camera is not None:
        gap = camera - [grid.width_m / 2, grid.height_m / 2, 0.0]
        place = {
            "distance_m": round(float(np.linalg.norm(gap)), 2),
            "obliqueness_deg": round(float(np.rad2deg(np.arctan2(np.hypot(*gap[:2]), gap[2]))), 1),
        }
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
        **place,
    }


def _rounded_or_none(value: float | None) -> float | None:
    return None if value is None else round(value, 3)


def _coverage_notes(photo: FacadeOrthophoto) -> list[str]:
    """Says so where a part of the facade was not seen: windows there cannot be found."""
    seen = float(photo.fused.valid.mean())
    if seen >= WELL_SEEN:
        return []
    return [f"only {seen:.0%} of the facade was seen: windows elsewhere are not in the ratio"]


def _recess_note(parsed: ParsedFacade, config: StreetConfig) -> str:
    """How deep the glass lies and how that is known."""
    measured = [window.recess_m for window in parsed.windows if window.recess_m is not None]
    switched_off = "" if config.measure.correct_recess else "; edges not corrected (switched off)"
    assumed = (
        f"assumed {config.measure.assumed_recess_m:g} +- {config.measure.recess_sigma_m:g} m "
        "behind the wall"
    )
    if not measured:
        return f"glass {assumed}{switched_off}"
    rest = len(parsed.windows) - len(measured)
    return (
        f"glass {float(np.median(measured)):.2f} m behind the wall, measured by parallax at "
        f"{len(measured)} windows" + (f"; {assumed} at {rest}" if rest else "") + switched_off
    )
