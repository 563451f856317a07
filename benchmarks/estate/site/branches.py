"""Branches as lines with radii, side branches, and round bars along them."""

from __future__ import annotations

import numpy as np
from benchmarks.estate.parts import Mesh
from benchmarks.estate.plan import FloatArray

Branches = tuple[FloatArray, FloatArray]
"""Lines (N, K, 3) and their radii (N, K)."""


def grown(
    starts: FloatArray,
    ahead: FloatArray,
    length: FloatArray,
    radius: FloatArray,
    points: int,
    wobble: float,
    lift: float,
    rng: np.random.Generator,
) -> Branches:
    """Branches from starts (N, 3) that wobble and turn up by ``lift`` (down if negative)."""
    lines = [starts]
    direction = ahead
    for _ in range(points - 1):
        direction = direction + rng.normal(0, wobble, direction.shape)
        direction[:, 2] += lift / (points - 1)
        direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
        lines.append(lines[-1] + direction * (length / (points - 1))[:, None])
    taper = np.linspace(1, 0.25, points)
    return np.stack(lines, axis=1), radius[:, None] * taper


def children(
    parents: Branches,
    each: int,
    first: float,
    angles_deg: tuple[float, float],
    share: float,
    hang: float,
    rng: np.random.Generator,
) -> Branches:
    """Side branches of every parent and one that carries its end on."""
    lines, radii = parents
    count = len(lines)
    parent = np.repeat(np.arange(count), each)
    at = (
        first
        + (1 - first) * (np.tile(np.arange(each), count) + rng.uniform(0, 1, count * each)) / each
    )
    starts = point_at(lines[parent], at)
    axis = lines[parent, -1] - lines[parent, 0]
    length = np.linalg.norm(axis, axis=1)
    axis /= length[:, None]
    angle = np.deg2rad(rng.uniform(*angles_deg, count * each))
    side = np.cross(axis, rng.normal(0, 1, axis.shape))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    ahead = axis * np.cos(angle)[:, None] + side * np.sin(angle)[:, None]
    size = np.maximum(length * share * (1.15 - 0.55 * at), 0.15) * rng.uniform(
        0.7, 1.2, count * each
    )
    thick = np.maximum(radii[parent, 0] * 0.45 * (1.1 - 0.6 * at), 0.004)
    return grown(starts, ahead, size, thick, 4, 0.16, -hang * 1.6 + 0.1, rng)


def point_at(lines: FloatArray, share: FloatArray) -> FloatArray:
    """The point (N, 3) of every line (N, K, 3) at its share (N,) of the way."""
    place = np.clip(share, 0, 1) * (lines.shape[1] - 1)
    low = np.minimum(place.astype(int), lines.shape[1] - 2)
    rows = np.arange(len(lines))
    rest = (place - low)[:, None]
    return lines[rows, low] * (1 - rest) + lines[rows, low + 1] * rest


def thinned(branches: Branches, points: int) -> Branches:
    """The branches with fewer points."""
    lines, radii = branches
    chosen = np.linspace(0, lines.shape[1] - 1, points).round().astype(int)
    return lines[:, chosen], radii[:, chosen]


def tubes(material: str, lines: FloatArray, radii: FloatArray, sides: int) -> Mesh:
    """Round bars along lines (N, K, 3) with radii (N, K); ``uv`` is in metres around and along."""
    count, points = radii.shape
    tangent = np.gradient(lines, axis=1)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=2, keepdims=True), 1e-9)
    helper = np.where(np.abs(tangent[:, :1, 2:]) > 0.9, [[[1.0, 0, 0]]], [[[0, 0, 1.0]]])
    first = np.cross(helper, tangent)
    first /= np.maximum(np.linalg.norm(first, axis=2, keepdims=True), 1e-9)
    second = np.cross(tangent, first)
    turn = 2 * np.pi * np.arange(sides + 1) / sides
    round_ = (
        first[:, :, None] * np.cos(turn)[None, None, :, None]
        + second[:, :, None] * np.sin(turn)[None, None, :, None]
    )
    vertices = lines[:, :, None] + round_ * radii[:, :, None, None]
    steps = np.linalg.norm(np.diff(lines, axis=1), axis=2)
    along = np.concatenate([np.zeros((count, 1)), np.cumsum(steps, axis=1)], axis=1)
    uv = np.stack(
        np.broadcast_arrays(turn[None, None] * radii[:, :1, None], along[:, :, None]), axis=-1
    )
    index = np.arange(count * points * (sides + 1)).reshape(count, points, sides + 1)
    a, b = index[:, :-1, :-1], index[:, :-1, 1:]
    c, d = index[:, 1:, 1:], index[:, 1:, :-1]
    faces = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], -2).reshape(-1, 3)
    return Mesh(
        material,
        vertices.reshape(-1, 3).astype(np.float32),
        faces.astype(np.int32),
        uv.reshape(-1, 2).astype(np.float32),
        round_.reshape(-1, 3).astype(np.float32),
    )
