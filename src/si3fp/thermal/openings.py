"""Windows as openings of a wall under EnergyPlus's rules, repaired minimally.

Wall coordinates: x right seen from outside, y up, from the wall's lower left corner, metres. An
opening lies in the wall's plane, at least `inset_m` inside its edges (so it is never the whole
wall), overlaps no other and has no side below `MIN_SIDE_M`. Every change is noted with its size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from si3fp.geometry.rigid import Rigid3
from si3fp.model import Facade, Window

MIN_SIDE_M = 0.1  # decision: narrower openings are leftovers of a repair
MAX_SHIFT_M = 0.3  # decision: a larger shift onto the wall plane is noted
MAX_TURN_DEG = 30.0  # decision: a facade turned further does not belong to the edge
SAME_OPENING = 0.5  # share of the smaller opening; a larger overlap is the same window twice
NEGLIGIBLE_M = 1e-6


@dataclass(frozen=True, slots=True)
class Opening:
    """An axis-aligned rectangle on a wall, made of a window or of a part of one.

    Attributes
    ----------
    left_m, right_m, bottom_m, top_m
        Edges in wall coordinates.
    window
        The window that it shows.
    window_id
        ``<facade id>-w<index>``; parts of a window that a slab splits share it.
    """

    left_m: float
    right_m: float
    bottom_m: float
    top_m: float
    window: Window
    window_id: str

    @property
    def width_m(self) -> float:
        """Horizontal size."""
        return self.right_m - self.left_m

    @property
    def height_m(self) -> float:
        """Vertical size."""
        return self.top_m - self.bottom_m

    @property
    def area_m2(self) -> float:
        """Area."""
        return self.width_m * self.height_m

    @property
    def is_too_small(self) -> bool:
        """Whether a side is below `MIN_SIDE_M` (0.1 mm of grace for rounding)."""
        return min(self.width_m, self.height_m) < MIN_SIDE_M - 1e-4

    def clipped(self, left_m: float, right_m: float, bottom_m: float, top_m: float) -> Opening:
        """The part inside a rectangle; its sizes are negative where there is none."""
        return replace(
            self,
            left_m=max(self.left_m, left_m),
            right_m=min(self.right_m, right_m),
            bottom_m=max(self.bottom_m, bottom_m),
            top_m=min(self.top_m, top_m),
        )


def _size(opening: Opening) -> str:
    return f"{opening.width_m:.2f} x {opening.height_m:.2f} m"


def project(facade: Facade, world_from_wall: Rigid3) -> tuple[list[Opening], list[str]]:
    """Openings (unclipped) of a facade's windows, moved orthogonally onto a wall's plane; notes.

    The facade may differ from the wall by some centimetres and tenths of a degree: an opening takes
    the mean position of the window's corners on each side.
    """
    wall_from_facade = world_from_wall.inverse() @ facade.world_from_facade
    turn_deg = float(np.rad2deg(np.arccos(np.clip(wall_from_facade.rotation[2, 2], -1, 1))))
    if facade.windows and turn_deg > MAX_TURN_DEG:
        return [], [
            f"{facade.id}: the facade is turned by {turn_deg:.0f} degrees against its footprint "
            f"edge; its {len(facade.windows)} windows are dropped."
        ]
    openings = []
    shift_m = 0.0
    for index, window in enumerate(facade.windows):
        left, right = window.x_m, window.x_m + window.width_m
        bottom, top = window.y_m, window.y_m + window.height_m
        x, y, z = wall_from_facade.apply(
            [[left, bottom, 0.0], [right, bottom, 0.0], [right, top, 0.0], [left, top, 0.0]]
        ).T
        shift_m = max(shift_m, float(np.abs(z).max()))
        openings.append(
            Opening(
                left_m=float(x[0] + x[3]) / 2,
                right_m=float(x[1] + x[2]) / 2,
                bottom_m=float(y[0] + y[1]) / 2,
                top_m=float(y[2] + y[3]) / 2,
                window=window,
                window_id=f"{facade.id}-w{index}",
            )
        )
    notes = []
    if shift_m > MAX_SHIFT_M:
        notes.append(
            f"{facade.id}: windows are moved by up to {shift_m:.2f} m onto the footprint edge."
        )
    return openings, notes


def fit(
    openings: Sequence[Opening], width_m: float, height_m: float, inset_m: float
) -> tuple[list[Opening], list[str]]:
    """Openings clipped to a wall of width_m x height_m, without overlaps, and notes."""
    notes: list[str] = []
    inside: list[Opening] = []
    for opening in openings:
        part = opening.clipped(inset_m, width_m - inset_m, inset_m, height_m - inset_m)
        if min(part.width_m, part.height_m) <= 0:
            notes.append(
                f"{opening.window_id}: dropped, {_size(opening)} entirely outside its wall."
            )
        elif part.is_too_small:
            notes.append(
                f"{opening.window_id}: dropped, only {_size(part)} of {_size(opening)} on its wall."
            )
        else:
            if opening.area_m2 - part.area_m2 > NEGLIGIBLE_M:
                notes.append(
                    f"{opening.window_id}: clipped to its wall, {_size(opening)} became "
                    f"{_size(part)} ({part.area_m2 - opening.area_m2:+.2f} m2)."
                )
            inside.append(part)
    separate, overlap_notes = _separated(inside)
    return separate, notes + overlap_notes


def _separated(openings: Sequence[Opening]) -> tuple[list[Opening], list[str]]:
    """Openings without overlaps: a duplicate goes, others meet in the middle of the overlap.

    One pass over the pairs is enough, as a repair only shrinks or removes.
    """
    kept: list[Opening | None] = list(openings)
    notes = []
    for i in range(len(kept)):
        for j in range(i + 1, len(kept)):
            first, second = kept[i], kept[j]
            if first is None or second is None:
                continue
            wide = min(first.right_m, second.right_m) - max(first.left_m, second.left_m)
            high = min(first.top_m, second.top_m) - max(first.bottom_m, second.bottom_m)
            if wide <= NEGLIGIBLE_M or high <= NEGLIGIBLE_M:
                continue
            if wide * high > SAME_OPENING * min(first.area_m2, second.area_m2):
                weaker = j if _strength(first) >= _strength(second) else i
                lost, stays = (second, first) if weaker == j else (first, second)
                kept[weaker] = None
                notes.append(
                    f"{lost.window_id}: dropped, {_size(lost)} covered by {stays.window_id}."
                )
                continue
            everything = {
                "left_m": -np.inf,
                "right_m": np.inf,
                "bottom_m": -np.inf,
                "top_m": np.inf,
            }
            if wide <= high:
                before = first.left_m + first.right_m <= second.left_m + second.right_m
                cut = max(first.left_m, second.left_m) + wide / 2
                low, high_side = {"right_m": cut}, {"left_m": cut}
            else:
                before = first.bottom_m + first.top_m <= second.bottom_m + second.top_m
                cut = max(first.bottom_m, second.bottom_m) + high / 2
                low, high_side = {"top_m": cut}, {"bottom_m": cut}
            sides = (low, high_side) if before else (high_side, low)
            notes.append(
                f"{first.window_id} and {second.window_id}: overlap of {wide:.2f} x {high:.2f} m "
                "removed, half from each."
            )
            for k, opening, side in ((i, first, sides[0]), (j, second, sides[1])):
                shrunk = opening.clipped(**{**everything, **side})
                kept[k] = None if shrunk.is_too_small else shrunk
                if shrunk.is_too_small:
                    notes.append(f"{shrunk.window_id}: dropped, only {_size(shrunk)} is left.")
    return [opening for opening in kept if opening is not None], notes


def _strength(opening: Opening) -> tuple[float, float]:
    return opening.window.score, opening.area_m2


def split(
    openings: Sequence[Opening], levels_m: Sequence[float], inset_m: float
) -> tuple[list[list[Opening]], list[str]]:
    """Openings by storey, cut where they cross a slab, and notes.

    Parameters
    ----------
    openings
        Openings that fit the wall.
    levels_m
        Heights of the slabs above the wall's foot, from 0 to the wall's height; storey k lies
        between levels k and k + 1.
    inset_m
        Least distance to a slab.
    """
    storeys: list[list[Opening]] = [[] for _ in levels_m[1:]]
    notes = []
    for opening in openings:
        parts: list[Opening] = []
        for storey, foot_m, head_m in zip(storeys, levels_m[:-1], levels_m[1:], strict=True):
            part = opening.clipped(-np.inf, np.inf, foot_m + inset_m, head_m - inset_m)
            if part.height_m > 0 and not part.is_too_small:
                storey.append(part)
                parts.append(part)
        change_m2 = sum(part.area_m2 for part in parts) - opening.area_m2
        if not parts:
            notes.append(f"{opening.window_id}: dropped, {_size(opening)} lies on a slab.")
        elif len(parts) > 1:
            notes.append(
                f"{opening.window_id}: split by slabs into {len(parts)} parts "
                f"({change_m2:+.2f} m2)."
            )
        elif change_m2 < -NEGLIGIBLE_M:
            notes.append(
                f"{opening.window_id}: cut at a slab, {_size(opening)} became {_size(parts[0])} "
                f"({change_m2:+.2f} m2)."
            )
    return storeys, notes
