"""What of a reconstruction can be used: photos whose lens has an inverse, finite points (C.2)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from si3fp.camera2d.undistort import Lens, undistorted_camera
from si3fp.errors import InputError, ReconstructionError
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Photo, SparsePoints

_MIN_PHOTOS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Usable:
    """Photos free of distortion and their points, in the frame of the reconstruction.

    Attributes
    ----------
    photos
        With the cameras of their undistorted pixels.
    lenses
        By photo id the camera that took it.
    points
        All points.
    left_out
        Reason by id of each photo that cannot be used.
    """

    photos: tuple[Photo, ...]
    lenses: dict[str, Lens]
    points: SparsePoints
    left_out: dict[str, str]

    @property
    def centres(self) -> dict[str, FloatArray]:
        """Optical centre (3,) by photo id."""
        return {photo.id: photo.centre_in_world for photo in self.photos}

    def typical_distance(self) -> float:
        """Median depth of the points in the photos that saw them, in units of the poses.

        Raises
        ------
        ReconstructionError
            If no point lies in front of a photo that saw it.
        """
        points, photos = _sightings(self.points, {p.id: i for i, p in enumerate(self.photos)})
        forward = np.stack([photo.cam_from_world.rotation[2] for photo in self.photos])
        offset = np.array([photo.cam_from_world.translation[2] for photo in self.photos])
        seen = self.points.points_in_world[points]
        depth = np.einsum("ni,ni->n", forward[photos], seen) + offset[photos]
        if not (depth > 0).any():
            raise ReconstructionError(
                "The reconstruction has no point that lies before the photos that saw it; "
                "reconstruct again."
            )
        return float(np.median(depth[depth > 0]))


def usable(
    photos: Sequence[Photo], distortion: Mapping[str, ArrayLike], points: SparsePoints
) -> Usable:
    """The photos whose distortion can be taken out, 3 or more, and the points.

    Parameters
    ----------
    photos
        As reconstructed; a photo's camera holds once the distortion is taken out.
    distortion
        Coefficients (4,) k1, k2, p1, p2 by photo id.
    points
        Sparse points in the frame of the poses.

    Raises
    ------
    InputError
        If ids repeat, a photo has no coefficients or a point is not finite.
    ReconstructionError
        If fewer than three photos can be used.
    """
    repeated = [name for name, count in Counter(photo.id for photo in photos).items() if count > 1]
    if repeated:
        raise InputError(f"Photos occur twice in the reconstruction: {', '.join(repeated)}.")
    unknown = [photo.id for photo in photos if photo.id not in distortion]
    if unknown:
        raise InputError(f"No lens distortion is given for {', '.join(unknown)}.")
    if not np.isfinite(points.points_in_world).all():
        bad = int((~np.isfinite(points.points_in_world).all(axis=1)).sum())
        raise InputError(f"{bad} sparse points contain NaN or infinity; reconstruct again.")
    lenses: dict[str, Lens] = {}
    good: list[Photo] = []
    left_out: dict[str, str] = {}
    found: dict[tuple[Pinhole, bytes], Pinhole | str] = {}
    for photo in photos:
        lens = Lens(photo.camera, np.asarray(distortion[photo.id], dtype=np.float64))
        key = (lens.camera, lens.distortion.tobytes())
        if key not in found:
            try:
                found[key] = undistorted_camera(lens)
            except InputError as error:
                found[key] = str(error)
        match found[key]:
            case Pinhole() as camera:
                lenses[photo.id] = lens
                good.append(replace(photo, camera=camera))
            case str(reason):
                left_out[photo.id] = reason
    if len(good) < _MIN_PHOTOS:
        reasons = "".join(f" {name}: {reason}" for name, reason in left_out.items())
        raise ReconstructionError(
            f"{len(good)} of the reconstructed photos can be used, {_MIN_PHOTOS} are needed. "
            f"Check the photos with `si3fp photos --check`.{reasons}"
        )
    return Usable(tuple(good), lenses, points, left_out)


def _sightings(
    points: SparsePoints, index: Mapping[str, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Point and photo index of every point in every photo that saw it and is used."""
    pairs = [
        (n, index[photo_id])
        for n, ids in enumerate(points.photo_ids)
        for photo_id in ids
        if photo_id in index
    ]
    table = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return table[:, 0], table[:, 1]
