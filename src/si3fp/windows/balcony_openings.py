"""M.1: the doors and windows behind the fronts of balconies, of which the lower part is hidden.

A front covers door and window beside it up to the same height. The door reaches down to the floor
of the balcony, the window to the sill of its row; which is which, their widths tell
(docs/decisions/0018-openings-behind-balconies.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections
from si3fp.windows.depth import share_within
from si3fp.windows.fuse import FusedDetections
from si3fp.windows.measure import BALCONY_DOOR_HEIGHT_M
from si3fp.windows.regular import BESIDE_M

SLAB_M, SLAB_SIGMA_M = 0.2, 0.15
"""The floor above the lower end of a balcony's front, which a render draws out downwards."""
DOOR_M, DOOR_SIGMA_M = 2.15, 0.2
"""Height of doors."""
HIGHEST_DOOR_M = 3.2
"""No door is higher; what begins farther above a balcony's slab belongs to the next storey."""
NEAR_M = 0.3
"""A door's box ends so near to the balcony's front or within it."""
DOOR_WIDTH_M = 1.05
"""Doors of one leaf, with their frame, are narrower; what is wider may hold a window too."""
WIDER = 1.15
"""The window beside a door is wider than it by this factor or more."""
GAP_M = (-0.15, 0.5)
"""Between a door and the window beside it; negative as far as boxes overlap."""
HEAD_M = 0.15
"""Heads of a door and the window beside it, as they show, differ by no more."""
SAME_M = 0.2
"""Sides of one column, as they show, differ by no more."""
SPAN_IOU = 0.85
"""A box as wide as a door and a window together, in one dimension."""
HALF = 0.5


def openings_behind(
    front: FloatArray, openings_px: FloatArray, seen: NDArray[np.bool_], m_per_px: float
) -> NDArray[np.intp]:
    """Indices of the openings (N, 4) that rise from behind a balcony's front to a door's height.

    Between opening and front no wall shows.
    """
    left, top, right, bottom = front
    behind = []
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
            behind.append(index)
    return np.array(behind, np.intp)


def door_beside(door_m: FloatArray, others_m: FloatArray) -> bool:
    """Whether a narrow opening (3,) stands beside a wider one (N, 3) under the same head.

    All are left, right and head in metres; heads up or down alike.
    """
    return bool(_partners(door_m, others_m).any())


def _partners(door_m: FloatArray, others_m: FloatArray) -> NDArray[np.bool_]:
    """(N,) which openings are the window beside a door; left, right and head of all."""
    width_m, widths_m = door_m[1] - door_m[0], others_m[:, 1] - others_m[:, 0]
    gap_m = np.maximum(others_m[:, 0] - door_m[1], door_m[0] - others_m[:, 1])
    partners: NDArray[np.bool_] = (
        (width_m < DOOR_WIDTH_M)
        & (widths_m > WIDER * width_m)
        & (gap_m > GAP_M[0])
        & (gap_m < GAP_M[1])
        & (np.abs(others_m[:, 2] - door_m[2]) < HEAD_M)
    )
    return partners


def in_column(box: FloatArray, others: FloatArray, m_per_px: float) -> NDArray[np.bool_]:
    """(N,) whether boxes (N, 4) stand above or below one (4,), as wide as it."""
    sides = np.abs(others[:, [0, 2]] - box[[0, 2]]) < SAME_M / m_per_px
    return np.asarray(sides.all(axis=1))


def feet_hidden(
    boxes_px: FloatArray, wall_seen: NDArray[np.bool_], m_per_px: float
) -> NDArray[np.bool_]:
    """(N,) whether no wall was seen right under boxes (N, 4)."""
    near, far = np.array(BESIDE_M) / m_per_px
    under = [np.array([x0, y1 + near, x1, y1 + far]) for x0, _, x1, y1 in boxes_px]
    return np.array([share_within(wall_seen, strip) < HALF for strip in under], np.bool_)


