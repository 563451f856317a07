"""The demo: `si3fp street` and `si3fp simulate` on the shipped street, against its truth.

The street has three houses and nine panoramas, whose poses are 0.10-0.15 m and 0.2-0.3 degrees off
and whose planes 0.05 m and 0.3 degrees. ``python -m benchmarks.estate build street --seed 1 --only
panoramas --only truth -o DIR`` renders it; ``truth.hbjson`` here is ``truth/model.hbjson`` there.
"""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import click

from si3fp.errors import MissingDependencyError
from si3fp.evaluate import Evaluation, FacadeEvaluation, evaluate, facades_from_hbjson
from si3fp.pipeline import run_street
from si3fp.report.map_layer import write_map_layer
from si3fp.report.run_report import write_report
from si3fp.steps import Progress, simulate_run
from si3fp.thermal.energyplus import shipped_epw
from si3fp.workspace import Workspace, read_json

MIN_F1 = 0.8  # on the facades that a camera sees, the demo fails below this,
MAX_WWR_ERROR = 0.03  # and above this error of the glazed area over the gross wall area


def run_demo(
    out: Path,
    street: Path | None = None,
    *,
    overwrite: bool = False,
    progress: Progress = lambda step, done, total: None,
) -> int:
    """The exit code of the demo: 0, or 1 where too few windows or too wrong a ratio was found.

    Prints the heating demand, what was found against the truth, and the path of the report.

    Parameters
    ----------
    out
        The folder RUN.
    street
        A folder with ``panoramas.geojson``, ``footprints.geojson`` and ``truth.hbjson``; by default
        the street that ships with the package.
    overwrite
        Replace what the folder holds.
    progress
        Told how far each step is.
    """
    street = street or Path(str(resources.files("si3fp.demo") / "street"))
    run = run_street(
        street / "panoramas.geojson",
        street / "footprints.geojson",
        out,
        overwrite=overwrite,
        progress=progress,
    )
    write_map_layer(run)
    _simulate(run.workspace)
    result = evaluate_run(run.workspace.model, street / "truth.hbjson")
    click.echo(_table(result))
    good = _verdict(result)
    for lost in run.failed:
        click.echo(f"{lost.facade_id} was seen, but {lost.step} failed: {lost.reason}: NOT GOOD")
    good = good and not run.failed
    click.echo(f"report: {write_report(out)}")
    return 0 if good else 1


def evaluate_run(model: Path, truth: Path) -> Evaluation:
    """The metrics of one honeybee model against another."""
    found_origin, found = facades_from_hbjson(read_json(model))
    true_origin, true = facades_from_hbjson(read_json(truth))
    return evaluate(found, true, found_origin, true_origin)


def _simulate(workspace: Workspace) -> None:
    try:
        result = simulate_run(workspace, shipped_epw())
    except MissingDependencyError as error:
        click.echo(f"No simulation: {error}\n")
        return
    click.echo(f"Heating demand with the weather of {result.weather}:")
    for building in result.buildings:
        click.echo(
            f"  {building.id:12} {building.heating_kwh:10,.0f} kWh a year, "
            f"{building.heating_kwh_m2:4.0f} kWh/m2"
        )
    click.echo()


def _table(result: Evaluation) -> str:
    lines = ["Facade        windows: true  found  right     WWR: true  found"]
    lines += [_line(facade) for facade in result.facades]
    return "\n".join(lines)


def _line(facade: FacadeEvaluation) -> str:
    scores = facade.windows
    true = scores.true_positives + scores.false_negatives
    found = scores.true_positives + scores.false_positives
    if facade.wwr_found is None:
        return f"{facade.facade_id:22}{true:5}  not found         {facade.wwr_truth:11.3f}"
    return (
        f"{facade.facade_id:22}{true:5}  {found:5}  {scores.true_positives:5}"
        f"  {facade.wwr_truth:13.3f}  {facade.wwr_found:5.3f}"
    )


def _verdict(result: Evaluation) -> bool:
    """Whether the result is good enough; prints it."""
    scores, error = result.windows, result.wwr.area_weighted
    if scores.f1 is None or error is None:
        click.echo("No facade with windows was found: NOT GOOD")
        return False
    good = scores.f1 >= MIN_F1 and abs(error) <= MAX_WWR_ERROR
    found = [facade for facade in result.facades if facade.found_id is not None]
    true_m2 = sum(facade.wwr_truth * facade.area_m2 for facade in found)
    wwr_true = true_m2 / sum(facade.area_m2 for facade in found)
    click.echo(
        f"Of the {len(found)} facades found: F1 {scores.f1:.3f} (at least {MIN_F1}), "
        f"WWR {wwr_true + error:.3f} against {wwr_true:.3f}, "
        f"error {error:+.3f} (at most {MAX_WWR_ERROR}): {'good' if good else 'NOT GOOD'}"
    )
    if scores.mean_iou is not None and scores.mean_abs_position_error_m is not None:
        click.echo(
            f"mean IoU {scores.mean_iou:.2f}, "
            f"mean position error {scores.mean_abs_position_error_m:.2f} m"
        )
    return good
