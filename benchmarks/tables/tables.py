"""The paper's tables with our rows below the paper's, as Markdown between two marks of a page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from benchmarks.tables import paper
from benchmarks.tables.cases import Case, pictures_of, seconds_of
from benchmarks.tables.cells import ABSENT, cell, lines_of, number, spread, verdict
from benchmarks.tables.scores import Metrics, Scored, metrics, pooled, scored

from si3fp.errors import InputError

BEGIN, END = "<!-- estate tables: begin -->", "<!-- estate tables: end -->"
METHODS = (
    ("photos-mosaic", False, paper.CAMERA, "photos, mosaic"),
    ("photos-mosaic", True, None, "photos, mosaic (Total)"),
    ("photos-radiance", False, paper.CAMERA, "photos, radiance field"),
    ("photos-radiance", True, None, "photos, radiance field (Total)"),
    ("street", False, paper.STREET, "street"),
    ("street", True, paper.STREET_TOTAL, "street (Total)"),
)
"""Run, over all facades, the paper's name and ours."""
OTHER, ALL, MEMORY = "files, report, start-up", "whole run", "peak memory (GiB)"


def block(cases: Sequence[Case], command: str) -> str:
    """All tables of the cases, with what they are and what is missing."""
    rows, verdicts = _table_3(cases)
    judged = sum(verdicts.values())
    lines = [
        f"Made by `{command}`.",
        "",
        "**The same kind of building and the same protocol, rendered: not the paper's buildings.** "
        "B1 to B3 have the paper's height, longest side and number of facades; everything else is "
        "drawn by the seed, and pictures are fewer and smaller than the paper's (below). Our rows "
        "are the mean over seeds with the range in brackets: **bold** is better than the paper's "
        "row above, *slanted* worse, at the digits shown; signed errors are judged by the mean of "
        "their magnitudes. Totals of ours are pooled: micro over windows, mean over facades.",
        "",
        *lines_of(["building", "method", *(column.head for column in paper.COLUMNS)], rows),
        "",
        *([f"{verdicts['better']} of {judged} figures are better than the paper's, "
           f"{verdicts['same']} equal, {verdicts['worse']} worse.", ""] if judged else []),
        *lines_of(
            ["building", "whose", "height (m)", "longest side (m)", "facades", "photos", "px",
             "panoramas", "px", "facades missing (street)"],
            _table_2(cases),
        ),
        "",
        "Time per building, the mean over runs with the range; C.1 and S.1 of ours read files.",
        "",
        *lines_of(["step", f"paper ({paper.MACHINE})", *_runs(cases)], _table_5(cases)),
        "",
        *_footnotes(cases),
    ]  # fmt: skip
    return "\n".join(lines).rstrip()


def replaced(page: str, text: str) -> str:
    """The page with the text between its two marks.

    Raises
    ------
    InputError
        If the page does not have each mark once, in order.
    """
    if page.count(BEGIN) != 1 or page.count(END) != 1 or page.index(BEGIN) > page.index(END):
        raise InputError(
            f"The page needs the lines {BEGIN} and {END} once each, in this order; the tables go "
            "between them."
        )
    before, _, rest = page.partition(BEGIN)
    return f"{before}{BEGIN}\n\n{text}\n\n{END}{rest.partition(END)[2]}"


def _table_3(cases: Sequence[Case]) -> tuple[list[list[str]], Counter[str]]:
    names = list(dict.fromkeys(case.building for case in cases))
    runs = _runs(cases)
    rows: list[list[str]] = []
    verdicts: Counter[str] = Counter()
    for name in [*names, *([paper.TOTAL] if len(names) > 1 else [])]:
        above = ""
        for run, total, theirs, ours in METHODS:
            if run not in runs:
                continue
            found = _by_seed(cases, names if name == paper.TOTAL else [name], run, total=total)
            known = paper.TABLE_3.get((name, theirs or ""), {})
            # The paper has no totals of photos: a row of ours only where a facade is missing.
            if theirs is None and not _misses(cases, name, run):
                continue
            if name == paper.TOTAL and set(names) != set(paper.BUILDINGS):
                known = {}  # of other buildings
            if known and theirs != above:
                figures = [number(known.get(c.name), c) for c in paper.COLUMNS]
                rows.append([name, f"paper, {theirs}", *figures])
                above = theirs or ""
            cells = []
            for column in paper.COLUMNS:
                values = [m[column.name] for m in found]
                plain = [value for value in values if value is not None]
                cells.append(cell(plain, known.get(column.name), column))
                judged = verdict(plain, known.get(column.name), column)
                verdicts[judged or "none"] += 1
            rows.append([name, f"ours, {ours}", *cells])
    del verdicts["none"]
    return rows, verdicts


def _runs(cases: Sequence[Case]) -> list[str]:
    """Names of the runs in the order of the table."""
    there = {case.run_name for case in cases}
    return [run for run, total, _, _ in METHODS if run in there and not total]


