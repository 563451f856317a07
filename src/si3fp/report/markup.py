"""HTML and SVG as nested calls: everything that is not markup is escaped, tags always balance."""

from __future__ import annotations

import base64
import html
import io
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, TypeGuard

import cv2
import numpy as np
import PIL.Image

from si3fp.model import Image

VOID = frozenset({"br", "hr", "img", "meta"})
ABSENT = "–"
UNITS = {
    "_kwh_m2": "kWh/m²",
    "_w_m2k": "W/(m²K)",
    "_w_m2": "W/m²",
    "_m2": "m²",
    "_kwh": "kWh",
    "_deg": "°",
    "_m": "m",
}


class Markup(str):
    """Text that is markup already; plain strings are escaped where they meet it."""

    __slots__ = ()


def joined(children: Iterable[Any]) -> Markup:
    """Markup of children one after another; plain text is escaped, None left out."""
    return Markup(
        "".join(
            child if isinstance(child, Markup) else html.escape(str(child))
            for child in children
            if child is not None
        )
    )


def tag(name: str, /, *children: Any, **attributes: Any) -> Markup:
    """An element; ``class_`` becomes ``class``, other underscores become hyphens.

    Examples
    --------
    >>> print(tag("p", "a < b", class_="note"))
    <p class="note">a &lt; b</p>
    """
    pairs = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{html.escape(str(value))}"'
        for key, value in attributes.items()
        if value is not None
    )
    if name in VOID:
        return Markup(f"<{name}{pairs}>")
    return Markup(f"<{name}{pairs}>{joined(children)}</{name}>")


def number(value: Any, digits: int = 2, unit: str = "") -> str:
    """A number with its unit, or a dash where it is absent or not finite.

    Examples
    --------
    >>> number(12345.678, 1, "m"), number(None)
    ('12\u202f345.7\u00a0m', '–')
    """
    if not is_number(value):
        return ABSENT
    text = f"{float(value):,.{digits}f}".replace(",", "\u202f")
    if float(text.replace("\u202f", "")) == 0:
        text = text.lstrip("-")
    return f"{text}\u00a0{unit}" if unit else text


def is_number(value: Any) -> TypeGuard[float]:
    """Whether a value from a JSON is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def percent(share: Any, digits: int = 1) -> str:
    """A share as a percentage, or a dash."""
    return number(share * 100, digits, "%") if is_number(share) else ABSENT


def percent_interval(interval: Any) -> str:
    """``20.1–25.3 %`` of two shares, empty where there is no interval."""
    if not (
        isinstance(interval, Sequence) and len(interval) == 2 and all(map(is_number, interval))
    ):
        return ""
    return f"{number(interval[0] * 100, 1)}–{percent(interval[1])}"


def counted(count: int, singular: str, plural: str | None = None) -> str:
    """A count with its noun: ``1 window``, ``3 windows``."""
    return f"{count} {singular if count == 1 else plural or singular + 's'}"


def named_values(values: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Names in words and values with units of a record, nested ones with their parent's name."""
    for key, value in values.items():
        suffix = next((suffix for suffix in UNITS if key.endswith(suffix)), "")
        words = f"{prefix} {key.removesuffix(suffix).replace('_', ' ')}".strip()
        name = re.sub(r"^u( value)? ", "U-value ", re.sub(r"^g( value)? ", "g-value ", words))
        name = name[:1].upper() + name[1:] if not name.startswith("g-") else name
        if key == "period" and isinstance(value, list) and len(value) == 2:
            yield "Construction period", _period(*value)
        elif isinstance(value, dict):
            yield from named_values(value, words)
        elif isinstance(value, float):
            yield name, number(value, 2, UNITS.get(suffix, ""))
        elif isinstance(value, bool):
            yield name, "yes" if value else "no"
        elif isinstance(value, int | str):
            yield name, f"{value} {UNITS.get(suffix, '')}".strip()


def _period(first: Any, last: Any) -> str:
    """``1961–1975``; TABULA's 0 and 9999 are open ends."""
    if first == 0:
        return f"until {last}"
    return f"since {first}" if last == 9999 else f"{first}–{last}"


def table(
    head: Sequence[Any],
    rows: Sequence[Sequence[Any]],
    words: Sequence[int] = (0,),
    row_classes: Sequence[str | None] | None = None,
) -> Markup:
    """A table; the columns in ``words`` are text, all others numbers (right-aligned)."""

    def row(name: str, cells: Sequence[Any], class_: str | None = None) -> Markup:
        return tag(
            "tr",
            *(
                tag(name, cell, class_=None if column in words else "n")
                for column, cell in enumerate(cells)
            ),
            class_=class_,
        )

    classes = row_classes or [None] * len(rows)
    body = [row("td", cells, class_) for cells, class_ in zip(rows, classes, strict=True)]
    return tag(
        "div",
        tag("table", tag("thead", row("th", head)), tag("tbody", *body)),
        class_="scroll",
    )


def folded(summary: Any, *content: Any) -> Markup:
    """Content behind a line that opens it."""
    return tag("details", tag("summary", summary), *content)


def bullets(items: Iterable[Any], class_: str | None = None) -> Markup | None:
    """A list, or None without items."""
    rows = [tag("li", item) for item in items]
    return tag("ul", *rows, class_=class_) if rows else None


def fitted(image: Image, max_width_px: int, max_height_px: int = 100_000) -> Image:
    """The image, made smaller by area averaging where it is larger than the limits."""
    height, width = image.shape[:2]
    scale = min(1.0, max_width_px / width, max_height_px / height)
    if scale == 1.0:
        return image
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def picture(
    image: Image,
    alternative: str,
    *,
    lossless: bool = False,
    quality: int = 86,
    shown_height_px: int | None = None,
) -> Markup:
    """An ``img`` with the RGB pixels inside it, as JPEG or (``lossless``) PNG.

    It fills the width of the page, but is shown at most ``shown_height_px`` high.
    """
    stream = io.BytesIO()
    pixels = PIL.Image.fromarray(image)
    if lossless:
        pixels.save(stream, "PNG", optimize=True)
    else:
        # Full chroma resolution: thin coloured lines stay sharp.
        pixels.save(stream, "JPEG", quality=quality, subsampling=0, optimize=True)
    kind = "png" if lossless else "jpeg"
    height_px, width_px = image.shape[:2]
    limit = f"max-width:{width_px * shown_height_px / height_px:.0f}px" if shown_height_px else None
    data = base64.b64encode(stream.getvalue()).decode("ascii")
    return tag(
        "img",
        src=f"data:image/{kind};base64,{data}",
        alt=alternative,
        width=width_px,
        height=height_px,
        style=limit,
    )
