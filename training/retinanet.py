"""RetinaNet with ResNet-50 and a feature pyramid: the network of the paper's detector.

Plain torch with the module names of torchvision's ``retinanet_resnet50_fpn``, so that its published
COCO weights load: strides in the 3 x 3 convolutions, levels P3 to P5 from C3 to C5, P6 and P7 from
P5. He et al. 2016, arXiv:1512.03385; Lin et al. 2017, arXiv:1612.03144 and arXiv:1708.02002.
"""

from __future__ import annotations

import hashlib
import math
import re
import warnings
from pathlib import Path
from typing import Literal

import torch
from torch import Tensor, nn
from torch.nn.functional import interpolate, relu

from si3fp.errors import InputError
from training.anchors import PER_CELL

Norm = Literal["frozen", "batch"]
PUBLISHED_SHA256 = "eeacb38b"
"""First digits of the SHA-256 of ``retinanet_resnet50_fpn_coco-eeacb38b.pth``."""
MEAN_RGB = (123.675, 116.28, 103.53)
DEVIATION_RGB = (58.395, 57.12, 57.375)
"""Statistics of ImageNet, for RGB 0..255."""
OPSET = 18
_PRIOR = 0.01
_OUTPUT = "head.classification_head.cls_logits."


class FrozenBatchNorm(nn.Module):
    """Batch normalisation whose statistics and factors are constants.

    Nothing is added to the variance: the published weights were trained that way.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        for name, value in (("weight", 1), ("bias", 0), ("running_mean", 0), ("running_var", 1)):
            self.register_buffer(name, torch.full((channels,), float(value)))

    def forward(self, x: Tensor) -> Tensor:
        factor = self.weight * self.running_var.rsqrt()
        offset = self.bias - self.running_mean * factor
        return x * factor[:, None, None].to(x.dtype) + offset[:, None, None].to(x.dtype)


def _normalisation(norm: Norm, channels: int) -> nn.Module:
    return FrozenBatchNorm(channels) if norm == "frozen" else nn.BatchNorm2d(channels)


class _Bottleneck(nn.Module):
    """Residual unit: 1 x 1, 3 x 3 with the stride, 1 x 1 to four times the width."""

    def __init__(self, inputs: int, width: int, stride: int, norm: Norm) -> None:
        super().__init__()
        outputs = 4 * width
        self.conv1 = nn.Conv2d(inputs, width, 1, bias=False)
        self.bn1 = _normalisation(norm, width)
        self.conv2 = nn.Conv2d(width, width, 3, stride, 1, bias=False)
        self.bn2 = _normalisation(norm, width)
        self.conv3 = nn.Conv2d(width, outputs, 1, bias=False)
        self.bn3 = _normalisation(norm, outputs)
        self.downsample = None
        if stride > 1 or inputs != outputs:
            self.downsample = nn.Sequential(
                nn.Conv2d(inputs, outputs, 1, stride, bias=False), _normalisation(norm, outputs)
            )

    def forward(self, x: Tensor) -> Tensor:
        y = relu(self.bn1(self.conv1(x)))
        y = relu(self.bn2(self.conv2(y)))
        shortcut = x if self.downsample is None else self.downsample(x)
        return relu(self.bn3(self.conv3(y)) + shortcut)


class _Body(nn.Module):
    """Images to C3, C4 and C5 (strides 8, 16, 32)."""

    def __init__(self, norm: Norm, width: int, blocks: tuple[int, ...]) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(3, width, 7, 2, 3, bias=False)
        self.bn1 = _normalisation(norm, width)
        self.pool = nn.MaxPool2d(3, 2, 1)
        inputs = width
        for level, count in enumerate(blocks):
            units = []
            for k in range(count):
                stride = 2 if level > 0 and k == 0 else 1
                units.append(_Bottleneck(inputs, width << level, stride, norm))
                inputs = 4 * width << level
            self.add_module(f"layer{level + 1}", nn.Sequential(*units))
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")

    def forward(self, image: Tensor) -> list[Tensor]:
        c2 = self.layer1(self.pool(relu(self.bn1(self.conv1(image)))))
        c3 = self.layer2(c2)
        c4 = self.layer3(c3)
        return [c3, c4, self.layer4(c4)]


class _Pyramid(nn.Module):
    """C3 to C5 to P3 to P7, all of the same width."""

    def __init__(self, widths: list[int], channels: int) -> None:
        super().__init__()
        self.inner_blocks = nn.ModuleList(
            nn.Sequential(nn.Conv2d(width, channels, 1)) for width in widths
        )
        self.layer_blocks = nn.ModuleList(
            nn.Sequential(nn.Conv2d(channels, channels, 3, padding=1)) for _ in widths
        )
        self.extra_blocks = nn.ModuleDict(
            {name: nn.Conv2d(channels, channels, 3, 2, 1) for name in ("p6", "p7")}
        )
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_uniform_(module.weight, a=1)
                nn.init.zeros_(module.bias)

    def forward(self, features: list[Tensor]) -> list[Tensor]:
        inner = self.inner_blocks[2](features[2])
        levels = [self.layer_blocks[2](inner)]
        for k in (1, 0):
            inner = self.inner_blocks[k](features[k]) + interpolate(inner, scale_factor=2.0)
            levels.insert(0, self.layer_blocks[k](inner))
        p6 = self.extra_blocks["p6"](levels[-1])
        return [*levels, p6, self.extra_blocks["p7"](relu(p6))]


class _Branch(nn.Module):
    """Four convolutions and an output, the same for all levels; (N, A, values) of all levels."""

    def __init__(self, channels: int, values: int, output: str, bias: float) -> None:
        super().__init__()
        self.conv = nn.Sequential(
            *(nn.Sequential(nn.Conv2d(channels, channels, 3, padding=1), nn.ReLU()) for _ in "1234")
        )
        self.values, self.output = values, output
        self.add_module(output, nn.Conv2d(channels, PER_CELL * values, 3, padding=1))
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.normal_(module.weight, std=0.01)
                nn.init.zeros_(module.bias)
        nn.init.constant_(getattr(self, output).bias, bias)

    def forward(self, levels: list[Tensor]) -> Tensor:
        last = getattr(self, self.output)
        rows = []
        for level in levels:
            out = last(self.conv(level)).permute(0, 2, 3, 1)
            rows.append(out.reshape(out.shape[0], -1, self.values))
        return torch.cat(rows, dim=1)


class RetinaNet(nn.Module):
    """Images (N, 3, H, W), RGB 0..255, to logits (N, A, labels) and deltas (N, A, 4).

    H and W are multiples of 32; the A anchors are those of `training.anchors.anchors`.

    Parameters
    ----------
    labels
        Number of labels. There is no background label; the published weights have 91, of which
        number 0 and ten more stand for nothing.
    norm
        ``frozen`` to start from published weights (constants; the stem and the first stage stay as
        they are too), ``batch`` to train from scratch, where frozen statistics mean nothing and
        the heads, which have no normalisation, begin with weights that keep the variance.
    width, channels, blocks
        Of the backbone's stem, of the pyramid, and units per stage; ResNet-50 by default.
    """

    def __init__(
        self,
        labels: int,
        norm: Norm = "frozen",
        width: int = 64,
        channels: int = 256,
        blocks: tuple[int, ...] = (3, 4, 6, 3),
    ) -> None:
        super().__init__()
        self.labels, self.norm = labels, norm
        body = _Body(norm, width, blocks)
        pyramid = _Pyramid([8 * width, 16 * width, 32 * width], channels)
        self.backbone = nn.ModuleDict({"body": body, "fpn": pyramid})
        prior = -math.log((1 - _PRIOR) / _PRIOR)
        self.head = nn.ModuleDict(
            {
                "classification_head": _Branch(channels, labels, "cls_logits", prior),
                "regression_head": _Branch(channels, 4, "bbox_reg", 0.0),
            }
        )
        if norm == "batch":
            for branch in self.head.values():
                for unit in branch.conv:
                    nn.init.kaiming_normal_(unit[0].weight, nonlinearity="relu")
        for name, value in (("mean", MEAN_RGB), ("deviation", DEVIATION_RGB)):
            self.register_buffer(name, torch.tensor(value)[:, None, None], persistent=False)

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor]:
        features = self.backbone["body"]((image - self.mean) / self.deviation)
        levels = self.backbone["fpn"](features)
        return self.head["classification_head"](levels), self.head["regression_head"](levels)


def load_published(model: RetinaNet, path: Path, sha256_start: str = PUBLISHED_SHA256) -> None:
    """Put published weights in place; the output of another number of labels stays as it is.

    The stem and the first stage no longer learn afterwards.

    Parameters
    ----------
    model
        With ``norm="frozen"``.
    path
        ``retinanet_resnet50_fpn_coco-eeacb38b.pth``. It carries the names of 2020 (``conv.2`` for
        ``conv.1.0``, ``inner_blocks.0`` for ``inner_blocks.0.0``); today's are read too.
    sha256_start
        First digits of its SHA-256.

    Raises
    ------
    InputError
        If the file is missing, is another one, or does not fit the network.
    """
    if model.norm != "frozen":
        raise InputError(f'{path.name} needs RetinaNet(norm="frozen"), not "{model.norm}".')
    try:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"Cannot read the published weights {path}: {error}.") from error
    if not digest.startswith(sha256_start):
        raise InputError(
            f"{path} has SHA-256 {digest}, which does not begin with {sha256_start}: the file is "
            "damaged or is another one. Fetch retinanet_resnet50_fpn_coco-eeacb38b.pth again."
        )
    published = torch.load(path, map_location="cpu", weights_only=True)
    state = {_todays_name(name): value for name, value in published.items()}
    state = {name: v for name, v in state.items() if not name.endswith("num_batches_tracked")}
    own = model.state_dict()
    for name in [name for name in own if name.startswith(_OUTPUT)]:
        if name in state and state[name].shape != own[name].shape:
            state[name] = own[name]
    try:
        model.load_state_dict(state)
    except RuntimeError as error:
        raise InputError(f"{path} does not fit RetinaNet with ResNet-50: {error}") from error
    body = model.backbone["body"]
    for part in (body.conv1, body.layer1):
        part.requires_grad_(False)


def _todays_name(name: str) -> str:
    """``head.*.conv.2k.x`` to ``conv.k.0.x`` and ``fpn.*_blocks.k.x`` to ``*_blocks.k.0.x``."""
    old = re.fullmatch(r"(head\.\w+\.conv\.)(\d)\.(weight|bias)", name)
    if old:
        return f"{old[1]}{int(old[2]) // 2}.0.{old[3]}"
    return re.sub(r"((?:inner|layer)_blocks\.\d)\.(weight|bias)$", r"\1.0.\2", name)


def export_onnx(model: RetinaNet, path: Path, size: tuple[int, int]) -> None:
    """Write the network as ONNX, ``image`` to ``logits`` and ``deltas``, for inputs of (W, H) px.

    Anchors, decoding and non-maximum suppression stay outside (`training.anchors.detections`).
    """
    image = torch.zeros(1, 3, size[1], size[0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # as in training.export: the TorchScript exporter
        torch.onnx.export(
            model.eval().to(memory_format=torch.contiguous_format),
            (image,),
            str(path),
            opset_version=OPSET,
            dynamo=False,
            input_names=["image"],
            output_names=["logits", "deltas"],
        )
