"""Reading of the facade data sets, rectification, scale normalisation and the frozen split."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from training.rectify import find_rectifications

WINDOW, BALCONY, IGNORE = 0, 1, -1
LABELS = ("window", "balcony")
M_PER_PX = 0.03
"""Resolution that the detector works at."""
NOMINAL_HEIGHT = 1.4 / M_PER_PX
"""Height of the median window, in pixels, in a scale-normalised image: 1.4 m."""
CACHE_HEIGHT = 2.0 * NOMINAL_HEIGHT
"""Height of the median window, in pixels, in the cached images (never enlarged to reach it)."""
VALIDATION_LIST = Path(__file__).with_name("validation.json")
_HSLU_LABELS = {"window": WINDOW, "balcony-fence": BALCONY, "shop": IGNORE}
_CMP_LABELS = {"window": WINDOW, "balcony": BALCONY, "shop": IGNORE, "door": IGNORE}
_RENDERED = "rendered-facades"
_RENDERED_LABELS = {
    "window": WINDOW, "balcony_door": WINDOW, "balcony": BALCONY, "shop": IGNORE, "door": IGNORE
}  # fmt: skip


@dataclass
class Facade:
    """One annotated picture.

    ``levels`` are RGB uint8 pictures (H, W, 3), each half the size of the one before; polygons are
    in pixels of ``levels[0]`` with (0, 0) at the corner of the first pixel. ``labels`` holds class
    numbers or ``IGNORE``. ``rectifications`` are 3 x 3 homographies of those pixel coordinates
    that make a facade of the picture orthographic (up to scale). ``classes`` are the labelled ones.
    """

    name: str
    source: str
    levels: list[np.ndarray]
    polygons: list[np.ndarray]
    labels: np.ndarray
    classes: tuple[int, ...]
    rectifications: list[np.ndarray] = field(default_factory=list)


def data_folder(option: str | None) -> Path:
    """Data folder from the option or, without it, from SI3FP_TEST_DATA."""
    value = option or os.environ.get("SI3FP_TEST_DATA")
    if not value:
        raise SystemExit("give the data folder with --data or the variable SI3FP_TEST_DATA")
    return Path(value)


def warp_points(matrix: np.ndarray, points: np.ndarray) -> np.ndarray | None:
    """Points (N, 2) under a homography; None when one of them is at or behind the horizon."""
    homogeneous = points @ matrix[:, :2].T + matrix[:, 2]
    if np.any(homogeneous[:, 2] <= 1e-6):
        return None
    return homogeneous[:, :2] / homogeneous[:, 2:]


def bounds(points: np.ndarray) -> np.ndarray:
    """Bounding box (left, top, right, bottom) of points (N, 2)."""
    return np.concatenate([points.min(axis=0), points.max(axis=0)])


def in_spb_validation(file_name: str) -> bool:
    """True for about 12 % of the spb pictures, chosen by a hash of the file name."""
    digest = hashlib.md5(Path(file_name).name.encode(), usedforsecurity=False).hexdigest()
    return int(digest, 16) % 100 < 12


def freeze_validation(folder: Path, target: Path = VALIDATION_LIST) -> dict[str, list[str]]:
    """Write the validation list {set: [file names]} unless it exists; return it."""
    if target.exists():
        return json.loads(target.read_text())
    hslu = json.loads((folder / "hslu-facades/annotations.coco.json").read_text())["images"]
    spb = json.loads((folder / "spb-facades/annotations.coco.json").read_text())["images"]
    lists = {
        "hslu-facades": sorted(i["file_name"] for i in hslu if i["split"] == "val"),
        "spb-facades": sorted(i["file_name"] for i in spb if in_spb_validation(i["file_name"])),
    }
    target.write_text(json.dumps(lists, indent=1) + "\n")
    return lists


def read_set(
    folder: Path, name: str, keep: set[str] | None = None, drop: set[str] | None = None
) -> list[Facade]:
    """Facades of one data set; ``keep``/``drop`` choose file names. Pictures without windows go."""
    tables = {"hslu-facades": _HSLU_LABELS, "cmp-facades": _CMP_LABELS}
    return _read(folder / name, name, tables.get(name, {"window": WINDOW}), keep, drop)


def read_rendered(folder: Path) -> list[Facade]:
    """Facade pictures of ``python -m benchmarks.estate facades -o FOLDER``, which are orthographic.

    Doors of balconies are windows here, as in a thermal model. What is hidden, cut off or tiny is
    ignored.
    """
    return _read(folder, _RENDERED, _RENDERED_LABELS)


def _read(
    folder: Path,
    name: str,
    table: dict[str, int],
    keep: set[str] | None = None,
    drop: set[str] | None = None,
) -> list[Facade]:
    document = json.loads((folder / "annotations.coco.json").read_text())
    names = {c["id"]: c["name"] for c in document["categories"]}
    by_image: dict[int, list[dict]] = {}
    for annotation in document["annotations"]:
        by_image.setdefault(annotation["image_id"], []).append(annotation)
    classes = (WINDOW, BALCONY) if name in ("hslu-facades", _RENDERED) else (WINDOW,)
    facades = []
    # SPB lists 70 pictures twice, with the same boxes.
    once = {image["file_name"]: image for image in document["images"]}
    for file_name, image in once.items():
        if (keep is not None and file_name not in keep) or (drop and file_name in drop):
            continue
        # What nobody should have to find counts as a shop does.
        annotations = [
            ("shop" if a.get("ignore") else names[a["category_id"]], _polygon(a))
            for a in by_image.get(image["id"], [])
        ]
        if name == "cmp-facades":
            annotations = _with_blinds(annotations)
        polygons = [polygon for kind, polygon in annotations if kind in table]
        labels = [table[kind] for kind, _ in annotations if kind in table]
        if WINDOW not in labels:
            continue
        facade = _load(folder / file_name, f"{name}/{file_name}", polygons, labels)
        facade.source, facade.classes = name, classes
        if name == "hslu-facades":
            windows = [p for p, label in zip(facade.polygons, labels, strict=True) if label == 0]
            facade.rectifications = find_rectifications(windows, facade.levels[0].shape[:2])
        facades.append(facade)
    return facades


def read_training(folder: Path) -> list[Facade]:
    """Training pictures of hslu-facades and spb-facades (nothing of the validation list)."""
    lists = freeze_validation(folder)
    facades = []
    for name, held_out in lists.items():
        facades += read_set(folder, name, drop=set(held_out))
    return facades


def read_validation(folder: Path) -> list[Facade]:
    """Pictures of the frozen validation list."""
    lists = freeze_validation(folder)
    return [f for name, names in lists.items() for f in read_set(folder, name, keep=set(names))]


def median_height(facade: Facade, matrix: np.ndarray | None = None) -> float:
    """Median window height in pixels, after the homography if one is given (0 if none is left)."""
    heights = []
    for polygon, label in zip(facade.polygons, facade.labels, strict=True):
        if label != WINDOW:
            continue
        points = polygon if matrix is None else warp_points(matrix, polygon)
        if points is not None:
            heights.append(np.ptp(points[:, 1]))
    return float(np.median(heights)) if heights else 0.0


def _with_blinds(annotations: list[tuple[str, np.ndarray]]) -> list[tuple[str, np.ndarray]]:
    """(kind, polygon) with every blind made part of the window that it covers, as a box of both.

    A blind covers a window if it lies by more than half in its box. Others go: an open shutter
    stands beside its window and overlaps it by no more than the care of the annotation.
    """
    boxes = np.array([bounds(p) for kind, p in annotations if kind == "window"]).reshape(-1, 4)
    joined = boxes.copy()
    for blind in (bounds(p) for kind, p in annotations if kind == "blind"):
        low, high = np.maximum(boxes[:, :2], blind[:2]), np.minimum(boxes[:, 2:], blind[2:])
        common = np.clip(high - low, 0, None).prod(axis=1)
        if len(boxes) and common.max() > 0.5 * (blind[2:] - blind[:2]).prod():
            box = joined[common.argmax()]
            box[:2], box[2:] = np.minimum(box[:2], blind[:2]), np.maximum(box[2:], blind[2:])
    others = [a for a in annotations if a[0] not in ("window", "blind")]
    return others + [("window", _ring(box)) for box in joined]


def _ring(box: np.ndarray) -> np.ndarray:
    left, top, right, bottom = box
    return np.array([[left, top], [right, top], [right, bottom], [left, bottom]], float)


def _polygon(annotation: dict) -> np.ndarray:
    rings = annotation.get("segmentation")
    if rings:
        return np.asarray(max(rings, key=len), float).reshape(-1, 2)
    x, y, w, h = annotation["bbox"]
    return _ring(np.array([x, y, x + w, y + h]))


def _load(path: Path, name: str, polygons: list[np.ndarray], labels: list[int]) -> Facade:
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if picture is None:
        raise FileNotFoundError(path)
    picture = cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)
    heights = [np.ptp(p[:, 1]) for p, label in zip(polygons, labels, strict=True) if label == 0]
    scale = min(1.0, CACHE_HEIGHT / float(np.median(heights)))
    height, width = picture.shape[:2]
    size = max(32, round(width * scale)), max(32, round(height * scale))
    if size != (width, height):
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    factor = np.array([size[0] / width, size[1] / height])
    levels = [picture]
    while min(levels[-1].shape[:2]) >= 96 and len(levels) < 4:
        levels.append(cv2.resize(levels[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    return Facade(name, "", levels, [p * factor for p in polygons], np.array(labels), (WINDOW,))
