"""Photos of a walk around the buildings, with a triangle for the scale, and of a flight."""

from __future__ import annotations

from dataclasses import astuple, dataclass
from itertools import combinations
from typing import Any

import numpy as np
import shapely
from benchmarks.estate.capture.cameras import LensCamera, Pose
from benchmarks.estate.capture.lens import Distortion
from benchmarks.estate.drawing import millimetres, rng_of
from benchmarks.estate.plan import Building, Estate
from benchmarks.estate.site.placing import obstacles
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation
from shapely import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from si3fp.errors import InputError
from si3fp.geometry.enu import geodetic_from_world
from si3fp.geometry.pinhole import Pinhole

FloatArray = NDArray[np.float64]
Json = dict[str, Any]

EYE_M = 1.6
FOCAL_35MM = 26.0  # a phone's main camera
LENS = Distortion(k1=-0.045, k2=0.018, p1=0.0004, p2=-0.0003)
NEAREST_M, FARTHEST_M = 4.0, 22.0
RING_M = (8.0, 17.0)  # the nearest and the farthest loop that is sought first,
RING_PER_HEIGHT = 1.1  # in between by the height: the eaves lie at 40 degrees
STEP = 0.35  # along a wall, of the distance from it: photos share three quarters
TURN = float(np.deg2rad(11.0))  # around a corner: at 20 degrees features are no longer matched
AIM = 1.0  # of the distance: the camera looks at the middle of what passes on so much of the way
PERSON_M = 0.5
CLEAR_OF_LEAVES_M = 1.0
LEVEL_DEG = 12.0  # pitch of the lower row: some ground in front, most of the wall
TOP_MARGIN_DEG = 6.0
TAPE_SIGMA_M = 0.02
GPS_SIGMA_M = 2.5
FLIGHT_M = (12.0, 25.0)


@dataclass(frozen=True)
class Walk:
    """Poses by photo name in the order of the walk, and pairs whose distance was measured."""

    poses: dict[str, Pose]
    sides: tuple[tuple[str, str], ...]


def photo_lens(width_px: int) -> Pinhole:
    """The one camera of the photos, 4 : 3, its principal point a little off the middle."""
    height_px = width_px * 3 // 4
    # 36 x 24 mm film has a diagonal of 43.27 mm: what "35 mm equivalent" refers to.
    focal_px = FOCAL_35MM / 43.267 * float(np.hypot(width_px, height_px))
    return Pinhole(
        round(focal_px, 3),
        round(focal_px, 3),
        width_px * 0.5025,
        height_px * 0.4975,
        width_px,
        height_px,
    )


def lens_camera(pose: Pose, pinhole: Pinhole) -> LensCamera:
    """The camera of one photo."""
    return LensCamera(pose.world_from_cam, pinhole, LENS)


def walk_around(estate: Estate, count: int) -> Walk:
    """``count`` photos from eye height on a closed loop around every target.

    A loop runs where facades fit into the picture, nearer where something stands in the way, with
    shorter steps around corners.
    Buildings too high for one picture get a second row that looks up, from every place or from
    every third.
    """
    built = _built(estate)
    poses: dict[str, Pose] = {}
    sides: tuple[tuple[str, str], ...] = ()
    for building in estate.buildings:
        ring_m = float(np.clip(RING_PER_HEIGHT * building.height_m, *RING_M))
        half_deg = float(np.rad2deg(np.arctan(0.5 / (FOCAL_35MM / 43.267 * 5 / 3))))
        top_deg = float(np.rad2deg(np.arctan((building.height_m - EYE_M) / ring_m)))
        up_deg = max(top_deg - half_deg + TOP_MARGIN_DEG, LEVEL_DEG + 8.0)
        every = 1 if top_deg > LEVEL_DEG + half_deg else 3
        stations = round(count * every / (every + 1))
        looked_up = set(np.arange(0, stations, every)[: count - stations].tolist())
        level: dict[str, Pose] = {}
        for index, (here, target) in enumerate(_loop(estate, building, stations, ring_m)):
            rng = rng_of(estate.seed, "walk", building.id, index)
            name = f"photo-{len(poses):03d}.jpg"
            level[name] = poses[name] = _held(here, target, EYE_M, LEVEL_DEG, rng)
            if index in looked_up:
                name = f"photo-{len(poses):03d}.jpg"
                poses[name] = _held(here, target, EYE_M, up_deg, rng)
        sides = sides or _triangle(level, built)
    if not sides:
        raise InputError(
            f"No three photos of the walk around {estate.name} (seed {estate.seed}) see each "
            "other; take more photos or another seed."
        )
    return Walk(poses, sides)


