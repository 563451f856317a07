"""The detector: a backbone, a feature pyramid to stride 4 and two heads."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from training.backbone import EfficientNetLite, load_published, published_weights


def conv(inputs: int, outputs: int, kernel: int = 3, stride: int = 1) -> nn.Sequential:
    """Convolution, batch normalisation, ReLU."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


class Residual(nn.Module):
    """Two 3 x 3 convolutions with a shortcut; same shape in and out."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = conv(channels, channels)
        self.second = nn.Sequential(
            nn.Conv2d(channels, channels, 3, 1, 1, bias=False), nn.BatchNorm2d(channels)
        )
        nn.init.zeros_(self.second[1].weight)

    def forward(self, x: Tensor) -> Tensor:
        return torch.relu(x + self.second(self.first(x)))


class SmallResidual(nn.Module):
    """Plain residual backbone, trained from scratch: strides 4, 8, 16 and 32."""

    def __init__(
        self,
        widths: tuple[int, ...] = (48, 80, 144, 200),
        blocks: tuple[int, ...] = (2, 3, 3, 2),
    ) -> None:
        super().__init__()
        self.widths = list(widths)
        self.stem = conv(3, 24, 3, 2)
        stages, before = [], 24
        for width, count in zip(widths, blocks, strict=True):
            stages.append(
                nn.Sequential(conv(before, width, 3, 2), *(Residual(width) for _ in range(count)))
            )
            before = width
        self.stages = nn.ModuleList(stages)

    def freeze(self) -> None:
        """Nothing to keep: all of it learns."""

    def forward(self, image: Tensor) -> list[Tensor]:
        x = self.stem((image - 118.0) / 60.0)
        features = []
        for stage in self.stages:
            x = stage(x)
            features.append(x)
        return features


Backbone = SmallResidual | EfficientNetLite


def make_backbone(name: str, published: bool = False) -> Backbone:
    """``scratch`` or an EfficientNet-Lite by name, on demand with its published weights."""
    if name == "scratch":
        return SmallResidual()
    backbone = EfficientNetLite(name)
    if published:
        load_published(backbone, published_weights(name))
    return backbone


class Detector(nn.Module):
    """Images (N, 3, H, W), RGB 0..255, H and W multiples of 32, to three maps of stride 4.

    ``logits`` (N, 2, H/4, W/4); ``distances`` (N, 4, H/4, W/4): left, top, right, bottom in pixels
    from the centre of the cell, x = 4 (column + 0.5), y = 4 (row + 0.5); ``spreads`` of the same
    shape: the scale b of a Laplace distribution of each distance, in pixels.

    Parameters
    ----------
    backbone
        What makes the feature maps.
    neck
        Channels of pyramid and heads.
    """

    def __init__(self, backbone: Backbone, neck: int = 64, classes: int = 2) -> None:
        super().__init__()
        self.backbone = backbone
        self.laterals = nn.ModuleList(conv(width, neck, 1) for width in self.backbone.widths)
        self.smooth = nn.ModuleList(conv(neck, neck) for _ in self.backbone.widths[:-1])
        self.score_tower = nn.Sequential(conv(neck, neck), conv(neck, neck))
        self.side_tower = nn.Sequential(conv(neck, neck), conv(neck, neck))
        self.score = nn.Conv2d(neck, classes, 3, 1, 1)
        self.side = nn.Conv2d(neck, 4, 3, 1, 1)
        self.spread = nn.Conv2d(neck, 4, 3, 1, 1)
        nn.init.normal_(self.score.weight, std=0.01)
        nn.init.constant_(self.score.bias, -math.log((1 - 0.02) / 0.02))
        for layer, size in ((self.side, 15.0), (self.spread, 3.0)):
            nn.init.normal_(layer.weight, std=0.01)
            nn.init.constant_(layer.bias, math.log(size / 8.0))

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        features = self.backbone(image)
        top = self.laterals[-1](features[-1])
        for k in range(len(features) - 2, -1, -1):
            top = nn.functional.interpolate(top, scale_factor=2.0, mode="nearest")
            top = self.smooth[k](top + self.laterals[k](features[k]))
        logits = self.score(self.score_tower(top)).float()
        sides = self.side_tower(top)
        distances = 8.0 * torch.exp(self.side(sides).float().clamp(-4.0, 4.5))
        # What is unsure about a side must not pull on the side itself.
        spreads = 8.0 * torch.exp(self.spread(sides.detach()).float().clamp(-5.0, 3.0))
        return logits, distances, spreads


class Exported(nn.Module):
    """The detector with the scores after the sigmoid, as it is exported."""

    def __init__(self, detector: Detector) -> None:
        super().__init__()
        self.detector = detector

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        logits, distances, spreads = self.detector(image)
        return torch.sigmoid(logits), distances, spreads


def parameter_count(model: nn.Module) -> int:
    """Number of trainable numbers."""
    return sum(p.numel() for p in model.parameters())
