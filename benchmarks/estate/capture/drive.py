"""Where a mapping vehicle takes panoramas, and which part of each is worth rendering."""

from __future__ import annotations

import numpy as np
import shapely
from benchmarks.estate.capture.cameras import Equirect, Pose
from benchmarks.estate.capture.truth import facade_id
from benchmarks.estate.drawing import millimetres, rng_of
from benchmarks.estate.plan import Estate
from benchmarks.estate.rays import distances_to_line
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from shapely import LineString, Polygon

FloatArray = NDArray[np.float64]

CAMERA_HEIGHT_M = 2.5
LEAST_SPACING_M = 6.0
REACH_M = 45.0  # a facade farther away is not worth a panorama
INCIDENCE_DEG = 65.0  # nor one seen at a steeper angle than this
RENDERED_REACH_M = 60.0
MARGIN_DEG = 3.0  # around the buildings
GROUND_M = 4.0  # in front of them
AZIMUTHS = 7200


def panorama_poses(estate: Estate, most_per_facade: int) -> dict[str, Pose]:
    """Poses by panorama id along the estate's lines, headed where the vehicle drives.

    They stand 6 m apart, wider where a facade would be seen well by more than
    ``most_per_facade`` of them; places that see no facade of a target well are left out.
    """
    spacing_m = LEAST_SPACING_M
    while True:
        places = [
            place for line in estate.panorama_lines for place in _along(np.array(line), spacing_m)
        ]
        facades = [facades_seen_from(estate, place[:2]) for place in places]
        counts: dict[str, int] = {}
        for name in (name for names in facades for name in names):
            counts[name] = counts.get(name, 0) + 1
        if max(counts.values(), default=0) <= most_per_facade:
            break
        spacing_m += 0.25
    poses = {}
    for (x, y, heading_deg), seen in zip(places, facades, strict=True):
        if not seen:
            continue
        name = f"pano-{len(poses):02d}"
        rng = rng_of(estate.seed, "panorama", name)
        east, north, up = rng.normal(0, 1, 3) * [0.25, 0.25, 0.03]
        poses[name] = Pose(
            (
                millimetres(x + east),
                millimetres(y + north),
                millimetres(CAMERA_HEIGHT_M + up),
            ),
            round((heading_deg + float(rng.normal(0, 2.5))) % 360, 3),
            round(float(rng.normal(0, 0.8)), 3),
            round(float(rng.normal(0, 0.8)), 3),
        )
    return poses


def _along(line: FloatArray, spacing_m: float) -> list[tuple[float, float, float]]:
    """Places x, y on a line, evenly spaced, and the compass bearing of the line there."""
    steps = np.diff(line, axis=0)
    lengths = np.hypot(*steps.T)
    whole_m = float(lengths.sum())
    count = max(1, int(np.floor(whole_m / spacing_m)) + 1)
    margin_m = (whole_m - (count - 1) * spacing_m) / 2
    starts = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
    found = []
    for index in range(count):
        along_m = margin_m + index * spacing_m
        part = int(np.searchsorted(starts, along_m, side="right")) - 1
        x, y = line[part] + steps[part] * (along_m - starts[part]) / lengths[part]
        bearing_deg = float(np.rad2deg(np.arctan2(steps[part][0], steps[part][1]))) % 360
        found.append((float(x), float(y), bearing_deg))
    return found


def facades_seen_from(estate: Estate, place: tuple[float, float]) -> list[str]:
    """Ids of the target facades that a place sees well: near, not too obliquely, past buildings."""
    built = shapely.union_all(
        [Polygon(b.outline).buffer(-0.1) for b in (*estate.buildings, *estate.neighbours)]
    )
    here = np.array(place)
    found = []
    for building in estate.buildings:
        for edge, wall in enumerate(building.walls):
            pose = wall.world_from_facade
            outward = pose.rotation[:2, 2]
            samples = np.linspace(wall.start, wall.end, 9)[1:-1]
            way = here - samples
            distance = np.linalg.norm(way, axis=1)
            cosine = way @ outward / np.maximum(distance, 1e-9)
            near = (distance < REACH_M) & (cosine > np.cos(np.deg2rad(INCIDENCE_DEG)))
            lines = [LineString([here, sample]) for sample in samples[near]]
            if lines and not shapely.intersects(built, lines).all():
                found.append(facade_id(building, edge))
    return found


def towards_buildings(estate: Estate, pose: Pose, width_px: int) -> NDArray[np.bool_]:
    """Where (W / 2, W) a panorama looks at a target, from ground in front to above the roof."""
    azimuth = np.arange(AZIMUTHS) * (2 * np.pi / AZIMUTHS)
    rays = np.stack([np.sin(azimuth), np.cos(azimuth)], axis=1)
    low, high = np.full(AZIMUTHS, np.inf), np.full(AZIMUTHS, -np.inf)
    z_m = pose.place[2]
    for building in estate.buildings:
        here = np.array(pose.place)
        walls = [distances_to_line(here, rays, wall.start, wall.end) for wall in building.walls]
        distance = np.min(walls, axis=0)
        hit = distance < RENDERED_REACH_M
        top_m = max(building.height_m, *(wall.height_m for wall in building.walls))
        top_m += building.roof.rise_m + building.roof.fascia_m
        near = np.maximum(distance - 1.0 - building.roof.overhang_m, 0.5)
        high = np.where(hit, np.maximum(high, np.arctan((top_m - z_m) / near)), high)
        ground = np.arctan(-z_m / np.maximum(distance - GROUND_M, 1.5))
        low = np.where(hit, np.minimum(low, ground), low)
    wide = 2 * round(MARGIN_DEG / 360 * AZIMUTHS) + 1
    low = minimum_filter1d(low, wide, mode="wrap") - np.deg2rad(MARGIN_DEG)
    high = maximum_filter1d(high, wide, mode="wrap") + np.deg2rad(MARGIN_DEG)
    step = 4 if width_px % 8 == 0 and width_px > 4096 else 1
    coarse = Equirect(pose.world_from_cam, width_px // step)
    x, y = np.meshgrid(np.arange(coarse.width_px) + 0.5, np.arange(coarse.height_px) + 0.5)
    _, direction = coarse.rays(np.stack([x, y], axis=-1).reshape(-1, 2))
    turn = np.arctan2(direction[:, 0], direction[:, 1]) / (2 * np.pi) % 1
    index = (turn * AZIMUTHS).astype(int) % AZIMUTHS
    climb = np.arcsin(np.clip(direction[:, 2], -1, 1))
    seen = ((climb > low[index]) & (climb < high[index])).reshape(x.shape)
    return seen.repeat(step, axis=0).repeat(step, axis=1)
