"""What a run says on the terminal: a few lines on what it found, and bars while it works."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)

from si3fp.steps import Progress as Report
from si3fp.workspace import Workspace, read_json

SHOWN_NOTES = 4


def summary(run: Path) -> str:
    """A few lines on what a run found and where to look."""
    workspace = Workspace(run)
    about = read_json(workspace.run_json)
    lines = []
    facades = workspace.facade_ids()
    for name in facades:
        facade = read_json(workspace.facade(name, "facade.json"))
        windows = read_json(workspace.facade(name, "windows.json"))["windows"]
        lines.append(
            f"{name}: {facade['width_m']:.2f} x {facade['height_m']:.2f} m, "
            f"{len(windows)} windows, WWR {facade['wwr']:.3f}"
        )
    for row in about["missing"]:
        if row["step"] != "coverage":
            lines.append(f"{row['facade_id']}: failed in {row['step']}: {row['reason']}")
    unseen = sum(row["step"] == "coverage" for row in about["missing"])
    if unseen:
        lines.append(f"{unseen} facades not seen by any camera")
    for building in about["buildings"]:
        if building["wwr"] is not None:
            lines.append(
                f"{building['id']}: {building['storeys']} storeys, WWR {building['wwr']:.3f}"
            )
    notes = about.get("notes", [])
    lines += [f"Note: {note}" for note in notes[:SHOWN_NOTES]]
    if len(notes) > SHOWN_NOTES:
        lines.append(f"{len(notes) - SHOWN_NOTES} more notes are in the report")
    if workspace.model.exists():
        lines.append(f"model: {workspace.model}")
    lines.append(f"report: {workspace.report}")
    return "\n".join(lines)


@contextmanager
def progress_bars() -> Iterator[Report]:
    """A function that draws one bar per step on stderr."""
    bars = Progress(
        TextColumn("{task.description:10}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
    )
    tasks: dict[str, TaskID] = {}
    with bars:

        def progress(step: str, done: int, total: int) -> None:
            if step not in tasks:
                tasks[step] = bars.add_task(step, total=total)
            bars.update(tasks[step], completed=done, total=total)

        yield progress


@contextmanager
def progress_lines() -> Iterator[Callable[[str], None]]:
    """A function that shows the latest line of a long job on stderr."""
    with Console(stderr=True).status("EnergyPlus") as status:
        yield lambda line: status.update(f"EnergyPlus: {line}")