def flight_around(estate: Estate, count: int) -> dict[str, Pose]:
    """Photos from two rings in the air, 12 and 25 m high, looking down at the walls.

    ``count`` are planned; where a tree or house stands that high, none is taken.
    """
    poses = {}
    outline = _outline(estate)
    for row, height_m in enumerate(FLIGHT_M):
        ring = outline.buffer(RING_M[1] + 4.0 * row).exterior
        middle_m = max(building.height_m for building in estate.buildings) / 2
        high = shapely.union_all(
            [Point(t.place).buffer(t.crown_m / 2) for t in estate.trees if t.height_m > height_m]
            + [Polygon(b.outline) for b in estate.neighbours if b.height_m > height_m - 2.0]
        )
        for index in range(count // 2):
            point = ring.interpolate((index + 0.5 * row) / (count // 2), normalized=True)
            if high.dwithin(point, CLEAR_OF_LEAVES_M):
                continue
            here = np.array(point.coords[0])
            target = _nearest(outline, here)
            down = np.arctan2(middle_m - height_m, np.linalg.norm(target - here))
            rng = rng_of(estate.seed, "flight", row, index)
            pose = _held(here, target, height_m, float(np.rad2deg(down)), rng)
            poses[f"drone-{len(poses):03d}.jpg"] = pose
    return poses


def _outline(estate: Estate) -> Polygon:
    """All targets together; their hull where they stand apart."""
    together = shapely.union_all([Polygon(b.outline).buffer(0.05) for b in estate.buildings])
    return together if isinstance(together, Polygon) else together.convex_hull


def _built(estate: Estate) -> BaseGeometry:
    return shapely.union_all([Polygon(b.outline) for b in (*estate.buildings, *estate.neighbours)])


def _nearest(outline: Polygon, here: FloatArray) -> FloatArray:
    return np.array(shapely.shortest_line(outline.exterior, Point(here)).coords[0])


def _loop(
    estate: Estate, building: Building, count: int, ring_m: float
) -> list[tuple[FloatArray, FloatArray]]:
    """Places and the points that they look at, counter-clockwise."""
    outline, taken = Polygon(building.outline), obstacles(estate)
    hides = shapely.union_all(
        [
            Polygon(other.outline).buffer(-0.1)
            for other in (*estate.buildings, *estate.neighbours)
            if other is not building
        ]
    )
    distances_m = np.arange(NEAREST_M, FARTHEST_M + 0.1, 0.5)
    # As far away as the photos beside it where that can be: features change with the scale.
    distances_m = distances_m[np.argsort(np.abs(np.log(distances_m / ring_m)), kind="stable")]
    crowns = shapely.union_all(
        [Point(tree.place).buffer(tree.crown_m / 2 + CLEAR_OF_LEAVES_M) for tree in estate.trees]
    )
    found = []
    for on_ring, foot, target in zip(*_stations(outline, count, ring_m), strict=True):
        outward = (on_ring - foot) / np.linalg.norm(on_ring - foot)
        places = [
            here
            for here in foot + distances_m[:, None] * outward
            if not taken.dwithin(Point(here), PERSON_M)
            and not hides.intersects(LineString([here, foot]))
        ]
        # Behind a tree, or under it, only where there is nowhere else.
        places.sort(
            key=lambda here: (
                int(crowns.intersects(LineString([here, foot])))
                + int(crowns.intersects(Point(here)))
            )
        )
        if places:
            found.append((places[0], target))
    if len(found) < 3:
        raise InputError(
            f"The walk around {building.id} of {estate.name} (seed {estate.seed}) has "
            f"{len(found)} free places of {count}; take another seed."
        )
    return found


def _stations(
    outline: Polygon, count: int, ring_m: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Places on the ring, the nearest points of the walls, and what is looked at; (count, 2) each.

    Steps are even by what changes in the picture: by the way along walls, by the angle around
    corners.
    """
    ring = outline.buffer(ring_m).exterior
    if not ring.is_ccw:
        ring = ring.reverse()
    dense = max(20 * count, round(ring.length / 0.1))
    shares = np.arange(dense) / dense
    places = shapely.get_coordinates(shapely.line_interpolate_point(ring, shares, normalized=True))
    on_wall = shapely.shortest_line(shapely.points(places), outline.exterior)
    feet = shapely.get_coordinates(on_wall)[1::2]
    step_m = ring.length / dense
    passed_m = np.linalg.norm(np.roll(feet, -1, axis=0) - feet, axis=1)
    effort = np.where(passed_m < 0.1 * step_m, step_m / TURN, step_m / STEP)
    reached = np.cumsum(effort) - effort
    index = np.searchsorted(reached, np.arange(count) / count * effort.sum(), side="right") - 1
    window = max(1, round(AIM * ring_m / step_m))
    aims = uniform_filter1d(feet, window, axis=0, mode="wrap")
    return places[index], feet[index], aims[index]


def _held(
    here: FloatArray, target: FloatArray, height_m: float, pitch_deg: float, rng: Any
) -> Pose:
    """The pose of a camera held by hand."""
    east, north = target - here
    up_m, turn, pitch, roll = rng.normal(0, 1, 4) * [0.04, 2.0, 1.0, 0.8]
    return Pose(
        (millimetres(here[0]), millimetres(here[1]), millimetres(height_m + up_m)),
        round(float(np.rad2deg(np.arctan2(east, north)) + turn) % 360, 3),
        round(pitch_deg + float(pitch), 3),
        round(float(roll), 3),
    )


def _triangle(poses: dict[str, Pose], built: BaseGeometry) -> tuple[tuple[str, str], ...]:
    """The three sides of the largest fat triangle of places with free sight, if there is one."""
    places = {name: np.array(pose.place[:2]) for name, pose in poses.items()}
    lengths = {}
    for a, b in combinations(places, 2):
        length = float(np.linalg.norm(places[a] - places[b]))
        if 5.0 < length < 30.0 and not built.intersects(LineString([places[a], places[b]])):
            lengths[a, b] = length
    best, sides = 0.0, tuple[tuple[str, str], ...]()
    for a, b in lengths:
        for c, place in places.items():
            if (b, c) in lengths and (a, c) in lengths:
                (x1, y1), (x2, y2) = places[b] - places[a], place - places[a]
                area = abs(x1 * y2 - x2 * y1)
                if area > best:
                    best, sides = area, ((a, b), (b, c), (a, c))
    return sides


def triangle_record(walk: Walk, seed: int) -> Json:
    """``reference_triangle.json``: the sides as a tape measures them."""
    rng = rng_of(seed, "tape")
    sides = []
    for a, b in walk.sides:
        length = np.linalg.norm(np.subtract(walk.poses[a].place, walk.poses[b].place))
        sides.append([a, b, round(float(length + rng.normal(0, TAPE_SIGMA_M)), 3)])
    return {"sides_m": sides, "tape_sigma_m": TAPE_SIGMA_M}


def positions(poses: dict[str, Pose], estate: Estate) -> dict[str, tuple[float, float, float]]:
    """Latitude, longitude and height by photo as a phone's receiver gives them: metres off.

    Half of the error is the same for all photos of the walk.
    """
    common = rng_of(estate.seed, "gps").normal(0, GPS_SIGMA_M / np.sqrt(2), 3)
    found = {}
    for name, pose in poses.items():
        own = rng_of(estate.seed, "gps", name).normal(0, GPS_SIGMA_M / np.sqrt(2), 3)
        place = np.array(pose.place) + (common + own) * [1, 1, 1.5]
        lat, lon, height_m = geodetic_from_world(place, estate.origin)
        found[name] = (float(lat), float(lon), float(height_m))
    return found


def colmap_text(poses: dict[str, Pose], pinhole: Pinhole) -> dict[str, str]:
    """``cameras.txt``, ``images.txt`` and an empty ``points3D.txt`` of the exact poses."""
    lens = [pinhole.fx_px, pinhole.fy_px, pinhole.cx_px, pinhole.cy_px, *astuple(LENS)]
    size = f"{pinhole.width_px} {pinhole.height_px}"
    lines = []
    for number, (name, pose) in enumerate(poses.items(), start=1):
        cam_from_world = pose.world_from_cam.inverse()
        x, y, z, w = Rotation.from_matrix(cam_from_world.rotation).as_quat()
        values = " ".join(f"{v:.12g}" for v in [w, x, y, z, *cam_from_world.translation])
        lines += [f"{number} {values} 1 {name}", ""]
    return {
        "cameras.txt": f"1 OPENCV {size} {' '.join(f'{v:.12g}' for v in lens)}\n",
        "images.txt": "\n".join(lines) + "\n",
        "points3D.txt": "",
    }
