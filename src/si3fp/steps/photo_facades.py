"""C.3 and M.1 with their files: one wall of a photo run becomes a facade or a `Missing` row."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any

import numpy as np

from si3fp.camera2d.facade_plane import FacadePlane
from si3fp.camera2d.mosaic import MosaicRendering, render_mosaic
from si3fp.camera2d.render import RenderedFacade, facade_grid
from si3fp.config import FacadeBoxConfig, OrthoConfig, PhotoConfig
from si3fp.errors import FacadeError, InputError
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Facade, FacadeViews, Missing
from si3fp.records import facade_from_records
from si3fp.steps.facade_files import place_of_view, write_facade
from si3fp.steps.photo_scene import PhotoScene
from si3fp.steps.rectified import Progress
from si3fp.streetview.facade_box import FacadeBox, PriorBox, find_facade_box
from si3fp.streetview.orthophoto import FacadeOrthophoto
from si3fp.streetview.views import moved_to
from si3fp.windows.detect import WindowDetector
from si3fp.windows.parse import ParsedFacade, parse_facade
from si3fp.windows.parse_rendered import parse_rendered
from si3fp.workspace import Workspace, read_json

Timed = Callable[[str], AbstractContextManager[None]]


def find_photo_facade(
    plane: FacadePlane,
    scene: PhotoScene,
    detector: WindowDetector,
    workspace: Workspace,
    config: PhotoConfig,
    timed: Timed,
    progress: Progress,
) -> Facade | Missing:
    """C.3 and M.1 of one wall, with its files; a failure is a `Missing` row.

    The photos are first blended on the wall's plane (`si3fp.camera2d.mosaic`): the borders of the
    facade are found there. The radiance field then renders what lies between them.
    """
    name = plane.facade_id
    if not workspace.facade(name, "facade.json").exists():
        step = "render"
        try:
            with timed("C.3 mosaic"):
                wide = _with_margin(plane, scene, config.ortho)
                mosaic = _mosaic(plane, wide, scene, config, progress)
            step = "facade_box"
            with timed("S.4 facade"):
                rng = np.random.default_rng([config.seed, *name.encode()])
                prior = _prior(plane, config.ortho)
                box = find_facade_box(mosaic.views.views, wide, prior, _box(plane, config), rng)
                photo = _cropped(mosaic, box, wide)
            rendered: RenderedFacade | None = None
            if config.renderer == "radiance":
                step = "render"
                # numba takes long to load, and every other verb goes without it.
                from si3fp.camera2d.radiance_facade import render_radiance  # noqa: PLC0415

                with timed("C.3 radiance"):
                    rendered = render_radiance(
                        plane,
                        photo.views.grid,
                        tuple(scene.photos.values()),
                        scene.load,
                        scene.planes,
                        scene.points,
                        config.mosaic,
                        config.radiance,
                        rng,
                        progress,
                    )
            step = "windows"
            with timed("M.1 windows"):
                photo, parsed = _parsed(photo, rendered, scene, detector, config)
        except (FacadeError, InputError) as error:
            return Missing(name, step, str(error))
        with timed("write"):
            about = _about(plane, photo, rendered, scene)
            # The poses of the photos depend on all of them.
            write_facade(name, photo, parsed, about, scene.hashes, scene, workspace, config)
    return facade_from_records(
        read_json(workspace.facade(name, "facade.json")),
        read_json(workspace.facade(name, "windows.json")),
    )


def _with_margin(plane: FacadePlane, scene: PhotoScene, config: OrthoConfig) -> FacadeGrid:
    """The wall's grid with a margin on all sides, so that its borders can be moved."""
    seeing = [scene.photos[name] for name in plane.photo_ids] or list(scene.photos.values())
    m_per_px = facade_grid(plane, seeing, config.m_per_px).m_per_px
    corner = plane.world_from_facade.apply([-config.margin_m, -config.margin_m, 0.0])
    return FacadeGrid.covering(
        Rigid3(plane.world_from_facade.rotation, corner),
        plane.width_m + 2 * config.margin_m,
        plane.height_m + config.margin_m + config.headroom_m,
        m_per_px,
    )


