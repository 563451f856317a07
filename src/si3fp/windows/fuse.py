"""Algorithm 6: detections of several views of one facade become one list.

Groups need two different views (METHOD decision 2). The score threshold of merged boxes can
never reject after the filter of single ones (decision 3); the mean score over all views that saw
the place is the number that can.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from si3fp.config import FusionConfig
from si3fp.geometry.boxes import iou_matrix
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections, OrthoImage

SAME_IOU = 0.7
NESTED_SHARE = 0.8
NESTED_SCORE = 0.7


@dataclass(frozen=True, slots=True, eq=False)
class FusedDetections:
    """Detections with the views that agree on them.

    Attributes
    ----------
    detections
        Median boxes, merged scores, labels.
    views
        Per detection the ids of the views that found it, sorted.
    spread_px
        (N, 4) robust standard deviation of the four sides between the views; 0 with one view.
    """

    detections: Detections
    views: tuple[tuple[str, ...], ...]
    spread_px: FloatArray


def fuse_views(
    per_view: Mapping[str, Detections],
    config: FusionConfig,
    seen: Mapping[str, NDArray[np.bool_]] | None = None,
) -> FusedDetections:
    """Detections that several views agree on, best first.

    Parameters
    ----------
    per_view
        Detections on the common grid by view id.
    config
        Thresholds of the paper: single score, IoU of a group, number of views, merged score.
    seen
        Valid masks of the views; needed only where ``config.min_mean_score`` is not 0.

    Notes
    -----
    SI3FP, Algorithm 6: median box, mean of the square roots of the scores. A group is what
    overlaps with its best box, so that neighbours do not chain into one.
    """
    sources = np.array([view for view, found in per_view.items() for _ in range(len(found))])
    everything = _joined(list(per_view.values()))
    confident = everything.scores >= config.min_score
    everything, sources = everything.select(confident), sources[confident]

    boxes, scores, labels, views, spreads = [], [], [], [], []
    for members in _groups(everything, config.group_iou):
        found_by = tuple(sorted(set(sources[members].tolist())))
        merged = float(np.sqrt(everything.scores[members]).mean())
        if len(found_by) < config.min_views or merged < config.min_merged_score:
            continue
        corners = everything.boxes_px[members]
        box = np.median(corners, axis=0)
        if seen is not None and config.min_mean_score > 0:
            total = sum(everything.scores[members][sources[members] == v].max() for v in found_by)
            looked = sum(bool(_mostly(mask, box)) for mask in seen.values())
            if total / max(looked, len(found_by)) < config.min_mean_score:
                continue
        boxes.append(box)
        scores.append(merged)
        labels.append(everything.labels[members[0]])
        views.append(found_by)
        spreads.append(1.4826 * np.median(np.abs(corners - box), axis=0))
    order = np.argsort(-np.array(scores), kind="stable")
    return FusedDetections(
        Detections(np.array(boxes), np.array(scores), np.array(labels, np.str_)).select(order),
        tuple(views[i] for i in order),
        np.array(spreads).reshape(-1, 4)[order],
    )


def combine(
    agreed: FusedDetections,
    on_fused: Detections,
    views: Sequence[OrthoImage],
    threshold: float,
    config: FusionConfig,
) -> FusedDetections:
    """Windows of the views and of the fused image as one list, best first.

    Parameters
    ----------
    agreed
        What several views agree on, from `fuse_views`.
    on_fused
        Detections on the fused image of the same grid.
    views
        The registered views.
    threshold
        Recommended score of the detector.
    config
        IoU that makes two boxes one.

    Notes
    -----
    What is a window, the fused image tells better: it is sharp and free of what hides a part of one
    view. Where its sides are, the median over the views does
    (docs/decisions/0004-views-or-fused-image.md, with the measurement). A box of the fused image
    alone needs the detector's own threshold; one of the views alone needs the mean score over all
    views that saw the place to reach it.
    """
    strong = on_fused.select(on_fused.scores >= config.min_score)
    overlap = iou_matrix(strong.boxes_px, agreed.detections.boxes_px)
    boxes, scores, names, spreads = [], [], [], []
    taken = np.zeros(len(agreed.detections), bool)
    for index, box in enumerate(strong.boxes_px):
        partners = np.flatnonzero((overlap[index] > config.group_iou) & ~taken)
        score = strong.scores[index]
        if len(partners):
            partner = partners[overlap[index, partners].argmax()]
            taken[partner] = True
            agreement = float(agreed.detections.scores[partner]) ** 2
            if max(score, agreement) < threshold:
                continue
            # Views that see half a window, or two as one, only confirm it.
            same = overlap[index, partner] >= SAME_IOU
            boxes.append(agreed.detections.boxes_px[partner] if same else box)
            scores.append(max(score, agreement))
            names.append(agreed.views[partner])
            spreads.append(agreed.spread_px[partner])
        elif score >= threshold:
            boxes.append(box)
            scores.append(score)
            names.append(views_that_saw(box, views))
            spreads.append(np.zeros(4))
    for index in np.flatnonzero(~taken).tolist():
        box = agreed.detections.boxes_px[index]
        if boxes and iou_matrix(box[None], np.array(boxes)).max() > config.group_iou:
            continue
        saw = max(len(views_that_saw(box, views)), 1)
        share = min(1.0, len(agreed.views[index]) / saw)
        score = float(agreed.detections.scores[index]) ** 2 * share
        if score >= threshold:
            boxes.append(box)
            scores.append(score)
            names.append(agreed.views[index])
            spreads.append(agreed.spread_px[index])
    kept = Detections(np.array(boxes), np.array(scores), np.full(len(boxes), "window"))
    order = _not_nested(kept)
    return FusedDetections(
        kept.select(order),
        tuple(names[i] for i in order),
        np.array(spreads).reshape(-1, 4)[order],
    )


def _not_nested(detections: Detections) -> NDArray[np.int_]:
    """Indices, best first, without boxes inside another: the lights of a window are no windows.

    Of a box and what lies in it, the outer one stays unless its score is much lower.
    """
    boxes, scores = detections.boxes_px, detections.scores
    low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
    common = np.prod(np.clip(high - low, 0, None), axis=-1)
    area = np.prod(boxes[:, 2:] - boxes[:, :2], axis=-1)
    # inside[i, j]: most of i lies in j, which is larger.
    inside = (common > NESTED_SHARE * area[:, None]) & (area[:, None] < area[None])
    dropped = np.zeros(len(boxes), bool)
    for outer in np.argsort(-area, kind="stable"):
        inner = np.flatnonzero(inside[:, outer] & ~dropped)
        if not len(inner) or dropped[outer]:
            continue
        if scores[outer] >= NESTED_SCORE * scores[inner].max():
            dropped[inner] = True
        else:
            dropped[outer] = True
    order = np.argsort(-scores, kind="stable")
    return order[~dropped[order]]


def views_that_saw(box_px: FloatArray, views: Sequence[OrthoImage]) -> tuple[str, ...]:
    """Ids of the views that saw most of a box."""
    return tuple(sorted(view.source for view in views if _mostly(view.valid, box_px)))


def _mostly(mask: NDArray[np.bool_], box: FloatArray) -> bool:
    left, top = np.floor(box[:2]).astype(int)
    right, bottom = np.ceil(box[2:]).astype(int)
    part = mask[max(top, 0) : bottom, max(left, 0) : right]
    return bool(part.size and part.mean() > 0.8)


def _joined(parts: Sequence[Detections]) -> Detections:
    if not parts:
        return Detections(np.zeros((0, 4)), np.zeros(0), np.zeros(0, np.str_))
    return Detections(
        np.concatenate([part.boxes_px for part in parts]),
        np.concatenate([part.scores for part in parts]),
        np.concatenate([part.labels for part in parts]),
    )


def _groups(detections: Detections, min_iou: float) -> list[NDArray[np.intp]]:
    """Index groups of one label that overlap with their best member, which comes first."""
    overlap = iou_matrix(detections.boxes_px, detections.boxes_px)
    near = (overlap > min_iou) & (detections.labels[:, None] == detections.labels[None])
    free = np.ones(len(detections), bool)
    groups = []
    for seed in np.argsort(-detections.scores, kind="stable"):
        if free[seed]:
            members = np.flatnonzero(near[seed] & free)
            free[members] = False
            groups.append(np.concatenate([[seed], members[members != seed]]))
    return groups
