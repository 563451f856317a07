"""The only module that knows the file names of a run; writes to a temporary name and renames.

``RUN/ run.json  facades/<id>/{facade.json, ortho.png, coverage.png, views/*.png, detections.json,
windows.json, overlay.png}  buildings/<id>.hbjson  model.hbjson  windows.geojson  cloud.ply
report.html  simulation/  cache/``
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import si3fp
from si3fp.errors import InputError, SourceError
from si3fp.model import Image

SCHEMA_VERSION = 1


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """A temporary name beside ``path``, renamed onto it when the block ends without an error."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise SourceError(
            f"Could not write {path}: {error.strerror or error}. "
            "Free space or choose another folder, then run the same command again; "
            "finished work is kept."
        ) from error
    finally:
        with suppress(OSError):  # where the folder itself could not be made
            temporary.unlink(missing_ok=True)


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file in one step: the old one stays until the new one is complete."""
    with _replacing(path) as temporary:
        temporary.write_bytes(content)


def write_text(path: Path, content: str) -> None:
    """Write UTF-8 text in one step."""
    write_bytes(path, content.encode("utf-8"))


def write_png(path: Path, image: Image) -> None:
    """Write an image (H, W), (H, W, 3) RGB or (H, W, 4) RGBA, losslessly."""
    order = {3: cv2.COLOR_RGB2BGR, 4: cv2.COLOR_RGBA2BGRA}
    pixels = cv2.cvtColor(image, order[image.shape[2]]) if image.ndim == 3 else image
    done, encoded = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 3])
    if not done:
        raise SourceError(f"Could not encode {path} as PNG ({image.shape}, {image.dtype}).")
    write_bytes(path, encoded.tobytes())


def read_png(path: Path) -> Image:
    """An image that `write_png` wrote: (H, W), RGB or RGBA uint8."""
    damaged = SourceError(f"Could not read {path}; delete it and run the same command again.")
    try:
        # Not `cv2.imread`: on Windows it cannot open paths outside the system's code page.
        content = np.frombuffer(path.read_bytes(), np.uint8)
    except OSError as error:
        raise damaged from error
    pixels = cv2.imdecode(content, cv2.IMREAD_UNCHANGED) if content.size else None
    if pixels is None:
        raise damaged
    order = {3: cv2.COLOR_BGR2RGB, 4: cv2.COLOR_BGRA2RGBA}
    colours = cv2.cvtColor(pixels, order[pixels.shape[2]]) if pixels.ndim == 3 else pixels
    return np.ascontiguousarray(colours, dtype=np.uint8)


def write_array(path: Path, array: NDArray[Any]) -> None:
    """Write a plain numeric array as ``.npy`` (no pickle)."""
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=False)
    write_bytes(path, stream.getvalue())


def read_array(path: Path) -> NDArray[Any]:
    """An array that `write_array` wrote."""
    array: NDArray[Any] = np.load(path, allow_pickle=False)
    return array


def dump_json(payload: Any) -> str:
    """JSON text with a stable layout; numpy values become plain numbers, NaN is refused."""

    def plain(value: Any) -> Any:
        if isinstance(value, np.generic):
            return value.item()
        if isinstance(value, np.ndarray):
            return value.tolist()
        raise TypeError(f"Cannot write {type(value).__name__} as JSON.")

    return json.dumps(payload, indent=1, ensure_ascii=False, allow_nan=False, default=plain) + "\n"


def read_json(path: Path) -> Any:
    """The content of a JSON file.

    Raises
    ------
    InputError
        If the file is missing, cut short or not JSON.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"There is no file {path}.") from error
    except (ValueError, OSError) as error:
        raise InputError(f"{path} is not a readable JSON file: {error}") from error


def sha256_of(path: Path) -> str:
    """Hexadecimal SHA-256 of a file."""
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"Could not read {path}: {error.strerror or error}.") from error


