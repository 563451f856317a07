"""Photometric augmentation: light, colour, and what orthographic renderers do to pictures."""

from __future__ import annotations

import cv2
import numpy as np

from training.augment import Sample
from training.data import IGNORE, WINDOW


def photometric(sample: Sample, rng: np.random.Generator) -> Sample:
    """Random surrounds, light, colour, blur, ghosts, noise, compression, seams, missing regions."""
    image = sample.image
    if rng.random() < 0.15:
        image = _surrounds(sample, rng)
    if rng.random() < 0.35:
        image = _blur(image, rng)
    look = image.astype(np.float32)
    if rng.random() < 0.15:
        look[:] = look.mean(axis=2, keepdims=True)
    elif rng.random() < 0.5:
        grey = look.mean(axis=2, keepdims=True)
        look = grey + (look - grey) * rng.uniform(0.2, 1.4)
    if rng.random() < 0.7:
        gain = rng.uniform(0.6, 1.5) * np.exp(rng.normal(0, 0.07, 3))
        mean = look.mean()
        look = (look - mean) * rng.uniform(0.6, 1.4) + mean
        look = look * gain + rng.uniform(-20, 20)
    if rng.random() < 0.4:
        look = 255 * (np.clip(look, 0, 255) / 255) ** np.exp(rng.uniform(-0.6, 0.6))
    if rng.random() < 0.2:
        axis = int(rng.integers(2))
        ramp = np.linspace(rng.uniform(0.5, 1.3), rng.uniform(0.5, 1.3), look.shape[axis])
        look *= np.expand_dims(ramp.astype(np.float32), (1 - axis, 2))
    if rng.random() < 0.3:
        look += rng.standard_normal(look.shape, np.float32) * rng.uniform(1, 12)
    if rng.random() < 0.1:
        look = _floaters(look, rng)
    image = np.clip(look, 0, 255).astype(np.uint8)
    if rng.random() < 0.15:
        image = _seam(image, rng)
    if rng.random() < 0.12:
        image = _ghost(image, rng)
    if rng.random() < 0.3:
        quality = int(rng.integers(25, 90))
        packed = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        image = cv2.imdecode(packed, cv2.IMREAD_COLOR)
    image, labels = _holes(image, sample.boxes, sample.labels, rng)
    return Sample(np.ascontiguousarray(image), sample.boxes, labels)


