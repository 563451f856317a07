"""M.1: box edges moved onto the glazed unit with its frame, by the colours of the fused image.

A network trained on loose labels boxes stone surrounds with the window. Inside a window, colours
repeat from side to side (glass, frame, muntins); a surround shows colours that the window's inside
does not. Each side of a box is moved, within `MeasureConfig.search_m`, to where the most columns
(rows) that look like the inside are inside and the most others outside, at a place with a strong
gradient. The windows of one facade that are alike share what they learn: a side moves by the same
amount in all of them before it moves by its own evidence.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.config import MeasureConfig
from si3fp.geometry.rigid import FloatArray
from si3fp.model import OrthoImage
from si3fp.windows.fuse import FusedDetections

COLOUR_BINS = 12
MULLION_SHARE = 0.12
"""Share of the width on both sides of the middle that tells only what is not outside as well."""
FRAME_M = 0.04
UNKNOWN = 5e-5
"""Density added to the histograms: a colour that neither knows, as of a frame, tells nothing."""
LIKENESS_WEIGHT = 0.25
"""Score per 2 cm of columns or rows that look like the inside."""
EDGE_WEIGHT = 3.0
EDGE_SLOPE = 6.0
"""Grey levels per pixel at which an edge counts half."""
LEAST_SIGMA_PX = 0.5
"""No detected side is known better than this."""
CORE_SHARE = 0.2
"""Share of the size that is left out on each side where the inside's colours are learnt."""


def refine_boxes(
    fused: FusedDetections, image: OrthoImage, m_per_px: float, config: MeasureConfig
) -> FusedDetections:
    """The same windows with their sides moved and the standard deviations of these.

    Sides without evidence stay where they are.

    Parameters
    ----------
    fused
        Boxes in pixels of the image. Where the network tells how far a side may lie off, that
        bounds how far it moves, else ``config.box_sigma_m`` does.
    image
        The fused orthophoto.
    m_per_px
        Its resolution.
    config
        How far a side may move.
    """
    boxes = fused.detections.boxes_px
    if not config.refine or not len(boxes):
        return fused
    reach = max(1, round(config.search_m / m_per_px))
    offsets = np.arange(-reach, reach + 1)
    colours = _colour_index(image)
    strength = _gradients(image)
    evidence = np.stack(
        [_evidence(box, boxes, colours, strength, offsets, m_per_px, image.valid) for box in boxes]
    )
    told = fused.detections.edge_sigma_px * m_per_px
    told = np.where(told > 0, np.maximum(told, LEAST_SIGMA_PX * m_per_px), config.box_sigma_m)
    prior = -0.5 * (offsets * m_per_px / told[..., None]) ** 2
    shared = _shared_offsets(boxes, evidence + prior, offsets)
    near = -0.5 * ((offsets - shared[..., None]) * m_per_px / config.own_sigma_m) ** 2
    total = evidence + prior + near
    # The mean of a side's distribution errs less than its peak, and its width is what to expect.
    weight = np.exp(total - total.max(axis=-1, keepdims=True))
    weight /= weight.sum(axis=-1, keepdims=True)
    moves = (weight * offsets).sum(axis=-1)
    sigma = np.sqrt((weight * (offsets - moves[..., None]) ** 2).sum(axis=-1))
    moved = boxes + np.array([-1.0, -1.0, 1.0, 1.0]) * moves
    keep_size = (moved[:, 2:] - moved[:, :2]) > 0.4 * (boxes[:, 2:] - boxes[:, :2])
    moved = np.where(np.tile(keep_size, 2), moved, boxes)
    found = replace(fused.detections, boxes_px=moved, edge_sigma_px=sigma)
    return replace(fused, detections=found)


def _colour_index(image: OrthoImage) -> NDArray[np.int_]:
    """(H, W) index of a coarse CIE Lab colour cell, stretched to the facade's own range."""
    lab = cv2.cvtColor(image.rgb, cv2.COLOR_RGB2LAB).astype(np.float64)
    seen = lab[image.valid]
    if not len(seen):
        return np.zeros(image.valid.shape, np.int_)
    low, high = np.quantile(seen, [0.01, 0.99], axis=0)
    # Chroma of a grey facade must not be stretched into noise.
    span = np.maximum(high - low, [32.0, 48.0, 48.0])
    middle = (high + low) / 2
    cells = np.clip((lab - middle) / span + 0.5, 0, 0.999) * COLOUR_BINS
    cells = cells.astype(np.int_)
    index: NDArray[np.int_] = (cells[..., 0] * COLOUR_BINS + cells[..., 1]) * COLOUR_BINS + cells[
        ..., 2
    ]
    return index


def _gradients(image: OrthoImage) -> FloatArray:
    """(2, H, W, 3) derivative of the smoothed colour along x and y."""
    smooth = cv2.GaussianBlur(image.rgb, (0, 0), 1.0).astype(np.float64)
    across, down = np.zeros_like(smooth), np.zeros_like(smooth)
    across[:, 1:-1] = (smooth[:, 2:] - smooth[:, :-2]) / 2
    down[1:-1] = (smooth[2:] - smooth[:-2]) / 2
    return np.stack([across, down])


