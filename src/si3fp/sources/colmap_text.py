"""Cameras, poses and points from COLMAP's text files.

Read are `cameras.txt`, `images.txt` and, where present, `points3D.txt`. Camera models: PINHOLE,
SIMPLE_PINHOLE, SIMPLE_RADIAL, RADIAL and OPENCV; their lens distortion comes as the four numbers
k1, k2, p1, p2 of OpenCV beside the photo. Fisheye and other models are an error.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from si3fp.errors import InputError
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Photo, SparsePoints

# Index of fx, fy, cx, cy and of k1, k2, p1, p2 (-1 = 0) in the parameters of a model.
_MODELS = {
    "SIMPLE_PINHOLE": (3, (0, 0, 1, 2), (-1, -1, -1, -1)),
    "PINHOLE": (4, (0, 1, 2, 3), (-1, -1, -1, -1)),
    "SIMPLE_RADIAL": (4, (0, 0, 1, 2), (3, -1, -1, -1)),
    "RADIAL": (5, (0, 0, 1, 2), (3, 4, -1, -1)),
    "OPENCV": (8, (0, 1, 2, 3), (4, 5, 6, 7)),
}
_UNIT_TOLERANCE = 1e-3  # of a quaternion's length; files carry 6 digits or more


@dataclass(frozen=True, slots=True, eq=False)
class ColmapModel:
    """What the text files of COLMAP describe.

    Attributes
    ----------
    photos
        Photos with their poses, in the order of the file.
    distortion
        By photo id the coefficients (4,) k1, k2, p1, p2 in OpenCV's order; all zero where the
        photo is free of distortion as it is. A photo's `camera` holds once they are taken out.
    points
        Sparse points; none without `points3D.txt`.
    """

    photos: tuple[Photo, ...]
    distortion: dict[str, FloatArray]
    points: SparsePoints


def read_colmap_text(folder: Path) -> ColmapModel:
    """Photos, lens distortion and sparse points of a folder with COLMAP's text files.

    Raises
    ------
    InputError
        If a file is missing, a line is cut off, not a number or not finite, an id or name occurs
        twice, a camera or image is missing, or a camera model is not supported.
    """
    cameras: dict[str, tuple[Pinhole, FloatArray]] = {}
    for where, line in _lines(folder / "cameras.txt"):
        name, camera, distortion = _camera(line, where)
        if name in cameras:
            raise InputError(f"{where}: camera {name} occurs twice. Export the model again.")
        cameras[name] = (camera, distortion)

    photos: dict[str, Photo] = {}
    distortions: dict[str, FloatArray] = {}
    for number, photo, camera_name, where in _images(folder / "images.txt", cameras):
        if number in photos or photo.id in distortions:
            raise InputError(
                f"{where}: image {number}, {photo.id}, occurs twice. Export the model again."
            )
        photos[number] = photo
        distortions[photo.id] = cameras[camera_name][1]
    if not photos:
        raise InputError(f"{folder / 'images.txt'} has no image. Export the model again.")
    names = {number: photo.id for number, photo in photos.items()}
    return ColmapModel(tuple(photos.values()), distortions, _points(folder, names))


def _lines(path: Path, keep_empty: bool = False) -> Iterator[tuple[str, str]]:
    """Place and text of the lines that are no comments."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise InputError(
            f"There is no file {path}. Export the model with COLMAP: model_converter "
            "--output_type TXT."
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path} is not a readable text file: {error}. Export the model with COLMAP: "
            "model_converter --output_type TXT."
        ) from error
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.lstrip().startswith("#") and (keep_empty or line.strip()):
            yield f"{path}, line {number}", line.strip()


def _numbers(fields: list[str], where: str, what: str) -> list[float]:
    try:
        numbers = [float(field) for field in fields]
    except ValueError as error:
        raise InputError(f"{where}: {what} is not a number ({error}).") from error
    if not all(map(math.isfinite, numbers)):
        raise InputError(f"{where}: {what} is not finite, got {' '.join(fields)}.")
    return numbers


