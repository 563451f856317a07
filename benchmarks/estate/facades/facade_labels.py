"""Boxes of a facade picture, exact from its plan, and how much of each can be seen.

The box of a window or door is the outline of its frame's outer edge on the surface that holds it
(the wall, or the back of a loggia), where the camera shows it. On the wall itself that does not
depend on where the camera stands: it is the hole in the wall, so the truth's aperture. The box of
a balcony is its guard's front with the slab's edge. A shop is an area to ignore.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.estate.facades.facade_camera import FacadeCamera
from benchmarks.estate.facades.styles_draft import Box, FacadePlan, box_of
from numpy.typing import NDArray

CATEGORIES = ("window", "balcony_door", "door", "balcony", "shop")
LEAST_VISIBLE = 0.3
LEAST_INSIDE = 0.4
LEAST_PX = 6
BEFORE_M = 0.12  # sills, surrounds and casements are no occluders


@dataclass(frozen=True)
class Label:
    """One box: x0, y0, x1, y1 in pixels, clipped to the picture.

    ``visible`` is the share of its pixels in the picture that nothing hides, ``inside`` the share
    of the whole box that the picture shows, ``closed`` the share that a shutter covers.
    ``seen_px`` bounds the pixels that nothing hides; it is ``box_px`` where all can be seen.
    """

    category: str
    box_px: tuple[float, float, float, float]
    visible: float
    inside: float
    closed: float = 0.0
    seen_px: tuple[float, float, float, float] | None = None

    @property
    def ignore(self) -> bool:
        """Whether nobody should have to find it: shops, and what is hidden, cut or tiny."""
        x0, y0, x1, y1 = self.box_px
        return (
            self.category == "shop"
            or self.visible < LEAST_VISIBLE
            or self.inside < LEAST_INSIDE
            or min(x1 - x0, y1 - y0) < LEAST_PX
        )


def labels_of(
    plan: FacadePlan, camera: FacadeCamera, out_m: NDArray[np.float32]
) -> tuple[Label, ...]:
    """The labels of a picture whose surfaces lie ``out_m`` (H, W) before the wall's plane."""
    found = []
    for box, out, category, closed in _things(plan):
        x0, y0, x1, y1 = camera.shown(box, out)
        left, right = max(x0, 0.0), min(x1, float(camera.width_px))
        top, bottom = max(y0, 0.0), min(y1, float(camera.height_px))
        if right - left < 1 or bottom - top < 1:
            continue
        first, start = int(top), int(left)
        hidden = (
            out_m[first : max(first + 1, round(bottom)), start : max(start + 1, round(right))]
            >= out + BEFORE_M
        )
        inside = (right - left) * (bottom - top) / ((x1 - x0) * (y1 - y0))
        edges = _rounded(left, top, right, bottom)
        found.append(
            Label(
                category,
                edges,
                round(float(1 - hidden.mean()), 3),
                round(float(inside), 3),
                closed,
                _seen(hidden, edges),
            )
        )
    return tuple(found)


def _rounded(x0: float, y0: float, x1: float, y1: float) -> tuple[float, float, float, float]:
    return round(float(x0), 2), round(float(y0), 2), round(float(x1), 2), round(float(y1), 2)


def _seen(
    hidden: NDArray[np.bool_], edges: tuple[float, float, float, float]
) -> tuple[float, float, float, float] | None:
    """Bounds of what is not hidden, within the box; None where all is."""
    rows, columns = np.flatnonzero(~hidden.all(axis=1)), np.flatnonzero(~hidden.all(axis=0))
    if not len(rows):
        return None
    x, y = int(edges[0]), int(edges[1])
    return _rounded(
        edges[0] if columns[0] == 0 else x + columns[0],
        edges[1] if rows[0] == 0 else y + rows[0],
        edges[2] if columns[-1] == hidden.shape[1] - 1 else x + columns[-1] + 1,
        edges[3] if rows[-1] == hidden.shape[0] - 1 else y + rows[-1] + 1,
    )


def _things(plan: FacadePlan) -> list[tuple[Box, float, str, float]]:
    """Boxes on the wall, how far before its plane each is, category, share closed by shutters."""
    things: list[tuple[Box, float, str, float]] = []
    closers = [extra for extra in plan.extras if extra.kind in ("roller", "leaf")]
    for opening in plan.wall.openings:
        box = box_of(opening)
        if any(_holds(shop, box) for shop in plan.shops):
            continue
        closed = max(
            (
                extra.height_m / opening.height_m
                for extra in closers
                if _holds(box, (extra.x_m, extra.y_m, extra.x_m, extra.y_m))
            ),
            default=0.0,
        )
        things.append((box, -opening.depth_m, opening.kind, round(min(closed, 1.0), 3)))
    for balcony in plan.wall.balconies:
        if balcony.guard_m <= 0:
            continue
        slab = balcony.slab_m if balcony.kind in ("solid", "railing") else 0.0
        low, high = balcony.y_m - slab, balcony.y_m + balcony.guard_m
        front = (balcony.x_m, low, balcony.x_m + balcony.width_m, high)
        out = {"loggia": 0.0, "french": 0.08}.get(balcony.kind, balcony.depth_m)
        things.append((front, out, "balcony", 0.0))
    things += [(shop, 0.0, "shop", 0.0) for shop in plan.shops]
    return things


def _holds(outer: Box, inner: Box) -> bool:
    """Whether one box lies in another (1 cm is spared)."""
    return (
        outer[0] - 0.01 <= inner[0]
        and outer[1] - 0.01 <= inner[1]
        and inner[2] <= outer[2] + 0.01
        and inner[3] <= outer[3] + 0.01
    )
