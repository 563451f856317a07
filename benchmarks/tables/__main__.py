"""Renders the buildings, runs both paths on them, scores the runs and writes the tables.

``python -m benchmarks.tables --size full -o DIR`` goes on where it stopped; what failed is tried
again, and is a line below the tables until it works. ``--only-tables`` makes nothing new.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.tables.cases import Case, make, read
from benchmarks.tables.failures import write_worst
from benchmarks.tables.paper import BUILDINGS
from benchmarks.tables.plan import write_plan
from benchmarks.tables.stages import ROOT
from benchmarks.tables.tables import block, replaced

from si3fp.errors import Si3fpError
from si3fp.workspace import write_text

PAGE = ROOT / "docs" / "benchmarks.md"


def main(arguments: Sequence[str] | None = None) -> int:
    """The tables of all cases, in the page and in ``DIR/tables.md``."""
    options = _parser().parse_args(arguments)
    page = options.docs.read_text(encoding="utf-8")
    replaced(page, "")  # a page without the marks is said before hours of work
    cases = []
    for case in _cases(options):
        done = case
        print(f"{case.label} ...", file=sys.stderr, flush=True)
        if options.only_tables:
            done = read(case)
        else:
            done = make(case, options.size, options.paths, options.limit_min * 60,
                        again=options.again)  # fmt: skip
        picture = write_worst(done, options.output / "failures")
        if done.path == "street":
            write_plan(done, options.output / "failures")
        print(f"{case.label}: {done.problem or 'done'}"
              + (f", {picture}" if picture else ""), file=sys.stderr, flush=True)  # fmt: skip
        cases.append(done)
    text = block(cases, _command(options))
    write_text(options.output / "tables.md", text + "\n")
    # Read again: the work may have taken hours.
    write_text(options.docs, replaced(options.docs.read_text(encoding="utf-8"), text))
    print(text)
    return 1 if any(case.problem for case in cases) else 0


def _cases(options: argparse.Namespace) -> list[Case]:
    return [
        Case(
            building,
            seed,
            path,
            renderer,
            (options.output / f"{building.replace(':', '-')}-{options.size}-{seed}").absolute(),
        )
        for seed in options.seeds
        for building in options.buildings
        for path in options.paths
        for renderer in (options.renderers if path == "photos" else options.renderers[:1])
    ]


def _command(options: argparse.Namespace) -> str:
    words = [
        *("python -m benchmarks.tables --buildings", *options.buildings),
        *("--seeds", *map(str, options.seeds), "--paths", *options.paths),
        *("--renderers", *options.renderers, "--size", options.size, "-o DIR"),
    ]
    return " ".join(words)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tables", description=__doc__)
    parser.add_argument("--buildings", nargs="+", default=list(BUILDINGS), metavar="SPEC")
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3], metavar="N")
    parser.add_argument(
        "--paths", nargs="+", default=["street", "photos"], choices=["street", "photos"]
    )
    parser.add_argument(
        "--renderers", nargs="+", default=["mosaic", "radiance"], choices=["mosaic", "radiance"]
    )
    parser.add_argument("--size", default="full", choices=["full", "small"])
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    parser.add_argument("--docs", type=Path, default=PAGE, metavar="FILE")
    parser.add_argument(
        "--again", action="store_true", help="repeat runs and evaluations; the sets stay"
    )
    parser.add_argument("--only-tables", action="store_true", help="of what is there")
    parser.add_argument("--limit-min", type=float, default=300.0, help="longest stage")
    return parser


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Si3fpError as error:
        print(f"Error: {error}", file=sys.stderr)
        sys.exit(1)
