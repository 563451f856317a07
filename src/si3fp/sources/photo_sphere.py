"""Photo Sphere metadata: pose and crop of a panorama from XMP ``GPano:*`` and EXIF GPS.

XMP is read with a pattern for attributes and elements, not with an XML parser: entities are never
expanded. Properties as in Google's Photo Sphere XMP specification.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from si3fp.errors import InputError

MAX_ASPECT_ERROR = 1e-3
"""Share of the width by which 2 x height may differ from it (rounding of stitchers)."""

_MAX_XMP_CHARACTERS = 1 << 20
_ATTRIBUTE = re.compile(r"""GPano:(\w{1,64})\s{0,8}=\s{0,8}["']([^"'<]{0,256})["']""")
_ELEMENT = re.compile(r"<GPano:(\w{1,64})>([^<]{0,256})</GPano:")
_GPS_LAT_REF, _GPS_LAT, _GPS_LON_REF, _GPS_LON, _GPS_HEIGHT_REF, _GPS_HEIGHT = range(1, 7)


@dataclass(frozen=True, slots=True)
class PanoramaFrame:
    """Where the stored image lies in the full 360 x 180 degree image.

    Attributes
    ----------
    full_width_px, full_height_px
        Size of the full image in the pixels of the stored one.
    left_px, top_px
        Upper left corner of the stored image in the full one.
    """

    full_width_px: int
    full_height_px: int
    left_px: int = 0
    top_px: int = 0


def gpano_properties(xmp: str) -> dict[str, str]:
    """The ``GPano`` properties of an XMP packet, attributes and elements alike.

    Examples
    --------
    >>> gpano_properties('<rdf:Description GPano:PoseHeadingDegrees="0.0"/>')
    {'PoseHeadingDegrees': '0.0'}
    """
    text = xmp[:_MAX_XMP_CHARACTERS]
    return {
        name: value.strip()
        for pattern in (_ATTRIBUTE, _ELEMENT)
        for name, value in pattern.findall(text)
    }


def panorama_frame(
    properties: Mapping[str, str], width_px: int, height_px: int, name: str
) -> PanoramaFrame:
    """The full 2:1 frame of an image of this size.

    Where the properties declare a crop, it decides; an image that was resized after it was tagged
    is scaled. Otherwise the image itself must be twice as wide as high.

    Raises
    ------
    InputError
        If the image is not 2:1 and no crop says why, or the crop does not fit the image.
    """
    projection = properties.get("ProjectionType", "equirectangular")
    if projection.lower() != "equirectangular":
        raise InputError(f"{name}: the projection is {projection!r}; export it as equirectangular.")
    if "CroppedAreaImageWidthPixels" not in properties:
        _require_two_to_one(width_px, height_px, name)
        return PanoramaFrame(width_px, height_px)
    full_width = _pixels(properties, "FullPanoWidthPixels", name, least=1)
    full_height = _pixels(properties, "FullPanoHeightPixels", name, least=1)
    crop_width = _pixels(properties, "CroppedAreaImageWidthPixels", name, least=1)
    crop_height = _pixels(properties, "CroppedAreaImageHeightPixels", name, least=1)
    left = _pixels(properties, "CroppedAreaLeftPixels", name, least=0)
    top = _pixels(properties, "CroppedAreaTopPixels", name, least=0)
    _require_two_to_one(full_width, full_height, name)
    if left + crop_width > full_width or top + crop_height > full_height:
        raise InputError(
            f"{name}: the cropped area {crop_width} x {crop_height} at ({left}, {top}) leaves the "
            f"full panorama {full_width} x {full_height}; correct the GPano metadata."
        )
    scale = width_px / crop_width
    if abs(crop_height * scale - height_px) > max(1.0, MAX_ASPECT_ERROR * width_px):
        raise InputError(
            f"{name}: the image is {width_px} x {height_px}, but its GPano metadata speaks of a "
            f"crop of {crop_width} x {crop_height}; correct or remove the metadata."
        )
    # Rounding must not push the stored image out of the frame.
    frame_width = max(width_px, round(full_width * scale))
    frame_height = max(height_px, round(full_height * scale))
    return PanoramaFrame(
        frame_width,
        frame_height,
        min(round(left * scale), frame_width - width_px),
        min(round(top * scale), frame_height - height_px),
    )


def photo_sphere_row(
    properties: Mapping[str, str], gps: Mapping[int, Any], taken: str, name: str
) -> dict[str, Any]:
    """Pose and date as `read_panorama_records` checks them: the columns of a panorama file.

    Parameters
    ----------
    properties
        ``GPano`` properties; PoseHeadingDegrees is needed, pitch and roll default to 0.
    gps
        The GPS directory of the EXIF data.
    taken
        EXIF DateTimeOriginal ``YYYY:MM:DD hh:mm:ss`` or "".
    name
        The file, for messages.

    Raises
    ------
    InputError
        If heading, position or height is missing.
    """
    if "PoseHeadingDegrees" not in properties:
        raise InputError(
            f"{name}: no Photo Sphere heading (XMP GPano:PoseHeadingDegrees). Export the panorama "
            "with its metadata, or list the images with their poses in a panoramas GeoJSON."
        )
    for tag, what in ((_GPS_LAT, "latitude"), (_GPS_LON, "longitude"), (_GPS_HEIGHT, "altitude")):
        if tag not in gps:
            raise InputError(
                f"{name}: no {what} in the EXIF GPS data. Export the panorama with its position, "
                "or list the images with their poses in a panoramas GeoJSON."
            )
    below_sea_level = gps.get(_GPS_HEIGHT_REF) in (1, b"\x01", 3, b"\x03")
    height = _number(gps[_GPS_HEIGHT])
    return {
        "lat_deg": _degrees(gps[_GPS_LAT], gps.get(_GPS_LAT_REF) == "S"),
        "lon_deg": _degrees(gps[_GPS_LON], gps.get(_GPS_LON_REF) == "W"),
        "height_m": -height if below_sea_level else height,
        "heading_deg": properties["PoseHeadingDegrees"],
        "pitch_deg": properties.get("PosePitchDegrees", 0.0),
        "roll_deg": properties.get("PoseRollDegrees", 0.0),
        # EXIF writes blanks or zeros where the camera's clock was not set.
        "captured": taken[:10].replace(":", "-") if taken.strip(" :0") else "",
    }


def _require_two_to_one(width_px: int, height_px: int, name: str) -> None:
    if abs(width_px - 2 * height_px) > MAX_ASPECT_ERROR * width_px:
        raise InputError(
            f"{name}: a full equirectangular panorama is twice as wide as high, got "
            f"{width_px} x {height_px} px. Export the full 360 x 180 degree image, or tag the crop "
            "with GPano:CroppedArea* metadata."
        )


def _pixels(properties: Mapping[str, str], key: str, name: str, *, least: int) -> int:
    got = properties.get(key, "missing")
    if not got.isdecimal() or len(got) > 6 or int(got) < least:
        raise InputError(
            f"{name}: GPano:{key} is {got!r}, expected a whole number of pixels >= {least}."
        )
    return int(got)


def _number(value: Any) -> float:
    """A plain number; NaN for what is none (an EXIF rational may have denominator 0)."""
    try:
        return float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return math.nan


def _degrees(parts: Any, negative: bool) -> float:
    """Degrees of EXIF's degrees, minutes, seconds; NaN where they are damaged."""
    if not isinstance(parts, tuple | list) or len(parts) != 3:
        return math.nan
    degrees, minutes, seconds = (_number(part) for part in parts)
    total = degrees + minutes / 60 + seconds / 3600
    return -total if negative else total
