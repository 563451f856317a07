"""Parallel planes of one footprint edge, a bay and its wings, become one facade of the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from si3fp.geometry.boxes import iou_matrix
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Facade, Window

SAME_WINDOW_IOU = 0.3
"""Windows of two planes that overlap so far are one; paper, Algorithm 6."""


def merge_parts(facades: Sequence[Facade]) -> list[Facade]:
    """The facades with those of one edge joined on the plane of the largest.

    Parts carry the edge's id and a number, ``<building>-<edge>.2``; they are shifted along the
    normal onto the main plane, their rectangles joined into the one around them, and a window that
    two parts show is kept once, with the higher score.
    """
    groups: dict[str, list[Facade]] = {}
    for facade in facades:
        groups.setdefault(edge_of(facade.id), []).append(facade)
    return [
        group[0] if len(group) == 1 and group[0].id == name else _joined(name, group)
        for name, group in groups.items()
    ]


def edge_of(facade_id: str) -> str:
    """The id without the number of a part.

    Examples
    --------
    >>> edge_of("house-3.2"), edge_of("house-3"), edge_of("plot.7-1")
    ('house-3', 'house-3', 'plot.7-1')
    """
    stem, dot, number = facade_id.rpartition(".")
    return stem if dot and number.isdecimal() and "-" in stem else facade_id


def _joined(name: str, parts: Sequence[Facade]) -> Facade:
    main = max(parts, key=lambda part: (part.width_m * part.height_m, part.id))
    main_from_world = main.world_from_facade.inverse()
    origins = [main_from_world.apply(part.world_from_facade.translation) for part in parts]
    low = np.min([origin[:2] for origin in origins], axis=0)
    high = np.max(
        [
            np.add(origin[:2], (part.width_m, part.height_m))
            for origin, part in zip(origins, parts, strict=True)
        ],
        axis=0,
    )
    windows = [
        replace(window, x_m=window.x_m + shift[0], y_m=window.y_m + shift[1])
        for origin, part in zip(origins, parts, strict=True)
        for shift in [origin[:2] - low]
        for window in part.windows
    ]
    corner = main.world_from_facade.apply([low[0], low[1], 0.0])
    return Facade(
        name,
        Rigid3(main.world_from_facade.rotation, corner),
        float(high[0] - low[0]),
        float(high[1] - low[1]),
        tuple(_once(windows)),
        _interval(parts, float(np.prod(high - low))),
    )


def _once(windows: Sequence[Window]) -> list[Window]:
    """The windows without those that one of a higher score overlaps, in their order."""
    if not windows:
        return []
    boxes = np.array([[w.x_m, w.y_m, w.x_m + w.width_m, w.y_m + w.height_m] for w in windows])
    overlap: FloatArray = iou_matrix(boxes, boxes)
    kept: list[int] = []
    for index in sorted(range(len(windows)), key=lambda i: -windows[i].score):
        if not (overlap[index, kept] > SAME_WINDOW_IOU).any():
            kept.append(index)
    return [windows[index] for index in sorted(kept)]


def _interval(parts: Sequence[Facade], area_m2: float) -> tuple[float, float] | None:
    """The intervals of the parts by area: as if their errors went together, which is the wider."""
    ends = np.zeros(2)
    for part in parts:
        if part.wwr_interval is None:
            return None
        ends += np.array(part.wwr_interval) * part.width_m * part.height_m
    low, high = ends / area_m2
    return float(low), float(min(high, 1.0))
