"""What a training run leaves on disk, so that a kill costs nothing that was finished."""

from __future__ import annotations

import csv
from pathlib import Path

import torch


def append_row(path: Path, row: dict[str, float | str]) -> None:
    """Add a row to a CSV file, which begins with the names."""
    fresh = not path.exists()
    with path.open("a", newline="") as stream:
        writer = csv.DictWriter(stream, list(row), lineterminator="\n")
        if fresh:
            writer.writeheader()
        writer.writerow(row)


def save(path: Path, content: dict) -> None:
    """Write tensors under a temporary name and rename."""
    fresh = path.with_suffix(".tmp")
    torch.save(content, fresh)
    fresh.replace(path)
