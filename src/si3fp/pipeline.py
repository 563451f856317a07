"""Algorithm 7: from panoramas or photos to a thermal model, step by step of the paper."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import si3fp
from si3fp import steps
from si3fp.camera2d.parts import edge_of, merge_parts
from si3fp.config import PhotoConfig, RunConfig, StreetConfig
from si3fp.errors import ReconstructionError
from si3fp.model import Building, Facade, GeoOrigin, Missing
from si3fp.streetview.cluster import cluster_walls
from si3fp.windows.detect import OnnxDetector
from si3fp.workspace import Workspace


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """What a run ends with; everything is also in its folder.

    Attributes
    ----------
    workspace
        The folder.
    origin
        Origin of the world frame; None where place and north are unknown.
    buildings, loose_facades
        Buildings with their facades, and facades without a building.
    missing
        Facades that failed or were not seen.
    """

    workspace: Workspace
    origin: GeoOrigin | None
    buildings: tuple[Building, ...]
    loose_facades: tuple[Facade, ...]
    missing: tuple[Missing, ...]

    @property
    def failed(self) -> tuple[Missing, ...]:
        """Facades that cameras saw and that failed all the same."""
        return tuple(row for row in self.missing if row.step != "coverage")


def run_street(
    panoramas: Path,
    footprints: Path | None,
    out: Path,
    config: StreetConfig | None = None,
    *,
    circle: steps.Circle | None = None,
    columns: Mapping[str, str] | None = None,
    overwrite: bool = False,
    progress: steps.Progress = lambda step, done, total: None,
) -> Run:
    """The StreetView path: steps S.1 to S.4, M.1 and M.2.

    Parameters
    ----------
    panoramas
        ``PANORAMAS.geojson`` or a folder of Photo Sphere JPEGs.
    footprints
        Footprints, or None: walls then become faces without a building.
    out
        The folder RUN; a run that was cut off goes on where it stopped.
    config
        Constants of the method.
    circle
        Limits the panoramas to a place and radius.
    columns
        Other spellings of the footprints' properties.
    overwrite
        Replace what the folder holds.
    progress
        Told how far each step is.

    Raises
    ------
    InputError, SourceError, ReconstructionError
        If the inputs cannot be used, the disk fails, or no facade is found at all.
    """
    config = config or StreetConfig()
    workspace = Workspace(out)
    started, seconds = datetime.now(UTC), dict[str, float]()
    timed = partial(_timed, seconds=seconds)

    with timed("S.1 collect"):
        inputs = steps.collect(panoramas, footprints, config, circle=circle, columns=columns)
        detector = OnnxDetector()
        key = steps.run_key(inputs, config, detector.fingerprint, si3fp.__version__)
        steps.claim(workspace, key, overwrite)
    with timed("S.2 cluster"):
        clusters = cluster_walls(
            tuple(inputs.panoramas.values()), inputs.footprints, config.cluster
        )
        plans, unseen = steps.plan(inputs, clusters, config)
        missing = [*clusters.missing, *unseen]
    with timed("S.2 views"):
        steps.make_views(inputs, plans, workspace, config, progress)
        steps.write_cloud(inputs, workspace)
    with timed("S.3 align"):
        registered = steps.register_facades(plans, inputs, workspace, config, progress)
    found: list[Facade] = []
    for done, plan in enumerate(plans):
        progress("facades", done, len(plans))
        facade = steps.find_facade(plan, registered, inputs, detector, workspace, config, timed)
        if isinstance(facade, Missing):
            missing.append(facade)
        else:
            found.append(facade)
    progress("facades", len(plans), len(plans))
    with timed("M.2 model"):
        buildings, loose, rows = steps.build_models(
            inputs, found, missing, config.cluster.default_height_m, workspace, config
        )
    about = _about(key, started, seconds, detector, config)
    seen = steps.street_record(inputs, plans, clusters.unassigned)
    steps.write_run(workspace, inputs, missing, rows, about | seen)
    if not found:
        reasons = "; ".join(f"{row.facade_id}: {row.reason}" for row in missing[:5])
        raise ReconstructionError(
            f"No facade was found in {len(inputs.panoramas)} panoramas ({reasons or 'no walls'}). "
            f"{out}/run.json lists every wall; check the poses' datum and the footprints."
        )
    return Run(workspace, inputs.origin, tuple(buildings), tuple(loose), tuple(missing))


def run_photos(
    files: steps.PhotoFiles,
    out: Path,
    config: PhotoConfig | None = None,
    *,
    overwrite: bool = False,
    progress: steps.Progress = lambda step, done, total: None,
) -> Run:
    """The Camera2D path: steps C.2 and C.3, M.1 and M.2.

    Parameters
    ----------
    files
        Photos, what gives them scale and place, and footprints; without footprints walls become
        faces without a building. Without a scale there is no thermal model.
    out
        The folder RUN; a run that was cut off goes on where it stopped.
    config
        Constants of the method.
    overwrite
        Replace what the folder holds.
    progress
        Told how far each step is.

    Raises
    ------
    InputError, SourceError, ReconstructionError
        If the inputs cannot be used, the disk fails, the photos do not connect, nothing gives the
        scale, or no facade is found at all.
    """
    config = config or PhotoConfig()
    workspace = Workspace(out)
    started, seconds = datetime.now(UTC), dict[str, float]()
    timed = partial(_timed, seconds=seconds)

    with timed("C.1 collect"):
        sources = steps.collect_photos(files, config)
        detector = OnnxDetector()
        key = steps.photo_run_key(sources, files, config, detector.fingerprint, si3fp.__version__)
        steps.claim(workspace, key, overwrite)
    with timed("C.2 poses"):
        poses = steps.find_poses(sources, workspace, config, progress)
    with timed("C.2 scale and walls"):
        scene = steps.make_scene(sources, poses, config)
        steps.write_sparse_cloud(scene, workspace)
        missing = [*scene.found.missing]
    found: list[Facade] = []
    for done, plane in enumerate(scene.planes):
        progress("facades", done, len(scene.planes))
        facade = steps.find_photo_facade(plane, scene, detector, workspace, config, timed, progress)
        if isinstance(facade, Missing):
            missing.append(facade)
        else:
            found.append(facade)
    progress("facades", len(scene.planes), len(scene.planes))
    buildings: list[Building] = []
    loose: list[Facade] = []
    rows: list[dict[str, Any]] = []
    if scene.metric:
        with timed("M.2 model"):
            buildings, loose, rows = steps.build_models(
                scene,
                merge_parts(found),
                _by_edge(missing, found),
                config.planes.default_height_m,
                workspace,
                config,
            )
    about = _about(key, started, seconds, detector, config)
    steps.write_run(workspace, scene, missing, rows, about | steps.photos_record(scene))
    if not found:
        reasons = "; ".join(f"{row.facade_id}: {row.reason}" for row in missing[:5])
        raise ReconstructionError(
            f"No facade was found in {len(scene.photos)} photos ({reasons or 'no walls'}). "
            f"{out}/run.json lists every wall; `si3fp photos --check` tells which photos to add."
        )
    return Run(
        workspace,
        scene.origin,
        tuple(buildings),
        tuple(loose) if scene.metric else tuple(found),
        tuple(missing),
    )


def _by_edge(missing: Sequence[Missing], found: Sequence[Facade]) -> list[Missing]:
    """Rows of edges of which no part was found: a bay that failed does not hide its wall."""
    there = {edge_of(facade.id) for facade in found}
    return [row for row in missing if edge_of(row.facade_id) not in there]


def _about(
    key: str,
    started: datetime,
    seconds: Mapping[str, float],
    detector: OnnxDetector,
    config: RunConfig,
) -> dict[str, Any]:
    """What ``run.json`` says of the run itself."""
    return {
        "key": key,
        "started": started.isoformat(timespec="seconds"),
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "seconds": {step: round(value, 2) for step, value in seconds.items()},
        "detector": {"name": detector.name, "sha256": detector.sha256},
        "config": config.as_dict(),
    }


@contextmanager
def _timed(step: str, seconds: dict[str, float]) -> Iterator[None]:
    start = time.monotonic()
    yield
    seconds[step] = seconds.get(step, 0.0) + time.monotonic() - start
