"""The steps of a run with their files: each skips what a former run has finished.

Algorithms live in the modules below; here stands what is read, kept and written, and where one
facade's failure becomes a `Missing` row.
"""

from si3fp.steps.capture import CaptureCheck, check_photos
from si3fp.steps.evaluation import ModelEvaluation, evaluate_model
from si3fp.steps.facades import find_facade, register_facades
from si3fp.steps.inputs import Circle, StreetInputs, claim, collect, run_key, street_record
from si3fp.steps.models import build_models, simulate_run, write_run
from si3fp.steps.photo_facades import find_photo_facade
from si3fp.steps.photo_inputs import PhotoFiles, collect_photos, photo_run_key
from si3fp.steps.photo_scene import (
    PhotoScene,
    find_poses,
    make_scene,
    photos_record,
    write_sparse_cloud,
)
from si3fp.steps.pictures import Picture, detect_pictures, picture_files
from si3fp.steps.rectified import Progress, make_views, plan, write_cloud

__all__ = [
    "CaptureCheck",
    "Circle",
    "ModelEvaluation",
    "PhotoFiles",
    "PhotoScene",
    "Picture",
    "Progress",
    "StreetInputs",
    "build_models",
    "check_photos",
    "claim",
    "collect",
    "collect_photos",
    "detect_pictures",
    "evaluate_model",
    "find_facade",
    "find_photo_facade",
    "find_poses",
    "make_scene",
    "make_views",
    "photo_run_key",
    "photos_record",
    "picture_files",
    "plan",
    "register_facades",
    "run_key",
    "simulate_run",
    "street_record",
    "write_cloud",
    "write_run",
    "write_sparse_cloud",
]
