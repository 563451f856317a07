"""`RadianceField`: colour and density in front of one wall, fitted to photos.

Mildenhall et al. 2020 (arXiv:2003.08934) on the hash encoding of Müller et al. 2022
(doi:10.1145/3528223.3530127), written for two CPU cores.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.camera2d.radiance.arrays import Field
from si3fp.camera2d.radiance.layout import FieldLayout, new_field
from si3fp.camera2d.radiance.rays import pack_photos
from si3fp.camera2d.radiance.stopping import FitReport, Progress, train
from si3fp.camera2d.radiance.training import Trainer, run_all
from si3fp.camera2d.radiance.views import render_points, see_points
from si3fp.config import RadianceConfig
from si3fp.errors import InputError
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Image, LoadImage, Photo

OPAQUE_FROM = 0.5
"""A pixel has a depth where at least this share of the light is absorbed."""


@dataclass(frozen=True, slots=True, eq=False)
class OrthoRendering:
    """A field seen along the facade's normal.

    Attributes
    ----------
    rgb
        (H, W, 3) uint8.
    depth_m
        (H, W) metres in front of the plane where half the light is absorbed; NaN where opacity
        is below one half.
    opacity
        (H, W) share of the light absorbed between the near and the far bound.
    """

    rgb: Image
    depth_m: NDArray[np.float32]
    opacity: NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class RadianceField:
    """A fitted field.

    Attributes
    ----------
    world_from_facade
        Pose of the wall; the field lives in frame ``facade``.
    layout, field
        Its boxes and its numbers.
    config
        Constants that it was fitted with.
    report
        How the fit went.
    """

    world_from_facade: Rigid3
    layout: FieldLayout
    field: Field
    config: RadianceConfig
    report: FitReport

    @classmethod
    def fit(
        cls,
        photos: Sequence[Photo],
        load: LoadImage,
        world_from_facade: Rigid3,
        width_m: float,
        height_m: float,
        points_in_world: FloatArray,
        config: RadianceConfig,
        rng: np.random.Generator,
        progress: Progress | None = None,
    ) -> RadianceField:
        """The field that explains what the photos show of a rectangle and in front of it.

        Parameters
        ----------
        photos
            Undistorted photos with metric poses.
        load
            Reads a photo's pixels.
        world_from_facade, width_m, height_m
            The rectangle on the wall plane.
        points_in_world
            (N, 3) points of the reconstruction: what lies in front of the slab starts near them.
        config
            Budget and constants. The same seed gives the same field, bit for bit and for any
            number of threads, unless ``budget_s`` binds or the run is interrupted.
        rng
            Source of randomness.
        progress
            Told the samples done.

        Raises
        ------
        FacadeError
            If fewer than two photos see the rectangle, or the fit breaks down.
        InputError
            If a point is not finite or a photo has the wrong size.

        Notes
        -----
        Ctrl-C ends the training early; the field so far is returned.
        """
        points = np.asarray(points_in_world, dtype=np.float64).reshape(-1, 3)
        if not np.isfinite(points).all():
            raise InputError(
                f"{int((~np.isfinite(points)).any(axis=1).sum())} of {len(points)} points of the "
                "reconstruction are not finite; remove them."
            )
        packed = pack_photos(photos, load, world_from_facade, width_m, height_m, config)
        layout = FieldLayout.around(width_m, height_m, packed.photos.centre.astype(float), config)
        field, network = new_field(layout, config, rng)
        margin = 0.5 * config.margin_m
        bounds = np.array(
            [
                -margin,
                width_m + margin,
                -margin,
                height_m + margin,
                -config.slab_behind_m,
                config.slab_front_m,
                config.near_share,
            ],
            np.float32,
        )
        budget = int(config.samples_per_px * width_m * height_m / config.m_per_px**2)
        trainer = Trainer(
            field,
            network,
            layout,
            packed,
            world_from_facade.inverse().apply(points),
            bounds,
            budget,
            config,
            rng,
        )
        report = train(trainer, progress)
        return cls(world_from_facade, layout, field, config, report)

    def render_ortho(self, grid: FacadeGrid, near_m: float, far_m: float) -> OrthoRendering:
        """The facade on a grid in the field's plane (SI3FP, Algorithm 5).

        One perpendicular ray per pixel centre starts ``near_m`` in front of the plane, so that
        what stands farther out is cut away, and ends ``far_m`` behind it.
        """
        config = self.config
        near = np.float32(min(near_m, config.slab_front_m))
        far = np.float32(min(far_m, config.slab_behind_m))
        step = np.float32(config.step_px * config.m_per_px)
        view = np.array([0, 0, 0, 0, 0, -1], np.float32)
        out = np.empty((grid.height_px, grid.width_px, 5), np.float32)
        columns = np.arange(grid.width_px) + 0.5

        def rows(row: int) -> None:
            pixels = np.stack([columns, np.full(grid.width_px, row + 0.5)], axis=-1)
            foot = self._facade_points(grid, pixels)[:, :2]
            render_points(self.field, foot.astype(np.float32), near, far, step, view, out[row])

        with ThreadPoolExecutor(config.threads) as pool:
            run_all(pool, rows, range(grid.height_px))
        rgb = np.round(255.0 * np.clip(out[..., :3], 0.0, 1.0)).astype(np.uint8)
        opacity = out[..., 3].copy()
        depth = np.where(opacity >= OPAQUE_FROM, out[..., 4], np.float32(np.nan))
        return OrthoRendering(rgb, depth.astype(np.float32), opacity)

    def coverage(
        self,
        photos: Sequence[Photo],
        grid: FacadeGrid,
        depth_m: NDArray[np.float32],
        step_m: float = 0.1,
    ) -> Mapping[str, NDArray[np.bool_]]:
        """Which photos see which part of the rendered surface.

        For each photo a lattice (h, w) that covers the grid with cells of about ``step_m``; True
        where the surface at the centre of the cell projects into the photo and more than half of
        its light reaches the camera, by majority of the 3 x 3 cells around. A cell without depth
        is taken on the plane.
        """
        h, w = (max(1, round(size / step_m)) for size in (grid.height_m, grid.width_m))
        x, y = np.meshgrid((np.arange(w) + 0.5) / w, (np.arange(h) + 0.5) / h)
        pixels = np.stack([x * grid.width_px, y * grid.height_px], axis=-1).reshape(-1, 2)
        row, column = pixels[:, 1].astype(int), pixels[:, 0].astype(int)
        points = self._facade_points(grid, pixels)
        points[:, 2] += np.nan_to_num(depth_m[row, column], nan=0.0)
        in_world = self.world_from_facade.apply(points)

        def seen(photo: Photo) -> NDArray[np.bool_]:
            lattice = self._visible(photo, points, in_world).reshape(h, w)
            # A grain of depth must not hide a cell from its own photo: the cells around it vote.
            return np.asarray(cv2.medianBlur(lattice.view(np.uint8), 3), np.uint8) > 0

        with ThreadPoolExecutor(self.config.threads) as pool:
            return dict(zip((p.id for p in photos), pool.map(seen, photos), strict=True))

    def _visible(self, photo: Photo, points: FloatArray, in_world: FloatArray) -> NDArray[np.bool_]:
        """Whether a photo sees each of the points (N, 3) in frame ``facade``."""
        config = self.config
        pixels = photo.camera.project(photo.cam_from_world.apply(in_world))
        with np.errstate(invalid="ignore"):
            size = [photo.camera.width_px, photo.camera.height_px]
            inside: NDArray[np.bool_] = np.all((pixels >= 0) & (pixels < size), axis=1)
        centre = self.world_from_facade.inverse().apply(photo.centre_in_world)
        inside &= centre[2] > points[:, 2]
        seen = np.zeros(int(inside.sum()), np.bool_)
        steps = np.array([config.front_step_m, config.step_px * config.m_per_px], np.float32)
        see_points(
            self.field,
            centre.astype(np.float32),
            points[inside].astype(np.float32),
            np.float32(config.slab_front_m),
            steps,
            np.float32(config.before_surface_m),
            np.float32(config.near_share),
            seen,
        )
        inside[inside] = seen
        return inside

    def _facade_points(self, grid: FacadeGrid, pixels: FloatArray) -> FloatArray:
        """Points (N, 3) of a grid's plane in frame ``facade`` of the field."""
        return self.world_from_facade.inverse().apply(grid.world_from_pixels(pixels))
