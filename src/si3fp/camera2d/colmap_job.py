"""COLMAP's process: started, watched and ended; what it finished is kept in a work folder."""

from __future__ import annotations

import json
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from si3fp.camera2d.overlap import Features, features_of
from si3fp.camera2d.photo_pairs import pairs_to_match
from si3fp.config import CaptureConfig, SfmConfig
from si3fp.errors import ReconstructionError, SourceError

Progress = Callable[[str, int, int], None]
"""Told the step, how much of it is done, and of how much."""

_JOB = "job.json"
_POLL_S = 0.3
_LOG_LINES = 8
_KILLED = -9  # by the system, where memory ends
# Settings of `SfmConfig` on which features and matches rest.
_OF_DATABASE = (
    *("max_side_px", "max_features", "min_matches"),
    *("all_pairs_up_to", "followers", "near_photos", "near_m"),
)


def run_job(
    folder: Path,
    work_dir: Path,
    job: dict[str, Any],
    config: SfmConfig,
    seed: int,
    progress: Progress,
) -> dict[str, Any]:
    """The report of COLMAP's process; the earlier one where nothing changed.

    Parameters
    ----------
    folder
        The photos' files.
    work_dir
        Keeps what is finished.
    job
        ``photos`` with ``name``, ``sha256`` and the index of their ``camera``; ``cameras`` as
        COLMAP's attributes; where known ``poses`` (3, 4) as lists, then only points are sought, or
        ``places`` in metres, None where unknown.
    config, seed
        Constants.
    progress
        Told the steps.

    Raises
    ------
    SourceError
        If ``work_dir`` cannot be written.
    ReconstructionError
        If the process fails.
    """
    job = {**job, "config": asdict(config), "seed": seed, "colmap": version("pycolmap")}
    job = json.loads(json.dumps(job))
    report_file = work_dir / "report.json"
    try:
        work_dir.mkdir(parents=True, exist_ok=True)
        old_pairs = _keep_what_holds(work_dir, job)
        pairs = _pairs(folder, job, config, progress) if old_pairs is None else old_pairs
        if not report_file.exists():
            content = json.dumps({**job, "folder": str(folder.resolve()), "pairs": pairs})
            (work_dir / _JOB).write_text(content, encoding="utf-8")
            _run_process(work_dir, len(job["photos"]), len(pairs), progress)
        report: dict[str, Any] = json.loads(report_file.read_text(encoding="utf-8"))
    except OSError as error:
        raise SourceError(f"Could not work in {work_dir}: {error.strerror or error}.") from error
    return report


def _keep_what_holds(work_dir: Path, job: dict[str, Any]) -> list[tuple[int, int]] | None:
    """Pairs of an earlier run with the same photos and settings; removes what does not hold now."""
    try:
        old = json.loads((work_dir / _JOB).read_text(encoding="utf-8"))
        pairs = [(first, second) for first, second in old["pairs"]]
        same_model = all(old.get(key) == value for key, value in job.items())
        same_database = _database_rests_on(old) == _database_rests_on(job)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        same_model = same_database = False
    if not same_model:
        (work_dir / "report.json").unlink(missing_ok=True)
        for name in ("models", "sparse"):
            shutil.rmtree(work_dir / name, ignore_errors=True)
    if not same_database:
        for file in work_dir.glob("database.db*"):
            file.unlink()
        return None
    return pairs


def _database_rests_on(job: dict[str, Any]) -> list[Any]:
    """What features and matches depend on."""
    whole = [job.get(key) for key in ("photos", "cameras", "places", "seed", "colmap")]
    return [*whole, *(job["config"][key] for key in _OF_DATABASE)]


def _pairs(
    folder: Path, job: dict[str, Any], config: SfmConfig, progress: Progress
) -> list[tuple[int, int]]:
    names = [photo["name"] for photo in job["photos"]]
    capture = CaptureConfig()

    def coarse() -> list[Features]:
        found = []
        for done, name in enumerate(names):
            progress("pairs", done, len(names))
            content = np.frombuffer((folder / name).read_bytes(), np.uint8)
            grey = cv2.imdecode(content, cv2.IMREAD_GRAYSCALE)
            if grey is None:
                grey = np.zeros((32, 32), np.uint8)  # COLMAP will say what it makes of the file
            found.append(features_of(np.asarray(grey, np.uint8), capture))
        progress("pairs", len(names), len(names))
        return found

    places = [place or [np.nan] * 3 for place in job.get("places", [None] * len(names))]
    return pairs_to_match(places, coarse, config, capture)


def _run_process(work_dir: Path, photos: int, pairs: int, progress: Progress) -> None:
    """Run COLMAP to its end; it is killed when this process is interrupted."""
    said, log = work_dir / "progress.txt", work_dir / "process.log"
    command = [
        *(sys.executable, "-P", "-m", "si3fp.camera2d._colmap_process"),
        str((work_dir / _JOB).resolve()),
    ]
    with (
        said.open("w", encoding="utf-8") as lines,
        log.open("w", encoding="utf-8") as errors,
        # Its stdin is a pipe that is closed when this process dies, however it dies.
        subprocess.Popen(  # noqa: S603 - our own interpreter and module
            command, stdin=subprocess.PIPE, stdout=lines, stderr=errors
        ) as process,
    ):
        try:
            while process.poll() is None:
                with suppress(subprocess.TimeoutExpired):
                    process.wait(_POLL_S)
                progress(*_state(work_dir, said, photos, pairs))
        except BaseException:
            process.kill()
            raise
    if process.returncode != 0:
        last = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()[-_LOG_LINES:]
        how = f"exit code {process.returncode}"
        if process.returncode < 0:
            how = f"killed by signal {-process.returncode}"
        if process.returncode == _KILLED:
            how += ", perhaps for want of memory: set SfmConfig.threads to 1"
        raise ReconstructionError(
            f"COLMAP's process ended early ({how}):\n  "
            + "\n  ".join(last or ["it said nothing"])
            + f"\nSee {log}. What is done is kept: run it again to go on. If it fails again, "
            f"delete {work_dir}."
        )


def _state(work_dir: Path, said: Path, photos: int, pairs: int) -> tuple[str, int, int]:
    """Step, how much of it is done, and of how much."""
    lines = said.read_text(encoding="utf-8").splitlines()
    if "cameras" in lines:
        # COLMAP begins with two photos, and again with a second model.
        models = "\n".join(lines).split("two cameras")
        return "cameras", min(models[-1].count("camera") + 2, photos) * (len(models) > 1), photos
    step, table, total = "features", "descriptors", photos
    if "matches" in lines:
        step, table, total = "matches", "matches", pairs
    try:
        database = f"{(work_dir / 'database.db').resolve().as_uri()}?mode=ro"
        with closing(sqlite3.connect(database, uri=True)) as connection:
            (done,) = connection.execute(f"SELECT COUNT(*) FROM {table}").fetchone()  # noqa: S608
    except sqlite3.Error:  # not there yet, or just being written
        done = 0
    return step, min(done, total), total
