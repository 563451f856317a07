"""S.3 on painted walls that are moved by known motions."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from si3fp.config import AlignConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import FacadeViews, OrthoImage, Panorama
from si3fp.streetview.align import Registration, register, registered
from si3fp.streetview.matching import features_of, nearest
from si3fp.streetview.pose_motion import motion_covariance

CONFIG = AlignConfig()
M_PER_PX = 0.05
GRID = FacadeGrid.covering(Rigid3(np.eye(3), np.zeros(3)), 13.0, 9.0, M_PER_PX)
SIZE = (GRID.width_px, GRID.height_px)
MIDDLE = np.array([GRID.width_px / 2, GRID.height_px / 2])
MARGIN_PX = 60
"""How far the painted wall goes on beyond the grid."""

Matrix = NDArray[np.float64]


def painted_wall(seed=0, *, windows=True, grain=22.0) -> NDArray[np.uint8]:
    """A plastered wall with stains of all sizes and windows, no two alike."""
    rng = np.random.default_rng(seed)
    height, width = GRID.height_px + 2 * MARGIN_PX, GRID.width_px + 2 * MARGIN_PX
    picture = np.full((height, width), 150.0, np.float32)
    for sigma in (0.8, 2.0, 5.0):
        noise = cv2.GaussianBlur(rng.normal(size=picture.shape).astype(np.float32), (0, 0), sigma)
        picture += grain * noise / noise.std()
    if windows:
        for left in range(40, width - 40, 50):
            for top in range(40, height - 50, 60):
                dx, dy = rng.integers(0, 12, 2)
                picture[top + dy : top + 34, left + dx : left + 24] = 50 + 30 * rng.random()
    picture = cv2.GaussianBlur(picture, (0, 0), 0.8)
    colours = np.stack([picture, 0.95 * picture, 0.85 * picture], axis=-1)
    return np.clip(colours, 0, 255).astype(np.uint8)


def about_middle(matrix: Sequence[Sequence[float]]) -> Matrix:
    """The homography of pixels about the grid's middle as one of pixel coordinates."""
    to_middle = np.array([[1, 0, -MIDDLE[0]], [0, 1, -MIDDLE[1]], [0, 0, 1.0]])
    return np.linalg.inv(to_middle) @ np.asarray(matrix, float) @ to_middle


def random_motion(model: str, rng: np.random.Generator) -> Matrix:
    """View from wall in grid pixels: decimetres, half degrees, percent."""
    tx, ty = rng.uniform(-6, 6, 2)
    if model == "translation":
        return about_middle([[1, 0, tx], [0, 1, ty], [0, 0, 1]])
    scale, turn = rng.uniform(-0.02, 0.02, 2)
    if model == "similarity":
        return about_middle([[1 + scale, -turn, tx], [turn, 1 + scale, ty], [0, 0, 1]])
    stretch, shear = rng.uniform(-0.02, 0.02, 2)
    px, py = rng.uniform(-1.5e-4, 1.5e-4, 2)
    return about_middle([[1 + stretch, -turn, tx], [shear, 1 + scale, ty], [px, py, 1]])


def moved_wall(wall: NDArray[np.uint8], view_from_wall: Matrix, seed: int, source="") -> OrthoImage:
    """The wall as a view with a pose error shows it: moved, with noise and an exposure."""
    rng = np.random.default_rng(1000 + seed)
    margin = np.array([[1, 0, -MARGIN_PX], [0, 1, -MARGIN_PX], [0, 0, 1.0]])
    to_cv2 = np.array([[1, 0, -0.5], [0, 1, -0.5], [0, 0, 1.0]])
    matrix = to_cv2 @ view_from_wall @ margin @ np.linalg.inv(to_cv2)
    rgb = cv2.warpPerspective(wall, matrix, SIZE, flags=cv2.INTER_CUBIC)
    noisy = rgb * rng.uniform(0.8, 1.2) + rng.normal(scale=3.0, size=rgb.shape)
    valid = np.ones(rgb.shape[:2], np.bool_)
    return OrthoImage(source or f"view-{seed}", np.clip(noisy, 0, 255).astype(np.uint8), valid)


