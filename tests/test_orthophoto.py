"""S.3 and S.4 for one wall: what lies where in the world still lies there in the orthophoto."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from si3fp.config import AlignConfig, FacadeBoxConfig, OrthoConfig
from si3fp.errors import FacadeError
from si3fp.geometry.equirect import directions_from_pixels, world_from_pano_rotation
from si3fp.geometry.rigid import Rigid3
from si3fp.model import OrthoImage, Panorama
from si3fp.ortho import rectify
from si3fp.streetview.align import Registration
from si3fp.streetview.cluster import Wall
from si3fp.streetview.drift import without_drift
from si3fp.streetview.orthophoto import (
    FacadeOrthophoto,
    align_views,
    crop_to_facade,
    moved_views,
)
from si3fp.streetview.views import ViewPlan, plan_views
from si3fp.streetview.wall_fit import WallFit

WORLD_FROM_WALL = Rigid3(
    world_from_pano_rotation(63.0, 0.0, 0.0) @ np.diag([1.0, -1.0, -1.0]),
    np.array([-20.0, 35.0, 412.0]),
)
"""A wall that is looked at towards the bearing of 63 degrees."""

WIDTH_M, HEIGHT_M = 9.0, 6.0
MARKER_M = (5.0, 3.4, 6.2, 4.8)
"""The red window: left, bottom, right, top in metres from the wall's lower left corner."""

PICTURE_M_PER_PX = 0.02
MARGIN_M = 4.0
"""The painted plane goes on beyond the wall: sky above, pavement below, neighbours beside."""


def painted_plane() -> NDArray[np.uint8]:
    rng = np.random.default_rng(0)
    height, width = (
        round((size + 2 * MARGIN_M) / PICTURE_M_PER_PX) for size in (HEIGHT_M, WIDTH_M)
    )
    picture = np.full((height, width, 3), (205, 215, 235), np.float32)

    def box(x0, y0, x1, y1, colour):
        top, bottom = (round((HEIGHT_M + MARGIN_M - y) / PICTURE_M_PER_PX) for y in (y1, y0))
        left, right = (round((x + MARGIN_M) / PICTURE_M_PER_PX) for x in (x0, x1))
        picture[top:bottom, left:right] = colour

    box(-MARGIN_M, 0, -0.8, 4.5, (150, 120, 100))
    box(WIDTH_M + 0.8, 0, WIDTH_M + MARGIN_M, 5.0, (120, 130, 110))
    box(0, 0, WIDTH_M, HEIGHT_M, (178, 164, 130))
    box(-MARGIN_M, -MARGIN_M, WIDTH_M + MARGIN_M, 0, (105, 104, 102))
    for x in (0.8, 2.9, 5.0, 7.1):
        for y in (0.9, 3.4):
            box(x, y, x + 1.2, y + 1.4, (236, 234, 228))
            box(x + 0.1, y + 0.1, x + 0.55, y + 1.3, rng.uniform(40, 90, 3))
            box(x + 0.65, y + 0.1, x + 1.1, y + 1.3, rng.uniform(40, 90, 3))
    box(*MARKER_M, (220, 20, 20))
    for sigma in (1.0, 3.0, 9.0):
        stains = cv2.GaussianBlur(
            rng.normal(size=(height, width)).astype(np.float32), (0, 0), sigma
        )
        picture += 6 * (stains / stains.std())[..., None]
    return np.clip(cv2.GaussianBlur(picture, (0, 0), 1.0), 0, 255).astype(np.uint8)


