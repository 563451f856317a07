"""Train the paper's detector: ``python -m training.paper --recipe paper|cpu --out RUN``.

RetinaNet with ResNet-50 on facades, within a number of iterations or of minutes; a killed run goes
on with ``--resume``.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import logsigmoid
from torch.utils.data import DataLoader, IterableDataset

from si3fp.errors import Si3fpError
from training.anchors import BACKGROUND, MULTIPLE_PX, NEITHER, anchors, detections, match
from training.augment import Sample
from training.data import M_PER_PX, Facade, data_folder, read_training
from training.journal import append_row, save
from training.recipes import RECIPES, Recipe, training_sample
from training.retinanet import MEAN_RGB, RetinaNet, load_published

_CHECKPOINT, _WEIGHTS, _LOSSES = "checkpoint.pt", "weights.pt", "losses.csv"
_ALPHA, _GAMMA = 0.25, 2.0


def padded(images: list[np.ndarray]) -> np.ndarray:
    """Pictures (H, W, 3) as one array (N, H, W, 3) float32, sides multiples of 32.

    What is added right and below has ImageNet's mean colour, which is zero to the network.
    """
    height, width = (
        max(-(-image.shape[k] // MULTIPLE_PX) * MULTIPLE_PX for image in images) for k in (0, 1)
    )
    batch = np.empty((len(images), height, width, 3), np.float32)
    batch[:] = MEAN_RGB
    for place, image in zip(batch, images, strict=True):
        place[: image.shape[0], : image.shape[1]] = image
    return batch


def batch_of(samples: list[Sample]) -> dict[str, Tensor]:
    """``image`` (N, 3, H, W), ``kinds`` (N, A) and ``deltas`` (N, A, 4) of some pictures."""
    image = padded([sample.image for sample in samples])
    places = anchors((image.shape[2], image.shape[1]))
    targets = [match(sample.boxes, sample.labels, places) for sample in samples]
    return {
        "image": torch.from_numpy(image).permute(0, 3, 1, 2),
        "kinds": torch.from_numpy(np.stack([kinds for kinds, _ in targets])),
        "deltas": torch.from_numpy(np.stack([deltas for _, deltas in targets])),
    }


class Pictures(IterableDataset):
    """Endless training pictures of a recipe."""

    def __init__(self, facades: list[Facade], recipe: Recipe, seed: int) -> None:
        self.facades, self.recipe, self.seed = facades, recipe, seed

    def __iter__(self) -> Iterator[Sample]:
        torch.set_num_threads(1)
        cv2.setNumThreads(0)
        rng = np.random.default_rng(self.seed)
        while True:
            facade = self.facades[rng.integers(len(self.facades))]
            yield training_sample(facade, self.recipe, rng)


def focal_loss(logits: Tensor, kinds: Tensor) -> Tensor:
    """Focal loss, summed over the anchors of a picture over its positive ones, mean of pictures.

    ``logits`` (N, A, labels), ``kinds`` (N, A) of `training.anchors.match`; alpha 0.25, gamma 2.
    """
    positive = kinds[..., None] == torch.arange(logits.shape[-1], device=logits.device)
    sign = torch.where(positive, 1.0, -1.0)
    weight = torch.where(positive, _ALPHA, 1 - _ALPHA) * (kinds != NEITHER)[..., None]
    loss = -weight * torch.sigmoid(-sign * logits) ** _GAMMA * logsigmoid(sign * logits)
    return (loss.sum(dim=(1, 2)) / _positives(kinds)).mean()


def box_loss(deltas: Tensor, wanted: Tensor, kinds: Tensor) -> Tensor:
    """L1 of the deltas (N, A, 4), summed over the positive anchors over their number, mean."""
    error = (deltas - wanted).abs().sum(dim=2) * (kinds > BACKGROUND)
    return (error.sum(dim=1) / _positives(kinds)).mean()


def _positives(kinds: Tensor) -> Tensor:
    return (kinds > BACKGROUND).sum(dim=1).clamp(min=1)


def losses(model: RetinaNet, batch: dict[str, Tensor], half: bool = True) -> dict[str, Tensor]:
    """Total, focal and box loss (scalars) of one batch, with bfloat16 where ``half``."""
    image = batch["image"].contiguous(memory_format=torch.channels_last)
    with torch.autocast("cpu", torch.bfloat16, enabled=half):
        logits, deltas = model(image)
    focal = focal_loss(logits.float(), batch["kinds"])
    box = box_loss(deltas.float(), batch["deltas"], batch["kinds"])
    return {"total": focal + box, "focal": focal, "box": box}


def rate(recipe: Recipe, iteration: int, progress: float) -> float:
    """Learning rate of an iteration at a share of the run's length."""
    warm = min((iteration + 1) / recipe.warm_up_iterations, 1.0)
    fall = 0.5 * (1 + math.cos(math.pi * min(progress, 1.0))) if recipe.cosine else 1.0
    return recipe.learning_rate * warm * fall


