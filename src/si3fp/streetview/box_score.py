"""The score of a box on one view, in constant time per box, and the best box of a view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from si3fp.config import FacadeBoxConfig
from si3fp.geometry.rigid import FloatArray
from si3fp.streetview.lines import Segments, ViewLines, band

IntArray = NDArray[np.int_]
SIDES = ("left", "right", "bottom", "top")
LEFT, RIGHT, BOTTOM, TOP = range(4)


@dataclass(frozen=True, slots=True, eq=False)
class Priors:
    """Where each side is expected: left, right, bottom, top in pixels of the raster.

    Attributes
    ----------
    position_px
        (4,) columns and rows; NaN where nothing is known.
    sigma_px
        (4,) standard deviations.
    """

    position_px: FloatArray
    sigma_px: FloatArray

    @classmethod
    def from_metres(
        cls,
        sides_m: Sequence[float | None],
        height_m: float,
        m_per_px: float,
        config: FacadeBoxConfig,
    ) -> Priors:
        """Priors of left, right, bottom and top in metres of a facade frame height_m tall."""
        known = np.array([np.nan if side is None else side for side in sides_m], dtype=np.float64)
        known[[BOTTOM, TOP]] = height_m - known[[BOTTOM, TOP]]
        sigma = [config.edge_sigma_m] * 2 + [config.ground_sigma_m, config.eaves_sigma_m]
        return cls(known / m_per_px, np.array(sigma) / m_per_px)

    def candidates(
        self, columns: FloatArray, rows: FloatArray, slack_px: float
    ) -> list[FloatArray]:
        """Positions to try for each side: relevant lines within 3 sigma, and the prior itself.

        The prior gives way to a line within slack_px of it.
        """
        found = []
        for side, lines in enumerate((columns, columns, rows, rows)):
            expected = self.position_px[side]
            if not np.isfinite(expected):
                found.append(lines)
                continue
            gap = np.abs(lines - expected)
            near = lines[gap <= 3 * self.sigma_px[side]]
            found.append(near if (gap <= slack_px).any() else np.append(near, expected))
        return found

    def log_density(self, boxes_px: FloatArray) -> FloatArray:
        """Heavy-tailed log density (N,) of boxes (N, 4), 0 at the prior: a map may be wrong."""
        gap = (boxes_px - self.position_px) / self.sigma_px
        total: FloatArray = -np.log1p(np.nan_to_num(gap) ** 2 / 2).sum(axis=1)
        return total


@dataclass(frozen=True, slots=True, eq=False)
class _Sides:
    """Running sums along all possible sides of one direction: (positions + 1, length + 1)."""

    support: FloatArray
    crossing: FloatArray
    seen: FloatArray

    @classmethod
    def of(
        cls, lines: Segments, across: Segments, seen: NDArray[np.bool_], slack_px: float
    ) -> _Sides:
        """Sums for sides parallel to `lines`; lines `across` may cross them."""
        positions, length = seen.shape
        near = band(lines, positions, length, slack_px, np.ones(len(lines))) > 0.5
        # A line crosses every boundary between its ends; the slack spares lines that end there.
        first = np.ceil(across.low_px + slack_px).astype(np.int_)
        stop = np.floor(across.high_px - slack_px).astype(np.int_) + 1
        keep = stop > first
        at = np.clip(across.position_px, 0, length - 1).astype(np.int_)
        steps = np.zeros((positions + 2, length))
        for ends, sign in ((first, 1.0), (stop, -1.0)):
            rows = np.clip(ends[keep], 0, positions + 1)
            np.add.at(steps, (rows, at[keep]), sign * across.length_px[keep])
        crossing = steps.cumsum(axis=0)[: positions + 1]
        visible = seen[np.minimum(np.arange(positions + 1), positions - 1)]
        return cls(*(_running(layer) for layer in (near, crossing, visible)))


def _running(layer: NDArray[np.bool_] | FloatArray) -> FloatArray:
    return np.pad(np.cumsum(layer, axis=1, dtype=np.float64), ((0, 0), (1, 0)))


@dataclass(frozen=True, slots=True, eq=False)
class ViewScore:
    """What one view says about boxes; built once, then a few look-ups per box.

    Attributes
    ----------
    structure, seen_px2
        (h + 1, w + 1) running sums of where lines of both directions meet, and of the seen area.
    length_px, slack_px
        Length of all lines; how far from a side a line still lies on it.
    horizontal, vertical
        Running sums along possible sides.
    """

    structure: FloatArray
    seen_px2: FloatArray
    length_px: float
    slack_px: float
    horizontal: _Sides
    vertical: _Sides

    @classmethod
    def of(cls, lines: ViewLines, slack_px: float, cell_px: float) -> ViewScore:
        """The sums of a view.

        Parameters
        ----------
        lines
            Its lines.
        slack_px
            Lines within this distance of a side lie on it and do not cross it.
        cell_px
            Horizontal and vertical lines within such a square belong together.
        """
        rows, columns = lines.seen.shape
        along = band(lines.horizontal, rows, columns, 0.5, np.ones(len(lines.horizontal)))[:rows]
        up = band(lines.vertical, columns, rows, 0.5, np.ones(len(lines.vertical)))[:columns].T
        cell = (max(1, round(cell_px)),) * 2
        product = cv2.blur(along, cell) * cv2.blur(np.ascontiguousarray(up), cell)
        meeting = np.sqrt(np.maximum(product, 0.0))
        return cls(
            _running(np.pad(np.cumsum(meeting, axis=0), ((1, 0), (0, 0)))),
            _running(np.pad(np.cumsum(lines.seen, axis=0), ((1, 0), (0, 0)))),
            float(lines.horizontal.length_px.sum() + lines.vertical.length_px.sum()),
            slack_px,
            _Sides.of(lines.horizontal, lines.vertical, lines.seen, slack_px),
            _Sides.of(lines.vertical, lines.horizontal, lines.seen.T, slack_px),
        )

    def _boundaries(self, boxes_px: FloatArray) -> IntArray:
        """(4, N) pixel boundaries of boxes (N, 4); what lies beyond the raster ends with it."""
        rows, columns = (size - 1 for size in self.seen_px2.shape)
        clipped = np.clip(np.round(boxes_px), 0, [columns, columns, rows, rows])
        return clipped.astype(np.int_).T

    def side_shares(self, boxes_px: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Supported and seen share of each side, and line length crossing it, each (N, 4).

        Support is counted on what was seen, but on half of the side at least.
        """
        left, right, bottom, top = self._boundaries(boxes_px)
        corner = int(np.ceil(self.slack_px))
        supported, seen, crossing = (np.empty(boxes_px.shape) for _ in range(3))
        for side, sums, at, start, stop in (
            (LEFT, self.vertical, left, top, bottom),
            (RIGHT, self.vertical, right, top, bottom),
            (BOTTOM, self.horizontal, bottom, left, right),
            (TOP, self.horizontal, top, left, right),
        ):
            length = np.maximum(stop - start, 1)
            visible = sums.seen[at, stop] - sums.seen[at, start]
            support = sums.support[at, stop] - sums.support[at, start]
            supported[:, side] = support / np.maximum(visible, length / 2)
            seen[:, side] = visible / length
            # Near a corner, what seems to cross is the line of the other side.
            inner_start, inner_stop = (
                np.minimum(start + corner, stop),
                np.maximum(stop - corner, start),
            )
            crossed = sums.crossing[at, inner_stop] - sums.crossing[at, inner_start]
            crossing[:, side] = np.maximum(crossed, 0.0)
        return supported, seen, crossing

    def score(self, boxes_px: FloatArray, config: FacadeBoxConfig) -> FloatArray:
        """Score (N,) of boxes (N, 4): a few tenths, larger is better.

        Every term is a share, so neither large boxes nor pictures with many lines win: the share
        of the structure inside the box, minus the share of all line length that crosses its sides,
        minus the share of the seen area that it takes, plus the mean share of its sides that lie
        on lines. Structure is where horizontal and vertical lines meet, as at windows; tiles of a
        roof and joints of a pavement run one way only.
        """
        left, right, bottom, top = self._boundaries(boxes_px)

        def inside(sums: FloatArray) -> FloatArray:
            part = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
            share: FloatArray = part / max(float(sums[-1, -1]), 1e-9)
            return share

        supported, _, crossing = self.side_shares(boxes_px)
        crossed = crossing.sum(axis=1) / max(self.length_px, 1.0)
        total: FloatArray = (
            inside(self.structure)
            - crossed
            - config.area_weight * inside(self.seen_px2)
            + config.side_weight * supported.mean(axis=1)
        )
        return total