def seen_from(picture: NDArray[np.uint8], panorama: Panorama, width_px: int) -> NDArray[np.uint8]:
    """The panorama of the painted plane, black elsewhere."""
    xy = np.stack(np.meshgrid(np.arange(width_px) + 0.5, np.arange(width_px // 2) + 0.5), axis=-1)
    wall_from_pano = WORLD_FROM_WALL.inverse() @ panorama.pano_from_world.inverse()
    rays = wall_from_pano.rotate(directions_from_pixels(xy, width_px, width_px // 2))
    slope = np.where(rays[..., 2] < -0.05, rays[..., 2], np.nan)
    reach = -wall_from_pano.translation[2] / slope
    points = wall_from_pano.translation + reach[..., None] * rays
    column = (points[..., 0] + MARGIN_M) / PICTURE_M_PER_PX - 0.5
    row = (HEIGHT_M + MARGIN_M - points[..., 1]) / PICTURE_M_PER_PX - 0.5
    maps = [np.nan_to_num(axis, nan=-9.0).astype(np.float32) for axis in (column, row)]
    return np.asarray(cv2.remap(picture, *maps, cv2.INTER_LINEAR), np.uint8)


def panorama_at(name: str, place_m, *, heading=50.0, error_m=(0.0, 0.0, 0.0)) -> Panorama:
    place = WORLD_FROM_WALL.apply(np.asarray(place_m) + error_m)
    return Panorama(name, "", Rigid3(world_from_pano_rotation(heading, 1.0, -1.0), place).inverse())


PLACES = {"a": (2.0, 2.0, 7.0), "b": (4.5, 2.0, 7.5), "c": (7.0, 2.0, 7.0)}
ERRORS = {"a": (0.15, 0.05, 0.1), "b": (-0.2, -0.04, -0.1), "c": (0.05, -0.01, 0.0)}

Made = tuple[ViewPlan, list[OrthoImage], dict[str, Panorama]]


def views_of_the_wall(believed: dict[str, Panorama]) -> Made:
    """Views by poses as they are believed, of images as they were taken."""
    wall = Wall(
        "house-0", "house", 0, WORLD_FROM_WALL, WIDTH_M, HEIGHT_M, (), tuple(PLACES),
        WallFit(0, 0, 0.0, 0.0, None, None, "footprint", 0.5, 1.0),
    )  # fmt: skip
    config = OrthoConfig()
    plan = plan_views(wall, believed, dict.fromkeys(PLACES, 2048), config)
    picture = painted_plane()
    views = []
    for name in plan.panorama_ids:
        image = seen_from(picture, panorama_at(name, PLACES[name]), 2048)
        seen = np.ones(image.shape[:2], np.bool_)
        views.append(rectify(believed[name], image, seen, plan.grid, config))
    return plan, views, believed


@pytest.fixture(scope="module")
def exact() -> Made:
    return views_of_the_wall({name: panorama_at(name, place) for name, place in PLACES.items()})


@pytest.fixture(scope="module")
def noisy() -> Made:
    return views_of_the_wall(
        {name: panorama_at(name, place, error_m=ERRORS[name]) for name, place in PLACES.items()}
    )


def aligned(made: Made) -> tuple[tuple[Registration, ...], tuple[OrthoImage, ...]]:
    """Registrations of the wall alone, and the moved views."""
    plan, views, panoramas = made
    facade = align_views(plan, views, panoramas, AlignConfig())
    (registrations,) = without_drift([facade], panoramas, AlignConfig())
    return registrations, moved_views(plan, views, registrations)


def orthophoto_of(made: Made) -> FacadeOrthophoto:
    plan, _, panoramas = made
    _, moved = aligned(made)
    rng = np.random.default_rng(0)
    return crop_to_facade(plan, moved, panoramas, FacadeBoxConfig(), rng)


def marker_in_world(image: OrthoImage, grid) -> NDArray[np.float64]:
    """Lower left and upper right corner of the red window in the world, from its pixels."""
    red = image.rgb[..., 0].astype(int) - image.rgb[..., 1:].max(axis=-1)
    rows, columns = np.nonzero((red > 90) & image.valid)
    return grid.world_from_pixels(
        [[columns.min(), rows.max() + 1], [columns.max() + 1, rows.min()]]
    )


MARKER_IN_WORLD = WORLD_FROM_WALL.apply(
    [[MARKER_M[0], MARKER_M[1], 0.0], [MARKER_M[2], MARKER_M[3], 0.0]]
)


def test_a_window_is_where_it_is_in_the_world_after_cropping(exact):
    made = orthophoto_of(exact)
    grid = made.views.grid
    # One pixel of the grid, and the common drift that noise in three views leaves.
    for image in (made.fused, *made.views.views):
        gap_m = np.linalg.norm(marker_in_world(image, grid) - MARKER_IN_WORLD, axis=-1)
        assert gap_m.max() < 0.04, image.source


def test_the_crop_is_the_facade(exact):
    made = orthophoto_of(exact)
    corner = WORLD_FROM_WALL.inverse().apply(made.views.grid.world_from_facade.translation)
    # The wall's corner; the box is found to a pixel of 0.05 m of the line raster.
    np.testing.assert_allclose(corner, [0.0, 0.0, 0.0], atol=0.12)
    assert made.views.grid.width_m == pytest.approx(WIDTH_M, abs=0.2)
    assert made.views.grid.height_m == pytest.approx(HEIGHT_M, abs=0.2)
    shape = (made.views.grid.height_px, made.views.grid.width_px)
    assert made.fused.valid.shape == shape
    assert made.fused.valid.all()
    assert made.fused.seen_by is not None
    assert made.fused.seen_by.max() == 3
    assert [view.source for view in made.views.views] == list(exact[0].panorama_ids)


def test_cameras_come_in_the_frame_of_the_cropped_facade(exact):
    made = orthophoto_of(exact)
    corner = WORLD_FROM_WALL.inverse().apply(made.views.grid.world_from_facade.translation)
    assert set(made.cameras_in_facade) == set(PLACES)
    for name, place in PLACES.items():
        np.testing.assert_allclose(made.cameras_in_facade[name], place - corner, atol=1e-9)


def test_wrong_poses_are_registered_and_the_window_is_near_its_place(noisy):
    plan, _, _ = noisy
    registrations, moved = aligned(noisy)
    assert len(moved) == 3
    for registration in registrations:
        assert registration.used
        assert registration.residual_before_px is not None
        assert registration.residual_after_px is not None
        assert registration.residual_before_px > 3.0
        assert registration.residual_after_px < 1.5
    corners = np.array([marker_in_world(view, plan.grid) for view in moved])
    # Together to two pixels, and off by no more than the mean of the three pose errors.
    assert np.linalg.norm(corners - corners.mean(axis=0), axis=-1).max() < 2 * plan.grid.m_per_px
    assert np.linalg.norm(corners.mean(axis=0) - MARKER_IN_WORLD, axis=-1).max() < 0.12


def test_the_blend_of_registered_views_is_sharp(noisy):
    """The step at the red window's left side is as steep in the blend as in one view."""
    made = orthophoto_of(noisy)

    def steepest(image: OrthoImage) -> float:
        inner = image.rgb[40:-40, 40:-40, 0].astype(np.float64)
        return float(np.quantile(np.abs(np.diff(inner, axis=1)), 0.995))

    single = np.mean([steepest(view) for view in made.views.views])
    assert steepest(made.fused) > 0.75 * single


def test_no_view_is_an_error_that_counts_the_panoramas(exact):
    plan, _, panoramas = exact
    with pytest.raises(FacadeError, match="None of 3 panoramas"):
        align_views(plan, [], panoramas, AlignConfig())


def test_where_the_wall_goes_on_the_facade_ends_at_the_corner_of_the_map(exact: Made) -> None:
    plan, views, panoramas = exact
    terrace = replace(plan, wall=replace(plan.wall, goes_on=(True, False), width_m=WIDTH_M - 0.4))
    _, moved = aligned((terrace, views, panoramas))
    photo = crop_to_facade(terrace, moved, panoramas, FacadeBoxConfig(), np.random.default_rng(0))
    left = photo.views.grid.world_from_facade.translation
    corner = plan.wall.world_from_facade.translation
    assert np.hypot(*(left - corner)[:2]) < 0.02
    assert photo.box.evidence[0] == "footprint"
    assert any("goes on" in note for note in photo.box.notes)
