"""The sides of a house as bays: one room, stairwell or balcony wide, the same on every storey."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.estate.drawing import millimetres
from benchmarks.estate.plans.fenestration import Use

Point = tuple[float, float]


@dataclass(frozen=True)
class Levels:
    """Heights of one house: floor of the ground storey, storeys, top of its walls, metres."""

    ground_m: float
    storey_m: float
    storeys: int
    height_m: float

    def floor_m(self, storey: float) -> float:
        """Floor of a storey (0 = ground storey; halves are landings) above the ground."""
        return millimetres(self.ground_m + storey * self.storey_m)

    @property
    def plinth_m(self) -> float:
        """Top of the plinth."""
        return millimetres(max(0.25, self.ground_m - 0.05))

    @property
    def attic_m(self) -> float:
        """Height of the wall above the ceiling of the top storey."""
        return millimetres(self.height_m - self.floor_m(self.storeys))


@dataclass(frozen=True)
class Bay:
    """One room's width of a wall; ``mirrored`` in the second flat of a landing."""

    use: Use
    mirrored: bool = False


@dataclass(frozen=True)
class Side:
    """One side of a house: from ``start`` to ``end``, divided evenly into bays."""

    start: Point
    end: Point
    bays: tuple[Bay, ...]
    gable: bool = False


def bays_of(*units: str) -> tuple[Bay, ...]:
    """Bays from letters; every unit is one landing with two flats, the second half mirrored.

    b bed, k kitchen, l living, t bath, B balcony, S stair, s door of a store, - nothing.

    >>> [bay.use for bay in bays_of("bSb")]
    ['bed', 'stair', 'bed']
    """
    uses: dict[str, Use] = {
        "b": "bed",
        "k": "kitchen",
        "l": "living",
        "t": "bath",
        "B": "balcony",
        "S": "stair",
        "s": "store",
        "-": "blank",
    }
    return tuple(
        Bay(uses[letter], 2 * index >= len(unit))
        for unit in units
        for index, letter in enumerate(unit)
    )
