"""Openings of a wall become windows: parts of one window are joined, outlines become rectangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from si3fp.geometry.rigid import FloatArray
from si3fp.model import Window

PARTS_TOUCH_M = 0.05  # decision: parts of one window lie closer than this, a mullion's width,
SHARED_EDGE = 0.5  # along at least this share of the shorter edge
RECTANGULAR = 0.95  # decision: an outline fills this share of its rectangle, or it is said


@dataclass(frozen=True, slots=True, eq=False)
class Opening:
    """One aperture or glazed door.

    Attributes
    ----------
    window_id
        The window that it is a part of; None where the model does not say.
    label
        As in `Window`.
    outline_m
        Corners (V, 2) on the plane of its wall.
    """

    window_id: str | None
    label: Literal["window", "balcony_door"]
    outline_m: FloatArray


def area_m2(outline_m: FloatArray) -> float:
    """Area of a simple polygon (V, 2)."""
    x, y = outline_m.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)


def windows_of(openings: Sequence[Opening], join_touching: bool) -> tuple[list[Window], int]:
    """Windows as bounding rectangles of their parts, and how many openings were joined by touch.

    Parameters
    ----------
    openings
        On one plane, from the facade's lower left corner.
    join_touching
        Join those without ``window_id`` that share an edge too.
    """
    groups: dict[str, list[Opening]] = {}
    loose: list[list[Opening]] = []
    for opening in openings:
        if opening.window_id is None:
            loose.append([opening])
        else:
            groups.setdefault(opening.window_id, []).append(opening)
    if join_touching:
        loose = _joined(loose)
    # One part that touches nothing stays: the rest of each group was joined away.
    joined = sum(len(group) for group in loose if len(group) > 1)
    return [_window(group) for group in [*groups.values(), *loose]], joined


def _joined(groups: list[list[Opening]]) -> list[list[Opening]]:
    done: list[list[Opening]] = []
    for group in groups:
        touching = [other for other in done if any(_touch(group[0], part) for part in other)]
        done = [other for other in done if other not in touching]
        done.append([*(part for other in touching for part in other), *group])
    return done


def _touch(a: Opening, b: Opening) -> bool:
    """Whether two openings share an edge: a gap one way, a common stretch the other."""
    low, high = (
        np.maximum(a.outline_m.min(axis=0), b.outline_m.min(axis=0)),
        np.minimum(a.outline_m.max(axis=0), b.outline_m.max(axis=0)),
    )
    shared_m = high - low
    shorter_m = np.minimum(np.ptp(a.outline_m, axis=0), np.ptp(b.outline_m, axis=0))
    near = shared_m > -PARTS_TOUCH_M
    along = shared_m >= SHARED_EDGE * shorter_m
    return bool((near[0] and along[1]) or (near[1] and along[0]))


def _window(parts: Sequence[Opening]) -> Window:
    outline = np.concatenate([part.outline_m for part in parts])
    (left, bottom), (width, height) = outline.min(axis=0), np.ptp(outline, axis=0)
    door = any(part.label == "balcony_door" for part in parts)
    return Window(
        float(left),
        float(bottom),
        float(width),
        float(height),
        "balcony_door" if door else "window",
    )
