"""Curves of a training run: losses and validation metrics over time."""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
from matplotlib import pyplot as plt


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def draw(run: Path, target: Path) -> None:
    """PNG with three panels: losses, F1 at IoU 0.5 and 0.75, AP50 and mean IoU."""
    losses, metrics = _rows(run / "losses.csv"), _rows(run / "metrics.csv")
    figure, axes = plt.subplots(1, 3, figsize=(15, 4.2), layout="constrained")
    minutes = [float(r["minutes"]) for r in losses]
    for name in ("total", "centre", "giou", "side"):
        axes[0].plot(minutes, [float(r[name]) for r in losses], label=name)
    axes[0].set_yscale("log")
    axes[0].set_title("training losses")
    sets = sorted({r["set"] for r in metrics})
    panels = ((axes[1], ("f1_50", "f1_75")), (axes[2], ("ap50", "mean_iou")))
    for axis, names in panels:
        for colour, key in enumerate(sets):
            rows = [r for r in metrics if r["set"] == key]
            for name, style in zip(names, ("-", "--"), strict=True):
                axis.plot(
                    [float(r["minutes"]) for r in rows],
                    [float(r[name]) for r in rows],
                    style,
                    color=f"C{colour}",
                    label=key if style == "-" else None,
                )
        axis.set_ylim(0, 1)
        axis.set_title(f"validation: {names[0]} (line), {names[1]} (dashed)")
    for axis in axes:
        axis.set_xlabel("minutes")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7)
    figure.savefig(target, dpi=90)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", type=Path, required=True, help="folder of training.train --out")
    parser.add_argument("--out", type=Path, required=True, help="PNG to write")
    options = parser.parse_args()
    draw(options.run, options.out)


if __name__ == "__main__":
    main()
