"""Rendered facade pictures as training pictures."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
from benchmarks.estate.facades.facade_labels import CATEGORIES
from benchmarks.estate.facades.facades_cli import COCO, coco_of
from training.augment import random_crop
from training.data import BALCONY, CACHE_HEIGHT, IGNORE, WINDOW, bounds, read_rendered


def folder_of(path: Path, kinds: list[tuple[str, int]]) -> Path:
    """One picture of 400 x 200 px with boxes of 30 x 40 px in a row; kinds with ``ignore``."""
    (path / "images").mkdir()
    cv2.imwrite(str(path / "images" / "one.png"), np.full((200, 400, 3), 90, np.uint8))
    annotations = [
        {
            "id": number,
            "image_id": 0,
            "category_id": CATEGORIES.index(kind),
            "bbox": [20 + 60 * number, 80, 30, 40],
            "ignore": ignore,
        }
        for number, (kind, ignore) in enumerate(kinds)
    ]
    image = {"id": 0, "file_name": "images/one.png", "width": 400, "height": 200}
    (path / COCO).write_text(json.dumps(coco_of([{"image": image, "annotations": annotations}])))
    return path


def test_windows_and_doors_of_balconies_are_learnt_and_what_is_hidden_is_not(
    tmp_path: Path,
) -> None:
    kinds = [("window", 0), ("balcony_door", 0), ("balcony", 0), ("door", 0), ("window", 1)]
    (facade,) = read_rendered(folder_of(tmp_path, kinds))
    assert facade.labels.tolist() == [WINDOW, WINDOW, BALCONY, IGNORE, IGNORE]
    assert facade.classes == (WINDOW, BALCONY)
    assert not facade.rectifications  # the picture is orthographic as it is
    assert min(1.0, CACHE_HEIGHT / 40) == 1.0  # so the picture keeps its pixels
    assert bounds(facade.polygons[1]).tolist() == [80, 80, 110, 120]
    crop = random_crop(facade, (96, 96), np.random.default_rng(0))
    assert crop.image.shape == (96, 96, 3)


def test_pictures_without_windows_teach_nothing(tmp_path: Path) -> None:
    assert read_rendered(folder_of(tmp_path, [("balcony", 0), ("window", 1)])) == []