def key_of(*parts: Any) -> str:
    """Hexadecimal SHA-256 of plain values: names the inputs of a finished step."""
    text = json.dumps(parts, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


class Workspace:
    """File names of one run.

    Parameters
    ----------
    root
        The folder RUN; created on the first write.
    """

    def __init__(self, root: Path) -> None:
        self.root = Path(root)

    @property
    def run_json(self) -> Path:
        """Times, versions, notes and the list of facades."""
        return self.root / "run.json"

    @property
    def model(self) -> Path:
        """All buildings of the run as one HBJSON."""
        return self.root / "model.hbjson"

    @property
    def windows_geojson(self) -> Path:
        """Windows for GIS."""
        return self.root / "windows.geojson"

    @property
    def cloud(self) -> Path:
        """The coloured points of the plane maps."""
        return self.root / "cloud.ply"

    @property
    def report(self) -> Path:
        """The self-contained report."""
        return self.root / "report.html"

    @property
    def simulation(self) -> Path:
        """Folder of the EnergyPlus run."""
        return self.root / "simulation"

    @property
    def simulation_result(self) -> Path:
        """Heating demand per building and month."""
        return self.simulation / "result.json"

    @property
    def cache(self) -> Path:
        """Intermediate files that make a run resumable; may be deleted when it is done."""
        return self.root / "cache"

    @property
    def key(self) -> Path:
        """Names the inputs and settings of the run."""
        return self.cache / "key.json"

    def raw_view(self, facade_id: str, panorama_id: str) -> Path:
        """A view before registration, RGBA."""
        return self.cache / "views" / safe_name(facade_id) / f"{safe_name(panorama_id)}.png"

    def points(self, panorama_id: str) -> Path:
        """Points of one panorama: (N, 6) x y z red green blue."""
        return self.cache / "points" / f"{safe_name(panorama_id)}.npy"

    def clear(self) -> None:
        """Remove what a run writes, and nothing else."""
        for folder in ("cache", "facades", "buildings", "simulation"):
            shutil.rmtree(self.root / folder, ignore_errors=True)
        for file in (self.run_json, self.model, self.windows_geojson, self.cloud, self.report):
            file.unlink(missing_ok=True)

    def building(self, building_id: str) -> Path:
        """One building's HBJSON."""
        return self.root / "buildings" / f"{safe_name(building_id)}.hbjson"

    def facade(self, facade_id: str, name: str) -> Path:
        """A file of one facade, for example ``ortho.png``."""
        return self.root / "facades" / safe_name(facade_id) / name

    def facade_ids(self) -> list[str]:
        """Ids of the finished facades, sorted by folder name."""
        return [
            read_json(path)["id"] for path in sorted((self.root / "facades").glob("*/facade.json"))
        ]

    def write_json(self, path: Path, schema: str, payload: dict[str, Any]) -> None:
        """Write a JSON with its schema and the package's version first."""
        write_text(path, dump_json({**stamp(schema), **payload}))


def stamp(schema: str) -> dict[str, str]:
    """Schema and version of the package: what every JSON of a run begins with."""
    return {"schema": f"si3fp/{schema}/{SCHEMA_VERSION}", "si3fp_version": si3fp.__version__}


def safe_name(name: str) -> str:
    """A file name for an id: other characters than letters, digits, dot, dash become ``_``.

    An id that had to be changed gets a short hash, so that different ids never share a file.

    Examples
    --------
    >>> safe_name("wing-a-0")
    'wing-a-0'
    >>> safe_name("a/b") == safe_name("a_b")
    False
    """
    cleaned = re.sub(r"[^\w.\-]", "_", name, flags=re.ASCII).lstrip(".") or "_"
    if cleaned == name and len(cleaned) <= 100:
        return cleaned
    return f"{cleaned[:80]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def claim_file(path: Path, schema: str, verb: str, overwrite: bool) -> None:
    """Make sure that a file is free, or an earlier result of the same kind that may be replaced.

    Parameters
    ----------
    path
        Where a verb wants to write.
    schema
        Name of its schema, as in `stamp`.
    verb
        Its name, for the message.
    overwrite
        Whether an earlier result may be replaced; nothing else ever is.

    Raises
    ------
    InputError
        If something is there that must stay.
    """
    if not path.exists():
        return
    if path.is_dir():
        raise InputError(f"{path} is a folder; give a file for the result with -o.")
    try:
        ours = str(read_json(path)["schema"]).startswith(f"si3fp/{schema}/")
    except (InputError, KeyError, TypeError):
        ours = False
    if not ours:
        raise InputError(
            f"{path} was not written by si3fp {verb} and is never replaced; give another file with "
            "-o."
        )
    if not overwrite:
        raise InputError(
            f"{path} holds an earlier result. Give another file with -o, or replace it with "
            "--overwrite."
        )
