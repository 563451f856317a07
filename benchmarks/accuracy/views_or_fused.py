"""Which detections to believe: of the single views (Algorithm 6), of the fused image, or of both.

``python -m benchmarks.accuracy.views_or_fused RUN TRUTH [RUN TRUTH ...]`` takes finished runs of
`si3fp street` and their truth (an HBJSON, or ``tests/data/castle_truth.json``), fuses the
detections of the runs again in three ways, with and without the refinement of edges, and prints
one table for each and one for all.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from si3fp.blend import blend
from si3fp.config import FusionConfig, MeasureConfig
from si3fp.evaluate import Evaluation, evaluate, facades_from_hbjson
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Detections, Facade, GeoOrigin, OrthoImage, Window
from si3fp.ortho import wall_resolution
from si3fp.records import facade_from_records
from si3fp.windows.detect import OnnxDetector
from si3fp.windows.fuse import FusedDetections, combine, fuse_views
from si3fp.windows.join import join_openings
from si3fp.windows.measure import measure_windows
from si3fp.windows.parse import of_label
from si3fp.windows.recess import estimate_recess
from si3fp.windows.refine import refine_boxes
from si3fp.workspace import Workspace, read_json, read_png, safe_name

WAYS = ("views", "fused", "both")


@dataclass(frozen=True)
class Parsed:
    """What a run kept of one facade."""

    facade: Facade
    grid: FacadeGrid
    fused: OrthoImage
    views: tuple[OrthoImage, ...]
    per_view: dict[str, Detections]
    on_fused: Detections
    cameras: dict[str, np.ndarray]


def facades_of(run: Path) -> Iterator[Parsed]:
    workspace = Workspace(run)
    places = {
        row["id"]: np.array(row["position_in_world"])
        for row in read_json(workspace.run_json)["panoramas"]
    }
    for name in workspace.facade_ids():
        about = read_json(workspace.facade(name, "facade.json"))
        found = read_json(workspace.facade(name, "detections.json"))
        facade = facade_from_records(about, read_json(workspace.facade(name, "windows.json")))
        used = [view["source"] for view in about["views"] if view["used"]]
        views = tuple(_image(v, workspace.facade(name, f"views/{safe_name(v)}.png")) for v in used)
        cameras = {v: facade.world_from_facade.inverse().apply(places[v]) for v in used}
        grid = FacadeGrid(facade.world_from_facade, *about["grid_px"], about["m_per_px"])
        # ortho.png shows windows at the depth of their glass; edges are sought on the wall.
        fused = blend(views, [_resolution(grid, cameras[v]) for v in used])
        per_view = {view: _detections(rows) for view, rows in found["views"].items()}
        yield Parsed(facade, grid, fused, views, per_view, _detections(found["fused"]), cameras)


def truth_of(path: Path) -> tuple[GeoOrigin | None, list[Facade]]:
    content = json.loads(path.read_text())
    if path.suffix == ".hbjson":
        return facades_from_hbjson(content)
    facades = []
    for name, facade in content["facades"].items():
        pose = facade["world_from_facade"]
        windows = tuple(
            Window(w["x_m"], w["y_m"], w["width_m"], w["height_m"]) for w in facade["windows"]
        )
        frame = Rigid3(np.array(pose["rotation"]), np.array(pose["translation"]))
        facades.append(Facade(name, frame, facade["width_m"], facade["height_m"], windows))
    return GeoOrigin(**content["origin"]), facades


def windows_by(
    way: str, parsed: Parsed, threshold: float, measure: MeasureConfig
) -> tuple[Window, ...]:
    fusion = FusionConfig()
    nothing = Detections(np.zeros((0, 4)), np.zeros(0), np.zeros(0, np.str_))
    agreed = fuse_views({name: of_label(d) for name, d in parsed.per_view.items()}, fusion)
    on_fused = of_label(parsed.on_fused)
    if way == "views":
        together = agreed
    else:
        together = combine(
            agreed if way == "both" else fuse_views({}, fusion), on_fused, parsed.views, fusion
        )
        sure = np.flatnonzero(together.detections.scores >= threshold)
        together = join_openings(together.select(sure), parsed.fused, parsed.grid.m_per_px, measure)
    refined: FusedDetections = refine_boxes(together, parsed.fused, parsed.grid.m_per_px, measure)
    recesses = estimate_recess(
        refined.detections.boxes_px, parsed.views, parsed.cameras, parsed.grid.m_per_px, measure
    )
    return measure_windows(refined, nothing, parsed.grid, parsed.cameras, measure, recesses)


def _resolution(grid: FacadeGrid, camera: np.ndarray) -> np.ndarray:
    columns, rows = np.arange(grid.width_px) + 0.5, np.arange(grid.height_px) + 0.5
    x = grid.facade_from_pixels(np.stack([columns, columns * 0], axis=-1))[:, 0]
    y = grid.facade_from_pixels(np.stack([rows * 0, rows], axis=-1))[:, 1]
    return np.asarray(
        wall_resolution(x[None] - camera[0], y[:, None] - camera[1], camera[2]), np.float32
    )


def _image(source: str, path: Path) -> OrthoImage:
    pixels = read_png(path)
    return OrthoImage(source, np.ascontiguousarray(pixels[..., :3]), pixels[..., 3] == 255)


def _detections(rows: Mapping[str, Any]) -> Detections:
    return Detections(
        np.array(rows["boxes_px"]), np.array(rows["scores"]), np.array(rows["labels"], np.str_)
    )


def _row(way: str, refine: bool, results: list[Evaluation]) -> str:
    hits = sum(r.windows.true_positives for r in results)
    wrong = sum(r.windows.false_positives for r in results)
    missed = sum(r.windows.false_negatives for r in results)
    matches = [m for r in results for f in r.facades for m in f.matches]

    def mean(name: str) -> float:
        return float(np.mean([abs(getattr(match, name)) for match in matches]))

    precision, recall = hits / max(hits + wrong, 1), hits / max(hits + missed, 1)
    return (
        f"| {way} | {'yes' if refine else 'no'} | {precision:.3f} | {recall:.3f} "
        f"| {2 * hits / max(2 * hits + wrong + missed, 1):.3f} | {mean('iou'):.3f} "
        f"| {mean('relative_area_error'):.3f} | {mean('position_error_m'):.3f} |"
    )


def main() -> None:
    runs = [Path(word) for word in sys.argv[1::2]]
    truths = [truth_of(Path(word)) for word in sys.argv[2::2]]
    parsed = [list(facades_of(run)) for run in runs]
    origins = [GeoOrigin(**read_json(Workspace(run).run_json)["origin"]) for run in runs]
    threshold = OnnxDetector().thresholds["window"]
    results: dict[tuple[str, bool], list[Evaluation]] = {}
    for way in WAYS:
        for refine in (False, True):
            measure = MeasureConfig(refine=refine)
            results[way, refine] = [
                evaluate(
                    [
                        replace(p.facade, windows=windows_by(way, p, threshold, measure))
                        for p in facades
                    ],
                    true,
                    origin,
                    true_origin,
                )
                for facades, origin, (true_origin, true) in zip(
                    parsed, origins, truths, strict=True
                )
            ]
    for index, name in [*enumerate(map(str, runs)), (None, "all")]:
        print(f"\n{name}\n")
        print("| detections of | refined | P | R | F1 | mean IoU | area error | position m |")
        print("|---|---|---|---|---|---|---|---|")
        for (way, refine), each in results.items():
            print(_row(way, refine, each if index is None else [each[index]]))


if __name__ == "__main__":
    main()
