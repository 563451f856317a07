"""A run or any honeybee model against the truth, with its files."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from si3fp.errors import InputError, MissingDependencyError, Si3fpError
from si3fp.evaluate import Evaluation, ModelFacades, evaluate, read_facades
from si3fp.evaluate.heating import HeatingErrors, compare_heating
from si3fp.evaluate.metrics import MIN_IOU
from si3fp.evaluate.pairing import in_words
from si3fp.evaluate.totals import HEIGHT_BAND_M, OPENING_DEPTH_M
from si3fp.geometry.enu import GeoOrigin
from si3fp.model import Facade
from si3fp.thermal.energyplus import simulate
from si3fp.thermal.weather import read_weather
from si3fp.workspace import Workspace, dump_json, read_json, sha256_of, stamp, write_text

SCHEMA = "evaluation"
JSON_NAME = "evaluation.json"
DECIMALS = 6
NOTABLE_SHIFT_M = 1.0  # decision: a mean shift of the facades beyond this is said

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False)
class ModelEvaluation:
    """A model against the truth, and what a reader has to know of it.

    Attributes
    ----------
    found_file, truth_file
        The two models.
    result
        The metrics.
    heating
        Both heating demands, all buildings first; empty where they were not simulated.
    weather
        Place of the weather file, or None.
    notes
        What was shifted, joined, left out or could not be done.
    inputs
        SHA-256 of the files by name.
    config
        Options and constants.
    """

    found_file: Path
    truth_file: Path
    result: Evaluation
    heating: tuple[HeatingErrors, ...]
    weather: str | None
    notes: tuple[str, ...]
    inputs: Mapping[str, str]
    config: Mapping[str, Any]


def evaluate_model(
    run: Path,
    truth: Path,
    out: Path | None = None,
    *,
    epw: Path | None = None,
    join_touching: bool = False,
    overwrite: bool = False,
    say: Say = lambda line: None,
) -> ModelEvaluation:
    """The metrics of a run or model against the truth; writes ``out/evaluation.json``.

    Parameters
    ----------
    run
        A run folder, or an HBJSON file of any tool.
    truth
        HBJSON of the truth.
    out
        Folder for the JSON and, with ``epw``, the files of EnergyPlus; None writes nothing.
    epw
        Weather file: compares the heating demands too, where the extra ``energy`` is installed.
    join_touching
        Apertures that share an edge are one window, in both models.
    overwrite
        Replace an earlier evaluation.
    say
        Gets a line of text whenever there is news.

    Raises
    ------
    InputError
        If a file cannot be read, the models do not overlap, the truth has no walls, or ``out``
        holds an evaluation already.
    """
    if out is not None:
        _claim(out, overwrite)
    if epw is not None:
        read_weather(epw)  # a wrong file is said before anything is computed
    found_file = _model_file(run)
    found = _read(found_file, join_touching)
    true = _read(truth, join_touching)
    if not true.facades:
        raise InputError(f"{truth} has no outdoor walls; nothing can be evaluated against it.")
    result = evaluate(
        _with_intervals(found.facades, run),
        true.facades,
        found.origin,
        true.origin,
        buildings=true.buildings,
        balcony_facades=true.balcony_facades,
    )
    result = _with_reasons(result, found.missing)
    heating, weather, energy_notes = _heating(found_file, truth, epw, out, say)
    inputs = {"found": sha256_of(found_file), "truth": sha256_of(truth)}
    if epw is not None:
        inputs["weather"] = sha256_of(epw)
    evaluation = ModelEvaluation(
        found_file,
        truth,
        result,
        heating,
        weather,
        (*_notes(result, found, true), *energy_notes),
        inputs,
        {
            "join_touching": join_touching,
            "min_iou": MIN_IOU,
            "height_band_m": HEIGHT_BAND_M,
            "opening_depth_m": OPENING_DEPTH_M,
        },
    )
    if out is not None:
        write_text(out / JSON_NAME, dump_json(evaluation_record(evaluation)))
    return evaluation


def evaluation_record(evaluation: ModelEvaluation) -> dict[str, Any]:
    """The content of ``evaluation.json``; numbers rounded to six decimals."""
    record: dict[str, Any] = _rounded(
        {
            **stamp(SCHEMA),
            "config": dict(evaluation.config),
            "inputs": dict(evaluation.inputs),
            "notes": evaluation.notes,
            **asdict(evaluation.result),
            "heating": {
                "weather": evaluation.weather,
                "rows": [asdict(row) for row in evaluation.heating],
            }
            if evaluation.heating
            else None,
        }
    )
    return record


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, DECIMALS) + 0.0
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    return value


def _claim(out: Path, overwrite: bool) -> None:
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; give a folder for the evaluation with -o.")
    if (out / JSON_NAME).exists() and not overwrite:
        raise InputError(
            f"{out} holds an earlier evaluation. Give another folder with -o, or replace it with "
            "--overwrite."
        )


def _model_file(run: Path) -> Path:
    if not run.is_dir():
        return run
    model = Workspace(run).model
    if not model.exists():
        raise InputError(
            f"{run} holds no {model.name}. Give the folder of a finished run, or an HBJSON file."
        )
    return model


def _read(file: Path, join_touching: bool) -> ModelFacades:
    content = read_json(file)
    try:
        return read_facades(content, join_touching=join_touching)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error


def _with_intervals(facades: tuple[Facade, ...], run: Path) -> list[Facade]:
    """The facades with the intervals that a run's ``facade.json`` states."""
    if not run.is_dir():
        return list(facades)
    workspace = Workspace(run)
    known = []
    for facade in facades:
        file = workspace.facade(facade.id, "facade.json")
        stated = read_json(file).get("wwr_interval") if file.exists() else None
        known.append(replace(facade, wwr_interval=(stated[0], stated[1])) if stated else facade)
    return known


