"""Algorithm 3: which panoramas are resampled, how finely, and what they then show."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from si3fp.config import ClusterConfig, OrthoConfig
from si3fp.geometry.equirect import world_from_pano_rotation
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Footprint, OrthoImage, Panorama
from si3fp.streetview.cluster import Wall
from si3fp.streetview.views import enough_seen, make_view, moved_to, plan_views
from si3fp.streetview.wall_fit import WallFit

CONFIG = OrthoConfig()
SOUTH_WALL = Rigid3(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), np.array([40.0, 9.0, 3.0]))
WIDTH_M, HEIGHT_M = 12.0, 8.0


def wall_seen_by(panoramas: dict[str, Panorama]) -> Wall:
    return Wall(
        "house-2",
        "house",
        2,
        SOUTH_WALL,
        WIDTH_M,
        HEIGHT_M,
        tuple((name, 0) for name in panoramas),
        tuple(panoramas),
        WallFit(1, 1, 0.0, 0.0, None, None, "planes", 0.2, 0.5),
    )


def cameras(**places_m: tuple[float, float, float]) -> dict[str, Panorama]:
    """Level panoramas at places in the wall's frame: right, up, out."""
    rotation = world_from_pano_rotation(0.0, 0.0, 0.0)
    return {
        name: Panorama(name, "", Rigid3(rotation, SOUTH_WALL.apply(place)).inverse())
        for name, place in places_m.items()
    }


def plan(panoramas: dict[str, Panorama], width_px: int | dict[str, int] = 8192, config=CONFIG):
    widths = width_px if isinstance(width_px, dict) else dict.fromkeys(panoramas, width_px)
    return plan_views(wall_seen_by(panoramas), panoramas, widths, config)


def test_the_grid_is_the_wall_with_a_margin():
    panoramas = cameras(a=(6, 2.5, 8), b=(3, 2.5, 8), c=(9, 2.5, 8))
    made = plan(panoramas)
    grid, margin_m = made.grid, made.margin_m
    assert margin_m == CONFIG.margin_m
    assert grid.m_per_px == CONFIG.m_per_px
    # The wall's lower left corner lies at (margin, margin), all of the wall is on the grid.
    corner = grid.world_from_facade.apply([margin_m, margin_m, 0.0])
    np.testing.assert_allclose(corner, SOUTH_WALL.translation, atol=1e-9)
    assert grid.width_m == pytest.approx(WIDTH_M + 2 * margin_m, abs=grid.m_per_px)
    assert grid.height_m >= HEIGHT_M + 2 * margin_m - 1e-9
    np.testing.assert_array_equal(grid.world_from_facade.rotation, SOUTH_WALL.rotation)


def test_the_grid_reaches_high_where_the_eaves_are_unknown():
    panoramas = cameras(a=(6, 2.5, 8))
    wall = dataclasses.replace(wall_seen_by(panoramas), height_is_assumed=True)
    grid = plan_views(wall, panoramas, {"a": 8192}, CONFIG).grid
    assert grid.height_m - CONFIG.margin_m > 25  # an usual block of eight storeys


def test_the_best_panorama_comes_first():
    panoramas = cameras(far=(6, 2.5, 20), near=(6, 2.5, 6), middle=(6, 2.5, 12))
    assert plan(panoramas).panorama_ids == ("near", "middle", "far")


def test_a_sharper_image_beats_a_nearer_one():
    panoramas = cameras(near=(6, 2.5, 8), sharp=(6, 2.5, 12))
    assert plan(panoramas, {"near": 2048, "sharp": 8192}).panorama_ids == ("sharp", "near")


def test_equal_panoramas_come_by_name():
    panoramas = cameras(b=(6, 2.5, 8), a=(6, 2.5, 8), c=(6, 2.5, 8))
    assert plan(panoramas).panorama_ids == ("a", "b", "c")


def test_the_grid_is_coarser_where_the_images_are():
    """2048 pixels at 10 m: 31 mm straight ahead; the third best of three decides."""
    panoramas = cameras(a=(6, 2.5, 10), b=(6, 2.5, 10), c=(6, 2.5, 14))
    m_per_px = plan(panoramas, 2048).grid.m_per_px
    straight_ahead = 2 * np.pi * 14 / 2048
    assert straight_ahead < m_per_px < 1.2 * straight_ahead
    assert m_per_px == round(m_per_px, 3)
    assert plan(panoramas, 8192).grid.m_per_px == CONFIG.m_per_px


