"""Parked cars as meshes: bodies drawn through sections from nose to tail."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.meshes.solids import ball, box, quad
from benchmarks.estate.parts import Material, Mesh, Parts, joined
from benchmarks.estate.plan import Car, FloatArray
from benchmarks.estate.site.car_shapes import CAR_SIZES_M, SHAPES, Shape, axes_of
from benchmarks.estate.site.wheels import TYRE_RADIUS_M, wheel_meshes
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

GAP_M = 0.012
MATERIALS = {
    "car_glass": Material("plastic", (0.035, 0.04, 0.042), roughness=0.02),
    "car-black": Material("plastic", (0.05, 0.05, 0.052), roughness=0.45),
    "car-gap": Material("diffuse", (0.02, 0.02, 0.02)),
    "car-lamp": Material("plastic", (0.62, 0.65, 0.68), roughness=0.03),
    "car-tail": Material("plastic", (0.42, 0.03, 0.03), roughness=0.05),
    "car-plate": Material("plastic", (0.86, 0.86, 0.84), roughness=0.4),
    "car-tyre": Material("diffuse", (0.055, 0.055, 0.056)),
    "car-rim": Material("metal", (0.62, 0.63, 0.65), roughness=0.3),
}


def car_parts(cars: Sequence[Car], ground_z_m: float, seed: int, *, coarse: bool = False) -> Parts:
    """Meshes of cars that stand on ground at a height; ``coarse`` for far ones."""
    parts = Parts(materials=dict(MATERIALS))
    bodies: dict[str, list[Mesh]] = {}
    for number, car in enumerate(cars):
        if car.kind not in bodies:
            bodies[car.kind] = joined(body_meshes(car.kind, coarse=coarse))
        paint = "car-paint-" + "-".join(f"{round(255 * value):03d}" for value in car.rgb)
        parts.materials[paint] = Material("plastic", car.rgb, roughness=0.06)
        ahead, left = axes_of(car)
        frame = np.stack([[*ahead, 0.0], [*left, 0.0], [0.0, 0.0, 1.0]])
        sag = rng_of(seed, "car", number).uniform(-0.015, 0.01)
        foot = np.array([*car.place, ground_z_m + sag])
        for mesh in bodies[car.kind]:
            parts.meshes.append(
                Mesh(
                    paint if mesh.material == "paint" else mesh.material,
                    (mesh.vertices @ frame + foot).astype(np.float32),
                    mesh.faces,
                    None,
                    None if mesh.normals is None else (mesh.normals @ frame).astype(np.float32),
                )
            )
    parts.meshes = joined(parts.meshes)
    return parts


def body_meshes(kind: str, *, coarse: bool = False) -> list[Mesh]:
    """A car whose nose looks along x, with its middle over the origin and tyres on z = 0."""
    length, width, _ = CAR_SIZES_M[kind]
    shape = SHAPES[kind]
    stations = _stations(shape, length, coarse)
    points, rows = _sections(shape, stations, length, width)
    meshes = _skin(shape, stations, points, rows)
    x_of = length / 2 - np.array(shape.axles) * length
    for x in x_of:
        for side in (-1, 1):
            meshes += wheel_meshes(np.array([x, side * (width / 2 - 0.115), TYRE_RADIUS_M]), side)
    belt = float(PchipInterpolator(*zip(*shape.belt, strict=True))(shape.windows[0][0]))
    mirror_x = length / 2 - (shape.windows[0][0] + 0.015) * length
    for side in (-1, 1):
        centre = [mirror_x, side * (width / 2 + 0.06), belt + 0.07]
        meshes.append(_plain(ball("paint", centre, (0.06, 0.10, 0.07), rings=6)))
    for end, sign in ((length / 2 + 0.032, 1), (-length / 2 - 0.032, -1)):
        low, high = (0.36, 0.47) if sign > 0 else (0.55, 0.66)
        corners = [
            [end, -sign * y, z] for y, z in ((-0.26, low), (0.26, low), (0.26, high), (-0.26, high))
        ]
        plate = quad("car-plate", corners[::-1])
        meshes.append(_plain(plate))
    meshes.append(
        _plain(
            box("car-gap", [-length * 0.44, -width * 0.4, 0.2], [length * 0.44, width * 0.4, 0.34])
        )
    )
    return meshes


def _plain(mesh: Mesh) -> Mesh:
    return Mesh(mesh.material, mesh.vertices, mesh.faces, None, mesh.normals)


def _stations(shape: Shape, length: float, coarse: bool) -> FloatArray:
    """Shares of the length, nose to tail, dense at the ends and at wheels, with doors' gaps."""
    stations = [np.linspace(0, 1, 36 if coarse else 72)]
    stations.append(np.array([0.0, 0.002, 0.006, 0.012, 0.02, 0.03, 0.045]))
    stations.append(1 - np.array([0.0, 0.002, 0.006, 0.012, 0.02, 0.03, 0.045]))
    turn = np.cos(np.linspace(0, np.pi, 11 if coarse else 17))
    for axle in shape.axles:
        stations.append(axle + turn * (TYRE_RADIUS_M + 0.055) / length)
    edges = [*shape.screen, *shape.rear, *(edge for window in shape.windows for edge in window)]
    stations.append(np.array(edges))
    merged = np.unique(np.round(np.concatenate(stations), 5))
    keep = np.concatenate([[True], np.diff(merged) > 0.0012])
    merged = merged[keep]
    for gap in shape.doors:
        half = GAP_M / 2 / length
        merged = merged[np.abs(merged - gap) > 2 * half]
        merged = np.append(merged, [gap - half, gap + half])
    return np.sort(merged)


