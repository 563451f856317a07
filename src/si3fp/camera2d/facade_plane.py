"""`FacadePlane`: a rectangle on a wall that is rendered and parsed on its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from si3fp.errors import InputError
from si3fp.geometry.rigid import FloatArray, Rigid3


@dataclass(frozen=True, slots=True, eq=False)
class FacadePlane:
    """A vertical rectangle between ground and eaves.

    Attributes
    ----------
    facade_id
        ``<building id>-<footprint edge index>``, without footprint ``wall-<n>``.
    building_id, edge_index
        Footprint and edge, or None.
    world_from_facade
        Pose: origin at the lower left corner seen from outside, x right, y up, z outward.
    width_m, height_m
        Size.
    photo_ids
        Photos that look at it.
    notes
        What each side rests on.
    """

    facade_id: str
    building_id: str | None
    edge_index: int | None
    world_from_facade: Rigid3
    width_m: float
    height_m: float
    photo_ids: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not (self.width_m > 0 and self.height_m > 0 and np.isfinite(self.width_m)):
            raise InputError(
                f"Wall {self.facade_id} has no area: {self.width_m} x {self.height_m} m."
            )

    @property
    def corners_in_world(self) -> FloatArray:
        """The paper's v0, v1 and v2 (3, 3): lower left, lower right, upper left."""
        return self.world_from_facade.apply(
            [[0.0, 0.0, 0.0], [self.width_m, 0.0, 0.0], [0.0, self.height_m, 0.0]]
        )
