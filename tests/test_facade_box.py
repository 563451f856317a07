"""S.4 on painted walls: windows on plaster, sky above the eaves, pavement below, neighbours."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from si3fp.config import FacadeBoxConfig
from si3fp.errors import FacadeError
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import OrthoImage
from si3fp.streetview.box_score import Priors, ViewScore
from si3fp.streetview.facade_box import PriorBox, find_facade_box
from si3fp.streetview.lines import Segments, find_lines, raster_size, relevant_positions

CONFIG = FacadeBoxConfig()
M_PER_PX = 0.025
GRID = FacadeGrid.covering(Rigid3(np.eye(3), np.zeros(3)), 18.0, 13.0, M_PER_PX)
LEFT_M, RIGHT_M, BOTTOM_M, TOP_M = 2.5, 15.2, 1.6, 10.3
TRUTH = PriorBox(LEFT_M, RIGHT_M, BOTTOM_M, TOP_M)
TOLERANCE_M = 0.12
"""Two raster pixels of 0.05 m and the spread of the detector's line positions."""


def paint(seed=0, *, shift_m=(0.0, 0.0), texture=6.0, roof=False, gutter=False) -> np.ndarray:
    """A wall of 12.7 x 8.7 m with 3 x 4 windows; all edges at the module's constants."""
    rng = np.random.default_rng(seed)
    picture = np.full((GRID.height_px, GRID.width_px, 3), (205, 215, 235), np.float32)

    def box(x0, y0, x1, y1, colour):
        (c0, r1), (c1, r0) = (
            GRID.pixels_from_facade(np.array([[x0, y0], [x1, y1]]) + shift_m).round().astype(int)
        )
        picture[max(r0, 0) : max(r1, 0), max(c0, 0) : max(c1, 0)] = colour

    box(-2, -3, 0, 9.1, (150, 120, 100))  # a neighbour beyond a gap
    box(16.6, -3, 20, 8.0, (120, 130, 110))
    if roof:
        box(LEFT_M, TOP_M, RIGHT_M, TOP_M + 2.2, (96, 70, 62))
        for n in range(8):
            box(LEFT_M, TOP_M + 0.27 * n, RIGHT_M, TOP_M + 0.27 * n + 0.03, (80, 58, 50))
    if gutter:
        box(LEFT_M - 0.3, TOP_M, RIGHT_M + 0.3, TOP_M + 0.3, (140, 136, 128))  # soffit from below
        box(LEFT_M - 0.3, TOP_M + 0.3, RIGHT_M + 0.3, TOP_M + 0.5, (70, 70, 72))
    box(LEFT_M, BOTTOM_M, RIGHT_M, TOP_M, (178, 164, 130))
    box(-3, -3, 20, BOTTOM_M, (105, 104, 102))
    for row in range(3):
        for column in range(4):
            x, y = LEFT_M + 1.3 + 3.0 * column, BOTTOM_M + 1.0 + 2.7 * row
            box(x, y, x + 1.3, y + 1.5, (236, 234, 228))
            box(x + 0.1, y + 0.1, x + 0.6, y + 1.4, (52, 60, 70))
            box(x + 0.7, y + 0.1, x + 1.2, y + 1.4, (48, 56, 66))
    picture += texture * rng.normal(size=(*picture.shape[:2], 1))
    picture = cv2.GaussianBlur(picture, (0, 0), 1.0) * rng.uniform(0.85, 1.1)
    return np.clip(picture, 0, 255).astype(np.uint8)


def view(seed=0, **how) -> OrthoImage:
    rgb = paint(seed, **how)
    return OrthoImage(f"view-{seed}", rgb, np.ones(rgb.shape[:2], np.bool_))


def views(count=4, **how) -> list[OrthoImage]:
    rng = np.random.default_rng(99)  # registered to a few centimetres
    return [view(seed, shift_m=rng.normal(0, 0.02, 2), **how) for seed in range(count)]


def found(images, prior, config=CONFIG, seed=0):
    return find_facade_box(images, GRID, prior, config, np.random.default_rng(seed))


