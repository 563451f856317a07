"""Pictures of a facade: boxes on the fused image, and how many views saw each point."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image as PilImage
from PIL import ImageDraw, ImageFont

from si3fp.errors import InputError
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Image

Colour = tuple[int, int, int]

BOX_COLOURS: dict[str, Colour] = {
    "window": (0, 122, 255),
    "balcony_door": (255, 122, 0),
    "door": (158, 70, 220),
    "balcony": (120, 120, 120),
    "inferred": (225, 20, 120),
    "reviewed": (0, 150, 90),
}
"""Colour of a label, or of an origin other than ``detected``."""

OTHER_COLOUR: Colour = (90, 90, 90)
NOT_SEEN: Colour = (64, 66, 70)
SEEN_ONCE: Colour = (244, 178, 84)
SEEN_TWICE, SEEN_MOST = np.array([190, 226, 222.0]), np.array([6, 78, 110.0])


def box_colour(label: str, origin: str = "detected") -> Colour:
    """Colour of a box: by its origin where that is not ``detected``, else by its label."""
    key = label if origin == "detected" else origin
    return BOX_COLOURS.get(key, OTHER_COLOUR)


def opaque(image: Image) -> Image:
    """RGB (H, W, 3) of grey, RGB or RGBA pixels; transparent ones show a light hatch."""
    if image.ndim == 2:
        return np.repeat(image[..., None], 3, axis=2)
    if image.shape[2] == 3:
        return image
    diagonal = np.arange(image.shape[0])[:, None] + np.arange(image.shape[1])
    hatch = np.where(diagonal % 16 < 2, 212, 236)[..., None]
    alpha = image[..., 3:].astype(np.float32) / 255
    mixed = image[..., :3] * alpha + hatch * (1 - alpha)
    return np.asarray(np.rint(mixed), dtype=np.uint8)


def overlay(
    rgb: Image,
    boxes_px: ArrayLike,
    labels: Sequence[str],
    scores: Sequence[float],
    *,
    origins: Sequence[str] | None = None,
    numbers: Sequence[int] | None = None,
) -> Image:
    """The image with a thin coloured frame, the score and, where given, the number of every box.

    Parameters
    ----------
    rgb
        (H, W, 3) uint8; not changed.
    boxes_px
        (N, 4) x0 y0 x1 y1, half-open, sub-pixel; lines are centred on these edges.
    labels, scores, origins, numbers
        N each; see `BOX_COLOURS`. Text that does not fit into its box is left out.

    Returns
    -------
    (H, W, 3) uint8.

    Raises
    ------
    InputError
        If the boxes and their attributes differ in number.
    """
    boxes: FloatArray = np.asarray(boxes_px, dtype=np.float64).reshape(-1, 4)
    names = origins if origins is not None else ["detected"] * len(boxes)
    shown = [str(number) for number in numbers] if numbers is not None else [""] * len(boxes)
    if not len(boxes) == len(labels) == len(scores) == len(names) == len(shown):
        raise InputError(
            f"An overlay needs one label and score per box, got {len(boxes)} boxes, "
            f"{len(labels)} labels, {len(scores)} scores."
        )
    colours = [box_colour(label, origin) for label, origin in zip(labels, names, strict=True)]
    mean_size_px = float(np.sqrt(rgb.shape[0] * rgb.shape[1]))
    thickness = max(1, round(mean_size_px / 600))
    halo = rgb.copy()
    for box in boxes:
        _frame(halo, box, (255, 255, 255), thickness + 2)
    canvas: Image = np.asarray(cv2.addWeighted(rgb, 0.5, halo, 0.5, 0.0), dtype=np.uint8)
    for box, colour in zip(boxes, colours, strict=True):
        _frame(canvas, box, colour, thickness)
    if not len(boxes):
        return canvas

    size_px = np.clip(np.median(boxes[:, 2] - boxes[:, 0]) * 0.34, 9, 6 + mean_size_px / 45)
    font = ImageFont.load_default(round(float(size_px)))
    drawing = PilImage.fromarray(canvas)
    draw = ImageDraw.Draw(drawing)
    for box, colour, score, number in zip(boxes, colours, scores, shown, strict=True):
        _chip(draw, font, box, f"{score:.2f}", colour=colour, side="top")
        if number:
            _chip(draw, font, box, number, colour=(40, 44, 52), side="bottom")
    return np.asarray(drawing, dtype=np.uint8)


def _frame(canvas: Image, box: FloatArray, colour: Colour, thickness: int) -> None:
    """Draw an anti-aliased rectangle whose lines are centred on the box's edges."""
    corners = np.array([[box[0], box[1]], [box[2], box[1]], [box[2], box[3]], [box[0], box[3]]])
    points = np.rint((corners - 0.5) * 16).astype(np.int32)  # cv2: pixel 0 has its centre at 0
    cv2.polylines(canvas, [points], True, colour, thickness, cv2.LINE_AA, shift=4)


