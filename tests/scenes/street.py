"""`make_street`: a small synthetic street with known windows, seen by noisy panoramas."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from tests.scenes import textures
from tests.scenes.layout import Layout, Size, build_surfaces, lay_out
from tests.scenes.render import Surface, render_panorama, surfaces_hit

from si3fp.geometry.equirect import world_from_pano_rotation
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Facade, Footprint, GeoOrigin, Image, Panorama, Planes, Window

POSITION_NOISE_M = 0.12
ROTATION_NOISE_DEG = 0.25
PLANE_NOISE_M = 0.05
PLANE_NOISE_DEG = 0.3
PLANE_MAP_PX = (512, 256)


@dataclass(frozen=True)
class PanoramaPose:
    """Place (3,) in the world and heading, pitch, roll in degrees."""

    place: NDArray[np.float64]
    heading_deg: float
    pitch_deg: float
    roll_deg: float

    @property
    def pano_from_world(self) -> Rigid3:
        """The pose as a transform."""
        rotation = world_from_pano_rotation(self.heading_deg, self.pitch_deg, self.roll_deg)
        return Rigid3(rotation, self.place).inverse()


@dataclass(frozen=True)
class Street:
    """A rendered street.

    Attributes
    ----------
    origin
        Origin of the world frame; the ground lies at world z = 0.
    footprints
        Outlines with all attributes; edge 0 of each is its street front.
    exact, noisy
        Panoramas with true poses and planes, and as a mapping vehicle would report them.
    exact_poses, noisy_poses
        The same poses as places and angles, by panorama id.
    images
        RGB (W / 2, W, 3) by panorama id.
    truth
        Facades with their true windows: street fronts, and the gables, which have none.
    """

    origin: GeoOrigin
    footprints: list[Footprint]
    exact: list[Panorama]
    noisy: list[Panorama]
    exact_poses: dict[str, PanoramaPose]
    noisy_poses: dict[str, PanoramaPose]
    images: dict[str, Image]
    truth: list[Facade]

    def load(self, panorama_id: str) -> Image:
        """The image of a panorama, as a `LoadImage`."""
        return self.images[panorama_id]


def make_street(seed: int = 1, size: Size = "tiny", width_px: int | None = None) -> Street:
    """A street: ``tiny`` (1 house, 3 panoramas), ``small`` (1, 5) or ``street`` (3, 9)."""
    rng = np.random.default_rng([seed, 7])
    width_px = width_px or {"tiny": 1024, "small": 3072, "street": 3072}[size]
    layout = lay_out(size, rng)
    surfaces = build_surfaces(layout, rng)
    turn_deg = float(rng.uniform(-25, 25))
    world_from_street = turn(layout, turn_deg)
    surfaces = [moved(surface, world_from_street) for surface in surfaces]
    sky = textures.sky(min(2048, 2 * width_px), rng)
    mirrored = textures.mirrored_world(sky, rng)

    exact, noisy, images = [], [], {}
    exact_poses, noisy_poses = {}, {}
    count = len(layout.cameras)
    for index, place in enumerate(layout.cameras):
        name = f"pano-{index:02d}"
        wander = rng.normal(0, 1, 3) * [0.3, 0.35, 0.03]
        pose = PanoramaPose(
            world_from_street.apply(place + wander),
            float(rng.uniform(0, 360)),
            float(rng.normal(0, 0.8)),
            float(rng.normal(0, 0.8)),
        )
        world_from_pano = pose.pano_from_world.inverse()
        links = tuple(f"pano-{i:02d}" for i in (index - 1, index + 1) if 0 <= i < count)
        panorama = Panorama(name, "2024-06", pose.pano_from_world, links=links)
        panorama = _with_planes(panorama, surfaces, world_from_pano)
        noisy_pose = _disturbed(pose, rng)
        picture = render_panorama(surfaces, world_from_pano, width_px, sky, mirrored)
        exact.append(panorama)
        noisy.append(_disturbed_panorama(panorama, noisy_pose, rng))
        exact_poses[name], noisy_poses[name] = pose, noisy_pose
        images[name] = photographed(picture, rng)
    origin = GeoOrigin(57.6886, 11.9776, 14.0)
    return Street(
        origin,
        footprints_of(layout, world_from_street),
        exact,
        noisy,
        exact_poses,
        noisy_poses,
        images,
        truth_of(layout, world_from_street),
    )


def turn(layout: Layout, turn_deg: float) -> Rigid3:
    """The street's frame turned about up, its middle moved to the origin."""
    angle = np.deg2rad(turn_deg)
    rotation = np.array(
        [[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]]
    )
    middle = np.array([*layout.cameras[:, :2].mean(axis=0), 0.0])
    return Rigid3(rotation, -rotation @ middle)


