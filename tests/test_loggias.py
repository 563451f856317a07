"""Back walls of loggias, from views that are computed ray by ray: 0.04 m per pixel.

Four storeys of 2.8 m with a loggia 3 m wide. Fronts reach 1.1 m up from the slabs' edges; the next
slab is what ends the opening above. Cameras stand 2.5 m above the road.
"""

import cv2
import numpy as np
import pytest

from si3fp.blend import blend
from si3fp.config import MeasureConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Detections, OrthoImage
from si3fp.windows.balcony_columns import BalconyColumn
from si3fp.windows.loggias import NO_LOGGIAS, find_loggias, moved_back, on_back_walls

STEP_M = 0.04
SIZE = (300, 200)
GRID = FacadeGrid(Rigid3(np.eye(3), np.zeros(3)), SIZE[1], SIZE[0], STEP_M)
SIDES_M, FRONT_M = (2.5, 5.5), 1.1
EDGES_M = 0.4 + 2.8 * np.arange(4)
CAMERAS = {f"view{x}": np.array([x, 2.5, 11.0]) for x in (-3.0, 0.5, 4.0, 7.5, 11.0)}
CONFIG = MeasureConfig()


def px(left, right, bottom, top):
    return np.array([left, 12 - top, right, 12 - bottom]) / STEP_M


FRONTS = Detections(
    np.array([px(*SIDES_M, edge, edge + FRONT_M) for edge in EDGES_M]),
    np.full(4, 0.8),
    np.full(4, "balcony"),
)
OPENINGS = np.array(
    [
        px(*SIDES_M, edge + FRONT_M, above)
        for edge, above in zip(EDGES_M, [*EDGES_M[1:], 12.0], strict=True)
    ]
)


def column(ahead_m=0.0):
    return BalconyColumn(*SIDES_M, EDGES_M, EDGES_M, ahead_m)


def texture(seed):
    field = np.random.default_rng(seed).normal(size=(*SIZE, 3))
    field = cv2.GaussianBlur(field, (0, 0), 1.5)
    return (128 + 40 * field / field.std()).clip(0, 255)


WALL, BACK = texture(1), texture(2)


def behind(camera, depth_m):
    """Columns and rows at which lines of sight through the pixels meet a plane behind the wall."""
    foot = GRID.pixels_from_facade(camera[:2])
    y, x = np.mgrid[0 : SIZE[0], 0 : SIZE[1]] + 0.5
    reach = depth_m / camera[2]
    return x + (x - foot[0]) * reach, y + (y - foot[1]) * reach


def views(depth_m):
    found = []
    for name, camera in CAMERAS.items():
        u, v = (axis.astype(np.float32) - 0.5 for axis in behind(camera, depth_m))
        back = cv2.remap(BACK, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
        rgb = WALL.copy()
        for box in OPENINGS.round().astype(int):
            part = (slice(box[1], box[3]), slice(box[0], box[2]))
            rgb[part] = back[part]
        found.append(OrthoImage(name, rgb.round().astype(np.uint8), np.ones(SIZE, bool)))
    return found


def found_in(depth_m, *, ahead_m=0.0, fronts=FRONTS):
    return find_loggias(fronts, (column(ahead_m),), views(depth_m), CAMERAS, GRID, CONFIG)


@pytest.mark.parametrize("depth_m", [0.9, 1.25, 1.7])
def test_the_depth_of_the_back_walls_and_their_openings_are_found(depth_m):
    loggias = found_in(depth_m)
    assert loggias.depth_m == pytest.approx(depth_m, abs=0.06)
    assert loggias.openings_px == pytest.approx(OPENINGS)


def test_a_wall_right_behind_balconies_that_stand_out_and_no_fronts_make_no_loggia():
    assert found_in(0.0) is NO_LOGGIAS
    assert found_in(1.25, ahead_m=1.2) is NO_LOGGIAS
    assert found_in(1.25, fronts=FRONTS.select(np.zeros(0, int))) is NO_LOGGIAS


def test_the_picture_shows_the_back_wall_where_cameras_see_it():
    seen_from = views(1.2)
    loggias = found_in(1.2)
    fused = blend(seen_from, [np.ones(SIZE, np.float32)] * len(seen_from))
    image, seen = on_back_walls(fused, seen_from, loggias, CAMERAS, GRID)
    left, top, right, bottom = OPENINGS[1].round().astype(int)
    part = (slice(top, bottom), slice(left, right))
    # Over the rail, 5.9 - 2 m above the cameras' eyes, the view rises by 1.2 / 11 per metre.
    hidden_px = (EDGES_M[1] + FRONT_M - 2.5) * 1.2 / 11 / STEP_M
    rows = np.flatnonzero(image.valid[part].all(axis=1))
    assert bottom - top - 1 - rows.max() == pytest.approx(hidden_px, abs=3)
    assert (seen[part] > 0).tolist() == image.valid[part].tolist()
    off = np.abs(image.rgb[part].astype(float) - BACK[part])[image.valid[part]]
    before = np.abs(fused.rgb[part].astype(float) - BACK[part])[image.valid[part]]
    assert off.mean() < 0.35 * before.mean()
    outside = np.isnan(seen)
    assert (image.rgb[outside] == fused.rgb[outside]).all()
    assert image.valid[outside].all()


def test_detections_of_a_view_move_to_where_they_are_on_the_back_wall():
    loggias = found_in(1.2)
    camera = CAMERAS["view7.5"]
    truth = px(3.2, 4.2, 4.8, 5.6)
    foot = GRID.pixels_from_facade(camera[:2])
    # By similar triangles, a place 1.2 m behind appears drawn towards the camera's foot.
    appears = (truth * 11 + np.tile(foot, 2) * 1.2) / 12.2
    beside, gone = px(6.3, 7.3, 4.8, 5.6), px(2.6, 2.7, 4.8, 5.6)
    boxes = np.array([appears, beside, gone])
    found = Detections(boxes, np.full(3, 0.9), np.full(3, "window"), np.ones((3, 4)))
    moved = moved_back(found, camera, loggias, GRID)
    assert moved.boxes_px[0] == pytest.approx(truth, abs=0.3)
    assert moved.edge_sigma_px[0] == pytest.approx(1.2 / 11 + 1, rel=0.01)
    # What stands beside the loggia stays; what would lie in its side wall is no opening.
    assert moved.boxes_px[1].tolist() == beside.tolist()
    assert len(moved) == 2
