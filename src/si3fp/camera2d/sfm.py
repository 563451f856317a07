"""C.2: cameras, poses and points from photos, by COLMAP in a process of its own.

The work folder keeps what is finished: features and matches in COLMAP's database, then the models.
A run that was stopped goes on there; a changed photo or setting starts anew.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from si3fp.camera2d.colmap_job import Progress, run_job
from si3fp.camera2d.sfm_verdict import SfmResult, judge
from si3fp.config import SfmConfig
from si3fp.errors import InputError, ReconstructionError
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Photo

_ORIENTATION = 0x0112  # EXIF
_FOCAL_FACTOR = 1.2  # of the longer side, where EXIF tells nothing; COLMAP's
_DIAGONAL_35MM = 43.267  # mm


@dataclass(frozen=True, slots=True)
class PhotoFile:
    """A photo to reconstruct from, and what its EXIF tells.

    Attributes
    ----------
    id
        Name of the file in the folder of photos; its pixels are upright as they are.
    camera
        Maker and model, or "".
    focal_px
        Focal length (`focal_from_35mm`), or None.
    position_m
        Where it was taken, in any metric frame, or None; it only proposes which photos to match.
    """

    id: str
    camera: str = ""
    focal_px: float | None = None
    position_m: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if self.focal_px is not None and not 0 < self.focal_px < np.inf:
            raise InputError(f"{self.id}: a focal length of {self.focal_px} px cannot be.")
        if self.position_m is not None and not np.isfinite(self.position_m).all():
            raise InputError(f"{self.id}: its position {self.position_m} is not finite.")


def focal_from_35mm(focal_35mm: float, width_px: int, height_px: int) -> float:
    """Focal length in pixels of one given for 35 mm film with the same diagonal angle of view.

    Examples
    --------
    >>> round(focal_from_35mm(28.0, 4000, 3000))
    3236
    """
    return float(focal_35mm / _DIAGONAL_35MM * np.hypot(width_px, height_px))


def reconstruct(
    folder: Path,
    photos: Sequence[PhotoFile],
    work_dir: Path,
    config: SfmConfig | None = None,
    *,
    seed: int = 0,
    progress: Progress = lambda step, done, total: None,
) -> SfmResult:
    """Poses, cameras and points of photos, up to a similarity.

    Photos of one size, camera and focal length share one camera of COLMAP's model SIMPLE_RADIAL,
    whose focal length and distortion are refined.

    Parameters
    ----------
    folder
        Folder with the photos' files.
    photos
        In the order in which they were taken.
    work_dir
        Folder for the database, the models (`SfmModel.folder`) and the log ``process.log``; it
        belongs to this function.
    config
        Constants; the defaults where left out.
    seed
        Of everything random. The same photos and settings give the same files bit for bit on one
        machine as long as `SfmConfig.mapper_threads` is 1.
    progress
        Told about the steps ``pairs``, ``features``, ``matches`` and ``cameras``.

    Raises
    ------
    InputError
        If no photo can be read, one is not upright, or the mapper is unknown.
    SourceError
        If ``work_dir`` cannot be written.
    ReconstructionError
        If fewer than three photos can be connected, or COLMAP's process fails.
    """
    config = config or SfmConfig()
    if config.mapper not in ("incremental", "global"):
        raise InputError(f"The mapper is incremental or global, got {config.mapper!r}.")
    sources, lost = _read_sources(folder, [photo.id for photo in photos])
    usable = [photo for photo in photos if photo.id in sources]
    groups: dict[tuple[Any, ...], int] = {}
    entries = []
    for photo in usable:
        width, height, sha256 = sources[photo.id]
        key = (width, height, photo.camera, photo.focal_px)
        group = groups.setdefault(key, len(groups))
        entries.append({"name": photo.id, "sha256": sha256, "camera": group})
    cameras = [_camera(width, height, focal) for width, height, _, focal in groups]
    job = {
        "photos": entries,
        "cameras": cameras,
        "places": [photo.position_m for photo in usable],
    }
    report = run_job(folder, work_dir, job, config, seed, progress)
    return judge([photo.id for photo in usable], report, lost, work_dir / "models", config)


def triangulate_known(
    folder: Path,
    photos: Sequence[Photo],
    distortion: Mapping[str, FloatArray],
    work_dir: Path,
    config: SfmConfig | None = None,
    *,
    seed: int = 0,
    progress: Progress = lambda step, done, total: None,
) -> Path:
    """Folder with COLMAP's text files of photos with known cameras, and points of what they see.

    Parameters
    ----------
    folder
        Folder with the photos' files, named as their ids, with lens distortion.
    photos
        Cameras and poses, which stay as they are.
    distortion
        By photo id k1, k2, p1, p2 of OpenCV; zero where left out.
    work_dir, config, seed, progress
        As for `reconstruct`.

    Raises
    ------
    InputError
        If a photo cannot be read, is not upright or has another size than its camera.
    ReconstructionError
        If the photos do not match each other, or not their cameras.
    """
    config = config or SfmConfig()
    sources, lost = _read_sources(folder, [photo.id for photo in photos])
    if lost:
        raise InputError("\n".join(f"{folder / name}: {why}" for name, why in lost.items()))
    cameras, entries, poses = [], [], []
    for number, photo in enumerate(photos):
        width, height, sha256 = sources[photo.id]
        camera = photo.camera
        if (width, height) != (camera.width_px, camera.height_px):
            raise InputError(
                f"{folder / photo.id} has {width} x {height} px, its camera {camera.width_px} x "
                f"{camera.height_px}. Give the photos from which the cameras were computed."
            )
        lens = distortion.get(photo.id, np.zeros(4)).tolist()
        intrinsics = [camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px, *lens]
        cameras.append(_colmap_camera("OPENCV", width, height, intrinsics, known=True))
        entries.append({"name": photo.id, "sha256": sha256, "camera": number})
        pose = photo.cam_from_world
        poses.append(np.column_stack([pose.rotation, pose.translation]).tolist())
    job = {"photos": entries, "cameras": cameras, "poses": poses}
    report = run_job(folder, work_dir, job, config, seed, progress)
    (model,) = report["models"]
    if model["points"] < len(photos) or model["agreeing"] < 0.5:
        raise ReconstructionError(
            f"The {len(photos)} known cameras do not fit their photos: {model['points']} points, "
            f"and of the matches of two photos {model['agreeing']:.0%} agree with the cameras "
            "(median). Check that cameras and photos belong together and that nothing was resized, "
            "cropped or renamed; or leave out --cameras to compute new ones."
        )
    return work_dir / "models" / "0"


def _read_sources(
    folder: Path, names: Sequence[str]
) -> tuple[dict[str, tuple[int, int, str]], dict[str, str]]:
    """Width, height and hash of each file, and why others cannot be read."""
    sources, lost = {}, {}
    for name in names:
        try:
            content = (folder / name).read_bytes()
            with Image.open(BytesIO(content)) as picture:
                orientation = picture.getexif().get(_ORIENTATION, 1)
                width, height = picture.size
        except FileNotFoundError:
            lost[name] = f"is not in {folder}"
            continue
        except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
            lost[name] = "cannot be read as a picture; copy it again"
            continue
        if orientation not in (0, 1):
            raise InputError(f"{folder / name} is turned by its EXIF; give upright pixels.")
        sources[name] = (width, height, hashlib.sha256(content).hexdigest())
    if not sources:
        raise InputError(f"No photo of {folder} can be read. {next(iter(lost.values()), '')}")
    return sources, lost


def _camera(width: int, height: int, focal_px: float | None) -> dict[str, Any]:
    known = focal_px is not None
    focal = focal_px if focal_px is not None else _FOCAL_FACTOR * max(width, height)
    return _colmap_camera(
        "SIMPLE_RADIAL", width, height, [focal, width / 2, height / 2, 0.0], known
    )


def _colmap_camera(
    model: str, width: int, height: int, params: list[float], known: bool
) -> dict[str, Any]:
    return {
        "model": model,
        "width": width,
        "height": height,
        "params": params,
        "has_prior_focal_length": known,
    }
