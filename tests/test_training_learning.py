"""The detector can learn, and what is exported is what was trained."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs the extra `train`")

import torch
from training.measure import evaluate
from training.network import Detector
from training.targets import decode, encode, iou
from training.train import average, predictor, rate, step_losses


def made_batch() -> tuple[dict, list[np.ndarray]]:
    """Four generated pictures (64 x 64 px) with a bright window or two, and their targets."""
    rng = np.random.default_rng(0)
    parts, truths = [], []
    for k in range(4):
        image = rng.integers(30, 60, (64, 64, 3)).astype(np.uint8)
        boxes = np.array([[6.0 + k, 8, 24 + k, 34], [36, 20.0 + k, 56, 44 + k]])
        for left, top, right, bottom in boxes.astype(int):
            image[top:bottom, left:right] = 220
        targets = encode(boxes, np.zeros(2, int), (64, 64))
        targets["active"] = np.ones((2, 16, 16), np.float32)
        targets["negative"] = np.ones((16, 16), np.float32)
        targets["image"] = image.transpose(2, 0, 1).copy()
        parts.append(targets)
        truths.append(boxes)
    return {n: torch.from_numpy(np.stack([p[n] for p in parts])) for n in parts[0]}, truths


def test_overfits_generated_pictures() -> None:
    torch.manual_seed(0)
    torch.set_num_threads(1)
    model = Detector(widths=(16, 24, 32, 32), blocks=(1, 1, 1, 1), neck=24)
    batch, truths = made_batch()
    optimiser = torch.optim.AdamW(model.parameters(), 6e-3)
    first = None
    for _ in range(90):
        losses = step_losses(model, batch, 0.0, half=False)
        first = first or float(losses["total"].detach())
        optimiser.zero_grad()
        losses["total"].backward()
        optimiser.step()
    assert float(losses["total"].detach()) < 0.25 * first
    model.train()  # statistics of so few steps are not yet settled
    with torch.no_grad():
        logits, distances = model(batch["image"].float())
    for k, truth in enumerate(truths):
        scores = torch.sigmoid(logits[k]).numpy()
        boxes, _, classes = decode(scores, distances[k].numpy(), 0.3)
        assert len(boxes) == 2 and np.all(classes == 0)
        assert iou(truth, boxes).max(axis=1).min() > 0.7


def test_rate_ends_at_zero() -> None:
    values = [rate(p, 1.0) for p in np.linspace(0, 1, 101)]
    assert values[0] < 0.1 and max(values) == pytest.approx(1.0, abs=1e-3)
    assert values[-1] == pytest.approx(0.0, abs=1e-6) and rate(1.5, 1.0) == pytest.approx(0.0)


def test_average_follows_the_model() -> None:
    model, mean = Detector(), Detector()
    for step in range(4):
        average(mean, model, step)
    gaps = [
        float((a - b).detach().abs().max())
        for a, b in zip(mean.parameters(), model.parameters(), strict=True)
    ]
    assert max(gaps) < 0.05


def test_perfect_predictions_measure_one() -> None:
    from training.augment import Sample

    boxes = np.array([[8.0, 8, 30, 40], [40, 8, 60, 40]])
    sample = Sample(np.zeros((64, 64, 3), np.uint8), boxes, np.zeros(2, int))
    targets = encode(boxes, sample.labels, (64, 64))
    result = evaluate(lambda _: (targets["heat"], targets["sides"]), [("made", (0,), sample)])
    assert result["made/window"]["f1_50"] == 1.0 and result["made/window"]["mean_iou"] > 0.999


def test_export_matches_torch(tmp_path: Path) -> None:
    pytest.importorskip("onnx", reason="export needs onnx")
    pytest.importorskip("onnxruntime")
    from training.export import export_onnx, largest_error

    model = Detector(widths=(16, 24, 32, 32), blocks=(1, 1, 1, 1), neck=24).eval()
    export_onnx(model, tmp_path / "detector.onnx")
    errors = largest_error(model, tmp_path / "detector.onnx")
    assert errors["scores"] < 1e-4 and errors["distances"] < 1e-2
    scores, distances = predictor(model)(np.zeros((64, 96, 3), np.uint8))
    assert scores.shape == (2, 16, 24) and distances.shape == (4, 16, 24)
