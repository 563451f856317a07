"""The process that runs COLMAP: ``python -m si3fp.camera2d._colmap_process JOB.json``.

Only this process imports pycolmap: beside it OpenCV's PNG writer breaks, its crashes would take
si3fp along, and a process can be ended at any time. It is started by `si3fp.camera2d.sfm` and ends
when that closes its stdin or dies. It writes the steps that it begins to stdout, features and
matches to ``database.db``, models as text to ``models/<n>``, the largest first, and ``report.json``
last. What the database already has is not done again.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import threading
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

from si3fp.camera2d.coherence import (
    ModelView,
    agreeing_share,
    coherence,
    neighbours,
    scales_contradict,
)
from si3fp.config import SfmConfig
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Photo

Job = dict[str, Any]


def main(job_path: Path) -> None:
    """Run a job: photos, cameras and pairs in, models and report out."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    job = json.loads(job_path.read_text(encoding="utf-8"))
    config = SfmConfig(**job["config"])
    work, folder = job_path.parent, Path(job["folder"])
    database = work / "database.db"
    _register_photos(database, job)
    _say("features")
    extraction = pycolmap.FeatureExtractionOptions()
    extraction.num_threads = config.threads
    extraction.max_image_size = config.max_side_px
    extraction.sift.max_num_features = config.max_features
    names = [photo["name"] for photo in job["photos"]]
    pycolmap.extract_features(database, folder, image_names=names, extraction_options=extraction)
    _say("matches")
    _match(database, job["pairs"], config, job["seed"])
    _say("cameras")
    if "poses" in job:
        models = [_triangulate(database, folder, work, job)]
    else:
        models = _map(database, folder, work, config, job["seed"])
    _write_report(database, work, models, job, config)


def _end_with_parent() -> None:
    os.read(sys.stdin.fileno(), 1)  # returns when the other end is closed
    os._exit(3)


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _register_photos(database_path: Path, job: Job) -> None:
    """Write photos and cameras to a new database; photo i has the id i + 1 in every table."""
    with pycolmap.Database.open(database_path) as database:
        if database.num_images() == len(job["photos"]):
            _rename(database, [photo["name"] for photo in job["photos"]])
            return
        database.clear_all_tables()
        cameras = [pycolmap.Camera(**camera) for camera in job["cameras"]]
        for number, camera in enumerate(cameras, start=1):
            camera.camera_id = number
            rig = pycolmap.Rig(rig_id=number)
            rig.add_ref_sensor(camera.sensor_id)
            database.write_camera(camera, use_camera_id=True)
            database.write_rig(rig, use_rig_id=True)
        for number, photo in enumerate(job["photos"], start=1):
            image = pycolmap.Image(
                name=photo["name"], camera_id=photo["camera"] + 1, image_id=number
            )
            image.frame_id = number
            frame = pycolmap.Frame(frame_id=number, rig_id=photo["camera"] + 1)
            frame.add_data_id(image.data_id)
            database.write_frame(frame, use_frame_id=True)
            database.write_image(image, use_image_id=True)


def _rename(database: Any, names: list[str]) -> None:
    for image in database.read_all_images():
        if image.name != names[image.image_id - 1]:
            image.name = names[image.image_id - 1]
            database.update_image(image)


def _match(database_path: Path, pairs: list[list[int]], config: SfmConfig, seed: int) -> None:
    """Match and verify pairs of photos that are not matched yet."""
    with pycolmap.Database.open(database_path) as database:
        names = [image.name for image in sorted(database.read_all_images(), key=_image_id)]
        # COLMAP's list of pairs is split at blanks, which names may have.
        _rename(database, [str(number) for number in range(len(names))])
    listed = database_path.with_name("pairs.txt")
    listed.write_text("".join(f"{a} {b}\n" for a, b in pairs), encoding="ascii")
    pairing = pycolmap.ImportedPairingOptions()
    pairing.match_list_path = listed
    pairing.block_size = 8 * config.threads  # pairs between two entries in the database
    matching = pycolmap.FeatureMatchingOptions()
    matching.num_threads = config.threads
    verification = pycolmap.TwoViewGeometryOptions()
    verification.min_num_inliers = config.min_matches
    verification.ransac.random_seed = seed
    pycolmap.match_image_pairs(database_path, matching, pairing, verification)
    with pycolmap.Database.open(database_path) as database:
        _rename(database, names)


def _image_id(image: Any) -> int:
    return int(image.image_id)


def _map(database: Path, folder: Path, work: Path, config: SfmConfig, seed: int) -> list[Any]:
    """The models, the one with the most photos first."""
    out = work / "sparse"
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    if config.mapper == "global":
        calibrated = work / "calibrated.db"  # calibration writes focal lengths
        shutil.copyfile(database, calibrated)
        pycolmap.calibrate_view_graph(calibrated)
        options = pycolmap.GlobalPipelineOptions()
        options.min_num_matches = config.min_matches
        options.min_model_size = config.min_model_photos
        options.random_seed = seed
        options.num_threads = config.threads
        options.image_path = folder
        models = pycolmap.global_mapping(calibrated, folder, out, options)
    else:
        models = pycolmap.incremental_mapping(
            database,
            folder,
            out,
            _incremental(config, seed),
            initial_image_pair_callback=lambda: _say("two cameras"),
            next_image_callback=lambda: _say("camera"),
        )
    return sorted(models.values(), key=lambda model: -int(model.num_reg_images()))


def _incremental(config: SfmConfig, seed: int) -> Any:
    options = pycolmap.IncrementalPipelineOptions()
    options.min_num_matches = config.min_matches
    options.min_model_size = config.min_model_photos
    options.random_seed = options.mapper.random_seed = options.triangulation.random_seed = seed
    options.num_threads = options.mapper.num_threads = config.threads
    return options


