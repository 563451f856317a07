"""The command line: every verb is a thin shell around an importable function.

Results go to stdout, progress and messages to stderr. Exit codes: 0 done, 1 an error with a
message, 2 wrong usage, 3 done but a facade that cameras saw, or a picture, failed, or the photos
are not ready, 130 interrupted.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NoReturn, TypeVar

import click

import si3fp
from si3fp.config import PhotoConfig, SfmConfig, StreetConfig
from si3fp.demo import run_demo
from si3fp.errors import Si3fpError
from si3fp.geometry.enu import GeoOrigin
from si3fp.pipeline import Run, run_photos, run_street
from si3fp.report.console import progress_bars, progress_lines, summary
from si3fp.report.evaluation_table import evaluation_table
from si3fp.report.map_layer import write_map_layer
from si3fp.report.picture_overlays import overlay_files, write_overlays
from si3fp.report.run_report import write_report
from si3fp.steps import (
    Circle,
    PhotoFiles,
    check_photos,
    detect_pictures,
    evaluate_model,
    picture_files,
    simulate_run,
)
from si3fp.workspace import Workspace, dump_json, read_json

EXIT_PART_FAILED = 3
EXIT_INTERRUPTED = 130

a_path = click.Path(path_type=Path)

Config = TypeVar("Config", StreetConfig, PhotoConfig)


RUN_OPTIONS = (
    click.option("--footprints", type=a_path, help="Footprints: GeoJSON or GeoPackage."),
    click.option(
        "--column",
        "columns",
        multiple=True,
        metavar="NAME=SPELLING",
        help="Another spelling of a footprint property, for example height_m=HOEHE.",
    ),
    click.option("--m-per-px", type=float, help="Resolution of the facades (default 0.02)."),
    click.option("--country", help="Country of the thermal tables (default SE)."),
    click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True),
    click.option("--no-recess-correction", is_flag=True, help="Leave window edges as they appear."),
    click.option(
        "--no-inferred", is_flag=True, help="Add no windows that only rows and columns tell."
    ),
    click.option("--overwrite", is_flag=True, help="Replace what the folder holds."),
)
"""Options of every verb that makes a run."""


def run_options(verb: Callable[..., None]) -> Callable[..., None]:
    """The verb with `RUN_OPTIONS`, in that order in its help."""
    for option in reversed(RUN_OPTIONS):
        verb = option(verb)
    return verb


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(si3fp.__version__, prog_name="si3fp")
def verbs() -> None:
    """Street panoramas or photos of a building to a thermal 3D model with its real windows."""


@verbs.command()
@click.argument("panoramas", type=a_path)
@click.option("-o", "--out", type=a_path, required=True, help="Folder of the run.")
@click.option("--lat", type=float, help="Centre of the neighbourhood, with --lon and --radius-m.")
@click.option("--lon", type=float)
@click.option("--radius-m", type=float)
@run_options
def street(
    panoramas: Path,
    footprints: Path | None,
    out: Path,
    lat: float | None,
    lon: float | None,
    radius_m: float | None,
    columns: tuple[str, ...],
    m_per_px: float | None,
    country: str | None,
    seed: int,
    no_recess_correction: bool,
    no_inferred: bool,
    overwrite: bool,
) -> None:
    """Street panoramas to a thermal model (steps S.1 to S.4, M.1, M.2).

    PANORAMAS is a GeoJSON list or a folder of Photo Sphere JPEGs.
    """
    config = _with_options(
        StreetConfig(seed=seed), m_per_px, country, no_recess_correction, no_inferred
    )
    with progress_bars() as progress:
        run = run_street(
            panoramas,
            footprints,
            out,
            config,
            circle=_circle(lat, lon, radius_m),
            columns=_columns(columns),
            overwrite=overwrite,
            progress=progress,
        )
    _finish(run, out)


@verbs.command()
@click.argument("folder", type=a_path)
@click.option("--check", is_flag=True, help="Only check the photos (step C.1); -o is a JSON file.")
@click.option("-o", "--out", type=a_path, help="Folder of the run.")
@click.option("--triangle", type=a_path, help="Measured distances between places of photos: JSON.")
@click.option("--cameras", type=a_path, metavar="DIR", help="Known cameras: COLMAP's text files.")
@click.option(
    "--origin",
    type=(float, float, float),
    metavar="LAT LON HEIGHT",
    help="Where the known cameras' frame has its zero, x being east and y north.",
)
@click.option("--unscaled", is_flag=True, help="Go on without a scale: ratios and pictures only.")
@click.option(
    "--renderer",
    type=click.Choice(["mosaic", "radiance"]),
    default=PhotoConfig().renderer,
    show_default=True,
    help="Photos blended on the wall's plane, or a radiance field with depth.",
)
@click.option(
    "--mapper",
    type=click.Choice(["incremental", "global"]),
    default=SfmConfig().mapper,
    show_default=True,
    help="How COLMAP finds the poses.",
)
@run_options
def photos(
    folder: Path,
    check: bool,
    out: Path | None,
    triangle: Path | None,
    cameras: Path | None,
    origin: tuple[float, float, float] | None,
    footprints: Path | None,
    columns: tuple[str, ...],
    unscaled: bool,
    renderer: str,
    mapper: str,
    m_per_px: float | None,
    country: str | None,
    seed: int,
    no_recess_correction: bool,
    no_inferred: bool,
    overwrite: bool,
) -> None:
    """Photos of a building to a thermal model (steps C.1 to C.3, M.1, M.2).

    FOLDER holds JPEGs or PNGs, named in the order in which they were taken. Scale: measured
    distances (--triangle), GPS in the photos, or known cameras (--cameras).
    """
    if check:
        _check_photos(folder, out, overwrite)
        return
    if out is None:
        raise click.UsageError("Give the folder of the run with -o, or --check.")
    config = PhotoConfig(seed=seed, renderer=renderer)
    config = replace(config, sfm=replace(config.sfm, mapper=mapper))
    config = _with_options(config, m_per_px, country, no_recess_correction, no_inferred)
    files = PhotoFiles(
        folder=folder,
        triangle=triangle,
        cameras=cameras,
        camera_origin=GeoOrigin(*origin) if origin else None,
        footprints=footprints,
        columns=_columns(columns),
        unscaled=unscaled,
    )
    with progress_bars() as progress:
        run = run_photos(files, out, config, overwrite=overwrite, progress=progress)
    _finish(run, out)


def _check_photos(folder: Path, out: Path | None, overwrite: bool) -> None:
    with progress_bars() as progress:
        done = check_photos(folder, out, overwrite=overwrite, progress=progress)
    click.echo(done.summary)
    if not done.verdict.ready:
        sys.exit(EXIT_PART_FAILED)


@verbs.command()
@click.argument("images", type=a_path, nargs=-1, required=True)
@click.option("-o", "--out", type=a_path, required=True, help="JSON to write.")
@click.option(
    "--m-per-px",
    type=click.FloatRange(0.0005, 0.2),
    help="Scale of all images; without it, each one's is estimated from its windows.",
)
@click.option("--overlay", type=a_path, metavar="DIR", help="Draw the boxes into PNGs there.")
@click.option("--overwrite", is_flag=True, help="Replace an earlier result.")
def detect(
    images: tuple[Path, ...],
    out: Path,
    m_per_px: float | None,
    overlay: Path | None,
    overwrite: bool,
) -> None:
    """Windows on orthographic or near-frontal pictures (step M.1 alone).

    IMAGES are JPEGs, PNGs, or folders of them.
    """
    files = picture_files(images)
    targets = overlay_files(overlay, files, overwrite=overwrite) if overlay else None
    with progress_bars() as progress:
        run = detect_pictures(files, out, m_per_px=m_per_px, overwrite=overwrite, progress=progress)
        if targets:
            write_overlays(run.pictures, targets, progress)
    for picture in run.pictures:
        # A picture without windows is worth a look: it is a note, not a result.
        click.echo(picture.summary, err=not len(picture.detections))
    for reason in run.failed.values():
        click.echo(f"Error: {reason}", err=True)
    if run.failed:
        sys.exit(EXIT_PART_FAILED)


@verbs.command()
@click.argument("run", type=a_path)
@click.option("--epw", type=a_path, required=True, help="Weather file (EPW).")
@click.option(
    "--north",
    "north_deg",
    type=click.FloatRange(-360, 360),
    metavar="DEG",
    help="Compass bearing of the model's y axis, where the run does not know it.",
)
def simulate(run: Path, epw: Path, north_deg: float | None) -> None:
    """Simulate the heating demand of a run's model with EnergyPlus (extra `energy`)."""
    workspace = Workspace(run)
    with progress_lines() as say:
        result = simulate_run(workspace, epw, say, north_deg)
    write_report(run)
    for building in result.buildings:
        click.echo(
            f"{building.id}: {building.heating_kwh:,.0f} kWh heating a year, "
            f"{building.heating_kwh_m2:.0f} kWh/m2"
        )
    click.echo(f"report: {workspace.report}")


