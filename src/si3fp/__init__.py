"""Street panoramas or photos of a building to a thermal 3D model with its real windows."""

__version__ = "0.1.0"
