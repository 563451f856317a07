"""Export trained weights to ONNX, check them against torch and write the metadata."""

from __future__ import annotations

import argparse
import hashlib
import json
import warnings
from pathlib import Path

import numpy as np
import onnxruntime
import torch

from training.data import LABELS, M_PER_PX, data_folder, read_validation
from training.measure import all_views, evaluate, onnx_predictor
from training.network import Detector, Exported, make_backbone, parameter_count

OPSET = 18
OUTPUTS = ("scores", "distances", "spreads")
_WEIGHTS = Path(__file__).parents[1] / "src/si3fp/windows/weights"
_DATA = [
    {
        "name": "HSLU building-facade-segmentation (train split)",
        "licence": "CC BY 4.0",
        "attribution": "Lucerne University of Applied Sciences and Arts (HSLU), "
        "building-facade-segmentation",
    },
    {"name": "SPB facades (without the validation pictures)", "licence": "CC0 1.0"},
]
_PUBLISHED = {
    "name": "ImageNet (ILSVRC 2012), through the published weights of EfficientNet-Lite0",
    "licence": "weights Apache-2.0; the pictures belong to many owners",
    "attribution": "TensorFlow TPU project; ported by ML Illustrated",
}


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


def main() -> None:
    """Export, check, measure on the validation list and write detector.json."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", type=Path, required=True, help="folder of training.train --out")
    parser.add_argument("--out", type=Path, default=_WEIGHTS)
    parser.add_argument("--data", help="data folder (default: SI3FP_TEST_DATA)")
    parser.add_argument("--backbone", default="lite0", help="as in training.train")
    parser.add_argument("--version", default="0.2.0")
    options = parser.parse_args()
    torch.set_num_threads(1)
    detector = load(options.run / "average.pt", options.backbone)
    path = options.out / "detector.onnx"
    fresh = path.with_suffix(".tmp.onnx")
    export_onnx(detector, fresh)
    errors = largest_error(detector, fresh)
    metrics = evaluate(onnx_predictor(fresh), all_views(read_validation(data_folder(options.data))))
    fresh.replace(path)
    thresholds = {label: metrics[f"upright/{label}"]["threshold"] for label in LABELS}
    document = {
        "name": "si3fp-facade-detector",
        "version": options.version,
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "opset": OPSET,
        "parameters": parameter_count(detector),
        "m_per_px": M_PER_PX,
        "stride": 4,
        "labels": list(LABELS),
        "score_threshold": thresholds["window"],
        "score_thresholds": thresholds,
        "largest_export_error": errors,
        "validation": "training/validation.json; pictures scaled by the true median window height; "
        "thresholds of the best F1 on the sets `upright` (rectified hslu, spb)",
        "metrics": metrics,
        "training_data": _DATA + ([] if options.backbone == "scratch" else [_PUBLISHED]),
        "licence": "Apache-2.0",
    }
    (options.out / "detector.json").write_text(json.dumps(document, indent=2) + "\n")
    print(json.dumps({k: document[k] for k in ("sha256", "score_thresholds")}), errors)


if __name__ == "__main__":
    main()
