"""M.1: balconies by the depth of a render, and the doors whose feet they hide."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.geometry.boxes import iou_matrix
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections, OrthoImage, Window
from si3fp.windows.depth import known_depth, share_within
from si3fp.windows.fuse import FusedDetections
from si3fp.windows.measure import BALCONY_DOOR_HEIGHT_M
from si3fp.windows.regular import edges_of

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
SLAB_M, SLAB_SIGMA_M = 0.2, 0.15
"""The floor above the lower end of a balcony's front, which a render draws out downwards."""
DOOR_M, DOOR_SIGMA_M = 2.15, 0.2
"""Height of doors."""
FOOT_SIGMA_M = SLAB_SIGMA_M * DOOR_SIGMA_M / float(np.hypot(SLAB_SIGMA_M, DOOR_SIGMA_M))
HIGHEST_DOOR_M = 3.2
"""No door is higher; what begins farther above a balcony's slab belongs to the next storey."""
NEAR_M = 0.3
"""A door's box ends so near to the balcony's front or within it."""
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
        if len(_doors_of(box, openings_px, valid, m_per_px)):
            door = "below a door"
        elif share_within(~valid, above) > HALF:
            door = "and what is above it was not seen"
        else:
            continue
        far_m = float(np.nanmedian(ahead_m[regions == number]))
        at = f"balcony {width * m_per_px:.1f} m wide stands {far_m:.1f} m in front of the wall"
        yield _Front(box, area, fill, f"{at}, {door}")


def complete_doors(
    found: FusedDetections,
    balconies: Detections,
    wall_seen: NDArray[np.bool_],
    m_per_px: float,
) -> FusedDetections:
    """The same openings, doors of balconies completed down to the floor that a front hides.

    Parameters
    ----------
    found
        Openings.
    balconies
        From `find_balconies`: their boxes end at the underside of the slab.
    wall_seen
        (H, W) where the wall or what is set into it shows.
    m_per_px
        Resolution.

    Notes
    -----
    One opening alone above a balcony is its door. Of several, nothing says which are doors and
    which end at a sill behind the front, so these stay as they show.
    """
    boxes = found.detections.boxes_px.copy()
    sigma = found.detections.edge_sigma_px.copy()
    notes = list(found.notes)
    for balcony in balconies.boxes_px:
        doors = _doors_of(balcony, boxes, wall_seen, m_per_px)
        if len(doors) != 1:
            continue
        door = int(doors[0])
        foot = _foot(balcony[3], boxes[door, 1], m_per_px)
        if boxes[door, 3] >= foot:
            continue
        boxes[door, 3], sigma[door, 3] = foot, FOOT_SIGMA_M / m_per_px
        words = "foot hidden by a balcony, completed to its floor"
        notes[door] = f"{notes[door]}; {words}" if notes[door] else words
    detections = replace(found.detections, boxes_px=boxes, edge_sigma_px=sigma)
    return FusedDetections(detections, found.views, tuple(notes))


def complete_inferred(
    windows: Sequence[Window],
    balconies: Detections,
    wall_seen: NDArray[np.bool_],
    grid: FacadeGrid,
) -> tuple[Window, ...]:
    """The same windows; an inferred one alone above a balcony is its door down to the floor.

    Parameters
    ----------
    windows
        All windows of the facade.
    balconies, wall_seen
        As in `complete_doors`.
    grid
        Grid of the facade.
    """
    edges_m = edges_of(windows)
    corners = [grid.pixels_from_facade(edges_m[:, side]) for side in ([0, 3], [1, 2])]
    boxes = np.concatenate(corners, axis=1)
    result = list(windows)
    for balcony in balconies.boxes_px:
        doors = _doors_of(balcony, boxes, wall_seen, grid.m_per_px)
        if len(doors) != 1 or windows[doors[0]].origin != "inferred":
            continue
        window = windows[doors[0]]
        foot = _foot(balcony[3], boxes[doors[0], 1], grid.m_per_px)
        foot_m = float(grid.facade_from_pixels([balcony[0], foot])[1])
        if foot_m < window.y_m:
            left, right, _, top = window.edge_sigma_m
            result[doors[0]] = replace(
                window,
                y_m=foot_m,
                height_m=window.y_m + window.height_m - foot_m,
                label="balcony_door",
                edge_sigma_m=(left, right, round(FOOT_SIGMA_M, 4), top),
                evidence=f"{window.evidence}; the door of a balcony, completed to its floor",
            )
    return tuple(result)


def _foot(slab_px: float, head_px: float, m_per_px: float) -> float:
    """Row of a door's foot, from the underside of the slab before it and from its head."""
    by_slab = slab_px - SLAB_M / m_per_px
    by_head = head_px + DOOR_M / m_per_px
    return FOOT_SIGMA_M**2 * (by_slab / SLAB_SIGMA_M**2 + by_head / DOOR_SIGMA_M**2)


def _doors_of(
    balcony: FloatArray, openings_px: FloatArray, seen: NDArray[np.bool_], m_per_px: float
) -> NDArray[np.intp]:
    """Indices of the openings (N, 4) that rise from behind a balcony's front to a door's height.

    Between opening and front no wall shows.
    """
    left, top, right, bottom = balcony
    doors = []
    for index, (o_left, o_top, o_right, o_bottom) in enumerate(openings_px):
        covered = min(right, o_right) - max(left, o_left)
        height_m = (bottom - o_top) * m_per_px
        between = np.array([o_left, o_bottom, o_right, top])
        if (
            covered > HALF * (o_right - o_left)
            and BALCONY_DOOR_HEIGHT_M <= height_m <= HIGHEST_DOOR_M
            and o_top < top
            and o_bottom < bottom + NEAR_M / m_per_px
            and (top - o_bottom < NEAR_M / m_per_px or share_within(seen, between) < HALF)
        ):
            doors.append(index)
    return np.array(doors, np.intp)
