"""Photos of a building from a folder: what their headers tell, and their pixels upright."""

from __future__ import annotations

import math
import os
import shutil
import threading
from collections import Counter, OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2

from si3fp.config import CaptureConfig
from si3fp.errors import InputError, SourceError
from si3fp.model import Image, LoadImage
from si3fp.sources.images import load_picture, read_header

_SUFFIXES = frozenset({".jpg", ".jpeg", ".png"})
_MIN_PHOTOS = 3
_LISTED = 5
_CACHE_BYTES = 512 * 1024 * 1024
_UPRIGHT_QUALITY = 97
_LAT_REF, _LAT, _LON_REF, _LON, _HEIGHT_REF, _HEIGHT, _, _, _STATUS = range(1, 10)


@dataclass(frozen=True, slots=True)
class PhotoRecord:
    """A photo as its file describes it.

    Attributes
    ----------
    id
        File name; unique in the folder, also without its ending and in lower case.
    file
        JPEG or PNG.
    width_px, height_px
        Size upright, as viewers show it.
    orientation
        EXIF orientation, 1 to 8; 1 is upright as stored.
    camera
        Maker and model by EXIF, or "".
    focal_mm, focal_35mm
        Focal length by EXIF, and the one of a 35 mm camera with the same angle of view; or None.
    captured
        ``YYYY-MM-DD``, or "".
    gps
        Latitude and longitude in degrees (WGS 84), height in metres or None; None without GPS.
    """

    id: str
    file: Path
    width_px: int
    height_px: int
    orientation: int = 1
    camera: str = ""
    focal_mm: float | None = None
    focal_35mm: float | None = None
    captured: str = ""
    gps: tuple[float, float, float | None] | None = None


@dataclass(frozen=True, slots=True)
class PhotoFolder:
    """The photos of a folder.

    Attributes
    ----------
    records
        Those that can be read, by name.
    unreadable
        Reason by file name of the others.
    """

    records: tuple[PhotoRecord, ...]
    unreadable: Mapping[str, str]


def read_photo_records(folder: Path, max_pixels: int = CaptureConfig().max_pixels) -> PhotoFolder:
    """The photos of a folder by name, three or more; each is decoded once, at reduced size.

    Parameters
    ----------
    folder
        JPEG or PNG files; hidden files, other files and folders in it are ignored.
    max_pixels
        Limit on the size of one photo.

    Raises
    ------
    InputError
        If ``folder`` is no folder, fewer than three photos can be read, or two names differ in
        case or ending only.
    """
    files = _photo_files(folder)
    records: list[PhotoRecord] = []
    unreadable: dict[str, str] = {}
    for file in files:
        try:
            records.append(_record(file, max_pixels))
        except InputError as error:
            unreadable[file.name] = str(error).removeprefix(str(file)).lstrip(": ")
    if len(records) < _MIN_PHOTOS:
        failed = [f"{name}: {reason}" for name, reason in unreadable.items()]
        raise InputError(
            f"The folder {folder} holds {len(records)} photos that can be read, {_MIN_PHOTOS} are "
            f"needed and some 20 are good. {_listed(failed, ' ')}".rstrip()
        )
    return PhotoFolder(tuple(records), unreadable)


def photo_loader(
    records: Sequence[PhotoRecord],
    undistort: Callable[[str, Image], Image],
    *,
    max_pixels: int = CaptureConfig().max_pixels,
    cache_bytes: int = _CACHE_BYTES,
) -> LoadImage:
    """A function from a photo's id to its RGB pixels, upright and free of distortion, read-only.

    It may be called from several threads. The photos used last are kept while they fit.

    Parameters
    ----------
    records
        The photos.
    undistort
        Takes the lens distortion out of the upright pixels of a photo.
    max_pixels
        Limit on the size of one photo.
    cache_bytes
        Memory for the photos that are kept.
    """
    files = {record.id: record.file for record in records}
    kept: OrderedDict[str, Image] = OrderedDict()
    lock = threading.Lock()

    def load(photo_id: str) -> Image:
        if photo_id not in files:
            raise InputError(f"There is no photo {photo_id!r} among the {len(files)} read.")
        with lock:
            if photo_id in kept:
                kept.move_to_end(photo_id)
                return kept[photo_id]
        pixels = undistort(photo_id, load_picture(files[photo_id], max_pixels))
        pixels.flags.writeable = False
        with lock:
            kept[photo_id] = pixels
            kept.move_to_end(photo_id)
            while kept and sum(image.nbytes for image in kept.values()) > cache_bytes:
                kept.popitem(last=False)
        return pixels

    return load


