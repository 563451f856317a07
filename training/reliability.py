"""Scores against what they promise: the curve that makes them probabilities, errors, a diagram."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
from scipy.optimize import minimize

mpl.use("Agg")
from matplotlib import pyplot as plt

KNOTS = np.linspace(0.05, 1.0, 20)
"""Raw scores at which the curves are written; the detector's lowest score is the first."""
Curve = Callable[[np.ndarray], np.ndarray]
"""Raw scores (N,) to probabilities (N,)."""


def _round(value: float) -> float:
    return round(float(value), 4)


def fit_curve(scores: np.ndarray, hits: np.ndarray) -> np.ndarray:
    """Probabilities (20,) at `KNOTS`, strictly rising, of scores (N,) that were right or not (N,).

    Beta calibration (Kull, Silva Filho and Flach 2017): the log odds are a ln(s) - b ln(1 - s) + c
    with a and b positive. Outcomes are drawn in by one count, as Platt (1999) does.
    """
    right = int(hits.sum())
    outcome = np.where(hits, (right + 1) / (right + 2), 1 / (len(hits) - right + 2))
    terms = _terms(scores)

    def loss(weights: np.ndarray) -> tuple[float, np.ndarray]:
        odds = terms @ weights
        gradient = terms.T @ (1 / (1 + np.exp(-odds)) - outcome)
        return float((np.logaddexp(0, odds) - outcome * odds).sum()), gradient

    bounds = [(0.01, None), (0.01, None), (None, None)]
    weights = minimize(loss, [1.0, 1.0, 0.0], jac=True, bounds=bounds, method="L-BFGS-B").x
    return 1 / (1 + np.exp(-_terms(KNOTS) @ weights))


def _terms(scores: np.ndarray) -> np.ndarray:
    safe = np.clip(scores, 1e-3, 1 - 1e-3)
    return np.stack([np.log(safe), -np.log(1 - safe), np.ones_like(safe)], axis=1)


def reliability(probability: np.ndarray, hits: np.ndarray, raw: np.ndarray) -> dict:
    """Error of probabilities (N,) against outcomes (N,), before and after the calibration.

    ``ece``: mean difference between mean probability and share of hits, in fifteen classes of as
    many boxes each; ``brier``: mean squared error; ``bins``: mean probability, share of hits and
    number of boxes in ten classes of equal width.
    """
    classes = np.minimum((probability * 10).astype(int), 9)
    return {
        "boxes": len(hits),
        "ece": _round(_calibration_error(probability, hits)),
        "ece_before": _round(_calibration_error(raw, hits)),
        "brier": _round(np.mean((probability - hits) ** 2)),
        "brier_before": _round(np.mean((raw - hits) ** 2)),
        "bins": [
            [_round(probability[mine].mean()), _round(hits[mine].mean()), int(mine.sum())]
            for mine in (classes == k for k in range(10))
            if mine.any()
        ],
    }


def _calibration_error(probability: np.ndarray, hits: np.ndarray) -> float:
    order = np.argsort(probability, kind="stable")
    parts = [part for part in np.array_split(order, 15) if len(part)]
    gaps = [abs(probability[part].mean() - hits[part].mean()) * len(part) for part in parts]
    return sum(gaps) / len(order)


def draw(reliable: dict[str, dict], target: Path) -> None:
    """PNG: share of hits over probability by label, above the number of boxes."""
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(5, 6.2), height_ratios=(3, 1), sharex=True, layout="constrained"
    )
    above.plot([0, 1], [0, 1], color="0.6", lw=1)
    for number, (label, values) in enumerate(reliable.items()):
        mean, share, boxes = np.array(values["bins"]).T
        error = np.sqrt(share * (1 - share) / boxes)
        text = f"{label}: calibration error {values['ece']:.3f}, raw {values['ece_before']:.3f}"
        above.errorbar(mean, share, error, marker="o", capsize=2, color=f"C{number}", label=text)
        below.plot(mean, boxes, "o-", color=f"C{number}")
    above.set_ylabel("share of hits at IoU 0.5")
    above.legend(loc="upper left", fontsize=8)
    below.set_yscale("log")
    below.set_ylabel("boxes")
    below.set_xlabel("probability, by a calibration without the photo")
    for axis in (above, below):
        axis.grid(alpha=0.3)
        axis.set_xlim(0, 1)
    target.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(target, dpi=100)
    plt.close(figure)
