"""Facade pictures with exact boxes, in thousands: training data for the window detector.

A seed and a number give one picture, whatever else is made; the style, the crop, the light, what
stands before the wall and the camera are all drawn from them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from benchmarks.estate.capture.lens import photographed
from benchmarks.estate.drawing import rng_of
from benchmarks.estate.facades.facade_camera import FacadeCamera
from benchmarks.estate.facades.facade_labels import Label, labels_of
from benchmarks.estate.facades.facade_scene import Before, facade_parts, in_world
from benchmarks.estate.facades.styles import facade_plan
from benchmarks.estate.facades.styles_draft import FacadePlan, choose
from benchmarks.estate.plan import Car, Light, Rgb
from benchmarks.estate.rendering.light import sky_map
from benchmarks.estate.rendering.renderer import Renderer, mitsuba
from benchmarks.estate.sun import sun_position_deg
from numpy.typing import NDArray

from si3fp.geometry.enu import GeoOrigin
from si3fp.geometry.rigid import Rigid3

SAMPLES = 2
"""Even: panes reflect in every other sample."""
PIXELS = 400_000
"""Pixels of a picture at most: what two cores render in about a second."""
SKY_HEIGHT_PX = 128
LONGEST_PX = 1100
DEEPEST = 5
FACES_SUN = 0.45
"""Share of the pictures whose wall is turned to the sun; the rest look anywhere."""


@dataclass(frozen=True)
class FacadePicture:
    """One picture: rgb (H, W, 3) uint8, its labels, and how it came about."""

    number: int
    rgb: NDArray[np.uint8]
    labels: tuple[Label, ...]
    style: str
    m_per_px: float
    oblique: bool


@dataclass(frozen=True)
class Shot:
    """Everything that a picture is drawn from."""

    plan: FacadePlan
    camera: FacadeCamera
    before: Before
    light: Light
    origin: GeoOrigin


def facade_shot(seed: int, number: int, *, longest_px: int = LONGEST_PX) -> Shot:
    """What picture ``number`` shows, and from where; no rendering."""
    plan = facade_plan(seed, number)
    wall = plan.wall
    rng = rng_of(seed, "facade shot", number)
    month, hour = int(rng.integers(3, 11)), round(float(rng.uniform(7.0, 17.0)), 2)
    origin = GeoOrigin(round(float(rng.uniform(30, 60)), 3), 0.0, 0.0)
    skies = [0.0, rng.uniform(0.05, 0.4), rng.uniform(0.4, 0.8), 1.0]
    cloud = round(float(choose(rng, skies, (2, 3, 2, 4))), 2)
    light = Light(f"2024-{month:02d}-{int(rng.integers(1, 29)):02d}", hour, cloud)
    outward_deg = rng.uniform(0, 360)
    if rng.random() < FACES_SUN:
        sun_deg, _ = sun_position_deg(light.date, light.hour_utc, origin)
        outward_deg = sun_deg + rng.uniform(-80, 80)
    along = np.deg2rad(180 - outward_deg)
    end = (wall.width_m * np.cos(along), wall.width_m * np.sin(along))
    world_from_facade = replace(wall, end=end).world_from_facade
    camera = _camera(rng, plan, world_from_facade, longest_px)
    return Shot(plan, camera, _before(rng, plan, camera, month), light, origin)


def facade_picture(
    seed: int, number: int, *, samples: int = SAMPLES, longest_px: int = LONGEST_PX
) -> FacadePicture:
    """Picture ``number`` of a seed with its labels."""
    shot = facade_shot(seed, number, longest_px=longest_px)
    camera = shot.camera
    parts = facade_parts(shot.plan, shot.before, seed, number)
    sky = sky_map(mitsuba(), shot.light, shot.origin, SKY_HEIGHT_PX)
    renderer = Renderer(in_world(parts, camera.world_from_facade), sky, shot.origin)
    rendered = renderer.render(camera, samples, number, max_depth=DEEPEST, albedo_samples=samples)
    rng = rng_of(seed, "facade photo", number)
    return FacadePicture(
        number,
        photographed(
            rendered.radiance,
            rendered.seen,
            rng,
            vignetting=float(rng.uniform(0.0, 0.35)),
            exposure_jitter_ev=0.5,
            noise=float(rng.uniform(0.3, 3.0)),
        ),
        labels_of(shot.plan, camera, camera.out_m(rendered.depth_m)),
        shot.plan.style,
        camera.m_per_px,
        camera.eye is not None,
    )


def _camera(
    rng: np.random.Generator, plan: FacadePlan, world_from_facade: Rigid3, longest_px: int
) -> FacadeCamera:
    """A crop of the wall at 0.015 to 0.02 m/px, now and then with what is around the wall."""
    wall = plan.wall
    scale = LONGEST_PX / longest_px
    m_per_px = round(float(rng.uniform(0.0145, 0.02)) * scale, 4)
    around = rng.random() < 0.3
    left_m, right_m = (rng.uniform(0, 1.5, 2) if around else rng.uniform(-1.0, 0.0, 2)).tolist()
    low_m, high_m = (rng.uniform(0, 0.8, 2) if around else rng.uniform(-1.2, 0.0, 2)).tolist()
    width = wall.width_m + left_m + right_m
    height = wall.height_m + low_m + high_m
    width = min(width, longest_px * m_per_px)
    height = min(height, longest_px * m_per_px, PIXELS / scale**2 * m_per_px**2 / width)
    x0 = rng.uniform(-left_m, max(-left_m, wall.width_m + right_m - width))
    y0 = rng.uniform(-low_m, max(-low_m, wall.height_m + high_m - height))
    if rng.random() < 0.25:
        y0 = -low_m
    eye = None
    if rng.random() < 0.45:
        across = rng.uniform(x0 - 1.0, x0 + width + 1.0)
        eye = (
            round(across, 3),
            round(float(rng.uniform(1.5, 4.0)), 3),
            round(float(rng.uniform(8, 20)), 3),
        )
    return FacadeCamera(
        world_from_facade,
        round(float(x0), 3),
        round(float(y0 + height), 3),
        m_per_px,
        int(width / m_per_px),
        int(height / m_per_px),
        eye,
    )


def _before(rng: np.random.Generator, plan: FacadePlan, camera: FacadeCamera, month: int) -> Before:
    """What stands before the wall: often nothing, sometimes a tree too many."""
    width = plan.wall.width_m
    nearest_m = 1.0 if camera.eye is None else min(1.0, camera.eye[2] / 16)
    trees: list[tuple[float, float, float]] = []
    if rng.random() < 0.3:
        for _ in range(int(rng.integers(1, 3))):
            tall = rng.uniform(4.0, 9.0)
            trees.append((rng.uniform(0, width), nearest_m * rng.uniform(2.2, 5.5), tall))
    elif rng.random() < 0.3:  # out of the picture, for its shadow
        behind_m = (9.0 if camera.eye is None else camera.eye[2]) + 4.5
        place = rng.uniform(-3, width + 3), behind_m + rng.uniform(0, 4)
        trees.append((*place, rng.uniform(6, 12)))
    if rng.random() < 0.3:
        for _ in range(int(rng.integers(1, 6))):
            trees.append((rng.uniform(0, width), rng.uniform(0.7, 1.5), rng.uniform(0.8, 2.2)))
    cars = []
    if rng.random() < 0.25:
        x = rng.uniform(-2, 4)
        while x < width + 2:
            kind = choose(rng, ["saloon", "estate", "hatchback", "van"], (3, 3, 4, 1))
            grey = rng.uniform(0.05, 0.85)
            colours = [(grey,) * 3, (0.45, 0.06, 0.06), (0.08, 0.14, 0.32), (0.20, 0.28, 0.22)]
            rgb = choose(rng, colours, (6, 1, 1, 1))
            cars.append(
                Car(
                    (x, -nearest_m * rng.uniform(4.6, 5.6)),
                    float(choose(rng, [90, 270])),
                    kind,
                    rgb,
                )
            )
            x += rng.uniform(5.5, 12.0)
    posts = ((rng.uniform(0, width), rng.uniform(3, 4)),) if rng.random() < 0.12 else ()
    wires = tuple(rng.uniform(3, 8, int(rng.integers(1, 4)))) if rng.random() < 0.1 else ()
    sides: list[Rgb | None] = []
    for _ in range(2):
        grey = rng.uniform(0.35, 0.75)
        tint = (
            round(grey * rng.uniform(0.95, 1.1), 2),
            round(grey, 2),
            round(grey * rng.uniform(0.7, 1.0), 2),
        )
        sides.append(tint if rng.random() < 0.6 else None)
    season = "bare" if month in (3, 11) else "autumn" if month == 10 else "summer"
    return Before(tuple(trees), tuple(cars), posts, wires, (sides[0], sides[1]), season)
