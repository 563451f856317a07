"""Trained weights to ONNX, checked against torch."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import onnxruntime
import torch

from training.network import Detector, Exported, make_backbone

OPSET = 18
OUTPUTS = ("scores", "distances", "spreads")


def export_onnx(detector: Detector, path: Path) -> None:
    """Write the ONNX file: ``image`` to the three maps of `OUTPUTS`; N, H, W are free."""
    model = Exported(detector).eval().to(memory_format=torch.contiguous_format)
    path.parent.mkdir(parents=True, exist_ok=True)
    grid = {0: "batch", 2: "rows", 3: "columns"}
    with warnings.catch_warnings():
        # The TorchScript exporter keeps three free axes without constraints; it is deprecated.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            model,
            (torch.zeros(1, 3, 96, 128),),
            str(path),
            opset_version=OPSET,
            dynamo=False,
            input_names=["image"],
            output_names=list(OUTPUTS),
            dynamic_axes={"image": {0: "batch", 2: "height", 3: "width"}}
            | dict.fromkeys(OUTPUTS, grid),
        )


def largest_error(detector: Detector, path: Path) -> dict[str, float]:
    """Largest difference between ONNX and torch: scores (0..1), distances and spreads (px)."""
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    model = Exported(detector).eval()
    errors = dict.fromkeys(OUTPUTS, 0.0)
    rng = np.random.default_rng(0)
    for shape in ((1, 3, 64, 96), (2, 3, 256, 320), (1, 3, 512, 384)):
        image = rng.uniform(0, 255, shape).astype(np.float32)
        got = session.run(list(OUTPUTS), {"image": image})
        with torch.no_grad():
            want = [t.numpy() for t in model(torch.from_numpy(image))]
        for name, a, b in zip(errors, got, want, strict=True):
            errors[name] = max(errors[name], float(np.abs(a - b).max()))
    return errors


def load(path: Path, backbone: str = "lite0") -> Detector:
    """Detector with the weights of ``average.pt``."""
    detector = Detector(make_backbone(backbone))
    detector.load_state_dict(torch.load(path, map_location="cpu", weights_only=True))
    return detector.eval()
