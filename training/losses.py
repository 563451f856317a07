"""Losses: penalty-reduced focal loss on the centres, GIoU and L1 on the sides."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import logsigmoid


def centre_loss(logits: Tensor, heat: Tensor, weight: Tensor, negative: Tensor) -> Tensor:
    """Focal loss over (N, C, h, w), divided by the number of centres.

    ``weight`` (N, C, h, w) switches cells off; ``negative`` (same shape) scales only the loss of
    cells that are no centre, for data sets in which some objects are unlabelled.
    """
    probability = torch.sigmoid(logits)
    centre = (heat >= 0.999).float() * weight
    gain = centre * (1 - probability) ** 2 * logsigmoid(logits)
    elsewhere = (1 - centre) * weight * negative * (1 - heat) ** 4
    loss = elsewhere * probability**2 * logsigmoid(-logits)
    return -(gain.sum() + loss.sum()) / centre.sum().clamp(min=1.0)


def side_loss(distances: Tensor, sides: Tensor, weight: Tensor) -> tuple[Tensor, Tensor]:
    """(1 - GIoU, relative L1), averaged with ``weight`` (N, h, w); sides are (N, 4, h, w) px."""
    chosen = weight > 0
    scale = weight[chosen]
    if scale.numel() == 0:
        zero = distances.sum() * 0.0
        return zero, zero
    got = distances.permute(0, 2, 3, 1)[chosen]
    want = sides.permute(0, 2, 3, 1)[chosen]
    low, high = torch.minimum(got, want), torch.maximum(got, want)
    common = (low[:, 0] + low[:, 2]) * (low[:, 1] + low[:, 3])
    hull = (high[:, 0] + high[:, 2]) * (high[:, 1] + high[:, 3])
    area_got = (got[:, 0] + got[:, 2]) * (got[:, 1] + got[:, 3])
    area_want = (want[:, 0] + want[:, 2]) * (want[:, 1] + want[:, 3])
    union = area_got + area_want - common
    giou = common / union - (hull - union) / hull
    extent = torch.stack([want[:, 0] + want[:, 2], want[:, 1] + want[:, 3]], dim=1).repeat(1, 2)
    relative = ((got - want).abs() / extent).clamp(max=2.0).mean(dim=1)
    total = scale.sum()
    return ((1 - giou) * scale).sum() / total, (relative * scale).sum() / total


def spread_loss(distances: Tensor, spreads: Tensor, sides: Tensor, weight: Tensor) -> Tensor:
    """Negative log-likelihood of the sides under Laplace distributions around the found ones.

    All (N, 4, h, w) px, ``weight`` (N, h, w). Moves the spreads only, never the distances.
    """
    chosen = weight > 0
    if not chosen.any():
        return spreads.sum() * 0.0
    scale = weight[chosen][:, None]
    error = (distances.detach() - sides).abs().permute(0, 2, 3, 1)[chosen]
    b = spreads.permute(0, 2, 3, 1)[chosen]
    likelihood: Tensor = ((error / b + torch.log(b)) * scale).sum() / (4 * scale.sum())
    return likelihood
