"""The shipped weights in one command: train, export, quantise, calibrate, describe.

``python -m training.ship --data DATA --out RUN`` writes src/si3fp/windows/weights/ and
training/log/. It goes on where a killed one stopped.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
from pathlib import Path

import torch

from training import calibrate, card, plot
from training.data import LABELS, M_PER_PX, data_folder, read_training, read_validation
from training.export import OPSET, export_onnx, largest_error, load
from training.measure import all_views, evaluate, onnx_predictor
from training.network import parameter_count
from training.quantise import calibration_pictures, quantise
from training.targets import STRIDE
from training.train import add_options, start

WEIGHTS = Path(__file__).parents[1] / "src/si3fp/windows/weights"
LOG = Path(__file__).with_name("log")
MOST_LOSS = 0.005
"""Of F1, that eight bits may cost; with more, the float weights ship."""
_PICTURES = 64
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


def export_both(run: Path, backbone: str, data: Path) -> tuple[Path, dict]:
    """The model to ship and its description: eight bits unless they cost too much."""
    detector = load(run / "average.pt", backbone)
    exact, eight = run / "float.onnx", run / "eight.onnx"
    export_onnx(detector, exact)
    errors = largest_error(detector, exact)
    quantise(exact, eight, calibration_pictures(read_training(data), _PICTURES))
    seen = all_views(read_validation(data))
    metrics = {path: evaluate(onnx_predictor(path), seen) for path in (exact, eight)}
    f1 = {path: result["upright/window"]["f1_50"] for path, result in metrics.items()}
    chosen = eight if f1[exact] - f1[eight] <= MOST_LOSS else exact
    return chosen, {
        "opset": OPSET,
        "parameters": parameter_count(detector),
        "arithmetic": "eight bits" if chosen == eight else "float",
        "largest_export_error": errors,
        "metrics": metrics[chosen],
        "metrics_float": metrics[exact],
        "training_data": _DATA + ([] if backbone == "scratch" else [_PUBLISHED]),
    }


def main() -> None:
    """Command line: the options of the training, and the version to write."""
    parser = argparse.ArgumentParser(description=__doc__)
    add_options(parser)
    parser.add_argument("--version", default="0.2.0")
    options = parser.parse_args()
    options.resume = True
    start(options)
    torch.set_num_threads(1)
    data = data_folder(options.data)
    chosen, described = export_both(options.out, options.backbone, data)
    thresholds = {label: described["metrics"][f"upright/{label}"]["threshold"] for label in LABELS}
    document = {
        "name": "si3fp-facade-detector",
        "version": options.version,
        "sha256": hashlib.sha256(chosen.read_bytes()).hexdigest(),
        "m_per_px": M_PER_PX,
        "stride": STRIDE,
        "labels": list(LABELS),
        "score_thresholds": thresholds,
        "licence": "Apache-2.0",
        **described,
    }
    shutil.copyfile(chosen, WEIGHTS / "detector.tmp")
    (WEIGHTS / "detector.tmp").replace(WEIGHTS / "detector.onnx")
    (WEIGHTS / "detector.json").write_text(json.dumps(document, indent=2) + "\n")
    for name in ("losses.csv", "metrics.csv"):
        shutil.copyfile(options.out / name, LOG / name)
    plot.draw(options.out, LOG / "curves.png")
    calibrate.write(WEIGHTS / "detector.onnx", data, LOG / "reliability.png")
    card.write(WEIGHTS, LOG)


if __name__ == "__main__":
    main()
