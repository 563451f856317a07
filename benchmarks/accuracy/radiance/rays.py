"""Exact ray casting against the wall with its recesses, the ground, boxes and balls.

A ray is ``origin + t * direction`` in frame facade. Rays come on a lattice (rows, columns), so that
a box or a ball is only tested in the window of the lattice that it can cover.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from benchmarks.accuracy.radiance.scene import Scene
from benchmarks.accuracy.radiance.solids import GLASS_SETBACK_M, Ball, Box
from benchmarks.accuracy.radiance.textures import MARGIN_M, Float
from numpy.typing import NDArray

from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Photo

SKY, GROUND, WALL, REVEAL, SOFFIT, SILL, FRAME, GLASS = range(8)
TABLE_M = 0.05

Window = tuple[slice, slice]


@dataclass(frozen=True)
class Rays:
    """A lattice of rays.

    Attributes
    ----------
    origin, direction
        x, y and z as (h, w) float32 arrays, broadcast where constant.
    window
        Rows and columns whose rays a convex body with these corners (N, 3) can meet.
    """

    origin: tuple[Float, Float, Float]
    direction: tuple[Float, Float, Float]
    window: Callable[[FloatArray], Window]

    @property
    def shape(self) -> tuple[int, int]:
        rows, columns = self.direction[0].shape
        return rows, columns

    def at(self, window: Window) -> tuple[tuple[Float, ...], tuple[Float, ...]]:
        """Origins and directions in a window."""
        return tuple(o[window] for o in self.origin), tuple(d[window] for d in self.direction)


def _clipped(low: FloatArray, high: FloatArray, shape: tuple[int, int]) -> Window:
    """Slices of the lattice between (column, row) bounds, one ray wider."""
    left, top = np.floor(np.clip(low, -2, 1e6)).astype(int) - 1
    right, bottom = np.ceil(np.clip(high, -2, 1e6)).astype(int) + 1
    rows = slice(min(max(top, 0), shape[0]), min(max(bottom, 0), shape[0]))
    return rows, slice(min(max(left, 0), shape[1]), min(max(right, 0), shape[1]))


def _spread(values: object, shape: tuple[int, int]) -> Float:
    return np.broadcast_to(np.asarray(values, np.float32), shape)


def _never_zero(values: Float) -> Float:
    return np.where(np.abs(values) < 1e-9, np.float32(1e-9), values)


def photo_rays(photo: Photo, world_from_facade: Rigid3, samples: int) -> Rays:
    """Rays through ``samples`` x ``samples`` places of each pixel; t is the depth in the camera."""
    camera = photo.camera
    cam_from_facade = photo.cam_from_world @ world_from_facade
    facade_from_cam = cam_from_facade.inverse()
    shape = (camera.height_px * samples, camera.width_px * samples)
    pixels = np.stack(
        np.meshgrid((np.arange(shape[1]) + 0.5) / samples, (np.arange(shape[0]) + 0.5) / samples),
        axis=-1,
    )
    directions = facade_from_cam.rotate(camera.unproject(pixels)).astype(np.float32)

    def window(corners: FloatArray) -> Window:
        in_cam = cam_from_facade.apply(corners)
        if (in_cam[:, 2] < 0.05).all():
            return slice(0, 0), slice(0, 0)
        if (in_cam[:, 2] < 0.05).any():
            return slice(0, shape[0]), slice(0, shape[1])
        places = camera.project(in_cam) * samples
        return _clipped(places.min(axis=0), places.max(axis=0), shape)

    x, y, z = (_spread(value, shape) for value in facade_from_cam.translation)
    return Rays((x, y, z), tuple(_never_zero(directions[..., axis]) for axis in range(3)), window)


def facade_rays(x_m: FloatArray, y_m: FloatArray, start_m: float) -> Rays:
    """Rays straight at the wall from ``start_m`` in front, through (rows y, columns x)."""
    shape = (len(y_m), len(x_m))

    def window(corners: FloatArray) -> Window:
        low, high = corners.min(axis=0), corners.max(axis=0)
        columns = np.searchsorted(x_m, [low[0], high[0]])
        rows = len(y_m) - np.searchsorted(y_m[::-1], [high[1], low[1]])
        return _clipped(np.array([columns[0], rows[0]]), np.array([columns[1], rows[1]]), shape)

    origin = (_spread(x_m[None, :], shape), _spread(y_m[:, None], shape), _spread(start_m, shape))
    direction = (_spread(1e-9, shape), _spread(1e-9, shape), _spread(-1.0, shape))
    return Rays(origin, direction, window)


def sight_rays(centre: FloatArray, x_m: FloatArray, y_m: FloatArray, depth_m: Float) -> Rays:
    """Rays from a camera to points (rows y, columns x, depth); t = 1 at the point."""
    shape = depth_m.shape
    nearest, farthest = float(depth_m.max()), float(depth_m.min())
    step = (float(x_m[1] - x_m[0]), float(y_m[0] - y_m[1]))

    def window(corners: FloatArray) -> Window:
        # The shadow of a corner on the depths of the points; depth and corner vary separately,
        # so that the extremes are among these.
        before = np.maximum(centre[2] - corners[:, 2], 0.05)
        scales = np.stack([(centre[2] - depth) / before for depth in (nearest, farthest)])
        scales = np.maximum(scales, 1.0)[..., None]
        shadow = centre[:2] + (corners[None, :, :2] - centre[:2]) * scales
        low, high = shadow.min(axis=(0, 1)), shadow.max(axis=(0, 1))
        return _clipped(
            np.array([(low[0] - x_m[0]) / step[0], (y_m[0] - high[1]) / step[1]]),
            np.array([(high[0] - x_m[0]) / step[0] + 1, (y_m[0] - low[1]) / step[1] + 1]),
            shape,
        )

    x, y, z = (_spread(value, shape) for value in centre)
    direction = (
        _never_zero((x_m[None, :] - centre[0]).astype(np.float32) + _spread(0.0, shape)),
        _never_zero((y_m[:, None] - centre[1]).astype(np.float32) + _spread(0.0, shape)),
        _never_zero(depth_m - np.float32(centre[2])),
    )
    return Rays((x, y, z), direction, window)


@dataclass(frozen=True)
class WallHits:
    """Where rays meet wall, recess or ground: t (inf for the sky), part, index of the opening."""

    t: Float
    part: NDArray[np.uint8]
    opening: NDArray[np.int16]


class Wall:
    """The wall with its recesses, ready for casting."""

    def __init__(self, scene: Scene) -> None:
        self.low_x, self.high_x = -MARGIN_M + 0.1, scene.width_m + MARGIN_M - 0.1
        self.width_m, self.height_m = scene.width_m, scene.height_m
        self.bounds = np.array(
            [[o.left, o.right, o.bottom, o.top, o.recess, o.frame] for o in scene.openings],
            np.float32,
        )
        self.panes = np.array([[o.columns, o.rows] for o in scene.openings], np.float32)
        columns, rows = round(self.width_m / TABLE_M) + 1, round(self.height_m / TABLE_M) + 1
        self.table = np.full((rows, columns), -1, np.int16)
        for index, o in enumerate(scene.openings):
            box = [int(edge / TABLE_M) for edge in (o.bottom, o.top, o.left, o.right)]
            self.table[box[0] : box[1] + 1, box[2] : box[3] + 1] = index

    def cast(self, rays: Rays) -> WallHits:
        """The nearest of wall, recess and ground along each ray."""
        (ox, oy, oz), (dx, dy, dz) = rays.origin, rays.direction
        t = -oz / dz
        x, y = ox + t * dx, oy + t * dy
        # Neighbours to the left and right are lower and higher.
        top = np.where(x < 0, self.height_m - 2.1, self.height_m + 1.7)
        top = np.where((x >= 0) & (x <= self.width_m), self.height_m, top)
        on_wall = (dz < 0) & (y >= 0) & (y < top) & (x > self.low_x) & (x < self.high_x)
        t = np.where(on_wall, t, np.float32(np.inf))
        part = np.where(on_wall, np.uint8(WALL), np.uint8(SKY))
        opening = np.full(rays.shape, -1, np.int16)
        self._enter_recesses(rays, x, y, t, part, opening, on_wall)
        to_ground = np.where(dy < 0, -oy / dy, np.float32(np.inf))
        ground = to_ground < t
        t[ground] = to_ground[ground]
        part[ground] = GROUND
        return WallHits(t, part, opening)

    def _enter_recesses(
        self,
        rays: Rays,
        x: Float,
        y: Float,
        t: Float,
        part: NDArray[np.uint8],
        opening: NDArray[np.int16],
        on_wall: NDArray[np.bool_],
    ) -> None:
        near = np.flatnonzero(on_wall & (x >= 0) & (x <= self.width_m) & (y <= self.height_m))
        px, py = x.ravel()[near], y.ravel()[near]
        index = self.table[(py / TABLE_M).astype(np.int32), (px / TABLE_M).astype(np.int32)]
        left, right, bottom, top, recess, frame = self.bounds[index].T
        inside = (index >= 0) & (px > left) & (px < right) & (py > bottom) & (py < top)
        near, index = near[inside], index[inside]
        if not len(near):
            return
        origin = [axis.reshape(-1)[near] for axis in rays.origin]
        direction = [axis.reshape(-1)[near] for axis in rays.direction]
        left, right, bottom, top, recess, frame = self.bounds[index].T
        out, axis = _leave(origin, direction, (left, right, bottom, top, -recess))
        found = np.where(axis == 2, FRAME, REVEAL).astype(np.uint8)
        found[(axis == 1) & (direction[1] > 0)] = SOFFIT
        found[(axis == 1) & (direction[1] < 0)] = SILL

        columns, rows = self.panes[index].T
        bx, by = origin[0] + out * direction[0], origin[1] + out * direction[1]
        pitch_x = (right - left - frame) / columns
        pitch_y = (top - bottom - frame) / rows
        at_x, at_y = np.floor((bx - left) / pitch_x), np.floor((by - bottom) / pitch_y)
        low_x, low_y = left + at_x * pitch_x + frame, bottom + at_y * pitch_y + frame
        high_x, high_y = low_x + pitch_x - frame, low_y + pitch_y - frame
        pane = (axis == 2) & (bx > low_x) & (by > low_y) & (at_x < columns) & (at_y < rows)
        bounds = (low_x, high_x, low_y, high_y, -recess - np.float32(GLASS_SETBACK_M))
        deeper, axis = _leave(origin, direction, bounds)
        out = np.where(pane, deeper, out)
        found[pane & (axis == 2)] = GLASS
        np.put(t, near, out)
        np.put(part, near, found)
        np.put(opening, near, index)


def _leave(
    origin: list[Float], direction: list[Float], bounds: tuple[Float, ...]
) -> tuple[Float, NDArray[np.intp]]:
    """t and axis where rays leave the box left, right, bottom, top, back that they are in."""
    left, right, bottom, top, back = bounds
    ends = np.stack(
        [
            (np.where(direction[0] > 0, right, left) - origin[0]) / direction[0],
            (np.where(direction[1] > 0, top, bottom) - origin[1]) / direction[1],
            (back - origin[2]) / direction[2],
        ]
    )
    axis = ends.argmin(axis=0)
    return np.asarray(np.take_along_axis(ends, axis[None], axis=0)[0], np.float32), axis


def body_hits(
    body: Box | Ball, origin: tuple[Float, ...], direction: tuple[Float, ...]
) -> tuple[Float, NDArray[np.int8]]:
    """t (inf for a miss) where rays enter a body, and the axis of the face of a box."""
    if isinstance(body, Box):
        return _box_hits(body, origin, direction)
    return _ball_hits(body, origin, direction), np.zeros(direction[0].shape, np.int8)


def _box_hits(
    box: Box, origin: tuple[Float, ...], direction: tuple[Float, ...]
) -> tuple[Float, NDArray[np.int8]]:
    enter: Float = np.full(direction[0].shape, -np.inf, np.float32)
    leave: Float = np.full(direction[0].shape, np.inf, np.float32)
    face = np.zeros(direction[0].shape, np.int8)
    for axis in range(3):
        first = (np.float32(box.low[axis]) - origin[axis]) / direction[axis]
        second = (np.float32(box.high[axis]) - origin[axis]) / direction[axis]
        near = np.minimum(first, second)
        face = np.where(near > enter, np.int8(axis), face)
        enter = np.maximum(enter, near)
        leave = np.minimum(leave, np.maximum(first, second))
    return np.where((enter < leave) & (enter > 0), enter, np.float32(np.inf)), face


def _ball_hits(ball: Ball, origin: tuple[Float, ...], direction: tuple[Float, ...]) -> Float:
    to = [np.float32(centre) - o for centre, o in zip(ball.centre, origin, strict=True)]
    square = direction[0] ** 2 + direction[1] ** 2 + direction[2] ** 2
    middle = (to[0] * direction[0] + to[1] * direction[1] + to[2] * direction[2]) / square
    gap = sum((d * middle - c) ** 2 for d, c in zip(direction, to, strict=True))
    inside = np.float32(ball.radius**2) - gap
    t = middle - np.sqrt(np.maximum(inside, 0) / square)
    return np.where((inside > 0) & (t > 0), t, np.float32(np.inf))


def corners_of(body: Box | Ball) -> FloatArray:
    """Corners (8, 3) of the smallest axis-aligned box around a body."""
    if isinstance(body, Box):
        low, high = np.array(body.low), np.array(body.high)
    else:
        low, high = np.array(body.centre) - body.radius, np.array(body.centre) + body.radius
    choice = np.array([[k >> axis & 1 for axis in range(3)] for k in range(8)])
    return np.where(choice == 1, high, low)
