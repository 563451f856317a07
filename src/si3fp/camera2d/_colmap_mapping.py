"""Cameras and points from a database of matches by COLMAP's mappers; part of its process."""

from __future__ import annotations

import copy
import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

from si3fp.camera2d.coherence import strays
from si3fp.config import SfmConfig

Say = Callable[[str], None]
Job = dict[str, Any]


def mapped(
    database: Path, folder: Path, work: Path, config: SfmConfig, seed: int, say: Say
) -> list[Any]:
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
            initial_image_pair_callback=lambda: say("two cameras"),
            next_image_callback=lambda: say("camera"),
        )
    say("refinement")
    largest_first = sorted(models.values(), key=lambda model: -int(model.num_reg_images()))
    for model in largest_first:
        _drop_strays(model, config)
    return [refined(model, config) for model in largest_first]


def _drop_strays(model: Any, config: SfmConfig) -> None:
    """Take out photos that were put far away from all others, as false matches can do."""
    numbers = list(model.reg_image_ids())
    centres = np.array([model.images[number].projection_center() for number in numbers])
    for index in strays(centres, config.stray):
        model.deregister_frame(model.images[numbers[index]].frame_id)


def refined(model: Any, config: SfmConfig) -> Any:
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


def triangulated(database: Path, folder: Path, work: Path, job: Job) -> Any:
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
