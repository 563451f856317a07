"""Wheels of cars."""

from __future__ import annotations

import numpy as np
from benchmarks.estate.parts import Mesh
from benchmarks.estate.plan import FloatArray

TYRE_RADIUS_M = 0.315
SIDES = 28
SPOKES = 7
# Distance from the axle and along it (outwards) of the tyre's and the rim's outline.
_TYRE = ((0.20, -0.10), (0.29, -0.105), (0.315, -0.08), (0.315, 0.08), (0.29, 0.10), (0.205, 0.092))
_RIM = ((0.205, 0.092), (0.195, 0.08), (0.185, 0.07), (0.07, 0.085), (0.001, 0.088))


def wheel_meshes(centre: FloatArray, side: int) -> list[Mesh]:
    """A wheel with its axle along y whose outer face looks to ``side`` (+1 or -1)."""
    turn = 2 * np.pi * np.arange(SIDES + 1) / SIDES
    tyre = _turned(np.array(_TYRE), turn, centre, side)
    rim = _turned(np.array(_RIM), turn, centre, side)
    gaps = np.zeros((len(_RIM) - 1, SIDES), bool)
    gaps[2] = (np.arange(SIDES) * SPOKES % SIDES) * 2 >= SIDES
    return [
        _mesh("car-tyre", tyre, np.ones((len(_TYRE) - 1, SIDES), bool), side, smooth=True),
        _mesh("car-rim", rim, ~gaps, side, smooth=False),
        _mesh("car-gap", rim, gaps, side, smooth=False),
    ]


def _turned(profile: FloatArray, turn: FloatArray, centre: FloatArray, side: int) -> FloatArray:
    """The surface (P, T, 3) that a profile (radius, along the axle) sweeps."""
    radius, along = profile[:, :1], np.broadcast_to(profile[:, 1:], (len(profile), len(turn)))
    return centre + np.stack([radius * np.cos(turn), side * along, radius * np.sin(turn)], axis=-1)


def _mesh(material: str, grid: FloatArray, chosen: np.ndarray, side: int, *, smooth: bool) -> Mesh:
    rows, columns = grid.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    quads = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1)
    quads = quads[chosen]
    if side < 0:
        quads = quads[:, ::-1]
    faces = np.concatenate([quads[:, [0, 2, 1]], quads[:, [0, 3, 2]]]).astype(np.int32)
    normals = None
    if smooth:
        normals = np.cross(np.gradient(grid, axis=1), np.gradient(grid, axis=0)).reshape(-1, 3)
        normals *= -side / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        normals = normals.astype(np.float32)
    return Mesh(material, grid.reshape(-1, 3).astype(np.float32), faces, None, normals)