def assert_is_the_wall(box):
    sides = [box.left_m, box.right_m, box.bottom_m, box.top_m]
    np.testing.assert_allclose(sides, [LEFT_M, RIGHT_M, BOTTOM_M, TOP_M], atol=TOLERANCE_M)


def test_the_box_is_the_wall_and_says_that_the_images_told():
    box = found(views(), TRUTH)
    assert_is_the_wall(box)
    assert box.evidence == ("images",) * 4
    assert max(box.sigma_m) <= 0.1
    assert min(box.relevant_lines) >= 5
    assert box.notes == ()


def test_the_box_needs_no_prior():
    assert_is_the_wall(found(views(), PriorBox()))


def test_the_eaves_come_from_the_images_not_from_the_roof():
    assert_is_the_wall(found(views(roof=True), TRUTH))
    assert_is_the_wall(found(views(roof=True), PriorBox(LEFT_M, RIGHT_M, BOTTOM_M, None)))


def test_a_gutter_in_front_of_the_wall_does_not_raise_the_eaves():
    assert_is_the_wall(found(views(gutter=True), TRUTH))
    assert_is_the_wall(found(views(gutter=True), PriorBox(LEFT_M, RIGHT_M, BOTTOM_M, TOP_M + 1)))


@pytest.mark.parametrize("error_m", [-2.0, 2.0])
def test_a_mapped_height_two_metres_off_is_corrected(error_m):
    prior = PriorBox(LEFT_M, RIGHT_M, BOTTOM_M, TOP_M + error_m)
    assert_is_the_wall(found(views(), prior))


def test_eaves_that_were_merely_assumed_give_way_to_the_images_however_far_off():
    prior = PriorBox(LEFT_M, RIGHT_M, BOTTOM_M, TOP_M - 6.0, top_is_assumed=True)
    assert_is_the_wall(found(views(), prior))


def test_a_footprint_half_a_metre_off_is_corrected():
    assert_is_the_wall(found(views(), PriorBox(LEFT_M - 0.5, RIGHT_M - 0.5, BOTTOM_M + 0.2, TOP_M)))


def test_a_badly_registered_view_is_outvoted():
    images = [*views(3), view(7, shift_m=(0.9, -0.8))]
    box = found(images, PriorBox(LEFT_M, RIGHT_M, BOTTOM_M, None))
    assert_is_the_wall(box)


def test_a_view_that_saw_only_one_end_does_not_vote_on_the_other():
    halves = []
    for seed, part in (
        (0, slice(0, 400)),
        (1, slice(0, 380)),
        (2, slice(300, 720)),
        (3, slice(320, 720)),
    ):
        one = view(seed)
        valid = np.zeros_like(one.valid)
        valid[:, part] = True
        halves.append(OrthoImage(one.source, np.where(valid[..., None], one.rgb, 0), valid))
    assert_is_the_wall(found(halves, TRUTH))


def test_a_single_view_is_enough_where_it_is_all_there_is():
    assert_is_the_wall(found([view()], TRUTH))


def test_nothing_to_see_keeps_the_prior_and_says_so():
    grey = np.full((GRID.height_px, GRID.width_px, 3), 120, np.uint8)
    blank = [OrthoImage(f"v{n}", grey, np.ones(grey.shape[:2], np.bool_)) for n in range(3)]
    box = found(blank, TRUTH)
    assert (box.left_m, box.right_m) == pytest.approx((LEFT_M, RIGHT_M))
    assert (box.bottom_m, box.top_m) == pytest.approx((BOTTOM_M, TOP_M))
    assert box.evidence == ("footprint", "footprint", "footprint", "prior")
    assert box.sigma_m == pytest.approx((0.5, 0.5, 0.3, 1.5))
    assert "top side from the mapped height" in box.notes[3]
    assumed = found(blank, replace(TRUTH, top_is_assumed=True))
    assert assumed.top_m == pytest.approx(TOP_M)
    assert assumed.sigma_m[3] > 5
    assert "top side from an assumed height" in assumed.notes[3]