def best_box(
    score: ViewScore,
    candidates: Sequence[FloatArray],
    priors: Priors,
    min_size_px: float,
    config: FacadeBoxConfig,
    rng: np.random.Generator,
) -> FloatArray | None:
    """The best box (4,) of one view, left, right, bottom, top in pixels; None where none is valid.

    `config.iterations` random boxes of the candidates are scored, then each side of the best one
    in turn tries all its candidates until nothing improves: random boxes alone seldom have four
    right sides.
    """

    def total(boxes: FloatArray) -> FloatArray:
        valid = (boxes[:, RIGHT] - boxes[:, LEFT] >= min_size_px) & (
            boxes[:, BOTTOM] - boxes[:, TOP] >= min_size_px
        )
        value = np.full(len(boxes), -np.inf)
        value[valid] = score.score(boxes[valid], config)
        return value + config.prior_weight * priors.log_density(boxes)

    draws = np.stack([rng.choice(lines, config.iterations) for lines in candidates], axis=-1)
    values = total(draws)
    best: FloatArray = draws[int(np.argmax(values))]
    reached = float(values.max())
    if not np.isfinite(reached):
        return None
    improved = True
    while improved:
        improved = False
        for side in range(4):
            trials = np.repeat(best[None], len(candidates[side]), axis=0)
            trials[:, side] = candidates[side]
            values = total(trials)
            if values.max() > reached + 1e-12:
                best, reached, improved = trials[int(np.argmax(values))], float(values.max()), True
    return best
