"""Buildings, their facades and windows, and boxes found on pictures of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from si3fp.geometry.enu import GeoOrigin
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model.images import require

WindowLabel = Literal["window", "balcony_door"]
WindowOrigin = Literal["detected", "inferred", "reviewed"]


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """Boxes on an orthographic image.

    Attributes
    ----------
    boxes_px
        (N, 4) x0 y0 x1 y1, half-open, sub-pixel.
    scores
        (N,) in [0, 1].
    labels
        (N,) strings.
    edge_sigma_px
        (N, 4) standard deviation of x0, y0, x1 and y1; 0 where unknown, and for all if left out.
    """

    boxes_px: FloatArray
    scores: FloatArray
    labels: NDArray[np.str_]
    edge_sigma_px: FloatArray = field(default_factory=lambda: np.zeros((0, 4)))

    def __post_init__(self) -> None:
        boxes = np.asarray(self.boxes_px, np.float64).reshape(-1, 4)
        sigma = np.asarray(self.edge_sigma_px, np.float64).reshape(-1, 4)
        object.__setattr__(self, "boxes_px", boxes)
        object.__setattr__(self, "scores", np.asarray(self.scores, np.float64).reshape(-1))
        object.__setattr__(self, "labels", np.asarray(self.labels, np.str_).reshape(-1))
        object.__setattr__(self, "edge_sigma_px", sigma if len(sigma) else np.zeros_like(boxes))
        require(
            len(self.boxes_px) == len(self.scores) == len(self.labels),
            f"Detections differ in length: {len(self.boxes_px)} boxes, {len(self.scores)} scores, "
            f"{len(self.labels)} labels.",
        )
        require(
            self.edge_sigma_px.shape == self.boxes_px.shape,
            f"Detections differ in length: {len(self.boxes_px)} boxes, {len(self.edge_sigma_px)} "
            "standard deviations.",
        )

    def __len__(self) -> int:
        return len(self.scores)

    def select(self, index: NDArray[np.bool_] | NDArray[np.int_]) -> Detections:
        """The detections at a boolean mask or integer index, in its order."""
        return Detections(
            self.boxes_px[index], self.scores[index], self.labels[index], self.edge_sigma_px[index]
        )


@dataclass(frozen=True, slots=True)
class Window:
    """A glazed unit with its frame, on its facade.

    Attributes
    ----------
    x_m, y_m
        Lower left corner from the facade's lower left corner.
    width_m, height_m
        Size.
    label
        ``window`` or ``balcony_door``.
    score
        Confidence in [0, 1].
    views
        Ids of the source images that saw it.
    origin
        ``detected``, ``inferred`` or ``reviewed``.
    edge_sigma_m
        Standard deviation of the left, right, bottom and top edge.
    recess_m
        Depth of the glass behind the wall plane, or None where unknown.
    correction_m
        What was added to the left, right, bottom and top edge coordinate for the recess.
    evidence
        One line in words on how the box came about.
    """

    x_m: float
    y_m: float
    width_m: float
    height_m: float
    label: WindowLabel = "window"
    score: float = 1.0
    views: tuple[str, ...] = ()
    origin: WindowOrigin = "detected"
    edge_sigma_m: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    recess_m: float | None = None
    correction_m: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    evidence: str = ""

    def __post_init__(self) -> None:
        require(
            bool(np.isfinite([self.x_m, self.y_m]).all())
            and self.width_m > 0
            and self.height_m > 0,
            f"A window needs a finite position and a positive size, got {self}.",
        )

    @property
    def area_m2(self) -> float:
        """Area of the opening."""
        return self.width_m * self.height_m


@dataclass(frozen=True, slots=True, eq=False)
class Facade:
    """A rectangular facade between ground and eaves with its windows.

    Attributes
    ----------
    id
        As in `FacadeViews`.
    world_from_facade
        Pose of the lower left corner seen from outside.
    width_m, height_m
        Size.
    windows
        Windows and balcony doors.
    wwr_interval
        90 % interval of the window-to-wall ratio, or None.
    """

    id: str
    world_from_facade: Rigid3
    width_m: float
    height_m: float
    windows: tuple[Window, ...] = ()
    wwr_interval: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        require(
            self.width_m > 0 and self.height_m > 0,
            f"Facade {self.id} has no area: {self.width_m} x {self.height_m} m.",
        )

    @property
    def wwr(self) -> float:
        """Area of windows and balcony doors over the gross facade area (windows included)."""
        return sum(window.area_m2 for window in self.windows) / (self.width_m * self.height_m)

    @property
    def centre_in_world(self) -> FloatArray:
        """Centre of the facade (3,) in metres."""
        return self.world_from_facade.apply([self.width_m / 2, self.height_m / 2, 0.0])


@dataclass(frozen=True, slots=True)
class Missing:
    """A facade that failed or that no camera saw: a result, not a crash.

    Attributes
    ----------
    facade_id
        The facade.
    step
        Where it ended: ``coverage``, ``align``, ``facade_box``, ``windows``.
    reason
        In words.
    """

    facade_id: str
    step: str
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class Footprint:
    """The outline of a building as a map gives it.

    Attributes
    ----------
    id
        Identifier.
    outline_in_world
        (V, 2) counter-clockwise corners, not closed, metres; edge i runs from corner i to i + 1
        and has its outside on the right.
    ground_m, height_m
        Height of the ground in world z and of the eaves above it; None where unknown.
    storeys, year, use
        Attributes; None where unknown.
    """

    id: str
    outline_in_world: FloatArray
    ground_m: float | None = None
    height_m: float | None = None
    storeys: int | None = None
    year: int | None = None
    use: str | None = None

    def __post_init__(self) -> None:
        outline = np.asarray(self.outline_in_world, dtype=np.float64)
        require(
            outline.ndim == 2 and outline.shape[1] == 2 and len(outline) >= 3,
            f"Footprint {self.id}: an outline needs at least 3 corners, got {outline.shape}.",
        )
        require(bool(np.isfinite(outline).all()), f"Footprint {self.id} contains NaN.")
        x, y = outline[:, 0], outline[:, 1]
        area = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
        require(area > 0, f"Footprint {self.id}: corners must run counter-clockwise, area {area}.")
        object.__setattr__(self, "outline_in_world", outline)

    def edges(self) -> list[tuple[FloatArray, FloatArray]]:
        """Start and end corner (2,) of every edge."""
        return [
            (self.outline_in_world[i], self.outline_in_world[(i + 1) % len(self.outline_in_world)])
            for i in range(len(self.outline_in_world))
        ]


@dataclass(frozen=True, slots=True, eq=False)
class Building:
    """A building with the facades that were found.

    Attributes
    ----------
    id
        Identifier.
    origin
        Origin of the world frame.
    footprint_in_world
        (V, 2) counter-clockwise outline in metres.
    base_z_m
        World z of the ground.
    height_m
        Ground to eaves.
    storeys
        Number of storeys above the ground.
    facades
        Facades found; `facade_id` ends in the index of their footprint edge.
    missing
        Facades that failed or were not seen.
    year, use
        Attributes; None where unknown.
    """

    id: str
    origin: GeoOrigin
    footprint_in_world: FloatArray
    base_z_m: float
    height_m: float
    storeys: int
    facades: tuple[Facade, ...] = ()
    missing: tuple[Missing, ...] = ()
    year: int | None = None
    use: str | None = None

    def __post_init__(self) -> None:
        require(self.height_m > 0, f"Building {self.id}: height must be positive.")
        require(self.storeys >= 1, f"Building {self.id}: needs at least one storey.")