def _camera(line: str, where: str) -> tuple[str, Pinhole, FloatArray]:
    fields = line.split()
    if len(fields) < 4:
        raise InputError(f"{where}: a camera is CAMERA_ID MODEL WIDTH HEIGHT PARAMS, got {line!r}.")
    name, model = fields[:2]
    if model not in _MODELS:
        raise InputError(
            f"{where}: the camera model {model} is not supported, only {', '.join(_MODELS)}. "
            "Undistort the photos with COLMAP (image_undistorter) and use its model."
        )
    count, pinhole, lens = _MODELS[model]
    width, height, *values = _numbers(fields[2:], where, f"the size or a parameter of {model}")
    if len(values) != count:
        raise InputError(
            f"{where}: a {model} camera has {count} parameters, got {len(values)}; the line is "
            "cut off or of another model."
        )
    if width != int(width) or height != int(height):
        raise InputError(f"{where}: the size must be whole pixels, got {width} x {height}.")
    fx, fy, cx, cy = (values[i] for i in pinhole)
    try:
        camera = Pinhole(fx, fy, cx, cy, int(width), int(height))
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    return name, camera, np.array([values[i] if i >= 0 else 0.0 for i in lens])


def _images(
    path: Path, cameras: dict[str, tuple[Pinhole, FloatArray]]
) -> Iterator[tuple[str, Photo, str, str]]:
    """Image id, photo, camera id and place of every image; two lines each, the second unused."""
    lines = _lines(path, keep_empty=True)
    for where, line in lines:
        if not line:
            continue
        fields = line.split(maxsplit=9)
        if len(fields) < 10:
            raise InputError(
                f"{where}: an image is IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, got "
                f"{line[:80]!r}; the line is cut off."
            )
        number, camera_name, name = fields[0], fields[8], fields[9]
        pose = _numbers(fields[1:8], where, f"the pose of {name}")
        if camera_name not in cameras:
            raise InputError(f"{where}: {name} has camera {camera_name}, not in cameras.txt.")
        marks_where, marks = next(lines, (where, ""))
        if len(marks.split()) % 3:
            raise InputError(
                f"{marks_where}: after the line of {name} comes one with its points, X Y "
                "POINT3D_ID each (empty where there are none); this one is cut off or missing."
            )
        rotation = _rotation(pose[:4], f"{where}: the rotation of {name}")
        cam_from_world = Rigid3(rotation, np.array(pose[4:]))
        yield number, Photo(name, cameras[camera_name][0], cam_from_world), camera_name, where


def _rotation(quaternion: list[float], what: str) -> FloatArray:
    """Rotation (3, 3) of the unit quaternion w, x, y, z."""
    length = math.hypot(*quaternion)
    if abs(length - 1) > _UNIT_TOLERANCE:
        raise InputError(f"{what} is no unit quaternion, its length is {length:.4g}.")
    w, x, y, z = (value / length for value in quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _points(folder: Path, names: dict[str, str]) -> SparsePoints:
    path = folder / "points3D.txt"
    places, colours, errors, tracks = [], [], [], []
    for where, line in _lines(path) if path.exists() else ():
        fields = line.split()
        if len(fields) < 8 or len(fields) % 2:
            raise InputError(
                f"{where}: a point is POINT3D_ID X Y Z R G B ERROR and pairs of IMAGE_ID "
                f"POINT2D_IDX, got {len(fields)} values; the line is cut off."
            )
        x, y, z, *colour, error = _numbers(fields[1:8], where, "a value of the point")
        if any(not 0 <= channel <= 255 for channel in colour):
            raise InputError(f"{where}: colours are 0 to 255, got {colour}.")
        unknown = [number for number in fields[8::2] if number not in names]
        if unknown:
            raise InputError(f"{where}: seen by image {unknown[0]}, which is not in images.txt.")
        places.append((x, y, z))
        colours.append(colour)
        errors.append(error)
        tracks.append(tuple(dict.fromkeys(names[number] for number in fields[8::2])))
    return SparsePoints(
        np.array(places, dtype=np.float64).reshape(-1, 3),
        np.array(colours, dtype=np.uint8).reshape(-1, 3),
        np.array(errors, dtype=np.float64),
        tuple(tracks),
    )