def _mosaic(
    plane: FacadePlane,
    grid: FacadeGrid,
    scene: PhotoScene,
    config: PhotoConfig,
    progress: Progress,
) -> MosaicRendering:
    return render_mosaic(
        plane,
        grid,
        tuple(scene.photos.values()),
        scene.load,
        scene.planes,
        scene.points,
        config.mosaic,
        progress,
    )


def _box(plane: FacadePlane, config: PhotoConfig) -> FacadeBoxConfig:
    """How sure the borders are before the pictures are asked."""
    if plane.building_id is None:
        return config.facade_box
    return replace(config.facade_box, eaves_sigma_m=config.mapped_eaves_sigma_m)


def _prior(plane: FacadePlane, config: OrthoConfig) -> PriorBox:
    return PriorBox(
        left_m=config.margin_m,
        right_m=config.margin_m + plane.width_m,
        bottom_m=config.margin_m,
        top_m=config.margin_m + plane.height_m,
    )


def _cropped(mosaic: MosaicRendering, box: FacadeBox, wide: FacadeGrid) -> FacadeOrthophoto:
    """The mosaic between the facade's borders."""
    left, bottom = wide.pixels_from_facade([box.left_m, box.bottom_m]).round().astype(int)
    right, top = wide.pixels_from_facade([box.right_m, box.top_m]).round().astype(int)
    rows = slice(max(top, 0), min(bottom, wide.height_px))
    columns = slice(max(left, 0), min(right, wide.width_px))
    grid = wide.cropped(columns.start, rows.start, columns.stop, rows.stop)
    shift = grid.world_from_facade.inverse() @ wide.world_from_facade
    return FacadeOrthophoto(
        FacadeViews(
            mosaic.views.facade_id,
            grid,
            tuple(moved_to(view, rows, columns) for view in mosaic.views.views),
        ),
        moved_to(mosaic.fused, rows, columns),
        box,
        {name: shift.apply(centre) for name, centre in mosaic.cameras_in_facade.items()},
    )


def _parsed(
    photo: FacadeOrthophoto,
    rendered: RenderedFacade | None,
    scene: PhotoScene,
    detector: WindowDetector,
    config: PhotoConfig,
) -> tuple[FacadeOrthophoto, ParsedFacade]:
    """The picture that M.1 reads, and its windows."""
    grid = photo.views.grid
    if rendered is None:
        return photo, parse_facade(
            photo.views,
            photo.fused,
            photo.cameras_in_facade,
            detector,
            config.fusion,
            config.measure,
        )
    facade_from_world = grid.world_from_facade.inverse()
    cameras = {
        name: facade_from_world.apply(scene.photos[name].centre_in_world)
        for name in rendered.seen_from
    }
    picture = FacadeOrthophoto(photo.views, rendered.ortho, photo.box, cameras)
    parsed = parse_rendered(
        rendered.ortho,
        cameras,
        rendered.seen_from,
        detector,
        config.fusion,
        config.measure,
        grid,
    )
    return picture, parsed


def _about(
    plane: FacadePlane,
    photo: FacadeOrthophoto,
    rendered: RenderedFacade | None,
    scene: PhotoScene,
) -> Mapping[str, Any]:
    notes = [*plane.notes]
    if rendered is not None:
        notes += rendered.notes
        if rendered.held_out_psnr_db is not None:
            notes.append(
                f"a photo left out is predicted with {rendered.held_out_psnr_db:.1f} dB PSNR"
            )
    if not scene.metric:
        notes.append("no scale: lengths are nominal, ratios are true")
    return {
        "building_id": plane.building_id,
        "edge": plane.edge_index,
        "renderer": "mosaic" if rendered is None else "radiance",
        "held_out_psnr_db": None if rendered is None else rendered.held_out_psnr_db,
        "views": [
            {"source": name, "used": True, "reason": "", **place_of_view(name, photo)}
            for name in photo.cameras_in_facade
        ],
        "corners_in_world": plane.corners_in_world.round(4).tolist(),
        "notes": notes,
    }
