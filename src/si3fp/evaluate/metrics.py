"""The paper's metrics: found facades and windows against true ones.

Windows are compared in the plane of the true facade: the corners of a found window go to the world
and from there onto that plane, whatever frame or origin they came from.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields, replace

import numpy as np

from si3fp.evaluate.pairing import (
    box_in,
    mean_shift_m,
    paired_facades,
    require_one_place,
    truth_from_found_world,
    why_unpaired,
)
from si3fp.evaluate.results import (
    Box,
    BuildingEvaluation,
    Evaluation,
    FacadeEvaluation,
    Unmatched,
    WindowMatch,
)
from si3fp.evaluate.scores import Totals
from si3fp.evaluate.totals import scores, totals
from si3fp.geometry.enu import GeoOrigin
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Facade, Window

MIN_IOU = 0.5  # paper: a found window is a true positive above this overlap


def evaluate(
    found: Sequence[Facade],
    truth: Sequence[Facade],
    found_origin: GeoOrigin | None = None,
    truth_origin: GeoOrigin | None = None,
    *,
    buildings: Mapping[str, str] | None = None,
    balcony_facades: Collection[str] | None = None,
) -> Evaluation:
    """The paper's metrics of found facades against true ones.

    Facades are paired by id where they lie within 30 degrees and 3 m, the rest by geometry (normals
    within 15 degrees, planes within 1 m, largest overlap first); windows one to one, best IoU
    first, above 0.5.

    Parameters
    ----------
    found, truth
        Facades in their worlds.
    found_origin, truth_origin
        Origins of the two worlds; where either is None, both are taken to be the same world.
    buildings
        The building of each true facade; by default what stands before the last dash of an id
        that ends in a number.
    balcony_facades
        Ids of the true facades with balconies; by default those with a balcony door.

    Raises
    ------
    InputError
        If the two models lie apart.
    """
    if found_origin is not None and truth_origin is not None:
        shift = truth_from_found_world(found_origin, truth_origin)
        found = [
            replace(facade, world_from_facade=shift @ facade.world_from_facade) for facade in found
        ]
    require_one_place(found, truth, found_origin, truth_origin)
    pairs = paired_facades(found, truth)
    owners = buildings or {}
    facades = tuple(
        _evaluate_facade(
            facade,
            pairs.get(facade.id),
            owners.get(facade.id, building_of(facade.id)),
            any(window.label == "balcony_door" for window in facade.windows)
            if balcony_facades is None
            else facade.id in balcony_facades,
        )
        for facade in truth
    )
    whole = totals(facades)
    return Evaluation(
        **{field.name: getattr(whole, field.name) for field in fields(Totals)},
        without_balconies=_without_balconies(facades),
        buildings=_buildings(facades, {facade.id: facade for facade in truth}),
        facades=facades,
        unmatched=_unmatched(found, truth, pairs),
        mean_shift_m=mean_shift_m(
            [(pairs[true.id], true) for true in truth if true.id in pairs],
        ),
    )


def building_of(facade_id: str, otherwise: str = "all") -> str:
    """The building in an id ``<building>-<edge>``; ``otherwise`` where the id has another form.

    Examples
    --------
    >>> building_of("north-1-0"), building_of("wall-3"), building_of("east")
    ('north-1', 'all', 'all')
    """
    named = re.fullmatch(r"(.+)-\d+(#\d+)?", facade_id)
    return named[1] if named and named[1] != "wall" else otherwise


def _without_balconies(facades: Sequence[FacadeEvaluation]) -> Totals:
    return totals([facade for facade in facades if not facade.balconies])


def _buildings(
    facades: Sequence[FacadeEvaluation], truth: Mapping[str, Facade]
) -> tuple[BuildingEvaluation, ...]:
    rows = []
    for name in dict.fromkeys(facade.building_id for facade in facades):
        own = [facade for facade in facades if facade.building_id == name]
        feet_and_tops_m = [
            truth[facade.facade_id].world_from_facade.apply([0.0, y_m, 0.0])[2]
            for facade in own
            for y_m in (0.0, facade.height_m)
        ]
        rows.append(
            BuildingEvaluation(
                name,
                float(max(feet_and_tops_m) - min(feet_and_tops_m)),
                max(facade.width_m for facade in own),
                totals(own),
                _without_balconies(own),
            )
        )
    return tuple(rows)


def _unmatched(
    found: Sequence[Facade], truth: Sequence[Facade], pairs: Mapping[str, Facade]
) -> tuple[Unmatched, ...]:
    true_of = {facade.id: true_id for true_id, facade in pairs.items()}
    found_of = {true_id: facade.id for true_id, facade in pairs.items()}
    missing = [facade for facade in truth if facade.id not in found_of]
    extra = [facade for facade in found if facade.id not in true_of]
    return (
        *(
            Unmatched(f.id, "truth", len(f.windows), why_unpaired(f, found, true_of))
            for f in missing
        ),
        *(
            Unmatched(f.id, "found", len(f.windows), why_unpaired(f, truth, found_of))
            for f in extra
        ),
    )


def _evaluate_facade(
    truth: Facade, found: Facade | None, building_id: str, balconies: bool
) -> FacadeEvaluation:
    area_m2 = truth.width_m * truth.height_m
    identity = Rigid3(np.eye(3), np.zeros(3))
    true_boxes = [box_in(identity, *_rectangle(window)) for window in truth.windows]
    missed = FacadeEvaluation(
        facade_id=truth.id,
        found_id=None,
        building_id=building_id,
        balconies=balconies,
        width_m=truth.width_m,
        height_m=truth.height_m,
        area_m2=area_m2,
        found_area_m2=None,
        relative_area_error=None,
        windows=scores((), 0, len(truth.windows)),
        matches=(),
        wwr_truth=truth.wwr,
        wwr_found=None,
        wwr_error=None,
        wwr_interval=None,
        found_outline_m=None,
        true_boxes_m=tuple(_plain(box) for box in true_boxes),
        found_boxes_m=(),
        found_offsets_m=(),
    )
    if found is None:
        return missed
    truth_from_found = truth.world_from_facade.inverse() @ found.world_from_facade
    found_boxes = [box_in(truth_from_found, *_rectangle(window)) for window in found.windows]
    matches = _matched(found_boxes, true_boxes)
    found_area_m2 = found.width_m * found.height_m
    return replace(
        missed,
        found_id=found.id,
        found_area_m2=found_area_m2,
        relative_area_error=(found_area_m2 - area_m2) / area_m2,
        windows=scores(matches, len(found.windows), len(truth.windows)),
        matches=matches,
        wwr_found=found.wwr,
        wwr_error=found.wwr - truth.wwr,
        wwr_interval=found.wwr_interval,
        found_outline_m=_plain(box_in(truth_from_found, 0.0, 0.0, found.width_m, found.height_m)),
        found_boxes_m=tuple(_plain(box) for box in found_boxes),
        found_offsets_m=tuple(
            float(
                truth_from_found.apply(
                    [window.x_m + window.width_m / 2, window.y_m + window.height_m / 2, 0.0]
                )[2]
            )
            for window in found.windows
        ),
    )


def _rectangle(window: Window) -> tuple[float, float, float, float]:
    return window.x_m, window.y_m, window.width_m, window.height_m


def _plain(box: FloatArray) -> Box:
    left, bottom, right, top = (float(value) for value in box)
    return left, bottom, right, top


def _matched(
    found_boxes: Sequence[FloatArray], true_boxes: Sequence[FloatArray]
) -> tuple[WindowMatch, ...]:
    """One-to-one pairs above the least IoU, the best first; in the order of the true windows."""
    pairs = [
        _compared(i, found_box, j, true_box)
        for i, found_box in enumerate(found_boxes)
        for j, true_box in enumerate(true_boxes)
    ]
    matches: list[WindowMatch] = []
    for pair in sorted(pairs, key=lambda pair: (-pair.iou, pair.truth, pair.found)):
        free = all(pair.found != m.found and pair.truth != m.truth for m in matches)
        if pair.iou > MIN_IOU and free:
            matches.append(pair)
    return tuple(sorted(matches, key=lambda match: match.truth))


def _compared(i: int, found: FloatArray, j: int, truth: FloatArray) -> WindowMatch:
    shared = np.clip(np.minimum(found[2:], truth[2:]) - np.maximum(found[:2], truth[:2]), 0, None)
    found_area, true_area = (found[2:] - found[:2]).prod(), (truth[2:] - truth[:2]).prod()
    offset = (found[:2] + found[2:] - truth[:2] - truth[2:]) / 2
    return WindowMatch(
        i,
        j,
        float(shared.prod() / (found_area + true_area - shared.prod())),
        float((found_area - true_area) / true_area),
        float(np.hypot(*offset)),
    )
