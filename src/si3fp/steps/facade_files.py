"""The folder of one facade: pictures, detections, windows, and what they rest on."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from si3fp.config import MeasureConfig, RunConfig
from si3fp.model import Facade, OrthoImage
from si3fp.records import detections_record, facade_record, window_record
from si3fp.steps.inputs import RunInputs
from si3fp.streetview.orthophoto import FacadeOrthophoto
from si3fp.windows.parse import ParsedFacade
from si3fp.workspace import Workspace, safe_name, write_array, write_png

WELL_SEEN = 0.95


def write_facade(
    name: str,
    photo: FacadeOrthophoto,
    parsed: ParsedFacade,
    about: Mapping[str, Any],
    used_inputs: Collection[str],
    inputs: RunInputs,
    workspace: Workspace,
    config: RunConfig,
) -> None:
    """Write the folder of one facade; ``facade.json`` comes last and says that it is complete.

    Parameters
    ----------
    name
        Id of the facade.
    photo, parsed
        Its pictures and windows.
    about
        What is particular to the path: building, edge, views, plane, notes.
    used_inputs
        Names of the input files that the facade depends on.
    inputs, workspace, config
        Of the run.
    """
    grid = photo.views.grid
    head = {
        "config": config.as_dict(),
        "inputs": {key: value for key, value in inputs.hashes.items() if key in used_inputs},
    }
    for view in photo.views.views:
        write_png(workspace.facade(name, f"views/{safe_name(view.source)}.png"), _rgba(view))
    write_png(workspace.facade(name, "ortho.png"), _rgba(parsed.picture))
    seen_by, depth_m = photo.fused.seen_by, photo.fused.depth_m
    if seen_by is not None:
        write_png(workspace.facade(name, "coverage.png"), seen_by)
    if depth_m is not None:
        write_array(workspace.facade(name, "depth.npy"), depth_m)
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
    record = {
        **head,
        **facade_record(facade, inputs.origin),
        **{key: value for key, value in about.items() if key != "notes"},
        "m_per_px": grid.m_per_px,
        "grid_px": [grid.width_px, grid.height_px],
        "coverage": {
            "seen": round(float(photo.fused.valid.mean()), 4),
            "seen_by_two": round(float((seen_by >= 2).mean()), 4) if seen_by is not None else None,
        },
        "box": plain(photo.box),
        "notes": [
            *about["notes"],
            *parsed.notes,
            *photo.box.notes,
            *_coverage_notes(photo),
            _recess_note(parsed, photo.fused.depth_m is not None, config.measure),
        ],
    }
    workspace.write_json(workspace.facade(name, "facade.json"), "facade", record)


def plain(value: Any) -> dict[str, Any]:
    """Fields of a result dataclass, numbers rounded to 0.1 mm."""
    return {
        key: round(item, 4) if isinstance(item, float) else item
        for key, item in asdict(value).items()
    }


def place_of_view(source: str, photo: FacadeOrthophoto) -> dict[str, float]:
    """Distance and obliqueness of a view to the middle of the facade; empty where unknown."""
    camera = photo.cameras_in_facade.get(source)
    if camera is None:
        return {}
    grid = photo.views.grid
    gap = camera - [grid.width_m / 2, grid.height_m / 2, 0.0]
    return {
        "distance_m": round(float(np.linalg.norm(gap)), 2),
        "obliqueness_deg": round(float(np.rad2deg(np.arctan2(np.hypot(*gap[:2]), gap[2]))), 1),
    }


def _rgba(view: OrthoImage) -> Any:
    return np.dstack([view.rgb, view.valid.view(np.uint8) * np.uint8(255)])


def _coverage_notes(photo: FacadeOrthophoto) -> list[str]:
    """Says so where a part of the facade was not seen: windows there cannot be found."""
    seen = float(photo.fused.valid.mean())
    if seen >= WELL_SEEN:
        return []
    return [f"only {seen:.0%} of the facade was seen: windows elsewhere are not in the ratio"]


def _recess_note(parsed: ParsedFacade, has_depth: bool, config: MeasureConfig) -> str:
    """How deep the glass lies and how that is known."""
    measured = [window.recess_m for window in parsed.windows if window.recess_m is not None]
    switched_off = "" if config.correct_recess else "; edges not corrected (switched off)"
    assumed = f"assumed {config.assumed_recess_m:g} +- {config.recess_sigma_m:g} m behind the wall"
    if not measured:
        return f"glass {assumed}{switched_off}"
    rest = len(parsed.windows) - len(measured)
    return (
        f"glass {float(np.median(measured)):.2f} m behind the wall, measured by "
        f"{'depth' if has_depth else 'parallax'} at {len(measured)} windows"
        + (f"; {assumed} at {rest}" if rest else "")
        + switched_off
    )
