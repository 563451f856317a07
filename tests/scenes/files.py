"""Writes a street as the files that a user would have, and its truth."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from tests.scenes.street import PanoramaPose, Street

from si3fp.geometry.enu import geodetic_from_world
from si3fp.model import Facade, Footprint, GeoOrigin, Panorama

JPEG_QUALITY = 88
Json = dict[str, Any]


def write_street(street: Street, folder: Path) -> None:
    """Write ``panoramas.geojson``, images, plane maps, footprints and the truth into a folder."""
    for name in ("panoramas", "depth"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    for name, image in street.images.items():
        quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
        cv2.imwrite(str(folder / f"panoramas/{name}.jpg"), image[..., ::-1], quality)
    for panorama in street.noisy:
        (folder / f"depth/{panorama.id}.b64").write_text(plane_map_text(panorama))
    panoramas = [_panorama_feature(p, street) for p in street.noisy]
    footprints = [footprint_feature(footprint, street.origin) for footprint in street.footprints]
    _write(folder / "panoramas.geojson", {"type": "FeatureCollection", "features": panoramas})
    _write(folder / "footprints.geojson", {"type": "FeatureCollection", "features": footprints})
    _write(folder / "truth.hbjson", truth_model(street))
    _write(folder / "truth.json", _truth(street))


def plane_map_text(panorama: Panorama) -> str:
    """A panorama's plane map in Street View's wire format."""
    planes, index = panorama.planes_in_pano, panorama.plane_index
    if planes is None or index is None:
        raise ValueError(f"{panorama.id} has no planes")
    height, width = index.shape
    header = struct.pack("<BHHHB", 8, len(planes) + 1, width, height, 8)
    right, down, forward = planes.normals.T
    table = np.column_stack([right, forward, -down, planes.offsets_m])
    table = np.concatenate([np.zeros((1, 4)), table]).astype("<f4")
    content = header + (index + 1).astype(np.uint8).tobytes() + table.tobytes()
    return base64.urlsafe_b64encode(content).decode().rstrip("=")


def truth_model(street: Street) -> Json:
    """The facades with their windows as a honeybee model of orphaned walls."""
    origin = {
        "lat_deg": street.origin.lat_deg,
        "lon_deg": street.origin.lon_deg,
        "height_m": street.origin.height_m,
    }
    return {
        "type": "Model",
        "identifier": "street-truth",
        "units": "Meters",
        "tolerance": 0.001,
        "orphaned_faces": [_wall(facade) for facade in street.truth],
        "properties": {"type": "ModelProperties"},
        "user_data": {"si3fp": {"origin": origin}},
    }


def _wall(facade: Facade) -> Json:
    def outline(x: float, y: float, width: float, height: float) -> Json:
        corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
        points = facade.world_from_facade.apply([[*corner, 0.0] for corner in corners])
        return {"type": "Face3D", "boundary": points.round(6).tolist()}

    outdoors = {"type": "Outdoors"}
    return {
        "type": "Face",
        "identifier": facade.id,
        "face_type": "Wall",
        "geometry": outline(0, 0, facade.width_m, facade.height_m),
        "boundary_condition": outdoors,
        "apertures": [
            {
                "type": "Aperture",
                "identifier": f"{facade.id}-w{i}",
                "geometry": outline(w.x_m, w.y_m, w.width_m, w.height_m),
                "boundary_condition": outdoors,
                "properties": {"type": "AperturePropertiesAbridged"},
            }
            for i, w in enumerate(facade.windows)
        ],
        "properties": {"type": "FacePropertiesAbridged"},
        "user_data": {"facade_id": facade.id},
    }


def _panorama_feature(panorama: Panorama, street: Street) -> Json:
    pose = street.noisy_poses[panorama.id]
    lat, lon, height = geodetic_from_world(pose.place, street.origin)
    return {
        "type": "Feature",
        "geometry": {
            "type": "Point",
            "coordinates": [round(lon, 9), round(lat, 9), round(height, 3)],
        },
        "properties": {
            "id": panorama.id,
            "image": f"panoramas/{panorama.id}.jpg",
            "depth": f"depth/{panorama.id}.b64",
            "heading_deg": round(pose.heading_deg, 4),
            "pitch_deg": round(pose.pitch_deg, 4),
            "roll_deg": round(pose.roll_deg, 4),
            "captured": panorama.captured,
            "provider": "si3fp synthetic street",
            "links": list(panorama.links),
        },
    }


def footprint_feature(footprint: Footprint, origin: GeoOrigin) -> Json:
    """One building as the GeoJSON feature of a footprint file."""
    outline = footprint.outline_in_world
    closed = np.concatenate([outline, outline[:1]])
    places = geodetic_from_world(np.column_stack([closed, np.zeros(len(closed))]), origin)
    return {
        "type": "Feature",
        "geometry": {
            "type": "Polygon",
            "coordinates": [[[round(lon, 9), round(lat, 9)] for lat, lon, _ in places]],
        },
        "properties": {
            "id": footprint.id,
            "ground_m": origin.height_m + (footprint.ground_m or 0.0),
            "height_m": footprint.height_m,
            "storeys": footprint.storeys,
            "year": footprint.year,
            "use": footprint.use,
        },
    }


def _truth(street: Street) -> Json:
    def pose(panorama_pose: PanoramaPose) -> Json:
        return {
            "place_in_world_m": panorama_pose.place.tolist(),
            "heading_deg": panorama_pose.heading_deg,
            "pitch_deg": panorama_pose.pitch_deg,
            "roll_deg": panorama_pose.roll_deg,
        }

    return {
        "origin": truth_model(street)["user_data"]["si3fp"]["origin"],
        "facades": {
            facade.id: {
                "width_m": facade.width_m,
                "height_m": facade.height_m,
                "windows": [
                    {
                        "x_m": w.x_m,
                        "y_m": w.y_m,
                        "width_m": w.width_m,
                        "height_m": w.height_m,
                        "recess_m": w.recess_m,
                    }
                    for w in facade.windows
                ],
            }
            for facade in street.truth
        },
        "exact_poses": {name: pose(value) for name, value in street.exact_poses.items()},
    }


def _write(path: Path, content: Json) -> None:
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