def _misses(cases: Sequence[Case], name: str, run: str) -> bool:
    return any(
        case.evaluation is not None and case.evaluation["missing_count"]
        for case in cases
        if case.run_name == run and name in (case.building, paper.TOTAL)
    )


def _by_seed(
    cases: Sequence[Case], buildings: Sequence[str], run: str, *, total: bool
) -> list[Metrics]:
    """The pooled metrics of every seed of which all the buildings are there."""
    parts: dict[int, list[Scored]] = {}
    for case in cases:
        if case.run_name == run and case.building in buildings and case.evaluation is not None:
            parts.setdefault(case.seed, []).append(scored(case.evaluation, total=total))
    return [
        metrics(pooled(found), total=total)
        for found in parts.values()
        if len(found) == len(buildings)
    ]


def _table_2(cases: Sequence[Case]) -> list[list[str]]:
    rows = []
    for name in dict.fromkeys(case.building for case in cases):
        own = [case for case in cases if case.building == name]
        known = paper.TABLE_2.get(name)
        if known is not None:
            rows.append([
                name, "paper", f"{known.height_m:.1f}", f"{known.longest_side_m:.1f}",
                str(known.facades), str(known.images), known.image_px, str(known.panoramas),
                known.panorama_px, f"{known.missing} ({100 * known.missing / known.facades:.1f} %)",
            ])  # fmt: skip
        truths = [case.evaluation for case in own if case.evaluation is not None]
        sizes = [building for truth in truths for building in truth["buildings"]]
        missing = [
            case.evaluation["missing_count"]
            for case in own
            if case.path == "street" and case.evaluation is not None
        ]
        facades = [truth["facade_count"] for truth in truths]
        share = 100 * sum(missing) / len(missing) / facades[0] if missing else None
        rows.append([
            name,
            "ours",
            spread([building["height_m"] for building in sizes], 1),
            spread([building["longest_side_m"] for building in sizes], 1),
            spread(facades, 0),
            *_pictures([case for case in own if case.path == "photos"], "photos"),
            *_pictures([case for case in own if case.path == "street"], "panoramas"),
            ABSENT if share is None else f"{spread(missing, 1)}, {share:.1f} %",
        ])  # fmt: skip
    return rows


def _pictures(cases: Iterable[Case], kind: str) -> tuple[str, str]:
    """Number and size of the pictures that the evaluated runs of some cases had."""
    sets = {case.set_folder: case for case in cases if case.evaluation is not None}.values()
    found = [pictures for case in sets if (pictures := pictures_of(case, kind)) is not None]
    sizes = ", ".join(sorted({pictures.size_px for pictures in found}))
    return spread([pictures.count for pictures in found], 0), sizes or ABSENT


def _table_5(cases: Sequence[Case]) -> list[list[str]]:
    known = dict(paper.TABLE_5)
    steps: dict[str, dict[str, list[float]]] = {run: {} for run in _runs(cases)}
    for case in cases:
        if case.run is None or case.stage is None or not case.stage.done:
            continue
        own = Counter[str]()
        for step, seconds in case.run["seconds"].items():
            number_of_step = step.split()[0]
            own[number_of_step if number_of_step in known else OTHER] += seconds
        own[OTHER] += max(case.stage.seconds - sum(own.values()), 0.0)
        own[ALL] = case.stage.seconds
        own[MEMORY] = case.stage.peak_mib / 1024
        for step, value in own.items():
            steps[case.run_name].setdefault(step, []).append(value)
    known[ALL] = f"{paper.WHOLE['street']} street, {paper.WHOLE['photos']} photos"
    return [
        [
            step if step == MEMORY else f"{step} (s)",
            known.get(step, ABSENT),
            *(spread(found.get(step, []), 1) for found in steps.values()),
        ]
        for step in (*dict(paper.TABLE_5), OTHER, ALL, MEMORY)
    ]


def _footnotes(cases: Sequence[Case]) -> list[str]:
    """Machines, rendering, versions, and what is missing."""
    stages = [case.stage for case in cases if case.stage is not None and case.stage.done]
    machines = sorted({stage.machine for stage in stages if stage.machine})
    versions = sorted({case.run["si3fp_version"] for case in cases if case.run is not None})
    lines = []
    if machines:
        lines.append(f"Our machine: {'; '.join(machines)}. si3fp {', '.join(versions)}.")
    lines += _rendering({case.folder: case for case in cases}.values())
    unfinished = [f"- {case.label}: {case.problem}" for case in cases if case.problem]
    if unfinished:
        lines += ["", "Not in the tables:", "", *unfinished]
    return lines


def _rendering(cases: Iterable[Case]) -> list[str]:
    """What a picture of the sets took to render, and the truth of a building."""
    times = [seconds_of(case) for case in cases]
    found = []
    for kind, word in (("panoramas", "a panorama"), ("photos", "a photo"), ("truth", "the truth")):
        values = [each[kind] for each in times if kind in each]
        if values:
            found.append(f"{word} {spread(values, 0)} s")
    return [f"Rendering took: {', '.join(found)}."] if found else []
