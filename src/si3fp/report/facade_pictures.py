"""The pictures of one facade as figures of the report."""

from __future__ import annotations

import cv2
import numpy as np

from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Image
from si3fp.report.figures import box_colour, coverage_picture, opaque, overlay
from si3fp.report.markup import Markup, counted, fitted, is_number, joined, picture, tag
from si3fp.report.records import Record
from si3fp.report.totals import views_of
from si3fp.workspace import Workspace, read_png, safe_name

MIN_SIZE_PX = 1000
MAX_WIDTH_PX = 1600
MAX_HEIGHT_PX = 1400
MAX_ROWS = 3
ROW_ASPECT = 3.5
THUMBNAIL_PX = (360, 240)
COVERAGE_PX = 560
SHOWN_HEIGHT_PX = 680
MAX_THUMBNAILS = 24


def _boxes_px(facade: Record, m_per_px: float, width_px: int, height_px: int) -> FloatArray:
    """Boxes (N, 4) of a facade's windows on its fused image of this size."""
    grid = FacadeGrid(Rigid3(np.eye(3), np.zeros(3)), width_px, height_px, m_per_px)
    low = np.array([[w["x_m"], w["y_m"]] for w in facade["windows"]]).reshape(-1, 2)
    size = np.array([[w["width_m"], w["height_m"]] for w in facade["windows"]]).reshape(-1, 2)
    a, b = grid.pixels_from_facade(low), grid.pixels_from_facade(low + size)
    return np.column_stack([a[:, 0], b[:, 1], b[:, 0], a[:, 1]])


def facade_overlay(
    workspace: Workspace, facade: Record, *, page_size: bool = False
) -> Image | None:
    """The fused image with the facade's windows, or None without the image.

    With ``page_size`` the image is made smaller first, so that lines and text keep their size.
    """
    path = workspace.facade(str(facade["id"]), "ortho.png")
    if not path.exists():
        return None
    fused = opaque(read_png(path))
    small = _fitted_to_page(fused) if page_size else fused
    m_per_px = facade.get("m_per_px")
    if not is_number(m_per_px):
        return small
    boxes = _boxes_px(facade, m_per_px, fused.shape[1], fused.shape[0])
    windows = facade["windows"]
    return overlay(
        small,
        boxes * (small.shape[1] / fused.shape[1]),
        [str(window.get("label", "window")) for window in windows],
        [float(window.get("score", 1.0)) for window in windows],
        origins=[str(window.get("origin", "detected")) for window in windows],
        numbers=range(len(windows)),
    )


def _rows(image: Image) -> int:
    """In how many rows a picture is shown: a long facade's windows stay legible."""
    return int(np.clip(round(image.shape[1] / image.shape[0] / ROW_ASPECT), 1, MAX_ROWS))


def enlarged(image: Image) -> Image:
    """The image, enlarged where its longer side is below `MIN_SIZE_PX`: lines on it are sharp."""
    height_px, width_px = image.shape[:2]
    larger = MIN_SIZE_PX / max(height_px, width_px)
    if larger <= 1:
        return image
    size = (max(1, round(width_px * larger)), max(1, round(height_px * larger)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)


def _fitted_to_page(image: Image) -> Image:
    """The image in the size of the page, small ones enlarged."""
    return fitted(enlarged(image), _rows(image) * MAX_WIDTH_PX, MAX_HEIGHT_PX)


def fused_figure(workspace: Workspace, facade: Record) -> Markup | None:
    """The fused image with boxes and the key of its colours; ``overlay.png`` stands in."""
    identifier = str(facade["id"])
    drawn = facade_overlay(workspace, facade, page_size=True)
    if drawn is None:
        path = workspace.facade(identifier, "overlay.png")
        if not path.exists():
            return tag("p", "The fused image of this facade is not in the run.", class_="soft")
        drawn = _fitted_to_page(opaque(read_png(path)))
    rows = _rows(drawn)
    kinds = dict.fromkeys(
        (str(window.get("label", "window")), str(window.get("origin", "detected")))
        for window in facade["windows"]
    )
    keys = [
        joined(
            [
                tag("span", class_="key", style=f"background:rgb{box_colour(label, origin)}"),
                label.replace("_", " ") + ("" if origin == "detected" else f", {origin}"),
            ]
        )
        for label, origin in kinds
    ]
    parts = f", {rows} parts from left to right" if rows > 1 else ""
    text = " The upper number is the score, the lower one the number in the table of windows."
    return tag(
        "figure",
        *(
            picture(
                np.ascontiguousarray(part),
                f"Fused image of facade {identifier} with its windows",
                shown_height_px=SHOWN_HEIGHT_PX,
            )
            for part in np.array_split(drawn, rows, axis=1)
        ),
        tag(
            "figcaption",
            f"Fused orthographic image{parts}. ",
            *keys,
            "." if keys else None,
            text if keys else " No windows were found.",
        ),
    )


def coverage_figure(workspace: Workspace, facade: Record) -> Markup | None:
    """The map of how many views saw each point, or None without the file."""
    path = workspace.facade(str(facade["id"]), "coverage.png")
    if not path.exists():
        return None
    seen_by = read_png(path)
    width_px = min(seen_by.shape[1], COVERAGE_PX)
    height_px = max(1, round(seen_by.shape[0] * width_px / seen_by.shape[1]))
    small = cv2.resize(seen_by, (width_px, height_px), interpolation=cv2.INTER_NEAREST)
    return tag(
        "figure",
        picture(
            coverage_picture(np.asarray(small, dtype=np.uint8)),
            "Number of views per point",
            lossless=True,
            shown_height_px=SHOWN_HEIGHT_PX // 2,
        ),
        tag("figcaption", "How many registered views saw each point of the facade."),
    )


def thumbnails(workspace: Workspace, facade: Record) -> Markup | None:
    """A strip of the rectified views, those used first, or None without files."""
    folder = workspace.facade(str(facade["id"]), "views")
    files = {path.stem: path for path in sorted(folder.glob("*.png"))}
    used, dropped = views_of(facade)
    sources = {
        safe_name(str(view.get("source"))): str(view.get("source")) for view in used + dropped
    }
    gone = {safe_name(str(view.get("source"))) for view in dropped}
    order = [*(stem for stem in sources if stem in files), *(f for f in files if f not in sources)]
    figures = [
        tag(
            "figure",
            picture(
                fitted(opaque(read_png(files[stem])), *THUMBNAIL_PX), f"View {stem}", quality=78
            ),
            tag("figcaption", sources.get(stem, stem), " (dropped)" if stem in gone else None),
            class_="dropped" if stem in gone else None,
        )
        for stem in order[:MAX_THUMBNAILS]
    ]
    if not figures:
        return None
    more = len(order) - len(figures)
    return joined(
        [
            tag("h4", "Rectified views"),
            tag("div", *figures, class_="strip"),
            tag("p", f"{counted(more, 'further view')} not shown.", class_="soft")
            if more
            else None,
        ]
    )
