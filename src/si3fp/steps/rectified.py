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

    load = image_loader(list(inputs.records.values()), config.collect.max_pixels)

    def work(name: str) -> None:
        mine = [p for p in plans if name in p.panorama_ids]
        todo = [p for p in mine if not workspace.raw_view(p.wall.facade_id, name).exists()]
        points_file = workspace.points(name)
        if not todo and points_file.exists():
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
