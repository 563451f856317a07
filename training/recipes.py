"""The recipe of the paper's detector as one configuration, and a small one for two cores.

`PAPER` is what the paper says; `CPU` replaces the fields that minutes without a graphics card, and
without the published weights, do not allow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from training.augment import Sample, random_crop, scaling, warp_boxes, warp_image
from training.data import IGNORE, WINDOW, Facade


@dataclass(frozen=True)
class Recipe:
    """How the paper's detector is trained and run; the defaults are the paper's.

    The paper leaves open what comes after ``inference_longest_px``. There: the batch that fits the
    paper's rate by the rule of 0.01 for 16 pictures, the usual momentum and decay of the weights,
    a constant rate after a short warm-up, and mild colours.
    """

    name: str = "paper"
    iterations: int = 64_000
    learning_rate: float = 0.0005
    shortest_px: tuple[int, int] = (800, 1600)
    """Range from which the shorter side of a training picture is drawn."""
    longest_px: int = 1440
    inference_shortest_px: int = 1024
    inference_longest_px: int = 1333
    pictures_per_batch: int = 1
    momentum: float = 0.9
    weight_decay: float = 1e-4
    warm_up_iterations: int = 1000
    colour_jitter: float = 0.2
    """Largest relative change of brightness, contrast and saturation."""
    cosine: bool = False
    """Whether the rate falls to zero at the end of the run."""
    largest_gradient: float = math.inf
    published_weights: bool = True
    """Start from COCO; without it from scratch, with batch normalisation that learns."""
    crop_px: int | None = None
    """Without it, whole pictures at the sides above. With it, square crops at the scale of
    `training.train`, cut as there (scale, tilt and flip at random), and inference at that scale:
    its median window, 47 px high, lies within the smallest anchors of 32 to 50 px."""


PAPER = Recipe()
CPU = replace(
    PAPER,
    name="cpu",
    learning_rate=0.01,
    pictures_per_batch=2,
    warm_up_iterations=20,
    cosine=True,
    largest_gradient=10.0,
    published_weights=False,
    crop_px=256,
)
RECIPES = {recipe.name: recipe for recipe in (PAPER, CPU)}


def jittered(image: np.ndarray, strength: float, rng: np.random.Generator) -> np.ndarray:
    """RGB uint8 picture with brightness, contrast and saturation changed by up to ``strength``."""
    brightness, contrast, saturation = rng.uniform(1 - strength, 1 + strength, 3)
    look = image.astype(np.float32) * brightness
    mean = look.mean()
    look = mean + (look - mean) * contrast
    grey = look @ np.array([0.299, 0.587, 0.114], np.float32)
    look = grey[..., None] + (look - grey[..., None]) * saturation
    return np.clip(np.round(look), 0, 255).astype(np.uint8)


def training_sample(facade: Facade, recipe: Recipe, rng: np.random.Generator) -> Sample:
    """One training picture of the recipe; labels are 0 for windows, negative for ignored areas."""
    if recipe.crop_px is None:
        height, width = facade.levels[0].shape[:2]
        shortest, longest = min(width, height), max(width, height)
        low, high = recipe.shortest_px
        scale = min(rng.integers(low, high + 1) / shortest, recipe.longest_px / longest)
        size = round(width * scale), round(height * scale)
        matrix = scaling(size[0] / width, size[1] / height)
        image = warp_image(facade, matrix, size)
        boxes, labels = warp_boxes(facade, matrix, size, upright=False)
    else:
        crop = random_crop(facade, (recipe.crop_px, recipe.crop_px), rng)
        image, boxes, labels = crop.image, crop.boxes, crop.labels
    told = (labels == WINDOW) | (labels == IGNORE)
    return Sample(jittered(image, recipe.colour_jitter, rng), boxes[told], labels[told])
