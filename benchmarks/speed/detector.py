"""Time of finding windows in one 1024 x 1344 px picture: ``python benchmarks/speed/detector.py``.

The detector that ships, as a whole and its network alone, against the paper's RetinaNet with
ResNet-50, the network alone in fp32 and in int8 (random weights: the time does not depend on
them). All on two CPUs, taking turns in one run, so that other work on the machine meets all alike;
ratios are medians over the rounds. Needs the extra `train`.
"""

from __future__ import annotations

import argparse
import os
import platform
import tempfile
import time
from collections.abc import Callable, Iterator
from importlib import resources
from pathlib import Path

if hasattr(os, "sched_setaffinity"):  # before the libraries count the CPUs
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:2])

import cv2
import numpy as np
import onnxruntime
import torch
from onnxruntime.quantization import (
    CalibrationDataReader,
    QuantFormat,
    QuantType,
    quantize_static,
)
from onnxruntime.quantization.shape_inference import quant_pre_process
from training.retinanet import RetinaNet, export_onnx

from si3fp.model import OrthoImage
from si3fp.windows.detect import OnnxDetector

WIDTH_PX, HEIGHT_PX = 1344, 1024
"""What the paper's resizing to 1024/1333 makes of a 3:4 picture, padded to multiples of 32."""
THREADS = 2
SHIPPED = Path(str(resources.files("si3fp.windows") / "weights" / "detector.onnx"))


def picture(rng: np.random.Generator) -> np.ndarray:
    """RGB uint8 (H, W, 3): a plastered wall with noise and dark windows 30 x 47 px."""
    image = np.full((HEIGHT_PX, WIDTH_PX, 3), 170.0)
    for top in range(60, HEIGHT_PX - 60, 100):
        for left in range(40, WIDTH_PX - 40, 80):
            image[top : top + 47, left : left + 30] = rng.uniform(20, 90)
    image += 25 * cv2.GaussianBlur(rng.normal(size=image.shape), (0, 0), 1.5)
    return np.clip(image, 0, 255).astype(np.uint8)


def as_batch(image: np.ndarray) -> dict[str, np.ndarray]:
    """The picture as a network takes it."""
    return {"image": np.ascontiguousarray(image.transpose(2, 0, 1)[None], np.float32)}


class Pictures(CalibrationDataReader):
    """Three pictures from which the ranges of the int8 network are taken."""

    def __init__(self) -> None:
        self._batches: Iterator[dict[str, np.ndarray]] = iter(
            [as_batch(picture(np.random.default_rng(seed))) for seed in (1, 2, 3)]
        )

    def get_next(self) -> dict[str, np.ndarray] | None:
        return next(self._batches, None)


def write_retinanet(folder: Path) -> tuple[Path, Path]:
    """The paper's network as ONNX in fp32 and in int8 (static, per channel, QDQ)."""
    torch.manual_seed(0)
    torch.set_num_threads(THREADS)
    exact, ready, small = (folder / f"{name}.onnx" for name in ("fp32", "ready", "int8"))
    # Batch normalisation in evaluation mode is folded into the convolutions by the export.
    export_onnx(RetinaNet(1, norm="batch"), exact, (WIDTH_PX, HEIGHT_PX))
    quant_pre_process(exact, ready, skip_symbolic_shape=True)
    quantize_static(
        ready,
        small,
        Pictures(),
        quant_format=QuantFormat.QDQ,
        per_channel=True,
        activation_type=QuantType.QUInt8,
        weight_type=QuantType.QInt8,
    )
    return exact, small


def network(path: Path | str, batch: dict[str, np.ndarray]) -> Callable[[], object]:
    """A run of an ONNX file on the batch."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = THREADS
    options.log_severity_level = 3
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    return lambda: session.run(None, batch)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--model", type=Path, help="another detector.onnx than the shipped one")
    arguments = parser.parse_args()
    image = picture(np.random.default_rng(0))
    batch = as_batch(image)
    detector = OnnxDetector(arguments.model)
    ortho = OrthoImage("made", image, np.ones(image.shape[:2], np.bool_))
    shipped = arguments.model or SHIPPED
    with tempfile.TemporaryDirectory() as folder:
        exact, small = write_retinanet(Path(folder))
        runs: dict[str, Callable[[], object]] = {
            f"{detector.name}, tiles and boxes": lambda: detector.detect(ortho, detector.m_per_px),
            f"{detector.name}, network": network(shipped, batch),
            "RetinaNet-R50 int8, network": network(small, batch),
            "RetinaNet-R50 fp32, network": network(exact, batch),
        }
        times: dict[str, list[tuple[float, float]]] = {name: [] for name in runs}
        for count in range(arguments.rounds + 1):
            for name, run in runs.items():
                wall, cpu = time.perf_counter(), time.process_time()
                run()
                if count:  # the first round warms up
                    taken = time.perf_counter() - wall, time.process_time() - cpu
                    times[name].append(taken)
    base = np.array(times["RetinaNet-R50 int8, network"])
    print(
        f"{WIDTH_PX} x {HEIGHT_PX} px, {THREADS} threads, {arguments.rounds} rounds, "
        f"{platform.machine()}, onnxruntime {onnxruntime.__version__}, "
        f"load {os.getloadavg()[0]:.1f}\n\n"
        "| | median, s | least, s | CPU, s | of RetinaNet int8: time | CPU |\n"
        "|---|---|---|---|---|---|"
    )
    for name, rows in times.items():
        wall_s, cpu_s = np.array(rows).T
        wall_ratio, cpu_ratio = np.median(np.array(rows) / base, axis=0)
        print(
            f"| {name} | {np.median(wall_s):.3f} | {wall_s.min():.3f} | {np.median(cpu_s):.3f} "
            f"| {wall_ratio:.3f} | {cpu_ratio:.3f} |"
        )


if __name__ == "__main__":
    main()