@verbs.command()
@click.argument("run", type=a_path)
@click.option("--truth", type=a_path, required=True, help="HBJSON of the true building.")
@click.option("-o", "--out", type=a_path, metavar="DIR", help="Write JSON and a page there.")
@click.option("--epw", type=a_path, help="Weather file (EPW): compare heating demands too.")
@click.option("--join-touching", is_flag=True, help="Apertures that share an edge are one window.")
@click.option("--overwrite", is_flag=True, help="Replace an earlier evaluation.")
def evaluate(
    run: Path, truth: Path, out: Path | None, epw: Path | None, join_touching: bool, overwrite: bool
) -> None:
    """The paper's metrics of a run against the truth.

    RUN is the folder of a run, or an HBJSON file of any tool.
    """
    with progress_lines() as say:
        evaluation = evaluate_model(
            run, truth, out, epw=epw, join_touching=join_touching, overwrite=overwrite, say=say
        )
    click.echo(evaluation_table(evaluation))
    if out is not None:
        # matplotlib takes long to load and only this verb draws with it.
        from si3fp.report.evaluation_report import write_evaluation_report  # noqa: PLC0415

        click.echo(f"report: {write_evaluation_report(evaluation, out)}")


@verbs.command()
@click.option(
    "-o", "--out", type=a_path, default="demo-run", show_default=True, help="Folder of the run."
)
@click.option("--overwrite", is_flag=True, help="Replace what the folder holds.")
def demo(out: Path, overwrite: bool) -> None:
    """Run `street` and `simulate` on the street that ships with the package, against its truth."""
    with progress_bars() as progress:
        code = run_demo(out, overwrite=overwrite, progress=progress)
    if code:
        sys.exit(code)


