"""C.1: which photos to take again and where photos are missing, judged from what was measured."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from si3fp.camera2d.advice import notes_on, to_do
from si3fp.camera2d.facts import PhotoFacts, Settings
from si3fp.camera2d.overlap import Overlap, components, weak_links
from si3fp.config import CaptureConfig

Rating = Literal["ok", "check", "retake"]


@dataclass(frozen=True, slots=True)
class PhotoVerdict:
    """The rating of one photo, why, and the photos that show the same place.

    Attributes
    ----------
    name
        File name.
    rating
        "ok", "check" (usable, look at it), or "retake" (left out of everything that follows).
    reasons
        Sentences; none where it is ok.
    neighbours
        Names of the usable photos that overlap with it.
    """

    name: str
    rating: Rating
    reasons: tuple[str, ...]
    neighbours: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CaptureVerdict:
    """Whether a set of photos is ready for reconstruction, and what to do.

    Attributes
    ----------
    ready
        Whether the photos without those to retake hang together.
    photos
        One verdict per photo, by name.
    to_do
        Sentences: what to photograph or change.
    notes
        Sentences: what is worth knowing.
    groups
        Names of the usable photos that hang together, the largest group first.
    weak
        Photos that alone hold a group, and that group.
    """

    ready: bool
    photos: tuple[PhotoVerdict, ...]
    to_do: tuple[str, ...]
    notes: tuple[str, ...]
    groups: tuple[tuple[str, ...], ...]
    weak: tuple[tuple[str, tuple[str, ...]], ...]


def judge(
    photos: Sequence[PhotoFacts],
    overlaps: Sequence[Overlap],
    unreadable: Mapping[str, str],
    config: CaptureConfig,
) -> CaptureVerdict:
    """Whether the photos are ready, a rating with reasons for each, and what to do.

    Parameters
    ----------
    photos
        Those that could be read, in the order in which they were taken.
    overlaps
        Pairs of them that show the same place, by index.
    unreadable
        Why the others could not be read, by name.
    config
        Limits.
    """
    faults = [_faults(photo, photos, config) for photo in photos]
    usable = [index for index, found in enumerate(faults) if not found]
    links = [pair for pair in overlaps if not (faults[pair.first] or faults[pair.second])]
    neighbours: list[list[int]] = [[] for _ in photos]
    for pair in links:
        neighbours[pair.first].append(pair.second)
        neighbours[pair.second].append(pair.first)
    rejected = set(range(len(photos))) - set(usable)
    groups = [group for group in components(len(photos), links) if not rejected.intersection(group)]
    weak = weak_links(len(photos), links)
    names = [photo.name for photo in photos]
    doubts = _doubts(photos, links, neighbours, usable, config)
    verdicts = [PhotoVerdict(name, "retake", (reason,), ()) for name, reason in unreadable.items()]
    for index, name in enumerate(names):
        alone = len(usable) > 1 and index in usable and not neighbours[index]
        lost = ["it shows nothing that another photo shows: stand so that half of the view repeats"]
        reasons = faults[index] or (lost if alone else doubts[index])
        rating: Rating = "retake" if faults[index] or alone else "check" if reasons else "ok"
        near = tuple(names[other] for other in sorted(neighbours[index]))
        verdicts.append(PhotoVerdict(name, rating, tuple(reasons), near))
    joined = [group for group in groups if len(group) > 1]
    return CaptureVerdict(
        ready=len(joined) == 1 and len(joined[0]) >= config.min_photos,
        photos=tuple(sorted(verdicts, key=lambda verdict: verdict.name)),
        to_do=tuple(to_do(names, joined, weak, config)),
        notes=tuple(notes_on(photos, usable, links, joined, config)),
        groups=tuple(tuple(names[index] for index in group) for group in groups),
        weak=tuple((names[w.photo], tuple(names[i] for i in w.group)) for w in weak),
    )


def usual_blur_px(photo: PhotoFacts, photos: Sequence[PhotoFacts], config: CaptureConfig) -> float:
    """Blur of the sharper photos (lower quartile) of this one's camera, zoom and size.

    Where they are fewer than three, all photos count, for cameras sharpen differently. It is no
    less than `CaptureConfig.sharp_px`: what is sharpened beyond that is no measure for others.
    """
    alike = [other.blur_px for other in photos if other.settings == photo.settings]
    if len(alike) < 3:
        alike = [other.blur_px for other in photos]
    return max(float(np.quantile(alike, 0.25)), config.sharp_px)


def _faults(photo: PhotoFacts, photos: Sequence[PhotoFacts], config: CaptureConfig) -> list[str]:
    """Why a photo cannot be used, by itself."""
    faults = []
    usual = usual_blur_px(photo, photos, config)
    if photo.blur_px > max(usual + config.blurred_px, usual * config.blurred_factor):
        faults.append(
            f"it is blurred: its edges by {photo.blur_px:.1f} px, those of the sharp photos by "
            f"{usual:.1f} px; hold still and focus on the wall"
        )
    if photo.white > config.max_white:
        faults.append(
            f"it is overexposed: {photo.white:.0%} of it is white without detail (sky left out)"
        )
    if photo.black > config.max_black:
        faults.append(f"it is underexposed: {photo.black:.0%} of it is black without detail")
    if photo.width_px * photo.height_px < config.min_pixels:
        faults.append(
            f"it is too small: {photo.width_px} x {photo.height_px} px; take the original file, "
            "at least 2 megapixels"
        )
    return faults


def _doubts(
    photos: Sequence[PhotoFacts],
    links: Sequence[Overlap],
    neighbours: Sequence[Sequence[int]],
    usable: Sequence[int],
    config: CaptureConfig,
) -> list[list[str]]:
    """What is worth a look at each photo."""
    doubts: list[list[str]] = [[] for _ in photos]
    wanted = min(config.min_neighbours, len(usable) - 1)
    for index in usable:
        photo, near = photos[index], neighbours[index]
        usual = usual_blur_px(photo, photos, config)
        if photo.blur_px > usual + config.soft_px:
            doubts[index].append(
                f"it is softer than the others: blurred by {photo.blur_px:.1f} px, the sharp "
                f"photos by {usual:.1f} px"
            )
        for share, what in ((photo.white, "white"), (photo.black, "black")):
            if share > config.doubtful_share:
                doubts[index].append(f"{share:.0%} of it is {what} without detail")
        if photo.width_px * photo.height_px < config.good_pixels:
            doubts[index].append(
                f"it is small: {photo.width_px} x {photo.height_px} px; windows come out coarse"
            )
        if 0 < len(near) < wanted:
            listed = ", ".join(photos[other].name for other in near)
            doubts[index].append(
                f"it overlaps with {len(near)} other photos only ({listed}), {wanted} are wanted: "
                "take more beside it"
            )
    for index, reason in _odd_settings(photos, usable):
        doubts[index].append(reason)
    for first, second, moved in _twins(photos, links, usable, config):
        how = "the same file" if moved is None else f"the picture moved by {moved:.1%} of its width"
        doubts[second].append(
            f"it repeats {photos[first].name} ({how}): one is enough, a step aside would help more"
        )
    return doubts


def _twins(
    photos: Sequence[PhotoFacts],
    links: Sequence[Overlap],
    usable: Sequence[int],
    config: CaptureConfig,
) -> list[tuple[int, int, float | None]]:
    """The earlier photo, the one that repeats it, and how far it moved; each repeat once."""
    twins: dict[int, tuple[int, int, float | None]] = {}
    by_content: dict[str, int] = {}
    for index in usable:
        earlier = by_content.setdefault(photos[index].sha256, index)
        if earlier != index:
            twins[index] = (earlier, index, None)
    for pair in links:
        if pair.moved < config.twin_moved and pair.share > config.twin_share:
            twins.setdefault(pair.second, (pair.first, pair.second, pair.moved))
    return list(twins.values())


def _odd_settings(photos: Sequence[PhotoFacts], usable: Sequence[int]) -> list[tuple[int, str]]:
    """Photos whose camera, zoom or size only few share, and how they differ from most."""
    counts = Counter(photos[index].settings for index in usable)
    if len(counts) < 2:
        return []
    most = max(counts, key=lambda settings: counts[settings])
    odd = []
    for index in usable:
        settings = photos[index].settings
        if settings == most or counts[settings] >= max(3, len(usable) // 5):
            continue  # enough of a kind to find their intrinsics
        odd.append((index, f"it was taken with {_named(settings)}, most with {_named(most)}"))
    return odd


def _named(settings: Settings) -> str:
    camera, focal, long_px, short_px = settings
    lens = "unknown focal length" if focal is None else f"{focal:g} mm"
    return f"{camera or 'an unnamed camera'}, {lens}, {long_px} x {short_px} px"