def _chip(
    draw: ImageDraw.ImageDraw,
    font: ImageFont.ImageFont | ImageFont.FreeTypeFont,
    box: FloatArray,
    text: str,
    *,
    colour: Colour,
    side: str,
) -> None:
    """Draw white text on a coloured chip in the upper left or lower left corner of the box."""
    left, top, right, bottom = font.getbbox(text)
    pad = max(1, round((bottom - top) * 0.22))
    width, height = right - left + 2 * pad, bottom - top + 2 * pad
    if width > (box[2] - box[0]) * 1.05 or height > (box[3] - box[1]) * 0.5:
        return
    x = round(box[0])
    y = round(box[1]) if side == "top" else round(box[3] - height)
    draw.rectangle([x, y, x + width - 1, y + height - 1], fill=colour)
    draw.text((x + pad - left, y + pad - top), text, font=font, fill=(255, 255, 255))


def coverage_palette(most: int) -> Image:
    """Colours (most + 1, 3) of 0 ... most views: dark grey, amber, then light to dark blue."""
    palette = np.zeros((most + 1, 3), dtype=np.uint8)
    palette[0] = NOT_SEEN
    if most >= 1:
        palette[1] = SEEN_ONCE
    for count in range(2, most + 1):
        share = (count - 2) / max(1, most - 2)
        palette[count] = np.rint(SEEN_TWICE + share * (SEEN_MOST - SEEN_TWICE))
    return palette


def coverage_picture(seen_by: NDArray[np.uint8]) -> Image:
    """The number of views (H, W) of every point in colour, with a legend below.

    Returns
    -------
    (H + legend, W, 3) uint8; the first H rows are the map, one colour per number of views.
    """
    palette = coverage_palette(max(1, int(seen_by.max(initial=0))))
    coloured = palette[seen_by]
    return np.concatenate([coloured, _legend(palette, seen_by.shape[1])], axis=0)


def _legend(palette: Image, width_px: int) -> Image:
    """Swatches of all numbers of views with their labels, as wide as the map."""
    font = ImageFont.load_default(13)
    legend = PilImage.new("RGB", (width_px, 44), (255, 255, 255))
    draw = ImageDraw.Draw(legend)
    caption = "views per point"
    start = round(font.getlength(caption)) + 12 if width_px > 260 else 0
    if start:
        draw.text((0, 10), caption, font=font, fill=(70, 74, 82))
    swatch = max(1, min(34, (width_px - start) // len(palette)))
    every = -(-18 // swatch)
    edges = [start + swatch * index for index in range(len(palette) + 1)]
    for count, (left, right) in enumerate(pairwise(edges)):
        red, green, blue = (int(channel) for channel in palette[count])
        draw.rectangle([left, 10, right - 1, 24], fill=(red, green, blue))
        if count % every == 0:
            draw.text(
                ((left + right) / 2, 27), str(count), font=font, fill=(70, 74, 82), anchor="ma"
            )
    return np.asarray(legend, dtype=np.uint8)
