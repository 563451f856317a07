"""The drift of facades from poses that they share, on walls whose true places are computed."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from si3fp.config import AlignConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Panorama
from si3fp.streetview.align import Registration
from si3fp.streetview.drift import RegisteredFacade, without_drift
from si3fp.streetview.pose_motion import PoseMotion

CONFIG = AlignConfig()
M_PER_PX = 0.05
PLANE_SIGMA = np.array([0.08, 0.004])
CORNERS = np.array([[0.0, 0.0], [16.0, 0.0], [16.0, 9.0], [0.0, 9.0]])
"""A house of 16 by 9 metres, counter-clockwise; its walls are 8 m tall."""
ROUND = np.deg2rad(np.arange(0.0, 360.0, 24.0))
"""Where 15 cameras stand around it."""
SURE = np.diag([1e6] * 2 + [1e8] * 4 + [1e10] * 2)
"""What thousands of matches tell of a motion."""

Matrix = NDArray[np.float64]


def wall_grid(side: int) -> FacadeGrid:
    left, right = CORNERS[side], CORNERS[(side + 1) % 4]
    x = np.append((right - left) / np.linalg.norm(right - left), 0.0)
    up = np.array([0.0, 0.0, 1.0])
    frame = Rigid3(np.column_stack([x, up, np.cross(x, up)]), np.append(left, 0.0))
    return FacadeGrid.covering(frame, float(np.linalg.norm(right - left)), 8.0, M_PER_PX)


def camera(turn: float, place_m=(0.0, 0.0, 0.0), rotation_rad=(0.0, 0.0, 0.0)) -> Panorama:
    """One of the ring, its true pose off the believed one by a place and a turn in the world."""
    middle = np.array([8.0, 4.5, 2.5])
    place = middle + 22.0 * np.array([np.cos(turn), np.sin(turn), 0.0]) + place_m
    world_from_pano = Rotation.from_rotvec(rotation_rad).as_matrix()
    pose = Rigid3(world_from_pano, place).inverse()
    return Panorama(f"p{np.rad2deg(turn):03.0f}", "", pose)


def true_motion(believed: Panorama, true: Panorama, grid: FacadeGrid, plane_m: float) -> Matrix:
    """Homography of grid pixels to where their content lies on a wall ``plane_m`` further out."""
    width, height = grid.width_px, grid.height_px
    pixels = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    rays = believed.pano_from_world.apply(grid.world_from_pixels(pixels))
    lines = true.pano_from_world.inverse().rotate(rays)
    through = grid.world_from_facade.translation + plane_m * grid.normal_in_world
    reach = (through - true.centre_in_world) @ grid.normal_in_world / (lines @ grid.normal_in_world)
    hits = grid.world_from_facade.inverse().apply(true.centre_in_world + reach[:, None] * lines)
    seen = grid.pixels_from_facade(hits[:, :2])
    return cv2.getPerspectiveTransform(pixels.astype(np.float32), seen.astype(np.float32))


def gauge(grid: FacadeGrid, rng: np.random.Generator, size_m=0.1) -> Matrix:
    """A motion that the views of one facade share, in grid pixels."""
    linear = np.eye(2) + rng.normal(scale=0.1 * size_m / 4, size=(2, 2))
    middle = np.array([grid.width_px / 2, grid.height_px / 2])
    shift = rng.normal(scale=size_m / M_PER_PX, size=2) + middle - linear @ middle
    return np.vstack([np.column_stack([linear, shift]), [0.0, 0.0, 1.0]])


def facing(panorama: Panorama, grid: FacadeGrid) -> bool:
    """Whether a camera sees a wall at less than 70 degrees to its normal."""
    gap = panorama.centre_in_world - grid.world_from_facade.apply([grid.width_m / 2, 4.0, 0.0])
    return bool(gap @ grid.normal_in_world > np.cos(np.deg2rad(70)) * np.linalg.norm(gap))


def drive(seed: int, pose_m=0.08, pose_deg=0.15, plane_m=0.06):
    """Facades registered without error but for their drift, the believed cameras, and truths.

    The truth of a facade is the motion in grid pixels of each of its views.
    """
    rng = np.random.default_rng(seed)
    believed = [camera(turn) for turn in ROUND]
    true = [
        camera(turn, rng.normal(scale=pose_m, size=3), np.deg2rad(rng.normal(0, pose_deg, 3)))
        for turn in ROUND
    ]
    facades, truths = [], []
    for side in range(3):
        grid = wall_grid(side)
        wall_m, drift = rng.normal(scale=plane_m), gauge(grid, rng)
        pairs = [(b, t) for b, t in zip(believed, true, strict=True) if facing(b, grid)]
        motions = [true_motion(b, t, grid, wall_m) for b, t in pairs]
        registrations = tuple(
            Registration(
                b.id,
                True,
                "registered",
                "homography",
                drift @ motion,
                500,
                3.0,
                0.1,
                information=SURE,
            )
            for (b, _), motion in zip(pairs, motions, strict=True)
        )
        facades.append(RegisteredFacade(grid, PLANE_SIGMA, registrations))
        truths.append(motions)
    return facades, {b.id: b for b in believed}, truths


def left_m(placed, facades, truths) -> Matrix:
    """Mean over the views of how far each facade is from the truth at its points, (F, P, 2)."""
    x, y = np.meshgrid(np.linspace(0.1, 0.9, 5), np.linspace(0.1, 0.9, 3))
    errors = []
    for registrations, facade, motions in zip(placed, facades, truths, strict=True):
        grid = facade.grid
        points = np.stack([x * grid.width_px, y * grid.height_px], axis=-1).reshape(-1, 1, 2)
        gaps = [
            cv2.perspectiveTransform(points, one.grid_from_view)
            - cv2.perspectiveTransform(points, motion)
            for one, motion in zip(registrations, motions, strict=True)
        ]
        errors.append(np.mean(gaps, axis=0)[:, 0] * grid.m_per_px)
    return np.array(errors)


def test_right_poses_take_all_of_the_drift_out():
    facades, panoramas, truths = drive(0, pose_m=0.0, pose_deg=0.0, plane_m=0.0)
    before = left_m([f.registrations for f in facades], facades, truths)
    after = left_m(without_drift(facades, panoramas, CONFIG), facades, truths)
    assert np.abs(before).max() > 0.1
    assert np.abs(after).max() < 0.002


def test_poses_that_facades_share_place_them_better_than_each_alone():
    alone, together = [], []
    for seed in range(4):
        facades, panoramas, truths = drive(seed)
        placed = without_drift(facades, panoramas, CONFIG)
        together.append(left_m(placed, facades, truths))
        placed = [without_drift([facade], panoramas, CONFIG)[0] for facade in facades]
        alone.append(left_m(placed, facades, truths))
    assert np.std(together) < 0.6 * np.std(alone)
    # 15 poses that err by 0.08 m and 0.15 degrees, some 16 m away: 0.09 / sqrt(15) and a plane.
    assert np.sqrt(np.mean(np.square(together))) < 0.035


def test_a_plane_off_its_wall_does_not_shift_what_is_seen_from_one_side():
    """Poses are right, the wall stands 0.2 m behind its plane, and all cameras to its right."""
    grid, rng = wall_grid(0), np.random.default_rng(1)
    cameras = [camera(np.deg2rad(turn)) for turn in (-75, -65, -55, -45, -35)]
    motions = [true_motion(each, each, grid, -0.2) for each in cameras]
    shift_m = np.mean([(motion @ [160.0, 80.0, 1.0] / motion[2].sum())[0] for motion in motions])
    assert abs(shift_m - 160.0) * M_PER_PX > 0.05
    drift = gauge(grid, rng)
    registrations = tuple(
        Registration(each.id, True, "", "homography", drift @ motion, information=SURE)
        for each, motion in zip(cameras, motions, strict=True)
    )
    facade = RegisteredFacade(grid, np.array([0.2, 0.01]), registrations)
    sure = replace(CONFIG, position_sigma_m=0.02, direction_sigma_deg=0.05)
    placed = without_drift([facade], {each.id: each for each in cameras}, sure)
    assert np.abs(left_m(placed, [facade], [motions])).max() < 0.03


def test_a_view_registered_wrongly_moves_no_other():
    facades, panoramas, truths = drive(3)
    off = np.array([[1.0, 0.0, 16.0], [0.0, 1.0, -9.0], [0.0, 0.0, 1.0]])
    first, *rest = facades[0].registrations
    wrong = replace(first, grid_from_view=off @ first.grid_from_view)
    spoiled = [replace(facades[0], registrations=(wrong, *rest)), *facades[1:]]
    right = without_drift(facades, panoramas, CONFIG)
    placed = without_drift(spoiled, panoramas, CONFIG)
    gap = left_m([placed[0][1:], *placed[1:]], facades, [truths[0][1:], *truths[1:]])
    usual = left_m([right[0][1:], *right[1:]], facades, [truths[0][1:], *truths[1:]])
    # 0.9 m wrong; the mean of its facade would be moved by 0.2 m.
    assert np.abs(gap - usual).max() < 0.07


def test_what_no_match_tells_says_nothing():
    facades, panoramas, _ = drive(4)
    first, *rest = facades[0].registrations
    deaf = replace(
        first, grid_from_view=first.grid_from_view @ np.diag([1.1, 1, 1]), information=0 * SURE
    )
    with_it = replace(facades[0], registrations=(deaf, *rest))
    without = replace(facades[0], registrations=tuple(rest))
    one = without_drift([with_it, *facades[1:]], panoramas, CONFIG)
    other = without_drift([without, *facades[1:]], panoramas, CONFIG)
    for ours, theirs in zip(one[0][1:], other[0], strict=True):
        np.testing.assert_allclose(ours.grid_from_view, theirs.grid_from_view, atol=1e-6)


def test_a_view_alone_is_moved_by_what_others_tell_of_its_pose():
    """Believed 0.3 m too far along a wall; a second picture of that wall has no other view."""
    facades, panoramas, _ = drive(5, pose_m=0.0, pose_deg=0.0, plane_m=0.0)
    lonely = facades[0].registrations[0].source
    true = panoramas[lonely]
    place = true.centre_in_world + np.array([0.3, 0.0, 0.0])
    panoramas[lonely] = Panorama(lonely, "", Rigid3(np.eye(3), place).inverse())

    def registered_again(facade: RegisteredFacade) -> RegisteredFacade:
        moved = [
            true_motion(panoramas[one.source], true, facade.grid, 0.0)
            if one.source == lonely
            else np.eye(3)
            for one in facade.registrations
        ]
        pairs = zip(facade.registrations, moved, strict=True)
        again = tuple(replace(one, grid_from_view=motion) for one, motion in pairs)
        return replace(facade, registrations=again)

    only = Registration(lonely, True, "the only view", "none", np.eye(3))
    alone = replace(facades[0], registrations=(only,))
    (unmoved,) = without_drift([alone], panoramas, CONFIG)
    np.testing.assert_allclose(unmoved[0].grid_from_view, np.eye(3), atol=1e-9)
    *_, (told,) = without_drift([*map(registered_again, facades), alone], panoramas, CONFIG)
    moved_m = (told.grid_from_view @ [160.0, 80.0, 1.0] - [160.0, 80.0, 1.0])[0] * M_PER_PX
    # Back along the wall; two standard deviations are believed in part.
    assert -0.3 < moved_m < -0.1


def test_a_facade_whose_matches_miss_says_less():
    """One facade is stretched by 2 %, which poses could explain: the others follow it less."""
    facades, panoramas, truths = drive(7, pose_m=0.0, pose_deg=0.0, plane_m=0.0)

    def moved_m(residual_px: float) -> float:
        bent = np.eye(3)
        bulging = []
        for k, one in enumerate(facades[0].registrations):
            bent[2, 0] = 2e-5 * (-1) ** k
            matrix = one.grid_from_view @ bent
            bulging.append(replace(one, grid_from_view=matrix, residual_after_px=residual_px))
        bulging = replace(facades[0], registrations=tuple(bulging))
        placed = without_drift([bulging, *facades[1:]], panoramas, CONFIG)
        return float(np.abs(left_m(placed[1:], facades[1:], truths[1:])).max())

    assert moved_m(2.0) < 0.5 * moved_m(0.1)


def test_dropped_views_and_no_views_stay_as_they_are():
    facades, panoramas, _ = drive(6)
    dropped = Registration("p000", False, "fewer than 12", "none", np.eye(3))
    nothing = RegisteredFacade(wall_grid(3), PLANE_SIGMA, (dropped,))
    *_, (same,) = without_drift([*facades, nothing], panoramas, CONFIG)
    assert same is dropped
    assert without_drift([nothing], panoramas, CONFIG) == ((dropped,),)
    assert without_drift([], panoramas, CONFIG) == ()


def test_a_plane_further_out_by_hand():
    """A camera 16 m away at the side: what lies x from its foot moves towards it by x / 16."""
    grid = wall_grid(0)
    panorama = Panorama("p", "", Rigid3(np.eye(3), np.array([-4.0, -16.0, 4.0])).inverse())
    motion = PoseMotion.of(panorama, grid)
    tx, _, xx, _, _, yy, *_ = motion(np.array([0.0] * 6 + [0.1, 0.0]))
    assert tx == pytest.approx(-0.1 * 12 / 16)
    assert (xx, yy) == pytest.approx((-0.1 / 16, -0.1 / 16))
