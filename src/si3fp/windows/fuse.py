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
MEDIAN_COST = np.pi / 2
"""Variance of a median over that of a mean."""


@dataclass(frozen=True, slots=True, eq=False)
class FusedDetections:
    """Detections with the views that agree on them.

    Attributes
    ----------
    detections
        Median boxes, merged scores, labels, and the standard deviations of the merged sides.
    views
        Per detection the ids of the views that found it, sorted.
    notes
        Per detection what happened to it, in words; empty for all if left out.
    """

    detections: Detections
    views: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.notes:
            object.__setattr__(self, "notes", ("",) * len(self.views))

    def select(self, index: NDArray[np.int_]) -> FusedDetections:
        """The detections at an integer index, in its order."""
        return FusedDetections(
            self.detections.select(index),
            tuple(self.views[i] for i in index),
            tuple(self.notes[i] for i in index),
        )


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

    boxes, scores, labels, views, sigmas = [], [], [], [], []
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
        sigmas.append(_median_sigma(corners, everything.edge_sigma_px[members]))
    merged_all = Detections(
        np.array(boxes), np.array(scores), np.array(labels, np.str_), np.array(sigmas)
    )
    return FusedDetections(merged_all, tuple(views)).select(
        np.argsort(-np.array(scores), kind="stable")
    )


def _median_sigma(corners: FloatArray, sigma: FloatArray) -> FloatArray:
    """Standard deviation (4,) of the median of sides (N, 4), each known to ``sigma`` (N, 4).

    What scatters between the views averages out; the rest of the network's own uncertainty is
    common to all views of the same window and does not. 0 where the network tells none: views that
    agree may all be wrong.
    """
    if not sigma.all():
        return np.zeros(4)
    scatter = (1.4826 * np.median(np.abs(corners - np.median(corners, axis=0)), axis=0)) ** 2
    common = np.clip((sigma**2).mean(axis=0) - scatter, 0, None)
    total: FloatArray = np.sqrt(common + MEDIAN_COST * scatter / len(corners))
    return total


def combine(
    agreed: FusedDetections,
    on_fused: Detections,
    views: Sequence[OrthoImage],
    config: FusionConfig,
) -> FusedDetections:
    """All that the views and the fused image propose as one list, best first.

    Parameters
    ----------
    agreed
        What several views agree on, from `fuse_views`.
    on_fused
        Detections on the fused image of the same grid, best first.
    views
        The registered views.
    config
        IoU that makes two boxes one, score from which a box may have partners.

    Notes
    -----
    What is a window, the fused image tells better: it is sharp and free of what hides a part of one
    view. Where its sides are, the median over the views does
    (docs/decisions/0004-views-or-fused-image.md, with the measurement). The score is that of the
    fused image or the views' own, whichever is higher; one of the views alone is their mean score
    over all views that saw the place. The caller sets the threshold.
    """
    overlap = iou_matrix(on_fused.boxes_px, agreed.detections.boxes_px)
    boxes, scores, names, sigmas = [], [], [], []
    taken = np.zeros(len(agreed.detections), bool)
    for index, box in enumerate(on_fused.boxes_px):
        score = on_fused.scores[index]
        partners = np.flatnonzero((overlap[index] > config.group_iou) & ~taken)
        if len(partners) and score >= config.min_score:
            partner = partners[overlap[index, partners].argmax()]
            taken[partner] = True
            # Views that see half a window, or two as one, only confirm it.
            same = overlap[index, partner] >= SAME_IOU
            sides = agreed.detections if same else on_fused
            at = partner if same else index
            boxes.append(sides.boxes_px[at])
            sigmas.append(sides.edge_sigma_px[at])
            scores.append(max(score, float(agreed.detections.scores[partner]) ** 2))
            names.append(agreed.views[partner])
        else:
            boxes.append(box)
            sigmas.append(on_fused.edge_sigma_px[index])
            scores.append(score)
            names.append(views_that_saw(box, views))
    for index in np.flatnonzero(~taken).tolist():
        box = agreed.detections.boxes_px[index]
        saw = max(len(views_that_saw(box, views)), 1)
        share = min(1.0, len(agreed.views[index]) / saw)
        boxes.append(box)
        sigmas.append(agreed.detections.edge_sigma_px[index])
        scores.append(float(agreed.detections.scores[index]) ** 2 * share)
        names.append(agreed.views[index])
    proposed = Detections(
        np.array(boxes), np.array(scores), np.full(len(boxes), "window"), np.array(sigmas)
    )
    return FusedDetections(proposed, tuple(names)).select(
        np.argsort(-proposed.scores, kind="stable")
    )


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
        np.concatenate([part.edge_sigma_px for part in parts]),
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
