"""The report of a run: complete, self-contained, well-formed, and drawn where it should be."""

import json
import re
from dataclasses import asdict
from html.parser import HTMLParser

import numpy as np
import pytest

from si3fp.config import StreetConfig
from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin, geodetic_from_world
from si3fp.model import Window
from si3fp.report.drawings import CameraPoint, WallLine, month_bars, nice_below, plan
from si3fp.report.figures import (
    NOT_SEEN,
    SEEN_ONCE,
    box_colour,
    coverage_palette,
    coverage_picture,
    opaque,
    overlay,
)
from si3fp.report.markup import VOID, Markup, number, percent_interval, tag
from si3fp.report.records import read_run
from si3fp.report.run_report import run_report, write_report
from si3fp.report.totals import wwr_of_building
from si3fp.workspace import Workspace, read_png, write_bytes, write_png

ORIGIN = {"lat_deg": 59.349, "lon_deg": 18.072, "height_m": 12.0}
OUTLINE = [[0.0, 0.0], [24.0, 0.0], [24.0, 11.0], [0.0, 11.0]]


def windows_of(width_m, height_m):
    """A regular grid of windows with a balcony door and an inferred one."""
    columns, rows = max(1, int(width_m // 2.6)), max(1, int(height_m // 3.1))
    return [
        Window(
            x_m=0.8 + 2.6 * column,
            y_m=0.9 + 3.0 * row,
            width_m=1.25,
            height_m=1.45,
            label="balcony_door" if column == 1 and row == 1 else "window",
            score=0.97 - 0.05 * ((column * 3 + row * 5) % 9),
            views=("p01", "p02", "p03")[: 1 + (column + row) % 3],
            origin="inferred" if column == 3 and row == 0 else "detected",
            edge_sigma_m=(0.02, 0.02, 0.03, 0.04),
            recess_m=0.12,
            correction_m=(0.0, 0.0, 0.0, 0.031),
            evidence="fused image, edges from gradients",
        )
        for row in range(rows)
        for column in range(columns)
    ]


def wall_picture(width_m, height_m, windows, m_per_px, seed):
    """RGBA: plaster with dark glass, and a corner that no camera saw."""
    rng = np.random.default_rng(seed)
    shape = (round(height_m / m_per_px), round(width_m / m_per_px))
    grain = rng.normal(0, 5, shape)[..., None]
    shade = np.linspace(12, -12, shape[1])[None, :, None]
    rgb = np.clip(np.array([206, 188, 160]) + grain + shade, 0, 255).astype(np.uint8)
    for window in windows:
        rows = slice(
            round((height_m - window.y_m - window.height_m) / m_per_px),
            round((height_m - window.y_m) / m_per_px),
        )
        columns = slice(
            round(window.x_m / m_per_px), round((window.x_m + window.width_m) / m_per_px)
        )
        rgb[rows, columns] = (238, 236, 230)
        frame = max(1, round(0.07 / m_per_px))
        rgb[
            rows.start + frame : rows.stop - frame, columns.start + frame : columns.stop - frame
        ] = (62, 78, 96)
    alpha = np.full(shape, 255, np.uint8)
    alpha[: shape[0] // 7, : shape[1] // 9] = 0
    return np.dstack([rgb, alpha])


def write_facade(workspace, name, building, start, bearing_deg, size_m, m_per_px):
    """One finished facade whose foot starts at ``start``, looking along the bearing."""
    width_m, height_m = size_m
    windows = windows_of(width_m, height_m)
    normal = np.array([np.sin(np.deg2rad(bearing_deg)), np.cos(np.deg2rad(bearing_deg)), 0.0])
    right = np.cross([0.0, 0.0, 1.0], normal)
    rotation = np.column_stack([right, [0.0, 0.0, 1.0], normal])
    picture = wall_picture(width_m, height_m, windows, m_per_px, seed=len(name))
    height_px, width_px = picture.shape[:2]
    middle = np.array([*start, 0.0]) + right * width_m / 2 + [0.0, 0.0, height_m / 2]
    lat, lon, height = geodetic_from_world(middle, GeoOrigin(**ORIGIN)).tolist()
    views = [
        {
            "source": f"p{index:02d}",
            "used": index < 9,
            "reason": "" if index < 9 else "too oblique" if index < 13 else "too few matches",
            "model": "similarity" if index < 9 else "none",
            "inliers": 400 - 23 * index if index < 9 else 0,
            "residual_before_px": 6.2 + 0.3 * index if index < 13 else None,
            "residual_after_px": 0.7 if index < 9 else None,
            "shift_m": 0.11 + 0.01 * index,
            "distance_m": 12.5 + index,
            "obliqueness_deg": 8.0 + 4 * index,
        }
        for index in range(15)
    ]
    gross = width_m * height_m
    wwr = sum(window.area_m2 for window in windows) / gross
    facade = {
        "id": name,
        "building_id": building,
        "edge": 0,
        "origin": ORIGIN,
        "world_from_facade": {"rotation": rotation, "translation": [*start, 0.0]},
        "width_m": width_m,
        "height_m": height_m,
        "wwr": wwr,
        "wwr_interval": [wwr - 0.021, wwr + 0.018],
        "centre": {"lat_deg": lat, "lon_deg": lon, "height_m": height},
        "m_per_px": m_per_px,
        "grid_px": [width_px, height_px],
        "views": views,
        "coverage": {"seen": 0.984, "seen_by_two": 0.93},
        "box": {
            "left_m": 0.12,
            "right_m": width_m + 0.12,
            "bottom_m": 0.0,
            "top_m": height_m,
            "evidence": {
                "left": "footprint corner and 4 lines",
                "right": "footprint corner",
                "bottom": "ground of the footprint",
                "top": "eaves line in 6 views",
            },
        },
        "plane": {"members": 14, "rms_m": 0.053, "angle_deg": 0.8},
        "notes": ["Recess of 0.12 m assumed: no depth was available."],
        "config": StreetConfig().as_dict(),
    }
    workspace.write_json(workspace.facade(name, "facade.json"), "facade", facade)
    workspace.write_json(
        workspace.facade(name, "windows.json"), "windows", {"windows": [asdict(w) for w in windows]}
    )
    write_png(workspace.facade(name, "ortho.png"), picture)
    rows, columns = np.indices((height_px, width_px))
    seen_by = 1 + 8 * np.sin(np.pi * columns / width_px) * (0.5 + 0.5 * rows / height_px)
    seen_by = np.where(picture[..., 3] > 0, seen_by, 0).astype(np.uint8)
    write_png(workspace.facade(name, "coverage.png"), seen_by)
    for index in range(4):
        write_png(
            workspace.facade(name, f"views/p{index:02d}.png"),
            np.roll(picture, 40 * index, axis=1)[::2, ::2],
        )


def write_run(root, m_per_px=0.1, building="west <wing> & co"):
    """A run with one building of four facades, two of them found, one wall without a building."""
    workspace = Workspace(root)
    write_facade(workspace, f"{building}-0", building, (0.0, 0.0), 180.0, (24.0, 9.6), m_per_px)
    write_facade(workspace, f"{building}-1", building, (24.0, 0.0), 90.0, (11.0, 9.4), m_per_px)
    write_facade(workspace, "wall-1", None, (-14.0, -22.0), 0.0, (9.0, 6.0), m_per_px)
    archetype = {
        "country": "SE",
        "period": [1961, 1975],
        "u_wall_w_m2k": 0.41,
        "u_roof_w_m2k": 0.22,
        "u_floor_w_m2k": 0.36,
        "u_window_w_m2k": 2.3,
        "g_window": 0.76,
        "notes": ["The footprint has no year: 1970 is assumed."],
    }
    cameras = [
        {
            "id": f"p{index:02d}",
            "captured": "2021-06" if index % 3 else "2022-09",
            "position_in_world": [-8.0 + 2.9 * index, -11.0 - (index % 3), 2.4],
            "used": index != 7,
        }
        for index in range(15)
    ]
    cameras.append(
        {"id": "far", "captured": "", "position_in_world": [900.0, 0.0, 2.4], "used": False}
    )
    head = {
        "started": "2024-03-05T09:14:00+00:00",
        "finished": "2024-03-05T09:15:12+00:00",
        "command": "si3fp street panoramas.geojson --footprints footprints.geojson -o run",
        "seconds": {"read": 3.1, "planes": 1.4, "views": 21.9, "align": 14.2, "detect": 18.8},
        "inputs": {"panoramas.geojson": "ab" * 32, "footprints.geojson": "cd" * 32},
        "origin": ORIGIN,
        "panoramas": cameras,
        "footprints": [
            {"id": building, "outline_in_world": OUTLINE, "ground_m": 0.0, "height_m": 9.6,
             "storeys": 3, "year": None},
        ],
        "buildings": [
            {"id": building, "storeys": 3, "height_m": 9.6, "wwr": 0.1934,
             "wwr_interval": [0.172, 0.211], "facades": [f"{building}-0", f"{building}-1"],
             "year": None, "archetype": archetype, "notes": ["Storeys come from the footprint."]},
        ],
        "missing": [
            {"facade_id": f"{building}-2", "step": "coverage", "reason": "No camera faces it."},
            {"facade_id": f"{building}-3", "step": "align", "reason": "2 views share 5 matches."},
        ],
        "unassigned": [
            {"panorama": "p03", "plane": 4, "reason": "6.1 m from the nearest footprint edge"},
        ],
        "notes": ["All capture dates were used: the latest alone gives 5 panoramas of 15."],
    }  # fmt: skip
    workspace.write_json(workspace.run_json, "run", head)
    months = [9100, 7800, 6900, 4100, 1800, 300, 60, 120, 900, 3600, 6300, 8600]
    floor_area_m2 = 792.0
    simulation = {
        "epw": "/somewhere/stockholm.epw",
        "buildings": [
            {"id": building, "floor_area_m2": floor_area_m2, "heating_kwh": sum(months),
             "heating_kwh_m2": sum(months) / floor_area_m2, "monthly_kwh": months},
        ],
    }  # fmt: skip
    workspace.write_json(workspace.simulation / "result.json", "simulation", simulation)
    return workspace
