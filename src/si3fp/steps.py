"""The steps of a run with their files: each skips what a former run has finished.

Algorithms live in the modules below; here stands what is read, kept and written, and where one
facade's failure becomes a `Missing` row.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from si3fp.config import StreetConfig
from si3fp.errors import FacadeError, InputError
from si3fp.geometry.enu import GeoOrigin
from si3fp.model import Building, Facade, Footprint, Missing, OrthoImage, Panorama
from si3fp.records import (
    detections_record,
    facade_from_records,
    facade_record,
    missing_record,
    origin_record,
    rounded,
    window_record,
)
from si3fp.sources.footprints import footprints_in_world, read_footprints
from si3fp.sources.images import load_panorama, seen_pixels
from si3fp.sources.local import PanoramaRecord, panoramas_in_world, read_panorama_records
from si3fp.sources.selection import run_origin, select_panoramas, within_radius
from si3fp.streetview.align import Registration
from si3fp.streetview.cloud import cloud_stride, coloured_points, ply_bytes
from si3fp.streetview.cluster import WallClusters
from si3fp.streetview.orthophoto import FacadeOrthophoto, align_views, crop_to_facade
from si3fp.streetview.views import ViewPlan, enough_seen, make_view, plan_views
from si3fp.thermal.archetypes import Archetype, archetype
from si3fp.thermal.assemble import assemble
from si3fp.thermal.building import make_building
from si3fp.thermal.energyplus import SimulationResult, simulate
from si3fp.windows.detect import WindowDetector
from si3fp.windows.parse import ParsedFacade, parse_facade
from si3fp.workspace import (
    Workspace,
    dump_json,
    key_of,
    read_array,
    read_json,
    read_png,
    safe_name,
    sha256_of,
    write_array,
    write_bytes,
    write_png,
    write_text,
)

Progress = Callable[[str, int, int], None]
"""Called with the name of a step, how much of it is done, and how much there is."""

PARALLEL_PIXELS = 8192 * 4096
"""Panoramas up to this size are decoded two at a time; larger ones would not fit in memory."""


@dataclass(frozen=True, slots=True, eq=False)
class StreetInputs:
    """What S.1 found.

    Attributes
    ----------
    origin
        Origin of the world frame.
    panoramas
        The panoramas used, by id.
    records
        Their files, by id.
    footprints
        The buildings; empty without a map.
    by_building
        Ids of the panoramas to use for every building.
    hashes
        SHA-256 of every input file by name.
    notes
        What the filters did.
    """

    origin: GeoOrigin
    panoramas: Mapping[str, Panorama]
    records: Mapping[str, PanoramaRecord]
    footprints: tuple[Footprint, ...]
    by_building: Mapping[str, frozenset[str]]
    hashes: Mapping[str, str]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Circle:
    """A place and a radius that limit which panoramas are used."""

    lat_deg: float
    lon_deg: float
    radius_m: float


def collect(
    panoramas: Path,
    footprints: Path | None,
    config: StreetConfig,
    *,
    circle: Circle | None = None,
    columns: Mapping[str, str] | None = None,
) -> StreetInputs:
    """S.1: the panoramas and footprints of a run, checked and filtered."""
    records = read_panorama_records(panoramas, config.collect.max_pixels)
    outlines = read_footprints(footprints, columns) if footprints else []
    notes: list[str] = []
    if circle is not None:
        kept = within_radius(records, circle.lat_deg, circle.lon_deg, circle.radius_m)
        notes.append(
            f"{len(kept)} of {len(records)} panoramas lie within {circle.radius_m:g} m of "
            f"{circle.lat_deg}, {circle.lon_deg}."
        )
        if not kept:
            raise InputError(f"{panoramas}: {notes[-1]} Give a larger radius or another place.")
        records = kept
    origin = run_origin(outlines, records)
    buildings = tuple(footprints_in_world(outlines, origin))
    selection = select_panoramas(records, buildings, origin, config.collect)
    chosen = selection.records
    files = [panoramas] if panoramas.is_file() else []
    files += [footprints] if footprints else []
    files += [record.image for record in chosen]
    files += [record.plane_map for record in chosen if record.plane_map]
    return StreetInputs(
        origin,
        {panorama.id: panorama for panorama in panoramas_in_world(chosen, origin)},
        {record.id: record for record in chosen},
        buildings,
        selection.by_building,
        {file.name: sha256_of(file) for file in sorted(files)},
        (*notes, *selection.notes),
    )


def claim(workspace: Workspace, key: str, overwrite: bool) -> None:
    """Make sure that the run's folder is empty or holds this very run, finished or not.

    Raises
    ------
    InputError
        If it holds a run of other inputs or settings and ``overwrite`` is not set.
    """
    held = None
    if workspace.root.exists() and not workspace.root.is_dir():
        raise InputError(f"{workspace.root} is a file; give a folder for the run with -o.")
    if workspace.key.exists():
        held = read_json(workspace.key)["key"]
    elif workspace.root.exists() and any(workspace.root.iterdir()):
        held = "files that are not of this run"
    if overwrite:
        workspace.clear()
    elif held not in (None, key):
        raise InputError(
            f"{workspace.root} holds a run of other inputs, settings or another version. Choose "
            "another folder with -o, or replace it with --overwrite."
        )
    write_text(workspace.key, dump_json({"key": key}))


def run_key(inputs: StreetInputs, config: StreetConfig, detector_sha256: str, version: str) -> str:
    """Names a run: the same key means the same results."""
    return key_of(dict(inputs.hashes), config.as_dict(), detector_sha256, version)


def plan(
    inputs: StreetInputs, clusters: WallClusters, config: StreetConfig
) -> tuple[list[ViewPlan], list[Missing]]:
    """Algorithm 3, first half: the grid of every wall and the panoramas to use for it."""
    plans, missing = [], []
    widths = {name: record.width_px for name, record in inputs.records.items()}
    for wall in clusters.walls:
        allowed = inputs.by_building.get(wall.building_id or "", None)
        names = tuple(n for n in wall.panorama_ids if allowed is None or n in allowed)
        made = plan_views(replace(wall, panorama_ids=names), inputs.panoramas, widths, config.ortho)
        if made.panorama_ids:
            plans.append(made)
        else:
            missing.append(
                Missing(
                    wall.facade_id,
                    "coverage",
                    f"{len(names)} panoramas see it, but all more obliquely than "
                    f"{config.ortho.max_obliqueness_deg:g} degrees",
                )
            )
    return plans, missing


def make_views(
    inputs: StreetInputs,
    plans: Sequence[ViewPlan],
    workspace: Workspace,
    config: StreetConfig,
    progress: Progress,
) -> None:
    """Algorithms 1 and 3: every view as a file; each panorama is decoded once, for all walls."""
    stride = cloud_stride(list(inputs.panoramas.values()), config.cluster)

    def work(name: str) -> None:
        mine = [p for p in plans if name in p.panorama_ids]
        todo = [p for p in mine if not workspace.raw_view(p.wall.facade_id, name).exists()]
        points_file = workspace.points(name)
        if not todo and points_file.exists():
            return
        image = load_panorama(inputs.records[name].image, config.collect.max_pixels)
        panorama = inputs.panoramas[name]
        if todo:
            seen = seen_pixels(image)
            for each in todo:
                view = make_view(
                    each, panorama, image, seen, inputs.footprints, config.ortho, config.cluster
                )
                alpha = view.valid.view(np.uint8) * np.uint8(255)
                write_png(
                    workspace.raw_view(each.wall.facade_id, name), np.dstack([view.rgb, alpha])
                )
        points, colours = coloured_points(panorama, image, stride)
        write_array(points_file, np.column_stack([points, colours]).astype(np.float32))

    names = list(inputs.panoramas)
    large = max(r.width_px * r.height_px for r in inputs.records.values()) > PARALLEL_PIXELS
    with ThreadPoolExecutor(1 if large else 2) as pool:
        progress("views", 0, len(names))
        for done, _ in enumerate(pool.map(work, names), start=1):
            progress("views", done, len(names))


def write_cloud(inputs: StreetInputs, workspace: Workspace) -> None:
    """The paper's coloured points of all panoramas as ``cloud.ply``."""
    parts = [read_array(workspace.points(name)) for name in inputs.panoramas]
    points = np.concatenate(parts)
    write_bytes(
        workspace.cloud, ply_bytes(points[:, :3].astype(np.float64), points[:, 3:].astype(np.uint8))
    )


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
                views = [_raw_view(plan, each, workspace) for each in plan.panorama_ids]
                registrations, moved = align_views(
                    plan, enough_seen(views, config.ortho), inputs.panoramas, config.align
                )
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
        except FacadeError as error:
            return Missing(name, step, str(error))
        with timed("write"):
            _write_facade(plan, registrations, photo, parsed, inputs, workspace, config)
    return facade_from_records(
        read_json(workspace.facade(name, "facade.json")),
        read_json(workspace.facade(name, "windows.json")),
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
    head = {
        "config": config.as_dict(),
        "inputs": {n: h for n, h in inputs.hashes.items() if _is_input_of(n, plan, inputs)},
    }
    for view in photo.views.views:
        write_png(workspace.facade(name, f"views/{safe_name(view.source)}.png"), _rgba(view))
    write_png(workspace.facade(name, "ortho.png"), _rgba(photo.fused))
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
    facade = Facade(name, grid.world_from_facade, grid.width_m, grid.height_m, parsed.windows)
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
        "notes": [*plan.wall.notes, *photo.box.notes, _recess_note(parsed, config)],
    }
    record = head | facade_record(facade, inputs.origin) | about
    workspace.write_json(workspace.facade(name, "facade.json"), "facade", record)