def _curve(points: Sequence[tuple[float, float]], stations: FloatArray, soft: float) -> FloatArray:
    """A smooth curve through points, rounded a little at its corners."""
    fine = np.linspace(0, 1, 801)
    values = PchipInterpolator(*zip(*points, strict=True))(fine)
    return np.interp(stations, fine, gaussian_filter1d(values, soft, mode="nearest"))


LOWER, GLASS, ROOF = 9, 5, 7
"""Rows of the skin: sill to belt, belt to roof's edge, edge to the middle."""


def _sections(
    shape: Shape, stations: FloatArray, length: float, width: float
) -> tuple[FloatArray, NDArray[np.str_]]:
    """Points (S, R, 3) of the left half from floor to roof, and every strip's name (R - 1,)."""
    top = _curve(shape.top, stations, 7)
    belt = np.minimum(_curve(shape.belt, stations, 8), top - 0.015)
    x = length / 2 - stations * length
    # Seen from above: full in the middle, drawn in and rounded at nose and tail.
    nose, tail = np.clip(stations / 0.20, 0, 1), np.clip((1 - stations) / 0.17, 0, 1)
    plan = (0.70 + 0.30 * (1 - (1 - nose) ** 3.2)) * (0.80 + 0.20 * (1 - (1 - tail) ** 3.2))
    plan *= np.sqrt(np.clip(1 - (1 - np.clip(stations / 0.03, 0, 1)) ** 2 * 0.20, 0, 1))
    plan *= np.sqrt(np.clip(1 - (1 - np.clip((1 - stations) / 0.02, 0, 1)) ** 2 * 0.14, 0, 1))
    half = width / 2 * plan
    sill = (
        0.205
        + 0.10 * (1 - np.clip(stations / 0.1, 0, 1))
        + 0.13 * (1 - np.clip((1 - stations) / 0.1, 0, 1))
    )
    arch = TYRE_RADIUS_M + 0.055
    for axle in shape.axles:
        off = (stations - axle) * length
        over = TYRE_RADIUS_M + np.sqrt(np.clip(arch**2 - off**2, 0, None))
        sill = np.where(np.abs(off) <= arch, np.maximum(sill, over), sill)
    cabin = np.clip((top - belt - 0.06) / 0.40, 0, 1)
    edge_z = top - 0.03 - 0.045 * cabin
    edge_z = np.maximum(edge_z, belt + 0.005)
    edge_y = half * (0.90 - 0.20 * cabin)
    rows: list[FloatArray] = [
        np.stack([x, np.zeros_like(x), sill], 1),
        np.stack([x, half * 0.45, sill], 1),
        np.stack([x, half * 0.93, sill], 1),
    ]
    names = ["floor", "floor"]
    for k in range(LOWER):
        share = (k + 1) / LOWER
        z = sill + (belt - sill) * share
        # Widest below the belt; drawn in towards the sill and, at the shoulder, to the windows.
        middle = np.clip((z - 0.22) / (belt - 0.22 + 1e-6), 0, 1)
        swell = 1 - 0.075 * (1 - middle) ** 2.2 - 0.035 * np.clip(middle - 0.72, 0, 1) ** 2 / 0.0784
        rows.append(np.stack([x, half * swell, z], 1))
        names.append("sill" if k == 0 else "side")
    shoulder = half * 0.962
    for k in range(GLASS):
        share = (k + 1) / GLASS
        z = belt + (edge_z - belt) * share
        y = (shoulder - 0.012 * cabin) * (1 - share) + edge_y * share
        y = y + 0.035 * half * np.sin(np.pi * share) * cabin
        rows.append(np.stack([x, y, z], 1))
        names.append("window" if 0 < k < GLASS - 1 else "rail")
    for k in range(ROOF):
        angle = np.pi / 2 * (k + 1) / ROOF
        y = edge_y * np.cos(angle) ** 0.75
        z = edge_z + (top - edge_z) * np.sin(angle) ** 0.8
        rows.append(np.stack([x, np.maximum(y, 0), z], 1))
        names.append("edge" if k == 0 else "roof")
    return np.stack(rows, axis=1), np.array(names)