def test_one_blurred_panorama_of_many_does_not_make_the_grid_coarse():
    panoramas = cameras(a=(6, 2.5, 8), b=(5, 2.5, 8), c=(7, 2.5, 8), far=(6, 2.5, 55))
    made = plan(panoramas)
    assert made.grid.m_per_px == CONFIG.m_per_px
    assert made.panorama_ids[-1] == "far"


def test_panoramas_that_see_the_wall_too_obliquely_or_from_behind_are_left_out():
    panoramas = cameras(
        good=(6, 2.5, 8),
        behind=(6, 2.5, -8),
        # 60 m along the wall, 8 m in front: 80 degrees to the normal everywhere.
        oblique=(60, 2.5, 8),
    )
    assert plan(panoramas).panorama_ids == ("good",)


def test_the_share_of_the_wall_that_must_be_seen_is_a_setting():
    """At 1 m, 72 degrees reach 3.1 m on both sides and up: a seventh of the grid."""
    panoramas = cameras(close=(6, 2.5, 1.0))
    assert plan(panoramas).panorama_ids == ("close",)
    strict = dataclasses.replace(CONFIG, min_seen=0.5)
    assert plan(panoramas, config=strict).panorama_ids == ()


def test_no_more_views_than_asked_for():
    panoramas = cameras(**{f"p{i}": (i, 2.5, 15 - i) for i in range(7)})
    few = dataclasses.replace(CONFIG, max_views=3)
    assert plan(panoramas, config=few).panorama_ids == plan(panoramas).panorama_ids[:3]
    assert len(plan(panoramas).panorama_ids) == 7


def test_a_wall_that_nobody_sees_still_has_a_grid():
    made = plan(cameras(behind=(6, 2.5, -8)))
    assert made.panorama_ids == ()
    assert made.grid.m_per_px == CONFIG.m_per_px


def test_what_another_building_hides_is_not_valid():
    """A tower 2 m wide, halfway to the camera, hides 4 m of the wall."""
    panoramas = cameras(a=(6, 2.5, 12))
    made = plan(panoramas)
    image = np.full((512, 1024, 3), 200, np.uint8)

    def valid_columns_m(*footprints: Footprint) -> NDArray[np.float64]:
        view = make_view(
            made, panoramas["a"], image, np.ones((512, 1024), np.bool_), footprints, CONFIG,
            ClusterConfig(),
        )  # fmt: skip
        columns = np.nonzero(view.valid.all(axis=0))[0]
        return (columns + 0.5) * made.grid.m_per_px - made.margin_m

    def block(height_m: float) -> Footprint:
        corners = [[5, 6], [7, 6], [7, 5], [5, 5]]  # right, out
        outline = [SOUTH_WALL.apply([x, 0, z])[:2] for x, z in corners]
        return Footprint("other", np.array(outline), ground_m=3.0, height_m=height_m)

    # The mask is made on a lattice of 0.2 m.
    tower = valid_columns_m(block(30.0))
    hidden = tower[np.diff(tower, prepend=tower[0]) > 0.5]
    assert len(hidden) == 1
    assert hidden[0] == pytest.approx(8.0, abs=0.25)
    assert tower[tower < 6].max() == pytest.approx(4.0, abs=0.25)
    everywhere = valid_columns_m()
    assert everywhere.min() == pytest.approx(-CONFIG.margin_m, abs=0.05)
    assert len(tower) == pytest.approx(len(everywhere) - 4.0 / made.grid.m_per_px, abs=15)


def painted(seed: int, share: float) -> OrthoImage:
    rng = np.random.default_rng(seed)
    rgb: NDArray[np.uint8] = rng.integers(0, 256, (40, 50, 3), dtype=np.uint8)
    valid = np.zeros((40, 50), np.bool_)
    valid[:, : round(50 * share)] = True
    return OrthoImage(f"v{seed}", rgb, valid)


def test_views_with_too_little_content_are_left_out():
    views = [painted(0, 1.0), painted(1, 0.02), painted(2, 0.06), painted(3, 0.0)]
    assert [v.source for v in enough_seen(views, CONFIG)] == ["v0", "v2"]


def test_a_part_of_a_view_keeps_its_pixels():
    view = painted(0, 0.5)
    part = moved_to(view, slice(5, 25), slice(10, 45))
    assert part.source == "v0"
    np.testing.assert_array_equal(part.rgb, view.rgb[5:25, 10:45])
    np.testing.assert_array_equal(part.valid, view.valid[5:25, 10:45])
