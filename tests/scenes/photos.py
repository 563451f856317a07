"""`make_photos`: pinhole photos of a small house with known windows, poses and sparse points."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from tests.scenes import textures
from tests.scenes.files import JPEG_QUALITY, footprint_feature
from tests.scenes.layout import ground, house_surfaces, lay_out
from tests.scenes.render import Surface, hit_distance, inside, shade
from tests.scenes.street import footprints_of, moved, photographed, truth_of, turn
from tests.scenes.textures import Picture

from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Facade, Footprint, GeoOrigin, Image, Photo, SparsePoints

FloatArray = NDArray[np.float64]

CAMERA = Pinhole(520.0, 520.0, 320.0, 240.0, 640, 480)
TILE_PX = 80
POINT_NOISE_M = 0.01
SIDES = (("p0.jpg", "p4.jpg"), ("p4.jpg", "p7.jpg"), ("p7.jpg", "p0.jpg"))
# Place of the camera and of what it looks at, on the ground; the house is 10 x 8 m, its front at
# y = 9, its right gable at x = 10.
VIEWS = (
    ((1.0, 0.0), (3.0, 9.0)),
    ((2.5, -0.5), (4.0, 9.0)),
    ((4.5, 0.2), (5.0, 9.0)),
    ((7.0, 0.1), (5.5, 9.0)),
    ((9.0, -0.3), (6.5, 9.0)),
    ((15.0, 4.0), (9.5, 10.5)),
    ((18.0, 8.0), (10.0, 12.5)),
    ((20.0, 11.0), (10.0, 13.0)),
    ((20.0, 14.5), (10.0, 13.5)),
)


@dataclass(frozen=True)
class PhotoSet:
    """Photos of a house and all that is known of it.

    Attributes
    ----------
    origin
        Origin of the world frame: east, north, up; the ground lies at world z = 0.
    photos
        Exact cameras and poses.
    images
        RGB (480, 640, 3) by photo id.
    points
        Points on walls and ground, a centimetre off, with the photos that see them.
    footprints
        One; edge 0 is the front, edge 1 the right gable; the rest is not seen.
    truth
        Facades with their true windows.
    """

    origin: GeoOrigin
    photos: tuple[Photo, ...]
    images: dict[str, Image]
    points: SparsePoints
    footprints: list[Footprint]
    truth: list[Facade]


def make_photos(seed: int = 5) -> PhotoSet:
    """Nine photos of a house's front and right gable."""
    rng = np.random.default_rng([seed, 11])
    layout = lay_out("tiny", rng)
    world_from_street = turn(layout, float(rng.uniform(-25, 25)))
    (house,) = layout.houses
    painted = [
        ground(replace(layout, m_per_px=0.1), rng),
        *house_surfaces(house, layout.m_per_px, rng),
    ]
    surfaces = [moved(each, world_from_street) for each in painted]
    sky = textures.sky(1024, rng)
    mirrored = textures.mirrored_world(sky, rng)
    photos, images = [], {}
    for index, (place, target) in enumerate(VIEWS):
        height_m = 1.6 + 0.1 * float(rng.normal())
        photo = _looking(
            f"p{index}.jpg",
            world_from_street.apply([*place, height_m]),
            world_from_street.apply([*target, height_m + 0.9]),
        )
        photos.append(photo)
        images[photo.id] = photographed(_rendered(photo, surfaces, sky, mirrored), rng)
    return PhotoSet(
        GeoOrigin(57.6886, 11.9776, 14.0),
        tuple(photos),
        images,
        _sparse_points(photos, surfaces, rng),
        footprints_of(layout, world_from_street),
        truth_of(layout, world_from_street),
    )


