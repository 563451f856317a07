"""M.1 alone with its files: windows on loose orthographic pictures, of known scale or not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from si3fp.config import CollectConfig
from si3fp.errors import InputError
from si3fp.model import Detections, Image, OrthoImage
from si3fp.records import detections_record
from si3fp.sources.images import load_picture
from si3fp.steps.rectified import Progress
from si3fp.windows.detect import OnnxDetector, WindowDetector
from si3fp.windows.scale import estimate_m_per_px
from si3fp.workspace import claim_file, dump_json, sha256_of, stamp, write_text

IMAGE_SUFFIXES = frozenset({".jpg", ".jpeg", ".png"})
SCHEMA = "pictures"


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """One picture and what was found on it.

    Attributes
    ----------
    file
        JPEG or PNG.
    width_px, height_px
        Size as viewers show it.
    m_per_px
        Scale of the search; None where it was not given and no window tells it.
    estimated
        Whether the scale was found from the windows.
    detections
        Those at or above the detector's recommended score of their label, best first.
    """

    file: Path
    width_px: int
    height_px: int
    m_per_px: float | None
    estimated: bool
    detections: Detections

    @property
    def summary(self) -> str:
        """A line on what was found at which scale."""
        counts = Counter(self.detections.labels.tolist()).most_common()
        found = ", ".join(f"{label} {count}" for label, count in counts) or "no windows"
        if self.m_per_px is None:
            return f"{self.file}: {found} at any scale"
        how = " (estimated)" if self.estimated else ""
        return f"{self.file}: {found} at {self.m_per_px:.3g} m per pixel{how}"


@dataclass(frozen=True, slots=True, eq=False)
class PictureRun:
    """The pictures that could be read, and why the others could not, by file."""

    pictures: tuple[Picture, ...]
    failed: Mapping[Path, str]


def picture_files(paths: Sequence[Path]) -> list[Path]:
    """The images named, each once, in the order given; of a folder, those in it by name.

    Raises
    ------
    InputError
        If a folder holds no image.
    """
    files: dict[Path, Path] = {}
    for path in paths:
        inside = [path]
        if path.is_dir():
            inside = sorted(p for p in path.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES)
            if not inside:
                raise InputError(f"The folder {path} holds no JPEG or PNG image.")
        for file in inside:
            files.setdefault(file.resolve(), file)
    return list(files.values())


def detect_pictures(
    files: Sequence[Path],
    out: Path,
    *,
    m_per_px: float | None = None,
    overwrite: bool = False,
    max_pixels: int = CollectConfig().max_pixels,
    progress: Progress = lambda step, done, total: None,
) -> PictureRun:
    """M.1 on loose pictures; writes ``out`` as JSON, one entry per picture that could be read.

    Parameters
    ----------
    files
        JPEG or PNG.
    out
        JSON to write; pictures that could not be read are listed in it under ``missing``.
    m_per_px
        Metres per pixel of all pictures; estimated for each from its windows where left out.
    overwrite
        Replace an earlier result. Other files are never replaced.
    max_pixels
        Limit on the size of one picture, as stored and as scaled for the detector.
    progress
        Told how many pictures are done.

    Raises
    ------
    InputError
        If ``out`` must not be written, or no picture can be read.
    SourceError
        If ``out`` cannot be written.
    """
    claim_file(out, SCHEMA, "detect", overwrite)
    detector = OnnxDetector()
    pictures: list[Picture] = []
    failed: dict[Path, str] = {}
    inputs: dict[str, str] = {}
    for done, file in enumerate(files):
        progress("pictures", done, len(files))
        try:
            picture = _picture(file, detector, m_per_px, max_pixels)
            inputs[file.as_posix()] = sha256_of(file)
        except InputError as error:
            failed[file] = str(error)
        else:
            pictures.append(picture)
    progress("pictures", len(files), len(files))
    if not pictures:
        raise InputError("No picture could be read. " + " ".join(failed.values()))
    config = {
        "m_per_px": m_per_px,
        "score_thresholds": dict(detector.thresholds),
        "detector": {"name": detector.name, "sha256": detector.sha256},
    }
    content = {
        **stamp(SCHEMA),
        "config": config,
        "inputs": inputs,
        "images": [picture_record(picture) for picture in pictures],
        "missing": [{"file": f.as_posix(), "reason": reason} for f, reason in failed.items()],
    }
    write_text(out, dump_json(content))
    return PictureRun(tuple(pictures), failed)


def detect_on_picture(
    rgb: Image, detector: WindowDetector, m_per_px: float | None
) -> tuple[Detections, float | None]:
    """What is on one picture at the recommended scores, best first, and the scale of the search.

    Parameters
    ----------
    rgb
        (H, W, 3) uint8.
    detector
        Finds windows at a given scale.
    m_per_px
        Scale; None to estimate it from the windows.
    """
    image = OrthoImage("picture", rgb, np.ones(rgb.shape[:2], np.bool_))
    scale = m_per_px or estimate_m_per_px(image, detector)
    if scale is None:
        return Detections(np.zeros((0, 4)), np.zeros(0), np.zeros(0, np.str_)), None
    found = detector.detect(image, scale)
    least = np.array([detector.thresholds[str(label)] for label in found.labels])
    return found.select(found.scores >= least), scale


def picture_record(picture: Picture) -> dict[str, Any]:
    """A picture's entry in the JSON; boxes to 0.01 px."""
    found = detections_record(picture.detections)
    return {
        "file": picture.file.as_posix(),
        "width": picture.width_px,
        "height": picture.height_px,
        "m_per_px": picture.m_per_px,
        "m_per_px_estimated": picture.estimated,
        **{key: found[key] for key in ("boxes_px", "scores", "labels")},
    }


def _picture(
    file: Path, detector: OnnxDetector, m_per_px: float | None, max_pixels: int
) -> Picture:
    rgb = load_picture(file, max_pixels)
    height_px, width_px = rgb.shape[:2]
    if m_per_px and height_px * width_px * (m_per_px / detector.m_per_px) ** 2 > max_pixels:
        raise InputError(
            f"{file}: at {m_per_px:g} m per pixel it shows {width_px * m_per_px:.0f} x "
            f"{height_px * m_per_px:.0f} m, too much for one search. Correct --m-per-px, or cut "
            "the picture."
        )
    detections, scale = detect_on_picture(rgb, detector, m_per_px)
    return Picture(file, width_px, height_px, scale, m_per_px is None, detections)
