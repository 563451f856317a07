"""The page of an evaluation: tables, the paper's plots and every facade, in one HTML file."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from string import Template

import si3fp
from si3fp.report.evaluation_facades import facades_part
from si3fp.report.evaluation_figures import (
    facade_area_figure,
    height_figure,
    position_figure,
    window_area_figure,
    wwr_figure,
)
from si3fp.report.evaluation_table import (
    COVERAGE_HEAD,
    PAPER_HEAD,
    TOTAL,
    coverage_rows,
    paper_rows,
    signed_percent,
)
from si3fp.report.markup import (
    ABSENT,
    Markup,
    bullets,
    counted,
    folded,
    joined,
    number,
    percent,
    table,
    tag,
)
from si3fp.steps import ModelEvaluation
from si3fp.workspace import write_text

HTML_NAME = "evaluation.html"


def evaluation_report(evaluation: ModelEvaluation) -> str:
    """An evaluation as one self-contained HTML document; the same for the same evaluation."""
    result = evaluation.result
    title = f"{_name(evaluation.found_file)} against the truth"
    body = joined(
        [
            tag(
                "header",
                tag("p", "si3fp evaluation", class_="kicker"),
                tag("h1", title),
                tag("p", f"Truth: {evaluation.truth_file.name}", class_="soft"),
            ),
            _tiles(evaluation),
            tag("p", _summary(evaluation), class_="lead"),
            bullets(evaluation.notes, class_="notes"),
            tag(
                "section",
                tag("h2", "Results"),
                _rows(PAPER_HEAD, paper_rows(result), words=(0, 1)),
                tag("p", METRICS, class_="soft"),
                tag("h3", "Facades found and missing"),
                _rows(COVERAGE_HEAD, coverage_rows(result), words=(0,)),
                _without_partner(evaluation),
                _heating(evaluation),
            ),
            _figures(evaluation),
            facades_part(evaluation.result),
            _about(evaluation),
        ]
    )
    files = resources.files("si3fp.report")
    return Template(files.joinpath("report.html").read_text("utf-8")).substitute(
        title=joined([title]),
        generator=joined([f"si3fp {si3fp.__version__}"]),
        style=files.joinpath("report.css").read_text("utf-8"),
        body=body,
    )


def write_evaluation_report(evaluation: ModelEvaluation, out: Path) -> Path:
    """Write ``out/evaluation.html``; its path."""
    path = out / HTML_NAME
    write_text(path, evaluation_report(evaluation))
    return path


METRICS = (
    "A found window is right where its intersection over union with a true one exceeds 0.5, one to "
    "one, the best first, on the true facade's plane. Total: windows of missing facades are missed "
    "and their WWR is 0; imputed: it is the mean of those found. Errors are found minus true. "
    "F1, IoU, area and position are taken over windows, the WWR over facades; signed errors cancel "
    "in a mean, hence the two columns on the right."
)


def _name(file: Path) -> str:
    return file.resolve().parent.name if file.name == "model.hbjson" else file.name


def _rows(head: tuple[str, ...], rows: list[tuple[str, ...]], words: tuple[int, ...]) -> Markup:
    return table(
        [name.replace("\n", " ") for name in head],
        [
            [ABSENT if cell == "-" else cell.replace(" ", "\N{NO-BREAK SPACE}") for cell in row]
            for row in rows
        ],
        words=words,
        row_classes=["total" if row[0] == TOTAL else None for row in rows],
    )


def _tiles(evaluation: ModelEvaluation) -> Markup:
    result = evaluation.result
    found = result.facade_count - result.missing_count
    values = [
        (f"{found} of {result.facade_count}", "facades found"),
        (number(result.windows_total.f1, 2), "F1 over all facades"),
        (number(result.windows.mean_iou, 2), "mean IoU of the windows found"),
        (number(result.windows.mean_abs_position_error_m, 2, "m"), "mean position error"),
        (number(result.wwr.mean_absolute, 3), "mean magnitude of the WWR error"),
    ]
    if evaluation.heating:
        values.append(
            (signed_percent(evaluation.heating[0].relative_error), "error of the heating demand")
        )
    return tag(
        "div",
        *(tag("div", tag("b", value), tag("span", name), class_="tile") for value, name in values),
        class_="tiles",
    )


def _summary(evaluation: ModelEvaluation) -> str:
    return " ".join(_sentences(evaluation))


def _sentences(evaluation: ModelEvaluation) -> Iterator[str]:
    result = evaluation.result
    windows, everything = result.windows, result.windows_total
    true = everything.true_positives + everything.false_negatives
    yield (
        f"{everything.true_positives} of {counted(true, 'true window')} were found, and "
        f"{counted(everything.false_positives, 'wrong one')}."
    )
    if result.missing_count and result.missing_count < result.facade_count:
        yield (
            f"On the facades found, precision is {percent(windows.precision)} and recall "
            f"{percent(windows.recall)}; with the missing ones recall is "
            f"{percent(everything.recall)}."
        )
    elif windows.precision is not None:
        yield f"Precision is {percent(windows.precision)} and recall {percent(windows.recall)}."
    if result.opening_iou_total is not None:
        yield (
            "As bodies half a metre deep, all openings together overlap with an IoU of "
            f"{number(result.opening_iou_total, 2)}."
        )
    if result.interval.facades:
        yield (
            f"The true WWR lies in its stated interval on {result.interval.covered} of "
            f"{counted(result.interval.facades, 'facade')}."
        )


def _without_partner(evaluation: ModelEvaluation) -> Markup | None:
    rows = [
        [
            row.facade_id,
            "missing" if row.model == "truth" else "not in the truth, not scored",
            str(row.windows),
            row.reason,
        ]
        for row in evaluation.result.unmatched
    ]
    if not rows:
        return None
    return joined(
        [
            tag("h3", "Walls without partner"),
            table(["Facade", "What", "Windows", "Why"], rows, words=(0, 1, 3)),
        ]
    )


def _heating(evaluation: ModelEvaluation) -> Markup | None:
    if not evaluation.heating:
        return None
    rows = [
        [
            row.id,
            number(row.found_kwh, 0),
            number(row.true_kwh, 0),
            signed_percent(row.relative_error),
            number(row.found_kwh_m2, 1),
            number(row.true_kwh_m2, 1),
            signed_percent(row.relative_error_per_area),
        ]
        for row in evaluation.heating
    ]
    head = ["Building", "Found (kWh)", "True (kWh)", "Error", "Found (kWh/m²)", "True (kWh/m²)",
            "Error"]  # fmt: skip
    return joined(
        [
            tag("h3", "Heating demand of a year"),
            table(head, rows),
            tag(
                "p",
                f"EnergyPlus with the weather of {evaluation.weather}, each model with its own "
                "constructions, uses and floor areas.",
                class_="soft",
            ),
        ]
    )


def _figures(evaluation: ModelEvaluation) -> Markup | None:
    result = evaluation.result
    plots = [
        (height_figure(result), "Precision and recall by height. Figures above the axis: true "
         "windows in the band."),
        (window_area_figure(result), "Errors of window areas."),
        (facade_area_figure(result), "Errors of facade areas."),
        (position_figure(result), "Errors of window positions."),
        (wwr_figure(result), "Errors of the window-to-wall ratio. Box: quartiles and median; "
         "diamond: mean; band: ±0.05."),
    ]  # fmt: skip
    drawn = [(svg, caption) for svg, caption in plots if svg is not None]
    if not drawn:
        return None
    return tag(
        "section",
        tag("h2", "Distributions"),
        tag(
            "div",
            *(
                tag("figure", _svg_image(svg, caption), tag("figcaption", caption))
                for svg, caption in drawn
            ),
            class_="pair",
        ),
    )


def _svg_image(svg: str, alternative: str) -> Markup:
    """The drawing as an image of its own, so that names inside it cannot clash."""
    data = base64.b64encode(svg.encode("utf-8")).decode("ascii")
    return tag("img", src=f"data:image/svg+xml;base64,{data}", alt=alternative, style="border:0")


def _about(evaluation: ModelEvaluation) -> Markup:
    return tag(
        "section",
        tag("h2", "About this evaluation"),
        folded(
            "Input files",
            table(
                ["File", "SHA-256"],
                [[name, tag("code", digest)] for name, digest in evaluation.inputs.items()],
                words=(0, 1),
            ),
        ),
        tag("p", f"Made with si3fp {si3fp.__version__}.", class_="foot"),
    )
