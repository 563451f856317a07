"""Static eight-bit quantisation of the exported detector, calibrated on training pictures."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import onnx
from onnxruntime.quantization import (
    CalibrationDataReader,
    CalibrationMethod,
    QuantFormat,
    QuantType,
    quantize_static,
)
from onnxruntime.quantization.shape_inference import quant_pre_process

from training.augment import random_crop
from training.data import Facade, data_folder, read_training
from training.photometric import photometric

_EXACT = ("/score/Conv", "/side/Conv", "/spread/Conv")
"""Last layers of the heads: a step of eight bits in a logarithm of a distance is too coarse."""


class _Pictures(CalibrationDataReader):
    def __init__(self, pictures: Iterable[np.ndarray]) -> None:
        self._left: Iterator[np.ndarray] = iter(pictures)

    def get_next(self) -> dict[str, np.ndarray] | None:
        picture = next(self._left, None)
        if picture is None:
            return None
        return {"image": picture.transpose(2, 0, 1)[None].astype(np.float32)}


def calibration_pictures(
    facades: list[Facade], count: int, seed: int = 0, size: int = 512
) -> list[np.ndarray]:
    """Crops (size, size, 3) RGB uint8 of training facades; every second one is augmented."""
    rng = np.random.default_rng(seed)
    pictures = []
    for k in range(count):
        crop = random_crop(facades[rng.integers(len(facades))], (size, size), rng)
        pictures.append((photometric(crop, rng) if k % 2 else crop).image)
    return pictures


def quantise(source: Path, target: Path, pictures: list[np.ndarray]) -> None:
    """Write ``target``: weights per channel and activations in eight bits, last layers exact.

    Parameters
    ----------
    source
        Exported detector with float weights.
    target
        Where to write.
    pictures
        RGB uint8, sides multiples of 32, to learn the range of each activation from.
    """
    with tempfile.TemporaryDirectory() as folder:
        prepared = Path(folder) / "prepared.onnx"
        quant_pre_process(str(source), str(prepared), skip_symbolic_shape=True)
        exact = [
            node.name
            for node in onnx.load(str(prepared)).graph.node
            if any(node.name.endswith(end) for end in _EXACT)
        ]
        quantize_static(
            str(prepared),
            str(target),
            _Pictures(pictures),
            quant_format=QuantFormat.QDQ,
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            op_types_to_quantize=["Conv", "Add", "Resize", "Relu", "Clip"],
            nodes_to_exclude=exact,
            calibrate_method=CalibrationMethod.MinMax,
        )


def main() -> None:
    """Quantise a model beside itself."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", type=Path, required=True, help="float ONNX file")
    parser.add_argument("--out", type=Path, required=True, help="eight-bit ONNX file")
    parser.add_argument("--data", help="data folder (default: SI3FP_TEST_DATA)")
    parser.add_argument("--count", type=int, default=48, help="calibration pictures")
    options = parser.parse_args()
    facades = read_training(data_folder(options.data))
    quantise(options.model, options.out, calibration_pictures(facades, options.count))
    print(f"{options.out}: {options.out.stat().st_size / 2**20:.1f} MiB")


if __name__ == "__main__":
    main()
