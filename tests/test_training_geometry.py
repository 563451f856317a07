"""Augmentation keeps pictures and boxes together; targets survive the round trip."""

import cv2
import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs the extra `train`")

from training.augment import (
    Sample,
    random_crop,
    scaling,
    translation,
    warp_boxes,
    warp_image,
)
from training.data import IGNORE, Facade, median_height, warp_points
from training.photometric import photometric
from training.rectify import find_rectifications
from training.targets import decode, encode, iou


def striped_facade(seed: int = 0) -> Facade:
    """White rectangles (windows 24 x 35 px) on a dark wall, 400 x 300 px."""
    rng = np.random.default_rng(seed)
    picture = np.full((300, 400, 3), 40, np.uint8)
    polygons = []
    for row in range(4):
        for column in range(6):
            x, y = 30 + 62 * column + rng.integers(8), 20 + 70 * row
            picture[y : y + 35, x : x + 24] = 230
            ring = [[x, y], [x + 24, y], [x + 24, y + 35], [x, y + 35]]
            polygons.append(np.array(ring, float))
    levels = [picture, cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)]
    return Facade("made", "made", levels, polygons, np.zeros(len(polygons), int), (0, 1))


@pytest.mark.parametrize("scale", [0.45, 1.0, 1.7])
def test_polygons_follow_the_picture(scale: float) -> None:
    facade = striped_facade()
    matrix = translation(-20, -10) @ scaling(scale, scale)
    matrix[2, :2] = 1e-4, -5e-5
    image = warp_image(facade, matrix, (320, 288))
    boxes, labels = warp_boxes(facade, matrix, (320, 288), upright=False)
    assert (labels != IGNORE).sum() >= 4
    bright = (image[..., 0] > 135).astype(np.uint8)
    _, _, stats, _ = cv2.connectedComponentsWithStats(bright)
    found = np.array([[x, y, x + w, y + h] for x, y, w, h, _ in stats[1:]], float)
    for box in boxes[labels != IGNORE]:
        if box.min() > 1 and box[2] < 319 and box[3] < 287:
            nearest = np.abs(found - box).max(axis=1).min()
            assert nearest <= 1.6


def test_random_crops_hold_their_boxes() -> None:
    facade = striped_facade()
    rng = np.random.default_rng(3)
    kept = 0
    for _ in range(30):
        crop = random_crop(facade, (192, 128), rng)
        assert crop.image.shape == (128, 192, 3) and crop.image.dtype == np.uint8
        for box, label in zip(crop.boxes, crop.labels, strict=True):
            if label == IGNORE:
                continue
            left, top, right, bottom = np.round(box).astype(int)
            inner = crop.image[top + 3 : bottom - 3, left + 3 : right - 3]
            if inner.size:
                kept += 1
                assert np.median(inner) > 180
    assert kept > 60


def test_photometric_changes_no_box() -> None:
    rng = np.random.default_rng(0)
    for _ in range(40):
        image = rng.integers(0, 255, (96, 160, 3), dtype=np.uint8)
        sample = Sample(image, np.array([[10.0, 10, 40, 60]]), np.array([0]))
        seen = photometric(sample, rng)
        assert seen.image.shape == image.shape and seen.image.dtype == np.uint8
        assert np.array_equal(seen.boxes, sample.boxes)
        assert seen.labels[0] in (0, IGNORE)


def test_targets_round_trip() -> None:
    boxes = np.array([[8.0, 10, 33, 45], [60, 12.5, 84, 50], [100, 90, 112, 102], [20, 60, 90, 80]])
    labels = np.array([0, 0, 0, 1])
    targets = encode(boxes, labels, (128, 128))
    found, scores, classes = decode(targets["heat"], targets["sides"], 0.9)
    assert len(found) == 4 and np.allclose(scores, 1.0)
    table = iou(boxes, found)
    assert np.all(table.max(axis=1) > 0.999)
    assert np.array_equal(classes[table.argmax(axis=1)], labels)


def test_ignored_boxes_teach_nothing() -> None:
    targets = encode(np.array([[20.0, 20, 60, 60]]), np.array([IGNORE]), (96, 96))
    assert targets["heat"].max() == 0 and targets["side_weight"].max() == 0
    assert targets["care"][10, 10] == 0 and targets["care"][20, 20] == 1


def test_rectification_straightens_windows() -> None:
    facade = striped_facade()
    view = np.array([[0.9, -0.12, 40], [0.15, 1.0, 10], [6e-4, 3e-4, 1.0]])
    seen = [p for q in facade.polygons if (p := warp_points(view, q)) is not None]
    found = find_rectifications(seen, (300, 400))
    assert len(found) == 1
    for polygon in seen:
        upright = warp_points(found[0], polygon)
        assert upright is not None
        w, h = np.ptp(upright, axis=0)
        assert abs(cv2.contourArea(upright.astype(np.float32))) > 0.97 * w * h
    assert median_height(facade) == pytest.approx(35.0)
