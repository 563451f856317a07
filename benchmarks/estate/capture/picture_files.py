"""Pictures and records on disk: written whole under a temporary name, then renamed."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.estate.capture.walk import FOCAL_35MM
from benchmarks.estate.plan import Light
from numpy.typing import NDArray
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

JPEG_QUALITY = 92
SENSOR_DIAGONAL_MM = 12.2
_MAKE, _MODEL, _EXIF, _GPS = 0x010F, 0x0110, 0x8769, 0x8825
_TAKEN, _FOCAL, _FOCAL_35MM = 0x9003, 0x920A, 0xA405


def written_whole(path: Path, write: Callable[[Path], None]) -> None:
    """The file or folder ``path``, made by ``write`` under another name: all of it or nothing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.stem}.part{path.suffix}")
    write(partial)
    partial.replace(path)


def write_json(path: Path, content: Any) -> None:
    """The content as JSON, indented by one."""
    write_text(path, json.dumps(content, indent=1) + "\n")


def write_text(path: Path, text: str) -> None:
    """The text in UTF-8."""
    written_whole(path, lambda partial: _as_utf8(partial, text))


def _as_utf8(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def write_jpeg(path: Path, rgb: NDArray[np.uint8], exif: Image.Exif | None = None) -> None:
    """The picture as a JPEG of quality 92."""
    extra: dict[str, Any] = {} if exif is None else {"exif": exif}
    image = Image.fromarray(rgb)
    written_whole(path, lambda partial: image.save(partial, quality=JPEG_QUALITY, **extra))


def write_png(path: Path, picture: NDArray[Any]) -> None:
    """The picture as a PNG: RGB, or one bit per pixel where it is boolean."""
    image = Image.fromarray(picture)
    written_whole(path, lambda partial: image.save(partial, optimize=picture.dtype == bool))


def write_array(path: Path, array: NDArray[Any]) -> None:
    """The array as ``.npy``."""
    written_whole(path, lambda partial: np.save(partial, array))


def photo_exif(
    number: int, light: Light, gps: tuple[float, float, float] | None = None
) -> Image.Exif:
    """What a phone writes: maker, focal length, the time (ten seconds a photo), its position."""
    exif = Image.Exif()
    exif[_MAKE], exif[_MODEL] = "si3fp", "estate"
    taken = datetime.fromisoformat(light.date) + timedelta(hours=light.hour_utc)
    taken += timedelta(seconds=10 * number)
    focal_mm = FOCAL_35MM * SENSOR_DIAGONAL_MM / 43.267
    exif[_EXIF] = {
        _TAKEN: taken.strftime("%Y:%m:%d %H:%M:%S"),
        _FOCAL: IFDRational(round(focal_mm * 100), 100),
        _FOCAL_35MM: round(FOCAL_35MM),
    }
    if gps is not None:
        lat_deg, lon_deg, height_m = gps
        exif[_GPS] = {
            1: "N" if lat_deg >= 0 else "S",
            2: _sexagesimal(lat_deg),
            3: "E" if lon_deg >= 0 else "W",
            4: _sexagesimal(lon_deg),
            5: b"\x00" if height_m >= 0 else b"\x01",
            6: IFDRational(round(abs(height_m) * 100), 100),
        }
    return exif


def _sexagesimal(degrees: float) -> tuple[IFDRational, IFDRational, IFDRational]:
    hundredths = round(abs(degrees) * 3600 * 10000)
    minutes, seconds = divmod(hundredths, 60 * 10000)
    whole, minutes = divmod(minutes, 60)
    return IFDRational(whole, 1), IFDRational(minutes, 1), IFDRational(seconds, 10000)
