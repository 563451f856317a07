"""The figures that the paper reports (Tables 2, 3 and 5), and how its columns are read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Column:
    """A column of the paper's Table 3 (and two that it lacks).

    ``digits`` and ``percent`` are how it is printed; ``higher`` tells that a larger value is
    better, else the smaller magnitude is.
    """

    name: str
    head: str
    digits: int
    higher: bool = False
    percent: bool = False
    signed: bool = False


COLUMNS = (
    Column("f1", "F1", 2, higher=True),
    Column("f1_plain", "F1, no balconies", 2, higher=True),
    Column("iou", "mean IoU", 2, higher=True),
    Column("area", "area error (%)", 1, percent=True),
    Column("position_m", "position error (m)", 3),
    Column("wwr", "WWR error", 3, signed=True),
    Column("imputed", "WWR error, imputed", 3, signed=True),
    Column("wwr_absolute", "mean abs. WWR error", 3),
    Column("wwr_by_area", "WWR error by area", 3, signed=True),
)

CAMERA, STREET, STREET_TOTAL = "Camera2D", "StreetView", "StreetView (Total)"
TOTAL = "Total"
BUILDINGS = ("b1", "b2", "b3")

_NAMES = tuple(column.name for column in COLUMNS)
_ROWS: dict[tuple[str, str], tuple[float | None, ...]] = {
    ("b1", CAMERA): (0.75, 0.90, 0.80, 0.171, 0.065, -0.080),
    ("b1", STREET): (0.75, 0.97, 0.70, 0.152, 0.189, -0.090),
    ("b1", STREET_TOTAL): (0.71, 0.65, None, None, None, -0.095, -0.070),
    ("b2", CAMERA): (0.83, 0.87, 0.78, 0.219, 0.077, -0.009),
    ("b2", STREET): (0.80, 0.81, 0.73, 0.232, 0.105, -0.052),
    ("b2", STREET_TOTAL): (0.61, 0.63, None, None, None, -0.092, -0.042),
    ("b3", CAMERA): (0.72, 0.84, 0.77, 0.152, 0.129, -0.048),
    ("b3", STREET): (0.28, 0.46, 0.69, 0.223, 0.216, -0.040),
    ("b3", STREET_TOTAL): (0.19, 0.04, None, None, None, -0.099, -0.048),
    (TOTAL, CAMERA): (0.76, 0.86, 0.78, 0.178, 0.095, -0.038),
    (TOTAL, STREET): (0.60, 0.82, 0.71, 0.192, 0.165, -0.058),
    (TOTAL, STREET_TOTAL): (0.47, 0.42, None, None, None, -0.095, -0.050),
}
TABLE_3: dict[tuple[str, str], dict[str, float | None]] = {
    key: dict(zip(_NAMES, (*row, *[None] * len(_NAMES)), strict=False))
    for key, row in _ROWS.items()
}
"""By building and method: values by column; errors of areas as shares."""


@dataclass(frozen=True)
class Survey:
    """A row of Table 2."""

    height_m: float
    longest_side_m: float
    facades: int
    images: int
    image_px: str
    panoramas: int
    panorama_px: str
    missing: int


TABLE_2 = {
    "b1": Survey(23.2, 14.9, 8, 322, "2296 x 1724", 47, "16384 x 8192", 3),
    "b2": Survey(22.7, 35.2, 4, 439, "2250 x 1680", 22, "16384 x 8192", 1),
    "b3": Survey(11.0, 71.6, 6, 274, "2288 x 1708", 58, "16384 x 8192", 2),
}

TABLE_5 = (
    ("S.1", "~ 2 min (network)"),
    ("S.2", "< 1 min"),
    ("S.3", "< 1 min"),
    ("S.4", "< 10 s"),
    ("C.1", "~ 30 min (taking photos)"),
    ("C.2", "~ 2 h"),
    ("C.3", "< 10 min (GPU)"),
    ("M.1", "~ 1 s (GPU)"),
    ("M.2", "~ 1 s"),
)
MACHINE = "AMD Ryzen 7 5800X3D, 64 GB, NVIDIA RTX 3090 (24 GB)"
WHOLE = {"street": "~ 0.1 h", "photos": "~ 2.5 h"}
"""Processing time per building (the paper's comparison with LiDAR)."""
