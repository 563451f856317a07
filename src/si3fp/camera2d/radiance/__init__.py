"""C.3: the radiance field of one wall, fitted on a CPU."""

from si3fp.camera2d.radiance.field import OrthoRendering, RadianceField
from si3fp.camera2d.radiance.stopping import FitReport

__all__ = ["FitReport", "OrthoRendering", "RadianceField"]