def pose_covariance(sigma_m: float) -> Matrix:
    """Of a motion's shift, linear and perspective part, for a camera some 15 m away."""
    spread = [sigma_m] * 2 + [sigma_m / 15] * 4 + [sigma_m / 15**2] * 2
    return np.diag(np.square(spread))


def aligned(
    views: Sequence[OrthoImage], config=CONFIG, quality=None, sigmas=None
) -> tuple[Registration, ...]:
    return register(
        FacadeViews("house-0", GRID, tuple(views)),
        quality or [float(-i) for i in range(len(views))],
        [pose_covariance(sigma) for sigma in sigmas or [0.25] * len(views)],
        config,
    )


def disagreement_px(registrations: Sequence[Registration], motions: Sequence[Matrix]) -> float:
    """Largest distance at which two views put the same point of the wall on the grid."""
    x, y = np.meshgrid(np.linspace(10, SIZE[0] - 10, 9), np.linspace(10, SIZE[1] - 10, 7))
    points = np.stack([x, y], axis=-1).reshape(-1, 1, 2)
    places = np.array(
        [
            cv2.perspectiveTransform(points, registration.grid_from_view @ motion)[:, 0]
            for registration, motion in zip(registrations, motions, strict=True)
            if registration.used
        ]
    )
    return float(np.linalg.norm(places[:, None] - places[None], axis=-1).max())


@pytest.mark.parametrize("model", ["translation", "similarity", "homography"])
@pytest.mark.parametrize("seed", [0, 1])
def test_relative_motions_are_recovered_and_their_model_is_recognised(model, seed):
    rng = np.random.default_rng(seed)
    wall = painted_wall(seed)
    motions = [random_motion(model, rng) for _ in range(5)]
    result = aligned([moved_wall(wall, motion, i) for i, motion in enumerate(motions)])
    assert [r.source for r in result] == [f"view-{i}" for i in range(5)]
    assert all(r.used for r in result)
    assert {r.model for r in result} == {model}
    before = disagreement_px(
        [dataclasses.replace(r, grid_from_view=np.eye(3)) for r in result], motions
    )
    assert before > 5.0
    # Hundreds of matches of a third of a pixel each; corners are extrapolated.
    assert disagreement_px(result, motions) < 0.5
    for r in result:
        assert r.residual_before_px is not None
        assert r.residual_after_px is not None
        assert r.residual_after_px < 1.0 < r.residual_before_px
        assert r.inliers >= CONFIG.min_inliers


def test_moving_the_views_makes_them_one_picture():
    rng = np.random.default_rng(3)
    motions = [random_motion("similarity", rng) for _ in range(3)]
    views = [moved_wall(painted_wall(3), motion, i) for i, motion in enumerate(motions)]
    moved = [registered(v, r, GRID) for v, r in zip(views, aligned(views), strict=True)]

    def correlation(first: OrthoImage, second: OrthoImage) -> float:
        both = first.valid & second.valid
        return float(np.corrcoef(first.rgb[both].ravel(), second.rgb[both].ravel())[0, 1])

    assert correlation(views[0], views[1]) < 0.9
    assert correlation(moved[0], moved[1]) > 0.97
    assert correlation(moved[0], moved[2]) > 0.97


def mean_move_m(registrations: Sequence[Registration]) -> Matrix:
    """Mean over the views of how far each moves a point of the grid, (points, 2) metres."""
    x, y = np.meshgrid(np.linspace(0, SIZE[0], 7), np.linspace(0, SIZE[1], 5))
    points = np.stack([x, y], axis=-1).reshape(-1, 1, 2)
    moves = [cv2.perspectiveTransform(points, r.grid_from_view) - points for r in registrations]
    return np.mean(moves, axis=0)[:, 0] * M_PER_PX


