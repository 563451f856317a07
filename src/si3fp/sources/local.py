"""Panoramas from disk: a panoramas GeoJSON, or a folder of JPEGs with Photo Sphere metadata."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from si3fp.config import CollectConfig
from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin, world_from_geodetic
from si3fp.geometry.equirect import world_from_pano_rotation
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Image, LoadImage, Panorama
from si3fp.sources.geojson import (
    WRONG_CRS,
    explain,
    is_wgs84,
    read_feature_collection,
    require_lon_lat,
    require_unique,
)
from si3fp.sources.images import frame_of, load_panorama, read_header
from si3fp.sources.photo_sphere import photo_sphere_row
from si3fp.sources.plane_map import decode_plane_map

_MAX_PLANE_MAP_BYTES = 16 << 20  # a map of 512 x 256 has 0.2 MB


@dataclass(frozen=True, slots=True)
class PanoramaRecord:
    """One panorama as its file describes it; nothing is decoded yet.

    Attributes
    ----------
    id
        Unique identifier.
    lat_deg, lon_deg, height_m
        Position of the optical centre, WGS 84; the height shares its datum with the footprints.
    heading_deg, pitch_deg, roll_deg
        Attitude as in `si3fp.geometry.equirect.world_from_pano_rotation`.
    image
        JPEG or PNG.
    width_px, height_px
        Size of the full 2:1 frame.
    plane_map
        File with the plane map, or None.
    captured
        ``YYYY``, ``YYYY-MM`` or ``YYYY-MM-DD``; "" where unknown.
    links
        Ids of neighbouring panoramas.
    provider
        Who published it, or "".
    """

    id: str
    lat_deg: float
    lon_deg: float
    height_m: float
    heading_deg: float
    pitch_deg: float
    roll_deg: float
    image: Path
    width_px: int
    height_px: int
    plane_map: Path | None = None
    captured: str = ""
    links: tuple[str, ...] = ()
    provider: str = ""


_Finite = Annotated[float, Field(allow_inf_nan=False)]


class _Row(BaseModel):
    """The properties of one panorama; the descriptions complete "expected ..." in messages."""

    model_config = ConfigDict(coerce_numbers_to_str=True, extra="ignore")

    id: str = Field(min_length=1, description="a unique name")
    lat_deg: _Finite = Field(ge=-90, le=90, description="a latitude in degrees")
    lon_deg: _Finite = Field(ge=-180, le=180, description="a longitude in degrees")
    height_m: _Finite = Field(ge=-500, le=10_000, description="a height in metres")
    heading_deg: _Finite = Field(
        ge=-360, le=360, description="the compass bearing of the image centre in degrees"
    )
    pitch_deg: _Finite = Field(ge=-90, le=90, description="degrees from -90 to 90 (0 = level)")
    roll_deg: _Finite = Field(ge=-180, le=180, description="degrees from -180 to 180 (0 = level)")
    image: str = Field(min_length=1, description="the path of a JPEG or PNG beside the file")
    depth: str | None = Field(None, description="the path of a plane map, or nothing")
    captured: str = Field(
        "",
        pattern=r"^(\d{4}(-(0[1-9]|1[0-2])(-(0[1-9]|[12]\d|3[01])([T ].*)?)?)?)?$",
        description='a date "YYYY-MM" or "YYYY-MM-DD"',
    )
    links: tuple[str, ...] = Field((), description="a list of ids")
    provider: str = Field("", description="a name")

    @field_validator("captured", "links", "provider", mode="before")
    @classmethod
    def _null_is_absent(cls, value: Any, info: Any) -> Any:
        return cls.model_fields[info.field_name].default if value is None else value


def read_panorama_records(
    path: Path, max_pixels: int = CollectConfig().max_pixels
) -> list[PanoramaRecord]:
    """The panoramas of a GeoJSON file or of a folder of Photo Sphere JPEGs, in file order.

    Every image's header is read, so that a wrong file shows before the work starts.

    Parameters
    ----------
    path
        ``PANORAMAS.geojson`` or a folder.
    max_pixels
        Limit on the size of one panorama.

    Raises
    ------
    InputError
        If the file, a field, an image or a plane map is missing or wrong; the message names the
        panorama and the field.
    """
    if path.is_dir():
        records = _records_of_folder(path, max_pixels)
    else:
        records = _records_of_geojson(path, max_pixels)
    require_unique([record.id for record in records], path, "panorama")
    return records


def panoramas_in_world(
    records: Sequence[PanoramaRecord], origin: GeoOrigin
) -> tuple[Panorama, ...]:
    """The panoramas with their poses in the world frame and their plane maps decoded.

    Headings count from north at the origin: within 1 km the meridians converge by less than 0.02
    degrees up to 60 degrees of latitude, far below the accuracy of any heading.

    Raises
    ------
    InputError
        If a plane map cannot be read or decoded.
    """
    return tuple(_panorama(record, origin) for record in records)


def image_loader(
    records: Sequence[PanoramaRecord], max_pixels: int = CollectConfig().max_pixels
) -> LoadImage:
    """A function from a panorama's id to its RGB pixels; every call decodes again, none is kept."""
    paths = {record.id: record.image for record in records}

    def load(panorama_id: str) -> Image:
        if panorama_id not in paths:
            raise InputError(f"There is no panorama {panorama_id!r} among the {len(paths)} read.")
        return load_panorama(paths[panorama_id], max_pixels)

    return load


