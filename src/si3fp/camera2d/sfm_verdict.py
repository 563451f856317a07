"""C.2: what came out of structure from motion, in words: photos lost, models, doubts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from si3fp.camera2d.advice import span
from si3fp.camera2d.coherence import folded
from si3fp.config import SfmConfig
from si3fp.errors import ReconstructionError

_CHECK = "`si3fp photos --check FOLDER` tells where photos are missing"
_FEW_FEATURES = 100


@dataclass(frozen=True, slots=True)
class SfmModel:
    """A reconstruction, up to a similarity.

    Attributes
    ----------
    folder
        COLMAP's text files cameras.txt, images.txt and points3D.txt.
    photo_ids
        Photos in it, in the order given.
    points
        Number of points.
    error_px
        Median over the points of their mean reprojection error.
    doubts
        Why it may be wrong, in sentences; none where it agrees with itself.
    """

    folder: Path
    photo_ids: tuple[str, ...]
    points: int
    error_px: float
    doubts: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SfmResult:
    """What structure from motion found.

    Attributes
    ----------
    models
        The one with the most photos first: it is the one to use.
    lost
        By id the photos that are not in it, and why.
    notes
        What a user should know and do, in sentences: lost photos, other models, doubts.
    """

    models: tuple[SfmModel, ...]
    lost: Mapping[str, str]
    notes: tuple[str, ...]

    @property
    def folder(self) -> Path:
        """COLMAP's text files of the largest model."""
        return self.models[0].folder

    @property
    def photo_ids(self) -> tuple[str, ...]:
        """Photos of the largest model."""
        return self.models[0].photo_ids


def judge(
    names: Sequence[str],
    report: Mapping[str, Any],
    unreadable: Mapping[str, str],
    models_folder: Path,
    config: SfmConfig,
) -> SfmResult:
    """Models, lost photos and notes from the report of COLMAP's process.

    Parameters
    ----------
    names
        Of the photos that the report counts from zero.
    report
        ``features`` per photo, ``verified`` triples of two photos and their number of matches,
        ``models`` with ``photos``, ``points``, ``error_px``, ``neighbours``, ``strangers``,
        ``opposed`` and ``contradicts_first``, the largest first; ``set_aside`` pairs of photos
        whose matches folded the model and were not used; ``left_out`` photos that were taken out
        of the first model as they still lay where others belong.
    unreadable
        Photos that the report does not know, and why.
    models_folder
        Holds the folders 0, 1, ... of the models.
    config
        Limits.

    Raises
    ------
    ReconstructionError
        If no model has three photos.
    """
    found = report["models"]
    models = tuple(
        SfmModel(
            models_folder / str(number),
            tuple(names[photo] for photo in model["photos"]),
            model["points"],
            model["error_px"],
            tuple(_doubts(names, model, config)),
        )
        for number, model in enumerate(found)
        if len(model["photos"]) >= config.min_model_photos
    )
    lost = {**unreadable, **_lost(names, report, models, config)}
    lines = [f"{name}: {why}." for name, why in lost.items()]
    count = len(names) + len(unreadable)
    if not models:
        raise ReconstructionError(
            f"The {count} photos could not be connected: fewer than {config.min_model_photos} show "
            "the same points.\n  " + "\n  ".join(lines) + f"\nTake more photos with more overlap; "
            f"{_CHECK}."
        )
    notes = list(models[0].doubts)
    if report.get("set_aside"):
        pairs = ", ".join(f"{names[a]} and {names[b]}" for a, b in report["set_aside"][:3])
        notes.append(
            f"Parts of the building look alike: matches of {len(report['set_aside'])} pairs of "
            f"photos ({pairs}) laid one on another and were set aside. Compare the picture of the "
            "points with the building."
        )
    if report.get("left_out"):
        notes.append(
            f"{span(names, report['left_out'])} show a part that looks like another one, lay where "
            "other photos belong and were left out: what only they show is missing. Take more "
            "photos on the way from one part to the other."
        )
    if 2 * len(models[0].photo_ids) < count:
        notes.append(
            f"Only {len(models[0].photo_ids)} of {count} photos are connected: the model shows a "
            f"part of the building; {_CHECK}."
        )
    for number, model in enumerate(models[1:], start=1):
        own = [name for name in model.photo_ids if name not in models[0].photo_ids]
        line = (
            f"{span(names, [names.index(name) for name in own or model.photo_ids])} form a model "
            f"of their own (models/{model.folder.name} beside the database) with unknown size and "
            "position to the first. Take "
            "photos that show both parts, each repeating half of the one before, or run this "
            "group as a folder of its own."
        )
        if found[number]["contradicts_first"]:
            line += (
                " It shares photos with the first model, yet puts them at other distances from "
                "each other: at least one of the two is wrong, probably because parts of the "
                "building look alike."
            )
        notes += [line, *(f"Of that model: {doubt}" for doubt in model.doubts)]
    return SfmResult(models, lost, (*notes, *lines))


def _doubts(names: Sequence[str], model: Mapping[str, Any], config: SfmConfig) -> list[str]:
    strangers, opposed = model["strangers"], model["opposed"]
    doubts = []
    if folded(len(strangers), model["neighbours"], config):
        pairs = ", ".join(f"{names[a]} and {names[b]}" for a, b in strangers[:3])
        doubts.append(
            f"The model may be folded: it puts {len(strangers)} pairs of photos side by side, "
            f"looking at the same place, that show little or nothing in common ({pairs}). Two "
            "parts of the building probably look alike and were taken for one. Do not measure on "
            "it: look at these photos, take more on the way from one part to the other, or "
            "reconstruct each part from a folder of its own."
        )
    if len(opposed) >= config.min_strangers:
        pairs = ", ".join(f"{names[a]} and {names[b]}" for a, b in opposed[:3])
        doubts.append(
            f"{len(opposed)} pairs of photos match in many points that the model puts at "
            f"different places ({pairs}): parts of the building look alike, and either these "
            "matches or the model is wrong. Compare the picture of the points with the building."
        )
    return doubts


def _lost(
    names: Sequence[str],
    report: Mapping[str, Any],
    models: Sequence[SfmModel],
    config: SfmConfig,
) -> dict[str, str]:
    """Why photos are not in the first model."""
    first = set(models[0].photo_ids) if models else set()
    lost = {}
    for photo, name in enumerate(names):
        if name in first:
            continue
        features = report["features"][photo]
        matched = [
            (matches, names[b if a == photo else a])
            for a, b, matches in report["verified"]
            if photo in (a, b)
        ]
        elsewhere = [n for n, model in enumerate(models) if name in model.photo_ids]
        if photo in report.get("left_out", ()):
            lost[name] = (
                "lay where other photos belong, as a part of the building looks like another"
            )
        elif elsewhere:
            lost[name] = f"is in model {elsewhere[0]}, which is not connected with the first"
        elif features < _FEW_FEATURES:
            lost[name] = (
                f"has only {features} distinct points: blurred, dark, damaged or without texture; "
                "retake it"
            )
        elif not matched:
            lost[name] = (
                f"shows nothing that another photo shows ({features} distinct points, no pair with "
                f"{config.min_matches} matches); take photos beside it"
            )
        else:
            matches, other = max(matched)
            lost[name] = (
                f"matches {len(matched)} photos, best {other} with {matches} points, but could not "
                "be placed; take photos beside it that show the same wall"
            )
    return lost