def _triangulate(database: Path, folder: Path, work: Path, job: Job) -> Any:
    """Points of photos whose cameras and poses are known and stay as they are."""
    model = pycolmap.Reconstruction()
    for number, camera in enumerate(job["cameras"], start=1):
        model.add_camera_with_trivial_rig(pycolmap.Camera(camera_id=number, **camera))
    for number, (photo, pose) in enumerate(zip(job["photos"], job["poses"], strict=True), start=1):
        image = pycolmap.Image(name=photo["name"], camera_id=photo["camera"] + 1, image_id=number)
        cam_from_world = pycolmap.Rigid3d(np.array(pose, np.float64))
        model.add_image_with_trivial_frame(image, cam_from_world)
    config = SfmConfig(**job["config"])
    out = work / "sparse"
    out.mkdir(exist_ok=True)
    return pycolmap.triangulate_points(
        model, database, folder, out, options=_incremental(config, job["seed"])
    )


def _write_report(
    database_path: Path, work: Path, models: list[Any], job: Job, config: SfmConfig
) -> None:
    """Write the models as text and what the parent needs to judge them."""
    views = [_view(model) for model in models]
    _match_neighbours(database_path, views, job, config)
    with pycolmap.Database.open(database_path) as database:
        ids = range(1, len(job["photos"]) + 1)
        features = [int(database.num_keypoints_for_image(number)) for number in ids]
        matches = _verified_matches(database)
    entries = []
    for number, (model, view) in enumerate(zip(models, views, strict=True)):
        text = work / "models" / str(number)
        shutil.rmtree(text, ignore_errors=True)
        text.mkdir(parents=True)
        model.write_text(text)
        rays = _rays(matches, model)
        agreeing = [agreeing_share(r, view.photos[a], view.photos[b]) for (a, b), r in rays.items()]
        entries.append(
            {
                "photos": sorted(view.photos),
                "points": len(view.points),
                "error_px": float(model.compute_mean_reprojection_error()),
                "agreeing": float(np.median(agreeing)) if agreeing else 0.0,
                "contradicts_first": scales_contradict(views[0], view),
                **asdict(coherence(view, rays, config)),
            }
        )
    verified = [[first, second, len(points)] for (first, second), (points, _) in matches.items()]
    report = {"features": features, "verified": verified, "models": entries}
    unfinished = work / "report.json.part"
    unfinished.write_text(json.dumps(report), encoding="utf-8")
    unfinished.replace(work / "report.json")


def _match_neighbours(database: Path, views: list[ModelView], job: Job, config: SfmConfig) -> None:
    """Match photos that a model puts side by side and that nobody has compared yet."""
    known = {tuple(pair) for pair in job["pairs"]}
    missing = {
        (pair.first, pair.second)
        for view in views
        for pair in neighbours(view, config)
        if pair.shared < config.stranger_share * pair.expected
    } - known
    if missing:
        _match(database, [list(pair) for pair in sorted(missing)], config, job["seed"])


def _view(model: Any) -> ModelView:
    """A model in numbers, photos counted from zero."""
    place = {point: index for index, point in enumerate(model.points3D)}
    points = np.array([point.xyz for point in model.points3D.values()], np.float64)
    seen: dict[int, set[int]] = {number - 1: set() for number in model.reg_image_ids()}
    for point, index in place.items():
        for element in model.points3D[point].track.elements:
            seen[element.image_id - 1].add(index)
    photos = {}
    for number in model.reg_image_ids():
        image = model.images[number]
        camera = model.cameras[image.camera_id]
        (fx, _, cx), (_, fy, cy), _ = camera.calibration_matrix().tolist()
        pose = image.cam_from_world().matrix()
        photos[number - 1] = Photo(
            image.name,
            Pinhole(fx, fy, cx, cy, camera.width, camera.height),
            Rigid3(pose[:, :3], pose[:, 3]),
        )
    indices = {photo: np.array(sorted(index), np.intp) for photo, index in seen.items()}
    return ModelView(photos, points.reshape(-1, 3), indices)


def _verified_matches(database: Any) -> dict[tuple[int, int], tuple[Any, Any]]:
    """Pixels (M, 2) of verified matches in both photos, by pair, photos counted from zero."""
    found = {}
    pixels: dict[int, Any] = {}
    for pair_id, geometry in zip(*database.read_two_view_geometries(), strict=True):
        matches = geometry.inlier_matches
        if not len(matches):
            continue
        pair = pycolmap.pair_id_to_image_pair(pair_id)
        for number in pair:
            if number not in pixels:
                pixels[number] = database.read_keypoints(number)[:, :2].astype(np.float64)
        first, second = (number - 1 for number in pair)
        found[first, second] = (pixels[pair[0]][matches[:, 0]], pixels[pair[1]][matches[:, 1]])
    return found


def _rays(matches: dict[tuple[int, int], tuple[Any, Any]], model: Any) -> dict[Any, Any]:
    """The matches of the photos of a model as directions with z = 1, free of distortion."""
    registered = {number - 1 for number in model.reg_image_ids()}
    return {
        pair: tuple(
            np.pad(
                model.cameras[model.images[photo + 1].camera_id].cam_from_img(pixels),
                ((0, 0), (0, 1)),
                constant_values=1.0,
            )
            for photo, pixels in zip(pair, both, strict=True)
        )
        for pair, both in matches.items()
        if registered >= set(pair)
    }


if __name__ == "__main__":
    main(Path(sys.argv[1]))
