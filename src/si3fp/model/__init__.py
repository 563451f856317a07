"""The domain types: what the steps hand to one another. Frozen; shapes checked on creation."""

from si3fp.geometry.enu import GeoOrigin
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.planes import Planes
from si3fp.geometry.rigid import Rigid3
from si3fp.model.buildings import (
    Building,
    Detections,
    Facade,
    Footprint,
    Missing,
    Window,
    WindowLabel,
    WindowOrigin,
)
from si3fp.model.images import (
    FacadeViews,
    Image,
    KnownDistance,
    LoadImage,
    OrthoImage,
    Panorama,
    Photo,
    SparsePoints,
)

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
    "SparsePoints",
    "Window",
    "WindowLabel",
    "WindowOrigin",
]
