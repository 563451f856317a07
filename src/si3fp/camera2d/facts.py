"""C.1: what the capture check knows of one photo."""

from __future__ import annotations

from dataclasses import dataclass

Settings = tuple[str, float | None, int, int]
"""Camera, focal length in mm, longer and shorter side in pixels."""


@dataclass(frozen=True, slots=True)
class PhotoFacts:
    """What was measured on one photo.

    Attributes
    ----------
    name
        File name.
    sha256
        Of the file: equal ones are the same photo.
    width_px, height_px
        Size as viewers show it.
    camera
        Maker and model by EXIF, or "".
    focal_mm, focal_35mm
        Focal length by EXIF, and the one of a 35 mm camera with the same angle of view; or None.
    has_gps
        Whether EXIF tells the position.
    blur_px
        Blur of the edges (`quality.blur_px`), measured at
        `CaptureConfig.work_side_px` or the photo's own size where that is smaller.
    black, white
        Shares of black and white pixels (`quality.clipped_shares`).
    """

    name: str
    sha256: str
    width_px: int
    height_px: int
    camera: str
    focal_mm: float | None
    focal_35mm: float | None
    has_gps: bool
    blur_px: float
    black: float
    white: float

    @property
    def settings(self) -> Settings:
        """Camera, focal length and size: photos that share them share one set of intrinsics."""
        focal = self.focal_mm or self.focal_35mm
        short, long = sorted((self.width_px, self.height_px))
        return (self.camera, None if focal is None else round(focal, 1), long, short)