def _blur(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    kind = rng.random()
    height, width = image.shape[:2]
    if kind < 0.25:
        # A wall seen at a slant has few pixels along one direction.
        coarse = [1.0, 1.0]
        coarse[int(rng.random() < 0.2)] = rng.uniform(0.2, 0.6)
        small = cv2.resize(image, None, fx=coarse[0], fy=coarse[1], interpolation=cv2.INTER_AREA)
        return cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
    if kind < 0.5:
        factor = rng.uniform(0.35, 0.9)
        small = cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
        return cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
    if kind < 0.8:
        return cv2.GaussianBlur(image, (0, 0), rng.uniform(0.4, 1.6))
    length = int(rng.integers(3, 8))
    kernel = np.zeros((length, length), np.float32)
    end = (length - 1, int(rng.integers(0, length)))
    cv2.line(kernel, (0, length - 1 - end[1]), end, 1.0)
    return cv2.filter2D(image, -1, kernel / kernel.sum())


def _seam(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    size = image.shape[1]
    cut = int(rng.integers(size // 5, 4 * size // 5))
    shift = int(rng.integers(-2, 3))
    part = np.roll(image, shift, axis=0)[:, cut:].astype(np.float32) * rng.uniform(0.8, 1.25)
    image = image.copy()
    image[:, cut:] = np.clip(part, 0, 255).astype(np.uint8)
    return image


def _holes(
    image: np.ndarray, boxes: np.ndarray, labels: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Missing regions; a box more than half hidden becomes IGNORE."""
    height, width = image.shape[:2]
    hidden = np.zeros((height, width), np.uint8)
    if rng.random() < 0.15:
        depth = rng.uniform(0.03, 0.35, 2)
        ring = np.array([[0, 0], [1, 0], [1, depth[0]], [0, depth[1]]])
        ring = ring[:, ::-1] if rng.random() < 0.5 else ring
        ring = 1 - ring if rng.random() < 0.5 else ring
        cv2.fillPoly(hidden, [(ring * (width, height)).astype(np.int32)], 1)
    if rng.random() < 0.2:
        for _ in range(int(rng.integers(1, 4))):
            centre = rng.uniform(0, 1, 2) * (width, height)
            ring = centre + rng.uniform(-0.12, 0.12, (int(rng.integers(3, 7)), 2)) * width
            cv2.fillPoly(hidden, [cv2.convexHull(ring.astype(np.int32))], 1)
    if not hidden.any():
        return image, labels
    value = 0 if rng.random() < 0.7 else int(rng.integers(0, 256))
    image = image.copy()
    image[hidden > 0] = value
    labels = labels.copy()
    for k, box in enumerate(boxes):
        left, top, right, bottom = np.round(box).astype(int)
        patch = hidden[top:bottom, left:right]
        if patch.size and patch.mean() > 0.5:
            labels[k] = IGNORE
    return image, labels


def _surrounds(sample: Sample, rng: np.random.Generator) -> np.ndarray:
    """Painted surrounds: bands of stone or render around the windows, which are no part of them.

    One style for the whole crop, as on one building: widths of jambs, lintel and sill as shares of
    the window's height, colour, grain, and a line where the band ends.
    """
    image = sample.image.copy()
    windows = sample.boxes[sample.labels == WINDOW]
    taken, near = np.zeros(image.shape[:2], bool), np.zeros(image.shape[:2], bool)
    for box in sample.boxes:
        left, top, right, bottom = np.round(box).astype(int)
        taken[top:bottom, left:right] = True
        near[max(top - 5, 0) : bottom + 5, max(left - 5, 0) : right + 5] = True
    wall = image[near & ~taken]
    if not len(windows) or not len(wall):
        return image
    jamb, lintel, sill = rng.uniform(0.05, 0.2), rng.uniform(0.0, 0.3), rng.uniform(0.0, 0.2)
    colour = np.median(wall, axis=0) * rng.uniform(0.5, 1.6) + rng.normal(0, 12, 3)
    grain, line = rng.uniform(0, 10), rng.uniform(0.5, 1.1)
    size = image.shape[1], image.shape[0]
    for box in windows:
        tall = box[3] - box[1]
        reach = np.array([-jamb, -lintel, jamb, sill]) * tall
        outer = np.round(np.clip(box + reach, 0, [*size, *size])).astype(int)
        left, top, right, bottom = outer
        free = ~taken[top:bottom, left:right]
        band = colour + rng.normal(0, 1 + grain, (bottom - top, right - left, 1))
        rim = np.ones(free.shape, bool)
        rim[1:-1, 1:-1] = False
        band[rim] *= line
        patch = image[top:bottom, left:right]
        patch[free] = np.clip(band, 0, 255).astype(np.uint8)[free]
    return image


def _floaters(look: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Half-transparent blobs of colour, as a radiance field leaves where few photos looked."""
    height, width = look.shape[:2]
    cells = int(rng.integers(3, 9))
    veil = cv2.resize(rng.random((cells, cells), np.float32), (width, height), None, 0, 0, 2)
    opacity = np.clip((veil - rng.uniform(0.5, 0.8)) * 3, 0, rng.uniform(0.3, 0.9))[..., None]
    tint = cv2.resize(rng.uniform(0, 255, (cells, cells, 3)).astype(np.float32), (width, height))
    return look * (1 - opacity) + (0.5 * tint + 0.5 * look.mean(axis=(0, 1))) * opacity


def _ghost(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A part of the picture twice, as a blend of views that do not quite agree shows it."""
    shift = rng.uniform(-4, 4, 2)
    moved = cv2.warpAffine(
        image, np.array([[1, 0, shift[0]], [0, 1, shift[1]]]), image.shape[1::-1],
        borderMode=cv2.BORDER_REFLECT,
    )  # fmt: skip
    height, width = image.shape[:2]
    share = cv2.resize(rng.random((4, 4), np.float32), (width, height), None, 0, 0, 2)
    share = np.clip(share, 0, 1)[..., None] * rng.uniform(0.2, 0.5)
    return np.clip(image * (1 - share) + moved * share, 0, 255).astype(np.uint8)
