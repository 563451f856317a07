"""C.2 with its files: a folder of photos becomes cameras, points and walls in the world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from si3fp.camera2d.facade_plane import FacadePlane
from si3fp.camera2d.facades import FoundFacades, find_facades, walls_seen_from_above
from si3fp.camera2d.on_map import place_on_map, places_in_plan
from si3fp.camera2d.placed import PlacedReconstruction
from si3fp.camera2d.sfm import PhotoFile, focal_from_35mm, reconstruct, triangulate_known
from si3fp.camera2d.world import known_cameras, level_and_scale
from si3fp.config import PhotoConfig
from si3fp.errors import InputError, ReconstructionError
from si3fp.model import Footprint, LoadImage, Photo, SparsePoints
from si3fp.records import rounded
from si3fp.sources.colmap_text import ColmapModel, read_colmap_text
from si3fp.sources.footprints import footprints_in_world
from si3fp.sources.photos import (
    PhotoRecord,
    photo_loader,
    prepare_upright,
)
from si3fp.sources.selection import run_origin
from si3fp.steps.inputs import RunInputs
from si3fp.steps.photo_inputs import PhotoSources
from si3fp.steps.rectified import Progress
from si3fp.streetview.cloud import ply_bytes
from si3fp.workspace import Workspace, write_bytes


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PhotoScene(RunInputs):
    """What C.2 found; a run's footprints are there only where the walls lie on them.

    Attributes
    ----------
    placed
        Photos and points in the world.
    load
        Reads a photo's pixels free of distortion.
    found
        The walls.
    lost
        Reason by file name of the photos that are not used.
    """

    placed: PlacedReconstruction
    load: LoadImage
    found: FoundFacades
    lost: Mapping[str, str]

    @property
    def photos(self) -> dict[str, Photo]:
        """The photos by id."""
        return {photo.id: photo for photo in self.placed.photos}

    @property
    def points(self) -> SparsePoints:
        """Sparse points in the world."""
        return self.placed.points

    @property
    def planes(self) -> tuple[FacadePlane, ...]:
        """The walls to render."""
        return self.found.planes

    @property
    def metric(self) -> bool:
        """Whether lengths are metres."""
        return self.placed.metric


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """Cameras and points in a frame of their own.

    Attributes
    ----------
    model
        Cameras, poses and points.
    lost
        Reason by id of the photos without a pose.
    notes
        What a user should know.
    """

    model: ColmapModel
    lost: Mapping[str, str]
    notes: tuple[str, ...] = ()


def find_poses(
    sources: PhotoSources, workspace: Workspace, config: PhotoConfig, progress: Progress
) -> Poses:
    """C.2, first half: cameras and points in a frame of their own.

    Known cameras stay as they are and only get points, unless they bring their own.
    """
    cameras = sources.cameras
    if cameras is not None and len(cameras.points):
        return Poses(cameras, _without_camera(sources, cameras))
    upright = workspace.cache / "photos"
    prepare_upright(sources.records, upright)
    work_dir = workspace.cache / "sfm"
    if cameras is not None:
        folder = triangulate_known(
            upright,
            cameras.photos,
            cameras.distortion,
            work_dir,
            config.sfm,
            seed=config.seed,
            progress=progress,
        )
        return Poses(read_colmap_text(folder), _without_camera(sources, cameras))
    places = places_in_plan(sources.positions, None)
    files = [_photo_file(record, places.get(record.id)) for record in sources.records]
    result = reconstruct(upright, files, work_dir, config.sfm, seed=config.seed, progress=progress)
    return Poses(read_colmap_text(result.folder), result.lost, result.notes)


def make_scene(sources: PhotoSources, poses: Poses, config: PhotoConfig) -> PhotoScene:
    """C.2, second half: metres, vertical, place and north, and the walls.

    Raises
    ------
    ReconstructionError
        If nothing gives the scale or the vertical, there is no wall, or the walls do not lie on the
        footprints.
    InputError
        If distances, GPS or known cameras contradict the reconstruction. Doubts about the poses
        are told along: they are the likely cause.
    """
    try:
        return _made_scene(sources, poses, config)
    except (InputError, ReconstructionError) as error:
        lost = tuple(f"{name}: " for name in poses.lost)
        doubts = [note for note in poses.notes if not note.startswith(lost)]
        if not doubts:
            raise
        raise type(error)("\n  ".join([f"{error}\nOf the reconstruction:", *doubts])) from error


def _made_scene(sources: PhotoSources, poses: Poses, config: PhotoConfig) -> PhotoScene:
    model = poses.model
    origin = run_origin(sources.outlines, []) if sources.outlines else None
    if sources.cameras is not None:
        placed = known_cameras(
            model.photos,
            model.distortion,
            model.points,
            distances=sources.distances,
            origin=sources.camera_origin,
            config=config.world,
        )
    else:
        placed = level_and_scale(
            model.photos,
            model.distortion,
            model.points,
            distances=sources.distances,
            gps=sources.positions,
            origin=origin,
            unscaled=sources.unscaled,
            config=config.world,
        )
    footprints: tuple[Footprint, ...] = ()
    if origin is not None:
        origin = placed.origin or origin
        footprints = tuple(footprints_in_world(sources.outlines, origin))
        bare = find_facades(placed.photos, placed.points, (), config.planes)
        edges = [edge for footprint in footprints for edge in footprint.edges()]
        walls, outward = walls_seen_from_above(bare.planes)
        placed = place_on_map(placed, walls, outward, np.array(edges), origin, config.world)
    found = find_facades(placed.photos, placed.points, footprints, config.planes)
    return PhotoScene(
        origin=placed.origin,
        footprints=footprints,
        hashes=sources.hashes,
        notes=poses.notes,
        placed=placed,
        load=photo_loader(sources.records, placed.undistort),
        found=found,
        lost={**sources.unreadable, **poses.lost, **placed.left_out},
    )


def write_sparse_cloud(scene: PhotoScene, workspace: Workspace) -> None:
    """The sparse points as ``cloud.ply``, unless it is there."""
    if not workspace.cloud.exists():
        write_bytes(workspace.cloud, ply_bytes(scene.points.points_in_world, scene.points.rgb))


def photos_record(scene: PhotoScene) -> dict[str, Any]:
    """What ``run.json`` says of the photos, their reconstruction and walls left out."""
    used = {name for plane in scene.planes for name in plane.photo_ids}
    rows = [
        {
            "id": name,
            "position_in_world": rounded(photo.centre_in_world, 3),
            "used": name in used,
            "reason": "" if name in used else "shows no facade",
        }
        for name, photo in scene.photos.items()
    ]
    rows += [{"id": name, "used": False, "reason": why} for name, why in scene.lost.items()]
    return {
        "photos": sorted(rows, key=lambda row: str(row["id"])),
        "reconstruction": scene.placed.record,
        "left_out": list(scene.found.left_out),
    }


def _without_camera(sources: PhotoSources, cameras: ColmapModel) -> dict[str, str]:
    known = {photo.id for photo in cameras.photos}
    return {
        record.id: "is not among the known cameras"
        for record in sources.records
        if record.id not in known
    }


def _photo_file(record: PhotoRecord, place: Any) -> PhotoFile:
    focal_px = (
        focal_from_35mm(record.focal_35mm, record.width_px, record.height_px)
        if record.focal_35mm
        else None
    )
    position_m = None if place is None else (float(place[0]), float(place[1]), 0.0)
    return PhotoFile(record.id, record.camera, focal_px, position_m)
