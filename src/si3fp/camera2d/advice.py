"""C.1: what to photograph next, and what is worth knowing of a set of photos, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from si3fp.camera2d.facts import PhotoFacts
from si3fp.camera2d.overlap import Overlap, WeakLink
from si3fp.config import CaptureConfig


def to_do(
    names: Sequence[str],
    joined: Sequence[Sequence[int]],
    weak: Sequence[WeakLink],
    config: CaptureConfig,
) -> list[str]:
    """Sentences on where photos are missing.

    Parameters
    ----------
    names
        Of all photos, in the order in which they were taken.
    joined
        The groups of two or more that hang together, by index, the largest first.
    weak
        Photos that alone hold a group.
    config
        Limits.
    """
    lines = []
    if not joined or max(map(len, joined)) < config.min_photos:
        lines.append(
            f"Too few photos overlap: at least {config.min_photos} must show the same wall, and "
            "20 to 60 make a good set for one building."
        )
    if len(joined) > 1:
        lines.append(f"The photos fall into {len(joined)} groups that show nothing in common:")
        lines += [f"  group {n}: {span(names, group)}" for n, group in enumerate(joined, start=1)]
        for number, group in enumerate(joined[1:], start=2):
            others = [index for other in joined if other is not group for index in other]
            a, b = min(
                ((one, other) for one in group for other in others),
                key=lambda pair: (abs(pair[0] - pair[1]), pair),
            )
            lines.append(
                f"Take 3 to 5 photos on the way from {names[min(a, b)]} to {names[max(a, b)]}, "
                f"each repeating half of the one before, to connect group {number}."
            )
    if len(weak) > config.listed_weak_links:
        listed = span(names, sorted(link.photo for link in weak))
        lines.append(
            f"The set is a chain: {listed} each hold it together alone. Take photos between them, "
            "so that every place is on at least three."
        )
    else:
        lines += [
            f"{names[link.photo]} alone connects {span(names, link.group)} with the rest: take 2 "
            "or 3 photos beside it that show both sides."
            for link in weak
        ]
    return lines


def notes_on(
    photos: Sequence[PhotoFacts],
    usable: Sequence[int],
    links: Sequence[Overlap],
    joined: Sequence[Sequence[int]],
    config: CaptureConfig,
) -> list[str]:
    """Sentences on what is worth knowing of the set: number, cameras, positions.

    Parameters
    ----------
    photos
        All that could be read, in the order in which they were taken.
    usable
        Those that need not be taken again, by index.
    links
        Pairs of usable photos that show the same place.
    joined
        The groups of two or more that hang together, by index.
    config
        Limits.
    """
    notes = []
    used = [photos[index] for index in usable]
    if 0 < len(used) < config.good_number:
        notes.append(
            f"{len(used)} usable photos: 20 to 60 make a good set for one building, 300 to 500 "
            "for several."
        )
    ends = (min(usable), max(usable)) if usable else (0, 0)
    closed = any((pair.first, pair.second) == ends for pair in links)
    if len(joined) == 1 and len(used) >= config.good_number and not closed:
        notes.append(
            "The first and the last photo do not overlap: the round is not closed. Around a "
            "whole building go on until its beginning is seen again; one facade needs no round."
        )
    without = sum(photo.focal_mm is None and photo.focal_35mm is None for photo in used)
    if without:
        notes.append(
            f"{without} of {len(used)} photos do not tell their focal length (EXIF): it will be "
            "estimated, which takes one camera at one zoom. Files from messaging apps lose it; "
            "prefer the originals."
        )
    kinds = {photo.settings for photo in used}
    if len(kinds) > 1:
        notes.append(
            f"{len(kinds)} combinations of camera, zoom and size: each is calibrated on its own. "
            "One camera at one zoom is more accurate."
        )
    portrait = sum(photo.height_px > photo.width_px for photo in used)
    if 0 < portrait < len(used):
        notes.append(f"{portrait} upright and {len(used) - portrait} lying photos: both are fine.")
    gps = sum(photo.has_gps for photo in used)
    if used:
        notes.append(
            f"{gps} of {len(used)} photos tell their position (GPS)"
            + (": scale and north must come from elsewhere." if gps < 3 else ".")
        )
    usual = float(np.median([photo.blur_px for photo in used])) if used else 0.0
    if usual > config.soft_set_px:
        notes.append(
            f"The photos as a whole are soft: edges are blurred by {usual:.1f} px. Clean the lens, "
            "focus on the wall, and do not enlarge photos."
        )
    return notes


def span(names: Sequence[str], indices: Sequence[int]) -> str:
    """Photos in words: runs as "a to b", with their number.

    Examples
    --------
    >>> span(["a", "b", "c", "d", "e"], [0, 1, 2, 4])
    'a to c, e (4 photos)'
    """
    runs: list[list[int]] = []
    for index in indices:
        if runs and index == runs[-1][-1] + 1:
            runs[-1].append(index)
        else:
            runs.append([index])
    words = [
        names[run[0]] if len(run) == 1 else f"{names[run[0]]} to {names[run[-1]]}" for run in runs
    ]
    if len(words) > 6:
        words = [*words[:6], "..."]
    return f"{', '.join(words)} ({len(indices)} photo{'s' if len(indices) > 1 else ''})"
