"""The pictures of an estate as tasks: what each costs, which file it becomes, how it is made."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from benchmarks.estate.capture import picture_files as files
from benchmarks.estate.capture.cameras import Equirect, LensCamera, Orthographic, Pose
from benchmarks.estate.capture.drive import towards_buildings
from benchmarks.estate.capture.lens import photographed
from benchmarks.estate.capture.truth import facade_grid, facades_of, seen_on
from benchmarks.estate.capture.walk import lens_camera, photo_lens, positions
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.meshes.building_meshes import building_parts
from benchmarks.estate.parts import Parts
from benchmarks.estate.plan import Building, Estate
from benchmarks.estate.rendering.renderer import Renderer
from benchmarks.estate.site.surroundings import surroundings_parts

from si3fp.model import Facade

Say = Callable[[str], None]

SEEN_M_PER_PX = 0.1
STANDOFF_M = 0.8  # beyond whatever stands out of a wall
VIGNETTING = 0.2
SHARE_SEEN = 0.1  # of a panorama, roughly: for the time left


@dataclass(frozen=True)
class Size:
    """How many pictures of how many pixels, and the paths traced for each pixel.

    ``most_per_facade`` panoramas see a facade well at most; ``photos`` are taken around every
    building, ``flight`` from the air if any are.
    """

    panorama_px: int
    most_per_facade: int
    photo_px: int
    photos: int
    flight: int
    samples: int
    ortho_m_per_px: float = 0.02
    m_per_texel: float = 0.01


SIZES = {
    "small": Size(3072, 9, 1024, 60, 10, 6),
    "full": Size(8192, 12, 1600, 100, 40, 6),
}


@dataclass(frozen=True)
class Task:
    """One thing to make: its kind, what it costs (rays), the file that is there when it is done."""

    kind: str
    cost: float
    file: Path
    make: Callable[[], None]


class Pictures:
    """All pictures of an estate; its scenes are built when first needed, one at a time."""

    def __init__(
        self,
        estate: Estate,
        folder: Path,
        size: Size,
        panoramas: dict[str, Pose],
        photos: dict[str, Pose],
        *,
        variant: str | None = None,
        say: Say = lambda line: None,
    ) -> None:
        self._estate, self._folder, self._size = estate, folder, size
        self._panoramas, self._photos = panoramas, photos
        self._variant, self._say = variant, say
        self._scene: tuple[str, Renderer] | None = None

    def of_panoramas(self) -> Iterator[Task]:
        """``panoramas/<name>.jpg``, black where no target building lies."""
        cost = SHARE_SEEN * self._size.panorama_px**2 / 2 * self._size.samples
        for name in self._panoramas:
            path = self._folder / "panoramas" / f"{name}.jpg"
            yield Task("panoramas", cost, path, partial(self._take, name, path))

    def of_photos(self) -> Iterator[Task]:
        """``photos/<name>``, with what a phone writes into their headers."""
        cost = 0.75 * self._size.photo_px**2 * self._size.samples
        for name in self._photos:
            path = self._folder / "photos" / name
            yield Task("photos", cost, path, partial(self._take, name, path))

    def of_truth(self) -> Iterator[Task]:
        """``truth/seen/<camera>/<facade>.png``, then ``truth/ortho/<facade>.png`` and ``.npy``."""
        estate = self._estate
        facades = [(b, edge, f) for b in estate.buildings for edge, f in enumerate(facades_of(b))]
        all_m2 = sum(facade.width_m * facade.height_m for _, _, facade in facades)
        for name in (*self._panoramas, *self._photos):
            path = self._folder / "truth" / "seen" / Path(name).stem
            yield Task("masks", all_m2 / SEEN_M_PER_PX**2, path, partial(self._mask, name, path))
        for building, edge, facade in facades:
            path = self._folder / "truth" / "ortho" / f"{facade.id}.png"
            pixels = facade.width_m * facade.height_m / self._size.ortho_m_per_px**2
            make = partial(self._flatten, building, edge, facade, path)
            yield Task("orthophotos", pixels * self._size.samples, path, make)

    def _camera(self, name: str) -> Equirect | LensCamera:
        if name in self._photos:
            return lens_camera(self._photos[name], photo_lens(self._size.photo_px))
        pose, width_px = self._panoramas[name], self._size.panorama_px
        seen = towards_buildings(self._estate, pose, width_px)
        return Equirect(pose.world_from_cam, width_px, seen)

    def _take(self, name: str, path: Path) -> None:
        camera = self._camera(name)
        rendered = self._renderer(bare=False).render(
            camera, self._size.samples, self._path_seed(name)
        )
        exif = None
        if name in self._photos:
            number = list(self._photos).index(name)
            gps = positions({name: self._photos[name]}, self._estate)[name]
            exif = files.photo_exif(number, self._estate.light, gps)
        picture = photographed(
            rendered.radiance,
            rendered.seen,
            self._sensor(name),
            vignetting=VIGNETTING if name in self._photos else 0.0,
        )
        files.write_jpeg(path, picture, exif)

    def _mask(self, name: str, path: Path) -> None:
        camera, visible = self._camera(name), self._renderer(bare=False).visible
        unfinished = path.with_name(f".{path.name}.part")
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir(parents=True)
        for building in self._estate.buildings:
            for facade in facades_of(building):
                seen = seen_on(facade_grid(facade, SEEN_M_PER_PX), camera, visible)
                if seen.any():
                    files.write_png(unfinished / f"{facade.id}.png", seen)
        unfinished.replace(path)

    def _flatten(self, building: Building, edge: int, facade: Facade, path: Path) -> None:
        """The orthophoto of a facade with nothing in front, and how far things stand out of it."""
        camera = Orthographic(
            facade_grid(facade, self._size.ortho_m_per_px), _standoff_m(building, edge)
        )
        rendered = self._renderer(bare=True).render(
            camera, self._size.samples, self._path_seed(facade.id)
        )
        depth_m = (camera.standoff_m - rendered.depth_m).astype(np.float32)
        depth_m[~np.isfinite(depth_m)] = np.nan
        files.write_array(path.with_suffix(".npy"), depth_m)
        clean = {"vignetting": 0.0, "exposure_jitter_ev": 0.0, "noise": 0.0}
        sensor = self._sensor(facade.id)
        picture = photographed(rendered.radiance, rendered.seen, sensor, **clean)
        files.write_png(path, picture)

    def _renderer(self, *, bare: bool) -> Renderer:
        """The scene, or without what stands in front of the buildings."""
        name = "the buildings alone" if bare else "the estate"
        if self._scene is not None and self._scene[0] == name:
            return self._scene[1]
        self._scene = None  # frees the other one
        start = time.monotonic()
        estate, parts = self._estate, Parts()
        if bare:
            estate = replace(estate, neighbours=(), trees=(), hedges=(), cars=(), lamps=())
        for building in estate.buildings:
            parts.add(building_parts(building, estate.seed, m_per_texel=self._size.m_per_texel))
        parts.add(surroundings_parts(estate))
        renderer = Renderer(parts, estate.light, estate.origin, self._variant)
        self._scene = name, renderer
        faces = sum(len(mesh.faces) for mesh in parts.meshes)
        self._say(f"{name}: {faces:,} triangles in {time.monotonic() - start:.0f} s")
        return renderer

    def _path_seed(self, name: str) -> int:
        return int(rng_of(self._estate.seed, "paths", name).integers(1 << 31))

    def _sensor(self, name: str) -> np.random.Generator:
        return rng_of(self._estate.seed, "sensor", name)


def _standoff_m(building: Building, edge: int) -> float:
    """How far before a wall its orthophoto begins: beyond balconies, pipes and the eaves."""
    wall = building.walls[edge]
    balconies = [each.depth_m for each in wall.balconies if each.kind != "loggia"]
    ornaments = [each.out_m + each.gap_m for each in wall.ornaments]
    return STANDOFF_M + max([*balconies, *ornaments, building.roof.overhang_m])
