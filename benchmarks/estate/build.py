"""An estate on disk: the inputs of both paths as a user has them, and the truth beside them.

::

    estate.json                         what was built, with which noise and code
    footprints.geojson
    panoramas.geojson panoramas/ depth/ for si3fp street
    photos/ reference_triangle.json     for si3fp photos
    truth/model.hbjson facades.json poses.json
    truth/cameras/                      exact poses and lens of the photos, COLMAP's text
    truth/ortho/<facade>.png .npy       orthophotos without trees and cars; metres before the plane
    truth/seen/<camera>/<facade>.png    what a picture could show of a facade, where it shows any
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, Literal

from benchmarks.estate.capture.cameras import Pose
from benchmarks.estate.capture.drive import panorama_poses
from benchmarks.estate.capture.picture_files import write_json, write_text
from benchmarks.estate.capture.pictures import Pictures, Say, Size, Task
from benchmarks.estate.capture.reported import noise_record, panorama_feature, reported
from benchmarks.estate.capture.truth import (
    facades_record,
    footprints_geojson,
    poses_record,
    truth_model,
)
from benchmarks.estate.capture.walk import (
    colmap_text,
    flight_around,
    photo_lens,
    triangle_record,
    walk_around,
)
from benchmarks.estate.plan import Estate
from benchmarks.estate.record import claimed

from si3fp.sources.plane_map import encode_plane_map

Part = Literal["panoramas", "photos", "truth"]
PARTS: tuple[Part, ...] = ("panoramas", "photos", "truth")
Json = dict[str, Any]


def build(
    estate: Estate,
    folder: Path,
    size: Size,
    *,
    only: tuple[Part, ...] = PARTS,
    drone: bool = False,
    survey: Json | None = None,
    variant: str | None = None,
    say: Say = lambda line: None,
) -> Json:
    """The content of ``estate.json``, once everything is in ``folder``; what is there stays.

    Parameters
    ----------
    estate, size
        What is rendered, and how finely.
    only
        The parts to make; a later call with other parts adds them.
    drone
        Photos from the air too; a folder that has them keeps them without being asked.
    survey
        What became of the openings of a surveyed building, for the record.
    variant
        Of Mitsuba; by default the fastest that works.
    say
        Gets a line of text for every picture.

    Raises
    ------
    InputError
        If the folder holds another plan, seed, size or number of pictures, or no estate at all.
    """
    panoramas = panorama_poses(estate, size.most_per_facade)
    walk = walk_around(estate, size.photos)
    flight = flight_around(estate, size.flight)
    counts = {"panoramas": len(panoramas), "photos": len(walk.poses), "drone": len(flight)}
    record = claimed(folder, estate, size, counts, drone=drone, survey=survey)
    photos = {**walk.poses, **(flight if record["counts"]["drone"] else {})}
    write_json(folder / "footprints.geojson", footprints_geojson(estate))
    pictures = Pictures(estate, folder, size, panoramas, photos, variant=variant, say=say)
    tasks: list[Task] = []
    if "panoramas" in only:
        _write_panoramas(estate, folder, panoramas)
        tasks += pictures.of_panoramas()
    if "photos" in only:
        write_json(folder / "reference_triangle.json", triangle_record(walk, estate.seed))
        tasks += pictures.of_photos()
    if "truth" in only:
        _write_truth(estate, folder / "truth", size, panoramas, photos)
        tasks += pictures.of_truth()
    _work(tasks, folder, record, say)
    return record


def _write_panoramas(estate: Estate, folder: Path, panoramas: dict[str, Pose]) -> None:
    """``panoramas.geojson`` and ``depth/``: poses and planes as reported."""
    names = list(panoramas)
    features = []
    for index, name in enumerate(names):
        pose, planes, plane_index = reported(estate, name, panoramas[name])
        links = [names[i] for i in (index - 1, index + 1) if 0 <= i < len(names)]
        features.append(panorama_feature(name, pose, estate, links))
        write_text(folder / "depth" / f"{name}.b64", encode_plane_map(planes, plane_index))
    collection = {"type": "FeatureCollection", "noise": noise_record(), "features": features}
    write_json(folder / "panoramas.geojson", collection)


def _write_truth(
    estate: Estate, folder: Path, size: Size, panoramas: dict[str, Pose], photos: dict[str, Pose]
) -> None:
    """All of the truth that is not a picture."""
    write_json(folder / "model.hbjson", truth_model(estate))
    write_json(folder / "facades.json", facades_record(estate))
    write_json(folder / "poses.json", poses_record({**panoramas, **photos}, estate.origin))
    for name, text in colmap_text(photos, photo_lens(size.photo_px)).items():
        write_text(folder / "cameras" / name, text)


def _work(tasks: list[Task], folder: Path, record: Json, say: Say) -> None:
    """Do what is not there yet, with the time left as the work so far foretells it."""
    left = [task for task in tasks if not task.file.exists()]
    if len(left) < len(tasks):
        say(f"{len(tasks) - len(left)} of {len(tasks)} pictures are there already")
    whole = sum(task.cost for task in left)
    seconds, done, start = record["seconds"], 0.0, time.monotonic()
    for number, task in enumerate(left, start=1):
        begun = time.monotonic()
        task.make()
        now = time.monotonic()
        done += task.cost
        seconds[task.kind] = round(seconds.get(task.kind, 0.0) + now - begun, 1)
        write_json(folder / "estate.json", record)
        minutes = (now - start) * (whole / done - 1) / 60
        name = task.file.relative_to(folder)
        say(f"{number}/{len(left)} {name} {now - begun:.1f} s, {minutes:.0f} min left")
