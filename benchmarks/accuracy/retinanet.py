"""The paper's detector for `benchmarks.accuracy.detectors`: functions of a run's ``weights.pt``.

``--other "RetinaNet, recipe cpu" benchmarks.accuracy.retinanet:cpu RUN/weights.pt``; needs torch.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from training.paper import detect, load_trained
from training.recipes import CPU, PAPER, Recipe


def paper(weights: Path) -> Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray]]:
    """Boxes and scores as the paper's recipe finds them."""
    return _finder(weights, PAPER)


def cpu(weights: Path) -> Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray]]:
    """Boxes and scores as the recipe for two cores finds them."""
    return _finder(weights, CPU)


def _finder(
    weights: Path, recipe: Recipe
) -> Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray]]:
    model = load_trained(weights, recipe)

    def find(rgb: np.ndarray, m_per_px: float) -> tuple[np.ndarray, np.ndarray]:
        boxes, scores, _ = detect(model, rgb, m_per_px, recipe)
        return boxes, scores

    return find