def _is_input_of(file: str, plan: ViewPlan, inputs: StreetInputs) -> bool:
    files = [inputs.records[name] for name in plan.panorama_ids]
    return file in {r.image.name for r in files} | {r.plane_map.name for r in files if r.plane_map}


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


def build_models(
    inputs: StreetInputs,
    found: Sequence[Facade],
    missing: Sequence[Missing],
    default_height_m: float,
    workspace: Workspace,
    config: StreetConfig,
) -> tuple[list[Building], list[Facade], list[dict[str, Any]]]:
    """M.2: ``model.hbjson``, ``buildings/*.hbjson``; buildings, loose facades, their records."""
    buildings, archetypes, rows = [], {}, []
    edges = {f"{f.id}-{i}": f.id for f in inputs.footprints for i in range(len(f.edges()))}
    for footprint in inputs.footprints:
        mine = [facade for facade in found if edges.get(facade.id) == footprint.id]
        lost = [row for row in missing if edges.get(row.facade_id) == footprint.id]
        building, notes = make_building(
            footprint, mine, lost, inputs.origin, default_height_m, config.thermal
        )
        kind = archetype(config.thermal.country, building.year, config.thermal.default_year)
        buildings.append(building)
        archetypes[building.id] = kind
        rows.append(_building_row(building, kind, notes))
    loose = [facade for facade in found if facade.id not in edges]
    if not buildings and not loose:
        return [], [], []
    whole = assemble(buildings, archetypes, config.thermal, loose, origin=inputs.origin)
    write_text(workspace.model, dump_json(whole.hbjson))
    for building, row in zip(buildings, rows, strict=True):
        single = assemble([building], archetypes, config.thermal, neighbours=buildings)
        write_text(workspace.building(building.id), dump_json(single.hbjson))
        row["notes"] += single.notes
    return buildings, loose, rows


