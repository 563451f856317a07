"""The radiance field on a synthetic facade: renders the photos, fits, scores, prints a table.

``python -m benchmarks.accuracy.radiance --variant tuned --seed 0 --cache DIR [--budget-s 180]
[--png DIR]``. The fit gets the photos, their poses, the rectangle and points made of the photos.
A busy machine stretches the seconds; those of the processor count for two cores.
Memory is the peak of the process up to the rendered orthophoto, photos included, scores excluded.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from benchmarks.accuracy.radiance.case import Case, add_case_options, case_in
from benchmarks.accuracy.radiance.renderer import START_M
from benchmarks.accuracy.radiance.reprojection import on_the_plane, on_true_depth
from benchmarks.accuracy.radiance.scores import Rendering, Scores, score

from si3fp.camera2d.radiance import RadianceField
from si3fp.config import RadianceConfig
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.model import Image

BEHIND_M = 0.5
M_PER_PX = 0.02

COLUMNS: tuple[tuple[str, Callable[[Scores], str]], ...] = (
    ("PSNR dB", lambda s: f"{s.psnr_db:.2f}"),
    ("after gain", lambda s: f"{s.psnr_gain_db:.2f}"),
    ("edge cm", lambda s: f"{s.edge_cm:.2f}"),
    ("missed", lambda s: f"{s.edges_missed} of {s.edges}"),
    ("recess cm, p90", lambda s: "{:.1f}, {:.1f}".format(*s.recess_cm)),
    ("wall cm, p90", lambda s: "{:.1f}, {:.1f}".format(*s.wall_cm)),
    ("glass cm, p90", lambda s: "{:.1f}, {:.1f}".format(*s.glass_cm)),
    ("balcony cm, p90", lambda s: "{:.1f}, {:.1f}".format(*s.balcony_cm)),
    ("balcony IoU", lambda s: f"{s.balcony_iou:.3f}"),
)


def fitted(case: Case, budget_s: float, seed: int) -> tuple[Rendering, str]:
    """The field's orthophoto, and what the fit took."""
    before_s = time.process_time()
    field = RadianceField.fit(
        case.photos,
        case.load,
        case.world_from_facade,
        case.width_m,
        case.height_m,
        case.points.points_in_world,
        replace(RadianceConfig(), budget_s=budget_s, m_per_px=M_PER_PX),
        np.random.default_rng(seed),
    )
    processor_s = time.process_time() - before_s
    size_m = (case.width_m, case.height_m)
    grid = FacadeGrid.covering(case.world_from_facade, *size_m, M_PER_PX)
    ortho = field.render_ortho(grid, START_M, BEHIND_M)
    peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    report = field.report
    held_out = "none" if report.held_out_psnr_db is None else f"{report.held_out_psnr_db:.2f} dB"
    took = (
        f"{report.seconds:.0f} s ({processor_s:.0f} s of processor), "
        f"{report.samples / 1e6:.1f} M samples, stopped by {report.stopped}, "
        f"held-out photo {held_out}, peak memory {peak_mib:.0f} MiB"
    )
    return Rendering(ortho.rgb, ortho.depth_m), took


def save_pictures(folder: Path, name: str, rendering: Rendering) -> None:
    """``name.png`` and ``name-depth.png`` (grey, -0.5 m black to 1.5 m white)."""
    folder.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(folder / f"{name}.png"), rendering.rgb[..., ::-1])
    if rendering.depth_m is not None:
        cv2.imwrite(str(folder / f"{name}-depth.png"), _grey(rendering.depth_m))


def _grey(depth_m: np.ndarray) -> Image:
    scaled = np.clip((np.nan_to_num(depth_m, nan=-0.5) + 0.5) / 2.0 * 255, 0, 255)
    return np.asarray(scaled, np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add_case_options(parser)
    parser.add_argument("--budget-s", type=float, default=180.0, help="time for training")
    parser.add_argument("--png", type=Path, help="folder for pictures")
    options = parser.parse_args()
    # A process of its own: rendering must not count as memory of the fit.
    name = f"{options.variant}-{options.seed}"
    arguments = ["--variant", options.variant, "--seed", str(options.seed)]
    arguments += ["--cache", str(options.cache)]
    subprocess.run(
        [sys.executable, "-m", "benchmarks.accuracy.radiance.case", *arguments],
        check=True,
        stdout=sys.stderr,
    )
    case = case_in(options.cache, options.variant, options.seed)
    field, took = fitted(case, options.budget_s, options.seed)
    truth = case.truth(M_PER_PX)
    print(f"{name}: {100 * (truth.seen_by >= 2).mean():.1f} % seen by two photos; field: {took}")
    print("| renderer | " + " | ".join(title for title, _ in COLUMNS) + " |")
    print("|---" * (len(COLUMNS) + 1) + "|")

    def add_row(kind: str, rendering: Rendering) -> None:
        scores = score(rendering, truth, case.openings)
        print(f"| {kind} | " + " | ".join(show(scores) for _, show in COLUMNS) + " |", flush=True)
        if options.png:
            save_pictures(options.png, f"{name}-{kind.replace(' ', '-')}", rendering)

    add_row("field", field)
    add_row("plane", on_the_plane(case, truth))
    add_row("true depth", on_true_depth(case, truth))
    if options.png:
        save_pictures(options.png, f"{name}-truth", Rendering(truth.rgb, truth.depth_m))


if __name__ == "__main__":
    main()