@verbs.command()
@click.argument("run", type=a_path)
@click.option("--json", "as_json", is_flag=True, help="Machine-readable.")
def info(run: Path, as_json: bool) -> None:
    """What a run found."""
    if as_json:
        click.echo(dump_json(read_json(Workspace(run).run_json)), nl=False)
    else:
        click.echo(summary(run))


def _with_options(
    config: Config,
    m_per_px: float | None,
    country: str | None,
    no_recess_correction: bool,
    no_inferred: bool,
) -> Config:
    """The constants with what the options of both paths change."""
    if m_per_px is not None:
        if not 0.002 <= m_per_px <= 0.2:
            raise click.BadParameter("from 0.002 to 0.2 metres", param_hint="--m-per-px")
        config = replace(config, ortho=replace(config.ortho, m_per_px=m_per_px))
    if country is not None:
        config = replace(config, thermal=replace(config.thermal, country=country))
    measure = replace(
        config.measure,
        correct_recess=config.measure.correct_recess and not no_recess_correction,
        infer=config.measure.infer and not no_inferred,
    )
    return replace(config, measure=measure)


def _finish(run: Run, out: Path) -> None:
    """Map layer, report, summary, exit code."""
    write_map_layer(run)
    write_report(out)
    click.echo(summary(out))
    if run.failed:
        sys.exit(EXIT_PART_FAILED)


def _circle(lat: float | None, lon: float | None, radius_m: float | None) -> Circle | None:
    if lat is None and lon is None and radius_m is None:
        return None
    if lat is None or lon is None or radius_m is None:
        raise click.UsageError("--lat, --lon and --radius-m go together.")
    return Circle(lat, lon, radius_m)


def _columns(pairs: tuple[str, ...]) -> dict[str, str] | None:
    columns = {}
    for pair in pairs:
        name, separator, spelling = pair.partition("=")
        if not (name and separator and spelling):
            raise click.BadParameter(f"{pair!r} is not NAME=SPELLING", param_hint="--column")
        columns[name] = spelling
    return columns or None


def main() -> NoReturn:
    """Entry point: a `Si3fpError` is a message and exit code 1; anything else is a bug."""
    try:
        verbs(standalone_mode=False)
    except click.exceptions.Exit as stop:
        sys.exit(stop.exit_code)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except (KeyboardInterrupt, click.Abort):
        click.echo(
            "Interrupted. The same command without --overwrite continues a run where it stopped.",
            err=True,
        )
        sys.exit(EXIT_INTERRUPTED)
    except Si3fpError as error:
        click.echo(f"Error: {error}", err=True)
        sys.exit(1)
    sys.exit(0)


if __name__ == "__main__":
    main()
