"""A rendered scene in a folder: photos as JPEG, sparse points, the true orthophoto.

``python -m benchmarks.accuracy.radiance.case --variant tuned --seed 0 --cache DIR`` renders it.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from benchmarks.accuracy.radiance.points import sparse_points
from benchmarks.accuracy.radiance.renderer import Renderer, Truth
from benchmarks.accuracy.radiance.scene import VARIANTS, Scene, scene
from benchmarks.accuracy.radiance.solids import Opening
from numpy.typing import NDArray

from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Image, Photo, SparsePoints

JPEG_QUALITY = 95
TRUTH_M_PER_PX = 0.02


@dataclass(frozen=True)
class Case:
    """What a fit may read (photos, load, frame, size, points) and what it is scored against.

    Attributes
    ----------
    photos, load
        Photos with exact poses; ``load(photo.id)`` is RGB uint8.
    world_from_facade, width_m, height_m
        The rectangle to render.
    points
        Made of the photos alone.
    openings
        Truth, in frame facade.
    """

    name: str
    folder: Path
    photos: tuple[Photo, ...]
    world_from_facade: Rigid3
    width_m: float
    height_m: float
    points: SparsePoints
    openings: tuple[Opening, ...]

    def load(self, photo_id: str) -> Image:
        """The pixels of a photo."""
        return np.asarray(cv2.imread(str(self.folder / photo_id))[..., ::-1].copy(), np.uint8)

    def truth(self, m_per_px: float = TRUTH_M_PER_PX) -> Truth:
        """The true orthophoto, rendered once for each size of pixels."""
        path = self.folder / f"truth-{round(1000 * m_per_px)}mm.npz"
        if not path.exists():
            variant, seed = self.name.rsplit("-", 1)
            truth = Renderer(scene(int(seed), variant)).truth(m_per_px)
            sees = np.packbits(truth.sees, axis=0)
            _save(path, rgb=truth.rgb, depth_m=truth.depth_m, sees=sees)
        stored = np.load(path)
        grid = FacadeGrid.covering(self.world_from_facade, self.width_m, self.height_m, m_per_px)
        sees = np.unpackbits(stored["sees"], axis=0, count=len(self.photos)).astype(np.bool_)
        return Truth(grid, stored["rgb"], stored["depth_m"], sees)


def case_in(folder: Path, variant: str, seed: int) -> Case:
    """The case of a folder, rendered first where the folder does not hold it yet."""
    full = scene(seed, variant)
    place = folder / full.name
    place.mkdir(parents=True, exist_ok=True)
    _render_photos(full, place)
    nothing = SparsePoints(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0), ())
    case = Case(
        full.name,
        place,
        full.photos,
        full.world_from_facade,
        full.width_m,
        full.height_m,
        nothing,
        full.openings,
    )
    if not (place / "points.npz").exists():
        _save_points(place / "points.npz", sparse_points(case.photos, case.load), case.photos)
    case.truth()
    return replace(case, points=_read_points(place / "points.npz", case.photos))


def _render_photos(full: Scene, place: Path) -> None:
    missing = [k for k, photo in enumerate(full.photos) if not (place / photo.id).exists()]
    if not missing:
        return
    renderer = Renderer(full)
    for index in missing:
        photo = full.photos[index]
        rgb = renderer.photo(photo, np.random.default_rng([full.seed, index]))
        _, coded = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        (place / photo.id).write_bytes(coded.tobytes())


def _save(path: Path, **arrays: NDArray[np.generic]) -> None:
    partial = path.with_suffix(".partial.npz")
    np.savez_compressed(partial, **arrays)
    partial.replace(path)


def _save_points(path: Path, points: SparsePoints, photos: tuple[Photo, ...]) -> None:
    sees = np.array([[photo.id in ids for photo in photos] for ids in points.photo_ids], np.bool_)
    _save(path, points=points.points_in_world, rgb=points.rgb, error_px=points.error_px, sees=sees)


def _read_points(path: Path, photos: tuple[Photo, ...]) -> SparsePoints:
    stored = np.load(path)
    ids = np.array([photo.id for photo in photos])
    photo_ids = tuple(tuple(ids[row].tolist()) for row in stored["sees"])
    return SparsePoints(stored["points"], stored["rgb"], stored["error_px"], photo_ids)


def add_case_options(parser: argparse.ArgumentParser) -> None:
    """Options ``--variant``, ``--seed`` and ``--cache``."""
    parser.add_argument("--variant", choices=VARIANTS, default="tuned")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--cache",
        type=Path,
        default=Path(tempfile.gettempdir()) / "si3fp-radiance",
        help="folder of the rendered cases",
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add_case_options(parser)
    options = parser.parse_args()
    case = case_in(options.cache, options.variant, options.seed)
    print(f"{case.folder}: {len(case.photos)} photos, {len(case.points)} points")


if __name__ == "__main__":
    main()
