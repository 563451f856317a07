"""Training until a budget is spent, the held-out photo gets no better, or Ctrl-C."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from si3fp.camera2d.radiance.training import PARTS, Trainer, run_all
from si3fp.camera2d.radiance.views import render_pixels
from si3fp.errors import FacadeError

Progress = Callable[[str, int, int], None]
"""Called with a name, samples done and samples in all."""

CHECK_EVERY = 0.1
"""Share of the budget between two looks at the held-out photo."""


@dataclass(frozen=True, slots=True)
class FitReport:
    """How a fit went.

    Attributes
    ----------
    samples, steps, seconds
        What it took.
    stopped
        ``samples`` (budget), ``time`` (budget), ``converged`` or ``interrupted``.
    photos
        Photos trained on.
    held_out_id, held_out_psnr_db
        The photo that was left out and how well it was predicted, after fitting its exposure;
        None where there were too few photos to leave one out.
    """

    samples: int
    steps: int
    seconds: float
    stopped: str
    photos: tuple[str, ...]
    held_out_id: str | None
    held_out_psnr_db: float | None


def train(trainer: Trainer, progress: Progress | None) -> FitReport:
    """Train on the trainer's budget of samples or fewer.

    The rates fall in the second part of a training. Where the held-out photo has become no better
    over two checks of the first part, that second part begins.

    Raises
    ------
    FacadeError
        If the colour error is not a number any more, or nothing is left of the field.
    """
    config, photos, budget = trainer.config, trainer.photos, trainer.budget
    stopped, history, next_check = "samples", [], CHECK_EVERY
    with ThreadPoolExecutor(config.threads) as pool:
        trainer.step(pool, 0.0)  # compiles the kernels where they are not cached, off the clock
        start = time.monotonic()
        try:
            while trainer.samples_done < budget:
                elapsed = (time.monotonic() - start) / config.budget_s
                if elapsed >= 1.0:
                    stopped = "time"
                    break
                fraction = max(trainer.samples_done / budget, elapsed)
                if photos.held_out and next_check <= fraction < config.decay_from:
                    next_check += CHECK_EVERY
                    history.append(held_out_psnr_db(trainer, pool))
                    if len(history) > 2 and history[-1] < history[-3] + config.converged_db:
                        stopped, next_check = "converged", np.inf
                        budget = int(trainer.samples_done / config.decay_from)
                before = trainer.samples_done
                trainer.step(pool, fraction)
                if trainer.samples_done == before:
                    raise FacadeError(
                        f"The radiance field has become empty after {trainer.steps_done} steps: "
                        "the photos agree on nothing near the wall. Check the poses and the scale, "
                        "or use --renderer mosaic."
                    )
                if not np.isfinite(trainer.error):
                    raise FacadeError(
                        f"The radiance field broke down after {trainer.steps_done} steps: its "
                        "colour error is not a number. Check the poses and the scale."
                    )
                if progress is not None and trainer.steps_done % 16 == 0:
                    progress("radiance field", min(trainer.samples_done, budget), budget)
        except KeyboardInterrupt:
            stopped = "interrupted"
        seconds = time.monotonic() - start
        psnr = held_out_psnr_db(trainer, pool) if photos.held_out else None
    if progress is not None and stopped != "interrupted":
        progress("radiance field", budget, budget)
    ids = photos.ids
    return FitReport(
        trainer.samples_done,
        trainer.steps_done,
        seconds,
        stopped,
        ids[:-1] if photos.held_out else ids,
        ids[-1] if photos.held_out else None,
        psnr,
    )


def held_out_psnr_db(trainer: Trainer, pool: ThreadPoolExecutor) -> float:
    """Peak signal-to-noise ratio at random pixels of the held-out photo.

    Its exposure is fitted first: one gain per channel by least squares.
    """
    photos, config = trainer.photos, trainer.config
    draws = photos.draw_held_out(np.random.default_rng(0), config.held_out_pixels)
    steps = np.array([config.front_step_m, config.step_px * config.m_per_px], np.float32)
    rendered = np.empty((len(draws), 3), np.float32)
    size = -(-len(draws) // PARTS)

    def rays(part: int) -> None:
        rows = slice(part * size, (part + 1) * size)
        render_pixels(
            trainer.field, photos.photos, draws[rows], trainer.bounds, steps, rendered[rows]
        )

    run_all(pool, rays, range(PARTS))
    packed = photos.photos
    at = packed.first[draws[:, 0]] + draws[:, 2] * packed.width[draws[:, 0]] + draws[:, 1]
    hit = np.isfinite(rendered).all(axis=1)
    truth, image = packed.pixels[at[hit]] / 255.0, rendered[hit].astype(np.float64)
    if not len(image):
        return float("nan")
    gain = (truth * image).sum(axis=0) / np.maximum((image**2).sum(axis=0), 1e-9)
    return float(-10.0 * np.log10(max(np.mean((gain * image - truth) ** 2), 1e-12)))