def _skin(
    shape: Shape, stations: FloatArray, points: FloatArray, names: NDArray[np.str_]
) -> list[Mesh]:
    """The body's surface and its two ends, every cell with its material, both halves."""
    middle = (stations[:-1] + stations[1:]) / 2
    material = np.full((len(middle), len(names)), "paint", dtype="<U10")
    material[:, names == "floor"] = "car-gap"
    material[:, names == "sill"] = "car-black"
    columns = {name: np.flatnonzero(names == name) for name in ("side", "window", "roof")}
    for first, last in shape.windows:
        inside = (middle > first) & (middle < last)
        material[np.ix_(inside, columns["window"])] = "car_glass"
    for first, last in (shape.screen, shape.rear):
        inside = (middle > first) & (middle < last)
        material[np.ix_(inside, columns["roof"])] = "car_glass"
    for gap in shape.doors:
        inside = np.abs(middle - gap) * 4.5 < GAP_M / 2
        material[np.ix_(inside, columns["side"])] = "car-gap"
    lamps = columns["side"][-3:]
    material[np.ix_(middle < 0.045, lamps)] = "car-lamp"
    material[np.ix_(middle > 0.965, columns["side"][-4:])] = "car-tail"
    meshes = []
    caps = [_cap(points[0], names, 1), _cap(points[-1], names, -1)]
    for grid, kinds in ((points, material), *caps):
        for mirrored in (False, True):
            meshes += _cells(grid * ([1, -1, 1] if mirrored else [1, 1, 1]), kinds, mirrored)
    return meshes


def _cap(section: FloatArray, names: NDArray[np.str_], sign: int) -> tuple[FloatArray, np.ndarray]:
    """The rounded end of the body: its last section drawn in to the middle plane."""
    rings = [section]
    for scale, out in ((0.97, 0.010), (0.90, 0.018), (0.78, 0.022), (0.60, 0.024), (0.36, 0.026)):
        rings.append(section * [1, scale, 1] + [sign * out, 0, 0])
    rings.append(section * [1, 0, 1] + [sign * 0.026, 0, 0])
    grid = np.stack(rings)
    kinds = np.full((len(rings) - 1, len(names)), "paint", dtype="<U10")
    kinds[:, names == "floor"] = "car-black"
    sides = np.flatnonzero(names == "side")
    if sign > 0:
        kinds[:3, sides[-3:]] = "car-lamp"
        kinds[3:, sides[-2:-1]] = "car-black"
        kinds[2:, sides[:3]] = "car-black"
        return grid[::-1], kinds[::-1]
    kinds[:3, sides[-4:]] = "car-tail"
    kinds[:, sides[:2]] = "car-black"
    return grid, kinds


def _cells(grid: FloatArray, kinds: np.ndarray, mirrored: bool) -> list[Mesh]:
    """The cells of a grid of points (S, R, 3), one mesh per material, with smooth normals."""
    stations, rows = grid.shape[:2]
    index = np.arange(stations * rows).reshape(stations, rows)
    a, b = index[:-1, :-1], index[:-1, 1:]
    c, d = index[1:, 1:], index[1:, :-1]
    quads = np.stack([a, b, c, d], axis=-1)
    if not mirrored:
        quads = quads[..., ::-1]
    vertices = grid.reshape(-1, 3)
    normals = np.zeros_like(vertices)
    flat = quads.reshape(-1, 4)
    facing = np.cross(
        vertices[flat[:, 2]] - vertices[flat[:, 0]], vertices[flat[:, 3]] - vertices[flat[:, 1]]
    )
    for corner in range(4):
        np.add.at(normals, flat[:, corner], facing)
    # Both halves meet on the middle plane: there the normal has no sideways part.
    normals[np.abs(vertices[:, 1]) < 1e-9, 1] = 0
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(size > 1e-12, normals / np.maximum(size, 1e-12), [0.0, 0.0, -1.0])
    meshes = []
    for kind in np.unique(kinds):
        chosen = quads[kinds == kind].reshape(-1, 4)
        used, new = np.unique(chosen, return_inverse=True)
        new = new.reshape(-1, 4)
        faces = np.concatenate([new[:, [0, 1, 2]], new[:, [0, 2, 3]]])
        meshes.append(
            Mesh(
                str(kind),
                vertices[used].astype(np.float32),
                faces.astype(np.int32),
                None,
                normals[used].astype(np.float32),
            )
        )
    return meshes
