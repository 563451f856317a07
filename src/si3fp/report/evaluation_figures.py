"""The paper's five plots of an evaluation, as SVG text that is the same for the same result."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from si3fp.evaluate import Evaluation, FacadeEvaluation

INK, SOFT, LINE = "#1d2430", "#5b6573", "#e1e5ea"
PRECISION, RECALL = "#2b59c3", "#1a7f64"
BUILDING_COLOURS = ("#2b59c3", "#c8401f", "#1a7f64", "#b07d12", "#7a4fb5", "#0f8fa8")
MOST_BUILDINGS = len(BUILDING_COLOURS)
STYLE: Any = {
    "svg.hashsalt": "si3fp",  # names inside the file, the same every time
    "svg.fonttype": "none",  # text stays text
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Arial", "Helvetica"],
    "font.size": 9.5,
    "text.color": INK,
    "axes.labelcolor": SOFT,
    "axes.edgecolor": "#b8c0cc",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": LINE,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "legend.frameon": False,
    "legend.fontsize": 9,
}

Values = Callable[[FacadeEvaluation], Sequence[float]]


def height_figure(result: Evaluation) -> str | None:
    """Precision and recall by the height of the windows; None without windows."""
    bands = result.by_height
    if not bands:
        return None
    with matplotlib.rc_context(STYLE):
        figure, axes = _figure()
        middle = [(band.from_m + band.to_m) / 2 for band in bands]
        for label, colour, marker, values in (
            ("precision", PRECISION, "o", [band.precision for band in bands]),
            ("recall", RECALL, "s", [band.recall for band in bands]),
        ):
            known = np.array([np.nan if value is None else value for value in values])
            axes.plot(middle, known, marker=marker, color=colour, label=label, clip_on=False)
        total = np.array([np.nan if b.recall_total is None else b.recall_total for b in bands])
        if result.missing_count:
            axes.plot(
                middle, total, "s--", color=RECALL, markerfacecolor="white", clip_on=False,
                label="recall, missing facades included",
            )  # fmt: skip
        axes.set_ylim(0, 1)
        axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
        edges = [bands[0].from_m, *(band.to_m for band in bands)]
        axes.set_xlim(edges[0], edges[-1])
        axes.set_xticks(edges)
        for band, x in zip(bands, middle, strict=True):
            axes.annotate(
                str(band.true_total), (x, 0.02), ha="center", fontsize=8.5, color=SOFT,
                xycoords=("data", "axes fraction"),
            )  # fmt: skip
        axes.set_xlabel("height of the window's centre above the foot of the facade (m)")
        axes.legend(loc="lower center", ncols=3, bbox_to_anchor=(0.5, 1.0))
        return _svg(figure)


def window_area_figure(result: Evaluation) -> str | None:
    """Cumulative distribution of the relative area errors of matched windows."""
    return _cumulative(
        result,
        lambda facade: [abs(match.relative_area_error) for match in facade.matches],
        "absolute error of the window's area over its true area",
        "windows found",
        as_percent=True,
    )


def facade_area_figure(result: Evaluation) -> str | None:
    """Cumulative distribution of the relative area errors of the facades found."""
    return _cumulative(
        result,
        lambda facade: (
            [] if facade.relative_area_error is None else [abs(facade.relative_area_error)]
        ),
        "absolute error of the facade's area over its true area",
        "facades found",
        as_percent=True,
    )


def position_figure(result: Evaluation) -> str | None:
    """Cumulative distribution of the position errors of matched windows."""
    return _cumulative(
        result,
        lambda facade: [match.position_error_m for match in facade.matches],
        "distance of the window's centre from the true one (m)",
        "windows found",
        as_percent=False,
    )


def wwr_figure(result: Evaluation) -> str | None:
    """Box plot of the facades' WWR errors: found, total and imputed; None without facades."""
    found = [f.wwr_error for f in result.facades if f.wwr_error is not None]
    if not result.facades:
        return None
    ratios = [f.wwr_found for f in result.facades if f.wwr_found is not None]
    samples = [("facades found", found)]
    if result.missing_count:
        samples.append(("all (Total)", _errors(result, 0.0)))
        if ratios:
            samples.append(("all, imputed", _errors(result, float(np.mean(ratios)))))
    samples = [(name, values) for name, values in samples if values]
    with matplotlib.rc_context(STYLE):
        figure, axes = _figure()
        axes.axhspan(-0.05, 0.05, color="#eef2fb", zorder=0)
        axes.axhline(0.0, color="#b8c0cc", linewidth=1)
        drawn = axes.boxplot(
            [values for _, values in samples],
            tick_labels=[f"{name}\n({len(values)} facades)" for name, values in samples],
            widths=0.4, patch_artist=True, showmeans=True, showfliers=False,
            medianprops={"color": INK}, whiskerprops={"color": SOFT}, capprops={"color": SOFT},
            meanprops={"marker": "D", "markerfacecolor": "white", "markeredgecolor": INK,
                       "markersize": 5},
        )  # fmt: skip
        for box in drawn["boxes"]:
            box.set(facecolor="#cfdaf3", edgecolor=PRECISION)
        for index, (_, values) in enumerate(samples):
            across = index + 1 + 0.3 * np.linspace(-0.5, 0.5, max(2, len(values)))[: len(values)]
            axes.plot(across, sorted(values), "o", color=PRECISION, markersize=3.5, alpha=0.6)
        most = max(0.06, *(abs(value) for _, values in samples for value in values))
        axes.set_ylim(-1.1 * most, 1.1 * most)
        axes.grid(visible=False, axis="x")
        axes.set_ylabel("WWR found - true")
        return _svg(figure)