def _building_row(building: Building, kind: Archetype, notes: Sequence[str]) -> dict[str, Any]:
    area = sum(facade.width_m * facade.height_m for facade in building.facades)
    glass = sum(w.area_m2 for facade in building.facades for w in facade.windows)
    return {
        "id": building.id,
        "storeys": building.storeys,
        "height_m": round(building.height_m, 3),
        "year": building.year,
        "facades": [facade.id for facade in building.facades],
        "wwr": round(glass / area, 5) if area else None,
        "archetype": {"name": kind.name, **asdict(kind)},
        "notes": list(notes),
    }


def write_run(
    workspace: Workspace,
    inputs: StreetInputs,
    clusters: WallClusters,
    missing: Sequence[Missing],
    buildings: Sequence[dict[str, Any]],
    about: Mapping[str, Any],
) -> None:
    """``run.json``: the only file with times and dates."""
    payload = {
        **about,
        "inputs": dict(inputs.hashes),
        "origin": origin_record(inputs.origin),
        "panoramas": [
            {
                "id": panorama.id,
                "captured": panorama.captured,
                "position_in_world": rounded(panorama.centre_in_world, 3),
                "used": any(panorama.id in wall.panorama_ids for wall in clusters.walls),
            }
            for panorama in inputs.panoramas.values()
        ],
        "footprints": [
            {
                "id": footprint.id,
                "outline_in_world": rounded(footprint.outline_in_world, 3),
                "ground_m": footprint.ground_m,
                "height_m": footprint.height_m,
                "storeys": footprint.storeys,
                "year": footprint.year,
            }
            for footprint in inputs.footprints
        ],
        "buildings": list(buildings),
        "missing": [missing_record(row) for row in missing],
        "unassigned": [
            {
                "panorama": plane.panorama_id,
                "plane": plane.plane_index,
                "nearest": plane.nearest,
                "reason": plane.reason,
            }
            for plane in clusters.unassigned
        ],
        "notes": list(inputs.notes),
    }
    workspace.write_json(workspace.run_json, "run", payload)


def simulate_run(
    workspace: Workspace, epw: Path, say: Callable[[str], None] | None = None
) -> SimulationResult:
    """EnergyPlus on the run's model; ``simulation/result.json`` with the heating demand."""
    if not workspace.model.exists():
        raise InputError(
            f"{workspace.root} holds no model.hbjson; run `si3fp street ... -o "
            f"{workspace.root}` first."
        )
    result = simulate(workspace.model, epw, workspace.simulation, progress=say)
    workspace.write_json(workspace.simulation_result, "simulation", result.as_dict())
    return result