def write_photos(photo_set: PhotoSet, folder: Path) -> None:
    """Write ``photos``, ``cameras``, ``triangle.json`` and ``footprints.geojson`` into a folder."""
    for name in ("photos", "cameras"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    for name, image in photo_set.images.items():
        quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
        cv2.imwrite(str(folder / "photos" / name), image[..., ::-1], quality)
    write_colmap_text(photo_set, folder / "cameras")
    centres = {photo.id: photo.centre_in_world for photo in photo_set.photos}
    sides = [[a, b, round(float(np.linalg.norm(centres[a] - centres[b])), 3)] for a, b in SIDES]
    (folder / "triangle.json").write_text(json.dumps({"sides_m": sides}))
    features = [footprint_feature(each, photo_set.origin) for each in photo_set.footprints]
    (folder / "footprints.geojson").write_text(
        json.dumps({"type": "FeatureCollection", "features": features})
    )


def write_colmap_text(photo_set: PhotoSet, folder: Path) -> None:
    """Write the cameras, poses and points as COLMAP's text files."""
    size = f"{CAMERA.width_px} {CAMERA.height_px}"
    lens = f"{CAMERA.fx_px} {CAMERA.fy_px} {CAMERA.cx_px} {CAMERA.cy_px}"
    (folder / "cameras.txt").write_text(f"1 PINHOLE {size} {lens}\n")
    lines = []
    numbers = {photo.id: n for n, photo in enumerate(photo_set.photos, start=1)}
    for photo in photo_set.photos:
        x, y, z, w = Rotation.from_matrix(photo.cam_from_world.rotation).as_quat()
        pose = [w, x, y, z, *photo.cam_from_world.translation]
        lines += [f"{numbers[photo.id]} {' '.join(f'{v:.12g}' for v in pose)} 1 {photo.id}", ""]
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    points = photo_set.points
    rows = [
        f"{n} {' '.join(f'{v:.6f}' for v in place)} {' '.join(map(str, rgb))} {error:.3f} "
        + " ".join(f"{numbers[name]} 0" for name in track)
        for n, (place, rgb, error, track) in enumerate(
            zip(points.points_in_world, points.rgb, points.error_px, points.photo_ids, strict=True),
            start=1,
        )
    ]
    (folder / "points3D.txt").write_text("\n".join(rows) + "\n")


def rays_of_photo(photo: Photo) -> NDArray[np.float32]:
    """Unit rays (rows, columns, 3) in the world through the pixels' centres."""
    camera = photo.camera
    x, y = np.meshgrid(np.arange(camera.width_px) + 0.5, np.arange(camera.height_px) + 0.5)
    in_cam = camera.unproject(np.stack([x, y], axis=-1))
    in_cam /= np.linalg.norm(in_cam, axis=-1, keepdims=True)
    return photo.cam_from_world.inverse().rotate(in_cam).astype(np.float32)


def _rendered(photo: Photo, surfaces: list[Surface], sky: Picture, mirrored: Picture) -> Picture:
    """Colours (H, W, 3) in 0..255, tile by tile with the surfaces that are seen there."""
    centre, rays = photo.centre_in_world, rays_of_photo(photo)
    coarse = rays[TILE_PX // 8 :: TILE_PX // 4, TILE_PX // 8 :: TILE_PX // 4]
    near = [
        cv2.dilate(
            inside(each, *hit_distance(each, centre, coarse)).astype(np.uint8), np.ones((3, 3))
        )
        for each in surfaces
    ]
    picture = np.empty(rays.shape, np.float32)
    for row in range(0, rays.shape[0], TILE_PX):
        for column in range(0, rays.shape[1], TILE_PX):
            cells = np.s_[
                4 * row // TILE_PX : 4 * row // TILE_PX + 4,
                4 * column // TILE_PX : 4 * column // TILE_PX + 4,
            ]
            there = [each for each, seen in zip(surfaces, near, strict=True) if seen[cells].any()]
            tile = np.s_[row : row + TILE_PX, column : column + TILE_PX]
            picture[tile] = shade(there, centre, rays[tile], sky, mirrored)
    return picture


def _looking(name: str, place: FloatArray, target: FloatArray) -> Photo:
    """A photo taken at a place, its middle at the target, held level."""
    forward = (target - place) / np.linalg.norm(target - place)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    return Photo(name, CAMERA, Rigid3(rotation, -rotation @ place))


def _sparse_points(
    photos: list[Photo], surfaces: list[Surface], rng: np.random.Generator, per_m2: float = 20.0
) -> SparsePoints:
    """Points scattered over walls and ground, each with the photos that see it (three or more)."""
    places, colours, tracks = [], [], []
    for surface in surfaces:
        if not surface.plane:
            continue
        rows, columns = surface.picture.shape[:2]
        count = 4000  # of the ground
        if surface.facade is not None:
            count = int(per_m2 * surface.width_m * surface.height_m)
        share = rng.uniform(size=(count, 2))  # to the right and up
        uv = share * [surface.width_m, surface.height_m]
        pixel = ((1 - share[:, 1]) * rows).astype(int), (share[:, 0] * columns).astype(int)
        on_wall = np.ones(count, bool)
        if surface.facade is not None:
            on_wall = surface.facade.opening_id[pixel] == 0
        points = surface.corner + uv @ surface.axes[:2]
        seen = np.stack([_sees(photo, points, surfaces) for photo in photos]) & on_wall
        for index in np.flatnonzero(seen.sum(axis=0) >= 3):
            places.append(points[index])
            colours.append(surface.picture[pixel[0][index], pixel[1][index], :3])
            tracks.append(tuple(p.id for p, s in zip(photos, seen[:, index], strict=True) if s))
    noise = rng.normal(0.0, POINT_NOISE_M, (len(places), 3))
    return SparsePoints(
        np.array(places) + noise,
        np.array(colours, np.uint8),
        np.full(len(places), 0.5),
        tuple(tracks),
    )


def _sees(photo: Photo, points: FloatArray, surfaces: list[Surface]) -> NDArray[np.bool_]:
    camera = photo.camera
    pixels = camera.project(photo.cam_from_world.apply(points))
    with np.errstate(invalid="ignore"):
        seen = ((pixels >= 0) & (pixels < [camera.width_px, camera.height_px])).all(axis=-1)
    centre = photo.centre_in_world
    rays = (points - centre).astype(np.float32)[:, None]
    for surface in surfaces:
        distance, u, v = hit_distance(surface, centre, rays)  # 1 = at the point
        hidden = inside(surface, distance, u, v) & (distance < 0.999)
        seen &= ~hidden[:, 0]
    return seen