def test_matches_tell_more_of_a_view_that_has_many():
    rng = np.random.default_rng(5)
    motions = [random_motion("similarity", rng) for _ in range(4)]
    views = [moved_wall(painted_wall(5), motion, i) for i, motion in enumerate(motions)]
    views[3].valid[:, 130:] = False
    result = aligned(views)
    told = [r.information for r in result if r.information is not None]
    assert len(told) == 4
    for information in told:
        np.testing.assert_allclose(information, information.T)
        assert np.linalg.eigvalsh(information).min() > 0
    # A view of the left half knows where that is, and less where the right one would be.
    right = np.array([1.0, 0.0, 5.0, 0.0, 0.0, 0.0, 25.0, 0.0])
    left = right * [1, 1, -1, 1, 1, 1, 1, 1]
    variances = [[at @ np.linalg.inv(each) @ at for at in (left, right)] for each in told]
    assert variances[3][1] > 10 * variances[3][0]
    assert max(variances[0]) < 4 * min(variances[0])


def test_the_facade_does_not_shrink_with_hundreds_of_matches():
    """Shrinking every view would shrink every residual; the more views, the more it would pay."""
    rng = np.random.default_rng(6)
    motions = [random_motion("homography", rng) for _ in range(6)]
    wall = painted_wall(6)
    result = aligned([moved_wall(wall, motion, i) for i, motion in enumerate(motions)])
    assert sum(r.inliers for r in result) > 1000
    assert np.abs(mean_move_m(result)).max() < 0.01


