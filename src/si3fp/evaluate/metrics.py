"""The paper's metrics: found facades and windows against true ones.

Windows are compared in the plane of the true facade: the corners of a found window go to the world
and from there onto that plane, whatever frame or origin they came from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from si3fp.evaluate.results import (
    Evaluation,
    FacadeEvaluation,
    WindowMatch,
    WindowScores,
    WwrErrors,
)
from si3fp.geometry.enu import GeoOrigin, geodetic_from_world, world_from_geodetic
from si3fp.geometry.rigid import FloatArray, Rigid3
from si3fp.model import Facade, Window

MIN_IOU = 0.5  # paper: a found window is a true positive above this overlap
MAX_ANGLE_DEG = 15.0  # decision: facades without a common id match within this angle,
MAX_PLANE_DISTANCE_M = 1.0  # this distance of the planes,
MIN_OVERLAP = 0.1  # and this share of the smaller facade's area


def evaluate(
    found: Sequence[Facade],
    truth: Sequence[Facade],
    found_origin: GeoOrigin | None = None,
    truth_origin: GeoOrigin | None = None,
) -> Evaluation:
    """The paper's metrics of found facades against true ones.

    Facades are paired by id, the rest by geometry (normals within 15 degrees, planes within 1 m,
    largest overlap first); windows one to one, best IoU first, above 0.5.

    Parameters
    ----------
    found, truth
        Facades in their worlds.
    found_origin, truth_origin
        Origins of the two worlds; where either is None, both are taken to be the same world.
    """
    if found_origin is not None and truth_origin is not None:
        shift = _truth_from_found(found_origin, truth_origin)
        found = [
            replace(facade, world_from_facade=shift @ facade.world_from_facade) for facade in found
        ]
    pairs = _paired_facades(found, truth)
    facades = tuple(_evaluate_facade(facade, pairs.get(facade.id)) for facade in truth)
    seen = [facade for facade in facades if facade.found_id is not None]
    ratios = [facade.wwr_found for facade in seen if facade.wwr_found is not None]
    imputed = float(np.mean(ratios)) if ratios else 0.0
    taken = {facade.found_id for facade in seen}
    return Evaluation(
        facades,
        tuple(facade.id for facade in found if facade.id not in taken),
        _summed(seen),
        _summed(facades),
        _wwr_errors(seen, 0.0),
        _wwr_errors(facades, 0.0),
        _wwr_errors(facades, imputed),
    )


def _truth_from_found(found_origin: GeoOrigin, truth_origin: GeoOrigin) -> Rigid3:
    """The move between two east-north-up worlds, their slight turn included."""
    reach_m = 1000.0
    points = np.concatenate([np.zeros((1, 3)), reach_m * np.eye(3)])
    moved = world_from_geodetic(geodetic_from_world(points, found_origin), truth_origin)
    left, _, right = np.linalg.svd(((moved[1:] - moved[0]) / reach_m).T)
    return Rigid3(left @ right, moved[0])


def _paired_facades(found: Sequence[Facade], truth: Sequence[Facade]) -> dict[str, Facade]:
    """The found facade of each true facade's id."""
    by_id = {facade.id: facade for facade in found}
    pairs = {facade.id: by_id[facade.id] for facade in truth if facade.id in by_id}
    candidates = []
    for true in truth:
        for candidate in found:
            if true.id not in pairs and candidate.id not in pairs:
                overlap = _overlap(candidate, true)
                if overlap > MIN_OVERLAP:
                    candidates.append((-overlap, true.id, candidate.id))
    used: set[str] = set()
    for _, true_id, candidate_id in sorted(candidates):
        if true_id not in pairs and candidate_id not in used:
            pairs[true_id] = by_id[candidate_id]
            used.add(candidate_id)
    return pairs


