"""Algorithms 1 and 3 with their files: which views are made, and every view once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from si3fp.config import StreetConfig
from si3fp.model import Missing
from si3fp.sources.images import seen_pixels
from si3fp.sources.local import image_loader
from si3fp.steps.inputs import StreetInputs
from si3fp.streetview.cloud import cloud_stride, coloured_points, ply_bytes
from si3fp.streetview.cluster import WallClusters
from si3fp.streetview.views import ViewPlan, make_view, plan_views
from si3fp.workspace import (
    Workspace,
    read_array,
    write_array,
    write_bytes,
    write_png,
)

Progress = Callable[[str, int, int], None]
"""Called with the name of a step, how much of it is done, and how much there is."""

PARALLEL_PIXELS = 8192 * 4096
"""Panoramas up to this size are decoded two at a time; larger ones would not fit in memory."""


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
            continue
        reason = "no panorama of the chosen capture date sees it"
        if names:
            reason = (
                f"all panoramas that see it ({len(names)}) do so at more than "
                f"{config.ortho.max_obliqueness_deg:g} degrees to its normal"
            )
        missing.append(Missing(wall.facade_id, "coverage", reason))
    return plans, missing


def make_views(
    inputs: StreetInputs,
    plans: Sequence[ViewPlan],
    workspace: Workspace,
    config: StreetConfig,
    progress: Progress,
) -> None:
    """Algorithms 1 and 3: every view as a file; each panorama is decoded once, for all walls.

    Facades that are finished, and a cloud that is written, need no views and points any more.
    """
    stride = cloud_stride(list(inputs.panoramas.values()), config.cluster)
    open_plans = [
        p for p in plans if not workspace.facade(p.wall.facade_id, "facade.json").exists()
    ]
    has_cloud = workspace.cloud.exists()
    load = image_loader(list(inputs.records.values()), config.collect.max_pixels)

    def work(name: str) -> None:
        mine = [p for p in open_plans if name in p.panorama_ids]
        todo = [p for p in mine if not workspace.raw_view(p.wall.facade_id, name).exists()]
        points_file = workspace.points(name)
        needs_points = not (has_cloud or points_file.exists())
        if not todo and not needs_points:
            return
        image = load(name)
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
        if needs_points:
            points, colours = coloured_points(panorama, image, stride)
            write_array(points_file, np.column_stack([points, colours]).astype(np.float32))

    names = list(inputs.panoramas)
    large = max(r.width_px * r.height_px for r in inputs.records.values()) > PARALLEL_PIXELS
    with ThreadPoolExecutor(1 if large else 2) as pool:
        progress("views", 0, len(names))
        for done, _ in enumerate(pool.map(work, names), start=1):
            progress("views", done, len(names))


def write_cloud(inputs: StreetInputs, workspace: Workspace) -> None:
    """The paper's coloured points of all panoramas as ``cloud.ply``, unless it is there."""
    if workspace.cloud.exists():
        return
    parts = [read_array(workspace.points(name)) for name in inputs.panoramas]
    points = np.concatenate(parts)
    write_bytes(
        workspace.cloud, ply_bytes(points[:, :3].astype(np.float64), points[:, 3:].astype(np.uint8))
    )
