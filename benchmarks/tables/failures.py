"""The worst facade of a run as a picture: true windows green, found ones red."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.tables.cases import Case
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from si3fp.errors import InputError
from si3fp.workspace import Workspace, read_json, safe_name

Json = Mapping[str, Any]
Rgb = tuple[int, int, int]
TRUE_RGB: Rgb = (40, 200, 80)
FOUND_RGB: Rgb = (235, 50, 50)
GREY: Rgb = (200, 200, 200)
M_PER_PX = 0.02
LONGEST_PX = 2400
CAPTION_PX = 48
MARGIN_M = 0.5


def worst_facade(evaluation: Json) -> Json | None:
    """The found facade with the lowest F1 below 1, the one with most windows wrong where equal."""
    found = [
        facade
        for facade in evaluation["facades"]
        if facade["found_id"] is not None
        and facade["windows"]["f1"] is not None
        and facade["windows"]["f1"] < 1
    ]
    return min(found, key=_badness, default=None)


def write_worst(case: Case, folder: Path) -> Path | None:
    """The PNG of the case's worst facade in ``folder``; an older one of the same run goes."""
    stem = f"{case.building.replace(':', '-')}-seed{case.seed}-{case.run_name}"
    for old in folder.glob(f"{stem}-*.png"):
        old.unlink()
    facade = None if case.evaluation is None else worst_facade(case.evaluation)
    if facade is None:
        return None
    picture = drawn(facade, *_background(case, facade), case.label)
    file = folder / f"{stem}-{safe_name(facade['facade_id'])}.png"
    folder.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture).save(file)
    return file


def drawn(
    facade: Json, photo: Image.Image, box_m: Sequence[float], label: str
) -> NDArray[np.uint8]:
    """The facade with its boxes and a caption.

    Parameters
    ----------
    facade
        An entry of ``facades`` in ``evaluation.json``; its boxes are metres on the true facade,
        x0 y0 x1 y1 from its lower left corner.
    photo, box_m
        A picture and the rectangle on the true facade that it shows.
    label
        Said in the caption.
    """
    boxes = [*facade["true_boxes_m"], *facade["found_boxes_m"], box_m]
    boxes.append((0.0, 0.0, facade["width_m"], facade["height_m"]))
    x0, y0 = (min(box[i] for box in boxes) - MARGIN_M for i in (0, 1))
    x1, y1 = (max(box[i] for box in boxes) + MARGIN_M for i in (2, 3))
    px_per_m = min(1 / M_PER_PX, LONGEST_PX / max(x1 - x0, y1 - y0))

    def pixels(box: Sequence[float]) -> list[int]:
        left, right = ((x - x0) * px_per_m for x in (box[0], box[2]))
        top, bottom = ((y1 - y) * px_per_m + CAPTION_PX for y in (box[3], box[1]))
        return [round(left), round(top), round(right), round(bottom)]

    size = (round((x1 - x0) * px_per_m), round((y1 - y0) * px_per_m) + CAPTION_PX)
    canvas = Image.new("RGB", size, GREY)
    left, top, right, bottom = pixels(box_m)
    shown = photo.convert("RGBA").resize((max(right - left, 1), max(bottom - top, 1)))
    canvas.paste(shown, (left, top), shown)
    draw = ImageDraw.Draw(canvas)
    draw.rectangle(pixels((0.0, 0.0, facade["width_m"], facade["height_m"])), outline=(90, 90, 90))
    for name, colour, width in (("true_boxes_m", TRUE_RGB, 3), ("found_boxes_m", FOUND_RGB, 2)):
        for box in facade[name]:
            draw.rectangle(pixels(box), outline=colour, width=width)
    scores = facade["windows"]
    caption = (
        f"{label}, {facade['facade_id']}: F1 {scores['f1']:.2f}, "
        f"{scores['true_positives']} right, {scores['false_positives']} wrong, "
        f"{scores['false_negatives']} missed (true green, found red)"
    )
    draw.rectangle([0, 0, size[0], CAPTION_PX - 1], fill=(255, 255, 255))
    font = ImageFont.load_default(min(24.0, 1.7 * size[0] / len(caption)))
    draw.text((8, CAPTION_PX / 2), caption, font=font, fill=(0, 0, 0), anchor="lm")
    return np.asarray(canvas, np.uint8)


def _badness(facade: Json) -> tuple[float, int, str]:
    scores = facade["windows"]
    wrong = scores["false_positives"] + scores["false_negatives"]
    return scores["f1"], -wrong, facade["facade_id"]


def _background(case: Case, facade: Json) -> tuple[Image.Image, Sequence[float]]:
    """The run's orthophoto and what it covers, else the true one, else grey."""
    whole = (0.0, 0.0, facade["width_m"], facade["height_m"])
    own = Workspace(case.run_folder).facade(facade["found_id"], "ortho.png")
    true = case.set_folder / "truth" / "ortho" / f"{facade['facade_id']}.png"
    for file, box_m in ((own, _shown(case, facade)), (true, whole)):
        if file.exists() and box_m is not None:
            with Image.open(file) as picture:
                picture.load()
                return picture, box_m
    return Image.new("RGB", (8, 8), GREY), whole


def _shown(case: Case, facade: Json) -> Sequence[float] | None:
    """What the run's orthophoto shows of the true facade; its wall in the model may be wider."""
    try:
        found = read_json(Workspace(case.run_folder).facade(facade["found_id"], "facade.json"))
        truth = read_json(case.set_folder / "truth" / "facades.json")
    except InputError:
        return facade["found_outline_m"]
    if found["origin"] != truth["origin"]:
        return facade["found_outline_m"]
    true = truth["facades"][facade["facade_id"]]["world_from_facade"]
    corner, away = (np.array(each["translation"]) for each in (found["world_from_facade"], true))
    x_m, y_m, _ = (corner - away) @ np.array(true["rotation"])
    return x_m, y_m, x_m + found["width_m"], y_m + found["height_m"]
