"""How well the scale of a picture is found from its windows, and what a wrong one costs.

``python -m benchmarks.accuracy.picture_scale DATA [PICTURES]`` (extra ``train``; the folder with
``hslu-facades`` and ``spb-facades``): the validation pictures, resampled so that their true median
window is 1.4 m high at the scale of the training, times 0.3 to 3. F1 of the windows at the
recommended score and IoU 0.5 with the true scale and with the estimated one; the median factor
between the two, and how often it is below 1.25 and below 1.6. ``PICTURES`` of each set are taken
at random (all).
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from training.augment import Sample
from training.data import IGNORE, M_PER_PX, WINDOW, Facade, read_validation
from training.matching import Matched, join, match
from training.measure import views

from si3fp.model import Detections
from si3fp.steps.pictures import detect_on_picture
from si3fp.windows.detect import OnnxDetector, WindowDetector

FACTORS = (0.3, 0.55, 1.0, 1.8, 3.0)
SETS = ("hslu-rectified", "spb")


def measured(
    sample: Sample, true_m_per_px: float, detector: WindowDetector
) -> tuple[Matched, Matched, float]:
    """Windows at the true and at the estimated scale; the latter over the former, 0 for none."""
    rgb = np.ascontiguousarray(sample.image)
    truth, ignored = (sample.boxes[sample.labels == kind] for kind in (WINDOW, IGNORE))

    def matched(found: Detections) -> Matched:
        windows = found.select(found.labels == "window")
        return match(windows.boxes_px, windows.scores, truth, ignored, 0.5)

    known, _ = detect_on_picture(rgb, detector, true_m_per_px)
    found, scale = detect_on_picture(rgb, detector, None)
    return matched(known), matched(found), (scale or 0.0) / true_m_per_px


def row(name: str, results: list[tuple[Matched, Matched, float]]) -> str:
    """A line of the table."""
    known, found, ratios = zip(*results, strict=True)
    off = np.array([max(ratio, 1 / ratio) if ratio else np.inf for ratio in ratios])
    return (
        f"| {name} | {len(off)} | {join(list(known)).f1:.3f} | {join(list(found)).f1:.3f} "
        f"| {np.median(off):.2f} | {np.mean(off < 1.25):.2f} | {np.mean(off < 1.6):.2f} |"
    )


def chosen(facades: list[Facade], name: str, count: int | None) -> list[Facade]:
    """Facades that have a view of this set, ``count`` of them at random."""
    mine = [facade for facade in facades if name in dict(views(facade))]
    order = np.random.default_rng(0).permutation(len(mine))
    return [mine[index] for index in order[:count]]


def main(detector: WindowDetector) -> None:
    facades = read_validation(Path(sys.argv[1]))
    count = int(sys.argv[2]) if len(sys.argv) > 2 else None
    print("| set | pictures | F1, true scale | F1, estimated | off by | < 1.25 | < 1.6 |")
    print("|---|---|---|---|---|---|---|")
    for name in SETS:
        rows: dict[float, list[tuple[Matched, Matched, float]]] = {f: [] for f in FACTORS}
        for facade in chosen(facades, name, count):
            for factor in FACTORS:
                sample = dict(views(facade, factor)).get(name)
                if sample is not None and (sample.labels == WINDOW).any():
                    rows[factor].append(measured(sample, M_PER_PX / factor, detector))
        for factor, results in rows.items():
            print(row(f"{name} x {factor:g}", results))
        print(row(name, [result for results in rows.values() for result in results]), flush=True)


if __name__ == "__main__":
    main(OnnxDetector())