def test_what_was_not_seen_never_matches():
    """The same pattern stands still in both views where they saw nothing: it holds nothing back."""
    motions = [about_middle([[1, 0, dx], [0, 1, 3], [0, 0, 1]]) for dx in (-7, 0, 7)]
    bonnet = painted_wall(77, windows=False, grain=40.0)[: GRID.height_px // 2, : SIZE[0]]
    views = []
    for index, motion in enumerate(motions):
        view = moved_wall(painted_wall(8), motion, index)
        view.rgb[-len(bonnet) :] = bonnet
        view.valid[-len(bonnet) :] = False
        views.append(view)
    result = aligned(views)
    assert all(r.used for r in result)
    assert disagreement_px(result, motions) < 1.0


def test_views_that_saw_nothing_in_common_do_not_match_in_the_unseen():
    picture = painted_wall(9)
    views = [moved_wall(picture, np.eye(3), i) for i in range(2)]
    views[0].valid[:, 100:] = False
    views[1].valid[:, :160] = False
    result = aligned(views)
    assert [r.used for r in result] == [True, False]


def test_the_edge_of_the_seen_is_no_feature():
    """No feature lies within four pixels of the black beyond a ragged outline."""
    rng = np.random.default_rng(10)
    blobs = cv2.GaussianBlur(rng.normal(size=SIZE[::-1]).astype(np.float32), (0, 0), 12.0)
    seen = blobs > -0.03
    view = dataclasses.replace(moved_wall(painted_wall(10), np.eye(3), 0), valid=seen)
    view.rgb[~seen] = 0
    points_m, _ = features_of(view, GRID, CONFIG)
    columns, rows = np.floor(points_m / M_PER_PX + MIDDLE).astype(int).T
    gap_px = cv2.distanceTransform(seen.astype(np.uint8), cv2.DIST_C, 3)
    assert len(points_m) > 50
    assert gap_px[rows, columns].min() > 4


def test_features_are_where_their_blobs_are():
    """On a grid finer than the features' own: metres to the right and down from the middle."""
    grid = FacadeGrid.covering(Rigid3(np.eye(3), np.zeros(3)), 9.0, 6.0, 0.02)
    xy = np.stack(np.meshgrid(np.arange(450) + 0.5, np.arange(300) + 0.5), axis=-1)
    rng = np.random.default_rng(0)
    nodes = np.stack(np.meshgrid(np.linspace(-3.7, 3.7, 7), np.linspace(-2.2, 2.2, 5)), axis=-1)
    places_m = nodes.reshape(-1, 2) + rng.uniform(-0.2, 0.2, (35, 2))
    grey = np.full((300, 450), 90.0)
    for place_m in places_m:
        square = np.sum((xy - (place_m / 0.02 + [225, 150])) ** 2, axis=-1)
        grey += 120 * np.exp(-square / (2 * 7.0**2))
    rgb = np.repeat(grey.astype(np.uint8)[..., None], 3, axis=-1)
    points_m, _ = features_of(OrthoImage("v", rgb, np.ones(grey.shape, np.bool_)), grid, CONFIG)
    gaps = points_m[None] - places_m[:, None]
    nearest = gaps[np.arange(35), np.linalg.norm(gaps, axis=-1).argmin(axis=1)]
    # Half a pixel of the 0.05 m that they are found on would be 0.025 m.
    assert np.abs(np.median(nearest, axis=0)).max() < 0.008


def test_a_view_of_something_else_is_dropped_with_a_reason():
    rng = np.random.default_rng(11)
    motions = [random_motion("translation", rng) for _ in range(4)]
    views = [moved_wall(painted_wall(11), motion, i) for i, motion in enumerate(motions)]
    views[1] = moved_wall(painted_wall(99), np.eye(3), 1)
    result = aligned(views)
    assert [r.used for r in result] == [True, False, True, True]
    assert "matching points" in result[1].reason
    assert result[1].model == "none"
    assert disagreement_px(result, motions) < 0.5


def test_a_blank_view_is_dropped():
    views = [moved_wall(painted_wall(12), np.eye(3), i) for i in range(3)]
    views[2] = OrthoImage("blank", np.full_like(views[2].rgb, 128), views[2].valid)
    result = aligned(views)
    assert [r.used for r in result] == [True, True, False]


def test_a_single_view_stays_where_it_is():
    (result,) = aligned([moved_wall(painted_wall(), np.eye(3), 0)])
    assert result.used
    assert result.reason == "the only view"
    np.testing.assert_array_equal(result.grid_from_view, np.eye(3))


def test_no_views_give_no_registrations():
    assert aligned([]) == ()


def test_of_two_views_that_do_not_match_the_better_is_kept():
    views = [moved_wall(painted_wall(seed), np.eye(3), seed) for seed in (20, 21)]
    result = aligned(views, quality=[0.1, 0.7])
    assert [r.used for r in result] == [False, True]
    assert "alone" in result[1].reason
    assert result[0].residual_before_px is None


@pytest.mark.parametrize("shift_px", [6, 12, 18])
def test_a_repetitive_facade_is_not_matched_one_period_off(shift_px):
    """Identical windows every 2.5 m, 50 pixels; poses err by up to 0.9 m."""
    wall = painted_wall(30, windows=False, grain=1.5)
    window = painted_wall(31, grain=25.0)[100:130, 100:122]
    for left in range(20, wall.shape[1] - 30, 50):
        for top in range(20, wall.shape[0] - 40, 60):
            wall[top : top + 30, left : left + 22] = window
    motions = [
        about_middle([[1, 0, dx], [0, 1, dy], [0, 0, 1]])
        for dx, dy in ((0, 0), (shift_px, 3), (shift_px / 2, -2))
    ]
    result = aligned([moved_wall(wall, motion, i) for i, motion in enumerate(motions)])
    assert all(r.used for r in result)
    assert disagreement_px(result, motions) < 1.0


def test_views_beyond_the_best_are_registered_against_their_result():
    rng = np.random.default_rng(13)
    motions = [random_motion("similarity", rng) for _ in range(6)]
    views = [moved_wall(painted_wall(13), motion, i) for i, motion in enumerate(motions)]
    config = dataclasses.replace(CONFIG, best_views=3)
    result = aligned(views, config)
    assert all(r.used for r in result)
    assert disagreement_px(result, motions) < 0.5
    # The others do not change how the best lie to one another.
    alone = aligned(views[:3], config)
    for few, many in zip(alone, result, strict=False):
        ours = np.linalg.inv(alone[0].grid_from_view) @ few.grid_from_view
        theirs = np.linalg.inv(result[0].grid_from_view) @ many.grid_from_view
        np.testing.assert_allclose(ours, theirs, atol=1e-8)


def test_a_later_view_of_something_else_changes_nothing():
    rng = np.random.default_rng(14)
    motions = [random_motion("translation", rng) for _ in range(3)]
    views = [moved_wall(painted_wall(14), motion, i) for i, motion in enumerate(motions)]
    config = dataclasses.replace(CONFIG, best_views=3)
    stranger = moved_wall(painted_wall(98), np.eye(3), 3)
    with_stranger = aligned([*views, stranger], config)
    assert not with_stranger[3].used
    for first, second in zip(aligned(views, config), with_stranger, strict=False):
        assert (first.inliers, first.residual_after_px) == (
            second.inliers,
            second.residual_after_px,
        )
        np.testing.assert_array_equal(first.grid_from_view, second.grid_from_view)


def test_registering_twice_gives_the_same_bits():
    rng = np.random.default_rng(15)
    motions = [random_motion("homography", rng) for _ in range(4)]
    views = [moved_wall(painted_wall(15), motion, i) for i, motion in enumerate(motions)]
    for first, second in zip(aligned(views), aligned(views), strict=True):
        np.testing.assert_array_equal(first.grid_from_view, second.grid_from_view)
        assert first.residual_after_px == second.residual_after_px
        assert first.inliers == second.inliers


def test_the_order_of_the_views_does_not_matter():
    """Equal quality: the id decides, not the place in the list."""
    rng = np.random.default_rng(16)
    motions = [random_motion("similarity", rng) for _ in range(4)]
    views = [moved_wall(painted_wall(16), motion, i) for i, motion in enumerate(motions)]
    forward = aligned(views, quality=[1.0] * 4)
    backward = aligned(views[::-1], quality=[1.0] * 4)[::-1]
    for first, second in zip(forward, backward, strict=True):
        assert first.source == second.source
        np.testing.assert_array_equal(first.grid_from_view, second.grid_from_view)


def test_copies_of_one_image_stay_where_they_are():
    """Similarities of exactly one, twice the same id: no NaN, no motion."""
    view = moved_wall(painted_wall(17), np.eye(3), 0, "same")
    result = aligned([view, view, view])
    for registration in result:
        assert registration.used
        np.testing.assert_allclose(registration.grid_from_view, np.eye(3), atol=1e-6)


def test_a_pattern_that_repeats_within_the_reach_matches_nothing():
    """Tiles of 1 m, all alike: any shift by a metre is as good, so no match may be believed."""
    tile = painted_wall(18, windows=False, grain=40.0)[:20, :20]
    wall = np.tile(tile, (15, 20, 1))
    motions = [about_middle([[1, 0, dx], [0, 1, 0], [0, 0, 1]]) for dx in (0, 10)]
    result = aligned([moved_wall(wall, motion, i) for i, motion in enumerate(motions)])
    assert [r.used for r in result] == [True, False]


def test_a_view_too_far_off_is_dropped():
    """Two metres are no pose error."""
    motions = [about_middle([[1, 0, dx], [0, 1, 0], [0, 0, 1]]) for dx in (0, 1, 40)]
    views = [moved_wall(painted_wall(19), motion, i) for i, motion in enumerate(motions)]
    assert [r.used for r in aligned(views)] == [True, True, False]


@pytest.fixture
def shift_by_five() -> Registration:
    matrix = np.array([[1, 0, 5.0], [0, 1, -3.0], [0, 0, 1]])
    return Registration("view-0", True, "registered", "translation", matrix)


def test_registered_moves_whole_pixels_exactly(shift_by_five):
    view = moved_wall(painted_wall(), np.eye(3), 0)
    moved = registered(view, shift_by_five, GRID)
    assert moved.valid[:-3, 5:].all()
    np.testing.assert_array_equal(moved.rgb[:-3, 5:], view.rgb[3:, :-5])
    assert not moved.valid[:, :5].any()
    assert not moved.valid[-3:].any()


def test_registered_keeps_corners_not_centres():
    """Twice as large about the corner (0, 0): a square of 10 pixels becomes one of 20."""
    rgb = np.full((SIZE[1], SIZE[0], 3), 40, np.uint8)
    rgb[20:30, 50:60] = 240
    twice = Registration("v", True, "", "similarity", np.diag([2.0, 2.0, 1.0]))
    moved = registered(OrthoImage("v", rgb, np.ones(rgb.shape[:2], np.bool_)), twice, GRID)
    bright = moved.rgb[..., 0] > 140
    expected = np.zeros_like(bright)
    expected[40:60, 100:120] = True
    np.testing.assert_array_equal(bright, expected)


def test_registered_returns_an_unmoved_view_as_it_is():
    view = moved_wall(painted_wall(), np.eye(3), 0)
    assert registered(view, Registration("v", True, "", "none", np.eye(3)), GRID) is view


def test_registered_takes_no_colour_from_the_unseen():
    """A grey wall beside black that was not seen: no dark or bright rim after half a pixel."""
    rgb = np.full((SIZE[1], SIZE[0], 3), 150, np.uint8)
    valid = np.ones(rgb.shape[:2], np.bool_)
    valid[40:80, 60:130] = False
    rgb[~valid] = 0
    matrix = np.array([[1, 0, 0.5], [0, 1, 0.3], [0, 0, 1.0]])
    moved = registered(
        OrthoImage("v", rgb, valid), Registration("v", True, "", "translation", matrix), GRID
    )
    assert (moved.rgb[moved.valid] == 150).all()
    assert moved.valid[42:78, 62:128].sum() == 0
    assert moved.valid.sum() > valid.sum() - 3 * 2 * (40 + 70) - 2 * (SIZE[0] + SIZE[1])


def test_neighbours_are_those_of_a_search_through_all():
    rng = np.random.default_rng(0)
    points, others = rng.uniform([0, 0], [9, 4], (300, 2)), rng.uniform([0, 0], [9, 4], (260, 2))
    ours, theirs = (
        (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)
        for d in (rng.random((300, 128)), rng.random((260, 128)))
    )
    reach_m = 0.7
    best, best_back, top, second = nearest(points, ours, others, theirs, reach_m)
    all_pairs = np.where(
        (np.abs(points[:, None] - others[None]) <= reach_m).all(axis=-1), ours @ theirs.T, -1.0
    )
    found = all_pairs.max(axis=1) > 0
    np.testing.assert_array_equal(best[found], all_pairs.argmax(axis=1)[found])
    found_back = all_pairs.max(axis=0) > 0
    np.testing.assert_array_equal(best_back[found_back], all_pairs.argmax(axis=0)[found_back])
    ordered = np.sort(all_pairs, axis=1)
    np.testing.assert_allclose(top, ordered[:, -1], atol=1e-6)
    np.testing.assert_allclose(second, ordered[:, -2], atol=1e-6)


def test_the_covariance_of_a_frontal_camera_by_hand():
    """20 m in front of the middle: the shift is position and angle, the scale is depth."""
    south_wall = Rigid3(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), np.zeros(3))
    grid = FacadeGrid.covering(south_wall, 4.0, 2.0, 0.05)
    pose = Rigid3(
        np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), south_wall.apply([2.0, 1.0, 20.0])
    )
    covariance = motion_covariance(Panorama("p", "", pose.inverse()), grid, CONFIG)
    turn = np.deg2rad(CONFIG.direction_sigma_deg)
    sigma = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(sigma[:2], np.hypot(CONFIG.position_sigma_m, 20 * turn), rtol=0.02)
    np.testing.assert_allclose(sigma[[2, 5]], CONFIG.position_sigma_m / 20, rtol=0.02)
    np.testing.assert_allclose(sigma[[3, 4]], turn, rtol=0.05)  # roll
    np.testing.assert_allclose(covariance, covariance.T)
