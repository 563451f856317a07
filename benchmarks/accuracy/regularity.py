"""What rows and columns of a facade do to its windows, and how often they complete it rightly.

``python -m benchmarks.accuracy.regularity RUN TRUTH [RUN TRUTH ...]`` takes finished runs of
`si3fp street` and their truth (an HBJSON, or ``tests/data/castle_truth.json``) and prints

* the scores of the windows as measured, corrected, and completed;
* what becomes of windows that hang behind random blinds of 2 to 4 m until 15 % of them are hidden
  by more than half: what the detector had found there is taken away, windows that show by
  a third or more are cut. ``seen`` leaves the blinds out of what was seen, so that silence there
  says nothing; ``blank`` calls the same places well seen, so that every addition is wrong.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from benchmarks.accuracy.views_or_fused import Parsed, facades_of, truth_of

from si3fp.config import FusionConfig, MeasureConfig
from si3fp.evaluate import Evaluation, evaluate
from si3fp.geometry.boxes import iou_matrix
from si3fp.model import Detections, GeoOrigin, Window
from si3fp.windows.detect import OnnxDetector
from si3fp.windows.fuse import combine, fuse_views
from si3fp.windows.join import join_openings
from si3fp.windows.lattice import complete_windows
from si3fp.windows.measure import edges_from_box, measure_windows, stands_on_ground
from si3fp.windows.parse import of_label
from si3fp.windows.recess import estimate_recess
from si3fp.windows.refine import refine_boxes
from si3fp.windows.regular import correct_windows, edges_of
from si3fp.windows.seen import wall_seen
from si3fp.workspace import Workspace, read_json

TRIALS = 40
HIDDEN_SHARE = 0.15
LEAST_VISIBLE = 0.33
MEASURE = MeasureConfig()


@dataclass(frozen=True)
class Found:
    """One facade before regularity."""

    parsed: Parsed
    windows: tuple[Window, ...]
    candidates: tuple[Window, ...]
    entrances_m: np.ndarray
    seen: np.ndarray


def before_regularity(parsed: Parsed, threshold: float) -> Found:
    grid, fusion = parsed.grid, FusionConfig()
    per_view = {name: of_label(found) for name, found in parsed.per_view.items()}
    agreed = fuse_views(per_view, fusion)
    proposed = combine(agreed, of_label(parsed.on_fused), parsed.views, fusion)
    sure = proposed.detections.scores >= threshold
    joined = join_openings(
        proposed.select(np.flatnonzero(sure)), parsed.fused, grid.m_per_px, MEASURE
    )
    refined = refine_boxes(joined, parsed.fused, grid.m_per_px, MEASURE)
    boxes = refined.detections.boxes_px
    recesses = estimate_recess(boxes, parsed.views, parsed.cameras, grid.m_per_px, MEASURE)
    nothing = Detections(np.zeros((0, 4)), np.zeros(0), np.zeros(0, np.str_))
    weak = proposed.select(np.flatnonzero(~sure))
    edges = [edges_from_box(box, grid) for box in boxes]
    return Found(
        parsed,
        measure_windows(refined, nothing, grid, parsed.cameras, MEASURE, recesses),
        measure_windows(weak, nothing, grid, parsed.cameras, MEASURE),
        np.array([e for e in edges if stands_on_ground(e, MEASURE)]).reshape(-1, 4),
        wall_seen(parsed.fused, parsed.views),
    )


def regular(found: Found, threshold: float) -> tuple[tuple[Window, ...], tuple[Window, ...]]:
    grid = found.parsed.grid
    corrected = correct_windows(found.windows, found.seen, grid, MEASURE)
    completed = complete_windows(
        corrected, found.candidates, found.entrances_m, found.seen, grid, threshold, MEASURE
    )
    return corrected, completed


def behind_blinds(found: Found, rng: np.random.Generator) -> tuple[Found, np.ndarray]:
    """The facade with blinds before it, and (H, W) where they are."""
    grid, blinds = found.parsed.grid, np.zeros(found.seen.shape, bool)
    edges = edges_of(found.windows)
    shares = np.zeros(len(edges))
    while (shares > 0.5).mean() < HIDDEN_SHARE:
        width, height = rng.uniform(2, 4, 2) / grid.m_per_px
        x, y = rng.uniform(0, 1, 2) * [grid.width_px + width, grid.height_px + height]
        rows = slice(max(int(y - height), 0), int(y))
        blinds[rows, max(int(x - width), 0) : int(x)] = True
        shares = np.array([blinds[_pixels(e, found)].mean() for e in edges])
    windows = []
    for window, share in zip(found.windows, shares, strict=True):
        cut = _visible(window, blinds, found)
        if share < 0.02:
            windows.append(window)
        elif cut is not None and cut.area_m2 > LEAST_VISIBLE * window.area_m2:
            windows.append(cut)
    weak = [w for w in found.candidates if blinds[_pixels(edges_of([w])[0], found)].mean() < 0.3]
    return replace(found, windows=tuple(windows), candidates=tuple(weak)), blinds


def _pixels(edges_m: np.ndarray, found: Found) -> tuple[slice, slice]:
    grid = found.parsed.grid
    left, right, bottom, top = edges_m
    (x0, y0), (x1, y1) = (
        grid.pixels_from_facade([[left, top], [right, bottom]])
        .round()
        .astype(int)
        .clip(0, [grid.width_px, grid.height_px])
    )
    return slice(y0, max(y1, y0 + 1)), slice(x0, max(x1, x0 + 1))


def _visible(window: Window, blinds: np.ndarray, found: Found) -> Window | None:
    """The bounding box of what shows of a window."""
    rows, columns = _pixels(edges_of([window])[0], found)
    shows = ~blinds[rows, columns]
    if not shows.any():
        return None
    y, x = np.flatnonzero(shows.any(axis=1)), np.flatnonzero(shows.any(axis=0))
    grid = found.parsed.grid
    first, last = np.array([x[0], y[0]]), np.array([x[-1], y[-1]]) + 1
    corner = np.array([columns.start, rows.start])
    box = np.concatenate([corner + first, corner + last]).astype(float)
    left, right, bottom, top = edges_from_box(box, grid)
    return replace(window, x_m=left, y_m=bottom, width_m=right - left, height_m=top - bottom)


def _overlap(windows: tuple[Window, ...], others: tuple[Window, ...]) -> np.ndarray:
    return iou_matrix(edges_of(windows)[:, [0, 2, 1, 3]], edges_of(others)[:, [0, 2, 1, 3]])


def blinds_of(found: Found, threshold: float, rng: np.random.Generator) -> Counter[str]:
    """Counts of hidden, cut, added and completed windows; the unhidden result is the truth."""
    truth, count = regular(found, threshold)[1], Counter[str]()
    if len(truth) < 3:
        return count
    for _ in range(TRIALS):
        hidden, blinds = behind_blinds(found, rng)
        for name, seen in (("seen", np.where(blinds, 0, found.seen)), ("blank", found.seen)):
            # Behind a blind that shows blank wall, the wall is as well seen as it can be.
            map_ = np.where(blinds, 1, seen) if name == "blank" else seen
            case = replace(hidden, seen=map_.astype(np.float32))
            result = regular(case, threshold)[1]
            added = tuple(w for w in result if w.origin == "inferred")
            right = int((_overlap(added, truth) > 0.5).any(axis=1).sum()) if added else 0
            count[f"{name} added"] += len(added)
            count[f"{name} added rightly"] += right
            if name == "seen":
                before = _overlap(truth, hidden.windows).max(axis=1, initial=0)
                after = _overlap(truth, result).max(axis=1, initial=0)
                cut = (before > 0) & (before < 0.9)
                count["gone"] += int((before < 1e-9).sum())
                count["cut"] += int(cut.sum())
                count["cut, IoU before"] += float(before[cut].sum())
                count["cut, IoU after"] += float(after[cut].sum())
    return count


def _row(name: str, results: list[Evaluation]) -> str:
    hits = sum(r.windows.true_positives for r in results)
    wrong = sum(r.windows.false_positives for r in results)
    missed = sum(r.windows.false_negatives for r in results)
    matches = [m for r in results for f in r.facades for m in f.matches]
    error = np.array([m.relative_area_error for m in matches])
    return (
        f"| {name} | {hits / max(hits + wrong, 1):.3f} | {hits / max(hits + missed, 1):.3f} "
        f"| {2 * hits / max(2 * hits + wrong + missed, 1):.3f} "
        f"| {np.mean([m.iou for m in matches]):.3f} | {np.abs(error).mean():.3f} "
        f"| {error.mean():+.3f} | {np.mean([m.position_error_m for m in matches]):.3f} |"
    )


def main() -> None:
    threshold = OnnxDetector().thresholds["window"]
    results: dict[str, list[Evaluation]] = {"measured": [], "corrected": [], "completed": []}
    count = Counter[str]()
    rng = np.random.default_rng(1)
    for run, truth in zip(map(Path, sys.argv[1::2]), map(Path, sys.argv[2::2]), strict=True):
        origin = GeoOrigin(**read_json(Workspace(run).run_json)["origin"])
        true_origin, true = truth_of(truth)
        found = [before_regularity(parsed, threshold) for parsed in facades_of(run)]
        ways = [(each.windows, *regular(each, threshold)) for each in found]
        for way, windows in zip(results, zip(*ways, strict=True), strict=True):
            facades = [
                replace(f.parsed.facade, windows=w) for f, w in zip(found, windows, strict=True)
            ]
            results[way].append(evaluate(facades, true, origin, true_origin))
        for each in found:
            count.update(blinds_of(each, threshold, rng))
    print("| windows | P | R | F1 | mean IoU | area error | signed | position m |")
    print("|---|---|---|---|---|---|---|---|")
    for way, each in results.items():
        print(_row(way, each))
    print()
    for key, value in sorted(count.items()):
        print(f"{key}: {value:.0f}")
    print(f"precision of added windows: {count['seen added rightly'] / count['seen added']:.3f}")
    print(f"of windows gone, added: {count['seen added rightly'] / count['gone']:.3f}")
    for when in ("before", "after"):
        print(f"mean IoU of cut windows {when}: {count[f'cut, IoU {when}'] / count['cut']:.3f}")


if __name__ == "__main__":
    main()
