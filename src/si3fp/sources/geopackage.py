"""GeoPackage layers as GeoJSON-like features; the only module that imports pyogrio."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from si3fp.errors import InputError, MissingDependencyError


def read_layer(path: Path) -> tuple[list[dict[str, Any]], str]:
    """Features and the CRS of the only layer with geometries in a GeoPackage.

    Raises
    ------
    InputError
        If the file is missing or damaged, has no or several such layers, or declares no CRS.
    MissingDependencyError
        If pyogrio is not installed (extra ``geo``).
    """
    try:
        import pyogrio  # noqa: PLC0415 - optional
    except ImportError as error:
        raise MissingDependencyError(
            f"Reading {path} needs pyogrio: pip install 'si3fp[geo]', or save it as GeoJSON."
        ) from error
    if not path.is_file():
        raise InputError(f"There is no file {path}.")
    try:
        layers = [str(name) for name, kind in pyogrio.list_layers(path) if kind is not None]
        if len(layers) != 1:
            raise InputError(
                f"{path} holds {len(layers)} layers with geometries ({', '.join(layers)}); "
                "export the layer of footprints alone."
            )
        meta, _, geometries, columns = pyogrio.raw.read(path, layer=layers[0])
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError) as error:
        raise InputError(f"{path} is not a readable GeoPackage: {error}") from error
    if not meta["crs"]:
        raise InputError(
            f"{path} declares no coordinate system; assign the one of its coordinates, "
            "for example in QGIS, and save it again."
        )
    rows = [
        {str(name): _plain(column[i]) for name, column in zip(meta["fields"], columns, strict=True)}
        for i in range(len(geometries))
    ]
    shapes = shapely.from_wkb(geometries)
    features = [
        {"properties": row, "geometry": shapely.geometry.mapping(shape) if shape else None}
        for row, shape in zip(rows, shapes, strict=True)
    ]
    return features, str(meta["crs"])


def _plain(value: Any) -> Any:
    """A plain Python value; NaN, which stands for NULL in numeric columns, becomes None."""
    plain = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(plain, float) and math.isnan(plain) else plain
