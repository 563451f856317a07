"""Train the detector within a wall-clock budget; resumable, with an average of the weights."""

from __future__ import annotations

import argparse
import math
import time
from datetime import timedelta
from pathlib import Path

import cv2
import numpy as np
import torch
import torch.distributed as dist

from training.backbone import EfficientNetLite
from training.data import data_folder, read_rendered, read_training, read_validation
from training.journal import append_row, save
from training.loader import batches
from training.losses import centre_loss, side_loss, spread_loss
from training.measure import Predict, all_views, evaluate
from training.network import Detector, make_backbone

_CHECKPOINT = "checkpoint.pt"
_AVERAGE = "average.pt"
_LOSSES = "losses.csv"
_METRICS = "metrics.csv"
_DECAY = 0.998
_BACKBONE_SHARE = 0.4
"""Learning rate of published weights, as a share of the rate of the rest."""


def rate(progress: float, peak: float) -> float:
    """Learning rate at a share of the budget: a short warm-up, then a cosine down to zero."""
    warm = 0.04
    if progress < warm:
        return peak * (0.05 + 0.95 * progress / warm)
    return 0.5 * peak * (1 + math.cos(math.pi * min((progress - warm) / (1 - warm), 1.0)))


def step_losses(
    model: Detector, batch: dict[str, torch.Tensor], progress: float, half: bool = True
) -> dict[str, torch.Tensor]:
    """Losses of one batch: total, centre, giou, side (scalars)."""
    image = batch["image"].float().contiguous(memory_format=torch.channels_last)
    with torch.autocast("cpu", torch.bfloat16, enabled=half):
        logits, distances, spreads = model(image)
    weight = batch["active"] * batch["care"][:, None]
    negative = batch["negative"][:, None].expand_as(logits)
    if progress > 0.25:
        # Confident detections where windows may be unlabelled do not count as errors.
        doubtful = (negative < 1) & (logits.detach() > -0.4) & (batch["heat"] < 0.05)
        negative = torch.where(doubtful, 0.0, negative)
    centre = centre_loss(logits, batch["heat"], weight, negative)
    giou, side = side_loss(distances, batch["sides"], batch["side_weight"])
    spread = spread_loss(distances, spreads, batch["sides"], batch["side_weight"])
    total = centre + 2.0 * giou + 2.0 * side + 0.2 * spread
    return {"total": total, "centre": centre, "giou": giou, "side": side, "spread": spread}