def moved(surface: Surface, world_from_street: Rigid3) -> Surface:
    """The surface in the world."""
    return replace(
        surface,
        corner=world_from_street.apply(surface.corner),
        axes=world_from_street.rotate(surface.axes),
        levels=[],
        levels_behind=[],
    )


def _with_planes(panorama: Panorama, surfaces: list[Surface], world_from_pano: Rigid3) -> Panorama:
    """The panorama with the planes that it sees; normals point from the camera into the surface."""
    nearest, _ = surfaces_hit(surfaces, world_from_pano, PLANE_MAP_PX[0])
    plane_index = np.full(nearest.shape, -1, np.int32)
    normals, offsets = [], []
    for i, surface in enumerate(surfaces):
        seen = nearest == i
        if not surface.plane or not seen.any():
            continue
        normal = -surface.axes[2]
        plane_index[seen] = len(normals)
        normals.append(normal)
        offsets.append(float(normal @ surface.corner))
    planes = Planes(np.array(normals), np.array(offsets))
    return replace(
        panorama,
        planes_in_pano=planes.transformed(panorama.pano_from_world),
        plane_index=plane_index,
    )


def _disturbed(pose: PanoramaPose, rng: np.random.Generator) -> PanoramaPose:
    """The pose as reported: 0.10-0.15 m and 0.2-0.3 degrees off."""
    shift = rng.normal(0, 1, 3) * [1, 1, 0.6]
    shift *= rng.uniform(0.10, 0.15) / np.linalg.norm(shift)
    angles = rng.normal(0, 1, 3)
    angles *= rng.uniform(0.2, 0.3) / np.linalg.norm(angles)
    return PanoramaPose(
        pose.place + shift,
        float((pose.heading_deg + angles[0]) % 360),
        pose.pitch_deg + float(angles[1]),
        pose.roll_deg + float(angles[2]),
    )


def _disturbed_panorama(
    panorama: Panorama, pose: PanoramaPose, rng: np.random.Generator
) -> Panorama:
    planes = panorama.planes_in_pano
    if planes is None:
        return replace(panorama, pano_from_world=pose.pano_from_world)
    tilt = rng.normal(0, np.deg2rad(PLANE_NOISE_DEG) / np.sqrt(2), planes.normals.shape)
    normals = planes.normals + tilt
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = planes.offsets_m + rng.normal(0, PLANE_NOISE_M, len(planes))
    return replace(
        panorama,
        pano_from_world=pose.pano_from_world,
        planes_in_pano=Planes(normals, np.maximum(offsets, 0.0)),
    )


def photographed(picture: NDArray[np.float32], rng: np.random.Generator) -> Image:
    """The picture after lens, exposure, white balance, tone curve and sensor noise."""
    blurred = cv2.GaussianBlur(picture, (0, 0), 0.55, borderType=cv2.BORDER_REPLICATE)
    balance = rng.uniform(0.88, 1.10) * rng.uniform(0.98, 1.02, 3)
    values = np.clip(blurred * balance / 255, 0, None)
    toned = np.where(values > 0.8, 0.8 + 0.2 * np.tanh((values - 0.8) / 0.2), values) * 255
    toned += rng.standard_normal(toned.shape[:2], dtype=np.float32)[..., None] * 0.8
    return np.clip(toned, 0, 255).astype(np.uint8)


def footprints_of(layout: Layout, world_from_street: Rigid3) -> list[Footprint]:
    """The outlines of the houses in the world."""
    found = []
    for house in layout.houses:
        outline = np.column_stack([house.corners, np.zeros(4)])
        found.append(
            Footprint(
                house.id,
                world_from_street.apply(outline)[:, :2],
                ground_m=0.0,
                height_m=house.height_m,
                storeys=house.storeys,
                year=house.year,
                use="apartments",
            )
        )
    return found


def truth_of(layout: Layout, world_from_street: Rigid3) -> list[Facade]:
    """Street fronts with their windows, and gables."""
    found = []
    for house in layout.houses:
        for edge in (0, 1, 3):
            start, end = house.corners[edge], house.corners[(edge + 1) % 4]
            along = (end - start) / np.linalg.norm(end - start)
            axes = np.array(
                [[along[0], along[1], 0.0], [0.0, 0.0, 1.0], [along[1], -along[0], 0.0]]
            )
            pose = world_from_street @ Rigid3(axes.T, np.array([*start, 0.0]))
            windows = tuple(
                Window(o.x_m, o.y_m, o.width_m, o.height_m, recess_m=house.look.recess_m)
                for o in (house.openings if edge == 0 else ())
                if o.kind == "window"
            )
            width = float(np.linalg.norm(end - start))
            found.append(Facade(f"{house.id}-{edge}", pose, width, house.height_m, windows))
    return found
