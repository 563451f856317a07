"""M.1: doors at the ground are no windows, but the terrace door beside a window is one.

A hedge or steps hide the foot of an entrance, so the sills of its storey tell more than its own
lower edge (docs/decisions/0018-openings-behind-balconies.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from si3fp.config import MeasureConfig
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Window
from si3fp.windows.balcony_openings import door_beside
from si3fp.windows.regular import edges_of

FOOT_M = 1.0
"""Hedges and steps hide no more than this of a door's foot."""
HEAD_M = (1.8, 3.2)
"""Heads of doors above the ground; what ends lower lights a basement, higher a staircase."""
BELOW_SILLS_M = 0.5
"""Doors go at least so far below the sills of their storey; window kinds differ by less."""
LEAST_ROW = 2
"""Windows of a storey that tell where its sills are."""


def without_entrances(
    windows: Sequence[Window], storey: Sequence[Window], config: MeasureConfig
) -> tuple[tuple[Window, ...], FloatArray]:
    """The windows that are no doors at the ground, and left, right, bottom, top (M, 4) of those.

    Parameters
    ----------
    windows
        Measured openings.
    storey
        The windows whose sills tell where those of a storey are; ``windows``, if these are sure.
    config
        What stands on the ground whatever is beside it.

    Notes
    -----
    A door beside a window that has its head and a higher sill opens from a room to a terrace: it
    stays, as ``balcony_door``. What is one already, because of a balcony before it, stays too.
    """
    edges_m, others_m = edges_of(windows), edges_of(storey)
    upright = others_m[~_at_ground(others_m, config)]
    kept, gone = [], []
    for window, edges in zip(windows, edges_m, strict=True):
        stands = _at_ground(edges[None], config)[0] or _below_row(edges, upright)
        higher = upright[upright[:, 2] > edges[2] + BELOW_SILLS_M]
        if not stands or window.label == "balcony_door":
            kept.append(window)
        elif door_beside(edges[[0, 1, 3]], higher[:, [0, 1, 3]]):
            said = f"{window.evidence}; a door beside a window with the same head, no entrance"
            kept.append(replace(window, label="balcony_door", evidence=said))
        else:
            gone.append(edges)
    return tuple(kept), np.array(gone).reshape(-1, 4)


def _at_ground(edges_m: FloatArray, config: MeasureConfig) -> NDArray[np.bool_]:
    """(N,) whether openings (N, 4) stand on the ground and are as tall as a door or gate."""
    bottom, top = edges_m[:, 2], edges_m[:, 3]
    stands: NDArray[np.bool_] = (bottom < config.door_sill_m) & (
        top - bottom > config.door_height_m
    )
    return stands


def _below_row(edges_m: FloatArray, others_m: FloatArray) -> bool:
    """Whether an opening (4,) near the ground goes far below the sills of its storey.

    The storey are those of the others (N, 4) that begin below its head and end above its middle.
    """
    bottom, top = edges_m[2:]
    beside = (others_m[:, 2] < top) & (others_m[:, 3] > (bottom + top) / 2)
    beside &= (others_m != edges_m).any(axis=1)
    return bool(
        bottom < FOOT_M
        and HEAD_M[0] < top < HEAD_M[1]
        and beside.sum() >= LEAST_ROW
        and bottom < np.median(others_m[beside, 2]) - BELOW_SILLS_M
    )