def taken_apart(found: FusedDetections, m_per_px: float) -> FusedDetections:
    """The same openings; a door and a window boxed as one are two, as on another storey.

    Parameters
    ----------
    found
        Sure openings before lights are joined, best first.
    m_per_px
        Resolution.
    """
    boxes = found.detections.boxes_px
    heads_m = boxes[:, [0, 2, 1]] * m_per_px
    pairs = [
        np.concatenate([boxes[i], boxes[j]])
        for i in range(len(boxes))
        for j in np.flatnonzero(_partners(heads_m[i], heads_m))
    ]
    parts: list[tuple[int, FloatArray, str]] = []
    for k, box in enumerate(boxes):
        spans = [
            pair
            for pair in pairs
            if (pair[3] < box[1] or pair[1] > box[3])
            and span_iou(box[[0, 2]], (min(pair[0], pair[4]), max(pair[2], pair[6]))) > SPAN_IOU
        ]
        if not spans:
            parts.append((k, box, found.notes[k]))
            continue
        sides = np.median(np.array(spans)[:, [0, 2, 4, 6]], axis=0)
        note = "; ".join(
            part for part in (found.notes[k], "taken apart as on another storey") if part
        )
        parts += [
            (k, np.array([left, box[1], right, box[3]]), note)
            for left, right in (sides[:2], sides[2:])
        ]
    whole = found.select(np.array([k for k, _, _ in parts], dtype=np.int_))
    cut = np.array([box for _, box, _ in parts]).reshape(-1, 4)
    detections = replace(whole.detections, boxes_px=cut)
    return FusedDetections(detections, whole.views, tuple(note for _, _, note in parts))


def span_iou(span: Sequence[float] | FloatArray, other: Sequence[float] | FloatArray) -> float:
    """What two spans (first, last) share of what they cover; negative where they lie apart."""
    common = min(span[1], other[1]) - max(span[0], other[0])
    return float(common / (max(span[1], other[1]) - min(span[0], other[0])))


def complete_doors(
    found: FusedDetections,
    fronts: Detections,
    wall_seen: NDArray[np.bool_],
    m_per_px: float,
) -> FusedDetections:
    """The same openings, doors of balconies completed down to the floor that a front hides.

    Parameters
    ----------
    found
        Openings.
    fronts
        Fronts of balconies; their boxes end at the underside of the slab.
    wall_seen
        (H, W) where the wall or what is set into it shows.
    m_per_px
        Resolution.

    Notes
    -----
    A narrow opening beside a wider one is a door; the wider one ends at a sill behind the front
    and stays as it shows. One alone is the door too, if as narrow and not in the column of such
    windows. What lies above or below a door, narrow beside a wider one like it, is another if
    nobody saw what is under it.
    """
    boxes = found.detections.boxes_px.copy()
    sigma = found.detections.edge_sigma_px.copy()
    labels = found.detections.labels.astype("<U12")
    notes = list(found.notes)
    heads_m = boxes[:, [0, 2, 1]] * m_per_px

    def complete(door: int, foot: float, foot_sigma: float) -> None:
        if boxes[door, 3] >= foot:
            return
        boxes[door, 3], sigma[door, 3], labels[door] = foot, foot_sigma, "balcony_door"
        words = "foot hidden by a balcony, completed to its floor"
        notes[door] = f"{notes[door]}; {words}" if notes[door] else words

    behind = [openings_behind(box, boxes, wall_seen, m_per_px) for box in fronts.boxes_px]
    beside = {i for among in behind for i in among.tolist() if door_beside(heads_m[i], heads_m)}
    windows = [j for i in beside for j in np.flatnonzero(_partners(heads_m[i], heads_m))]
    for box, box_sigma, among in zip(fronts.boxes_px, fronts.edge_sigma_px, behind, strict=True):
        for i in among.tolist():
            alone = len(among) == 1 and heads_m[i, 1] - heads_m[i, 0] < DOOR_WIDTH_M
            if i in beside or (alone and not in_column(boxes[i], boxes[windows], m_per_px).any()):
                complete(i, *door_foot(box[3], box_sigma[3], boxes[i, 1], m_per_px))
    doors = sorted(beside)
    for i in np.flatnonzero(feet_hidden(boxes, wall_seen, m_per_px)).tolist():
        column = [door for door in doors if in_column(boxes[i], boxes[[door]], m_per_px)[0]]
        if i not in beside and column and door_beside(heads_m[i], heads_m):
            height = np.median(boxes[column, 3] - boxes[column, 1])
            complete(i, float(boxes[i, 1] + height), float(np.median(sigma[column, 3])))
    detections = replace(found.detections, boxes_px=boxes, labels=labels, edge_sigma_px=sigma)
    return FusedDetections(detections, found.views, tuple(notes))


def door_foot(
    slab_px: float, slab_sigma_px: float, head_px: float, m_per_px: float
) -> tuple[float, float]:
    """Row of a door's foot and its standard deviation, in pixels.

    From the underside of the slab before it, known to ``slab_sigma_px``, and from its head.
    """
    slab_sigma = float(np.hypot(SLAB_SIGMA_M / m_per_px, slab_sigma_px))
    door_sigma = DOOR_SIGMA_M / m_per_px
    sigma = slab_sigma * door_sigma / float(np.hypot(slab_sigma, door_sigma))
    by_slab = slab_px - SLAB_M / m_per_px
    by_head = head_px + DOOR_M / m_per_px
    return sigma**2 * (by_slab / slab_sigma**2 + by_head / door_sigma**2), sigma
