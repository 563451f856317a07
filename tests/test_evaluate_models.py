"""Facades of honeybee models that other tools write: what is joined, left out and said."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from si3fp.errors import InputError
from si3fp.evaluate import evaluate, read_facades

Json = dict[str, Any]


def rectangle(x0: float, x1: float, z0: float, z1: float) -> Json:
    boundary = [[x0, 0.0, z0], [x1, 0.0, z0], [x1, 0.0, z1], [x0, 0.0, z1]]
    return {"type": "Face3D", "boundary": boundary}


def aperture(x0: float, x1: float, z0: float, z1: float, **data: object) -> Json:
    return {"type": "Aperture", "geometry": rectangle(x0, x1, z0, z1), "user_data": data}


def wall(name: str, *apertures: Json, **more: object) -> Json:
    return {
        "type": "Face",
        "identifier": name,
        "face_type": "Wall",
        "boundary_condition": {"type": "Outdoors"},
        "geometry": rectangle(0, 10, 0, 5),
        "apertures": list(apertures),
        **more,
    }


def model(*faces: Json, **more: object) -> Json:
    return {"type": "Model", "identifier": "house", "orphaned_faces": list(faces), **more}


def sizes(content: Json, join_touching: bool) -> list[tuple[float, float]]:
    (facade,) = read_facades(content, join_touching=join_touching).facades
    return sorted((round(w.width_m, 3), round(w.height_m, 3)) for w in facade.windows)


PANES = (
    aperture(1, 1.5, 1, 2),
    aperture(1.53, 2.0, 1, 2),
    aperture(1, 2, 2.04, 2.4),  # a fanlight above both
    aperture(2.3, 2.8, 1, 2),  # 0.3 m aside
    aperture(2.0, 2.3, 0.1, 0.96),  # touches a corner only
)


def test_touching_parts_are_one_window_on_request() -> None:
    content = model(wall("w", *PANES))
    assert len(sizes(content, join_touching=False)) == 5
    assert sizes(content, join_touching=True) == [(0.3, 0.86), (0.5, 1.0), (1.0, 1.4)]
    notes = read_facades(content, join_touching=True).notes
    assert notes == ("openings that touch others, joined into windows: 3",)


def test_a_stated_window_is_not_joined_by_touch() -> None:
    named = [{**pane, "user_data": {"window_id": str(i)}} for i, pane in enumerate(PANES[:2])]
    assert len(sizes(model(wall("w", *named)), join_touching=True)) == 2
    same = [{**pane, "user_data": {"window_id": "w"}} for pane in PANES[:2]]
    assert sizes(model(wall("w", *same)), join_touching=False) == [(1.0, 1.0)]


def test_apertures_without_names_stay_apart() -> None:
    first, second = aperture(1, 2, 1, 2), aperture(5, 6, 1, 2)
    assert sizes(model(wall("w", first, second)), join_touching=False) == [(1.0, 1.0)] * 2


def test_what_is_no_facade_is_left_out_and_said() -> None:
    roof = {**wall("r", aperture(1, 2, 1, 2)), "face_type": "RoofCeiling"}
    party = wall("p", boundary_condition={"type": "Adiabatic"})
    leaning = wall("l", geometry={"boundary": [[0, 0, 0], [10, 0, 0], [10, 9, 3], [0, 9, 3]]})
    content = model(wall("w"), roof, party, leaning, orphaned_apertures=[aperture(1, 2, 1, 2)])
    known = read_facades(content)
    assert [facade.id for facade in known.facades] == ["w"]
    assert set(known.notes) == {
        "apertures without a wall, left out: 1",
        "apertures in roofs and floors, left out: 1",
        "walls against the ground or without heat flow, left out: 1",
        "walls that lean more than 45 degrees, left out: 1",
    }


def test_what_becomes_a_rectangle_is_said() -> None:
    gable = {"boundary": [[0, 0, 0], [10, 0, 0], [10, 0, 5], [5, 0, 9], [0, 0, 5]]}
    arch = {"geometry": {"boundary": [[1, 0, 1], [2, 0, 1], [2, 0, 2], [1.5, 0, 2.5], [1, 0, 2]]}}
    known = read_facades(model(wall("w", arch, geometry=gable)))
    assert known.facades[0].height_m == pytest.approx(9.0)
    assert len(known.notes) == 2
    assert read_facades(model(wall("w", aperture(1, 2, 1, 2)))).notes == ()


def test_balconies_are_stated_or_seen_by_their_doors() -> None:
    door = aperture(1, 2, 0.1, 2, label="balcony_door")
    content = model(
        wall("a", door, user_data={"facade_id": "a-0"}),
        wall("b", user_data={"facade_id": "a-1", "balconies": True}),
        wall("c", door, user_data={"facade_id": "a-2", "balcony": False}),
        wall("d", user_data={"facade_id": "a-3"}),
    )
    assert read_facades(content).balcony_facades == {"a-0", "a-1"}


def test_buildings_come_from_rooms_ids_or_the_model() -> None:
    rooms = [{"faces": [wall("s0")], "user_data": {"building_id": "tower"}}]
    far = {"geometry": {"boundary": [[0, 9, 0], [10, 9, 0], [10, 9, 5], [0, 9, 5]]}}
    content = model(wall("a", user_data={"facade_id": "slab-2"}), wall("x", **far), rooms=rooms)
    assert read_facades(content).buildings == {"s0": "tower", "slab-2": "slab", "x": "house"}


def test_intervals_and_missing_walls() -> None:
    content = model(
        wall("a", user_data={"facade_id": "a-0", "wwr_interval": [0.1, 0.2]}),
        wall("b", user_data={"facade_id": "a-1", "si3fp": {"missing": "coverage: a tree"}}),
    )
    known = read_facades(content)
    assert known.facades[0].wwr_interval == (0.1, 0.2)
    assert known.missing == {"a-1": "coverage: a tree"}
    with pytest.raises(InputError, match="wwr_interval of the wall a needs two numbers"):
        read_facades(model(wall("a", user_data={"wwr_interval": "wide"})))


SAMPLES = {
    "model_5vertex_sub_faces": 1,
    "model_complete_office_floor": 0,
    "model_complete_single_zone_office": 2,
    "model_energy_shoe_box": 2,
}


@pytest.mark.slow
@pytest.mark.skipif("SI3FP_TEST_DATA" not in os.environ, reason="needs SI3FP_TEST_DATA")
@pytest.mark.parametrize(("name", "windows"), SAMPLES.items())
def test_models_of_other_tools_against_themselves(name: str, windows: int) -> None:
    file = Path(os.environ["SI3FP_TEST_DATA"]) / "thermal" / "hbjson" / f"{name}.hbjson"
    known = read_facades(json.loads(file.read_text()))
    result = evaluate(known.facades, known.facades, buildings=known.buildings)
    assert result.missing_count == 0
    assert result.windows_total.true_positives == windows
    assert result.windows_total.f1 == (1.0 if windows else None)
    assert result.opening_iou_total == (pytest.approx(1.0) if windows else None)
    assert result.wwr_total.mean_absolute == 0.0
    assert result.mean_shift_m == (0.0, 0.0, 0.0)
