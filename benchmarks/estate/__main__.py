"""``python -m benchmarks.estate build SPEC --seed N -o DIR``: an estate with its truth.

``python -m benchmarks.estate facades -n COUNT -o DIR``: facade images with boxes, for training.
"""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path

import click
from benchmarks.estate.facades.facades_cli import facades

from si3fp.errors import Si3fpError


@click.group()
def main() -> None:
    """Photoreal housing estates with exact truth."""


@main.command("build")
@click.argument("spec")
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True)
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, metavar="DIR")
@click.option("--size", type=click.Choice(["small", "full"]), default="small", show_default=True)
@click.option(
    "--only",
    type=click.Choice(["panoramas", "photos", "truth"]),
    multiple=True,
    help="Make this part alone; can be given twice. A later run adds the others.",
)
@click.option("--drone", is_flag=True, help="Photos from the air too; a later run keeps them.")
@click.option(
    "--data",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="CityGML files for SPEC ingolstadt:<file stem>.",
)
def build_command(
    spec: str,
    seed: int,
    output: Path,
    size: str,
    only: tuple[str, ...],
    drone: bool,
    data: Path | None,
) -> None:
    """Render the estate SPEC: panoramas, photos and truth, into DIR; finished pictures stay.

    SPEC is b1, b2, b3, slab, high-slab, point, small, street, or a surveyed building.
    """
    from benchmarks.estate.build import PARTS, build  # noqa: PLC0415
    from benchmarks.estate.capture.pictures import SIZES  # noqa: PLC0415
    from benchmarks.estate.specs import estate_of, survey_of  # noqa: PLC0415

    parts = tuple(part for part in PARTS if not only or part in only)
    estate, survey = estate_of(spec, seed, data), survey_of(spec, data)
    if survey is not None:
        click.echo(str(survey), err=True)
    build(
        estate,
        output,
        SIZES[size],
        only=parts,
        drone=drone,
        survey=None if survey is None else asdict(survey),
        say=lambda line: click.echo(line, err=True),
    )
    click.echo(str(output))


main.add_command(facades)


def run() -> None:
    """The commands, an error as one line."""
    try:
        main(standalone_mode=True)
    except Si3fpError as error:
        click.echo(f"Error: {error}", err=True)
        sys.exit(1)


if __name__ == "__main__":
    run()
