"""Matches of pairs of photos in COLMAP's database; part of its process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pycolmap

from si3fp.camera2d.coherence import ModelView, coherence
from si3fp.config import SfmConfig


def match(database_path: Path, pairs: list[list[int]], config: SfmConfig, seed: int) -> None:
    """Match and verify pairs of photos that are not matched yet."""
    with pycolmap.Database.open(database_path) as database:
        names = [image.name for image in sorted(database.read_all_images(), key=_image_id)]
        # COLMAP's list of pairs is split at blanks, which names may have.
        rename(database, [f"photo-{number}" for number in range(len(names))])
    listed = database_path.with_name("pairs.txt")
    listed.write_text("".join(f"photo-{a} photo-{b}\n" for a, b in pairs), encoding="ascii")
    pairing = pycolmap.ImportedPairingOptions()
    pairing.match_list_path = listed
    pairing.block_size = 8 * config.threads  # pairs between two entries in the database
    matching = pycolmap.FeatureMatchingOptions()
    matching.num_threads = config.threads
    verification = pycolmap.TwoViewGeometryOptions()
    verification.min_num_inliers = config.min_matches
    verification.ransac.random_seed = seed
    pycolmap.match_image_pairs(database_path, matching, pairing, verification)
    with pycolmap.Database.open(database_path) as database:
        rename(database, names)


def match_neighbours(
    database: Path, views: list[ModelView], job: dict[str, Any], config: SfmConfig
) -> None:
    """Match photos that a model puts side by side and that nobody has compared yet."""
    strangers = {pair for model in views for pair in coherence(model, {}, config).strangers}
    missing = strangers - {tuple(pair) for pair in job["pairs"]}
    if missing:
        match(database, [list(pair) for pair in sorted(missing)], config, job["seed"])


def rename(database: Any, names: list[str]) -> None:
    """Give the photos other names, by number."""
    for image in database.read_all_images():
        if image.name != names[image.image_id - 1]:
            image.name = names[image.image_id - 1]
            database.update_image(image)


def _image_id(image: Any) -> int:
    return int(image.image_id)
