"""Found boxes against true ones: which are hits, and what follows from that."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from training.targets import iou


@dataclass(frozen=True)
class Matched:
    """The boxes found in some pictures, each (N,) with what became of it, and the true windows.

    Attributes
    ----------
    scores
        Of the boxes, 0 to 1.
    outcome
        1 hit, 0 false, -1 mostly in an ignored area, which counts neither way.
    overlap
        IoU with the true box of a hit, else 0.
    area, true_area
        Of the box and of its true box (0 without one), square pixels of the pictures.
    true_count, true_sum
        Number and summed area of all true boxes.
    """

    scores: np.ndarray
    outcome: np.ndarray
    overlap: np.ndarray
    area: np.ndarray
    true_area: np.ndarray
    true_count: int
    true_sum: float

    def at_least(self, score: float) -> Matched:
        """What would have become of the boxes with this score or more, alone.

        The matching goes from the best score down, so the others did not change it.
        """
        kept = self.scores >= score
        arrays = (self.scores, self.outcome, self.overlap, self.area, self.true_area)
        return Matched(*(array[kept] for array in arrays), self.true_count, self.true_sum)

    @property
    def hits(self) -> np.ndarray:
        return self.outcome == 1

    @property
    def precision(self) -> float:
        return float(self.hits.sum() / max((self.outcome >= 0).sum(), 1))

    @property
    def recall(self) -> float:
        return float(self.hits.sum() / max(self.true_count, 1))

    @property
    def f1(self) -> float:
        return float(_f1(self.precision, self.recall))


def clipped(boxes: np.ndarray, image: np.ndarray) -> np.ndarray:
    """Boxes (N, 4) cut at the borders of a picture (H, W, 3)."""
    height, width = image.shape[:2]
    return np.clip(boxes, 0, [width, height, width, height])


def match(
    boxes: np.ndarray, scores: np.ndarray, truth: np.ndarray, ignored: np.ndarray, limit: float
) -> Matched:
    """Boxes (N, 4) of one picture, best score first, against true (M, 4) and ignored (K, 4) ones.

    A box takes the true box that it overlaps most among those that no better box took, if their
    IoU is at least ``limit``.
    """
    order = np.argsort(-scores, kind="stable")
    boxes, scores = boxes[order], scores[order]
    outcome = np.zeros(len(boxes), int)
    overlap, true_area = np.zeros(len(boxes)), np.zeros(len(boxes))
    table, areas = iou(boxes, truth), _areas(truth)
    free = np.ones(len(truth), bool)
    for k, box in enumerate(boxes):
        row = np.where(free, table[k], -1.0)
        if row.size and row.max() >= limit:
            best = int(row.argmax())
            free[best] = False
            outcome[k], overlap[k], true_area[k] = 1, table[k, best], areas[best]
        elif len(ignored):
            low, high = np.maximum(box[:2], ignored[:, :2]), np.minimum(box[2:], ignored[:, 2:])
            common = np.clip(high - low, 0, None).prod(axis=1)
            if common.max() > 0.5 * (box[2:] - box[:2]).prod():
                outcome[k] = -1
    return Matched(
        scores, outcome, overlap, _areas(boxes), true_area, len(truth), float(areas.sum())
    )


def join(parts: list[Matched]) -> Matched:
    """Several pictures as one set."""
    names = ("scores", "outcome", "overlap", "area", "true_area")
    arrays = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
    return Matched(*arrays, sum(p.true_count for p in parts), sum(p.true_sum for p in parts))


def _areas(boxes: np.ndarray) -> np.ndarray:
    return (boxes[:, 2:] - boxes[:, :2]).prod(axis=1)


def curve(matched: Matched) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scores, precision and recall at every score, best first."""
    counted = matched.outcome >= 0
    scores, outcome = matched.scores[counted], matched.outcome[counted]
    order = np.argsort(-scores, kind="stable")
    hits = np.cumsum(outcome[order])
    return scores[order], hits / np.arange(1, len(hits) + 1), hits / max(matched.true_count, 1)


def average_precision(matched: Matched) -> float:
    """Area under the curve of precision over recall, precision made monotone."""
    _, precision, recall = curve(matched)
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    return float((envelope * np.diff(recall, prepend=0.0)).sum())


def best_threshold(matched: Matched) -> float:
    """Score with the best F1; 0.5 where nothing was found or nothing is there."""
    scores, precision, recall = curve(matched)
    if not len(scores) or not matched.true_count:
        return 0.5
    return float(scores[_f1(precision, recall).argmax()])


def _f1(precision, recall):
    return 2 * precision * recall / np.maximum(precision + recall, 1e-9)


def describe(at50: Matched, at75: Matched, threshold: float) -> dict[str, float]:
    """What the boxes with at least this score are worth, matched at IoU 0.5 and at IoU 0.75.

    ``ap50`` and ``best_f1`` are of all thresholds. The others: ``precision``, ``recall`` and ``f1``
    of both; of the hits at IoU 0.5 ``mean_iou``, the median and mean absolute error of the area
    (``area_median``, ``area_mean``) and the error of its sum (``area_bias_hits``); and
    ``area_bias``, the error of the summed area of all that was found against all that is there.
    Errors are shares of the true area. What lies in ignored areas counts on neither side.
    """
    best = at50.at_least(best_threshold(at50)).f1
    average = average_precision(at50)
    at50, at75 = at50.at_least(threshold), at75.at_least(threshold)
    hits = at50.hits
    none = not hits.any()
    found, true = at50.area[hits], at50.true_area[hits]
    error = np.abs(found / true - 1)
    everything = at50.area[at50.outcome >= 0].sum()
    return {
        "n": at50.true_count,
        "ap50": average,
        "best_f1": best,
        "precision": at50.precision,
        "recall": at50.recall,
        "f1_50": at50.f1,
        "precision_75": at75.precision,
        "recall_75": at75.recall,
        "f1_75": at75.f1,
        "mean_iou": 0.0 if none else float(at50.overlap[hits].mean()),
        "area_median": np.nan if none else float(np.median(error)),
        "area_mean": np.nan if none else float(error.mean()),
        "area_bias_hits": np.nan if none else float(found.sum() / true.sum() - 1),
        "area_bias": float(everything / at50.true_sum - 1) if at50.true_sum else np.nan,
        "threshold": threshold,
    }
