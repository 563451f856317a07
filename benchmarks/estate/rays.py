"""What a camera is for the renderer: a size, and rays through places of its picture."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class Camera(Protocol):
    """A camera of any projection.

    ``seen`` (H, W) is where it is worth rendering; elsewhere the picture stays black.
    """

    @property
    def width_px(self) -> int: ...
    @property
    def height_px(self) -> int: ...
    @property
    def seen(self) -> NDArray[np.bool_] | None: ...
    def rays(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Origins and unit directions (N, 3) in the world through pixels (N, 2) x, y."""
        ...
