"""`PlacedReconstruction`: photos and points in metres with z up, and how sure that is (C.2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from si3fp.camera2d.scale import Side
from si3fp.camera2d.undistort import Lens, undistort
from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin
from si3fp.geometry.rigid import Rigid3
from si3fp.geometry.similarity import Similarity3
from si3fp.model import Image, Photo, SparsePoints

ScaledBy = Literal["distances", "GPS", "cameras", "nothing"]
PlacedBy = Literal["GPS", "cameras", "footprints", "nothing"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlacedReconstruction:
    """A reconstruction in the frame ``world``: metres, z up.

    Attributes
    ----------
    photos
        Photos free of distortion, with their poses.
    lenses
        By photo id the camera that took it, distortion included.
    points
        Sparse points.
    m_per_unit, sigma_m_per_unit
        Scale applied to the reconstruction, and its standard deviation (0 where the units are
        arbitrary or known cameras gave them).
    scaled_by
        What the scale rests on. "nothing": the units are arbitrary.
    placed_by
        What place and north rest on. "nothing": x and y run anywhere, from the middle of the
        cameras.
    heading_sigma_deg, position_sigma_m
        Standard deviations of north and of either coordinate of the place; None where unknown.
    origin
        Of the frame; None where place and north are unknown.
    ground_z_m
        World z of the ground around the building.
    sides
        What each measured distance says.
    left_out
        Reason by id of each photo that was not used.
    facts, notes
        How it was done, and what to know or check, in words.
    """

    photos: tuple[Photo, ...]
    lenses: Mapping[str, Lens]
    points: SparsePoints
    m_per_unit: float
    sigma_m_per_unit: float
    scaled_by: ScaledBy
    placed_by: PlacedBy = "nothing"
    heading_sigma_deg: float | None = None
    position_sigma_m: float | None = None
    origin: GeoOrigin | None = None
    ground_z_m: float = 0.0
    sides: tuple[Side, ...] = ()
    left_out: Mapping[str, str]
    facts: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def metric(self) -> bool:
        """Whether the units are metres."""
        return self.scaled_by != "nothing"

    @property
    def north_known(self) -> bool:
        """Whether y points north and the origin lies on the map."""
        return self.placed_by != "nothing"

    def undistort(self, photo_id: str, image: Image) -> Image:
        """The pixels of a photo as its camera in `photos` would have taken them.

        Raises
        ------
        InputError
            If the photo is unknown or not of its lens's size.
        """
        for photo in self.photos:
            if photo.id == photo_id:
                try:
                    return undistort(image, self.lenses[photo_id], photo.camera)
                except InputError as error:
                    raise InputError(f"{photo_id}: {error}") from error
        raise InputError(f"{photo_id} is not among the {len(self.photos)} photos reconstructed.")

    def moved(self, world_from_here: Rigid3, **changes: Any) -> PlacedReconstruction:
        """The same in another frame; ``changes`` replace further fields."""
        similarity = Similarity3(1.0, world_from_here.rotation, world_from_here.translation)
        return replace(
            self,
            photos=tuple(transformed_photo(photo, similarity) for photo in self.photos),
            points=transformed_points(self.points, similarity),
            ground_z_m=self.ground_z_m + float(world_from_here.translation[2]),
            **changes,
        )

    @property
    def record(self) -> dict[str, Any]:
        """What run.json tells of it: plain values."""
        origin = self.origin
        return {
            "facts": list(self.facts),
            "notes": list(self.notes),
            "metric": self.metric,
            "scaled_by": self.scaled_by,
            "m_per_unit": self.m_per_unit,
            "sigma_m_per_unit": self.sigma_m_per_unit,
            "sides": [
                {
                    "start": side.distance.start,
                    "end": side.distance.end,
                    "distance_m": side.distance.distance_m,
                    "residual_m": side.residual_m,
                }
                for side in self.sides
            ],
            "north_known": self.north_known,
            "placed_by": self.placed_by,
            "heading_sigma_deg": self.heading_sigma_deg,
            "position_sigma_m": self.position_sigma_m,
            "origin": None
            if origin is None
            else {
                "lat_deg": origin.lat_deg,
                "lon_deg": origin.lon_deg,
                "height_m": origin.height_m,
            },
            "ground_z_m": self.ground_z_m,
            "left_out": dict(self.left_out),
        }


def transformed_photo(photo: Photo, b_from_a: Similarity3) -> Photo:
    """The photo with its pose in frame b."""
    return replace(photo, cam_from_world=b_from_a.cam_from_b(photo.cam_from_world))


def transformed_points(points: SparsePoints, b_from_a: Similarity3) -> SparsePoints:
    """The points in frame b."""
    return replace(points, points_in_world=b_from_a.apply(points.points_in_world))
