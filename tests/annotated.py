"""Annotated facades of real buildings, and runs moved into their frame by the cameras' places."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from si3fp.evaluate import facades_from_hbjson
from si3fp.geometry.rigid import Rigid3
from si3fp.geometry.similarity import fit_similarity
from si3fp.model import Facade, Window

DATA = Path(__file__).parent / "data"


def annotation(name: str) -> dict[str, Any]:
    """The content of a file of `tests/data`."""
    content: dict[str, Any] = json.loads((DATA / name).read_text())
    return content


def annotated_facades(content: Mapping[str, Any]) -> list[Facade]:
    """The facades that can be scored, with their true windows."""
    return [
        Facade(
            name,
            Rigid3(
                np.array(facade["world_from_facade"]["rotation"]),
                np.array(facade["world_from_facade"]["translation"]),
            ),
            facade["width_m"],
            facade["height_m"],
            tuple(
                Window(w["x_m"], w["y_m"], w["width_m"], w["height_m"], w["label"])
                for w in facade["windows"]
            ),
        )
        for name, facade in content["facades"].items()
        if facade.get("scored", True)
    ]


@dataclass(frozen=True)
class Alignment:
    """How a run's cameras lie against their true places.

    Attributes
    ----------
    truth_from_run
        Turn and shift.
    scale
        True metres per metre of the run.
    rms_m
        Distance of the centres after turn and shift alone.
    """

    truth_from_run: Rigid3
    scale: float
    rms_m: float


def align(run: Path, true_centres: Mapping[str, ArrayLike]) -> Alignment:
    """The run in the truth's frame, by the centres of all photos that it placed."""
    placed = {
        row["id"]: row["position_in_world"]
        for row in json.loads((run / "run.json").read_text())["photos"]
        if "position_in_world" in row
    }
    here = np.array(list(placed.values()))
    there = np.array([true_centres[name] for name in placed])
    fit = fit_similarity(here, there).b_from_a
    shift = there.mean(axis=0) - fit.rotation @ here.mean(axis=0)
    truth_from_run = Rigid3(fit.rotation, shift)
    gaps = truth_from_run.apply(here) - there
    return Alignment(truth_from_run, fit.scale, float(np.sqrt((gaps**2).sum(axis=1).mean())))


def facades_in_truth(run: Path, alignment: Alignment) -> list[Facade]:
    """The facades of the run's model in the truth's frame."""
    _, facades = facades_from_hbjson(json.loads((run / "model.hbjson").read_text()))
    return [
        replace(facade, world_from_facade=alignment.truth_from_run @ facade.world_from_facade)
        for facade in facades
    ]
