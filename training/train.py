"""Train the detector within a wall-clock budget; resumable, with an average of the weights."""

from __future__ import annotations

import argparse
import csv
import math
import time
from datetime import timedelta
from pathlib import Path

import cv2
import numpy as np
import torch
import torch.distributed as dist

from training.data import data_folder, read_training, read_validation
from training.loader import batches
from training.losses import centre_loss, side_loss
from training.measure import Predict, all_views, evaluate
from training.network import Detector

_CHECKPOINT = "checkpoint.pt"
_AVERAGE = "average.pt"
_LOSSES = "losses.csv"
_METRICS = "metrics.csv"
_DECAY = 0.998


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
        logits, distances = model(image)
    weight = batch["active"] * batch["care"][:, None]
    negative = batch["negative"][:, None].expand_as(logits)
    if progress > 0.25:
        # Confident detections where windows may be unlabelled do not count as errors.
        doubtful = (negative < 1) & (logits.detach() > -0.4) & (batch["heat"] < 0.05)
        negative = torch.where(doubtful, 0.0, negative)
    centre = centre_loss(logits, batch["heat"], weight, negative)
    giou, side = side_loss(distances, batch["sides"], batch["side_weight"])
    return {"total": centre + 2.0 * giou + 2.0 * side, "centre": centre, "giou": giou,
            "side": side}


def predictor(model: Detector) -> Predict:
    """Predictor of a network in evaluation mode."""

    def predict(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        batch = torch.from_numpy(image.transpose(2, 0, 1)[None].astype(np.float32))
        with torch.no_grad():
            logits, distances = model(batch.contiguous(memory_format=torch.channels_last))
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


def _append(path: Path, row: dict[str, float | str]) -> None:
    fresh = not path.exists()
    with path.open("a", newline="") as stream:
        writer = csv.DictWriter(stream, list(row), lineterminator="\n")
        if fresh:
            writer.writeheader()
        writer.writerow(row)


def _save(path: Path, content: dict) -> None:
    torch.save(content, path.with_suffix(".tmp"))
    path.with_suffix(".tmp").replace(path)


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


def train(rank: int, options: argparse.Namespace) -> None:
    """Run until the budget is spent; ``average.pt`` holds the weights to export.

    One process per core, each with one thread and its own crops: the cores then wait for each
    other once a step and not once an operation, which matters on a machine with other work.
    """
    cv2.setNumThreads(0)  # its threads do not survive the fork of the loader
    torch.set_num_threads(1)
    torch.manual_seed(options.seed)
    meeting = f"tcp://127.0.0.1:{options.port}"
    wait = timedelta(minutes=30)
    dist.init_process_group(
        "gloo", init_method=meeting, timeout=wait, world_size=options.processes, rank=rank
    )
    first = rank == 0
    out: Path = options.out
    out.mkdir(parents=True, exist_ok=True)
    folder = data_folder(options.data)
    facades = read_training(folder)
    seen = all_views(read_validation(folder)) if first else []
    print(f"{len(facades)} training pictures, {len(seen)} validation views", flush=True)
    model = Detector().to(memory_format=torch.channels_last)
    mean = Detector().to(memory_format=torch.channels_last).eval()
    mean.load_state_dict(model.state_dict())
    decayed = [p for p in model.parameters() if p.ndim > 1]
    plain = [p for p in model.parameters() if p.ndim <= 1]
    optimiser = torch.optim.AdamW(
        [{"params": decayed, "weight_decay": 0.03}, {"params": plain, "weight_decay": 0.0}],
        lr=options.rate,
    )
    step, before = 0, 0.0
    if options.resume and (out / _CHECKPOINT).exists():
        state = torch.load(out / _CHECKPOINT, weights_only=True)
        model.load_state_dict(state["model"])
        mean.load_state_dict(state["mean"])
        optimiser.load_state_dict(state["optimiser"])
        step, before = state["step"], state["elapsed"]
    seed = options.seed + 1000 * step + 100 * rank
    part = options.batch // options.processes
    stream = iter(batches(facades, options.size, part, seed))
    dist.barrier()
    start, budget = time.monotonic(), options.minutes * 60
    saved = measured = logged = before
    sums: dict[str, float] = {}
    count = 0
    elapsed = before
    while True:
        done = elapsed >= budget
        if first and count and (done or elapsed - logged > 30):
            row = {name: round(value / count, 4) for name, value in sums.items()}
            _append(out / _LOSSES, {"minutes": round(elapsed / 60, 2), "step": step, **row})
            print(f"{elapsed / 60:.1f} min, step {step}, {row}", flush=True)
            sums, count, logged = {}, 0, elapsed
        if first and (done or elapsed - saved > options.save_minutes * 60):
            state = {"model": model.state_dict(), "mean": mean.state_dict(), "step": step,
                     "optimiser": optimiser.state_dict(), "elapsed": elapsed}
            _save(out / _CHECKPOINT, state)
            _save(out / _AVERAGE, mean.state_dict())
            saved = elapsed
        if first and (done or elapsed - measured > options.measure_minutes * 60):
            for key, result in evaluate(predictor(mean), seen).items():
                row = {"minutes": round(elapsed / 60, 2), "step": step, "set": key, **result}
                _append(out / _METRICS, row)
                print(key, result, flush=True)
            measured = elapsed
        if done:
            dist.destroy_process_group()
            break
        for group in optimiser.param_groups:
            group["lr"] = rate(elapsed / budget, options.rate)
        model.train()
        losses = step_losses(model, next(stream), elapsed / budget)
        optimiser.zero_grad(set_to_none=True)
        losses["total"].backward()
        elapsed = share_gradients(model, before + time.monotonic() - start)
        norm = torch.nn.utils.clip_grad_norm_(model.parameters(), 5.0)
        if torch.isfinite(norm):
            optimiser.step()
            average(mean, model, step)
        step, count = step + 1, count + 1
        for name, value in losses.items():
            sums[name] = sums.get(name, 0.0) + float(value.detach())


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", help="data folder (default: SI3FP_TEST_DATA)")
    parser.add_argument("--out", type=Path, required=True, help="checkpoints and logs")
    parser.add_argument("--minutes", type=float, default=65.0, help="wall-clock budget")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--resume", action="store_true", help="go on from the last checkpoint")
    parser.add_argument("--size", type=int, default=320, help="side of the crops, px")
    parser.add_argument("--batch", type=int, default=12)
    parser.add_argument("--rate", type=float, default=2e-3, help="highest learning rate")
    parser.add_argument("--processes", type=int, default=2, help="one per core")
    parser.add_argument("--port", type=int, default=29517, help="local port to meet at")
    parser.add_argument("--save-minutes", type=float, default=3.0)
    parser.add_argument("--measure-minutes", type=float, default=6.0)
    options = parser.parse_args()
    torch.multiprocessing.spawn(train, (options,), nprocs=options.processes)


if __name__ == "__main__":
    main()
