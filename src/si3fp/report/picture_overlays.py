"""Pictures with the boxes that `si3fp detect` found on them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image as PilImage
from PIL import ImageDraw, ImageFont

from si3fp.config import CollectConfig
from si3fp.errors import InputError
from si3fp.model import Image
from si3fp.report.facade_pictures import enlarged
from si3fp.report.figures import box_colour, overlay
from si3fp.sources.images import load_picture
from si3fp.steps import Picture, Progress
from si3fp.workspace import write_png


def overlay_files(
    folder: Path, files: Sequence[Path], *, overwrite: bool = False
) -> dict[Path, Path]:
    """The PNG in ``folder`` for every picture, by picture; names that occur twice get a number.

    Raises
    ------
    InputError
        If the folder is a file or holds a picture itself, or a PNG is there and ``overwrite`` is
        not set.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; give a folder for the overlays with --overlay.")
    places = {file.resolve().parent for file in files}
    if folder.resolve() in places:
        raise InputError(
            f"{folder} holds the pictures themselves; give another folder with --overlay."
        )
    targets: dict[Path, Path] = {}
    taken: set[str] = set()
    for file in files:
        name, number = file.stem, 1
        while name.lower() in taken:  # some file systems do not tell A from a
            number += 1
            name = f"{file.stem}-{number}"
        taken.add(name.lower())
        targets[file] = folder / f"{name}.png"
    there = [target for target in targets.values() if target.exists()]
    if there and not overwrite:
        raise InputError(
            f"{there[0]} is there already. Give another folder with --overlay, or replace it with "
            "--overwrite."
        )
    return targets


def write_overlays(
    pictures: Sequence[Picture],
    targets: dict[Path, Path],
    progress: Progress = lambda step, done, total: None,
) -> None:
    """Write every picture with its boxes to its PNG of ``targets``; small pictures are enlarged."""
    for done, picture in enumerate(pictures):
        progress("overlays", done, len(pictures))
        rgb = load_picture(picture.file, CollectConfig().max_pixels)
        write_png(targets[picture.file], picture_overlay(rgb, picture))
    progress("overlays", len(pictures), len(pictures))


def picture_overlay(rgb: Image, picture: Picture) -> Image:
    """The picture (H, W, 3) with boxes and scores, and below it the key of their colours."""
    canvas = enlarged(rgb)
    found = picture.detections
    boxes = found.boxes_px * (canvas.shape[1] / rgb.shape[1])
    drawn = overlay(canvas, boxes, found.labels.tolist(), found.scores.tolist())
    return np.concatenate([drawn, _key(picture, canvas.shape[1])], axis=0)


def _key(picture: Picture, width_px: int) -> Image:
    """A strip with the colour and number of every label and the scale, as wide as the picture."""
    size_px = max(12.0, width_px / 60)
    font = ImageFont.load_default(size_px)
    height_px = round(size_px * 2)
    strip = PilImage.new("RGB", (width_px, height_px), (255, 255, 255))
    draw = ImageDraw.Draw(strip)
    x, middle = size_px / 2, height_px / 2
    for label, count in Counter(picture.detections.labels.tolist()).most_common():
        draw.rectangle(
            [x, middle - size_px / 2, x + size_px, middle + size_px / 2], fill=box_colour(label)
        )
        text = f"{label.replace('_', ' ')} {count}"
        draw.text((x + 1.5 * size_px, middle), text, font=font, fill=(40, 44, 52), anchor="lm")
        x += 3 * size_px + draw.textlength(text, font=font)
    scale = "scale unknown: no windows"
    if picture.m_per_px is not None:
        scale = f"{picture.m_per_px:.3g} m per pixel" + (", estimated" * picture.estimated)
    draw.text((x, middle), scale, font=font, fill=(110, 114, 122), anchor="lm")
    return np.asarray(strip, dtype=np.uint8)