class Run:
    """Network, optimiser, iteration and clock of a run; what a checkpoint holds."""

    def __init__(self, recipe: Recipe, out: Path, published: Path | None, resume: bool) -> None:
        self.recipe, self.out = recipe, out
        self.model = RetinaNet(1, "frozen" if recipe.published_weights else "batch")
        if recipe.published_weights:
            if published is None:
                raise SystemExit(
                    f'the recipe "{recipe.name}" starts from COCO: give '
                    "retinanet_resnet50_fpn_coco-eeacb38b.pth with --published"
                )
            load_published(self.model, published)
        self.model.to(memory_format=torch.channels_last)
        self.optimiser = torch.optim.SGD(
            [p for p in self.model.parameters() if p.requires_grad],
            recipe.learning_rate,
            recipe.momentum,
            weight_decay=recipe.weight_decay,
        )
        self.iteration, self.elapsed_s = 0, 0.0
        if resume and (out / _CHECKPOINT).exists():
            state = torch.load(out / _CHECKPOINT, weights_only=True)
            self.model.load_state_dict(state["model"])
            self.optimiser.load_state_dict(state["optimiser"])
            self.iteration, self.elapsed_s = state["iteration"], state["elapsed_s"]

    def save(self) -> None:
        """Write the checkpoint, and the weights alone."""
        state = {
            "model": self.model.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "iteration": self.iteration,
            "elapsed_s": self.elapsed_s,
            "recipe": asdict(self.recipe),
        }
        save(self.out / _CHECKPOINT, state)
        save(self.out / _WEIGHTS, state["model"])

    def advance(self, batch: dict[str, Tensor], progress: float) -> dict[str, float]:
        """One iteration; its losses."""
        for group in self.optimiser.param_groups:
            group["lr"] = rate(self.recipe, self.iteration, progress)
        self.model.train()
        found = losses(self.model, batch)
        self.optimiser.zero_grad(set_to_none=True)
        found["total"].backward()
        norm = torch.nn.utils.clip_grad_norm_(self.model.parameters(), self.recipe.largest_gradient)
        if torch.isfinite(norm):
            self.optimiser.step()
        self.iteration += 1
        return {name: float(value.detach()) for name, value in found.items()}


def train(run: Run, facades: list[Facade], minutes: float, save_minutes: float, seed: int) -> None:
    """Train until the recipe's iterations or the minutes are over; ``weights.pt`` is the result."""
    recipe = run.recipe
    stream = DataLoader(
        Pictures(facades, recipe, seed + run.iteration),
        recipe.pictures_per_batch,
        num_workers=1,
        prefetch_factor=4,
        collate_fn=batch_of,
    )
    start, noted, saved = time.monotonic() - run.elapsed_s, run.elapsed_s, run.elapsed_s
    rows: list[dict[str, float]] = []
    for batch in stream:
        progress = max(run.iteration / recipe.iterations, run.elapsed_s / 60 / minutes)
        rows.append(run.advance(batch, progress))
        run.elapsed_s = time.monotonic() - start
        done = run.iteration >= recipe.iterations or run.elapsed_s >= minutes * 60
        if done or run.elapsed_s - noted > 20:
            mean = {name: round(float(np.mean([r[name] for r in rows])), 4) for name in rows[0]}
            row = {"minutes": round(run.elapsed_s / 60, 2), "iteration": run.iteration, **mean}
            append_row(run.out / _LOSSES, row)
            print(row, flush=True)
            rows, noted = [], run.elapsed_s
        if done or run.elapsed_s - saved > save_minutes * 60:
            run.save()
            saved = run.elapsed_s
        if done:
            break


def load_trained(path: Path, recipe: Recipe) -> RetinaNet:
    """Network with the ``weights.pt`` of a run of the recipe, ready to detect."""
    model = RetinaNet(1, "frozen" if recipe.published_weights else "batch")
    model.load_state_dict(torch.load(path, map_location="cpu", weights_only=True))
    return model.to(memory_format=torch.channels_last).eval()


def detect(
    model: RetinaNet, image: np.ndarray, m_per_px: float, recipe: Recipe
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Boxes (K, 4) px, scores (K,) and labels (K,) in an RGB uint8 picture, best first.

    Whole pictures come at the recipe's sides, whatever their ``m_per_px``; with a recipe of crops
    they come at the scale of training.
    """
    height, width = image.shape[:2]
    if recipe.crop_px is None:
        sides = recipe.inference_shortest_px, recipe.inference_longest_px
        scale = min(sides[0] / min(width, height), sides[1] / max(width, height))
    else:
        scale = m_per_px / M_PER_PX
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    size = max(1, round(width * scale)), max(1, round(height * scale))
    large = cv2.resize(image, size, interpolation=how)
    batch = torch.from_numpy(padded([large])).permute(0, 3, 1, 2)
    model.eval()
    with torch.inference_mode(), torch.autocast("cpu", torch.bfloat16):
        logits, deltas = model(batch.contiguous(memory_format=torch.channels_last))
    outputs = logits[0].float().numpy(), deltas[0].float().numpy()
    boxes, scores, labels = detections(*outputs, (batch.shape[3], batch.shape[2]), size)
    return boxes * np.array([width / size[0], height / size[1]] * 2), scores, labels


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--recipe", choices=sorted(RECIPES), required=True)
    parser.add_argument("--data", help="data folder (default: SI3FP_TEST_DATA)")
    parser.add_argument("--out", type=Path, required=True, help="checkpoints and logs")
    parser.add_argument("--published", type=Path, help="COCO weights, for the recipe `paper`")
    parser.add_argument("--minutes", type=float, default=math.inf, help="end at the latest then")
    parser.add_argument("--save-minutes", type=float, default=3.0)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--resume", action="store_true", help="go on from the last checkpoint")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    torch.manual_seed(options.seed)
    options.out.mkdir(parents=True, exist_ok=True)
    try:
        run = Run(RECIPES[options.recipe], options.out, options.published, options.resume)
    except Si3fpError as error:
        raise SystemExit(str(error)) from error
    facades = read_training(data_folder(options.data))
    train(run, facades, options.minutes, options.save_minutes, options.seed)


if __name__ == "__main__":
    main()