def _overlap(found: Facade, truth: Facade) -> float:
    """Shared area over the smaller facade's; 0 where the planes differ."""
    truth_from_found = truth.world_from_facade.inverse() @ found.world_from_facade
    cosine = truth_from_found.rotation[2, 2]
    distance_m = abs(truth_from_found.apply([found.width_m / 2, found.height_m / 2, 0.0])[2])
    if cosine < np.cos(np.deg2rad(MAX_ANGLE_DEG)) or distance_m > MAX_PLANE_DISTANCE_M:
        return 0.0
    box = _box_in(truth_from_found, 0.0, 0.0, found.width_m, found.height_m)
    whole = np.array([0.0, 0.0, truth.width_m, truth.height_m])
    shared = np.clip(np.minimum(box[2:], whole[2:]) - np.maximum(box[:2], whole[:2]), 0, None)
    smaller = min(found.width_m * found.height_m, truth.width_m * truth.height_m)
    return float(shared.prod() / smaller)


def _box_in(
    b_from_a: Rigid3, x_m: float, y_m: float, width_m: float, height_m: float
) -> FloatArray:
    """x0, y0, x1, y1 in plane b of a rectangle in plane a."""
    corners = [
        [x_m + across * width_m, y_m + up * height_m, 0.0] for across in (0, 1) for up in (0, 1)
    ]
    moved = b_from_a.apply(corners)[:, :2]
    return np.concatenate([moved.min(axis=0), moved.max(axis=0)])


def _evaluate_facade(truth: Facade, found: Facade | None) -> FacadeEvaluation:
    matches = () if found is None else _matched_windows(found, truth)
    return FacadeEvaluation(
        truth.id,
        None if found is None else found.id,
        truth.width_m * truth.height_m,
        _scores(matches, 0 if found is None else len(found.windows), len(truth.windows)),
        matches,
        truth.wwr,
        None if found is None else found.wwr,
        None if found is None else found.wwr - truth.wwr,
    )


def _matched_windows(found: Facade, truth: Facade) -> tuple[WindowMatch, ...]:
    truth_from_found = truth.world_from_facade.inverse() @ found.world_from_facade
    found_boxes = [_box_in(truth_from_found, *_rectangle(window)) for window in found.windows]
    identity = Rigid3(np.eye(3), np.zeros(3))
    true_boxes = [_box_in(identity, *_rectangle(window)) for window in truth.windows]
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


def _rectangle(window: Window) -> tuple[float, float, float, float]:
    return window.x_m, window.y_m, window.width_m, window.height_m


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


def _scores(matches: Sequence[WindowMatch], found_count: int, true_count: int) -> WindowScores:
    hits = len(matches)

    def mean(values: list[float]) -> float | None:
        return float(np.mean(values)) if values else None

    return WindowScores(
        hits,
        found_count - hits,
        true_count - hits,
        hits / found_count if found_count else None,
        hits / true_count if true_count else None,
        2 * hits / (found_count + true_count) if found_count + true_count else None,
        mean([match.iou for match in matches]),
        mean([abs(match.relative_area_error) for match in matches]),
        mean([match.position_error_m for match in matches]),
    )


def _summed(facades: Sequence[FacadeEvaluation]) -> WindowScores:
    """Micro scores: all windows of all facades in one pot."""
    matches = [match for facade in facades for match in facade.matches]
    wrong = sum(facade.windows.false_positives for facade in facades)
    missed = sum(facade.windows.false_negatives for facade in facades)
    return _scores(matches, len(matches) + wrong, len(matches) + missed)


def _wwr_errors(facades: Sequence[FacadeEvaluation], missing_wwr: float) -> WwrErrors:
    if not facades:
        return WwrErrors(None, None, None)
    errors = np.array(
        [
            (missing_wwr if facade.wwr_found is None else facade.wwr_found) - facade.wwr_truth
            for facade in facades
        ]
    )
    areas = np.array([facade.area_m2 for facade in facades])
    return WwrErrors(
        float(errors.mean()), float(np.abs(errors).mean()), float(errors @ areas / areas.sum())
    )
