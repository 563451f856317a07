"""What the synthetic facades are built of, in frame facade: metres, the wall at z = 0."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.accuracy.radiance.textures import Rgb

GLASS_SETBACK_M = 0.03


@dataclass(frozen=True)
class Opening:
    """A recess in the wall, closed by a frame whose panes lie GLASS_SETBACK_M deeper; metres."""

    left: float
    right: float
    bottom: float
    top: float
    recess: float
    frame: float
    columns: int
    rows: int
    frame_rgb: Rgb
    interior: float
    curtain: float
    tilt: tuple[float, float]

    @property
    def glass_depth_m(self) -> float:
        """Distance of the glass behind the wall."""
        return self.recess + GLASS_SETBACK_M


@dataclass(frozen=True)
class Box:
    """An axis-aligned block; ``of_facade`` says that the true orthophoto shows it."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    rgb: Rgb
    of_facade: bool = False


@dataclass(frozen=True)
class Ball:
    """A clump of leaves."""

    centre: tuple[float, float, float]
    radius: float
    rgb: Rgb
