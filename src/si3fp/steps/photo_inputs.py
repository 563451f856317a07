"""What a photo run is given, read and checked before anything long begins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from difflib import get_close_matches
from pathlib import Path

from si3fp.config import PhotoConfig
from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin
from si3fp.model import KnownDistance
from si3fp.sources.colmap_text import ColmapModel, read_colmap_text
from si3fp.sources.footprints import FootprintRecord, read_footprints
from si3fp.sources.photos import PhotoFolder, PhotoRecord, read_photo_records
from si3fp.sources.triangle import read_known_distances
from si3fp.thermal.archetypes import archetype
from si3fp.workspace import key_of, sha256_of

MIN_GPS_PHOTOS = 3
"""Fewer positions give no scale."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotoFiles:
    """What a user gives for a photo run.

    Attributes
    ----------
    folder
        The photos.
    triangle
        Measured distances, or None.
    cameras
        Folder with COLMAP's text files of known cameras, in metres with z up, or None.
    camera_origin
        Where the frame of the known cameras has its zero, its axes east, north and up; or None.
    footprints
        Footprints, or None.
    columns
        Other spellings of the footprints' properties.
    unscaled
        Go on without a scale.
    """

    folder: Path
    triangle: Path | None = None
    cameras: Path | None = None
    camera_origin: GeoOrigin | None = None
    footprints: Path | None = None
    columns: Mapping[str, str] | None = None
    unscaled: bool = False


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PhotoSources:
    """The input of a photo run, read and checked.

    Attributes
    ----------
    records
        The photos.
    unreadable
        Reason by file name of photos that cannot be used.
    distances
        Measured distances.
    cameras
        Known cameras, or None.
    camera_origin
        Origin of their frame, or None.
    outlines
        Footprints as their file gives them.
    unscaled
        Go on without a scale.
    hashes
        SHA-256 of every input file by name and kind.
    """

    records: tuple[PhotoRecord, ...]
    unreadable: Mapping[str, str]
    distances: tuple[KnownDistance, ...]
    cameras: ColmapModel | None
    camera_origin: GeoOrigin | None
    outlines: tuple[FootprintRecord, ...]
    unscaled: bool
    hashes: Mapping[str, str]

    @property
    def positions(self) -> dict[str, tuple[float, float, float | None]]:
        """GPS position by photo id."""
        return {record.id: record.gps for record in self.records if record.gps is not None}


def collect_photos(files: PhotoFiles, config: PhotoConfig) -> PhotoSources:
    """The input of a run, read and checked before anything long begins.

    Raises
    ------
    InputError
        If a file cannot be used, a measured distance or known camera names no photo of the folder,
        options exclude each other, or the thermal tables do not know the country.
    """
    archetype(config.thermal.country, None, config.thermal.default_year)
    _require_compatible(files)
    folder = read_photo_records(files.folder)
    names = [record.id for record in folder.records]
    distances = read_known_distances(files.triangle) if files.triangle else ()
    for distance in distances:
        for name in (distance.start, distance.end):
            _require_photo(name, names, folder.unreadable, f"{files.triangle}: {distance}")
    _require_scale(files, folder)
    cameras = _known_cameras(files.cameras, folder) if files.cameras else None
    outlines = read_footprints(files.footprints, files.columns) if files.footprints else []
    hashes = {f"{record.id} (photo)": sha256_of(record.file) for record in folder.records}
    if files.triangle:
        hashes[f"{files.triangle.name} (distances)"] = sha256_of(files.triangle)
    if files.footprints:
        hashes[f"{files.footprints.name} (footprints)"] = sha256_of(files.footprints)
    for name in ("cameras.txt", "images.txt", "points3D.txt") if files.cameras else ():
        if files.cameras and (files.cameras / name).exists():
            hashes[f"{name} (cameras)"] = sha256_of(files.cameras / name)
    return PhotoSources(
        records=folder.records,
        unreadable=folder.unreadable,
        distances=distances,
        cameras=cameras,
        camera_origin=files.camera_origin,
        outlines=tuple(outlines),
        unscaled=files.unscaled,
        hashes=hashes,
    )


def photo_run_key(
    sources: PhotoSources, files: PhotoFiles, config: PhotoConfig, detector: str, version: str
) -> str:
    """Names a run: the same key means the same results."""
    origin = None if sources.camera_origin is None else asdict(sources.camera_origin)
    return key_of(
        dict(sources.hashes),
        dict(files.columns or {}),
        [origin, sources.unscaled],
        config.as_dict(),
        detector,
        version,
    )


def _require_scale(files: PhotoFiles, folder: PhotoFolder) -> None:
    """Minutes of work must not end with the message that nothing gave the scale."""
    placed = sum(record.gps is not None for record in folder.records)
    if files.triangle or files.cameras or files.unscaled or placed >= MIN_GPS_PHOTOS:
        return
    raise InputError(
        f"The photos of {files.folder} have no scale: {placed} of {len(folder.records)} have GPS, "
        f"{MIN_GPS_PHOTOS} are needed. Give measured distances (--triangle FILE), photos with GPS, "
        "or known cameras (--cameras DIR); or go on without metres (--unscaled), to window-to-wall "
        "ratios and pictures but no thermal model."
    )


def _require_compatible(files: PhotoFiles) -> None:
    if files.unscaled and files.footprints:
        raise InputError(
            "Photos without a scale cannot be laid on footprints: leave out --footprints, or give "
            "measured distances (--triangle) instead of --unscaled."
        )
    if files.unscaled and (files.triangle or files.cameras):
        raise InputError(
            "--unscaled is for photos of which nothing is measured: leave it out beside --triangle "
            "or --cameras."
        )
    if files.camera_origin is not None and files.cameras is None:
        raise InputError("--origin is the origin of known cameras: give them with --cameras DIR.")


def _known_cameras(where: Path, folder: PhotoFolder) -> ColmapModel:
    """The cameras of the photos that can be read, each of its photo's size."""
    model = read_colmap_text(where)
    records = {record.id: record for record in folder.records}
    photos = [photo for photo in model.photos if photo.id not in folder.unreadable]
    for photo in photos:
        _require_photo(photo.id, list(records), folder.unreadable, f"{where}: a camera")
        record, camera = records[photo.id], photo.camera
        if (camera.width_px, camera.height_px) != (record.width_px, record.height_px):
            raise InputError(
                f"{where}: the camera of {photo.id} has {camera.width_px} x {camera.height_px} px, "
                f"the photo {record.width_px} x {record.height_px} px. Give the photos with which "
                "the cameras were found, upright and in the same size."
            )
    return replace(model, photos=tuple(photos))


def _require_photo(name: str, names: list[str], unreadable: Mapping[str, str], where: str) -> None:
    if name in names:
        return
    if name in unreadable:
        raise InputError(f"{where}: the photo {name} cannot be read: {unreadable[name]}")
    near = get_close_matches(name, names, n=1, cutoff=0.0)
    raise InputError(
        f"{where}: there is no photo {name!r} in the folder of photos. Names are file names with "
        f"their ending, such as {near[0]!r}."
    )