def test_nothing_to_see_and_no_prior_is_an_error_that_names_the_side():
    grey = np.full((GRID.height_px, GRID.width_px, 3), 120, np.uint8)
    blank = [OrthoImage("v", grey, np.ones(grey.shape[:2], np.bool_))]
    with pytest.raises(FacadeError, match=r"no line for the left side .* Give footprints"):
        found(blank, PriorBox())
    with pytest.raises(FacadeError, match="no line for the top side"):
        found([], PriorBox(LEFT_M, RIGHT_M, BOTTOM_M, None))


def test_a_prior_beyond_the_grid_does_not_hide_the_wall():
    box = found(views(), PriorBox(LEFT_M, RIGHT_M, BOTTOM_M, GRID.height_m + 1.0))
    assert_is_the_wall(box)
    box = found(views(), PriorBox(-0.6, GRID.width_m + 0.7, -0.5, TOP_M))
    assert box.evidence[3] == "images"


def test_a_prior_without_area_is_an_error():
    with pytest.raises(FacadeError, match=r"cross: left 9\.00 m, right 4\.00 m"):
        found([], PriorBox(9.0, 4.0, BOTTOM_M, TOP_M))


def test_the_same_seed_gives_the_same_box():
    images = views(3)
    assert found(images, PriorBox()) == found(images, PriorBox())


