"""How well a rendered orthophoto and its depth agree with the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from benchmarks.accuracy.radiance.renderer import Truth
from benchmarks.accuracy.radiance.solids import Opening
from numpy.typing import NDArray

from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Image

MIN_PHOTOS = 2
BALCONY_M = 0.6
WALL_M = 0.01

SEARCH_CM = 12.0
FOUND_CM = 8.0
MIN_CONTRAST = 1 / 3
STEP_CM = 0.25
SMOOTHING_CM = 1.6
SIDE_CM = 6.0
"""Both sides of an edge must show this much; no frame is narrower."""

MAX_OWN_ERROR_CM = 1.0
"""An edge that is not the strongest step of the true picture cannot be scored this way."""

SIDES = ("left", "right", "bottom", "top")


@dataclass(frozen=True)
class Rendering:
    """What is scored: an orthophoto on the truth's grid and, where known, its depth.

    Attributes
    ----------
    rgb
        (H, W, 3) uint8.
    depth_m
        (H, W) metres in front of the wall, NaN where unknown; None without depth.
    """

    rgb: Image
    depth_m: NDArray[np.float32] | None = None


@dataclass(frozen=True)
class Scores:
    """Agreement with the truth where two photos saw; NaN where nothing could be measured.

    Attributes
    ----------
    psnr_db, psnr_gain_db
        As rendered, and after one factor per channel.
    edges, edges_missed, edge_cm
        Edges of openings that two photos saw on both sides, how many of them the picture does not
        show within 8 cm at a third of the contrast, median error of the others.
    wall_cm, glass_cm, balcony_cm
        Absolute error of depth, (median, 90th percentile) over pixels.
    recess_cm
        The same of the glass behind the wall around it, over openings.
    balcony_iou
        Of the pixels more than 0.6 m in front.
    """

    psnr_db: float
    psnr_gain_db: float
    edges: int
    edges_missed: int
    edge_cm: float
    wall_cm: tuple[float, float]
    glass_cm: tuple[float, float]
    balcony_cm: tuple[float, float]
    recess_cm: tuple[float, float]
    balcony_iou: float


def score(rendering: Rendering, truth: Truth, openings: Sequence[Opening]) -> Scores:
    """All scores of a rendering."""
    seen = truth.seen_by >= MIN_PHOTOS
    depth_m = rendering.depth_m
    if depth_m is None:
        depth_m = np.full(truth.depth_m.shape, np.nan, np.float32)
    errors_cm = edge_errors_cm(rendering.rgb, truth, openings)
    missed = ~np.isfinite(errors_cm)
    off_cm = 100 * np.abs(depth_m - truth.depth_m)
    raw_db, gain_db = psnr_db(rendering.rgb, truth.rgb, seen)
    return Scores(
        raw_db,
        gain_db,
        len(errors_cm),
        int(missed.sum()),
        float(np.median(np.abs(errors_cm[~missed]))) if (~missed).any() else np.nan,
        _middle_and_tail(off_cm[seen & (np.abs(truth.depth_m) < WALL_M)]),
        _middle_and_tail(off_cm[seen & _glass(truth, openings)]),
        _middle_and_tail(off_cm[seen & (truth.depth_m > BALCONY_M)]),
        _middle_and_tail(recess_errors_cm(depth_m, truth, openings)),
        _iou(depth_m > BALCONY_M, truth.depth_m > BALCONY_M, seen)
        if np.isfinite(depth_m).any()
        else np.nan,
    )


def psnr_db(rgb: Image, true_rgb: Image, where: NDArray[np.bool_]) -> tuple[float, float]:
    """PSNR as it is, and after the factor per channel that fits best."""
    found, true = rgb[where].astype(np.float64), true_rgb[where].astype(np.float64)
    gain = (found * true).sum(axis=0) / np.maximum((found**2).sum(axis=0), 1e-9)
    squares = [np.mean((found * factor - true) ** 2) for factor in (1.0, gain)]
    raw, fitted = (float(10 * np.log10(255**2 / max(square, 1e-9))) for square in squares)
    return raw, fitted


def edge_errors_cm(rgb: Image, truth: Truth, openings: Sequence[Opening]) -> FloatArray:
    """Signed errors (N,) of edges, positive outwards from the opening; NaN for a missed edge."""
    errors = []
    for opening in openings:
        for side in SIDES:
            x_px, y_px = _lines_across(opening, side, truth.grid)
            used = _usable(x_px, y_px, truth, opening)
            if used.mean() < 0.5:
                continue
            true = _profile(truth.rgb, x_px[used], y_px[used])
            found = _profile(rgb, x_px[used], y_px[used])
            offsets = _offsets_cm()
            outside = (offsets > 1) & (offsets < SIDE_CM)
            inside = (offsets < -1) & (offsets > -SIDE_CM)
            step = true[outside].mean(axis=0) - true[inside].mean(axis=0)
            direction = step / max(float(np.linalg.norm(step)), 1e-9)
            own_cm, contrast = _strongest_step(true @ direction)
            if abs(own_cm) > MAX_OWN_ERROR_CM:
                continue
            place_cm, strength = _strongest_step(found @ direction)
            sound = abs(place_cm) <= FOUND_CM and strength >= MIN_CONTRAST * contrast
            errors.append(place_cm if sound else np.nan)
    return np.array(errors)


def _offsets_cm() -> FloatArray:
    reach = SEARCH_CM + 4 * SMOOTHING_CM
    return np.linspace(-reach, reach, round(2 * reach / STEP_CM) + 1)


def _lines_across(
    opening: Opening, side: str, grid: FacadeGrid
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Pixels (lines, offsets) x and y of lines across an edge, inside to outside."""
    upright = side in {"left", "right"}
    outwards = 1 if side in {"right", "top"} else -1
    ends = (opening.bottom, opening.top) if upright else (opening.left, opening.right)
    along = np.arange(ends[0] + 0.1, ends[1] - 0.1, grid.m_per_px)[:, None]
    across = (getattr(opening, side) + outwards * _offsets_cm() / 100)[None, :]
    places = np.broadcast_arrays(*((across, along) if upright else (along, across)))
    pixels = grid.pixels_from_facade(np.stack(places, axis=-1)).astype(np.float32)
    return pixels[..., 0], pixels[..., 1]


