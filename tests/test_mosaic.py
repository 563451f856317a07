"""Photos rectified and blended on a facade whose every point has a known colour."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from si3fp.camera2d.choice import best_places, choose_photos
from si3fp.camera2d.facade_plane import FacadePlane
from si3fp.camera2d.mosaic import render_mosaic
from si3fp.camera2d.rectify import rectify_photo
from si3fp.camera2d.visibility import seen_from
from si3fp.config import MosaicConfig
from si3fp.errors import FacadeError, InputError
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Photo, SparsePoints

CONFIG = MosaicConfig()
WORLD_FROM_FACADE = Rigid3(
    np.array([[0.6, 0, 0.8], [0.8, 0, -0.6], [0, 1, 0]]), np.array([100.0, 50.0, 7.0])
)
WIDTH_M, HEIGHT_M = 12.0, 9.0
PLANE = FacadePlane("wall-0", None, None, WORLD_FROM_FACADE, WIDTH_M, HEIGHT_M)
NO_POINTS = SparsePoints(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0), ())


def wall_grid(m_per_px=0.05) -> FacadeGrid:
    return FacadeGrid.covering(WORLD_FROM_FACADE, WIDTH_M, HEIGHT_M, m_per_px)


def photo(x_m, y_m, z_m, *, at=(6.0, 4.5), roll_deg=0.0, focal_px=500.0, name="p") -> Photo:
    """A photo of 800 x 600 px taken from a place in the facade's frame towards a point on it."""
    camera = Pinhole(focal_px, 1.01 * focal_px, 405.0, 296.0, 800, 600)
    centre = np.array([x_m, y_m, z_m])
    forward = np.array([*at, 0.0]) - centre
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    level = np.stack([right, np.cross(forward, right), forward])
    roll = np.deg2rad(roll_deg)
    turn = np.array([[np.cos(roll), np.sin(roll), 0], [-np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
    cam_from_facade = Rigid3(turn @ level, -(turn @ level) @ centre)
    return Photo(name, camera, cam_from_facade @ WORLD_FROM_FACADE.inverse())


def smooth(x_m, y_m):
    """Three channels of waves of at least 2.5 m: linear interpolation errs below a grey level."""
    waves = [
        np.sin(2 * np.pi * x_m / 3.1) * np.cos(2 * np.pi * y_m / 4.3),
        np.cos(2 * np.pi * (x_m + 0.7 * y_m) / 2.9),
        np.sin(2 * np.pi * (x_m - y_m) / 5.3 + 1.0),
    ]
    return np.stack([128 + 90 * wave for wave in waves], axis=-1)


def picture(taken: Photo, paint=smooth, panels=()):
    """What it shows of the painted wall, and of white panels (x0, x1, y0, y1, z) before it."""
    camera = taken.camera
    pixels = np.meshgrid(np.arange(camera.width_px) + 0.5, np.arange(camera.height_px) + 0.5)
    facade_from_cam = (taken.cam_from_world @ WORLD_FROM_FACADE).inverse()
    rays = facade_from_cam.rotate(camera.unproject(np.stack(pixels, axis=-1)))
    centre = facade_from_cam.translation
    towards = rays[..., 2] < -1e-3

    def meeting(z_m):
        reach = (z_m - centre[2]) / np.where(towards, rays[..., 2], -1.0)
        return centre[:2] + reach[..., None] * rays[..., :2]

    wall = meeting(0.0)
    colours = np.where(towards[..., None], paint(wall[..., 0], wall[..., 1]), 0)
    for x0, x1, y0, y1, z in panels:
        x, y = np.moveaxis(meeting(z), -1, 0)
        hit = towards & (z < centre[2]) & (x > x0) & (x < x1) & (y > y0) & (y < y1)
        colours = np.where(hit[..., None], 250, colours)
    return (np.clip(colours, 0, 255) + 0.5).astype(np.uint8)


def painted(grid: FacadeGrid, paint=smooth):
    pixels = np.meshgrid(np.arange(grid.width_px) + 0.5, np.arange(grid.height_px) + 0.5)
    metres = grid.facade_from_pixels(np.stack(pixels, axis=-1))
    return paint(metres[..., 0], metres[..., 1])


def exact_pixels(taken: Photo, grid: FacadeGrid):
    pixels = np.meshgrid(np.arange(grid.width_px) + 0.5, np.arange(grid.height_px) + 0.5)
    world = grid.world_from_pixels(np.stack(pixels, axis=-1))
    return taken.camera.project(taken.cam_from_world.apply(world))


POSES = {
    "frontal": photo(6.0, 4.5, 12.0),
    "from below": photo(5.0, 1.6, 8.0),
    "oblique": photo(16.0, 1.6, 7.0),
    "portrait": photo(7.0, 2.0, 9.0, roll_deg=90.0),
    "rolled": photo(2.0, 2.0, 9.0, roll_deg=20.0),
}


@pytest.mark.parametrize("taken", POSES.values(), ids=list(POSES))
def test_a_wall_is_recovered_to_two_grey_levels(taken):
    grid = wall_grid()
    view = rectify_photo(taken, picture(taken), grid, CONFIG)
    assert view.source == "p"
    assert view.valid.mean() > 0.5
    error = np.abs(view.rgb - painted(grid))[view.valid]
    # Half a level of rounding twice, and the waves' curvature over a source pixel.
    assert error.max() < 2.5
    assert error.mean() < 0.5


def test_a_shift_of_half_a_pixel_would_show():
    grid = wall_grid()
    view = rectify_photo(POSES["frontal"], picture(POSES["frontal"]), grid, CONFIG)
    moved = painted(grid, lambda x, y: smooth(x + 0.025, y))
    assert np.abs(view.rgb - moved)[view.valid].max() > 4.0


def test_the_rim_of_the_photo_is_exact_and_nothing_beyond_it_is_shown():
    taken, grid = photo(3.0, 1.6, 9.0, at=(4.0, 2.5), focal_px=700.0), wall_grid(0.02)
    image = np.full((600, 800, 3), 200, np.uint8)
    view = rectify_photo(taken, image, grid, CONFIG)
    exact = exact_pixels(taken, grid)
    inside = ((exact >= 0.5) & (exact <= [799.5, 599.5])).all(axis=-1)
    np.testing.assert_array_equal(view.valid, inside)
    assert 0.1 < view.valid.mean() < 0.9
    assert (view.rgb[view.valid] == 200).all()
    assert not view.rgb[~view.valid].any()


def test_what_lies_behind_the_camera_or_the_wall_is_not_seen():
    grid = wall_grid()
    image = np.full((600, 800, 3), 200, np.uint8)
    away = photo(6.0, 4.5, 5.0, at=(40.0, 4.5))
    turned = dataclasses.replace(
        away,
        cam_from_world=Rigid3(np.diag([-1.0, 1.0, -1.0]), np.zeros(3)) @ away.cam_from_world,
    )
    behind = photo(6.0, 4.5, -8.0)
    for taken in (turned, behind):
        assert not rectify_photo(taken, image, grid, CONFIG).valid.any()


def test_the_obliqueness_limit_holds():
    taken, grid = photo(17.0, 4.5, 4.0), wall_grid()
    config = dataclasses.replace(CONFIG, max_obliqueness_deg=60.0)
    view = rectify_photo(taken, np.zeros((600, 800, 3), np.uint8), grid, config)
    x_m = (np.arange(grid.width_px) + 0.5) * grid.m_per_px
    beyond = np.hypot(17.0 - x_m, 0.0) > 4.0 * np.tan(np.deg2rad(60.0))
    assert not view.valid[:, beyond].any()
    assert view.valid.any()


def test_detail_finer_than_the_grid_becomes_its_mean():
    """A checkerboard of about 6 x 6 source pixels per grid pixel is grey, not a moire."""
    taken = photo(6.0, 4.5, 12.0, focal_px=360.0)
    image = np.indices((600, 800)).sum(axis=0) % 2 * np.uint8(255)
    image = np.repeat(image[..., None], 3, axis=-1).astype(np.uint8)
    view = rectify_photo(taken, image, wall_grid(0.2), CONFIG)
    assert np.abs(view.rgb[view.valid].astype(int) - 127).max() <= 2


@pytest.mark.parametrize("m_per_px", [0.05, 0.15, 0.4])
def test_averaging_down_keeps_places(m_per_px):
    """Photo pixels are 1.5 cm here; half a pixel of the coarsest grid off: 15 grey levels."""

    def long_waves(x_m, y_m):
        return smooth(x_m / 3, y_m / 3)

    taken, grid = photo(9.0, 2.0, 7.0, roll_deg=3.0), wall_grid(m_per_px)
    view = rectify_photo(taken, picture(taken, long_waves), grid, CONFIG)
    # The mean over an oblique averaged pixel is flatter than the wave.
    assert np.abs(view.rgb - painted(grid, long_waves))[view.valid].max() < 4.0


def test_a_photo_of_another_size_than_its_camera_is_an_error():
    with pytest.raises(InputError, match="400 x 300 px, its camera 800 x 600"):
        rectify_photo(POSES["frontal"], np.zeros((300, 400, 3), np.uint8), wall_grid(), CONFIG)


# Visibility


def lattice_metres(lattice):
    rows, columns = lattice.shape
    x = (np.arange(columns) + 0.5) / columns * WIDTH_M
    y = HEIGHT_M - (np.arange(rows) + 0.5) / rows * HEIGHT_M
    return np.meshgrid(x, y)


def standing(x_m, z0_m, z1_m, height_m=HEIGHT_M) -> FacadePlane:
    """A wall at right angles to the facade, from z0 to z1 before it, seen from the right."""
    rotation = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    frame = WORLD_FROM_FACADE @ Rigid3(rotation, np.array([x_m, 0.0, z1_m]))
    return FacadePlane("wall-1", None, None, frame, z1_m - z0_m, height_m)


def points_at(places, seen_by) -> SparsePoints:
    places = np.asarray(places, float)
    return SparsePoints(
        WORLD_FROM_FACADE.apply(places),
        np.zeros((len(places), 3), np.uint8),
        np.full(len(places), 0.5),
        (tuple(seen_by),) * len(places),
    )


@pytest.mark.parametrize("side", [1, -1])
def test_a_wall_in_between_hides_exactly_its_shadow(side):
    """A wall 2 to 4 m before the facade at x = 6, the camera 8 m before it, at x = 6 +- 3."""
    taken = photo(6.0 + 3.0 * side, 4.5, 8.0, focal_px=200.0)
    sight = seen_from(
        PLANE, wall_grid(), [taken], [PLANE, standing(6.0, 2.0, 4.0)], NO_POINTS, CONFIG
    )
    x, _ = lattice_metres(sight["p"])
    # The rays over its ends meet the facade 3 * 2 / 6 and 3 * 4 / 4 m beyond it.
    shadow = (side * (6.0 - x) > 1.0) & (side * (6.0 - x) < 3.0)
    np.testing.assert_array_equal(~sight["p"], shadow)


def test_a_low_wall_hides_only_what_lies_below_its_edge():
    taken = photo(9.0, 1.6, 8.0, focal_px=200.0)
    low = standing(6.0, 2.0, 4.0, height_m=1.0)
    sight = seen_from(PLANE, wall_grid(), [taken], [low], NO_POINTS, CONFIG)["p"]
    x, y = lattice_metres(sight)
    assert (~sight).any()
    # Over its near end the view falls from 1.6 to 1 m in 6 m, and meets the facade at 0.8 m.
    assert sight[(x < 3.0) | (x > 5.0) | (y > 0.8)].all()


def test_a_wall_found_twice_does_not_hide_itself():
    taken = photo(6.0, 4.5, 8.0, focal_px=200.0)
    twin = FacadePlane(
        "wall-1",
        None,
        None,
        WORLD_FROM_FACADE @ Rigid3(np.eye(3), np.array([-1.0, 0.0, 0.3])),
        14.0,
        9.0,
    )
    assert seen_from(PLANE, wall_grid(), [taken], [twin], NO_POINTS, CONFIG)["p"].all()


def bush(x_m, y_m, z_m, count=40):
    rng = np.random.default_rng(0)
    return rng.normal([x_m, y_m, z_m], 0.2, (count, 3))


def test_a_tree_hides_from_every_photo_what_lies_behind_it():
    """Its points are those of one photo; it stands there for the others, too."""
    left, right = photo(1.0, 1.6, 9.0, name="left"), photo(11.0, 1.6, 9.0, name="right")
    past = [photo(x, 4.5, 3.5, focal_px=250.0, name=f"{x:g}") for x in (2.0, 10.0)]
    taken = [left, right, *past, *[dataclasses.replace(p, id=p.id + "b") for p in past]]
    tree = points_at(bush(6.0, 3.0, 4.0), ["left"])
    sights = seen_from(PLANE, wall_grid(), taken, [], tree, CONFIG)
    without = seen_from(PLANE, wall_grid(), taken, [], NO_POINTS, CONFIG)
    x, y = lattice_metres(sights["left"])
    # The rays from (1, 1.6, 9) and (11, 1.6, 9) through (6, 3, 4) meet the wall at (10 | 2, 4.12).
    for name, at_m in (("left", 10.0), ("right", 2.0)):
        gap = np.hypot(x - at_m, y - 4.12)
        assert without[name][gap < 0.5].any()
        assert not sights[name][gap < 0.5].any()
        np.testing.assert_array_equal(sights[name][gap > 2.5], without[name][gap > 2.5])


def test_points_on_the_wall_overrule_a_few_before_it():
    taken = photo(6.0, 1.6, 9.0)
    on_wall = np.column_stack([np.tile([6.0, 4.0], (60, 1)), np.zeros(60)])
    mixed = points_at(np.concatenate([bush(6.0, 3.0, 4.0, 5), on_wall]), ["p"])
    without = seen_from(PLANE, wall_grid(), [taken], [], NO_POINTS, CONFIG)["p"]
    sight = seen_from(PLANE, wall_grid(), [taken], [], mixed, CONFIG)["p"]
    x, y = lattice_metres(sight)
    near = np.hypot(x - 6.0, y - 4.0) < 0.3
    assert sight[near].all()
    assert without[near].all()


def test_what_all_photos_show_before_the_wall_is_kept():
    """A balcony: where they cannot see past it, they see as many places as without it."""
    names = ["a", "b", "c"]
    taken = [photo(x, 1.6, 9.0, name=name) for x, name in zip((5.0, 6.0, 7.0), names, strict=True)]
    points = points_at(bush(6.0, 4.0, 1.2, 200), names)
    sights = seen_from(PLANE, wall_grid(), taken, [], points, CONFIG)
    without = seen_from(PLANE, wall_grid(), taken, [], NO_POINTS, CONFIG)
    enough, before = (np.sum(list(s.values()), axis=0) >= 2 for s in (sights, without))
    np.testing.assert_array_equal(enough, before)


def test_a_hedge_gives_way_to_two_photos_that_see_past_it():
    """From (6, 1.6, 9) it hides the wall at (6, 2.06); the others look past it from the sides."""
    ahead = photo(6.0, 1.6, 9.0, name="ahead")
    aside = [photo(x, 1.6, 6.0, name=f"{x:g}") for x in (0.5, 11.5)]
    hedge = points_at(bush(6.0, 2.0, 1.2), ["ahead"])
    x, y = lattice_metres(seen_from(PLANE, wall_grid(), [ahead], [], hedge, CONFIG)["ahead"])
    behind = np.hypot(x - 6.0, y - 2.06) < 0.3
    for others, hidden in ((aside[:1], False), (aside, True)):
        sights = seen_from(PLANE, wall_grid(), [ahead, *others], [], hedge, CONFIG)
        assert sights["ahead"][behind].any() != hidden
        assert all(sights[p.id][behind].all() for p in others)


# Choice


def ring(count):
    return [
        photo(x, 1.6, 9.0, at=(x, 3.0), focal_px=900.0, name=f"{i:03d}")
        for i, x in enumerate(np.linspace(0.0, WIDTH_M, count))
    ]


def test_the_first_photos_cover_the_facade():
    taken = ring(25)
    sights = seen_from(PLANE, wall_grid(), taken, [], NO_POINTS, CONFIG)
    chosen = choose_photos(taken, sights, wall_grid(), dataclasses.replace(CONFIG, max_views=4))
    together = np.any([sights[p.id] for p in chosen], axis=0)
    everything = np.any([sights[p.id] for p in taken], axis=0)
    assert len(chosen) == 4
    assert together.sum() > 0.9 * everything.sum()


@pytest.mark.parametrize("choose", [choose_photos, best_places])
def test_the_choice_does_not_depend_on_the_order_given(choose):
    taken = ring(25)
    sights = seen_from(PLANE, wall_grid(), taken, [], NO_POINTS, CONFIG)
    config = dataclasses.replace(CONFIG, max_views=8)
    forth = choose(taken, sights, wall_grid(), config)
    back = choose(taken[::-1], sights, wall_grid(), config)
    assert len(forth) == 8
    assert [str(getattr(p, "id", p)) for p in forth] == [str(getattr(p, "id", p)) for p in back]


@pytest.mark.parametrize("choose", [choose_photos, best_places])
def test_the_nearer_of_two_photos_comes_first(choose):
    near, far = photo(6.0, 4.5, 12.0, name="z"), photo(6.0, 4.5, 40.0, focal_px=600.0, name="a")
    sights = seen_from(PLANE, wall_grid(), [near, far], [], NO_POINTS, CONFIG)
    first = next(iter(choose([far, near], sights, wall_grid(0.01), CONFIG)))
    assert getattr(first, "id", first) == "z"


def test_places_belong_to_the_photos_that_look_straight_at_them():
    """Two stand for a place: those nearest to it."""
    row = (1.0, 3.07, 6.23, 9.0, 11.0)
    taken = [photo(x, 4.5, 9.0, at=(x, 4.5), name=f"{x:g}") for x in row]
    grid = wall_grid()
    sights = seen_from(PLANE, grid, taken, [], NO_POINTS, CONFIG)
    config = dataclasses.replace(CONFIG, photos_per_place=2)
    places = best_places(taken, sights, grid, config)
    assert (np.sum(list(places.values()), axis=0) == 2).all()
    x, _ = lattice_metres(sights["9"])
    for name, mine in places.items():
        gaps = np.sort([np.abs(x - float(other)) for other in places], axis=0)
        np.testing.assert_array_equal(mine, np.abs(x - float(name)) <= gaps[1] + 1e-9)


def test_a_photo_that_adds_nothing_is_left_out():
    taken = [photo(6.0, 4.5, 9.0, name=name) for name in "dacb"]
    taken.append(photo(6.0, 4.5, 12.0, name="farther"))
    grid = wall_grid(0.01)
    sights = seen_from(PLANE, grid, taken[:4], [], NO_POINTS, CONFIG)
    sights["farther"] = sights["a"]
    config = dataclasses.replace(CONFIG, photos_per_place=3)
    assert list(best_places(taken, sights, grid, config)) == ["a", "b", "c"]


# The whole


def album(panels=()):
    taken = [photo(x, 1.6, 9.0, name=f"{x:g}") for x in (2.0, 4.0, 6.0, 8.0, 10.0)]
    return taken, {p.id: picture(p, panels=panels) for p in taken}


def test_what_stands_before_the_wall_vanishes_from_the_blend():
    """A panel of 1 x 2 m, 3 m before the wall: in every photo it hides another part of it."""
    taken, images = album([(5.5, 6.5, 0.0, 2.0, 3.0)])
    grid = wall_grid()
    loaded = []

    def load(name):
        loaded.append(name)
        return images[name]

    rendering = render_mosaic(PLANE, grid, taken, load, [PLANE], NO_POINTS, CONFIG)
    fused = rendering.fused
    assert fused.source == "mosaic"
    assert sorted(loaded) == sorted(images)
    three = fused.seen_by >= 4
    assert three.mean() > 0.4
    assert np.abs(fused.rgb - painted(grid))[three].max() < 12
    assert np.abs(fused.rgb - painted(grid))[three].mean() < 1


def test_what_one_photo_alone_saw_is_masked_and_counted():
    taken, images = album()
    narrow = [
        dataclasses.replace(p, camera=dataclasses.replace(p.camera, width_px=100, cx_px=50.0))
        for p in taken
    ]
    grid = wall_grid()
    rendering = render_mosaic(
        PLANE, grid, narrow, lambda name: images[name][:, 355:455].copy(), [], NO_POINTS, CONFIG
    )
    fused = rendering.fused
    count = np.sum([view.valid for view in rendering.views.views], axis=0)
    # Counted on the lattice, so that a cell's rim may differ.
    assert (fused.seen_by == count).mean() > 0.95
    assert (fused.seen_by == 1).any()
    np.testing.assert_array_equal(fused.valid, (count >= 2) & (fused.seen_by >= 2))
    assert not fused.rgb[~fused.valid].any()


def test_cameras_are_given_in_the_frame_of_the_facade():
    taken, images = album()
    rendering = render_mosaic(PLANE, wall_grid(), taken, images.__getitem__, [], NO_POINTS, CONFIG)
    for p in taken:
        np.testing.assert_allclose(
            rendering.cameras_in_facade[p.id], [float(p.id), 1.6, 9.0], atol=1e-9
        )


def test_no_photo_of_the_facade_is_an_error_that_says_why():
    _, images = album()
    hidden = standing(6.0, 2.0, 4.0)
    behind = [photo(6.0, 4.5, -8.0)]
    with pytest.raises(FacadeError, match="None of 1 photos shows wall-0"):
        render_mosaic(PLANE, wall_grid(), behind, images.__getitem__, [hidden], NO_POINTS, CONFIG)


def test_rendering_twice_gives_the_same_bits():
    taken, images = album([(5.5, 6.5, 0.0, 2.0, 3.0)])
    first, second = (
        render_mosaic(PLANE, wall_grid(), taken, images.__getitem__, [], NO_POINTS, CONFIG).fused
        for _ in range(2)
    )
    np.testing.assert_array_equal(first.rgb, second.rgb)
