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
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pycolmap

from si3fp.camera2d._colmap_mapping import Job, mapped, triangulated
from si3fp.camera2d._colmap_matching import match, match_neighbours, rename
from si3fp.camera2d._colmap_numbers import rays_of, verified_matches, view
from si3fp.camera2d._colmap_unfolding import Unfolded, unfolded
from si3fp.camera2d.coherence import agreeing_share, coherence, scales_contradict
from si3fp.config import SfmConfig


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
    match(database, job["pairs"], config, job["seed"])
    _say("cameras")
    if "poses" in job:
        result = Unfolded([triangulated(database, folder, work, job)], database)
    else:
        models = mapped(database, folder, work, config, job["seed"], _say)
        result = unfolded(models, database, folder, job, config, _say)
    _write_report(work, result, job, config)
    for copied in work.glob("unfolded-*.db"):
        copied.unlink()


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
            rename(database, [photo["name"] for photo in job["photos"]])
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


def _write_report(work: Path, result: Unfolded, job: Job, config: SfmConfig) -> None:
    """Write the models as text and what the parent needs to judge them."""
    views = [view(model) for model in result.models]
    match_neighbours(result.database, views, job, config)
    with pycolmap.Database.open(result.database) as database:
        ids = range(1, len(job["photos"]) + 1)
        features = [int(database.num_keypoints_for_image(number)) for number in ids]
        matches = verified_matches(database)
    entries = []
    for number, (model, seen) in enumerate(zip(result.models, views, strict=True)):
        text = work / "models" / str(number)
        shutil.rmtree(text, ignore_errors=True)
        text.mkdir(parents=True)
        model.write_text(text)
        rays = rays_of(matches, model)
        errors_px = [point.error for point in model.points3D.values()]
        agreeing = [
            agreeing_share(r, seen.photos[a], seen.photos[b], config) for (a, b), r in rays.items()
        ]
        entries.append(
            {
                "photos": sorted(seen.photos),
                "points": len(seen.points),
                "error_px": float(np.median(errors_px)) if errors_px else 0.0,
                "agreeing": float(np.median(agreeing)) if agreeing else 0.0,
                "contradicts_first": scales_contradict(views[0], seen),
                **asdict(coherence(seen, rays, config)),
            }
        )
    verified = [[first, second, len(points)] for (first, second), (points, _) in matches.items()]
    report = {
        "features": features,
        "verified": verified,
        "models": entries,
        "set_aside": result.set_aside,
        "left_out": result.left_out,
    }
    unfinished = work / "report.json.part"
    unfinished.write_text(json.dumps(report), encoding="utf-8")
    unfinished.replace(work / "report.json")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