def _usable(
    x_px: NDArray[np.float32], y_px: NDArray[np.float32], truth: Truth, opening: Opening
) -> NDArray[np.bool_]:
    """(lines,) wall outside, recess inside, and two photos saw both."""
    rows, columns = truth.depth_m.shape
    in_picture = (x_px >= 0) & (x_px < columns) & (y_px >= 0) & (y_px < rows)
    column = np.clip(x_px, 0, columns - 1).astype(np.intp)
    row = np.clip(y_px, 0, rows - 1).astype(np.intp)
    depth_m = truth.depth_m[row, column]
    offsets = _offsets_cm()
    outside = (offsets > 2) & (offsets < SIDE_CM)
    inside = (offsets < -2) & (offsets > -SIDE_CM)
    usable = in_picture.all(axis=1)
    usable &= (np.abs(depth_m[:, outside]) < WALL_M).all(axis=1)
    usable &= (depth_m[:, inside] < -opening.recess + WALL_M).all(axis=1)
    seen = truth.seen_by[row, column] >= MIN_PHOTOS
    return np.asarray(usable & seen[:, outside | inside].all(axis=1))


def _profile(
    rgb: Image, x_px: NDArray[np.float32], y_px: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Mean colour (offsets, 3) along an edge, by distance from it."""
    # cv2 puts (0, 0) at the centre of the first pixel.
    lines = cv2.remap(
        rgb, x_px - 0.5, y_px - 0.5, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(lines.astype(np.float64).mean(axis=0))


def _strongest_step(profile: FloatArray) -> tuple[float, float]:
    """Place in cm and height in grey levels of the steepest rise of a profile."""
    offsets = _offsets_cm()
    distance = offsets[:, None] - offsets[None, :]
    kernel = -distance * np.exp(-((distance / SMOOTHING_CM) ** 2) / 2)
    slope = (kernel * (profile[None, :] - profile.mean())).sum(axis=1)
    slope[np.abs(offsets) > SEARCH_CM] = -np.inf
    top = int(slope.argmax())
    place = offsets[top]
    if np.isfinite(slope[[top - 1, top + 1]]).all():
        before, at, after = slope[top - 1 : top + 2]
        place += STEP_CM * (before - after) / 2 / min(before - 2 * at + after, -1e-12)
    above = (offsets > place + 1) & (offsets < place + 4)
    below = (offsets < place - 1) & (offsets > place - 4)
    return float(place), float(profile[above].mean() - profile[below].mean())


def recess_errors_cm(
    depth_m: NDArray[np.float32], truth: Truth, openings: Sequence[Opening]
) -> FloatArray:
    """Absolute error (N,) of the recess of each opening whose glass two photos saw."""
    seen = truth.seen_by >= MIN_PHOTOS
    errors = []
    for opening in openings:
        wall = _within(truth.grid, opening, 0.3) & seen & (np.abs(truth.depth_m) < WALL_M)
        glass = _glass(truth, [opening]) & seen
        if glass.sum() >= 50 and wall.sum() >= 50:
            recess_m = _known_median(depth_m[wall]) - _known_median(depth_m[glass])
            errors.append(100 * abs(recess_m - opening.glass_depth_m))
    return np.array(errors)


def _known_median(depth_m: NDArray[np.float32]) -> float:
    """Median in metres; NaN where more than half is unknown."""
    known = depth_m[np.isfinite(depth_m)]
    return float(np.median(known)) if 2 * len(known) > len(depth_m) else np.nan


def _within(grid: FacadeGrid, opening: Opening, margin_m: float) -> NDArray[np.bool_]:
    """(H, W) pixels in an opening and a margin around it."""
    left, top = grid.pixels_from_facade([opening.left - margin_m, opening.top + margin_m])
    right, bottom = grid.pixels_from_facade([opening.right + margin_m, opening.bottom - margin_m])
    x, y = np.arange(grid.width_px) + 0.5, np.arange(grid.height_px) + 0.5
    return ((y > top) & (y < bottom))[:, None] & ((x > left) & (x < right))[None, :]


def _glass(truth: Truth, openings: Sequence[Opening]) -> NDArray[np.bool_]:
    glass = np.zeros(truth.depth_m.shape, np.bool_)
    for opening in openings:
        at = np.abs(truth.depth_m + opening.glass_depth_m) < WALL_M
        glass |= _within(truth.grid, opening, 0.0) & at
    return glass


def _iou(first: NDArray[np.bool_], second: NDArray[np.bool_], where: NDArray[np.bool_]) -> float:
    both, either = (first & second & where).sum(), ((first | second) & where).sum()
    return float(both / either) if either else np.nan


def _middle_and_tail(errors: NDArray[np.floating]) -> tuple[float, float]:
    known = errors[np.isfinite(errors)]
    if not len(known):
        return np.nan, np.nan
    # Unknown depth counts as wrong.
    filled = np.where(np.isfinite(errors), errors, np.inf)
    middle, tail = np.quantile(filled, [0.5, 0.9], method="lower")
    return float(middle), float(tail)
