"""M.1: balconies by the depth of a render."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.geometry.boxes import iou_matrix
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections, OrthoImage
from si3fp.windows.balcony_openings import openings_behind
from si3fp.windows.depth import known_depth, share_within
from si3fp.windows.measure import BALCONY_DOOR_HEIGHT_M

BALCONY_M = (0.6, 0.75, 0.9, 1.05)
"""Balconies stand out at least as far as the first: one can stand on them. Walls without texture
bulge in a render, and a larger depth tells a balcony from the bulge that it grew together with."""
BALCONY_WIDTH_M = 0.8
"""Least width of a balcony."""
BALCONY_HEIGHT_M = (0.6, 1.6)
"""Height of a balcony's front from the underside of its slab to the rail."""
BALCONY_FILL = 0.6
"""Share of its box that a balcony's front takes; trees take less."""
RAIL_GAP_M = 0.12
"""Gaps between the bars of a rail are closed, and what is thinner than this is left out."""
HALF = 0.5


def find_balconies(
    ortho: OrthoImage, openings_px: FloatArray, wall_m: float, m_per_px: float
) -> tuple[Detections, tuple[str, ...]]:
    """Balconies by their depth, from left to right, and what speaks for each in words.

    Parameters
    ----------
    ortho
        Image with depth.
    openings_px
        (N, 4) boxes of openings: a balcony has a door, whose head shows above its front unless
        nobody could see it.
    wall_m
        Depth of the wall.
    m_per_px
        Resolution.

    Notes
    -----
    The score is the share of the box that stands out, from `BALCONY_FILL` to 1.
    """
    ahead_m = known_depth(ortho) - wall_m
    found = [
        front
        for least_m in BALCONY_M
        for front in _fronts(ahead_m > least_m, ahead_m, openings_px, ortho.valid, m_per_px)
    ]
    kept: list[_Front] = []
    # Large and full: neither grown together with a bulge nor a part of a front.
    for front in sorted(
        found, key=lambda each: -(each.fill**2) * np.prod(each.box[2:] - each.box[:2])
    ):
        others = np.array([other.box for other in kept]).reshape(-1, 4)
        if not (iou_matrix(front.box[None], others) > 0).any():
            kept.append(front)
    kept.sort(key=lambda each: (each.box[0], each.box[1]))
    boxes = np.array([front.box for front in kept]).reshape(-1, 4)
    scores = np.array([front.fill for front in kept])
    labels = np.full(len(kept), "balcony")
    return Detections(boxes, scores, labels), tuple(front.words for front in kept)


@dataclass(frozen=True, slots=True, eq=False)
class _Front:
    """The front of a balcony: its box (4,), the area and the share of it that stand out, words."""

    box: FloatArray
    area_px: int
    fill: float
    words: str


def _fronts(
    out: NDArray[np.bool_],
    ahead_m: FloatArray,
    openings_px: FloatArray,
    valid: NDArray[np.bool_],
    m_per_px: float,
) -> Iterator[_Front]:
    """The connected places that stand out, are as large as a balcony and have a door above."""
    side = 2 * round(RAIL_GAP_M / m_per_px / 2) + 1
    kernel = np.ones((side, side), np.uint8)
    closed = cv2.morphologyEx(out.astype(np.uint8), cv2.MORPH_CLOSE, kernel, borderValue=0)
    opened = cv2.morphologyEx(closed, cv2.MORPH_OPEN, kernel, borderValue=0)
    count, regions, stats, _ = cv2.connectedComponentsWithStats(opened)
    for number in range(1, count):
        left, top, width, height, area = (int(value) for value in stats[number])
        box = np.array([left, top, left + width, top + height], np.float64)
        fill = area / (width * height)
        low_m, high_m = BALCONY_HEIGHT_M
        if width * m_per_px < BALCONY_WIDTH_M or fill < BALCONY_FILL:
            continue
        if not low_m <= height * m_per_px <= high_m:
            continue
        above = np.array([left, box[3] - BALCONY_DOOR_HEIGHT_M / m_per_px, box[2], top])
        if len(openings_behind(box, openings_px, valid, m_per_px)):
            door = "below a door"
        elif share_within(~valid, above) > HALF:
            door = "and what is above it was not seen"
        else:
            continue
        far_m = float(np.nanmedian(ahead_m[regions == number]))
        at = f"balcony {width * m_per_px:.1f} m wide stands {far_m:.1f} m in front of the wall"
        yield _Front(box, area, fill, f"{at}, {door}")