def test_the_box_does_not_depend_on_the_resolution_of_the_views():
    coarse = FacadeGrid(GRID.world_from_facade, GRID.width_px // 2, GRID.height_px // 2, 0.05)
    images = []
    for one in views(3):
        rgb = cv2.resize(one.rgb, (coarse.width_px, coarse.height_px), interpolation=cv2.INTER_AREA)
        images.append(OrthoImage(one.source, rgb, np.ones(rgb.shape[:2], np.bool_)))
    assert_is_the_wall(find_facade_box(images, coarse, TRUTH, CONFIG, np.random.default_rng(0)))


def test_lines_lie_where_they_were_painted():
    lines = find_lines(view(texture=2.0), GRID, CONFIG)
    width, _ = raster_size(GRID, CONFIG)
    m_per_px = GRID.width_m / width
    rows = GRID.height_m - lines.horizontal.position_px * m_per_px
    long = lines.horizontal.length_px * m_per_px > 5
    assert np.abs(rows[long] - TOP_M).min() < 0.03
    assert np.abs(lines.vertical.position_px * m_per_px - LEFT_M).min() < 0.03


def test_lines_along_what_was_not_seen_do_not_count():
    one = view()
    valid = np.ones_like(one.valid)
    valid[:, 500:] = False
    lines = find_lines(OrthoImage("v", np.where(valid[..., None], one.rgb, 0), valid), GRID, CONFIG)
    assert len(lines.vertical)
    assert np.abs(lines.vertical.position_px - 250).min() > 4  # 0.2 m from the border


def test_lines_at_eleven_degrees_do_not_count():
    picture = np.full((GRID.height_px, GRID.width_px, 3), 80, np.uint8)
    for degrees, top in ((8.0, 100), (12.0, 300)):
        rise = int(600 * np.tan(np.deg2rad(degrees)))
        cv2.line(picture, (60, top + rise), (660, top), (255, 255, 255), 12)
    lines = find_lines(OrthoImage("v", picture, np.ones(picture.shape[:2], np.bool_)), GRID, CONFIG)
    rows = lines.horizontal.position_px
    assert len(rows)
    assert rows.max() < 120


def test_relevant_lines_are_those_that_two_views_show():
    here = Segments(np.array([10.0, 40.0]), np.array([0.0, 0.0]), np.array([50.0, 50.0]))
    there = Segments(np.array([11.0, 70.0]), np.array([5.0, 0.0]), np.array([55.0, 50.0]))
    beside = Segments(np.array([40.0]), np.array([60.0]), np.array([99.0]))
    relevant = relevant_positions([here, there, beside], 100, 100, 0.05, CONFIG)
    np.testing.assert_allclose(relevant, [10.5])


def test_a_larger_box_does_not_win_by_its_size():
    score = ViewScore.of(find_lines(view(), GRID, CONFIG), 3.0, 20.0)
    width, height = raster_size(GRID, CONFIG)
    m_per_px = GRID.width_m / width
    wall = np.array([LEFT_M, RIGHT_M, GRID.height_m - BOTTOM_M, GRID.height_m - TOP_M]) / m_per_px
    all_of_it = np.array([0.0, width, height, 0.0])
    inner = wall + np.array([1, -1, -1, 1]) * 1.2 / m_per_px
    of_wall, of_all, of_inner = score.score(np.array([wall, all_of_it, inner]), CONFIG)
    assert of_wall > of_all + 0.1
    assert of_wall > of_inner + 0.1


def test_priors_turn_metres_up_into_rows_down():
    priors = Priors.from_metres((1.0, 5.0, 0.5, None), 10.0, 0.05, CONFIG)
    np.testing.assert_allclose(priors.position_px, [20, 100, 190, np.nan])
    box = np.array([[20.0, 100.0, 190.0, 33.0], [30.0, 100.0, 190.0, 33.0]])
    at_prior, half_a_metre_off = priors.log_density(box)
    assert at_prior == 0.0
    assert half_a_metre_off == pytest.approx(-np.log(1.5))


@pytest.mark.slow
@pytest.mark.skipif("SI3FP_TEST_DATA" not in os.environ, reason="SI3FP_TEST_DATA is not set")
def test_castle_eaves_lie_where_the_wall_ends_and_the_cornice_begins():
    from si3fp.config import StreetConfig
    from si3fp.sources.footprints import footprints_in_world, read_footprints
    from si3fp.sources.images import seen_pixels
    from si3fp.sources.local import image_loader, panoramas_in_world, read_panorama_records
    from si3fp.sources.selection import run_origin
    from si3fp.streetview.cluster import cluster_walls
    from si3fp.streetview.drift import without_drift
    from si3fp.streetview.orthophoto import align_views, moved_views
    from si3fp.streetview.views import enough_seen, make_view, plan_views

    castle = Path(os.environ["SI3FP_TEST_DATA"]) / "castle"
    maps = read_footprints(castle / "footprints.geojson")
    records = read_panorama_records(castle / "street" / "panoramas.geojson")
    origin, load = run_origin(maps, records), image_loader(records)
    panoramas = {p.id: p for p in panoramas_in_world(records, origin)}
    config = StreetConfig()
    ortho = replace(config.ortho, margin_m=2.5, m_per_px=0.05)
    footprints = footprints_in_world(maps, origin)
    walls = cluster_walls(list(panoramas.values()), footprints, config.cluster).walls
    plans = [plan_views(wall, panoramas, dict.fromkeys(panoramas, 8192), ortho) for wall in walls]
    images = {plan.wall.facade_id: [] for plan in plans}
    for name, panorama in panoramas.items():
        image = load(name)
        lit = seen_pixels(image)
        for plan in plans:
            if name in plan.panorama_ids:
                view = make_view(plan, panorama, image, lit, footprints, ortho, config.cluster)
                images[plan.wall.facade_id].append(view)
    seen = [enough_seen(images[plan.wall.facade_id], ortho) for plan in plans]
    facades = [
        align_views(plan, views, panoramas, config.align)
        for plan, views in zip(plans, seen, strict=True)
    ]
    placed = without_drift(facades, panoramas, config.align)
    for plan, views, registrations in zip(plans, seen, placed, strict=True):
        moved = moved_views(plan, views, registrations)
        for top_m in (None, 2.5 + 12.8, 2.5 + 14.8):
            prior = PriorBox(2.5, 2.5 + plan.wall.width_m, 2.5, top_m)
            box = find_facade_box(moved, plan.grid, prior, CONFIG, np.random.default_rng(0))
            assert box.evidence[3] == "images"
            # Wall meets cornice 14.8 to 14.9 m above the mapped ground, measured on the pictures.
            assert box.top_m - 2.5 == pytest.approx(14.85, abs=0.2)
            assert box.bottom_m - 2.5 == pytest.approx(0.0, abs=0.25)
            assert box.left_m - 2.5 == pytest.approx(0.0, abs=0.6)
            assert box.right_m - 2.5 == pytest.approx(plan.wall.width_m, abs=0.6)
