"""Training of a radiance field: batches, two passes of kernels, Adam, occupancy, schedule."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from si3fp.camera2d.radiance.arrays import (
    F32,
    FEATURES,
    I64,
    LANES,
    LEVELS,
    MAX_BLOCKS,
    Field,
    Samples,
)
from si3fp.camera2d.radiance.gradients import train_rays
from si3fp.camera2d.radiance.layout import FRONT, SLAB, FieldLayout
from si3fp.camera2d.radiance.rays import TrainingPhotos
from si3fp.camera2d.radiance.tables import adam, refresh, scatter, visit
from si3fp.camera2d.radiance.views import cell_densities
from si3fp.config import RadianceConfig
from si3fp.geometry.rigid import FloatArray

PARTS = 16
"""Parts of a batch; fixed, so that sums do not depend on the number of threads."""

BATCHES, MIN_BATCH_SAMPLES = 3000, 4096
"""A small wall needs as many steps as a large one; smaller batches cost more than they bring."""

BETA1, BETA2, EPSILON = 0.9, 0.99, 1e-10


@dataclass(slots=True)
class AdamVector:
    """Adam (Kingma and Ba 2015, arXiv:1412.6980) on one small array."""

    mean: FloatArray
    square: FloatArray
    step: int = 0

    @classmethod
    def like(cls, values: NDArray[np.float32]) -> AdamVector:
        """Moments of zero for these values."""
        return cls(np.zeros(values.shape), np.zeros(values.shape))

    def update(self, values: NDArray[np.float32], gradient: FloatArray, rate: float) -> None:
        """Move the values in place."""
        self.step += 1
        self.mean += (1 - BETA1) * (gradient - self.mean)
        self.square += (1 - BETA2) * (gradient**2 - self.square)
        mean = self.mean / (1 - BETA1**self.step)
        square = self.square / (1 - BETA2**self.step)
        values -= (rate * mean / (np.sqrt(square) + EPSILON)).astype(np.float32)


class Trainer:
    """The state of a training: field, moments, occupancy, photos with their gains."""

    def __init__(
        self,
        field: Field,
        network: NDArray[np.float32],
        layout: FieldLayout,
        photos: TrainingPhotos,
        points_m: FloatArray,
        bounds: F32,
        budget: int,
        config: RadianceConfig,
        rng: np.random.Generator,
    ) -> None:
        self.field, self.network, self.layout = field, network, layout
        self.photos, self.bounds, self.config, self.rng = photos, bounds, config, rng
        self.budget = budget
        self.batch_samples = min(max(budget // BATCHES, MIN_BATCH_SAMPLES), config.batch_samples)
        self.moments = np.zeros((len(field.table), 2, FEATURES), np.float32)
        self.gradient = np.zeros_like(field.table)
        self.value = np.zeros(len(field.occupied), np.float32)
        self.network_adam = AdamVector.like(network)
        self.gain_adam = AdamVector.like(photos.photos.gain)
        room = self.batch_samples // PARTS * 2 + MAX_BLOCKS * LANES
        self.samples_left = Samples(
            np.empty((PARTS, room, 3), np.float32),
            np.empty((PARTS, LEVELS, room, FEATURES), np.float32),
            np.empty((PARTS, room), np.int32),
            np.empty((PARTS, room), np.float32),
            np.zeros((PARTS, 2), np.int64),
        )
        self.next_prune = config.prune_from
        self.steps_done = 0
        self.samples_done = 0
        self.samples_per_ray = 64.0
        self.error = np.nan
        self._seed(points_m)

    def _seed(self, points_m: FloatArray) -> None:
        """At the wall anything may be; in front of it only what is near a point.

        A plain wall looks the same from everywhere, so that photos alone would leave it anywhere.
        """
        config, layout = self.config, self.layout
        front, slab = (
            self.value[layout.region_first[region] : layout.region_first[region + 1]].reshape(
                layout.region_dims[region]
            )
            for region in (FRONT, SLAB)
        )
        depth = config.relief_m - layout.region_low_m[SLAB][2]
        slab[:, :, : int(np.ceil(depth / layout.region_cell_m[SLAB]))] = 4.0 * self._threshold(SLAB)
        standing = points_m[points_m[:, 2] > config.relief_m]
        for cells, region in ((front, FRONT), (slab, SLAB)):
            cell = layout.region_cell_m[region]
            for point in standing:
                place = (point - layout.region_low_m[region]) / cell
                low = np.maximum(np.floor(place - config.seed_radius_m / cell), 0).astype(int)
                high = np.maximum(np.ceil(place + config.seed_radius_m / cell), 0).astype(int)
                cells[low[0] : high[0], low[1] : high[1], low[2] : high[2]] = 4.0 * self._threshold(
                    region
                )
        self.field.occupied[:] = self.value > 0

    def step(self, pool: ThreadPoolExecutor, fraction: float) -> None:
        """One batch; ``fraction`` of the training lies behind."""
        config = self.config
        number = int(self.batch_samples / max(self.samples_per_ray, 4.0))
        number = max(PARTS, number // PARTS * PARTS)
        draws = self.photos.draw(self.rng, number)
        noise = self.rng.random((number, 4), dtype=np.float32)
        steps = self._steps(fraction)
        late = np.clip(2.0 * fraction - 0.5, 0.0, 1.0)
        shape = late * np.array([config.spread_weight, config.stand_off_weight], np.float32)
        packed = self.photos.photos
        gains = np.zeros((PARTS, *packed.gain.shape), np.float32)
        weights = np.zeros((PARTS, len(self.network)), np.float32)
        totals = np.zeros((PARTS, 3))
        size = number // PARTS

        def rays(part: int) -> None:
            rows = slice(part * size, (part + 1) * size)
            train_rays(
                self.field,
                packed,
                draws[rows],
                noise[rows],
                self.bounds,
                steps,
                shape,
                np.float32(config.huber),
                part,
                self.samples_left,
                gains[part],
                weights[part],
                totals[part],
            )

        run_all(pool, rays, range(PARTS))
        _, used, dropped = totals.sum(axis=0)
        self.error = float(totals[:, 0].sum() / max(used * 3, 1))
        visited = int(self.samples_left.filled[:, 1].sum())
        self.samples_done += visited
        self.samples_per_ray = 0.5 * self.samples_per_ray + 0.5 * visited / max(number - dropped, 1)
        self.steps_done += 1

        decay = config.final_rate ** max(
            0.0, (fraction - config.decay_from) / (1 - config.decay_from)
        )
        rate = config.learning_rate * decay
        warm = np.sqrt(1 - BETA2**self.steps_done) / (1 - BETA1**self.steps_done)
        rates = np.array([rate * warm, BETA1, BETA2, EPSILON], np.float32)

        def level(number: int) -> None:
            if number == LEVELS:
                visit(self.samples_left, self.value, np.float32(config.forget))
                return
            scatter(self.field, number, self.samples_left, self.gradient)
            first, last = self.layout.first[number : number + 2]
            adam(self.field.table, self.gradient, self.moments, first, last, rates)

        run_all(pool, level, [LEVELS - 1 - i for i in range(LEVELS)] + [LEVELS])
        self.network_adam.update(
            self.network, weights.sum(axis=0, dtype=np.float64), config.network_rate * decay
        )
        self._update_gains(gains.sum(axis=0, dtype=np.float64), rate)
        if fraction >= self.next_prune:
            self.next_prune = fraction * config.prune_growth
            self._prune(pool)

    def _steps(self, fraction: float) -> F32:
        """Distance between samples in front and slab."""
        config = self.config
        start, end = config.first_step_px, config.step_px
        share = np.clip(fraction / config.shorten_until, 0.0, 1.0)
        step_px = start * (end / start) ** share
        return np.array([config.front_step_m, step_px * config.m_per_px], np.float32)

    def _update_gains(self, gradient: FloatArray, rate: float) -> None:
        """Exposure of each photo against the mean of all; the mean stays 1."""
        gain = self.photos.photos.gain
        self.gain_adam.update(gain, gradient, rate * 0.1)
        trained = gain[:-1] if self.photos.held_out else gain
        trained /= np.exp(np.log(np.maximum(trained, 0.05)).mean(axis=0))

    def _prune(self, pool: ThreadPoolExecutor) -> None:
        """Skip from now on what is empty: cells below the threshold without a dense neighbour."""
        config, layout = self.config, self.layout
        for region in (FRONT, SLAB):
            first, last = layout.region_first[region : region + 2]
            cells = first + np.flatnonzero(self.field.occupied[first:last])
            inside = self.rng.random((len(cells), 3), dtype=np.float32)
            size = -(-len(cells) // PARTS)

            def look(
                part: int,
                region: int = region,
                cells: I64 = cells,
                inside: F32 = inside,
                size: int = size,
            ) -> None:
                rows = slice(part * size, (part + 1) * size)
                keep = np.float32(config.keep)
                cell_densities(self.field, region, cells[rows], inside[rows], keep, self.value)

            run_all(pool, look, range(PARTS))
            refresh(
                self.value,
                int(first),
                layout.region_dims[region],
                np.float32(self._threshold(region)),
                self.field.occupied,
            )

    def _threshold(self, region: int) -> float:
        """Density per metre below which a sample absorbs too little to be worth its time."""
        config = self.config
        step_m = (config.front_step_m, config.step_px * config.m_per_px)[region]
        return config.min_opacity / step_m


def run_all(pool: ThreadPoolExecutor, task: Callable[[int], None], numbers: Iterable[int]) -> None:
    """Run a task for each number and wait; errors of a task are raised here."""
    for _ in pool.map(task, numbers):
        pass
