"""Which facades a run from the street did not find, and where its cameras stood, as a map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.tables.cases import Case
from matplotlib.figure import Figure

from si3fp.workspace import read_json

Json = Mapping[str, Any]
FOUND, MISSING, CAMERA = "#28a050", "#eb3232", "#303030"
ASIDE_M = 4.0
"""Labels lie so far outside of their facades."""


def write_plan(case: Case, folder: Path) -> Path | None:
    """The PNG of the case's map in ``folder``; None where no facade is missing."""
    file = folder / f"{case.building.replace(':', '-')}-seed{case.seed}-{case.run_name}-plan.png"
    file.unlink(missing_ok=True)
    if case.evaluation is None or all(f["found_id"] for f in case.evaluation["facades"]):
        return None
    truth = read_json(case.set_folder / "truth" / "facades.json")["facades"]
    poses = read_json(case.set_folder / "truth" / "poses.json")["poses"]
    used = read_json(case.set_folder / "panoramas.geojson")["features"]
    places = [poses[feature["properties"]["id"]]["place_in_world_m"] for feature in used]
    folder.mkdir(parents=True, exist_ok=True)
    plan(case.evaluation["facades"], truth, places, case.label).savefig(file, dpi=110)
    return file


def plan(
    facades: Sequence[Json],
    truth: Mapping[str, Json],
    places_m: Sequence[Sequence[float]],
    label: str,
) -> Figure:
    """The facades from above, found ones green, missing ones red, and the cameras as dots.

    Parameters
    ----------
    facades
        ``facades`` of ``evaluation.json``.
    truth
        ``facades`` of the set's truth, by id: ``world_from_facade`` and ``width_m``.
    places_m
        Cameras: east, north, up.
    label
        Said in the title.
    """
    figure = Figure(figsize=(6.5, 5.0), layout="constrained")
    axes = figure.add_subplot(aspect="equal")
    cameras = np.array(places_m)
    axes.plot(*cameras[:, :2].T, "o", color=CAMERA, ms=4, label="panorama")
    for facade in facades:
        wall = truth[facade["facade_id"]]
        along, _, outside = np.array(wall["world_from_facade"]["rotation"]).T
        start = np.array(wall["world_from_facade"]["translation"])
        end = start + along * wall["width_m"]
        found = facade["found_id"] is not None
        axes.plot(*np.array([start, end])[:, :2].T, color=FOUND if found else MISSING, lw=3)
        scores = facade["windows"]
        count = scores["true_positives"] + scores["false_negatives"]
        state = f"{scores['true_positives']} of {count}" if found else f"{count} unseen"
        x_m, y_m, _ = (start + end) / 2 + ASIDE_M * outside
        text = f"{facade['facade_id']}\n{state}"
        sideways = "left" if outside[0] > 0.5 else "right" if outside[0] < -0.5 else "center"
        axes.text(x_m, y_m, text, fontsize=8, ha=sideways, va="center")
    axes.set(xlabel="east (m)", ylabel="north (m)")
    axes.set_title(f"{label}: windows found, by facade", fontsize=10)
    axes.set(xlim=np.add(axes.get_xlim(), (-10.0, 15.0)))
    return figure
