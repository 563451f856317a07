"""Folded models taken apart with COLMAP; part of its process (`si3fp.camera2d.unfold`)."""

from __future__ import annotations

import copy
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pycolmap

from si3fp.camera2d._colmap_mapping import Job, Say, mapped, refined
from si3fp.camera2d._colmap_matching import match, match_neighbours
from si3fp.camera2d._colmap_numbers import all_matches, rays_of, verified_matches, view
from si3fp.camera2d.coherence import Coherence, ModelView, Pair, coherence, folded
from si3fp.camera2d.unfold import displaced, follows
from si3fp.config import SfmConfig
from si3fp.geometry.rigid import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Unfolded:
    """Models without a fold, where that could be.

    Attributes
    ----------
    models
        COLMAP's, the one with the most photos first.
    database
        The matches that they rest on.
    set_aside
        Pairs of photos that lost matches.
    left_out
        Photos that still lay where others belong and were taken out of the first model.
    """

    models: list[Any]
    database: Path
    set_aside: tuple[Pair, ...] = ()
    left_out: tuple[int, ...] = ()


def unfolded(
    models: list[Any], database: Path, folder: Path, job: Job, config: SfmConfig, say: Say
) -> Unfolded:
    """The models, without a fold where that can be.

    What folds a model is taken out of a copy of the database, and the cameras are sought again.
    Where that leaves a fold, the smaller of the two parts is left out.
    """
    if not models:
        return Unfolded(models, database)
    lost: list[Pair] = []
    seen, found = _judged(models[0], database, job, config)
    current = database
    for number in range(config.most_folds):
        if not _folded(found, config):
            break
        attempt = database.with_name(f"unfolded-{number}.db")
        shutil.copyfile(current, attempt)
        parted = _part(attempt, models[0], seen, found, job, config)
        if not parted:
            break
        again = mapped(attempt, folder, database.parent, config, job["seed"], say)
        if not again or 2 * again[0].num_reg_images() < models[0].num_reg_images():
            break
        again_seen, after = _judged(again[0], attempt, job, config)
        if 2 * len(after.strangers) > len(found.strangers):
            break
        models, seen, found, current = again, again_seen, after, attempt
        lost += parted
    left_out: tuple[int, ...] = ()
    if _folded(found, config):
        models[0], left_out = _without_fold(models[0], seen, found, current, job, config)
    return Unfolded(models, current, tuple(sorted(set(lost))), left_out)


def _without_fold(
    model: Any, seen: ModelView, found: Coherence, database: Path, job: Job, config: SfmConfig
) -> tuple[Any, tuple[int, ...]]:
    """A folded model without the photos that fold it; unchanged where half would be lost."""
    smaller, left_out = copy.deepcopy(model), set[int]()
    while _folded(found, config):
        with pycolmap.Database.open(database) as some:
            rays = rays_of(verified_matches(some), smaller)
        stretch = displaced(
            sorted(seen.photos),
            found.strangers,
            _followed(rays, seen, config),
            config.enough_strangers,
        )
        out = min(stretch, seen.photos.keys() - stretch, key=len)
        left_out |= out
        if not out or 2 * len(left_out) > model.num_reg_images():
            return model, ()
        for photo in out:
            smaller.deregister_frame(photo + 1)
        seen, found = _judged(smaller, database, job, config)
    return refined(smaller, config), tuple(sorted(left_out))


def _judged(model: Any, database: Path, job: Job, config: SfmConfig) -> tuple[ModelView, Coherence]:
    seen = view(model)
    match_neighbours(database, [seen], job, config)
    with pycolmap.Database.open(database) as some:
        return seen, coherence(seen, rays_of(verified_matches(some), model), config)


def _part(
    database: Path, model: Any, seen: ModelView, found: Coherence, job: Job, config: SfmConfig
) -> list[Pair]:
    """Pairs of photos whose matches folded a model; the database loses them and keeps the rest."""
    with pycolmap.Database.open(database) as some:
        rays = rays_of(verified_matches(some), model)
        followed = _followed(rays, seen, config)
        stretch = displaced(sorted(seen.photos), found.strangers, followed)
        crossing = [pair for pair in rays if (pair[0] in stretch) != (pair[1] in stretch)]
        everything = all_matches(some, crossing)
        rays = rays_of({pair: pixels for pair, (_, pixels) in everything.items()}, model)
        left = []
        for pair in crossing:
            indices, _ = everything[pair]
            kept = indices[~follows(rays[pair], pair, seen, config)]
            ids = (pair[0] + 1, pair[1] + 1)
            some.delete_two_view_geometry(*ids)
            some.delete_matches(*ids)
            if len(kept) >= config.min_matches:
                some.write_matches(*ids, kept)
                left.append(list(pair))
    if left:
        match(database, left, config, job["seed"])  # what is matched is only verified
    return [pair for pair in crossing if followed[pair]]


def _followed(
    rays: dict[Pair, tuple[FloatArray, FloatArray]], seen: ModelView, config: SfmConfig
) -> dict[Pair, int]:
    """Number of matches that a model follows, by pair of its photos."""
    return {pair: int(follows(each, pair, seen, config).sum()) for pair, each in rays.items()}


def _folded(found: Coherence, config: SfmConfig) -> bool:
    return folded(len(found.strangers), found.neighbours, config)