def prepare_upright(
    records: Sequence[PhotoRecord], folder: Path, max_pixels: int = CaptureConfig().max_pixels
) -> None:
    """Fill a folder of the run's own with the photos upright, each named by its id.

    Photos that are upright as stored are linked, or copied where the disk knows no links; turned
    ones are written again. Files that are there already and not older than their photo stay; files
    that are no photo of ``records`` are removed.

    Raises
    ------
    InputError
        If ``folder`` is where the photos are, or a photo cannot be decoded.
    SourceError
        If a file cannot be written.
    """
    if any(record.file.resolve().parent == folder.resolve() for record in records):
        raise InputError(f"{folder} holds the photos themselves; prepare them in another folder.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        wanted = {record.id for record in records}
        for file in folder.iterdir():
            if file.is_file() and file.name not in wanted:
                file.unlink()
        for record in records:
            _prepare(record, folder / record.id, max_pixels)
    except OSError as error:
        raise SourceError(
            f"Could not write upright photos to {folder}: {error}. Free some space or choose "
            "another place for the run."
        ) from error


def _prepare(record: PhotoRecord, upright: Path, max_pixels: int) -> None:
    if upright.exists() and (
        upright.samefile(record.file) or upright.stat().st_mtime >= record.file.stat().st_mtime
    ):
        return
    partial = upright.with_name(f".{upright.name}.part")
    partial.unlink(missing_ok=True)
    if record.orientation == 1:
        try:
            os.link(record.file, partial)
        except OSError:  # another disk, or one without links
            shutil.copyfile(record.file, partial)
    else:
        pixels = cv2.cvtColor(load_picture(record.file, max_pixels), cv2.COLOR_RGB2BGR)
        _, encoded = cv2.imencode(
            upright.suffix, pixels, [cv2.IMWRITE_JPEG_QUALITY, _UPRIGHT_QUALITY]
        )
        partial.write_bytes(encoded.tobytes())
    partial.replace(upright)


def _photo_files(folder: Path) -> list[Path]:
    if not folder.exists():
        raise InputError(f"There is no folder {folder}. Give the folder that holds the photos.")
    if not folder.is_dir():
        raise InputError(f"{folder} is a file. Give the folder that holds the photos.")
    inside = sorted(p for p in folder.iterdir() if p.is_file() and not p.name.startswith("."))
    files = [file for file in inside if file.suffix.lower() in _SUFFIXES]
    if not files:
        others = Counter(file.suffix.lower() or "no ending" for file in inside).most_common(3)
        found = f" ({', '.join(f'{n} x {suffix}' for suffix, n in others)})" if others else ""
        raise InputError(
            f"The folder {folder} holds no JPEG or PNG photo{found}. Export the photos as JPEG in "
            "full size."
        )
    names: dict[str, list[str]] = {}
    for file in files:
        names.setdefault(file.stem.lower(), []).append(file.name)
    twins = [" and ".join(same) for same in names.values() if len(same) > 1]
    if twins:
        raise InputError(
            f"In the folder {folder} the names of photos differ in case or ending only: "
            f"{_listed(twins, '; ')}. Remove or rename one of each."
        )
    return files


def _record(file: Path, max_pixels: int) -> PhotoRecord:
    header = read_header(file)
    if "ProjectionType" in header.gpano:
        raise InputError(f"{file}: is a panorama, not a photo. Use it with `si3fp street`.")
    load_picture(file, max_pixels, least_side_px=1)  # shows what is truncated
    size = (header.width_px, header.height_px)
    width_px, height_px = size[::-1] if header.orientation >= 5 else size
    return PhotoRecord(
        id=file.name,
        file=file,
        width_px=width_px,
        height_px=height_px,
        orientation=header.orientation,
        camera=header.camera,
        focal_mm=header.focal_mm,
        focal_35mm=header.focal_35mm,
        # EXIF writes blanks or zeros where the camera's clock was not set.
        captured=header.taken[:10].replace(":", "-") if header.taken.strip(" :0") else "",
        gps=_position(header.gps),
    )


def _position(gps: Mapping[int, Any]) -> tuple[float, float, float | None] | None:
    """Position of an EXIF GPS directory; None where the receiver had none or wrote nonsense."""
    lat_deg = _degrees(gps.get(_LAT), gps.get(_LAT_REF) == "S")
    lon_deg = _degrees(gps.get(_LON), gps.get(_LON_REF) == "W")
    on_earth = abs(lat_deg) <= 90 and abs(lon_deg) <= 180  # False for NaN
    if not on_earth or gps.get(_STATUS) == "V" or (lat_deg == 0 and lon_deg == 0):
        return None
    height_m = _number(gps.get(_HEIGHT))
    below_sea_level = gps.get(_HEIGHT_REF) in (1, b"\x01", 3, b"\x03")
    if not math.isfinite(height_m):
        return lat_deg, lon_deg, None
    return lat_deg, lon_deg, -height_m if below_sea_level else height_m


def _degrees(parts: Any, negative: bool) -> float:
    if not isinstance(parts, tuple | list) or len(parts) != 3:
        return math.nan
    degrees, minutes, seconds = (_number(part) for part in parts)
    total = degrees + minutes / 60 + seconds / 3600
    return -total if negative else total


def _number(value: Any) -> float:
    """A plain number; NaN for what is none (an EXIF rational may have denominator 0)."""
    try:
        return float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return math.nan


def _listed(texts: Sequence[str], separator: str) -> str:
    more = f"{separator}and {len(texts) - _LISTED} more" if len(texts) > _LISTED else ""
    return separator.join(texts[:_LISTED]) + more
