"""Plane maps in Street View's wire format: which plane every pixel of a panorama shows.

URL-safe base64 without padding of little-endian bytes::

    u8 header size (8), u16 planes, u16 width, u16 height, u8 offset (8)
    width x height u8 plane indices in image order, 0 = no plane
    planes x four float32: nx, ny, nz, d

with ``n . x = d``, ``d >= 0``, in the plane frame x right, y forward, z up. Plane 0 is all zero
and stands for "none".
"""

from __future__ import annotations

import base64
import binascii
import struct

import numpy as np
from numpy.typing import NDArray

from si3fp.errors import InputError
from si3fp.geometry.planes import Planes
from si3fp.geometry.rigid import FloatArray

MAX_PLANES = 255
"""Planes without the zero plane that one byte per pixel can name."""

_HEADER = struct.Struct("<BHHHB")
_FLOATS_PER_PLANE = 4
_MEND = "Export or download the plane map again, or remove it from the panorama's `depth`."


def pano_from_plane_frame(vectors: FloatArray) -> FloatArray:
    """Vectors (..., 3) in frame ``pano`` of vectors (..., 3) in the plane frame of the format.

    ``pano`` is x right, y down, z forward; the plane frame x right, y forward, z up.
    """
    return np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], axis=-1)


def decode_plane_map(text: str | bytes, name: str) -> tuple[Planes, NDArray[np.int32]]:
    """Planes in frame ``pano`` and the index of the plane at every pixel.

    Parameters
    ----------
    text
        The encoded plane map.
    name
        What the error messages call it, usually the file.

    Returns
    -------
    planes
        Normals point from the camera into the wall, offsets are >= 0 metres. The zero plane is
        dropped, and with it every other plane whose normal is zero.
    plane_index
        (h, w) int32, row 0 on top, column 0 at yaw -180; -1 = none.

    Raises
    ------
    InputError
        If the text is not base64, has another length than its header says, names a plane that it
        does not hold, or holds NaN, a negative distance or a normal that is not of unit length.
    """
    content = _bytes_of(text, name)
    if len(content) < _HEADER.size:
        raise InputError(
            f"{name}: the plane map is cut short: {len(content)} bytes, its header alone has "
            f"{_HEADER.size}. {_MEND}"
        )
    header_size, count, width, height, offset = _HEADER.unpack_from(content)
    if (header_size, offset) != (_HEADER.size, _HEADER.size):
        raise InputError(
            f"{name}: not a plane map: header size {header_size} and offset {offset}, "
            f"expected {_HEADER.size} and {_HEADER.size}. {_MEND}"
        )
    if width == 0 or height == 0:
        raise InputError(f"{name}: the plane map has no pixels ({width} x {height}). {_MEND}")
    if not 1 <= count <= MAX_PLANES + 1:
        raise InputError(
            f"{name}: the plane map announces {count} planes; it must hold the zero plane and at "
            f"most {MAX_PLANES} others. {_MEND}"
        )
    expected = _HEADER.size + width * height + 4 * _FLOATS_PER_PLANE * count
    if len(content) != expected:
        state = "cut short" if len(content) < expected else "too long"
        raise InputError(
            f"{name}: the plane map is {state}: {len(content)} bytes, but {width} x {height} "
            f"pixels and {count} planes make {expected}. {_MEND}"
        )
    raw = np.frombuffer(content, np.uint8, width * height, _HEADER.size).reshape(height, width)
    if raw.max() >= count:
        raise InputError(
            f"{name}: a pixel shows plane {raw.max()}, but the map holds {count} (from 0). {_MEND}"
        )
    table = np.frombuffer(content, "<f4", offset=_HEADER.size + width * height)
    return _planes_and_index(table.reshape(count, _FLOATS_PER_PLANE)[1:], raw, name)


def encode_plane_map(planes: Planes, plane_index: NDArray[np.int32]) -> str:
    """The plane map as text; inverse of `decode_plane_map` to the precision of float32.

    Raises
    ------
    InputError
        If the format cannot hold the planes (at most 255, offsets >= 0) or the index.
    """
    if len(planes) > MAX_PLANES:
        raise InputError(
            f"A plane map holds at most {MAX_PLANES} planes, got {len(planes)}; keep the largest."
        )
    if (planes.offsets_m < 0).any():
        raise InputError(
            f"A plane map holds distances >= 0, got {planes.offsets_m.min()}: let the normals "
            "point from the camera into the wall."
        )
    if plane_index.ndim != 2 or not all(1 <= side <= 0xFFFF for side in plane_index.shape):
        raise InputError(f"A plane index must be 2-D and not empty, got {plane_index.shape}.")
    if plane_index.min() < -1 or plane_index.max() >= len(planes):
        raise InputError(
            f"The plane index runs from {plane_index.min()} to {plane_index.max()}, "
            f"but there are {len(planes)} planes."
        )
    height, width = plane_index.shape
    # Frame `pano` back to the plane frame: x right, y forward, z up.
    normals = np.stack([planes.normals[:, 0], planes.normals[:, 2], -planes.normals[:, 1]], axis=-1)
    table = np.zeros((len(planes) + 1, _FLOATS_PER_PLANE), dtype="<f4")
    table[1:, :3] = normals
    table[1:, 3] = planes.offsets_m
    content = (
        _HEADER.pack(_HEADER.size, len(planes) + 1, width, height, _HEADER.size)
        + (plane_index + 1).astype(np.uint8).tobytes()
        + table.tobytes()
    )
    return base64.urlsafe_b64encode(content).rstrip(b"=").decode("ascii")


def _bytes_of(text: str | bytes, name: str) -> bytes:
    try:
        encoded = text.encode("ascii") if isinstance(text, str) else text
        encoded = encoded.strip().rstrip(b"=").translate(bytes.maketrans(b"-_", b"+/"))
        return base64.b64decode(encoded + b"=" * (-len(encoded) % 4), validate=True)
    except (binascii.Error, UnicodeEncodeError) as error:
        raise InputError(f"{name}: not URL-safe base64 text ({error}). {_MEND}") from error


def _planes_and_index(
    table: NDArray[np.float32], raw: NDArray[np.uint8], name: str
) -> tuple[Planes, NDArray[np.int32]]:
    if not np.isfinite(table).all():
        bad = int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0]) + 1
        raise InputError(f"{name}: plane {bad} contains NaN or infinity: {table[bad - 1]}. {_MEND}")
    lengths = np.linalg.norm(table[:, :3].astype(np.float64), axis=1)
    kept = lengths > 0
    for number in np.flatnonzero(kept & (np.abs(lengths - 1) > 1e-3)) + 1:
        raise InputError(
            f"{name}: the normal of plane {number} has length {lengths[number - 1]:.4g}, "
            f"expected 1. {_MEND}"
        )
    for number in np.flatnonzero(kept & (table[:, 3] < 0)) + 1:
        raise InputError(
            f"{name}: plane {number} lies at distance {table[number - 1, 3]:.4g} m; with normals "
            f"that point away from the camera it must be >= 0. {_MEND}"
        )
    # Entry 0 (none) and planes without a normal become -1, the others count up.
    index_of_raw = np.full(len(table) + 1, -1, dtype=np.int32)
    index_of_raw[1:][kept] = np.arange(kept.sum(), dtype=np.int32)
    normals = pano_from_plane_frame(table[kept, :3].astype(np.float64))
    return Planes(normals, table[kept, 3].astype(np.float64)), index_of_raw[raw]
