"""The part of the report on poses, scale and place of a photo run."""

from __future__ import annotations

from si3fp.report.markup import Markup, bullets, is_number, number, table, tag
from si3fp.report.records import Record, records, texts


def reconstruction_part(reconstruction: Record) -> Markup | None:
    """How the photos were placed: registered photos, scale with its residuals, vertical, north."""
    if not reconstruction:
        return None
    sides = [
        [
            f"{side.get('start', '')} - {side.get('end', '')}",
            number(side.get("distance_m"), 3),
            number(_centimetres(side.get("residual_m")), 1),
        ]
        for side in records(reconstruction.get("sides"))
    ]
    return tag(
        "section",
        tag("h2", "Where the photos were taken from"),
        bullets(texts(reconstruction.get("facts"))),
        table(["Measured distance", "Metres", "Model minus measured, cm"], sides, words=(0,))
        if sides
        else None,
        bullets(texts(reconstruction.get("notes")), class_="notes"),
    )


def _centimetres(value: object) -> float | None:
    return 100 * float(value) if is_number(value) else None
