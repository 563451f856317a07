"""One building, seed and path: its rendered set, its run and its evaluation, made or read.

::

    DIR/<building>-<size>-<seed>/set/            the rendered set
    DIR/<building>-<size>-<seed>/<run>/          street, photos-radiance or photos-mosaic
    DIR/<building>-<size>-<seed>/<run>-scores/   evaluation.json
    DIR/<building>-<size>-<seed>/stages/         what every command took and said
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from benchmarks.tables.stages import Stage, read_stage, run_stage
from PIL import Image

from si3fp.errors import InputError
from si3fp.workspace import read_json, sha256_of

PathName = Literal["street", "photos"]
Json = dict[str, Any]
PARTS = {"street": ("panoramas", "truth"), "photos": ("photos", "truth")}
PART_FAILED = 3  # exit code of a run of which a facade failed


@dataclass(frozen=True)
class Case:
    """What there is of one run; what is not there is None, and ``problem`` says why.

    Attributes
    ----------
    building, seed, path
        Name of the estate, its seed, and ``street`` or ``photos``.
    renderer
        Of the photos' run.
    folder
        Of this building and seed.
    evaluation, run
        Contents of ``evaluation.json`` and ``run.json``.
    stage
        What the run took.
    problem
        Why there is no evaluation; empty where there is one.
    """

    building: str
    seed: int
    path: PathName
    renderer: str
    folder: Path
    evaluation: Json | None = None
    run: Json | None = None
    stage: Stage | None = None
    problem: str = ""

    @property
    def run_name(self) -> str:
        """Name of the run's folder."""
        return self.path if self.path == "street" else f"photos-{self.renderer}"

    @property
    def label(self) -> str:
        """Building, seed and run in words."""
        return f"{self.building} seed {self.seed} {self.run_name}"

    @property
    def set_folder(self) -> Path:
        """The rendered set."""
        return self.folder / "set"

    @property
    def run_folder(self) -> Path:
        """What si3fp wrote."""
        return self.folder / self.run_name

    @property
    def scores_folder(self) -> Path:
        """What the evaluation wrote."""
        return self.folder / f"{self.run_name}-scores"

    def record(self, stage: str) -> Path:
        """File that says what became of a stage."""
        return self.folder / "stages" / f"{stage}.json"


@dataclass(frozen=True)
class Pictures:
    """Number and size of the pictures of one kind in a set, for example 100 of 1600 x 1200."""

    count: int
    size_px: str


def make(case: Case, size: str, paths: Sequence[str], limit_s: float, *, again: bool) -> Case:
    """The case with everything that could be made; finished stages are not repeated.

    Parameters
    ----------
    case
        What to make.
    size
        Of the set: ``small`` or ``full``.
    paths
        All paths that the set has to serve.
    limit_s
        Longest time of one stage.
    again
        Repeat the run and the evaluation (of changed code); the set stays.
    """
    wanted = sorted({part for path in paths for part in PARTS[path]})
    build = run_stage(
        case.record("build"),
        [
            *(sys.executable, "-m", "benchmarks.estate", "build", case.building),
            *("--seed", str(case.seed), "--size", size, "-o", str(case.set_folder)),
            *(word for part in wanted for word in ("--only", part)),
        ],
        limit_s=limit_s,
    )
    if not build.done:
        return _read(replace(case, problem=f"rendering failed: {build.reason}"))
    truth = case.set_folder / "truth" / "model.hbjson"
    if not truth.exists():
        return _read(replace(case, problem=f"{truth} is missing; remove {case.record('build')}"))
    stage = run_stage(
        case.record(case.run_name),
        _run_command(case),
        allowed=(0, PART_FAILED),
        limit_s=limit_s,
        key=sha256_of(truth),
        extra=("--overwrite",) if again else (),
    )
    if not stage.done:
        return _read(replace(case, problem=f"the run failed: {stage.reason}"))
    model = case.run_folder / "model.hbjson"
    if not model.exists():
        return _read(replace(case, problem=f"the run wrote no {model.name}"))
    scores = run_stage(
        case.record(f"{case.run_name}-scores"),
        [
            *(sys.executable, "-m", "si3fp.cli", "evaluate", str(case.run_folder)),
            *("--truth", str(truth), "-o", str(case.scores_folder), "--overwrite"),
        ],
        limit_s=limit_s,
        key=sha256_of(model),
    )
    problem = "" if scores.done else f"the evaluation failed: {scores.reason}"
    return _read(replace(case, problem=problem))


def read(case: Case) -> Case:
    """The case with everything that is there, and why an evaluation is not."""
    for stage, failed in (
        ("build", "rendering failed"),
        (case.run_name, "the run failed"),
        (f"{case.run_name}-scores", "the evaluation failed"),
    ):
        record = read_stage(case.record(stage))
        if record is None:
            return _read(replace(case, problem=f"not done yet: {stage}"))
        if not record.done:
            return _read(replace(case, problem=f"{failed}: {record.reason}"))
    return _read(case)


def pictures_of(case: Case, kind: str) -> Pictures | None:
    """Number and size of the ``panoramas`` or ``photos`` of a set, None without any."""
    files = sorted((case.set_folder / kind).glob("*.jpg"))
    if not files:
        return None
    with Image.open(files[0]) as picture:
        width_px, height_px = picture.size
    return Pictures(len(files), f"{width_px} x {height_px}")


def seconds_of(case: Case) -> dict[str, float]:
    """Seconds that one panorama, one photo and the truth of the whole set took to render."""
    record = _json(case.set_folder / "estate.json") or {}
    spent: dict[str, float] = record.get("seconds", {})
    found = {}
    for kind in ("panoramas", "photos"):
        pictures = pictures_of(case, kind)
        if pictures is not None and kind in spent:
            found[kind] = spent[kind] / pictures.count
    if "orthophotos" in spent:
        found["truth"] = spent["orthophotos"] + spent.get("masks", 0.0)
    return found


def _run_command(case: Case) -> list[str]:
    start = [sys.executable, "-m", "si3fp.cli", case.path]
    end = ["--footprints", str(case.set_folder / "footprints.geojson"), "-o", str(case.run_folder)]
    if case.path == "street":
        return [*start, str(case.set_folder / "panoramas.geojson"), *end]
    return [
        *(*start, str(case.set_folder / "photos")),
        *("--triangle", str(case.set_folder / "reference_triangle.json")),
        *("--renderer", case.renderer, *end),
    ]


def _read(case: Case) -> Case:
    """The case with its files, where they can be read and nothing failed before them."""
    evaluation = None if case.problem else _json(case.scores_folder / "evaluation.json")
    run = _json(case.run_folder / "run.json")
    problem = case.problem or ("" if evaluation else "evaluation.json is missing")
    return replace(
        case,
        evaluation=evaluation,
        run=run,
        stage=read_stage(case.record(case.run_name)),
        problem=problem,
    )


def _json(file: Path) -> Json | None:
    try:
        content: Json = read_json(file)
    except InputError:
        return None
    return content
