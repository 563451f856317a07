"""``estate.json``: what a folder holds, and the code that made it."""

from __future__ import annotations

import hashlib
import json
import platform
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Any

from benchmarks.estate.capture.picture_files import write_json
from benchmarks.estate.capture.pictures import Size
from benchmarks.estate.capture.reported import noise_record
from benchmarks.estate.capture.walk import GPS_SIGMA_M
from benchmarks.estate.plan import Estate
from benchmarks.estate.rendering.denoise import available

from si3fp.errors import InputError

Json = dict[str, Any]


def claimed(
    folder: Path,
    estate: Estate,
    size: Size,
    counts: dict[str, int],
    *,
    drone: bool = False,
    survey: Json | None = None,
) -> Json:
    """The record of the folder, which is this estate's from now on.

    Parameters
    ----------
    estate, size
        What the folder is for; one that holds something else is an error.
    counts
        Of ``panoramas``, of ``photos`` of the walk, and of photos by ``drone``. The last are
        recorded as 0 until a call asks for them, and stay from then on.
    drone
        Whether this call asks for them.
    survey
        What became of the openings of a surveyed building.

    Raises
    ------
    InputError
        If the folder holds another plan, seed, size or number of pictures, or no estate at all.
    """
    file = folder / "estate.json"
    identity: Json = {
        "schema": "estate",
        "name": estate.name,
        "seed": estate.seed,
        "plan_sha256": plan_sha256(estate),
        "size": asdict(size),
    }
    if file.exists():
        record: Json = json.loads(file.read_text(encoding="utf-8"))
        _same(folder, record, identity)
        if "code_sha256" not in record:  # of before it was recorded
            record["code_sha256"] = [None]
            record["counts"]["photos"] -= record["counts"]["drone"]
    elif folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder} is not empty and holds no estate. Give another with -o.")
    else:
        record = {
            **identity,
            "counts": {**counts, "drone": 0},
            "light": asdict(estate.light),
            "origin": asdict(estate.origin),
            "denoised": available(),
            "noise": {**noise_record(), "gps_sigma_m": GPS_SIGMA_M},
            "versions": {name: _version(name) for name in ("si3fp", "mitsuba", "drjit", "numpy")}
            | {"python": platform.python_version()},
            "code_sha256": [],
            "seconds": {},
        }
    if drone and not record["counts"]["drone"]:
        record["counts"]["drone"] = counts["drone"]
    wanted = counts if record["counts"]["drone"] else {**counts, "drone": 0}
    _same(folder, record, {"counts": wanted})
    if survey is not None:
        record["survey"] = survey
    code = code_sha256()
    if code not in record["code_sha256"]:
        record["code_sha256"].append(code)
    write_json(file, record)
    return record


def plan_sha256(estate: Estate) -> str:
    """The digest of a plan: equal where name, seed and the code that draws plans are."""
    text = json.dumps(asdict(estate), sort_keys=True, default=float)
    return hashlib.sha256(text.encode()).hexdigest()


def code_sha256() -> str:
    """The digest of the generator's own source files, their names and their lines."""
    root = Path(__file__).parent
    digest = hashlib.sha256()
    for name in sorted(file.relative_to(root).as_posix() for file in root.rglob("*.py")):
        digest.update(f"{name}\n{(root / name).read_text(encoding='utf-8')}\n".encode())
    return digest.hexdigest()


def _same(folder: Path, record: Json, wanted: Json) -> None:
    for key, value in wanted.items():
        if record.get(key) != value:
            raise InputError(
                f"{folder} holds an estate with {key} {record.get(key)!r}, not {value!r}. "
                "Give another folder with -o, or remove this one."
            )


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
