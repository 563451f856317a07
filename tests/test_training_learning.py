"""The detector can learn, and what is exported is what was trained."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs the extra `train`")

import torch
from training.backbone import EfficientNetLite, load_published
from training.losses import spread_loss
from training.measure import evaluate
from training.network import Detector, SmallResidual, make_backbone
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
    model = Detector(SmallResidual(widths=(16, 24, 32, 32), blocks=(1, 1, 1, 1)), neck=24)
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
        logits, distances, spreads = model(batch["image"].float())
    for k, truth in enumerate(truths):
        scores = torch.sigmoid(logits[k]).numpy()
        boxes, _, classes = decode(scores, distances[k].numpy(), 0.3)
        assert len(boxes) == 2 and np.all(classes == 0)
        assert iou(truth, boxes).max(axis=1).min() > 0.7
    learnt = batch["side_weight"] > 0
    error = (distances - batch["sides"]).abs().permute(0, 2, 3, 1)[learnt]
    spread = spreads.permute(0, 2, 3, 1)[learnt]
    assert 0.3 < float(spread.mean() / error.mean()) < 3.0


def test_rate_ends_at_zero() -> None:
    values = [rate(p, 1.0) for p in np.linspace(0, 1, 101)]
    assert values[0] < 0.1 and max(values) == pytest.approx(1.0, abs=1e-3)
    assert values[-1] == pytest.approx(0.0, abs=1e-6) and rate(1.5, 1.0) == pytest.approx(0.0)


def test_average_follows_the_model() -> None:
    model, mean = Detector(SmallResidual()), Detector(SmallResidual())
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

    model = Detector(make_backbone("lite0"), neck=16).eval()
    export_onnx(model, tmp_path / "detector.onnx")
    errors = largest_error(model, tmp_path / "detector.onnx")
    assert errors["scores"] < 1e-4 and errors["distances"] < 1e-2 and errors["spreads"] < 1e-2
    scores, distances = predictor(model)(np.zeros((64, 96, 3), np.uint8))
    assert scores.shape == (2, 16, 24) and distances.shape == (4, 16, 24)


def test_spread_loss_is_least_where_the_spread_is_the_mean_error() -> None:
    distances, sides = torch.zeros(1, 4, 1, 2), torch.tensor([1.0, 3.0]).expand(1, 4, 1, 2)
    weight = torch.ones(1, 1, 2)

    def loss(b: float) -> float:
        return float(spread_loss(distances, torch.full((1, 4, 1, 2), b), sides, weight))

    assert loss(2.0) == pytest.approx(1.0 + np.log(2.0))
    assert loss(2.0) < min(loss(1.8), loss(2.2))


def published_checkpoint(path: Path, backbone: EfficientNetLite) -> dict[str, torch.Tensor]:
    """A made-up checkpoint with the keys of the published ones."""
    layers = {"expand": ("_expand_conv", "_bn0"), "depthwise": ("_depthwise_conv", "_bn1")}
    layers["project"] = ("_project_conv", "_bn2")
    made, number = {}, 0

    def add(unit: torch.nn.Module, convolution: str, norm: str) -> None:
        for kind, name in (("conv", convolution), ("norm", norm)):
            for key, value in getattr(unit, kind).state_dict().items():
                like = torch.rand(value.shape) if value.ndim else torch.tensor(3)
                made[f"{name}.{key}"] = like

    add(backbone.stem, "_conv_stem", "_bn0")
    for stage in backbone.stages:
        for block in stage:
            for part, (convolution, norm) in layers.items():
                if getattr(block, part) is not None:
                    prefix = f"_blocks.{number}."
                    add(getattr(block, part), prefix + convolution, prefix + norm)
            number += 1
    assert number == 16  # blocks of Lite0
    torch.save(made | {"_fc.weight": torch.zeros(1000, 1280)}, path)
    return made


def test_published_weights_find_their_places(tmp_path: Path) -> None:
    backbone = EfficientNetLite("lite0")
    made = published_checkpoint(tmp_path / "made.pth", backbone)
    load_published(backbone, tmp_path / "made.pth")
    assert torch.equal(backbone.stem.conv.weight, made["_conv_stem.weight"])
    last = backbone.stages[-1][-1].project
    assert torch.equal(last.conv.weight, made["_blocks.15._project_conv.weight"])
    assert torch.equal(last.norm.running_mean, made["_blocks.15._bn2.running_mean"])
    assert [f.shape[1:] for f in backbone(torch.zeros(1, 3, 64, 96))] == [
        (24, 16, 24), (40, 8, 12), (112, 4, 6), (320, 2, 3),
    ]  # fmt: skip


def test_frozen_stages_do_not_move() -> None:
    model = Detector(make_backbone("lite0"), neck=16).train()
    model.backbone.freeze()
    before = {name: value.clone() for name, value in model.backbone.state_dict().items()}
    batch, _ = made_batch()
    optimiser = torch.optim.SGD([p for p in model.parameters() if p.requires_grad], 0.01)
    step_losses(model, batch, 0.0, half=False)["total"].backward()
    optimiser.step()
    moved = {
        name.split(".")[0] + "." + name.split(".")[1]
        for name, value in model.backbone.state_dict().items()
        if not torch.equal(value, before[name])
    }
    assert moved == {"stages.1", "stages.2", "stages.3"}
