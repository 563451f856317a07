"""The estate's renderer against radiance and depth that can be computed."""

import dataclasses

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from benchmarks.estate.capture.cameras import Equirect, LensCamera, Pose
from benchmarks.estate.capture.lens import Distortion
from benchmarks.estate.parts import Material, Mesh, Parts
from benchmarks.estate.plan import Light
from benchmarks.estate.rendering.light import (
    SkyMap,
    level_irradiance,
    sky_illuminance,
    sky_map,
)
from benchmarks.estate.rendering.renderer import Renderer
from benchmarks.estate.rendering.variant import mitsuba
from benchmarks.estate.sun import direction_of, sun_position_deg

from si3fp.errors import MissingDependencyError
from si3fp.geometry.enu import GeoOrigin
from si3fp.geometry.pinhole import Pinhole

GOTHENBURG = GeoOrigin(57.7, 11.97, 0.0)
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def mi():
    try:
        return mitsuba()
    except MissingDependencyError as error:
        pytest.skip(str(error))


@dataclasses.dataclass
class Level:
    """Parallel rays along ``direction`` from a grid of 1 m pixels around ``centre``."""

    centre: tuple[float, float, float]
    direction: tuple[float, float, float]
    width_px: int = 8
    height_px: int = 6
    pixel_m: float = 1.0
    seen: np.ndarray | None = None

    def rays(self, pixels):
        forward = np.asarray(self.direction) / np.linalg.norm(self.direction)
        side = UP if abs(forward[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
        right = np.cross(forward, side)
        right /= np.linalg.norm(right)
        down = np.cross(forward, right)
        x = (pixels[:, :1] - self.width_px / 2) * self.pixel_m
        y = (pixels[:, 1:] - self.height_px / 2) * self.pixel_m
        return self.centre + x * right + y * down, np.broadcast_to(forward, (len(pixels), 3))


def quad(corner, u, v, material="wall"):
    a, u, v = (np.asarray(value, np.float32) for value in (corner, u, v))
    return Mesh(
        material,
        np.stack([a, a + u, a + u + v, a + v]),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32),
    )


def sky_of(radiance, sun=None, sun_rgb=(0.0, 0.0, 0.0), size=64):
    rgb = np.broadcast_to(np.float32(radiance), (size, 2 * size, 3))
    return SkyMap(rgb, UP if sun is None else np.asarray(sun), np.asarray(sun_rgb))


def renderer(meshes, sky, **materials):
    return Renderer(Parts(list(meshes), materials), sky, GOTHENBURG)


GROUND = quad((-500, -500, 0), (1000, 0, 0), (0, 1000, 0))
DOWN = Level((0, 0, 10), (0, 0, -1))


@pytest.mark.usefixtures("mi")
class TestPictures:
    def test_depth_of_a_slanted_plane_is_exact_at_the_middle_of_each_pixel(self):
        slope = quad((-500, -500, -500), (1000, 0, 1000), (0, 1000, 0))  # z = x
        found = renderer([slope], sky_of(0.0), wall=Material()).render(DOWN, 1, 0, denoise=False)
        x = np.arange(8) + 0.5 - 4
        assert np.allclose(found.depth_m, np.broadcast_to(10 - x, (6, 8)), atol=1e-4)

    def test_nothing_there_is_infinitely_far_and_shows_the_sky(self):
        found = renderer([GROUND], sky_of(0.7), wall=Material()).render(
            Level((0, 0, 10), (0, 1, 0.2)), 2, 0, denoise=False
        )
        assert np.isinf(found.depth_m).all()
        assert np.allclose(found.radiance, 0.7, atol=1e-5)

    def test_only_what_is_worth_it_is_rendered(self):
        seen = np.zeros((6, 8), bool)
        seen[2:4, 3:6] = True
        camera = dataclasses.replace(DOWN, seen=seen)
        found = renderer([GROUND], sky_of(0.5), wall=Material()).render(camera, 4, 0)
        assert np.array_equal(found.radiance.sum(axis=2) > 0, seen)
        assert np.array_equal(np.isfinite(found.depth_m), seen)

    @pytest.mark.parametrize("kind", ["lens", "panorama"])
    def test_edges_lie_where_the_camera_says(self, kind):
        """Shares of white in the pixels of an edge, against rays through 256 places of each."""
        down = Pose((0.3, 0.2, 5.0), 20.0, -70.0, 5.0).world_from_cam
        lens = Distortion(0.3, -0.1, 0.01, -0.02)
        camera = {
            "lens": LensCamera(down, Pinhole(20.0, 20.0, 12.0, 8.0, 24, 16), lens),
            "panorama": Equirect(down, 256),
        }[kind]
        white = quad((0, -500, 0.001), (500, 0, 0), (0, 1000, 0), "white")
        materials = {"wall": Material(rgb=(0.0,) * 3), "white": Material(rgb=(1.0,) * 3)}
        scene = renderer([GROUND, white], sky_of(0.0, sun=UP, sun_rgb=(np.pi,) * 3), **materials)
        found = scene.render(camera, 256, 0, denoise=False).radiance[..., 0]
        places = (np.arange(16) + 0.5) / 16
        y, x = (np.arange(n)[:, None] + places for n in (camera.height_px, camera.width_px))
        grid = np.stack(np.meshgrid(x.ravel(), y.ravel()), axis=-1)
        origins, directions = camera.rays(grid.reshape(-1, 2))
        way = np.where(directions[:, 2] < -0.05, -origins[:, 2] / directions[:, 2], np.nan)
        east = np.where(np.isfinite(way), origins[:, 0] + way * directions[:, 0] > 0, np.nan)
        share = east.reshape(camera.height_px, 16, camera.width_px, 16).mean(axis=(1, 3))
        assert np.count_nonzero((share > 0.1) & (share < 0.9)) > 10
        assert np.nanmax(np.abs(found - share)) < 0.03

    def test_white_furnace(self):
        """White ground under an even sky is as bright as the sky."""
        white = Material(rgb=(1.0, 1.0, 1.0))
        found = renderer([GROUND], sky_of(0.25), wall=white).render(DOWN, 16, 0, denoise=False)
        assert np.allclose(found.radiance, 0.25, rtol=1e-3)

    def test_the_sun_on_level_ground_follows_the_cosine(self):
        """Radiance = albedo / pi x irradiance x sine of the elevation."""
        for elevation_deg in (20.0, 50.0):
            sky = sky_of(0.0, direction_of(200.0, elevation_deg), (1.0, 0.8, 0.6))
            found = renderer([GROUND], sky, wall=Material(rgb=(1, 1, 1))).render(
                DOWN, 16, 0, denoise=False
            )
            wanted = np.array([1.0, 0.8, 0.6]) * np.sin(np.deg2rad(elevation_deg)) / np.pi
            assert np.allclose(found.radiance.mean(axis=(0, 1)), wanted, rtol=2e-3)

    def test_a_colour_is_linear_light_of_its_srgb_value(self):
        """sRGB 0.5 is 0.2140 of white, from a plain colour and from a texture alike."""
        plain = Material(rgb=(0.5, 0.5, 0.5))
        texture = Material(texture=np.full((4, 4, 3), 128, np.uint8))
        for material, wanted in ((plain, 0.21404), (texture, 0.21586)):
            found = renderer([GROUND], sky_of(1.0), wall=material).render(DOWN, 8, 0, denoise=False)
            assert np.allclose(found.radiance, wanted, rtol=4e-3)

    def test_row_0_of_a_texture_is_on_top(self):
        texture = np.zeros((2, 2, 3), np.uint8)
        texture[0, :, 0], texture[1, :, 1], texture[:, 1, 2] = 255, 255, 255
        wall = quad((-4, 0, -3), (8, 0, 0), (0, 0, 6))  # seen from the south: u is east
        found = renderer([wall], sky_of(1.0), wall=Material(texture=texture)).render(
            Level((0, -5, 0), (0, 1, 0)), 8, 0, denoise=False
        )
        red, green, blue = np.moveaxis(found.radiance, 2, 0)
        assert red[1, 2] > 0.8 and green[1, 2] < 0.2
        assert green[4, 2] > 0.8 and red[4, 2] < 0.2
        assert blue[1, 5] > 0.8 and blue[1, 2] < 0.2

    def test_the_shadow_falls_away_from_the_sun(self):
        wall = quad((-50, 0, 0), (100, 0, 0), (0, 0, 3), "other")
        sky = sky_of(0.0, direction_of(180.0, 45.0), (1.0, 1.0, 1.0))
        scene = renderer([GROUND, wall], sky, wall=Material(), other=Material(rgb=(0, 0, 0)))
        found = scene.render(Level((0, 0, 10), (0, 0, -1), pixel_m=1.5), 4, 0, denoise=False)
        north, south = found.radiance[1].mean(), found.radiance[4].mean()  # rows from the north
        assert north == 0
        assert south == pytest.approx(0.21404 * np.sqrt(0.5) / np.pi, rel=5e-3)

    def test_a_pane_mirrors_a_seventh_and_lets_the_rest_through(self):
        """Four faces of Fresnel reflectance 0.04: 4 x 0.04 / (1 + 3 x 0.04) = 0.1429."""
        pane = quad((-50, 0, -50), (100, 0, 0), (0, 0, 100), "pane")
        black = quad((-50, 3, -50), (100, 0, 0), (0, 0, 100))
        scene = renderer(
            [pane, black], sky_of(1.0), pane=Material("glass"), wall=Material(rgb=(0, 0, 0))
        )
        found = scene.render(Level((0, -5, 0), (0, 1, 0)), 2, 0, denoise=False)
        assert np.allclose(found.radiance, 0.16 / 1.12, rtol=1e-3)
        assert np.allclose(found.depth_m, 5.0, atol=1e-4)

    def test_a_bulging_pane_mirrors_by_its_shading_normals(self):
        """Normals 10 degrees up mirror a level ray to 20 degrees: there the sky is bright."""
        tilt = np.deg2rad(10.0)
        pane = dataclasses.replace(
            quad((-50, 0, -50), (100, 0, 0), (0, 0, 100), "pane"),
            normals=np.tile(np.float32([0, -np.cos(tilt), np.sin(tilt)]), (4, 1)),
        )
        black = quad((-50, 3, -50), (100, 0, 0), (0, 0, 100))
        sky = np.zeros((64, 1, 3))
        sky[:28] = 1.0  # down to an elevation of 11 degrees
        scene = renderer(
            [pane, black], sky_of(sky), pane=Material("glass"), wall=Material(rgb=(0, 0, 0))
        )
        found = scene.render(Level((0, -5, 0), (0, 1, 0)), 2, 0, denoise=False)
        assert np.allclose(found.radiance, 0.16 / 1.12, rtol=1e-3)

    def test_sun_shines_through_glass(self):
        roof = quad((-50, -50, 2), (100, 0, 0), (0, 100, 0), "pane")
        sky = sky_of(0.0, UP, (1.0, 1.0, 1.0))
        scene = renderer([GROUND, roof], sky, pane=Material("glass"), wall=Material(rgb=(1, 1, 1)))
        camera = Level((0, 0, 1), (0, 0, -1))
        found = scene.render(camera, 8, 0, denoise=False, max_depth=1)
        assert np.allclose(found.radiance, 1 / np.pi, rtol=1e-3)

    @pytest.mark.parametrize("kind", ["plastic", "metal"])
    def test_no_coat_gives_back_more_than_it_gets(self, kind):
        material = Material(kind, rgb=(1.0, 1.0, 1.0), roughness=0.3)
        found = renderer([GROUND], sky_of(0.25), wall=material).render(
            Level((0, 0, 10), (0, 0.7, -0.7), 16, 16), 64, 0, denoise=False
        )
        assert 0.15 < found.radiance.mean() < 0.26

    def test_light_comes_through_a_leaf_from_behind(self):
        """Sun at right angles behind it: colour x share of green x irradiance / pi."""
        sky = sky_of(0.0, -UP, (1.0, 1.0, 1.0))
        leaf = Material("leaf", rgb=(0.5, 0.5, 0.5))
        found = renderer([GROUND], sky, wall=leaf).render(DOWN, 4, 0, denoise=False)
        assert np.allclose(found.radiance[..., 1], 0.21404 * 0.85 / np.pi, rtol=2e-3)

    def test_visible_stops_before_the_target(self):
        wall = quad((-5, 0, 0), (10, 0, 0), (0, 0, 5))
        pane = quad((-5, 4, 0), (10, 0, 0), (0, 0, 5), "pane")
        scene = renderer([wall, pane], sky_of(0.0), wall=Material(), pane=Material("glass"))
        here = np.array([[0.0, -3, 1]] * 3 + [[0, 2, 1]])
        there = np.array([[0.0, 0, 1], [0, 0.5, 1], [0, 0.5, 9], [0, 6, 1]])
        assert scene.visible(here, there).tolist() == [True, False, True, False]

    def test_a_pixel_does_not_depend_on_its_batch(self, monkeypatch):
        scene = renderer([GROUND], sky_of(0.3), wall=Material("plastic"))
        whole = scene.render(DOWN, 4, 7, denoise=False).radiance
        monkeypatch.setattr("benchmarks.estate.rendering.renderer.BATCH_RAYS", 100)
        assert np.allclose(scene.render(DOWN, 4, 7, denoise=False).radiance, whole, atol=1e-6)
        assert not np.allclose(scene.render(DOWN, 4, 8, denoise=False).radiance, whole, atol=1e-6)

    def test_the_denoiser_keeps_texture_and_takes_noise(self):
        pytest.importorskip("oidn")
        rng = np.random.default_rng(0)
        texture = rng.integers(40, 220, (48, 64, 1)).repeat(3, axis=2).astype(np.uint8)
        floor = quad((-32, -24, 0), (64, 0, 0), (0, 48, 0))
        walls = [
            quad((-33, y, 0), (66, 0, 0), (0, 0, 30), "grey") for y in (-25.0, 25.0)
        ]  # a yard: most light comes from the walls
        scene = renderer(
            [floor, *walls], sky_of(0.5), wall=Material(texture=texture), grey=Material()
        )
        camera = Level((0, 0, 20), (0, 0, -1), 64, 48)
        truth = scene.render(camera, 256, 1, denoise=False).radiance
        noisy = scene.render(camera, 4, 0, denoise=False).radiance
        clean = scene.render(camera, 4, 0).radiance
        assert np.std(clean - truth) < 0.5 * np.std(noisy - truth)


def test_the_sky_gives_the_illuminance_of_its_cloud(mi):
    for cloud in (0.0, 0.3, 1.0):
        light = Light("2024-06-12", 11.0, cloud)
        sky = sky_map(mi, light, GOTHENBURG, 64)
        found = level_irradiance(sky.rgb[:32]) @ [0.2126, 0.7152, 0.0722]
        assert found == pytest.approx(sky_illuminance(sky.sun_direction[2], cloud), rel=1e-3)
        assert (sky.sun_rgb.max() > 0) == (cloud < 0.8)
        assert np.isfinite(sky.rgb).all() and sky.rgb.min() >= 0


def test_the_clear_sky_is_brightest_around_the_sun(mi):
    sky = sky_map(mi, Light("2024-06-12", 6.0, 0.0), GOTHENBURG, 64)
    azimuth_deg, elevation_deg = sun_position_deg("2024-06-12", 6.0, GOTHENBURG)
    # By hand: declination 23.15, hour angle -78.0 degrees.
    assert azimuth_deg == pytest.approx(86.9, abs=0.3)
    assert elevation_deg == pytest.approx(25.75, abs=0.3)
    row, column = np.unravel_index(sky.rgb[:30].sum(axis=2).argmax(), (30, 128))
    assert (column + 0.5) * 360 / 128 == pytest.approx(azimuth_deg, abs=6)
    assert 90 - (row + 0.5) * 180 / 64 == pytest.approx(elevation_deg, abs=25)
