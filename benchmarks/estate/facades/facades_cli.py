"""``python -m benchmarks.estate facades``: facade pictures with exact boxes, as a COCO data set."""

from __future__ import annotations

import json
import multiprocessing
import os
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import click
from benchmarks.estate.capture.picture_files import write_json, written_whole
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.facades.facade_labels import CATEGORIES
from PIL import Image

from si3fp.errors import Si3fpError

COCO = "annotations.coco.json"
BOXES_PER_PICTURE = 1000
"""Numbers of annotations that belong to one picture, so that no other picture changes them."""


def write_picture(folder: Path, seed: int, number: int) -> dict[str, Any]:
    """The record (image, annotations) of one picture, rendered unless its files are there."""
    record_path = folder / "records" / f"{seed}-{number:06d}.json"
    name = f"images/facade-{seed}-{number:06d}.jpg"
    if record_path.exists() and (folder / name).exists():
        return json.loads(record_path.read_text())
    from benchmarks.estate.facades.facade_pictures import facade_picture  # noqa: PLC0415

    picture = facade_picture(seed, number)
    height, width = picture.rgb.shape[:2]
    quality = int(rng_of(seed, "facade jpeg", number).integers(78, 97))
    image = Image.fromarray(picture.rgb)
    written_whole(folder / name, lambda path: image.save(path, quality=quality))
    annotations = []
    for index, label in enumerate(picture.labels):
        box = _with_size(label.box_px)
        annotations.append(
            {
                "id": number * BOXES_PER_PICTURE + index,
                "image_id": number,
                "category_id": CATEGORIES.index(label.category),
                "iscrowd": 0,
                "bbox": box,
                "area": round(box[2] * box[3], 2),
                "visible": label.visible,
                "bbox_visible": None if label.seen_px is None else _with_size(label.seen_px),
                "inside": label.inside,
                "closed": label.closed,
                "ignore": int(label.ignore),
            }
        )
    record = {
        "image": {
            "id": number,
            "file_name": name,
            "width": width,
            "height": height,
            "m_per_px": picture.m_per_px,
            "style": picture.style,
            "oblique": picture.oblique,
            "seed": seed,
        },
        "annotations": annotations,
    }
    write_json(record_path, record)
    return record


def _with_size(box_px: tuple[float, float, float, float]) -> list[float]:
    """Left, top, width and height, as COCO has it."""
    x0, y0, x1, y1 = box_px
    return [x0, y0, round(x1 - x0, 2), round(y1 - y0, 2)]


def coco_of(records: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """One COCO data set of the records, in the order of their pictures."""
    ordered = sorted(records, key=lambda record: record["image"]["id"])
    return {
        "categories": [{"id": index, "name": name} for index, name in enumerate(CATEGORIES)],
        "images": [record["image"] for record in ordered],
        "annotations": [one for record in ordered for one in record["annotations"]],
    }


def _one_thread() -> None:
    """Keep a process among others to one thread: idle threads that wait take time from the rest."""
    os.environ["OIDN_NUM_THREADS"], os.environ["OIDN_SET_AFFINITY"] = "1", "0"
    import cv2  # noqa: PLC0415
    from benchmarks.estate.rendering.renderer import mitsuba  # noqa: PLC0415
    from threadpoolctl import threadpool_limits  # noqa: PLC0415

    cv2.setNumThreads(1)
    threadpool_limits(1)
    mitsuba()
    import drjit  # noqa: PLC0415

    drjit.set_thread_count(1)


def _attempt(folder: Path, seed: int, number: int) -> str | None:
    """Write one picture; what went wrong, if anything: one picture must not cost thousands."""
    try:
        write_picture(folder, seed, number)
    except Si3fpError:
        raise
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return None


def _attempts(folder: Path, seed: int, numbers: range, jobs: int) -> Iterator[str | None]:
    attempt = partial(_attempt, folder, seed)
    if jobs == 1:
        yield from map(attempt, numbers)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_one_thread) as pool:
        yield from pool.map(attempt, numbers)


@click.command("facades")
@click.option("-n", "--count", type=click.IntRange(min=1), required=True, help="Pictures.")
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True)
@click.option("--start", type=click.IntRange(min=0), default=0, help="Number of the first picture.")
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, metavar="DIR")
@click.option("--jobs", type=click.IntRange(min=1), default=1, show_default=True, help="Processes.")
def facades(count: int, seed: int, start: int, output: Path, jobs: int) -> None:
    """Make facade pictures with exact boxes in DIR; pictures that are there stay."""
    numbers = range(start, start + count)
    failed = []
    for number, reason in zip(numbers, _attempts(output, seed, numbers, jobs), strict=True):
        if reason:
            failed.append(number)
            click.echo(f"Picture {number} of seed {seed} failed: {reason}", err=True)
        if (done := number - start + 1) % 20 == 0 or done == count:
            click.echo(f"{done} of {count}", err=True)
    paths = (output / "records").glob(f"{seed}-*.json")
    write_json(output / COCO, coco_of(json.loads(path.read_text()) for path in paths))
    click.echo(str(output / COCO))
    if failed:
        raise Si3fpError(
            f"{len(failed)} of {count} pictures failed (numbers {failed}); the others lie in "
            f"{output}. Run again for another try, or go on without them."
        )
