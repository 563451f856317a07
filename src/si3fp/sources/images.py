"""Images from disk: size from the header, pixels, the full 2:1 frame of a panorama, what it shows.

The header is checked before anything is decoded, then OpenCV decodes once: as fast as Pillow with
two thirds of its memory (0.84 and 1.28 GiB at 16384 x 8192, see benchmarks/speed/read_panorama.py).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL.JpegImagePlugin import JpegImageFile
from PIL.PngImagePlugin import PngImageFile

from si3fp.errors import InputError
from si3fp.model import Image
from si3fp.sources.photo_sphere import PanoramaFrame, gpano_properties, panorama_frame

NOT_SEEN_LEVEL = 8
"""Pixels with no channel above this are near-black."""

NOT_SEEN_MARGIN_PX = 8
"""Not seen regions grow by this much: JPEG ringing at their edge."""

_XMP_HEADER = b"http://ns.adobe.com/xap/1.0/\x00"
_EXIF_IFD, _GPS_IFD, _DATE_TIME_ORIGINAL, _ORIENTATION = 0x8769, 0x8825, 0x9003, 0x0112
_MAKE, _MODEL, _FOCAL_LENGTH, _FOCAL_LENGTH_35MM = 0x010F, 0x0110, 0x920A, 0xA405
_END_OF_IMAGE = b"\xff\xd9"
_BAND_PX = 512
_JPEG_FLAGS = {
    1: cv2.IMREAD_COLOR,
    2: cv2.IMREAD_REDUCED_COLOR_2,
    4: cv2.IMREAD_REDUCED_COLOR_4,
    8: cv2.IMREAD_REDUCED_COLOR_8,
}


@dataclass(frozen=True, slots=True)
class ImageHeader:
    """What a JPEG or PNG says about itself before it is decoded.

    Attributes
    ----------
    width_px, height_px
        Size as stored, whatever the orientation.
    gpano
        Photo Sphere properties of a JPEG; empty where there are none.
    gps
        EXIF GPS directory of a JPEG; empty where there is none.
    taken
        EXIF DateTimeOriginal of a JPEG, or "".
    pixels_offset
        Position in the file behind the header.
    orientation
        EXIF orientation of a JPEG, 1 to 8; 1, upright as stored, where there is none.
    camera
        EXIF maker and model of a JPEG, or "".
    focal_mm, focal_35mm
        EXIF focal length of a JPEG, and the one of a 35 mm camera with the same angle of view;
        None where it does not tell.
    """

    width_px: int
    height_px: int
    gpano: Mapping[str, str]
    gps: Mapping[int, Any]
    taken: str
    pixels_offset: int
    orientation: int = 1
    camera: str = ""
    focal_mm: float | None = None
    focal_35mm: float | None = None


def read_header(path: Path) -> ImageHeader:
    """Size and metadata of a JPEG or PNG file, without decoding it.

    Raises
    ------
    InputError
        If the file is missing, empty, of another format, or its header is damaged.
    """
    try:
        with path.open("rb") as stream:
            # The plug-ins are called directly: `PIL.Image.open` tries every format it knows and
            # has a pixel limit of its own, between ours and half of it.
            magic = stream.read(8)
            stream.seek(0)
            if magic.startswith(b"\xff\xd8\xff"):
                return _jpeg_header(JpegImageFile(stream), stream.tell())
            if magic == b"\x89PNG\r\n\x1a\n":
                # Without metadata: Pillow decodes the whole image to look for EXIF behind it.
                return ImageHeader(*PngImageFile(stream).size, {}, {}, "", stream.tell())
            what = "is empty" if not magic else "is neither a JPEG nor a PNG image"
            raise InputError(f"{path} {what}. Copy or export the image again.")
    except FileNotFoundError as error:
        raise InputError(f"There is no image {path}. Correct its path or copy the file.") from error
    except InputError:
        raise
    except (OSError, SyntaxError, ValueError, LookupError, TypeError, struct.error) as error:
        raise InputError(
            f"{path}: the image header cannot be read ({error}). Copy or export the image again."
        ) from error


def _jpeg_header(image: JpegImageFile, pixels_offset: int) -> ImageHeader:
    packets = [data for _, data in image.applist if data.startswith(_XMP_HEADER)]
    exif = image.getexif()
    details = exif.get_ifd(_EXIF_IFD)
    orientation = exif.get(_ORIENTATION, 1)
    return ImageHeader(
        *image.size,
        gpano=gpano_properties(b"".join(packets).decode("utf-8", errors="replace")),
        gps=dict(exif.get_ifd(_GPS_IFD)),
        taken=str(details.get(_DATE_TIME_ORIGINAL, "")).strip("\x00 "),
        pixels_offset=pixels_offset,
        orientation=orientation if orientation in range(1, 9) else 1,
        camera=" ".join(str(exif.get(tag, "")).strip("\x00 ") for tag in (_MAKE, _MODEL)).strip(),
        focal_mm=_length(details.get(_FOCAL_LENGTH)),
        focal_35mm=_length(details.get(_FOCAL_LENGTH_35MM)),
    )


def _length(value: Any) -> float | None:
    """A positive EXIF number; None where the camera wrote none, 0 for unknown, or nonsense."""
    try:
        length = float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return length if 0 < length < math.inf else None


def frame_of(header: ImageHeader, path: Path, max_pixels: int) -> PanoramaFrame:
    """The full frame of a panorama, checked against the size that fits into memory.

    Raises
    ------
    InputError
        If the image is not a 2:1 panorama or a tagged crop of one, or has too many pixels.
    """
    frame = panorama_frame(header.gpano, header.width_px, header.height_px, str(path))
    if frame.full_width_px * frame.full_height_px > max_pixels:
        raise InputError(
            f"{path}: a panorama of {frame.full_width_px} x {frame.full_height_px} px is beyond "
            f"the limit of {max_pixels:,} pixels (16384 x 8192 by default). Scale it down."
        )
    return frame


def load_picture(path: Path, max_pixels: int, least_side_px: int | None = None) -> Image:
    """RGB pixels (H, W, 3) uint8 of a picture as viewers show it: its EXIF orientation is applied.

    Grey, 16 bit and palette images become 8 bit RGB, transparent pixels black.

    Parameters
    ----------
    path
        JPEG or PNG.
    max_pixels
        Limit on W x H, checked before anything is decoded.
    least_side_px
        Decode a JPEG at a half, a quarter or an eighth while the longer side has this many pixels
        left; much faster. In full where left out.

    Raises
    ------
    InputError
        If the file is missing, empty, no image, truncated or too large.
    """
    header = read_header(path)
    if header.width_px * header.height_px > max_pixels:
        raise InputError(
            f"{path}: a picture of {header.width_px} x {header.height_px} px is beyond the limit "
            f"of {max_pixels:,} pixels. Scale it down or cut it."
        )
    longer_px = max(header.width_px, header.height_px)
    divisor = 1
    while least_side_px and divisor < 8 and longer_px >= 2 * divisor * least_side_px:
        divisor *= 2
    pixels = _decode(path, header, divisor)
    if header.orientation >= 5:  # 5 to 8: rows and columns are exchanged
        pixels = pixels.transpose(1, 0, 2)
    if header.orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    if header.orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    return np.ascontiguousarray(pixels)


def load_panorama(path: Path, max_pixels: int) -> Image:
    """RGB pixels (H, W, 3) uint8 of the full 2:1 frame, black where a crop shows nothing.

    Grey, 16 bit and palette images become 8 bit RGB, transparent pixels black.

    Parameters
    ----------
    path
        JPEG or PNG.
    max_pixels
        Limit on W x H, checked before anything is decoded.

    Raises
    ------
    InputError
        If the file is missing, empty, no image, truncated, not 2:1 or too large.
    """
    header = read_header(path)
    frame = frame_of(header, path, max_pixels)
    pixels = _decode(path, header)
    height, width = pixels.shape[:2]
    if (width, height) == (frame.full_width_px, frame.full_height_px):
        return pixels
    full = np.zeros((frame.full_height_px, frame.full_width_px, 3), np.uint8)
    rows = slice(frame.top_px, frame.top_px + height)
    full[rows, frame.left_px : frame.left_px + width] = pixels
    return full


def seen_pixels(image: Image) -> NDArray[np.bool_]:
    """(H, W) bool, False where a panorama shows nothing.

    Not seen are 4-connected near-black regions (no channel above 8) that touch the image border,
    grown by a square of 8 px; dark glass inside the picture is seen. Exact at full resolution.
    """
    height, width = image.shape[:2]
    # A frame of one dark pixel joins all regions that touch the border: one flood finds them. All
    # steps share one buffer, for most of the time goes into touching fresh memory.
    framed = np.full((height + 2, width + 2), 255, np.uint8)
    level = framed[1:-1, 1:-1]
    cv2.inRange(image, np.zeros(3), np.full(3, float(NOT_SEEN_LEVEL)), dst=level)
    cv2.floodFill(framed, None, (0, 0), 1, flags=4)
    seen = level.view(np.bool_)
    np.equal(level, 1, out=seen)
    side = 2 * NOT_SEEN_MARGIN_PX + 1
    cv2.dilate(level, np.ones((side, side), np.uint8), dst=level)
    return np.equal(level, 0, out=seen)


def _decode(path: Path, header: ImageHeader, divisor: int = 1) -> Image:
    """RGB pixels as stored; decoders fill what is missing with grey, so that is checked first."""
    damaged = InputError(
        f"{path}: the image is truncated or damaged and cannot be decoded. "
        "Copy or export it again, or remove it from the list."
    )
    try:
        content = path.read_bytes()
        is_jpeg = content.startswith(b"\xff\xd8")
        # An embedded thumbnail has an end of its own, but inside the header.
        if is_jpeg and content.rfind(_END_OF_IMAGE, header.pixels_offset) < 0:
            raise damaged
        if not is_jpeg:
            with path.open("rb") as stream:
                PngImageFile(stream).verify()
    except (OSError, SyntaxError, ValueError) as error:
        raise damaged from error
    encoded = np.frombuffer(content, np.uint8)
    # The pixels as stored: orientation is for the caller. Only PNG can be transparent.
    size = (header.height_px, header.width_px)
    flags = cv2.IMREAD_UNCHANGED
    if is_jpeg:
        flags = _JPEG_FLAGS[divisor] | cv2.IMREAD_IGNORE_ORIENTATION
        size = (-(-size[0] // divisor), -(-size[1] // divisor))
    try:
        pixels = cv2.imdecode(encoded, flags)
    except cv2.error as error:
        raise damaged from error
    if pixels is None or pixels.shape[:2] != size:
        raise damaged
    return _rgb8(pixels)


def _rgb8(pixels: NDArray[Any]) -> Image:
    """RGB uint8 of OpenCV's grey, BGR or BGRA pixels of 8 or 16 bit; in place where possible."""
    if pixels.dtype == np.uint16:
        pixels = (pixels >> 8).astype(np.uint8)
    if pixels.ndim == 2:
        return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_GRAY2RGB), np.uint8)
    if pixels.shape[2] == 4:
        pixels[pixels[..., 3] == 0] = 0
        return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_BGRA2RGB), np.uint8)
    for top in range(0, len(pixels), _BAND_PX):
        band = pixels[top : top + _BAND_PX]
        band[:] = cv2.cvtColor(band, cv2.COLOR_BGR2RGB)
    return np.asarray(pixels, np.uint8)
