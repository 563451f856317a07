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
from typing import Any

import numpy as np
import pycolmap

from si3fp.camera2d._colmap_mapping import mapped, triangulated
from si3fp.camera2d._colmap_numbers import all_matches, rays_of, verified_matches, view
from si3fp.camera2d.coherence import (
    Coherence,
    ModelView,
    Pair,
    agreeing_share,
    coherence,
    folded,
    scales_contradict,
)
from si3fp.camera2d.unfold import displaced, follows
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
    set_aside: list[Pair] = []
    if "poses" in job:
        models = [triangulated(database, folder, work, job)]
    else:
        models = mapped(database, folder, work, config, job["seed"], _say)
        models, database, set_aside = _unfolded(models, database, folder, job, config)
    _write_report(database, work, models, set_aside, job, config)
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


def _unfolded(
    models: list[Any], database: Path, folder: Path, job: Job, config: SfmConfig
) -> tuple[list[Any], Path, list[Pair]]:
    """The models, without a fold where that can be, their matches, and pairs that lost some.

    What folds a model is taken out of a copy of the database, and the cameras are sought again.
    """
    lost: list[Pair] = []
    if not models:
        return models, database, lost
    seen, found = _judged(models[0], database, job, config)
    current = database
    for number in range(config.most_folds):
        if not folded(len(found.strangers), found.neighbours, config):
            break
        attempt = database.with_name(f"unfolded-{number}.db")
        shutil.copyfile(current, attempt)
        parted = _part(attempt, models[0], seen, found, job, config)
        if not parted:
            break
        again = mapped(attempt, folder, database.parent, config, job["seed"], _say)
        if not again or 2 * again[0].num_reg_images() < models[0].num_reg_images():
            break
        seen, after = _judged(again[0], attempt, job, config)
        if 2 * len(after.strangers) > len(found.strangers):
            break
        models, found, current = again, after, attempt
        lost += parted
    return models, current, sorted(set(lost))


def _judged(model: Any, database: Path, job: Job, config: SfmConfig) -> tuple[ModelView, Coherence]:
    seen = view(model)
    _match_neighbours(database, [seen], job, config)
    with pycolmap.Database.open(database) as some:
        return seen, coherence(seen, rays_of(verified_matches(some), model), config)


def _part(
    database: Path, model: Any, seen: ModelView, found: Coherence, job: Job, config: SfmConfig
) -> list[Pair]:
    """Pairs of photos whose matches folded a model; the database loses them and keeps the rest."""
    with pycolmap.Database.open(database) as some:
        rays = rays_of(verified_matches(some), model)
        followed = {pair: int(follows(r, pair, seen, config).sum()) for pair, r in rays.items()}
        stretch = displaced(sorted(seen.photos), found.strangers, followed)
        crossing = [pair for pair in rays if (pair[0] in stretch) != (pair[1] in stretch)]
        everything = all_matches(some, crossing)
        rays = rays_of({pair: pixels for pair, (_, pixels) in everything.items()}, model)
        left = []
        for pair in crossing:
            indices, _ = everything[pair]
            kept = indices[~follows(rays[pair], pair, seen, config)]
            ids = (pair[0] + 1, pair[1] + 1)
            some.delete_two_view_geometry(*ids)
            some.delete_matches(*ids)
            if len(kept) >= config.min_matches:
                some.write_matches(*ids, kept)
                left.append(list(pair))
    if left:
        _match(database, left, config, job["seed"])  # what is matched is only verified
    return [pair for pair in crossing if followed[pair]]


def _write_report(
    database_path: Path,
    work: Path,
    models: list[Any],
    set_aside: list[Pair],
    job: Job,
    config: SfmConfig,
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
    report = {
        "features": features,
        "verified": verified,
        "models": entries,
        "set_aside": set_aside,
    }
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