def predictor(model: Detector) -> Predict:
    """Predictor of a network in evaluation mode."""

    def predict(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        batch = torch.from_numpy(image.transpose(2, 0, 1)[None].astype(np.float32))
        with torch.no_grad():
            logits, distances, _ = model(batch.contiguous(memory_format=torch.channels_last))
        return torch.sigmoid(logits)[0].numpy(), distances[0].numpy()

    return predict


def average(mean: Detector, model: Detector, step: int) -> None:
    """Move the running average of weights and statistics towards the model."""
    decay = min(_DECAY, (1 + step) / (10 + step))
    with torch.no_grad():
        theirs = model.state_dict()
        for name, value in mean.state_dict().items():
            if value.dtype.is_floating_point:
                value.lerp_(theirs[name], 1 - decay)
            else:
                value.copy_(theirs[name])


def share_gradients(model: Detector, elapsed: float) -> float:
    """Replace the gradients by their mean over the processes; return the first one's elapsed."""
    gradients = [p.grad for p in model.parameters() if p.grad is not None]
    flat = torch.cat([g.reshape(-1) for g in gradients] + [torch.tensor([elapsed])])
    if dist.get_rank() > 0:
        flat[-1] = 0.0
    dist.all_reduce(flat)
    at = 0
    for gradient in gradients:
        part = flat[at : at + gradient.numel()].view(gradient.shape)
        gradient.copy_(part / dist.get_world_size())
        at += gradient.numel()
    return float(flat[-1])


class Run:
    """State of a training run in one process: networks, optimiser and the position in time."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.out: Path = options.out
        backbone = make_backbone(options.backbone, published=True)
        self.model = Detector(backbone).to(memory_format=torch.channels_last)
        self.mean = Detector(make_backbone(options.backbone)).eval()
        self.mean = self.mean.to(memory_format=torch.channels_last)
        published = set()
        if isinstance(backbone, EfficientNetLite):
            published = {id(p) for p in backbone.parameters()}
        self.mean.load_state_dict(self.model.state_dict())
        self.model.backbone.freeze()
        learning = [p for p in self.model.parameters() if p.requires_grad]
        groups = [
            {
                "params": [p for p in learning if (p.ndim > 1, id(p) in published) == kind],
                "weight_decay": 0.03 if kind[0] else 0.0,
                "share": _BACKBONE_SHARE if kind[1] else 1.0,
            }
            for kind in ((True, False), (True, True), (False, False), (False, True))
        ]
        self.optimiser = torch.optim.AdamW(groups, lr=options.rate)
        self.step, self.elapsed = 0, 0.0
        if options.resume and (self.out / _CHECKPOINT).exists():
            state = torch.load(self.out / _CHECKPOINT, weights_only=True)
            self.model.load_state_dict(state["model"])
            self.mean.load_state_dict(state["mean"])
            self.optimiser.load_state_dict(state["optimiser"])
            self.step, self.elapsed = state["step"], state["elapsed"]

    def save(self) -> None:
        """Write the checkpoint and the averaged weights."""
        state = {
            "model": self.model.state_dict(),
            "mean": self.mean.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
            "elapsed": self.elapsed,
        }
        save(self.out / _CHECKPOINT, state)
        save(self.out / _AVERAGE, self.mean.state_dict())

    def advance(
        self, batch: dict[str, torch.Tensor], budget: float, peak: float, start: float
    ) -> dict[str, float]:
        """One step at the rate due now; ``start`` is the clock at zero elapsed seconds."""
        for group in self.optimiser.param_groups:
            group["lr"] = rate(self.elapsed / budget, peak) * group["share"]
        self.model.train()
        self.model.backbone.freeze()
        losses = step_losses(self.model, batch, self.elapsed / budget)
        self.optimiser.zero_grad(set_to_none=True)
        losses["total"].backward()
        self.elapsed = share_gradients(self.model, time.monotonic() - start)
        norm = torch.nn.utils.clip_grad_norm_(self.model.parameters(), 5.0)
        if torch.isfinite(norm):
            self.optimiser.step()
            average(self.mean, self.model, self.step)
        self.step += 1
        return {name: float(value.detach()) for name, value in losses.items()}


class Diary:
    """What the first process writes: losses, checkpoints and validation metrics."""

    def __init__(self, run: Run, options: argparse.Namespace, folder: Path) -> None:
        self.run, self.options = run, options
        self.views = all_views(read_validation(folder))
        self.sums: dict[str, float] = {}
        self.count = 0
        self.logged = self.saved = self.measured = run.elapsed

    def note(self, losses: dict[str, float], done: bool) -> None:
        """Add the losses of a step and write what is due."""
        run, elapsed = self.run, self.run.elapsed
        self.count += 1
        for name, value in losses.items():
            self.sums[name] = self.sums.get(name, 0.0) + value
        stamp = {"minutes": round(elapsed / 60, 2), "step": run.step}
        if done or elapsed - self.logged > 30:
            row = {name: round(value / self.count, 4) for name, value in self.sums.items()}
            append_row(run.out / _LOSSES, {**stamp, **row})
            print(f"{elapsed / 60:.1f} min, step {run.step}, {row}", flush=True)
            self.sums, self.count, self.logged = {}, 0, elapsed
        if done or elapsed - self.saved > self.options.save_minutes * 60:
            run.save()
            self.saved = elapsed
        if done or elapsed - self.measured > self.options.measure_minutes * 60:
            for key, result in evaluate(predictor(run.mean), self.views).items():
                append_row(run.out / _METRICS, {**stamp, "set": key, **result})
                print(key, result, flush=True)
            self.measured = elapsed


def train(rank: int, options: argparse.Namespace) -> None:
    """Run until the budget is spent; ``average.pt`` holds the weights to export.

    One process per core, each with one thread and its own crops: the cores then wait for each
    other once a step and not once an operation, which matters on a machine with other work.
    """
    cv2.setNumThreads(0)  # its threads do not survive the fork of the loader
    torch.set_num_threads(1)
    torch.manual_seed(options.seed)
    dist.init_process_group(
        "gloo",
        init_method=f"tcp://127.0.0.1:{options.port}",
        timeout=timedelta(minutes=30),
        world_size=options.processes,
        rank=rank,
    )
    options.out.mkdir(parents=True, exist_ok=True)
    folder = data_folder(options.data)
    facades = read_training(folder)
    if options.rendered:
        facades += read_rendered(options.rendered)
    run = Run(options)
    diary = Diary(run, options, folder) if rank == 0 else None
    seed = options.seed + 1000 * run.step + 100 * rank
    stream = batches(facades, options.size, options.batch // options.processes, seed)
    dist.barrier()
    start, budget = time.monotonic() - run.elapsed, options.minutes * 60
    for batch in stream:
        losses = run.advance(batch, budget, options.rate, start)
        done = run.elapsed >= budget
        if diary:
            diary.note(losses, done)
        if done:
            break
    dist.destroy_process_group()


def add_options(parser: argparse.ArgumentParser) -> None:
    """The options of a training run."""
    parser.add_argument("--data", help="data folder (default: SI3FP_TEST_DATA)")
    parser.add_argument(
        "--rendered", type=Path, help="more pictures: DIR of `benchmarks.estate facades`"
    )
    parser.add_argument("--out", type=Path, required=True, help="checkpoints and logs")
    parser.add_argument("--minutes", type=float, default=78.0, help="wall-clock budget")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--backbone", default="lite0", help="scratch, lite0, lite1 or lite2")
    parser.add_argument("--resume", action="store_true", help="go on from the last checkpoint")
    parser.add_argument("--size", type=int, default=384, help="side of the crops, px")
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--rate", type=float, default=1.5e-3, help="highest learning rate")
    parser.add_argument("--processes", type=int, default=2, help="one per core")
    parser.add_argument("--port", type=int, default=29517, help="local port to meet at")
    parser.add_argument("--save-minutes", type=float, default=3.0)
    parser.add_argument("--measure-minutes", type=float, default=19.0)


def start(options: argparse.Namespace) -> None:
    """Train with one process per core; with ``resume``, a finished run returns at once."""
    checkpoint = options.out / _CHECKPOINT
    if options.resume and checkpoint.exists():
        elapsed = torch.load(checkpoint, weights_only=True)["elapsed"]
        if elapsed >= options.minutes * 60:
            return
    torch.multiprocessing.spawn(train, (options,), nprocs=options.processes)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    add_options(parser)
    start(parser.parse_args())


if __name__ == "__main__":
    main()
