"""What years of traffic leave on bitumen: dirt, wheel tracks, oil, patches, cracks, lids."""

from __future__ import annotations

import cv2
import numpy as np
from benchmarks.estate.painting.noise import Field
from benchmarks.estate.painting.sheet import Sheet, smooth
from numpy.typing import NDArray


def paint_traffic(
    light: Field,
    warm: Field,
    near_m: Field,
    sheet: Sheet,
    parked: bool,
    rng: np.random.Generator,
) -> None:
    """Paint what traffic leaves: dirt at the edge, paler wheel tracks, oil where cars are parked.

    ``light`` and ``warm`` (h, w) are changed in place; ``near_m`` (h, w) is the way to the edge.
    """
    gutter = np.exp(-near_m / np.float32(0.25)) * np.clip(
        0.8 + 0.5 * sheet.clouds(1.5, 3, rng), 0.0, 1.6
    )
    light -= np.float32(0.10) * gutter
    warm += np.float32(0.012) * gutter
    if parked:
        light -= np.float32(0.22) * smooth(0.15, 0.9, sheet.specks(0.06, 0.20, rng))
        return
    uneven = np.clip(0.7 + 0.4 * sheet.clouds(4.0, 3, rng), 0.0, 1.4)
    for place_m in (1.1, 2.7):
        track = np.exp(-(((near_m - np.float32(place_m)) / np.float32(0.30)) ** 2))
        light += np.float32(0.035) * track * uneven
    middle = np.exp(-(((near_m - np.float32(1.9)) / np.float32(0.25)) ** 2))
    light -= np.float32(0.035) * middle * uneven


def bitumen_repairs(
    bitumen: NDArray[np.bool_], m_per_texel: float, along_deg: float, rng: np.random.Generator
) -> NDArray[np.int8]:
    """Change of brightness (H, W) in 1/255 where bitumen was cut, filled, sealed or cracked."""
    marks = np.zeros(bitumen.shape, np.int8)
    flat = np.flatnonzero(bitumen)
    if len(flat) == 0 or m_per_texel > 0.1:
        return marks
    area_m2 = len(flat) * m_per_texel**2
    bearing = np.radians(along_deg)
    along = np.array([np.sin(bearing), -np.cos(bearing)])  # columns, rows
    aside = np.array([along[1], -along[0]])

    def start() -> NDArray[np.float64]:
        place = int(flat[int(rng.integers(len(flat)))])
        return np.array([place % bitumen.shape[1], place // bitumen.shape[1]], np.float64)

    for _ in range(int(rng.poisson(area_m2 / 90.0))):
        half = np.array([rng.uniform(0.3, 2.5), rng.uniform(0.2, 0.8)]) / m_per_texel
        box = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
        corners = start() + box[:, :1] * along + box[:, 1:] * aside
        tone = int(rng.choice([-1, 1], p=[0.7, 0.3]) * rng.integers(8, 30))
        ring = [np.round(corners * 16).astype(np.int32)]
        wide = marks.view(np.uint8)
        cv2.fillPoly(wide, ring, tone % 256, cv2.LINE_8, 4)
        cv2.polylines(wide, ring, True, (-38) % 256, 1, cv2.LINE_8, 4)
    for _ in range(int(rng.poisson(area_m2 / 35.0))):
        turn = rng.uniform(-0.25, 0.25) + (np.pi / 2 if rng.random() < 0.4 else 0.0)
        steps = int(rng.integers(8, 60))
        angles = turn + rng.uniform(-0.6, 0.6, steps)
        moves = np.cos(angles)[:, None] * along + np.sin(angles)[:, None] * aside
        points = start() + np.cumsum(moves * 0.12 / m_per_texel, axis=0)
        sealed = rng.random() < 0.3
        line = [np.round(points * 16).astype(np.int32)]
        tone, thick = (-62, max(1, round(0.05 / m_per_texel))) if sealed else (-42, 1)
        cv2.polylines(marks.view(np.uint8), line, False, tone % 256, thick, cv2.LINE_8, 4)
    for _ in range(int(rng.poisson(area_m2 / 260.0))):
        centre = tuple(int(v) for v in np.round(start()))
        radius = max(2, round(0.31 / m_per_texel))
        cv2.circle(marks.view(np.uint8), centre, radius, (-70) % 256, -1)
        cv2.circle(marks.view(np.uint8), centre, radius, (-20) % 256, 1)
    marks[~bitumen] = 0
    return marks
