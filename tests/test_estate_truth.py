"""The truth of an estate: exact through the evaluation, and identical for spec and seed."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.estate.capture.cameras import LensCamera, Pose
from benchmarks.estate.capture.truth import (
    facade_grid,
    facades_of,
    facades_record,
    seen_on,
    truth_model,
)
from benchmarks.estate.plan import (
    Balcony,
    Building,
    Estate,
    Finish,
    Opening,
    Roof,
    Wall,
    WindowStyle,
)
from benchmarks.estate.specs import SPECS, estate_of

from si3fp.evaluate import evaluate, read_facades
from si3fp.geometry.enu import GeoOrigin
from si3fp.geometry.pinhole import Pinhole
from si3fp.model import Facade

FRONT = 6  # windows of the front, 4 of them on two storeys, one across a slab, one balcony door
BACK = 2


def opening(x_m: float, y_m: float, width_m: float = 1.4, height_m: float = 1.3, kind="window"):
    return Opening(kind, x_m, y_m, width_m, height_m, 0.12, WindowStyle())


def a_building(name: str = "house") -> Building:
    """12 x 8 x 6 m, two storeys: six openings and a door in front, two at the back, none else."""
    finish = Finish("brick", (0.6, 0.3, 0.2))
    corners = [(0.0, 0.0), (12.0, 0.0), (12.0, 8.0), (0.0, 8.0)]
    front = (
        opening(0.01, 0.9),
        opening(3.0, 0.9),
        opening(0.5, 3.9),
        opening(3.0, 3.9),
        opening(6.0, 1.75, 0.9, 1.3),  # ends 5 cm above the slab at 3 m
        replace(opening(8.0, 3.05, 0.9, 2.1, "balcony_door"), depth_m=1.2),
        opening(10.0, 0.0, 1.0, 2.1, "door"),
    )
    back = (opening(4.0, 0.9), opening(4.0, 3.9))
    walls = tuple(
        Wall(f"{name}-{i}", corners[i], corners[(i + 1) % 4], 6.0, finish, openings)
        for i, openings in enumerate([front, (), back, ()])
    )
    balcony = Balcony("loggia", 7.5, 3.0, 3.0, 1.2)
    walls = (replace(walls[0], balconies=(balcony,)), *walls[1:])
    return Building(name, walls, 6.0, 2, 3.0, 1968)


def an_estate(*buildings: Building) -> Estate:
    return Estate("test", 3, GeoOrigin(57.7, 11.97, 14.0), buildings or (a_building(),))


def evaluated(found: dict, true: dict):
    known, reference = read_facades(found), read_facades(true)
    return evaluate(
        known.facades,
        reference.facades,
        known.origin,
        reference.origin,
        buildings=reference.buildings,
        balcony_facades=reference.balcony_facades,
    )


def test_the_model_gives_back_every_facade_and_window_exactly() -> None:
    read = read_facades(truth_model(an_estate()))
    assert {f.id for f in read.facades} == {f"house-{i}" for i in range(4)}
    assert read.balcony_facades == {"house-0"}
    assert set(read.buildings.values()) == {"house"}
    for facade in read.facades:
        true = facades_of(a_building())[int(facade.id[-1])]
        assert (facade.width_m, facade.height_m) == pytest.approx((true.width_m, 6.0), abs=1e-6)
        shift = facade.world_from_facade.translation - true.world_from_facade.translation
        assert np.abs(shift).max() < 1e-6
        assert box_rows(facade) == pytest.approx(box_rows(true), abs=2e-6)
    assert len(read.facades[0].windows) == FRONT


def box_rows(facade: Facade) -> np.ndarray:
    rows = [[w.x_m, w.y_m, w.width_m, w.height_m] for w in facade.windows]
    return np.array(sorted(rows)).reshape(-1, 4)


def test_the_truth_against_itself_is_perfect() -> None:
    model = truth_model(an_estate())
    result = evaluated(model, model)
    assert result.windows.f1 == result.windows_total.f1 == 1.0
    assert result.windows.true_positives == FRONT + BACK
    assert result.windows.mean_iou == pytest.approx(1.0, abs=1e-9)
    assert result.windows.mean_abs_position_error_m == pytest.approx(0.0, abs=1e-9)
    assert result.wwr.mean_absolute == pytest.approx(0.0, abs=1e-12)
    assert result.opening_iou == pytest.approx(1.0, abs=1e-9)
    assert result.without_balconies.windows.true_positives == BACK
    assert (result.missing_count, result.unmatched) == (0, ())
    (building,) = result.buildings
    assert (building.height_m, building.longest_side_m) == pytest.approx((6.0, 12.0))


def test_a_shift_along_the_walls_is_the_position_error() -> None:
    true = truth_model(an_estate())
    found = copy.deepcopy(true)
    walls = {f.id: f.world_from_facade.rotation[:, 0] for f in facades_of(a_building())}
    for room in found["rooms"]:
        for aperture in (a for face in room["faces"] for a in face.get("apertures", [])):
            along = walls[aperture["user_data"]["facade_id"]]
            corners = np.array(aperture["geometry"]["boundary"]) + 0.10 * along
            aperture["geometry"]["boundary"] = corners.tolist()
    result = evaluated(found, true)
    assert result.windows.f1 == 1.0
    assert result.windows.mean_abs_position_error_m == pytest.approx(0.10, abs=1e-6)
    assert result.windows.mean_abs_relative_area_error == pytest.approx(0.0, abs=1e-6)


def test_a_facade_removed_counts_in_total_and_imputed() -> None:
    """By hand: front 10.34 of 72 m2, back 3.64 of 72 m2 (removed), two gables without windows."""
    true = truth_model(an_estate())
    found = copy.deepcopy(true)
    for room in found["rooms"]:
        room["faces"] = [
            face for face in room["faces"] if face["user_data"].get("facade_id") != "house-2"
        ]
    result = evaluated(found, true)
    assert result.missing_count == 1
    assert result.windows.recall == 1.0
    assert result.windows_total.recall == pytest.approx(6 / 8)
    assert result.wwr.mean_absolute == pytest.approx(0.0, abs=1e-9)
    assert result.wwr_total.mean_absolute == pytest.approx(3.64 / 72 / 4)
    assert result.wwr_imputed.mean_absolute == pytest.approx((3.64 / 72 - 10.34 / 72 / 3) / 4)


def test_windows_outside_balconies_and_doors_are_recorded() -> None:
    record = facades_record(an_estate())
    front = record["facades"]["house-0"]
    assert [o["kind"] for o in front["openings"]].count("door") == 1
    assert front["openings"][5]["depth_m"] == 1.2
    assert (front["balcony"], record["facades"]["house-2"]["balcony"]) == (True, False)
    assert front["wwr"] == pytest.approx(10.34 / 72, abs=1e-6)
    assert record["buildings"]["house"]["longest_side_m"] == 12.0


def test_neighbours_that_touch_make_party_walls_that_are_no_facades() -> None:
    house = a_building()
    moved = replace(
        a_building("next"),
        walls=tuple(
            replace(w, start=(w.start[0] + 12.0, w.start[1]), end=(w.end[0] + 12.0, w.end[1]))
            for w in a_building("next").walls
        ),
    )
    estate = replace(an_estate(house), neighbours=(moved,))
    assert {f.id for f in read_facades(truth_model(estate)).facades} == {
        "house-0",
        "house-2",
        "house-3",
    }


def test_a_mask_of_what_is_seen_knows_picture_side_and_occluders() -> None:
    front, gable = facades_of(a_building())[:2]
    pinhole = Pinhole(400.0, 400.0, 320.0, 240.0, 640, 480)
    camera = LensCamera(Pose((6.0, -6.0, 3.0), 0.0, 0.0, 0.0).world_from_cam, pinhole)

    def visible(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
        assert np.allclose(starts, [6.0, -6.0, 3.0])
        return ends[:, 2] > 2.0  # a wall hides what lies below

    grid = facade_grid(front, 0.1)
    seen = seen_on(grid, camera, visible)
    assert seen.shape == (60, 120)
    columns, rows = seen.any(axis=0), seen.any(axis=1)
    # Half the picture is 320 / 400 * 5.95 m = 4.76 m of wall to either side of 6 m.
    assert np.flatnonzero(columns)[[0, -1]] == pytest.approx([12, 107], abs=1)
    assert np.flatnonzero(rows)[[0, -1]].tolist() == [0, 39]
    assert not seen_on(facade_grid(gable, 0.1), camera, visible).any()


@pytest.mark.parametrize("spec", SPECS)
def test_every_spec_goes_through_the_model_without_loss(spec: str) -> None:
    estate = estate_of(spec, 1)
    read = read_facades(truth_model(estate))
    true = {facade.id: facade for b in estate.buildings for facade in facades_of(b)}
    assert {facade.id for facade in read.facades} == set(true)
    for facade in read.facades:
        boxes = box_rows(true[facade.id])
        assert len(facade.windows) == len(boxes)
        gaps = np.abs(box_rows(facade)[:, None] - boxes[None]).max(axis=2)
        assert (gaps < 2e-6).sum() == len(boxes)  # each box once


def test_a_window_above_the_eaves_raises_its_facade() -> None:
    house = a_building()
    gable = replace(
        house.walls[1],
        height_m=9.0,
        outline=((0.0, 0.0), (8.0, 0.0), (8.0, 6.0), (4.0, 9.0), (0.0, 6.0)),
        openings=(opening(3.5, 6.4, 0.9, 0.9),),
    )
    house = replace(house, walls=(house.walls[0], gable, *house.walls[2:]), roof=Roof("gable", 3.0))
    read = {f.id: f for f in read_facades(truth_model(an_estate(house))).facades}
    assert read["house-1"].height_m == pytest.approx(9.0)
    assert read["house-3"].height_m == pytest.approx(6.0)
    assert box_rows(read["house-1"]) == pytest.approx(np.array([[3.5, 6.4, 0.9, 0.9]]), abs=2e-6)
