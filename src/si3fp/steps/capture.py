"""C.1 with its files: is a folder of photos ready, and which photos must be taken again?"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from si3fp.camera2d.capture import CaptureVerdict, judge
from si3fp.camera2d.facts import PhotoFacts
from si3fp.camera2d.overlap import Features, Overlap, features_of, find_overlaps
from si3fp.camera2d.quality import blur_px, clipped_shares
from si3fp.config import CaptureConfig
from si3fp.errors import InputError
from si3fp.sources.images import load_picture, read_header
from si3fp.steps.pictures import picture_files
from si3fp.steps.rectified import Progress
from si3fp.workspace import claim_file, dump_json, sha256_of, stamp, write_text

SCHEMA = "capture"
_GPS_LATITUDE, _GPS_LONGITUDE = 2, 4


@dataclass(frozen=True, slots=True)
class CaptureCheck:
    """What was measured on the photos of a folder, and the verdict on them.

    Attributes
    ----------
    folder
        Where the photos are.
    facts
        One entry per photo that could be read, by name.
    overlaps
        Pairs of those that show the same place, by index.
    verdict
        Whether the set is ready, and what to do.
    """

    folder: Path
    facts: tuple[PhotoFacts, ...]
    overlaps: tuple[Overlap, ...]
    verdict: CaptureVerdict

    @property
    def summary(self) -> str:
        """The verdict in plain words: photos that are not ok, what to do, notes, ready or not."""
        verdict = self.verdict
        lines = [
            f"{photo.name}: {photo.rating}: {reason}"
            for photo in verdict.photos
            for reason in photo.reasons
        ]
        lines += [*verdict.to_do, *(f"Note: {note}" for note in verdict.notes)]
        ratings = [photo.rating for photo in verdict.photos]
        count = (
            f"{ratings.count('ok')} ok, {ratings.count('check')} to check, "
            f"{ratings.count('retake')} to retake"
        )
        answer = "ready" if verdict.ready else "NOT ready"
        if verdict.ready and "retake" in ratings:
            answer = "ready, without the photos to retake"
        return "\n".join([*lines, f"{self.folder}: {len(ratings)} photos ({count}): {answer}"])


def check_photos(
    folder: Path,
    out: Path | None = None,
    *,
    overwrite: bool = False,
    config: CaptureConfig | None = None,
    progress: Progress = lambda step, done, total: None,
) -> CaptureCheck:
    """The verdict on the photos of a folder; writes it to ``out`` as JSON where that is given.

    Parameters
    ----------
    folder
        JPEG or PNG files, named in the order in which they were taken.
    out
        JSON to write.
    overwrite
        Replace an earlier result. Other files are never replaced.
    config
        Limits; the defaults where left out.
    progress
        Told how many photos are measured and how many pairs are matched.

    Raises
    ------
    InputError
        If ``folder`` is no folder or holds no photo, or ``out`` must not be written.
    SourceError
        If ``out`` cannot be written.
    """
    config = config or CaptureConfig()
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder. Give the folder that holds the photos.")
    if out is not None:
        claim_file(out, SCHEMA, "photos", overwrite)
    files = picture_files([folder])
    facts: list[PhotoFacts] = []
    features: list[Features] = []
    unreadable: dict[str, str] = {}
    for done, file in enumerate(files):
        progress("photos", done, len(files))
        try:
            fact, feature = _measured(file, config)
        except InputError as error:
            unreadable[file.name] = str(error).removeprefix(str(file)).lstrip(": ")
        else:
            facts.append(fact)
            features.append(feature)
    progress("photos", len(files), len(files))
    overlaps = find_overlaps(features, config, lambda done, total: progress("overlap", done, total))
    verdict = judge(facts, overlaps, unreadable, config)
    check = CaptureCheck(folder, tuple(facts), tuple(overlaps), verdict)
    if out is not None:
        write_text(out, dump_json(capture_record(check, config)))
    return check


def capture_record(check: CaptureCheck, config: CaptureConfig) -> dict[str, Any]:
    """The JSON of a capture check."""
    verdict = check.verdict
    facts = {fact.name: fact for fact in check.facts}
    names = list(facts)
    return {
        **stamp(SCHEMA),
        "config": asdict(config),
        "inputs": {(check.folder / name).as_posix(): fact.sha256 for name, fact in facts.items()},
        "ready": verdict.ready,
        "to_do": verdict.to_do,
        "notes": verdict.notes,
        "photos": [
            {
                "file": photo.name,
                "rating": photo.rating,
                "reasons": photo.reasons,
                "overlaps_with": photo.neighbours,
                "measured": _fact_record(facts[photo.name]) if photo.name in facts else None,
            }
            for photo in verdict.photos
        ],
        "groups": verdict.groups,
        "weak_links": [{"photo": photo, "holds": group} for photo, group in verdict.weak],
        "overlaps": [
            {
                "photos": [names[pair.first], names[pair.second]],
                "matches": pair.matches,
                "share": round(pair.share, 4),
                "moved": round(pair.moved, 4),
            }
            for pair in check.overlaps
        ],
    }


def _fact_record(fact: PhotoFacts) -> dict[str, Any]:
    record = asdict(fact)
    for name in ("blur_px", "black", "white"):
        record[name] = round(record[name], 4)
    return {key: value for key, value in record.items() if key not in ("name", "sha256")}


def _measured(file: Path, config: CaptureConfig) -> tuple[PhotoFacts, Features]:
    """One photo: decoded once, at a reduced size where it is large."""
    header = read_header(file)
    rgb = load_picture(file, config.max_pixels, config.work_side_px)
    scale = min(1.0, config.work_side_px / max(rgb.shape))
    small = cv2.resize(
        cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY),
        None,
        fx=scale,
        fy=scale,
        interpolation=cv2.INTER_AREA,
    )
    grey = np.asarray(small, np.uint8)
    sides = (header.width_px, header.height_px)
    width_px, height_px = sides[::-1] if header.orientation >= 5 else sides
    black, white = clipped_shares(grey)
    fact = PhotoFacts(
        name=file.name,
        sha256=sha256_of(file),
        width_px=width_px,
        height_px=height_px,
        camera=header.camera,
        focal_mm=header.focal_mm,
        focal_35mm=header.focal_35mm,
        has_gps=_GPS_LATITUDE in header.gps and _GPS_LONGITUDE in header.gps,
        blur_px=blur_px(grey),
        black=black,
        white=white,
    )
    return fact, features_of(grey, config)