def _with_reasons(result: Evaluation, missing: Mapping[str, str]) -> Evaluation:
    """The result with the run's own words on facades that it marked as missing."""
    rows = [
        replace(row, reason=f"the run says {missing[row.facade_id]}")
        if row.model == "truth" and row.facade_id in missing
        else row
        for row in result.unmatched
    ]
    return replace(result, unmatched=tuple(rows))


def _notes(result: Evaluation, found: ModelFacades, true: ModelFacades) -> Iterator[str]:
    if not found.facades:
        yield "The found model has no facades."
    elif result.mean_shift_m is None:
        yield (
            "No wall of the found model lies on a true one. Check origins, directions and the "
            "height of the ground in both models."
        )
    if found.origin != true.origin:
        yield _origins(found.origin, true.origin)
    if result.mean_shift_m is not None:
        length_m = sum(value**2 for value in result.mean_shift_m) ** 0.5
        if length_m > NOTABLE_SHIFT_M:
            yield (
                f"The found facades' centres lie {in_words(result.mean_shift_m)} of the true ones "
                "on average: the origin or the height of the ground of one model may be wrong."
            )
    if true.balcony_facades:
        yield f"Facades with balconies: {', '.join(sorted(true.balcony_facades))}."
    for name, model in (("Found model", found), ("Truth", true)):
        yield from (f"{name}: {note}." for note in model.notes)


def _origins(found: GeoOrigin | None, true: GeoOrigin | None) -> str:
    if found is None or true is None:
        lacking = "found model" if found is None else "truth"
        return f"The {lacking} states no origin; both models are taken to share one world."
    return (
        f"The origins differ: {found.lat_deg:.6f}, {found.lon_deg:.6f}, {found.height_m:.2f} m "
        f"(found) and {true.lat_deg:.6f}, {true.lon_deg:.6f}, {true.height_m:.2f} m (truth). The "
        "found model was moved into the true world."
    )


def _heating(
    found: Path, truth: Path, epw: Path | None, out: Path | None, say: Say
) -> tuple[tuple[HeatingErrors, ...], str | None, tuple[str, ...]]:
    """Both demands, the place of the weather, and why there are none."""
    if epw is None:
        return (), None, ("No heating demand was compared: no weather file was given (--epw).",)
    results = []
    with _folder(out) as folder:
        for name, model in (("true", truth), ("found", found)):
            try:
                results.append(simulate(model, epw, folder / name, say))
            except MissingDependencyError as error:
                return (), None, (f"No heating demand was compared: {error}",)
            except Si3fpError as error:
                return (), None, (f"No heating demand was compared: the {name} model: {error}",)
    demands = [
        {building.id: (building.heating_kwh, building.floor_area_m2) for building in r.buildings}
        for r in results
    ]
    return compare_heating(demands[1], demands[0]), results[0].weather, ()


@contextmanager
def _folder(out: Path | None) -> Iterator[Path]:
    """Where EnergyPlus writes: kept in ``out/simulation``, else temporary."""
    if out is not None:
        yield out / "simulation"
    else:
        with tempfile.TemporaryDirectory() as folder:
            yield Path(folder)
