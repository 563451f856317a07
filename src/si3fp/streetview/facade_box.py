"""S.4: where the facade begins and ends on its grid (paper, Algorithm 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from sklearn.cluster import DBSCAN

from si3fp.config import FacadeBoxConfig
from si3fp.errors import FacadeError
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.rigid import FloatArray
from si3fp.model import OrthoImage
from si3fp.streetview.box_score import SIDES, TOP, Priors, ViewScore, best_box
from si3fp.streetview.lines import find_lines, raster_size, relevant_positions

Evidence = Literal["images", "footprint", "prior"]
MIN_SEEN = 0.3
"""Share of a side that a view must have seen to vote on it."""

ASSUMED_EAVES_SIGMA_M = 6.0
"""Accuracy of eaves that were merely assumed: any usual building is within three of these."""


@dataclass(frozen=True, slots=True)
class PriorBox:
    """Where the footprint and the mapped height put the facade, metres in the grid's frame.

    Each side may be None: nothing is known of it. A top that is merely assumed only serves where
    the images show none.
    """

    left_m: float | None = None
    right_m: float | None = None
    bottom_m: float | None = None
    top_m: float | None = None
    top_is_assumed: bool = False


@dataclass(frozen=True, slots=True)
class FacadeBox:
    """The facade between its ends, the ground and the eaves.

    Attributes
    ----------
    left_m, right_m, bottom_m, top_m
        Metres in the grid's facade frame.
    sigma_m
        Standard deviation of each side in this order: the spread of the views' votes, or that of
        the prior.
    evidence
        What decided each side: ``images``, ``footprint`` (left, right, bottom) or ``prior`` (top).
    relevant_lines
        Horizontal and vertical lines that several views show.
    notes
        In words, where a side did not come from the images.
    """

    left_m: float
    right_m: float
    bottom_m: float
    top_m: float
    sigma_m: tuple[float, ...]
    evidence: tuple[Evidence, ...]
    relevant_lines: tuple[int, int]
    notes: tuple[str, ...] = ()


def find_facade_box(
    views: Sequence[OrthoImage],
    grid: FacadeGrid,
    prior: PriorBox,
    config: FacadeBoxConfig,
    rng: np.random.Generator,
) -> FacadeBox:
    """The bounding box of the facade that the lines of the registered views agree on.

    Paper, Algorithm 4, with METHOD decision 6: lines of every view (LSD, within 10 degrees of the
    axes), relevant lines among them (seen in several views), boxes from random relevant lines and
    from the prior, a score that is normalised so that large boxes do not win (`box_score`), the
    best box of each view, DBSCAN and the median of the dominant cluster. A view votes only on the
    sides that it saw. docs/decisions/0003-facade-box.md.

    Parameters
    ----------
    views
        Registered views on `grid`, at any resolution.
    prior
        Sides from the footprint and the mapped height.
    rng
        Draws the boxes; the same state gives the same box.

    Raises
    ------
    FacadeError
        If neither the images nor the prior tell a side.
    """
    width, height = raster_size(grid, config)
    m_per_px = grid.width_m / width
    lines = [find_lines(view, grid, config) for view in views if view.valid.any()]
    rows = relevant_positions([one.horizontal for one in lines], height, width, m_per_px, config)
    columns = relevant_positions([one.vertical for one in lines], width, height, m_per_px, config)
    known = (prior.left_m, prior.right_m, prior.bottom_m, prior.top_m)
    if prior.top_is_assumed:
        config = replace(config, eaves_sigma_m=ASSUMED_EAVES_SIGMA_M)
    priors = Priors.from_metres(known, grid.height_m, m_per_px, config)
    slack_px = config.relevant_distance_m / m_per_px
    candidates = priors.candidates(columns, rows, slack_px)
    _require_every_side(candidates, len(lines))

    min_size_px = config.min_size_m / m_per_px
    scores = [ViewScore.of(one, slack_px, config.cell_m / m_per_px) for one in lines]
    votes = np.full((len(lines), 4), np.nan)
    supported, seen = np.zeros((len(lines), 4)), np.zeros((len(lines), 4))
    for row, score in enumerate(scores):
        box = best_box(score, candidates, priors, min_size_px, config, rng)
        if box is not None:
            votes[row] = box
            shares = score.side_shares(box[None])
            supported[row], seen[row] = shares[0][0], shares[1][0]

    box_px: list[float] = []
    sigmas: list[float] = []
    evidence: list[Evidence] = []
    notes: list[str] = []
    for side, name in enumerate(SIDES):
        voting = seen[:, side] >= MIN_SEEN
        agreed = _consensus(
            votes[voting, side], supported[voting, side], seen[voting, side], m_per_px, config
        )
        if agreed is not None:
            box_px.append(agreed[0])
            sigmas.append(agreed[1])
            evidence.append("images")
            continue
        expected = priors.position_px[side]
        if not np.isfinite(expected):
            raise _no_line(name, len(lines))
        box_px.append(float(expected))
        sigmas.append(float(priors.sigma_px[side]) * m_per_px)
        evidence.append("prior" if name == "top" else "footprint")
        source = "the footprint"
        if name == "top":
            source = "an assumed height" if prior.top_is_assumed else "the mapped height"
        notes.append(f"{name} side from {source}: no line of the images supports it")
    if evidence[TOP] == "images":
        box_px[TOP] = _below_the_overhang(np.array(box_px), rows, scores, m_per_px, config)
    left, right, bottom, top = box_px
    if right - left < 1 or bottom - top < 1:
        raise FacadeError(
            f"The sides of the facade cross: left {left * m_per_px:.2f} m, right "
            f"{right * m_per_px:.2f} m, bottom {grid.height_m - bottom * m_per_px:.2f} m, top "
            f"{grid.height_m - top * m_per_px:.2f} m. Check the footprint and its height."
        )
    return FacadeBox(
        left * m_per_px,
        right * m_per_px,
        grid.height_m - bottom * m_per_px,
        grid.height_m - top * m_per_px,
        tuple(sigmas),
        tuple(evidence),
        (len(rows), len(columns)),
        tuple(notes),
    )


def _require_every_side(candidates: Sequence[FloatArray], views: int) -> None:
    for name, positions in zip(SIDES, candidates, strict=True):
        if not len(positions):
            raise _no_line(name, views)


def _no_line(name: str, views: int) -> FacadeError:
    return FacadeError(
        f"Found no line for the {name} side of the facade in {views} views, and no footprint or "
        "mapped height tells it. Give footprints with height_m."
    )


def _below_the_overhang(
    box_px: FloatArray,
    rows_px: FloatArray,
    scores: Sequence[ViewScore],
    m_per_px: float,
    config: FacadeBoxConfig,
) -> float:
    """The lowest well supported line within `config.overhang_m` below the eaves, or the eaves.

    Gutter, fascia and cornice stand out in front of the wall. Seen from below they appear above
    the wall's end, and against the sky they are the stronger lines.
    """
    below = (rows_px > box_px[TOP]) & (rows_px - box_px[TOP] <= config.overhang_m / m_per_px)
    for row in np.flip(rows_px[below]):
        trial = np.where(np.arange(4) == TOP, row, box_px)[None]
        shares = [score.side_shares(trial) for score in scores]
        supported = [share[0][0, TOP] for share in shares if share[1][0, TOP] >= MIN_SEEN]
        if supported and np.median(supported) >= config.overhang_support:
            return float(row)
    return float(box_px[TOP])


def _consensus(
    votes_px: FloatArray,
    supported: FloatArray,
    seen: FloatArray,
    m_per_px: float,
    config: FacadeBoxConfig,
) -> tuple[float, float] | None:
    """Median of the dominant cluster of votes in pixels and its standard deviation in metres.

    None where fewer than `config.relevant_views` views (or all, where there are fewer) vote, or
    where fewer than half of the votes have a line below them: those follow the prior.
    """
    if not len(votes_px):
        return None
    labels = DBSCAN(eps=config.dbscan_eps_m / m_per_px, min_samples=1).fit_predict(
        votes_px[:, None]
    )
    dominant = labels == int(np.argmax(np.bincount(labels, seen)))
    chosen = votes_px[dominant]
    enough = len(chosen) >= min(config.relevant_views, len(votes_px))
    if not enough or np.median(supported[dominant]) < config.min_support:
        return None
    middle = float(np.median(chosen))
    spread = 1.4826 * float(np.median(np.abs(chosen - middle))) / np.sqrt(len(chosen))
    return middle, max(spread, 1.0) * m_per_px
