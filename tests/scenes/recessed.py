"""A wall with recessed windows and balconies as a render with depth shows it, ray by ray."""

from dataclasses import dataclass

import numpy as np

from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Detections, OrthoImage

WALL, GLASS, BALCONY = (185, 150, 120), (50, 60, 75), (120, 120, 125)
BALCONY_DEPTH_M = 1.2
PHOTOS_TO_TRUST = 2


@dataclass
class Render:
    """The image, its grid, who sees what, and boxes (N, 4) in pixels of the glass that shows."""

    ortho: OrthoImage
    grid: FacadeGrid
    cameras: dict
    seen_from: dict
    shown_px: np.ndarray


def rendered(
    windows, recess_m, cameras, *, balconies=(), hidden="masked", m_per_px=0.01, size_m=(8.0, 6.0),
    wall_m=0.0, noise_m=0.0, lattice=1, seed=0,
):  # fmt: skip
    """The exact render of windows (left, right, bottom, top in metres) that lie recess_m deep.

    ``hidden`` says what fewer than two cameras saw looks like: ``masked``, ``glass`` where the
    field goes on with it, or ``slope`` where it fills the reveal up to the last line of sight.
    """
    rng = np.random.default_rng(seed)
    grid = FacadeGrid.covering(Rigid3(np.eye(3), np.zeros(3)), *size_m, m_per_px)
    shape = (grid.height_px, grid.width_px)
    row, column = np.mgrid[0 : shape[0], 0 : shape[1]] + 0.5
    x, y = np.moveaxis(grid.facade_from_pixels(np.stack([column, row], axis=-1)), -1, 0)
    recesses = np.broadcast_to(recess_m, len(windows))
    depth = np.full(shape, wall_m)
    rgb = np.empty((*shape, 3), np.uint8)
    rgb[:] = WALL
    seen_from = {name: np.full(shape, camera[2] > 0) for name, camera in cameras.items()}
    openings = []
    for (left, right, bottom, top), deep in zip(windows, recesses, strict=True):
        opening = (x > left) & (x < right) & (y > bottom) & (y < top)
        openings.append(opening)
        rgb[opening] = GLASS
        depth[opening] = wall_m - deep
        for name, camera in cameras.items():
            # Where the line of sight to the glass passes through the wall plane.
            part = deep / (camera[2] - wall_m + deep)
            through_x, through_y = x + part * (camera[0] - x), y + part * (camera[1] - y)
            free = (through_x > left) & (through_x < right)
            free &= (through_y > bottom) & (through_y < top)
            seen_from[name] &= free | ~opening
    for left, right, bottom, top in balconies:
        front = (x > left) & (x < right) & (y > bottom) & (y < top)
        rgb[front], depth[front] = BALCONY, wall_m + BALCONY_DEPTH_M
        openings = [opening & ~front for opening in openings]
    count = np.sum(list(seen_from.values()), axis=0).astype(np.uint8)
    unseen = count < PHOTOS_TO_TRUST
    valid = ~unseen
    shown = [opening & valid for opening in openings]
    if hidden == "glass":
        valid, shown = np.ones(shape, bool), openings
    elif hidden == "slope":
        valid = np.ones(shape, bool)
        for opening, (_, _, bottom, _), deep in zip(openings, windows, recesses, strict=True):
            strip = opening & unseen
            reach = y[strip].max() - bottom
            depth[strip] = wall_m - deep * (y[strip] - bottom) / reach
        shown = [opening & (depth < wall_m - 0.5 * recess_m) for opening in openings]
    depth = depth + rng.normal(0, noise_m, shape)
    depth[~valid] = np.nan
    rgb[~valid] = 0
    ortho = OrthoImage("radiance", rgb, valid, depth.astype(np.float32), count)
    coarse = {name: seen[lattice // 2 :: lattice, lattice // 2 :: lattice]
              for name, seen in seen_from.items()}  # fmt: skip
    return Render(ortho, grid, cameras, coarse, np.array([bounds(mask) for mask in shown]))


def bounds(mask):
    """The box (4,) x0 y0 x1 y1 around True."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return [columns[0], rows[0], columns[-1] + 1, rows[-1] + 1]


class ToldDetector:
    """Finds what it is told: boxes in pixels with scores and labels."""

    thresholds = {"window": 0.4, "balcony": 0.3}  # noqa: RUF012
    wwr_errors = None

    def __init__(self, boxes_px, scores=0.9, labels="window"):
        boxes = np.asarray(boxes_px, float).reshape(-1, 4)
        scores = np.broadcast_to(np.asarray(scores, float), len(boxes))
        labels = np.broadcast_to(np.asarray(labels, np.str_), len(boxes))
        self._found = Detections(boxes, scores, labels, np.full((len(boxes), 4), 0.5))

    def detect(self, image, m_per_px):
        """What it was told, best first."""
        return self._found.select(np.argsort(-self._found.scores, kind="stable"))