def _panorama(record: PanoramaRecord, origin: GeoOrigin) -> Panorama:
    rotation = world_from_pano_rotation(record.heading_deg, record.pitch_deg, record.roll_deg)
    centre = world_from_geodetic([record.lat_deg, record.lon_deg, record.height_m], origin)
    planes, plane_index = None, None
    if record.plane_map is not None:
        planes, plane_index = decode_plane_map(
            _plane_map_text(record.plane_map), f"Panorama {record.id}, {record.plane_map}"
        )
    return Panorama(
        id=record.id,
        captured=record.captured,
        pano_from_world=Rigid3(rotation, centre).inverse(),
        planes_in_pano=planes,
        plane_index=plane_index,
        links=record.links,
    )


def _plane_map_text(path: Path) -> bytes:
    try:
        size = path.stat().st_size
        if size > _MAX_PLANE_MAP_BYTES:
            raise InputError(
                f"{path} is no plane map: {size:,} bytes, at most {_MAX_PLANE_MAP_BYTES:,} "
                "expected. Correct the panorama's `depth`."
            )
        return path.read_bytes()
    except OSError as error:
        raise InputError(
            f"Could not read the plane map {path}: {error.strerror or error}. "
            "Copy it again, or remove it from the panorama's `depth`."
        ) from error


def _records_of_geojson(path: Path, max_pixels: int) -> list[PanoramaRecord]:
    features, crs_name = read_feature_collection(path)
    if not is_wgs84(crs_name):
        raise InputError(f"{path} declares the coordinate system {crs_name!r}; {WRONG_CRS}.")
    if not features:
        raise InputError(f"{path} holds zero panoramas; add at least one point.")
    return [
        _record_of_feature(feature, number, path, max_pixels)
        for number, feature in enumerate(features)
    ]


def _record_of_feature(
    feature: dict[str, Any], number: int, path: Path, max_pixels: int
) -> PanoramaRecord:
    properties = feature.get("properties") or {}
    geometry = feature.get("geometry") or {}
    where = f"{path}, feature {number} ({properties.get('id', 'no id')})"
    if geometry.get("type") != "Point":
        raise InputError(
            f"{where}: a panorama is a Point, got {geometry.get('type', 'no geometry')}."
        )
    position = geometry.get("coordinates", [])
    require_lon_lat(position, where)
    if len(position) < 3:
        raise InputError(
            f"{where}: the point {position} has no height; write [lon, lat, height_m] with the "
            "height of the camera in the datum of the footprints' ground."
        )
    place = {"lon_deg": position[0], "lat_deg": position[1], "height_m": position[2]}
    return _record({**properties, **place}, where, path.parent, max_pixels)


def _records_of_folder(path: Path, max_pixels: int) -> list[PanoramaRecord]:
    images = sorted(p for p in path.iterdir() if p.suffix.lower() in {".jpg", ".jpeg"})
    if not images:
        lists = ", ".join(sorted(p.name for p in path.glob("*.geojson")))
        hint = f"; did you mean a file in it ({lists})?" if lists else "."
        raise InputError(f"The folder {path} holds zero JPEG panoramas{hint}")
    records = []
    for image in images:
        header = read_header(image)
        row = photo_sphere_row(header.gpano, header.gps, header.taken, str(image))
        row |= {"id": image.stem, "image": image.name}
        records.append(_record(row, str(image), path, max_pixels))
    return records


def _record(row: dict[str, Any], where: str, folder: Path, max_pixels: int) -> PanoramaRecord:
    try:
        checked = _Row.model_validate(row)
    except ValidationError as error:
        raise explain(error, _Row, where) from error
    image = _beside(folder, checked.image, f"{where}: `image`")
    plane_map = None
    if checked.depth:
        plane_map = _beside(folder, checked.depth, f"{where}: `depth`")
        if not plane_map.is_file():
            raise InputError(
                f"{where}: there is no plane map {plane_map}. Copy the file, or remove `depth`."
            )
    frame = frame_of(read_header(image), image, max_pixels)
    fields = checked.model_dump(exclude={"image", "depth"})
    return PanoramaRecord(
        **{**fields, "captured": checked.captured[:10]},
        image=image,
        plane_map=plane_map,
        width_px=frame.full_width_px,
        height_px=frame.full_height_px,
    )


def _beside(folder: Path, name: str, where: str) -> Path:
    """The file ``name`` relative to ``folder``; it may lie below the folder or below its parent.

    A list of panoramas may come from a stranger: it must not reach into the rest of the disk.
    """
    portable = name.replace("\\", "/")
    if "://" in portable or portable.startswith("/") or Path(portable).drive:
        raise InputError(f"{where} is {name!r}; write a path relative to the file, no URL.")
    if Path(os.path.normpath(portable)).parts[:2] == ("..", ".."):
        raise InputError(
            f"{where} is {name!r}, which leaves the folder around the file; put images and plane "
            "maps below it or beside it."
        )
    return folder / portable
