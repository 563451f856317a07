"""A small wall with a box in front and a niche is learned from rendered photos."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from si3fp.camera2d.radiance import RadianceField
from si3fp.camera2d.radiance.rays import pack_photos
from si3fp.camera2d.radiance.training import Trainer
from si3fp.config import RadianceConfig
from si3fp.errors import FacadeError, InputError
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Photo

WIDTH_M, HEIGHT_M, M_PER_PX = 2.4, 1.6, 0.04
BOX = (0.4, 1.0, 0.4, 1.2, 0.6)  # left, right, bottom, top, metres in front
NICHE = (1.5, 2.1, 0.4, 1.2, -0.2)
CAMERA = Pinhole(75.0, 75.0, 48.0, 32.0, 96, 64)
CONFIG = replace(
    RadianceConfig(), m_per_px=M_PER_PX, samples_per_px=400.0, batch_samples=4096, budget_s=600.0
)


@cache
def texture(seed):
    """(H, W, 3) smooth noise at 1 cm per pixel."""
    noise = np.random.default_rng(seed).normal(size=(240, 320, 3))
    noise = cv2.GaussianBlur(noise, (0, 0), 7)
    return 0.5 + 0.2 * noise / noise.std()


def colour(seed, x, y):
    picture = texture(seed)
    row = np.clip(((y + 0.3) * 100).astype(int), 0, picture.shape[0] - 1)
    column = np.clip(((x + 0.3) * 100).astype(int), 0, picture.shape[1] - 1)
    return np.clip(picture[row, column], 0, 1)


def world_from_facade():
    """A wall that looks north-east, not along an axis of the world."""
    angle = np.radians(35.0)
    x = np.array([np.cos(angle), np.sin(angle), 0.0])
    y = np.array([0.0, 0.0, 1.0])
    return Rigid3(np.stack([x, y, np.cross(x, y)], axis=1), np.array([12.0, -7.0, 3.0]))


def trace(origin, direction):
    """Colour (..., 3) and depth in front of the plane of rays in frame facade."""
    shape = direction.shape[:-1]
    image, depth = np.zeros((*shape, 3)), np.full(shape, np.nan)
    nearest = np.full(shape, np.inf)

    def meet(axis, place, ranges, seed):
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (place - origin[..., axis]) / direction[..., axis]
        t = np.where(np.isfinite(t), t, -1.0)
        point = origin + t[..., None] * direction
        hit = (t > 0) & (t < nearest)
        for other, (low, high) in ranges.items():
            hit &= (point[..., other] >= low) & (point[..., other] <= high)
        across = [a for a in range(3) if a != axis]
        image[hit] = colour(seed, point[hit][:, across[0]], point[hit][:, across[1]])
        depth[hit] = point[hit][:, 2]
        nearest[hit] = t[hit]

    wide = {0: (-9, 9), 1: (-9, 9)}
    for number, (left, right, bottom, top, z) in enumerate((BOX, NICHE)):
        sides = {0: (left, right), 1: (bottom, top), 2: (min(z, 0), max(z, 0))}
        meet(2, z, {0: sides[0], 1: sides[1]}, 10 * number + 1)
        for axis, places in ((0, (left, right)), (1, (bottom, top))):
            for place in places:
                meet(axis, place, {a: r for a, r in sides.items() if a != axis}, 10 * number + 2)
    # The wall last, with a hole where the niche is.
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -origin[..., 2] / direction[..., 2]
    point = origin + t[..., None] * direction
    hole = (
        (point[..., 0] > NICHE[0])
        & (point[..., 0] < NICHE[1])
        & (point[..., 1] > NICHE[2])
        & (point[..., 1] < NICHE[3])
    )
    before = nearest.copy()
    nearest[hole] = 0.0
    meet(2, 0.0, wide, 99)
    nearest[hole] = before[hole]
    return image, depth


def photo_at(name, centre, target):
    forward = np.subtract(target, centre) / np.linalg.norm(np.subtract(target, centre))
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    cam_from_facade = Rigid3(rotation, -rotation @ np.asarray(centre))
    return Photo(name, CAMERA, cam_from_facade @ world_from_facade().inverse())


def picture_of(photo):
    facade_from_cam = (photo.cam_from_world @ world_from_facade()).inverse()
    x, y = np.meshgrid(np.arange(CAMERA.width_px) + 0.5, np.arange(CAMERA.height_px) + 0.5)
    rays = facade_from_cam.rotate(CAMERA.unproject(np.stack([x, y], axis=-1)))
    image, _ = trace(facade_from_cam.translation, rays)
    return np.round(255 * image).astype(np.uint8)


@cache
def scene():
    photos = [
        photo_at(f"{i}{j}", (x, y, 2.6 + 0.2 * ((i + j) % 2)), (0.6 * x + 0.48, 0.8, 0.0))
        for i, x in enumerate([-0.6, 0.3, 1.2, 2.1, 3.0])
        for j, y in enumerate([0.1, 0.8, 1.5])
    ]
    return photos, {photo.id: picture_of(photo) for photo in photos}


def fit(config=CONFIG, photos=None, points=None, seed=0, **options):
    given, pictures = scene()
    return RadianceField.fit(
        given if photos is None else photos,
        pictures.__getitem__,
        world_from_facade(),
        WIDTH_M,
        HEIGHT_M,
        np.zeros((0, 3)) if points is None else points,
        config,
        np.random.default_rng(seed),
        **options,
    )


@cache
def fitted():
    return fit()


GRID = FacadeGrid.covering(world_from_facade(), WIDTH_M, HEIGHT_M, M_PER_PX)


@cache
def truth():
    """Colour and depth at the pixel centres, and whether a pixel is away from every step."""
    x, y = np.meshgrid(np.arange(GRID.width_px) + 0.5, np.arange(GRID.height_px) + 0.5)
    foot = GRID.facade_from_pixels(np.stack([x, y], axis=-1))
    origin = np.concatenate([foot, np.full((*x.shape, 1), 1.5)], axis=-1)
    image, depth = trace(origin, np.broadcast_to([0.0, 0.0, -1.0], origin.shape))
    kernel = np.ones((5, 5), np.uint8)
    flat = cv2.dilate(depth, kernel) - cv2.erode(depth, kernel) < 0.01
    return image, depth, flat


def test_orthophoto_and_depth_of_a_small_wall():
    rendering = fitted().render_ortho(GRID, 1.5, 0.4)
    image, depth, flat = truth()
    psnr = -10 * np.log10(np.mean((rendering.rgb / 255.0 - image)[flat] ** 2))
    assert psnr > 24
    off = np.abs(rendering.depth_m - depth)
    for place in (depth > 0.3, depth < -0.1, np.abs(depth) < 0.01):
        # One cell is 4 cm.
        assert np.nanmedian(off[place & flat]) < 0.04
    assert (rendering.opacity[flat] > 0.9).mean() > 0.95
    report = fitted().report
    assert report.stopped == "samples"
    assert report.held_out_id not in report.photos
    assert report.held_out_psnr_db > 20


def test_near_and_far_bounds_cut():
    field = fitted()
    _, depth, flat = truth()
    cut = field.render_ortho(GRID, 0.3, 0.4)
    box = (depth > 0.3) & flat
    assert np.nanmax(cut.depth_m) <= 0.3
    shallow = field.render_ortho(GRID, 1.5, 0.1)
    niche = (depth < -0.1) & flat
    assert (shallow.opacity[niche] < 0.5).mean() > 0.8
    assert np.isnan(shallow.depth_m[shallow.opacity < 0.5]).all()
    assert (shallow.depth_m[box] > 0.3).mean() > 0.9


def test_a_grid_elsewhere_on_the_plane_sees_the_same():
    whole = fitted().render_ortho(GRID, 1.5, 0.4)
    part = fitted().render_ortho(GRID.cropped(10, 5, 40, 30), 1.5, 0.4)
    np.testing.assert_allclose(part.opacity, whole.opacity[5:30, 10:40], atol=0.02)
    assert np.abs(part.rgb.astype(int) - whole.rgb[5:30, 10:40]).mean() < 1


def test_coverage_knows_what_the_box_hides():
    photos, _ = scene()
    rendering = fitted().render_ortho(GRID, 1.5, 0.4)
    seen = fitted().coverage(photos, GRID, rendering.depth_m, step_m=0.1)
    assert set(seen) == {photo.id for photo in photos}
    assert seen["01"].shape == (16, 24)
    # Cameras at the far left and right; the wall right of the box, at half its height.
    row, right_of_box, left_of_box = 8, 11, 2
    assert not seen["01"][row, right_of_box]
    assert seen["31"][row, right_of_box]
    assert seen["01"][row, left_of_box]
    assert not seen["41"][row, left_of_box]
    assert seen["21"][row, 18]


def test_same_seed_same_field_for_any_number_of_threads():
    short = replace(CONFIG, samples_per_px=20.0)
    fields = [fit(replace(short, threads=n)).field for n in (1, 2, 1)]
    for other in fields[1:]:
        np.testing.assert_array_equal(fields[0].table, other.table)
        np.testing.assert_array_equal(fields[0].hidden, other.hidden)
        np.testing.assert_array_equal(fields[0].occupied, other.occupied)
    assert not np.array_equal(fields[0].table, fit(short, seed=1).field.table)


def test_points_in_front_of_the_slab_open_its_cells():
    points = world_from_facade().apply([[1.0, 0.8, 2.2]])
    config = replace(CONFIG, samples_per_px=1.0)
    front = fit(config).layout.region_first[1]
    assert not fit(config).field.occupied[:front].any()
    assert fit(config, points=points).field.occupied[:front].any()


def test_interrupting_returns_the_field_so_far():
    def stop(name, done, total):
        raise KeyboardInterrupt

    report = fit(replace(CONFIG, samples_per_px=5000.0), progress=stop).report
    assert report.stopped == "interrupted"
    assert report.steps >= 1


def test_time_budget_ends_the_training():
    report = fit(replace(CONFIG, samples_per_px=1e6, budget_s=0.2)).report
    assert report.stopped == "time"
    assert report.seconds < 5


def test_progress_counts_up_to_the_budget():
    calls = []
    fit(replace(CONFIG, samples_per_px=60.0), progress=lambda *call: calls.append(call))
    done = [call[1] for call in calls]
    assert done == sorted(done)
    assert calls[-1][1] == calls[-1][2]


def test_a_field_that_became_empty_is_an_error_and_no_endless_training(monkeypatch):
    step = Trainer.step

    def nothing_visited(trainer, pool, fraction):
        step(trainer, pool, fraction)
        trainer.samples_done = 0

    monkeypatch.setattr(Trainer, "step", nothing_visited)
    with pytest.raises(FacadeError, match="has become empty"):
        fit()


def test_photos_that_see_nothing_are_named():
    away = photo_at("away", (1.0, 0.8, 3.0), (1.0, 0.8, 9.0))
    behind = photo_at("behind", (1.0, 0.8, -3.0), (1.0, 0.8, 0.0))
    with pytest.raises(FacadeError, match=r"0 of 2 photos see the wall of 2\.4 x 1\.6 m"):
        fit(photos=[away, behind])


def test_points_that_are_not_finite_are_refused():
    with pytest.raises(InputError, match="1 of 2 points"):
        fit(points=np.array([[0.0, 0, 0], [np.nan, 0, 0]]))


def test_a_picture_of_another_size_is_refused():
    photos, pictures = scene()
    with pytest.raises(InputError, match="its camera says"):
        pack_photos(
            photos,
            lambda name: pictures[name][:-1],
            world_from_facade(),
            WIDTH_M,
            HEIGHT_M,
            CONFIG,
        )


def test_fine_photos_are_averaged_down_and_coarse_ones_kept():
    photos, pictures = scene()
    fine = replace(CONFIG, m_per_px=0.08)
    rectangle = (world_from_facade(), WIDTH_M, HEIGHT_M)
    coarse = pack_photos(photos, pictures.__getitem__, *rectangle, fine)
    kept = pack_photos(photos, pictures.__getitem__, *rectangle, replace(CONFIG, m_per_px=0.01))
    assert len(coarse.photos.pixels) < 0.35 * len(kept.photos.pixels)
    assert kept.photos.width.max() <= CAMERA.width_px
    capped = pack_photos(
        photos, pictures.__getitem__, *rectangle, replace(CONFIG, m_per_px=0.01, photos_mib=0.1)
    )
    assert capped.photos.pixels.nbytes < 0.11 * 2**20


def test_rays_pass_through_pixel_centres():
    photos, pictures = scene()
    packed = pack_photos(
        photos,
        pictures.__getitem__,
        world_from_facade(),
        WIDTH_M,
        HEIGHT_M,
        replace(CONFIG, m_per_px=0.01),
    )
    index = packed.ids.index("20")
    matrix, centre = packed.photos.direction[index], packed.photos.centre[index]
    photo = next(p for p in photos if p.id == "20")
    width = packed.photos.width[index]
    for column, row in ((0, 0), (width // 2, 20)):
        direction = matrix @ np.array([column + 0.5, row + 0.5, 1.0])
        point = world_from_facade().apply(centre + 3.0 * direction)
        pixel = CAMERA.project(photo.cam_from_world.apply(point))
        shown = pictures["20"][int(pixel[1]), int(pixel[0])]
        at = packed.photos.first[index] + row * width + column
        np.testing.assert_allclose(pixel % 1.0, 0.5, atol=1e-3)
        np.testing.assert_array_equal(shown, packed.photos.pixels[at])


def test_training_ends_early_when_the_held_out_photo_gets_no_better():
    photos, pictures = scene()
    grey = {name: np.full_like(picture, 128) for name, picture in pictures.items()}
    report = RadianceField.fit(
        photos,
        grey.__getitem__,
        world_from_facade(),
        WIDTH_M,
        HEIGHT_M,
        np.zeros((0, 3)),
        replace(CONFIG, samples_per_px=200.0, converged_db=50.0),
        np.random.default_rng(0),
    ).report
    assert report.stopped == "converged"
    # A third of the budget went by until the third check; the falling rates take as much again.
    budget = 200.0 * GRID.width_px * GRID.height_px
    assert 0.5 * budget < report.samples < 0.9 * budget
