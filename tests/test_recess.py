"""Depth of the glass from views that are computed from a wall with recessed windows."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from si3fp.blend import blend
from si3fp.config import MeasureConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Detections, OrthoImage
from si3fp.ortho import wall_resolution
from si3fp.windows.fuse import FusedDetections
from si3fp.windows.measure import measure_windows, opening_box
from si3fp.windows.parallax import patch_warp, seen_from, widest_views
from si3fp.windows.recess import estimate_recess
from si3fp.windows.recess_estimate import UNKNOWN_RECESS, RecessEstimate, of_the_others
from si3fp.windows.sharpen import sharpen_windows

M_PER_PX = 0.02
GRID = FacadeGrid(Rigid3(np.eye(3), np.zeros(3)), 420, 260, M_PER_PX)
SIZE = (GRID.height_px, GRID.width_px)
BOXES = np.array([[60.0, 70, 120, 160], [180, 70, 240, 160], [300, 70, 360, 160]])
CAMERAS = {
    f"view{i}": np.array([x, 1.8, z])
    for i, (x, z) in enumerate([(-3.0, 8.0), (0.5, 9.0), (3.0, 7.5), (5.0, 9.0), (8.0, 8.0)])
}
CONFIG = MeasureConfig()


def noise(rng, scale_px, contrast):
    """(H, W, 3) smooth random texture around mid grey."""
    field = cv2.GaussianBlur(rng.normal(size=(*SIZE, 3)), (0, 0), scale_px)
    return 130 + contrast * field / field.std()


def glass(rng):
    """(H, W, 3) windows with light frames and bars on dark panes."""
    picture = noise(rng, 3.0, 4.0) - 70
    for left, top, right, bottom in BOXES.astype(int):
        for x in (left, (left + right) // 2 - 2, right - 5):
            picture[top:bottom, x : x + 5] = 215
        for y in (top, top + 30, top + 60, bottom - 5):
            picture[y : y + 5, left:right] = 215
    return picture


def render(recess_m, cameras, *, seed=0, reflections=0.0, wall_m=0.0, grain=9.0):
    """Views on the wall plane, ray by ray; the wall itself stands ``wall_m`` behind the grid."""
    rng = np.random.default_rng(seed)
    wall, window = noise(rng, 2.0, grain), glass(rng)
    y, x = np.mgrid[0 : SIZE[0], 0 : SIZE[1]] + 0.5
    views = []
    for name, camera in cameras.items():
        foot = GRID.pixels_from_facade(camera[:2])

        def at(depth_m, foot=foot, distance_m=camera[2]):
            reach = depth_m / distance_m
            return x + (x - foot[0]) * reach, y + (y - foot[1]) * reach

        def look(texture, place):
            u, v = ((axis - 0.5).astype(np.float32) for axis in place)
            return cv2.remap(texture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)

        on_wall, on_glass = at(wall_m), at(wall_m + recess_m)
        picture = look(wall, on_wall)
        behind = window
        if reflections:
            panes = window < 200
            behind = window + reflections * panes * noise(rng, 4.0, 1.0) / 2
            behind = np.where(panes, window + reflections * (noise(rng, 4.0, 1.0) - 130), window)
        behind = look(behind, on_glass)
        for left, top, right, bottom in BOXES:
            opening = inside(on_wall, left, top, right, bottom)
            picture[opening] = 90  # the reveal
            through = opening & inside(on_glass, left, top, right, bottom)
            picture[through] = behind[through]
        exposure = 0.8 + 0.4 * rng.random()
        rgb = np.clip(picture * exposure + rng.normal(0, 1.5, picture.shape), 0, 255)
        views.append(OrthoImage(name, rgb.astype(np.uint8), np.ones(SIZE, bool)))
    return views


def inside(place, left, top, right, bottom):
    return (place[0] > left) & (place[0] < right) & (place[1] > top) & (place[1] < bottom)


def fused(views, cameras):
    y, x = np.mgrid[0 : SIZE[0], 0 : SIZE[1]] + 0.5
    weights = []
    for view in views:
        foot = GRID.pixels_from_facade(cameras[view.source][:2])
        across, up = (x - foot[0]) * M_PER_PX, (y - foot[1]) * M_PER_PX
        resolution = wall_resolution(across, up, cameras[view.source][2])
        weights.append(resolution.astype(np.float32))
    return blend(views, weights)


def estimated(views, cameras=CAMERAS, boxes=BOXES):
    return estimate_recess(boxes, views, cameras, M_PER_PX, CONFIG)


@pytest.mark.parametrize("recess_m", [0.06, 0.12, 0.25, 0.40])
def test_the_recess_of_computed_views_is_found(recess_m):
    for estimate in estimated(render(recess_m, CAMERAS)):
        # Half the resolution at which views are compared; the sweep steps by 0.04 m.
        assert estimate.recess_m == pytest.approx(recess_m, abs=0.015)
        assert abs(estimate.recess_m - recess_m) < 2 * estimate.sigma_m
        assert estimate.views == len(CAMERAS)


def test_glass_flush_with_the_wall_has_no_recess():
    for estimate in estimated(render(0.0, CAMERAS)):
        assert estimate.recess_m == pytest.approx(0.0, abs=0.015)


def test_reflections_that_no_two_views_share_are_outvoted():
    views = render(0.2, CAMERAS, reflections=25.0)
    panes = [view.rgb[100:105, 66:85].astype(float) for view in views]
    assert np.abs(np.diff(panes, axis=0)).mean() > 10  # the reflections do differ
    for estimate in estimated(views):
        assert estimate.recess_m == pytest.approx(0.2, abs=0.02)


def test_the_recess_counts_from_the_wall_as_the_views_show_it():
    for estimate in estimated(render(0.2, CAMERAS, wall_m=-0.15)):
        assert estimate.recess_m == pytest.approx(0.2, abs=0.02)
        assert estimate.glass_m == pytest.approx(0.05, abs=0.015)


def test_a_smooth_wall_is_taken_to_stand_where_the_rest_of_the_facade_does():
    for estimate in estimated(render(0.2, CAMERAS, grain=0.0)):
        assert estimate.recess_m == pytest.approx(0.2, abs=0.03)


@pytest.mark.parametrize(
    "cameras",
    [
        {"a": np.array([4.2, 2.0, 9.0]), "b": np.array([-3.0, 2.0, 9.0])},
        {f"v{i}": np.array([4.2 + 0.1 * i, 2.6, 9.0 + i]) for i in range(6)},
        {f"v{i}": np.array([3.0 * i, 2.0, -5.0]) for i in range(4)},
    ],
    ids=["two views", "no baseline", "behind the wall"],
)
def test_without_baseline_nothing_is_said(cameras):
    views = render(0.2, {name: np.abs(camera) for name, camera in cameras.items()})
    for estimate in estimated(views, cameras):
        assert estimate.recess_m is None
        assert estimate.sigma_m == 0.0


def test_blank_panes_without_bars_say_nothing():
    rng = np.random.default_rng(1)
    views = [
        OrthoImage(
            name, np.clip(noise(rng, 2.0, 9.0), 0, 255).astype(np.uint8), np.ones(SIZE, bool)
        )
        for name in CAMERAS
    ]  # nothing in them belongs together
    assert all(estimate.recess_m is None for estimate in estimated(views))


def test_no_windows_and_no_cameras():
    views = render(0.1, CAMERAS)
    assert estimated(views, boxes=np.zeros((0, 4))) == ()
    assert estimated(views, cameras={}) == (UNKNOWN_RECESS,) * 3


def test_the_same_views_give_the_same_numbers_in_any_order():
    views = render(0.2, CAMERAS)
    first = estimated(views)
    assert estimated(views) == first
    for one, other in zip(first, estimated(views[::-1]), strict=True):
        assert one.recess_m == pytest.approx(other.recess_m, abs=1e-6)


def test_a_window_that_one_view_does_not_see_is_measured_by_the_others():
    views = render(0.2, CAMERAS)
    blind = views[0].valid.copy()
    blind[:, 150:] = False
    views[0] = OrthoImage(views[0].source, views[0].rgb, blind)
    estimates = estimated(views)
    assert [estimate.views for estimate in estimates] == [5, 4, 4]
    for estimate in estimates:
        assert estimate.recess_m == pytest.approx(0.2, abs=0.02)


def test_measured_windows_carry_their_recess_and_how_it_is_known():
    found = FusedDetections(
        Detections(BOXES[:2], np.full(2, 0.9), np.full(2, "window")),
        (("view0", "view1"),) * 2,
    )
    none = Detections(np.zeros((0, 4)), np.zeros(0), np.zeros(0, str))
    recesses = (RecessEstimate(0.2, 0.02, 0.0, 5), UNKNOWN_RECESS)
    deep, unknown = measure_windows(found, none, GRID, CAMERAS, CONFIG, recesses)
    assert (deep.recess_m, unknown.recess_m) == (0.2, None)
    assert "recess of 0.20 +- 0.02 m from parallax of 5 views" in deep.evidence
    assert "assumed recess of 0.12 m" in unknown.evidence
    assert deep.correction_m[3] / unknown.correction_m[3] == pytest.approx(0.2 / 0.12, rel=5e-3)
    assert deep.edge_sigma_m[3] < unknown.edge_sigma_m[3]


def test_windows_are_sharp_on_the_plane_of_their_glass_and_the_wall_is_untouched():
    views = render(0.25, CAMERAS)
    before = fused(views, CAMERAS)
    estimates = estimated(views)
    after = sharpen_windows(before, views, BOXES, estimates, CAMERAS, GRID)
    truth = np.clip(glass(np.random.default_rng(0)), 0, 255)
    outside = np.ones(SIZE, bool)
    for left, top, right, bottom in BOXES.astype(int):
        outside[top:bottom, left:right] = False
    assert (after.rgb[outside] == before.rgb[outside]).all()
    for left, top, right, bottom in BOXES.astype(int):
        # The lowest recess * tan(elevation) of the glass is hidden; the middle is not.
        part = np.s_[top + 5 : bottom - 30, left + 10 : right - 10, 1]
        bars = truth[part] > 200
        blurred, sharp = (
            float(image.rgb[part][bars].mean()) - float(image.rgb[part][~bars].mean())
            for image in (before, after)
        )
        assert sharp > 100  # of 215 - 60 grey levels; the thin bars are resampled
        assert sharp > 1.5 * blurred


def test_without_a_known_recess_the_picture_stays():
    views = render(0.2, CAMERAS)
    before = fused(views, CAMERAS)
    assert sharpen_windows(before, views, BOXES, (UNKNOWN_RECESS,) * 3, CAMERAS, GRID) is before


def test_opening_is_the_box_with_the_correction_of_the_window():
    recess = RecessEstimate(0.2, 0.02, 0.0, 5)
    found = FusedDetections(
        Detections(BOXES[:1], np.array([0.9]), np.array(["window"])),
        (("view0",),),
    )
    none = Detections(np.zeros((0, 4)), np.zeros(0), np.zeros(0, str))
    (window,) = measure_windows(found, none, GRID, CAMERAS, CONFIG, [recess])
    box = opening_box(BOXES[0], GRID, CAMERAS, recess, CONFIG)
    assert box[[0, 2]] * M_PER_PX == pytest.approx([window.x_m, window.x_m + window.width_m])
    bottom = (GRID.height_px - box[3]) * M_PER_PX
    assert bottom == pytest.approx(window.y_m)
    assert (box[3] - box[1]) * M_PER_PX == pytest.approx(window.height_m)


@given(st.floats(-500, 500), st.floats(50, 2000), st.floats(-10, 30), st.floats(-300, 300))
def test_a_view_shows_a_point_where_its_line_of_sight_meets_the_wall(foot, distance, depth, place):
    shrink, shift = seen_from(np.array([foot, 0.0]), distance, depth)
    shown = shrink * place + shift[0]
    # From the camera over the place shown, the line reaches the point at its depth.
    assert foot + (shown - foot) * (distance + depth) / distance == pytest.approx(place, abs=1e-6)


def test_a_patch_at_no_depth_is_the_patch_itself():
    image = np.arange(40, dtype=np.float32).reshape(5, 8)
    shrink, shift = seen_from(np.array([3.0, 2.0]), 100.0, 0.0)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    patch = cv2.warpAffine(image, patch_warp(shrink, shift, (2, 1)), (4, 3), flags=flags)
    assert (patch == image[1:4, 2:6]).all()


def test_the_widest_views_are_the_middle_and_the_ends():
    views = [
        OrthoImage(str(i), np.zeros((1, 1, 3), np.uint8), np.ones((1, 1), bool)) for i in range(9)
    ]
    cameras = {str(i): np.array([float(i), 2.0, 10.0]) for i in range(9)}
    assert [view.source for view in widest_views(views, cameras, 3)] == ["0", "4", "8"]
    assert len(widest_views(views, cameras, 20)) == 9
    assert widest_views([], cameras, 3) == []


def test_a_window_that_does_not_stand_free_has_the_depth_of_the_others():
    told = [RecessEstimate(depth, 0.02, depth, 5) for depth in (0.14, 0.15, 0.16, 0.50)]
    free = np.array([True, True, True, False])
    *same, changed = of_the_others(told, free)
    assert same == told[:3]
    assert (changed.recess_m, changed.sigma_m) == (pytest.approx(0.15), pytest.approx(0.03))
    assert changed.told_by == "3 other windows"
    assert of_the_others(told, np.array([True, True, False, False])) == tuple(told)
