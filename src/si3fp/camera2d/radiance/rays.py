"""Photos packed for training: cut to the facade, shrunk to its pixel size, one array of pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.camera2d.radiance.arrays import I64, Photos
from si3fp.config import RadianceConfig
from si3fp.errors import FacadeError, InputError
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import LoadImage, Photo

LATTICE = 33
"""Points per side that stand for the rectangle when its outline in a photo is found."""


@dataclass(frozen=True, slots=True, eq=False)
class _Cut:
    """What is kept of one photo: a box of its pixels (x0, y0, x1, y1), shrunk by ``shrink``."""

    photo: Photo
    cam_from_facade: Rigid3
    box_px: tuple[int, int, int, int]
    shrink: float
    seen: int

    def size_px(self, shrink: float) -> tuple[int, int]:
        x0, y0, x1, y1 = self.box_px
        return max(1, round((x1 - x0) / shrink)), max(1, round((y1 - y0) / shrink))


@dataclass(frozen=True, slots=True, eq=False)
class TrainingPhotos:
    """Pixels and rays of several photos, and the one photo that is held out.

    Attributes
    ----------
    photos
        All photos packed; the held-out one is the last if there is one.
    ids
        Their ids, in order.
    held_out
        Whether the last photo is held out of the training.
    """

    photos: Photos
    ids: tuple[str, ...]
    held_out: bool

    @property
    def end(self) -> int:
        """Number of pixels to train on."""
        return int(self.photos.first[-1]) if self.held_out else len(self.photos.pixels)

    def draw(self, rng: np.random.Generator, number: int) -> I64:
        """Random pixels (number, 3): photo, column, row."""
        return self._locate(rng.integers(0, self.end, number))

    def draw_held_out(self, rng: np.random.Generator, number: int) -> I64:
        """Random pixels (number, 3) of the held-out photo."""
        return self._locate(rng.integers(self.end, len(self.photos.pixels), number))

    def _locate(self, index: NDArray[np.int64]) -> I64:
        photo = np.searchsorted(self.photos.first, index, side="right") - 1
        row, column = np.divmod(index - self.photos.first[photo], self.photos.width[photo])
        return np.stack([photo, column, row], axis=1)


def pack_photos(
    photos: Sequence[Photo],
    load: LoadImage,
    world_from_facade: Rigid3,
    width_m: float,
    height_m: float,
    config: RadianceConfig,
) -> TrainingPhotos:
    """The pixels that look at a rectangle of the facade plane.

    A photo is averaged down until its pixel is as large as the orthophoto's, never enlarged; all
    are averaged down further where they would exceed ``config.photos_mib``. With
    ``config.min_photos_to_hold_out`` photos or more, the one that sees most is held out.

    Raises
    ------
    FacadeError
        If fewer than two photos see the rectangle.
    InputError
        If a loaded photo has another size than its camera says.
    """
    cuts = [
        cut
        for photo in photos
        if (cut := _cut(photo, world_from_facade, width_m, height_m, config)) is not None
    ]
    if len(cuts) < 2:
        raise FacadeError(
            f"{len(cuts)} of {len(photos)} photos see the wall of {width_m:.1f} x {height_m:.1f} m "
            "from in front; a radiance field needs at least two. Add photos of this wall."
        )
    held_out = len(cuts) >= config.min_photos_to_hold_out
    if held_out:
        best = max(range(len(cuts)), key=lambda i: (cuts[i].seen, -i))
        cuts.append(cuts.pop(best))

    bytes_needed = sum(3 * np.prod(cut.size_px(cut.shrink), dtype=float) for cut in cuts)
    more = max(1.0, float(np.sqrt(bytes_needed / (config.photos_mib * 2**20))))
    sizes = [cut.size_px(cut.shrink * more) for cut in cuts]
    counts = [width * height for width, height in sizes]
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    pixels = np.empty((int(first[-1]), 3), np.uint8)
    centre, direction = [], []
    for cut, size, start, end in zip(cuts, sizes, first[:-1], first[1:], strict=True):
        pixels[start:end] = _pixels(cut, size, load).reshape(-1, 3)
        facade_from_cam = cut.cam_from_facade.inverse()
        centre.append(facade_from_cam.translation)
        direction.append(facade_from_cam.rotation @ _ray_matrix(cut, size))
    packed = Photos(
        np.array(centre, np.float32),
        np.array(direction, np.float32),
        np.ones((len(cuts), 3), np.float32),
        pixels,
        first[:-1].copy(),
        np.array([width for width, _ in sizes], np.int64),
    )
    return TrainingPhotos(packed, tuple(cut.photo.id for cut in cuts), held_out)


def _cut(
    photo: Photo,
    world_from_facade: Rigid3,
    width_m: float,
    height_m: float,
    config: RadianceConfig,
) -> _Cut | None:
    """The part of a photo that shows the rectangle, or None if it sees nothing of its front."""
    cam_from_facade = photo.cam_from_world @ world_from_facade
    if cam_from_facade.inverse().translation[2] < config.min_standoff_m:
        return None
    x, y = np.meshgrid(np.linspace(0, width_m, LATTICE), np.linspace(0, height_m, LATTICE))
    points = cam_from_facade.apply(np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3))
    camera = photo.camera
    pixels = camera.project(points)
    size = np.array([camera.width_px, camera.height_px])
    with np.errstate(invalid="ignore"):
        inside: NDArray[np.bool_] = np.all((pixels >= 0) & (pixels < size), axis=1)
    if inside.sum() < config.min_seen * len(inside):
        return None
    # One lattice step more on each side: the outline lies between the points.
    border = np.ceil(size / LATTICE)
    x0, y0 = np.maximum(np.floor(pixels[inside].min(axis=0) - border), 0).astype(int)
    x1, y1 = np.minimum(np.ceil(pixels[inside].max(axis=0) + border), size).astype(int)
    m_per_px = float(np.median(points[inside, 2])) / camera.fx_px
    shrink = max(1.0, config.m_per_px / m_per_px)
    return _Cut(photo, cam_from_facade, (x0, y0, x1, y1), shrink, int(inside.sum()))


def _pixels(cut: _Cut, size: tuple[int, int], load: LoadImage) -> NDArray[np.uint8]:
    """The kept pixels (height, width, 3)."""
    image = load(cut.photo.id)
    camera = cut.photo.camera
    expected = (camera.height_px, camera.width_px, 3)
    if image.shape != expected or image.dtype != np.uint8:
        raise InputError(
            f"Photo {cut.photo.id} is {image.shape} {image.dtype}, its camera says {expected} "
            "uint8; give the undistorted picture that belongs to the camera."
        )
    x0, y0, x1, y1 = cut.box_px
    box = image[y0:y1, x0:x1]
    if size == (x1 - x0, y1 - y0):
        return np.ascontiguousarray(box)
    return np.asarray(cv2.resize(box, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _ray_matrix(cut: _Cut, size: tuple[int, int]) -> FloatArray:
    """(3, 3) ray in frame ``cam`` of a kept pixel (x, y, 1), z = 1."""
    x0, y0, x1, y1 = cut.box_px
    camera = cut.photo.camera
    step_x, step_y = (x1 - x0) / size[0], (y1 - y0) / size[1]
    return np.array(
        [
            [step_x / camera.fx_px, 0.0, (x0 - camera.cx_px) / camera.fx_px],
            [0.0, step_y / camera.fy_px, (y0 - camera.cy_px) / camera.fy_px],
            [0.0, 0.0, 1.0],
        ]
    )
