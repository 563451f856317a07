"""The domain types: what the steps hand to one another. Frozen; shapes checked on creation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.planes import Planes
from si3fp.geometry.rigid import FloatArray, Rigid3

__all__ = [
    "Building",
    "Detections",
    "Facade",
    "FacadeGrid",
    "FacadeViews",
    "Footprint",
    "GeoOrigin",
    "Image",
    "KnownDistance",
    "LoadImage",
    "Missing",
    "OrthoImage",
    "Panorama",
    "Photo",
    "Pinhole",
    "Planes",
    "Rigid3",
    "Window",
]

Image = NDArray[np.uint8]
LoadImage = Callable[[str], Image]
"""Reads the RGB image (H, W, 3) of a source id; source pixels are never stored in the types."""

WindowLabel = Literal["window", "balcony_door"]
WindowOrigin = Literal["detected", "inferred", "reviewed"]


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise InputError(message)


@dataclass(frozen=True, slots=True, eq=False)
class Panorama:
    """An equirectangular image with its pose and, where known, the planes that it sees.

    Attributes
    ----------
    id
        Identifier of the image.
    captured
        Capture date, ``YYYY-MM`` or ISO; empty where unknown.
    pano_from_world
        Pose; frame ``pano`` is x right, y down, z forward.
    planes_in_pano
        Planes, normals pointing from the camera into the wall; None without a plane map.
    plane_index
        (h, w) int32 index into the planes in image order, -1 = none; None without a plane map.
    links
        Ids of neighbouring panoramas.
    """

    id: str
    captured: str
    pano_from_world: Rigid3
    planes_in_pano: Planes | None = None
    plane_index: NDArray[np.int32] | None = None
    links: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        _require(bool(self.id), "A panorama needs an id.")
        _require(
            (self.planes_in_pano is None) == (self.plane_index is None),
            f"Panorama {self.id}: planes and plane index come together or not at all.",
        )
        if self.plane_index is not None and self.planes_in_pano is not None:
            _require(self.plane_index.ndim == 2, f"Panorama {self.id}: the plane index is 2-D.")
            top = int(self.plane_index.max(initial=-1))
            _require(
                top < len(self.planes_in_pano),
                f"Panorama {self.id}: plane index {top} but {len(self.planes_in_pano)} planes.",
            )

    @property
    def centre_in_world(self) -> FloatArray:
        """Optical centre (3,) in metres."""
        return self.pano_from_world.inverse().translation


@dataclass(frozen=True, slots=True, eq=False)
class Photo:
    """A photo with its pose.

    Attributes
    ----------
    id
        Name of the image.
    camera
        Its camera; the pixels of the photo are free of lens distortion.
    cam_from_world
        Pose; frame ``cam`` is x right, y down, z forward. Before the scale is known the world is
        the frame of the reconstruction, in its units.
    """

    id: str
    camera: Pinhole
    cam_from_world: Rigid3

    def __post_init__(self) -> None:
        _require(bool(self.id), "A photo needs an id.")

    @property
    def centre_in_world(self) -> FloatArray:
        """Optical centre (3,)."""
        return self.cam_from_world.inverse().translation


@dataclass(frozen=True, slots=True)
class KnownDistance:
    """A distance measured on site between two points, which gives a reconstruction its scale.

    Attributes
    ----------
    start, end
        Names of the points: ids of the photos taken from there, or of marked points.
    distance_m
        Length measured.
    """

    start: str
    end: str
    distance_m: float

    def __post_init__(self) -> None:
        _require(
            bool(self.start) and bool(self.end) and self.start != self.end,
            f"A known distance runs between two different points, got {self.start!r} and "
            f"{self.end!r}.",
        )
        _require(
            bool(np.isfinite(self.distance_m)) and self.distance_m > 0,
            f"The distance from {self.start} to {self.end} is {self.distance_m} m; "
            "give the length measured, a positive number of metres.",
        )

    def __str__(self) -> str:
        return f"{self.start} - {self.end} ({self.distance_m:g} m)"


@dataclass(frozen=True, slots=True, eq=False)
class OrthoImage:
    """One source image on a facade grid.

    Attributes
    ----------
    source
        Id of the source image; ``fused`` for a blend.
    rgb
        (H, W, 3) uint8.
    valid
        (H, W) bool, False where the source did not see.
    depth_m
        (H, W) metres in front of the facade plane, towards the viewer, or None.
    seen_by
        (H, W) uint8 number of source images, or None.
    """

    source: str
    rgb: Image
    valid: NDArray[np.bool_]
    depth_m: NDArray[np.float32] | None = None
    seen_by: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        _require(
            self.rgb.ndim == 3 and self.rgb.shape[2] == 3 and self.rgb.dtype == np.uint8,
            f"Orthographic image {self.source}: rgb must be (H, W, 3) uint8, got {self.rgb.shape}.",
        )
        for name in ("valid", "depth_m", "seen_by"):
            layer = getattr(self, name)
            _require(
                layer is None or layer.shape == self.rgb.shape[:2],
                f"Orthographic image {self.source}: {name} and rgb differ in size.",
            )


@dataclass(frozen=True, slots=True, eq=False)
class FacadeViews:
    """What both paths hand to the merged steps: one facade, one grid, 1 or N views on it.

    Attributes
    ----------
    facade_id
        ``<building id>-<footprint edge index>``, without footprint ``wall-<n>``.
    grid
        The common grid.
    views
        Orthographic images of the grid's size.
    """

    facade_id: str
    grid: FacadeGrid
    views: tuple[OrthoImage, ...]

    def __post_init__(self) -> None:
        size = (self.grid.height_px, self.grid.width_px)
        for view in self.views:
            _require(
                view.valid.shape == size,
                f"Facade {self.facade_id}: view {view.source} is {view.valid.shape}, "
                f"the grid {size}.",
            )


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
        _require(
            len(self.boxes_px) == len(self.scores) == len(self.labels),
            f"Detections differ in length: {len(self.boxes_px)} boxes, {len(self.scores)} scores, "
            f"{len(self.labels)} labels.",
        )
        _require(
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
        _require(
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
        _require(
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
        _require(
            outline.ndim == 2 and outline.shape[1] == 2 and len(outline) >= 3,
            f"Footprint {self.id}: an outline needs at least 3 corners, got {outline.shape}.",
        )
        _require(bool(np.isfinite(outline).all()), f"Footprint {self.id} contains NaN.")
        x, y = outline[:, 0], outline[:, 1]
        area = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
        _require(area > 0, f"Footprint {self.id}: corners must run counter-clockwise, area {area}.")
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
        _require(self.height_m > 0, f"Building {self.id}: height must be positive.")
        _require(self.storeys >= 1, f"Building {self.id}: needs at least one storey.")
