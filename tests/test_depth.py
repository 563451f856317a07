"""Depth of a render against walls, windows and balconies whose depth is known."""

import numpy as np
import pytest
from tests.scenes.recessed import rendered

from si3fp.config import MeasureConfig
from si3fp.errors import InputError
from si3fp.model import OrthoImage
from si3fp.windows.depth import depth_recesses, in_front, wall_depth

CONFIG = MeasureConfig()
CAMERAS = {name: np.array([x, 3.0, 7.0]) for name, x in (("a", 2.0), ("b", 4.0), ("c", 6.0))}
WINDOWS = [(0.6 + 2.6 * k, 1.6 + 2.6 * k, 2.4, 3.8) for k in range(3)]
BOXES = np.array([[left, 6 - top, right, 6 - bottom] for left, right, bottom, top in WINDOWS]) * 100


def recesses(render, boxes=BOXES):
    wall_m = wall_depth(render.ortho)
    return depth_recesses(render.ortho, boxes, wall_m, render.grid.m_per_px, CONFIG)


def changed(render, depth_m, valid=None):
    ortho = render.ortho
    render.ortho = OrthoImage(
        "radiance", ortho.rgb, ortho.valid if valid is None else valid, depth_m
    )
    return render


@pytest.mark.parametrize("recess_m", [0.0, 0.08, 0.2, 0.4])
@pytest.mark.parametrize("wall_m", [0.0, -0.15])
def test_the_recess_is_the_depth_behind_the_wall_around_the_window(recess_m, wall_m):
    render = rendered(WINDOWS, recess_m, CAMERAS, wall_m=wall_m, noise_m=0.03)
    assert wall_depth(render.ortho) == pytest.approx(wall_m, abs=0.005)
    for estimate in recesses(render):
        # Thousands of pixels of 0.03 m.
        assert estimate.recess_m == pytest.approx(recess_m, abs=0.005)
        assert estimate.glass_m == pytest.approx(recess_m - wall_m, abs=0.005)
        assert 0.02 <= estimate.sigma_m < 0.04


def test_reflections_in_the_panes_do_not_count_where_frames_tell():
    render = rendered(WINDOWS, 0.15, CAMERAS)
    depth = render.ortho.depth_m.copy()
    for left, top, right, bottom in BOXES.astype(int):
        depth[top + 12 : bottom - 12, left + 12 : right - 12] = -0.45
    for estimate in recesses(changed(render, depth)):
        assert estimate.recess_m == pytest.approx(0.15, abs=0.01)


def test_parts_of_a_window_that_contradict_each_other_tell_nothing():
    render = rendered(WINDOWS[:1], 0.15, CAMERAS)
    depth = render.ortho.depth_m.copy()
    left, top, right, bottom = BOXES[0].astype(int)
    depth[top:bottom, left:right] = np.linspace(0.3, -0.6, right - left)
    (estimate,) = recesses(changed(render, depth), BOXES[:1])
    assert estimate.recess_m is None


def test_a_window_that_tells_nothing_takes_the_depth_of_its_kind_and_is_less_sure():
    render = rendered(WINDOWS, [0.15, 0.15, 0.15], CAMERAS, noise_m=0.02)
    depth = render.ortho.depth_m.copy()
    left, top, right, bottom = BOXES[1].astype(int)
    depth[top:bottom, left:right] = np.nan
    one, blind, other = recesses(changed(render, depth))
    assert blind.recess_m == pytest.approx(0.15, abs=0.01)
    assert "2 windows of its size" in blind.told_by
    assert one.told_by == other.told_by == "depth"
    assert blind.sigma_m > one.sigma_m
    alone = recesses(render, BOXES[1:2])
    assert alone[0].recess_m is None


def test_windows_of_another_size_are_another_kind():
    small = (0.6, 1.1, 2.4, 2.9)
    render = rendered([small, *WINDOWS[1:]], [0.05, 0.25, 0.25], CAMERAS)
    boxes = np.vstack([[60, 310, 110, 360], BOXES[1:]])
    found = [estimate.recess_m for estimate in recesses(render, boxes)]
    assert found == pytest.approx([0.05, 0.25, 0.25], abs=0.01)


def test_what_no_two_photos_saw_does_not_count():
    render = rendered(WINDOWS, 0.15, CAMERAS)
    depth, valid = render.ortho.depth_m.copy(), render.ortho.valid.copy()
    left, _, right, bottom = BOXES[0].astype(int)
    depth[bottom - 40 : bottom, left:right] = -0.6
    valid[bottom - 40 : bottom, left:right] = False
    estimate = recesses(changed(render, depth, valid))[0]
    assert estimate.recess_m == pytest.approx(0.15, abs=0.01)


def test_a_balcony_beside_a_window_is_not_its_wall():
    render = rendered(WINDOWS, 0.15, CAMERAS, balconies=[(0.2, 2.2, 1.3, 2.6)])
    estimate = recesses(render)[0]
    assert estimate.recess_m == pytest.approx(0.15, abs=0.01)


def test_a_wall_that_bulges_around_a_window_is_still_flat():
    render = rendered(WINDOWS, 0.15, CAMERAS)
    depth = render.ortho.depth_m.copy()
    left, top, right, bottom = BOXES[1].astype(int)
    around = np.s_[top - 60 : bottom + 60, left - 60 : right + 60]
    bulge = 0.28 * np.random.default_rng(0).random(depth[around].shape)
    depth[around] = np.where(depth[around] > -0.1, bulge, depth[around])
    estimate = recesses(changed(render, depth))[1]
    # The bulge is 0.14 m in the middle, and believed by less than half.
    assert estimate.recess_m == pytest.approx(0.15, abs=0.07)
    assert estimate.sigma_m > recesses(rendered(WINDOWS, 0.15, CAMERAS))[1].sigma_m


def test_no_windows_and_no_depth():
    render = rendered(WINDOWS, 0.15, CAMERAS)
    assert recesses(render, np.zeros((0, 4))) == ()
    with pytest.raises(InputError, match="has no depth"):
        wall_depth(OrthoImage("mosaic", render.ortho.rgb, render.ortho.valid))
    nothing = np.full(render.ortho.valid.shape, np.nan, np.float32)
    blind = changed(render, nothing)
    assert wall_depth(blind.ortho) == 0.0
    assert not in_front(blind.ortho, 0.0).any()
    assert all(estimate.recess_m is None for estimate in recesses(blind))
