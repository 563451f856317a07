"""The synthetic facade: photos, true orthophoto and visibility agree with each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.accuracy.radiance.layouts import BRICK
from benchmarks.accuracy.radiance.renderer import Renderer, Truth
from benchmarks.accuracy.radiance.scene import VARIANTS, Scene, scene
from benchmarks.accuracy.radiance.scores import Rendering, edge_errors_cm, score
from benchmarks.accuracy.radiance.solids import Ball, Box, Opening

from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Photo

M_PER_PX = 0.02
WINDOW = Opening(0.5, 1.6, 1.0, 2.4, 0.2, 0.07, 2, 1, (235, 235, 230), 50.0, 0.0, (0.0, 0.0))
PARAPET = Box((2.2, 0.6, 1.14), (3.8, 1.6, 1.2), (118, 132, 128), of_facade=True)
BUSH = Ball((1.0, 0.9, 3.0), 0.3, (72, 104, 48))


def looking_at_the_wall(index: int, x: float, y: float, distance: float) -> Photo:
    camera = Pinhole(300.0, 300.0, 150.0, 120.0, 300, 240)
    rotation = np.diag([1.0, -1.0, -1.0])
    pose = Rigid3(rotation, -rotation @ np.array([x, y, distance]))
    return Photo(f"{index}", camera, pose @ small_world().inverse())


def small_world() -> Rigid3:
    return Rigid3(
        np.array([[0.8, 0.0, 0.6], [0.6, 0.0, -0.8], [0.0, 1.0, 0.0]]), np.array([3.0, -7.0, 2.0])
    )


@pytest.fixture(scope="module")
def small() -> Scene:
    places = [(0.6, 1.6, 5.0), (2.0, 1.6, 5.0), (3.4, 1.5, 5.0), (1.3, 1.7, 4.0), (2.7, 1.7, 4.0)]
    photos = tuple(looking_at_the_wall(k, *place) for k, place in enumerate(places))
    return Scene(
        name="small-0",
        seed=0,
        width_m=4.0,
        height_m=3.0,
        look=BRICK,
        openings=(WINDOW,),
        boxes=(PARAPET,),
        balls=(BUSH,),
        shadows=(),
        world_from_facade=small_world(),
        photos=photos,
    )


@pytest.fixture(scope="module")
def renderer(small: Scene) -> Renderer:
    return Renderer(small)


@pytest.fixture(scope="module")
def truth(renderer: Renderer) -> Truth:
    return renderer.truth(M_PER_PX)


def test_depth_is_that_of_the_solids(truth: Truth) -> None:
    def depth_at(x_m: float, y_m: float) -> float:
        column, row = truth.grid.pixels_from_facade([x_m, y_m]).astype(int)
        return float(truth.depth_m[row, column])

    assert depth_at(0.25, 2.0) == pytest.approx(0.0, abs=1e-5)
    assert depth_at(0.53, 2.0) == pytest.approx(-WINDOW.recess, abs=1e-5)
    assert depth_at(0.80, 2.0) == pytest.approx(-WINDOW.glass_depth_m, abs=1e-5)
    assert depth_at(3.0, 1.0) == pytest.approx(1.2, abs=1e-5)


def test_photo_shows_the_truth_where_it_sees(
    small: Scene, renderer: Renderer, truth: Truth
) -> None:
    photo = small.photos[1]
    rgb = renderer.photo(photo, np.random.default_rng(0)).astype(float)
    row, column = np.nonzero(truth.sees[1] & (np.abs(truth.depth_m) < 0.01))
    plane = truth.grid.world_from_pixels(np.stack([column + 0.5, row + 0.5], axis=-1))
    x, y = photo.camera.project(photo.cam_from_world.apply(plane)).astype(int).T
    difference = np.abs(rgb[y, x] - truth.rgb[row, column]).mean(axis=1)
    # Nearest pixels of bricks with joints: half of them within the noise of bricks.
    assert np.median(difference) < 12
    moved = np.abs(rgb[y, (x + 40) % 300] - truth.rgb[row, column]).mean(axis=1)
    assert np.median(moved) > 1.5 * np.median(difference)


def test_visibility_is_that_of_the_segment_to_the_camera(small: Scene, truth: Truth) -> None:
    rng = np.random.default_rng(1)
    rows, columns = truth.depth_m.shape
    row, column = rng.integers(0, rows, 500), rng.integers(0, columns, 500)
    xy = truth.grid.facade_from_pixels(np.stack([column + 0.5, row + 0.5], axis=-1))
    points = np.concatenate([xy, truth.depth_m[row, column][:, None]], axis=1)
    for index, photo in enumerate(small.photos):
        centre = small.world_from_facade.inverse().apply(photo.centre_in_world)
        # Steps of about 4 mm; the first ones are the surface itself.
        way = np.linspace(0.001, 1, 1500)[None, :, None]
        on_way = points[:, None] + way * (centre - points)[:, None]
        hidden = inside_box(on_way, PARAPET).any(axis=1)
        hidden |= (np.linalg.norm(on_way - BUSH.centre, axis=-1) < BUSH.radius).any(axis=1)
        hidden |= inside_wall(on_way).any(axis=1)
        pixels = photo.camera.project(
            photo.cam_from_world.apply(small.world_from_facade.apply(points))
        )
        framed = ((pixels > 0.5) & (pixels < np.array([299.5, 239.5]))).all(axis=1)
        expected = framed & ~hidden
        agree = expected == truth.sees[index][row, column]
        assert agree.mean() > 0.99, f"photo {photo.id}"
        assert 0.1 < expected.mean() < 0.95


def inside_box(points: np.ndarray, box: Box) -> np.ndarray:
    return ((points > box.low) & (points < box.high)).all(axis=-1)


def inside_wall(points: np.ndarray) -> np.ndarray:
    x, y, z = np.moveaxis(points, -1, 0)
    window = (x > WINDOW.left) & (x < WINDOW.right) & (y > WINDOW.bottom) & (y < WINDOW.top)
    # Frame bars stand out by less than the steps; only their recess counts.
    return (z < -1e-4) & (z > -WINDOW.recess) & ~window


def test_the_truth_scores_perfectly(truth: Truth) -> None:
    scores = score(Rendering(truth.rgb, truth.depth_m), truth, [WINDOW])
    assert scores.psnr_db > 90
    assert (scores.edges, scores.edges_missed) == (4, 0)
    assert scores.edge_cm < 0.3  # a seventh of a pixel
    assert scores.recess_cm[0] < 0.01
    assert scores.balcony_iou == 1.0


def test_a_moved_picture_has_moved_edges(truth: Truth) -> None:
    still = edge_errors_cm(truth.rgb, truth, [WINDOW])
    moved = edge_errors_cm(np.roll(truth.rgb, 2, axis=1), truth, [WINDOW])
    left, right, bottom, top = moved - still
    assert left == pytest.approx(-4.0, abs=0.3)
    assert right == pytest.approx(4.0, abs=0.3)
    assert [bottom, top] == pytest.approx([0.0, 0.0], abs=0.3)


def test_an_even_picture_misses_every_edge(truth: Truth) -> None:
    grey = np.full_like(truth.rgb, 128)
    scores = score(Rendering(grey), truth, [WINDOW])
    assert scores.edges_missed == scores.edges == 4
    assert np.isnan(scores.edge_cm)
    assert np.isnan(scores.recess_cm[0])


def test_a_recess_is_measured_against_the_wall_around_it(truth: Truth) -> None:
    farther = Rendering(truth.rgb, truth.depth_m - np.float32(0.04))
    scores = score(farther, truth, [WINDOW])
    assert scores.wall_cm[0] == pytest.approx(4.0, abs=0.01)
    assert scores.recess_cm[0] < 0.01


def test_unknown_depth_counts_as_wrong(truth: Truth) -> None:
    depth_m = truth.depth_m.copy()
    depth_m[:, : depth_m.shape[1] // 2] = np.nan
    scores = score(Rendering(truth.rgb, depth_m), truth, [WINDOW])
    assert scores.wall_cm[1] == np.inf


@pytest.mark.parametrize(
    ("variant", "openings", "boxes"), [("tuned", 39, 32), ("held-out", 32, 24)]
)
def test_variants(variant: str, openings: int, boxes: int) -> None:
    full = scene(0, variant)
    assert len(full.openings) == openings
    assert sum(box.of_facade for box in full.boxes) == boxes + 1  # four a balcony, one cornice
    assert len(full.photos) == 48
    again, other = scene(0, variant), scene(1, variant)
    assert again.openings == full.openings
    assert np.array_equal(again.photos[7].centre_in_world, full.photos[7].centre_in_world)
    assert other.openings != full.openings
    inside = full.world_from_facade.inverse()
    distances = [inside.apply(photo.centre_in_world)[2] for photo in full.photos]
    # Obstacles stand between the photographers and the start of the true orthophoto.
    assert min(distances) > max(ball.centre[2] + ball.radius for ball in full.balls)
    assert min(ball.centre[2] - ball.radius for ball in full.balls) > 2.0


def test_variants_are_different_facades() -> None:
    first, second = (scene(0, variant) for variant in VARIANTS)
    assert first.look != second.look
    assert (first.width_m, first.height_m) != (second.width_m, second.height_m)


def test_a_photo_is_the_same_each_time(small: Scene, renderer: Renderer) -> None:
    photo = small.photos[0]
    first = renderer.photo(photo, np.random.default_rng(3))
    again = Renderer(replace(small)).photo(photo, np.random.default_rng(3))
    assert np.array_equal(first, again)
