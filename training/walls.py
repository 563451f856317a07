"""The walls of the upright validation pictures: what a detector finds there against the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from si3fp.model import Detections, OrthoImage, Window
from si3fp.windows.detect import OnnxDetector
from training.augment import Sample
from training.data import BALCONY, IGNORE, LABELS, M_PER_PX, NOMINAL_HEIGHT, WINDOW, Facade
from training.matching import Matched, match
from training.measure import views
from training.targets import iou

WALL_MARGIN_PX = 0.5 * NOMINAL_HEIGHT
"""The wall of a picture is the hull of its windows and this much around."""
LEAST_KNOWN = 0.5
"""Share of the wall that ignored areas must leave."""
_UPRIGHT = ("hslu-rectified", "spb", "cmp")


@dataclass(frozen=True)
class Picture:
    """The boxes on the wall of one upright picture against the true windows; lengths in px.

    Attributes
    ----------
    group
        The source photo.
    name
        The data set.
    boxes, sigma
        (N, 4) of the windows found, best first, without those in ignored areas.
    matched
        The same against the truth.
    errors_px
        (H, 4) of the sides of the hits, for the factor of the spreads.
    wall_px2, known_share
        Area of the wall without ignored areas, and its share of the whole wall.
    parts
        Differences of the true ratio between a quarter of the wall, at each side, and the rest.
    balconies
        Balconies found on the whole picture against the truth, or None where they have no labels.
    """

    group: str
    name: str
    boxes: np.ndarray
    sigma: np.ndarray
    matched: Matched
    errors_px: np.ndarray
    wall_px2: float
    known_share: float
    parts: np.ndarray
    balconies: Matched | None

    @property
    def true_ratio(self) -> float:
        return self.matched.true_sum / self.wall_px2

    @property
    def wall_m2(self) -> float:
        """Area of the wall at the normal scale."""
        return self.wall_px2 * M_PER_PX**2

    def windows(self, probabilities: np.ndarray) -> list[Window]:
        """The boxes as windows, in metres of the normal scale."""
        return [
            Window(
                *(box[:2] * M_PER_PX),
                *((box[2:] - box[:2]) * M_PER_PX),
                score=float(score),
                edge_sigma_m=tuple(sigma[[0, 2, 1, 3]] * M_PER_PX),
            )
            for box, sigma, score in zip(self.boxes, self.sigma, probabilities, strict=True)
        ]


def look(detector: OnnxDetector, facades: list[Facade], photos: dict[str, str]) -> list[Picture]:
    """The upright pictures with windows, each file once; ``photos`` gives source photos by name."""
    once = {facade.name: facade for facade in facades}
    pictures = []
    for facade in once.values():
        group = photos.get(facade.name, facade.name)
        for name, sample in views(facade):
            if name in _UPRIGHT and (sample.labels == WINDOW).any():
                image = OrthoImage(facade.name, sample.image, np.ones(sample.image.shape[:2], bool))
                found = detector.detect(image, M_PER_PX)
                pictures.append(compare(group, name, found, sample, BALCONY in facade.classes))
    return [picture for picture in pictures if picture.known_share >= LEAST_KNOWN]


def compare(
    group: str, name: str, found: Detections, sample: Sample, with_balconies: bool
) -> Picture:
    """What was found on a picture against what is there."""
    ignored = sample.boxes[sample.labels == IGNORE]
    truth = sample.boxes[sample.labels == WINDOW]
    height, width = sample.image.shape[:2]
    wall = np.concatenate([truth[:, :2].min(axis=0), truth[:, 2:].max(axis=0)])
    wall = wall + WALL_MARGIN_PX * np.array([-1, -1, 1, 1])
    wall = np.clip(wall, 0, [width, height, width, height])
    middle = (found.boxes_px[:, :2] + found.boxes_px[:, 2:]) / 2
    inside = ((middle >= wall[:2]) & (middle < wall[2:])).all(axis=1)
    solid = (found.boxes_px[:, 2:] > found.boxes_px[:, :2]).all(axis=1)
    here = found.select(inside & solid & (found.labels == LABELS[WINDOW]))
    matched = match(here.boxes_px, here.scores, truth, ignored, 0.5)
    counted = matched.outcome >= 0
    hits = here.boxes_px[matched.hits]
    nearest = truth[iou(hits, truth).argmax(axis=1)] if len(hits) else hits
    used = np.ones((height, width), bool)
    for left, top, right, bottom in np.clip(ignored, 0, None).round().astype(int):
        used[top:bottom, left:right] = False
    left, top, right, bottom = wall.round().astype(int)
    known = used[top:bottom, left:right]
    balconies = None
    if with_balconies:
        fences = found.select(found.labels == LABELS[BALCONY])
        there = sample.boxes[sample.labels == BALCONY]
        balconies = match(fences.boxes_px, fences.scores, there, ignored, 0.5)
    return Picture(
        group,
        name,
        here.boxes_px[counted],
        here.edge_sigma_px[counted],
        _counted(matched),
        np.abs(hits - nearest),
        float(known.sum()),
        float(known.mean()),
        _parts(wall, truth),
        None if balconies is None else _counted(balconies),
    )


def _counted(matched: Matched) -> Matched:
    kept = matched.outcome >= 0
    names = ("scores", "outcome", "overlap", "area", "true_area")
    arrays = (getattr(matched, name)[kept] for name in names)
    return Matched(*arrays, matched.true_count, matched.true_sum)


def _parts(wall: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """(4,) ratio in the quarter at the left, top, right and bottom less that in the rest."""
    quarter = (wall[2:] - wall[:2]) / 4
    whole = _ratio(wall, truth)
    result = []
    for side in range(4):
        part = wall.copy()
        part[(side + 2) % 4] = wall[side] + (1 if side < 2 else -1) * quarter[side % 2]
        result.append(_ratio(part, truth) - (whole - 0.25 * _ratio(part, truth)) / 0.75)
    return np.array(result)


def _ratio(part: np.ndarray, truth: np.ndarray) -> float:
    low, high = np.maximum(truth[:, :2], part[:2]), np.minimum(truth[:, 2:], part[2:])
    return float(np.clip(high - low, 0, None).prod(axis=1).sum() / (part[2:] - part[:2]).prod())
