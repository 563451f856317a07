"""The process that runs COLMAP: ``python -m si3fp.camera2d._colmap_process JOB.json``.

Only this process imports pycolmap: beside it OpenCV's PNG writer breaks, its crashes would take
si3fp along, and a process can be ended at any time. It is started by `si3fp.camera2d.sfm` and ends
when that closes its stdin or dies. It writes the steps that it begins to stdout, features and
matches to ``database.db``, models as text to ``models/<n>``, the largest first, and ``report.json``
last. What the database already has is not done again.
"""

from __future__ import annotations

import copy
import json
import os
import shutil
import sys
import threading
from collections import Counter
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

from si3fp.camera2d._colmap_numbers import rays_of, verified_matches, view
from si3fp.camera2d.coherence import (
    ModelView,
    agreeing_share,
    coherence,
    scales_contradict,
)
from si3fp.config import SfmConfig

Job = dict[str, Any]


def main(job_path: Path) -> None:
    """Run a job: photos, cameras and pairs in, models and report out."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    job = json.loads(job_path.read_text(encoding="utf-8"))
    config = SfmConfig(**job["config"])
    config = replace(config, threads=min(config.threads, os.cpu_count() or 1))
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
        _rename(database, [f"photo-{number}" for number in range(len(names))])
    listed = database_path.with_name("pairs.txt")
    listed.write_text("".join(f"photo-{a} photo-{b}\n" for a, b in pairs), encoding="ascii")
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
        options.num_threads = config.mapper_threads
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
    _say("refinement")
    largest_first = sorted(models.values(), key=lambda model: -int(model.num_reg_images()))
    return [_refined(model, config) for model in largest_first]


def _refined(model: Any, config: SfmConfig) -> Any:
    """The model with all cameras and points adjusted once more, robustly.

    The mapper leaves the principal point in the middle of the picture and squares the errors of
    wrong matches. Here the principal point moves, of cameras with many photos, where that explains
    the pictures better and stays plausible.
    """
    moved = copy.deepcopy(model)
    _adjust(moved, config, principal_point=True, robust=False)
    for either in (model, moved):
        either.update_point_3d_errors()
    error_px, error_moved_px = (m.compute_mean_reprojection_error() for m in (model, moved))
    plausible = all(
        np.hypot(
            camera.principal_point_x - camera.width / 2,
            camera.principal_point_y - camera.height / 2,
        )
        <= config.max_principal_shift * max(camera.width, camera.height)
        for camera in moved.cameras.values()
    )
    better = plausible and error_moved_px < (1 - config.principal_gain) * error_px
    best = moved if better else model
    _adjust(best, config, principal_point=better, robust=True)
    best.update_point_3d_errors()
    return best


def _adjust(model: Any, config: SfmConfig, *, principal_point: bool, robust: bool) -> None:
    """Bundle adjustment; the principal point of cameras with few photos stays."""
    problem = pycolmap.BundleAdjustmentConfig()
    photos = Counter(model.images[number].camera_id for number in model.reg_image_ids())
    for number in model.reg_image_ids():
        problem.add_image(number)
    if principal_point:
        for camera, count in photos.items():
            if count < config.principal_point_photos:
                problem.set_constant_cam_intrinsics(camera)
    problem.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_principal_point = principal_point
    options.print_summary = False
    options.ceres.loss_function_type = (
        pycolmap.LossFunctionType.CAUCHY if robust else pycolmap.LossFunctionType.TRIVIAL
    )
    options.ceres.loss_function_scale = 1.0
    options.ceres.solver_options.max_num_iterations = config.adjustments
    options.ceres.solver_options.num_threads = config.mapper_threads
    pycolmap.create_default_bundle_adjuster(options, problem, model).solve()


def _incremental(config: SfmConfig, seed: int) -> Any:
    options = pycolmap.IncrementalPipelineOptions()
    options.min_num_matches = config.min_matches
    options.min_model_size = config.min_model_photos
    options.random_seed = options.mapper.random_seed = options.triangulation.random_seed = seed
    options.num_threads = options.mapper.num_threads = config.mapper_threads
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
    views = [view(model) for model in models]
    _match_neighbours(database_path, views, job, config)
    with pycolmap.Database.open(database_path) as database:
        ids = range(1, len(job["photos"]) + 1)
        features = [int(database.num_keypoints_for_image(number)) for number in ids]
        matches = verified_matches(database)
    entries = []
    for number, (model, seen) in enumerate(zip(models, views, strict=True)):
        text = work / "models" / str(number)
        shutil.rmtree(text, ignore_errors=True)
        text.mkdir(parents=True)
        model.write_text(text)
        rays = rays_of(matches, model)
        agreeing = [
            agreeing_share(r, seen.photos[a], seen.photos[b], config) for (a, b), r in rays.items()
        ]
        entries.append(
            {
                "photos": sorted(seen.photos),
                "points": len(seen.points),
                "error_px": float(model.compute_mean_reprojection_error()),
                "agreeing": float(np.median(agreeing)) if agreeing else 0.0,
                "contradicts_first": scales_contradict(views[0], seen),
                **asdict(coherence(seen, rays, config)),
            }
        )
    verified = [[first, second, len(points)] for (first, second), (points, _) in matches.items()]
    report = {"features": features, "verified": verified, "models": entries}
    unfinished = work / "report.json.part"
    unfinished.write_text(json.dumps(report), encoding="utf-8")
    unfinished.replace(work / "report.json")


def _match_neighbours(database: Path, views: list[ModelView], job: Job, config: SfmConfig) -> None:
    """Match photos that a model puts side by side and that nobody has compared yet."""
    strangers = {pair for model in views for pair in coherence(model, {}, config).strangers}
    missing = strangers - {tuple(pair) for pair in job["pairs"]}
    if missing:
        _match(database, [list(pair) for pair in sorted(missing)], config, job["seed"])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