def building_colours(result: Evaluation) -> dict[str, str]:
    """A colour for each building; empty for one alone or for too many to tell apart."""
    names = [building.id for building in result.buildings]
    if not 1 < len(names) <= MOST_BUILDINGS:
        return {}
    return dict(zip(names, BUILDING_COLOURS, strict=False))


def _cumulative(
    result: Evaluation, values_of: Values, label: str, whole: str, *, as_percent: bool
) -> str | None:
    """Share of a sample below a value, over all and for each building; None without a sample."""
    everything = [value for facade in result.facades for value in values_of(facade)]
    if not everything:
        return None
    with matplotlib.rc_context(STYLE):
        figure, axes = _figure()
        for building, colour in building_colours(result).items():
            own = [v for f in result.facades if f.building_id == building for v in values_of(f)]
            if own:
                axes.ecdf(own, color=colour, linewidth=1.2, label=f"{building} ({len(own)})")
        axes.ecdf(everything, color=INK, linewidth=2.2, label=f"all ({len(everything)})")
        median = float(np.median(everything))
        said = f"median {median * 100:.1f} %" if as_percent else f"median {median:.3f} m"
        axes.plot([0, median, median], [0.5, 0.5, 0], ":", color=SOFT, linewidth=1.2)
        axes.annotate(
            said, (median, 0.5), xytext=(8, -12), textcoords="offset points", color=INK, fontsize=9
        )
        axes.set_xlim(0, max(1.03 * max(everything), 0.01))
        axes.set_ylim(0, 1.01)
        axes.xaxis.set_major_locator(MaxNLocator(7, min_n_ticks=3))
        if as_percent:
            digits = 0 if max(everything) > 0.1 else 1
            axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=digits))
        axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
        axes.set_xlabel(label)
        axes.set_ylabel(f"share of {whole}")
        axes.legend(loc="lower center", ncols=4, bbox_to_anchor=(0.5, 1.0))
        return _svg(figure)


def _errors(result: Evaluation, missing_wwr: float) -> list[float]:
    return [
        (missing_wwr if facade.wwr_found is None else facade.wwr_found) - facade.wwr_truth
        for facade in result.facades
    ]


def _figure() -> tuple[Figure, Any]:
    figure = Figure(figsize=(5.6, 3.5), layout="constrained")
    return figure, figure.add_subplot()


def _svg(figure: Figure) -> str:
    stream = io.StringIO()
    figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return stream.getvalue()