def _evidence(
    box: FloatArray,
    boxes: FloatArray,
    colours: NDArray[np.int_],
    gradients: FloatArray,
    offsets: NDArray[np.int_],
    m_per_px: float,
    valid: NDArray[np.bool_],
) -> FloatArray:
    """Score (4, K) of moving the left, top, right and bottom side outwards by the offsets."""
    height, width = valid.shape
    reach = int(offsets[-1])
    ring = reach + max(2, round(0.3 / m_per_px))
    left, top, right, bottom = box.round().astype(int)
    x0, y0 = max(left - ring, 0), max(top - ring, 0)
    x1, y1 = min(right + ring, width), min(bottom + ring, height)
    likeness = _likeness(
        box, boxes, colours[y0:y1, x0:x1], valid[y0:y1, x0:x1], (x0, y0), FRAME_M / m_per_px
    )
    scores = np.zeros((4, len(offsets)))
    inner_y = _middle(top - y0, bottom - y0, y1 - y0)
    inner_x = _middle(left - x0, right - x0, x1 - x0)
    columns = likeness[inner_y].mean(axis=0)
    rows = likeness[:, inner_x].mean(axis=1)
    edge_x = np.linalg.norm(gradients[0, y0:y1, x0:x1][inner_y].mean(axis=0), axis=-1)
    edge_y = np.linalg.norm(gradients[1, y0:y1, x0:x1][:, inner_x].mean(axis=1), axis=-1)
    for side, (profile, edge, place, outward) in enumerate(
        (
            (columns, edge_x, left - x0, -1),
            (rows, edge_y, top - y0, -1),
            (columns, edge_x, right - x0, 1),
            (rows, edge_y, bottom - y0, 1),
        )
    ):
        scores[side] = _side(profile, edge, place, outward, offsets) * m_per_px / 0.02
    return scores


def _middle(low: int, high: int, size: int) -> slice:
    margin = round(0.12 * (high - low))
    start = min(max(low + margin, 0), size - 1)
    return slice(start, max(min(high - margin, size), start + 1))


def _likeness(
    box: FloatArray,
    boxes: FloatArray,
    colours: NDArray[np.int_],
    valid: NDArray[np.bool_],
    corner: tuple[int, int],
    frame_px: float,
) -> FloatArray:
    """(h, w) log ratio: does the colour belong to the inside of the box or to the wall around it.

    A surround that ends beyond the box is known to the outside; a frame is known to neither.
    """
    height, width = colours.shape
    y, x = np.mgrid[0:height, 0:width] + 0.5
    x, y = x + corner[0], y + corner[1]
    across, down = (x - box[0]) / (box[2] - box[0]), (y - box[1]) / (box[3] - box[1])
    # A mullion of stone in the middle must not make stone, which is outside too, a colour of the
    # inside; one of wood has the colour of the frame.
    core = (np.abs(across - 0.5) < 0.5 - CORE_SHARE) & (np.abs(down - 0.5) < 0.5 - CORE_SHARE)
    inside = core & (np.abs(across - 0.5) > MULLION_SHARE)
    # What lies within a frame's width beyond the box may be its frame: it tells nothing.
    outside = (
        (x < box[0] - frame_px)
        | (x > box[2] + frame_px)
        | (y < box[1] - frame_px)
        | (y > box[3] + frame_px)
    )
    for other in boxes:
        if not np.array_equal(other, box):
            outside &= (x < other[0]) | (x > other[2]) | (y < other[1]) | (y > other[3])
    cells = COLOUR_BINS**3

    def histogram(mask: NDArray[np.bool_]) -> FloatArray:
        counts = np.bincount(colours[mask & valid], minlength=cells).astype(np.float64)
        cube = counts.reshape((COLOUR_BINS,) * 3)
        for axis in range(3):
            cube = (
                0.5 * cube
                + 0.25 * np.take(cube, [0, *range(COLOUR_BINS - 1)], axis=axis)
                + 0.25 * np.take(cube, [*range(1, COLOUR_BINS), COLOUR_BINS - 1], axis=axis)
            )
        return np.asarray(cube.ravel() / max(cube.sum(), 1.0))

    beyond = histogram(outside)
    within = np.where(beyond < UNKNOWN, histogram(core), histogram(inside))
    ratio = np.log((within + UNKNOWN) / (beyond + UNKNOWN))
    # What differs less than sampling noise says nothing.
    ratio = np.sign(ratio) * np.clip(np.abs(ratio) - 0.25, 0.0, 2.0)
    return np.where(valid, ratio[colours], 0.0)


def _side(
    profile: FloatArray, edge: FloatArray, place: int, outward: int, offsets: NDArray[np.int_]
) -> FloatArray:
    """Score (K,) of every offset of one side: likeness gained inside, plus the gradient there."""
    total = np.zeros(len(offsets))
    for k, offset in enumerate(offsets):
        border = place + outward * int(offset)
        # Columns between the innermost offset and this one are inside if the side stands here.
        inmost = place + outward * int(offsets[0])
        low, high = sorted((inmost, border))
        low, high = max(low, 0), min(high, len(profile))
        gained = profile[low:high].sum() if high > low else 0.0
        near = edge[max(border - 1, 0) : border + 1]
        # Saturating: a frame on a light wall is as good an edge as its dark glass.
        slope = float(near.max()) if len(near) else 0.0
        total[k] = LIKENESS_WEIGHT * gained + EDGE_WEIGHT * slope / (slope + EDGE_SLOPE)
    return total


def _shared_offsets(
    boxes: FloatArray, evidence: FloatArray, offsets: NDArray[np.int_]
) -> FloatArray:
    """(N, 4) offset that the evidence of all windows of about this size prefers together."""
    size = boxes[:, 2:] - boxes[:, :2]
    log_size = np.log(np.maximum(size, 1.0))
    shared = np.zeros((len(boxes), 4))
    for index in range(len(boxes)):
        alike = np.abs(log_size - log_size[index]).max(axis=1) < 0.25
        total = evidence[alike].mean(axis=0)
        shared[index] = offsets[total.argmax(axis=1)]
    return shared
