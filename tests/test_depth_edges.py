"""Sides at the step from the wall to the glass, against openings whose sides are known."""

import cv2
import numpy as np
import pytest
from tests.scenes.recessed import rendered

from si3fp.config import MeasureConfig
from si3fp.model import Detections, OrthoImage
from si3fp.windows.depth import depth_recesses
from si3fp.windows.depth_edges import edges_by_depth
from si3fp.windows.fuse import FusedDetections
from si3fp.windows.recess_estimate import UNKNOWN_RECESS, RecessEstimate

M_PER_PX = 0.02
WINDOW = (3.0, 4.2, 2.4, 3.8)
TRUE_PX = np.array([150.0, 110, 210, 180])
CAMERAS = {name: np.array([x, 3.0, 7.0]) for name, x in (("a", 2.0), ("b", 4.0), ("c", 6.0))}


def image(recess_m=0.2, *, blur_px=0.0, noise_m=0.0, wall_m=0.0, seed=0):
    """A render whose depth is smeared and whose errors are alike over some pixels."""
    render = rendered([WINDOW], recess_m, CAMERAS, m_per_px=M_PER_PX, wall_m=wall_m)
    depth = np.nan_to_num(render.ortho.depth_m.astype(np.float64), nan=wall_m - recess_m)
    if blur_px:
        depth = cv2.GaussianBlur(depth, (0, 0), blur_px)
    if noise_m:
        noise = cv2.GaussianBlur(np.random.default_rng(seed).normal(size=depth.shape), (0, 0), 2.0)
        depth = depth + noise_m * noise / noise.std()
    whole = np.ones(depth.shape, bool)
    return OrthoImage("radiance", render.ortho.rgb, whole, depth.astype(np.float32))


def moved(ortho, off_px, recess=None, sigma_px=2.0):
    box = TRUE_PX + np.asarray(off_px, float)
    found = FusedDetections(
        Detections([box], [0.9], ["window"], np.full((1, 4), sigma_px)), (("a", "b"),), ("seen",)
    )
    if recess is None:
        (recess,) = depth_recesses(ortho, box[None], 0.0, M_PER_PX, MeasureConfig())
    return edges_by_depth(found, [recess], ortho, M_PER_PX)


OFFSETS = [(0, 0, 0, 0), (3, 3, -3, -3), (-3, -2, 2, 3), (2, -2, 3, -1)]


@pytest.mark.parametrize("off_px", OFFSETS)
@pytest.mark.parametrize("recess_m", [0.1, 0.2, 0.35])
def test_sides_go_to_the_step(off_px, recess_m):
    after = moved(image(recess_m), off_px)
    assert after.detections.boxes_px[0] == pytest.approx(TRUE_PX, abs=0.6)
    assert after.notes == ("seen",)
    assert after.views == (("a", "b"),)


@pytest.mark.parametrize("seed", range(4))
def test_noise_and_blur_leave_about_a_centimetre_which_is_said(seed):
    ortho = image(blur_px=1.2, noise_m=0.04, wall_m=-0.1, seed=seed)
    after = moved(ortho, (2, 2, -2, -2)).detections
    off = after.boxes_px[0] - TRUE_PX
    assert np.abs(off).max() < 1.2  # pixels of 0.02 m
    assert np.abs(off / after.edge_sigma_px[0]).max() < 3
    assert after.edge_sigma_px.max() < 1.5


def test_what_panes_mirror_and_a_sill_that_stands_out_do_not_matter():
    ortho = image()
    depth = ortho.depth_m.copy()
    depth[120:172, 160:200] = -0.9
    depth[180:186, 145:215] = 0.08
    after = moved(OrthoImage("radiance", ortho.rgb, ortho.valid, depth), (2, 2, -2, -2))
    assert after.detections.boxes_px[0] == pytest.approx(TRUE_PX, abs=0.6)


@pytest.mark.parametrize(
    "recess", [UNKNOWN_RECESS, RecessEstimate(0.03, 0.02, 0.03, 1)], ids=["unknown", "shallow"]
)
def test_without_a_step_the_sides_stay(recess):
    after = moved(image(0.03), (2, 2, -2, -2), recess).detections
    assert after.boxes_px[0].tolist() == (TRUE_PX + np.array([2, 2, -2, -2])).tolist()
    assert after.edge_sigma_px[0].tolist() == [2.0] * 4


def test_a_side_around_which_nobody_saw_stays():
    ortho = image()
    valid = ortho.valid.copy()
    valid[165:] = False
    blind = OrthoImage("radiance", ortho.rgb, valid, ortho.depth_m)
    after = moved(blind, (2, 2, -2, -2)).detections
    assert after.boxes_px[0, 3] == TRUE_PX[3] - 2
    assert after.boxes_px[0, :3] == pytest.approx(TRUE_PX[:3], abs=0.6)


def test_a_window_at_the_border_of_the_image():
    ortho = image()
    part = OrthoImage("radiance", ortho.rgb[110:], ortho.valid[110:], ortho.depth_m[110:])
    found = FusedDetections(
        Detections([TRUE_PX - [0, 110, 2, 110]], [0.9], ["window"], np.full((1, 4), 2.0)), (("a",),)
    )
    recess = RecessEstimate(0.2, 0.02, 0.2, 1)
    after = edges_by_depth(found, [recess], part, M_PER_PX).detections.boxes_px[0]
    assert after == pytest.approx(TRUE_PX - [0, 110, 0, 110], abs=1.5)
