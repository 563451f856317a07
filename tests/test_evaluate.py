"""The paper's metrics on cases that can be counted by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from si3fp.errors import InputError
from si3fp.evaluate import evaluate, facades_from_hbjson
from si3fp.geometry.enu import GeoOrigin, geodetic_from_world, world_from_geodetic
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Facade, Window

# A facade in the plane y = 0 that looks south: x right is east, y up is up.
SOUTH = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def facade(
    name: str, *windows: Window, place: tuple[float, float, float] = (0, 0, 0), height: float = 5.0
) -> Facade:
    return Facade(name, Rigid3(SOUTH, np.array(place, float)), 10.0, height, windows)


def three_windows() -> tuple[Window, ...]:
    return tuple(Window(x, 1.0, 1.0, 2.0) for x in (1.0, 4.0, 7.0))


def test_truth_against_itself_is_perfect() -> None:
    truth = [facade("a-0", *three_windows()), facade("a-1", Window(2, 1, 1, 1), place=(20, 0, 0))]
    result = evaluate(truth, truth)
    assert result.windows.f1 == result.windows.precision == result.windows.recall == 1.0
    assert result.windows.true_positives == 4
    assert result.windows.mean_iou == pytest.approx(1.0)
    assert result.windows.mean_abs_relative_area_error == pytest.approx(0.0)
    assert result.windows.mean_abs_position_error_m == pytest.approx(0.0)
    for errors in (result.wwr, result.wwr_total, result.wwr_imputed):
        assert (errors.mean, errors.mean_absolute, errors.area_weighted) == (0.0, 0.0, 0.0)
    assert result.windows == result.windows_total
    assert result.extra == ()


def test_a_shift_of_ten_centimetres_is_a_position_error_of_ten_centimetres() -> None:
    truth = [facade("a-0", *three_windows())]
    found = [facade("a-0", *three_windows(), place=(0.10, 0, 0))]
    windows = evaluate(found, truth).windows
    assert windows.mean_abs_position_error_m == pytest.approx(0.10)
    assert windows.mean_iou == pytest.approx(0.9 / 1.1)
    assert windows.f1 == 1.0


def test_false_positive_false_negative_and_area_count_as_by_hand() -> None:
    truth = [facade("a-0", *three_windows())]
    found = [
        facade(
            "a-0",
            Window(1.0, 1.0, 1.0, 1.5),  # IoU 0.75, a quarter of the area missing, centre 0.25 low
            Window(4.0, 1.0, 1.0, 2.0),  # exact
            Window(7.5, 1.0, 1.0, 2.0),  # IoU 1/3: neither found nor forgiven
            Window(9.0, 4.0, 0.5, 0.5),  # nothing there
        )
    ]
    result = evaluate(found, truth)
    windows = result.windows
    assert (windows.true_positives, windows.false_positives, windows.false_negatives) == (2, 2, 1)
    assert windows.precision == pytest.approx(2 / 4)
    assert windows.recall == pytest.approx(2 / 3)
    assert windows.f1 == pytest.approx(4 / 7)
    assert windows.mean_iou == pytest.approx((0.75 + 1) / 2)
    assert windows.mean_abs_relative_area_error == pytest.approx(0.125)
    assert windows.mean_abs_position_error_m == pytest.approx(0.125)
    # 1.5 + 2 + 2 + 0.25 = 5.75 m2 found, 6 m2 true, wall 50 m2.
    assert result.facades[0].wwr_found == pytest.approx(0.115)
    assert result.facades[0].wwr_truth == pytest.approx(0.12)
    assert result.wwr.mean == pytest.approx(-0.005)


def test_two_boxes_on_one_window_are_one_hit_and_the_better_one() -> None:
    truth = [facade("a-0", Window(1, 1, 1, 2))]
    found = [facade("a-0", Window(1.2, 1, 1, 2), Window(1.1, 1, 1, 2))]
    result = evaluate(found, truth)
    assert [match.found for match in result.facades[0].matches] == [1]
    assert (result.windows.true_positives, result.windows.false_positives) == (1, 1)


def test_an_iou_of_exactly_one_half_is_not_enough() -> None:
    truth = [facade("a-0", Window(1, 1, 1, 2))]
    found = [facade("a-0", Window(1, 1, 1, 1))]
    assert evaluate(found, truth).windows.true_positives == 0


def test_a_missing_facade_counts_in_the_totals_only() -> None:
    truth = [
        facade("a-0", *three_windows()),  # 50 m2, WWR 0.12
        facade("b-0", Window(1, 1, 4, 5), place=(40, 0, 0), height=10.0),  # 100 m2, WWR 0.20
    ]
    found = [facade("a-0", *three_windows())]
    result = evaluate(found, truth)
    assert result.windows.f1 == 1.0
    assert result.windows_total.recall == pytest.approx(3 / 4)
    assert result.windows_total.f1 == pytest.approx(6 / 7)
    assert result.facades[1].found_id is None
    assert result.facades[1].wwr_error is None
    assert result.wwr.mean == pytest.approx(0.0)
    assert result.wwr_total.mean == pytest.approx(-0.10)
    assert result.wwr_total.mean_absolute == pytest.approx(0.10)
    assert result.wwr_total.area_weighted == pytest.approx(-0.2 * 100 / 150)
    # The missing facade gets 0.12, the mean of those found: error -0.08.
    assert result.wwr_imputed.mean == pytest.approx(-0.04)


def test_errors_of_opposite_sign_cancel_in_the_mean_but_not_in_its_magnitude() -> None:
    truth = [
        facade("a-0", Window(1, 1, 2, 2.5)),
        facade("b-0", Window(1, 1, 2, 2.5), place=(40, 0, 0)),
    ]
    found = [
        facade("a-0", Window(1, 1, 2, 2)),
        facade("b-0", Window(1, 1, 2, 3), place=(40, 0, 0)),
    ]
    wwr = evaluate(found, truth).wwr
    assert wwr.mean == pytest.approx(0.0)
    assert wwr.mean_absolute == pytest.approx(0.02)


def test_zero_denominators_are_none_not_zero() -> None:
    blind = [facade("a-0")]
    result = evaluate(blind, blind)
    assert result.windows.precision is None
    assert result.windows.recall is None
    assert result.windows.f1 is None
    assert result.windows.mean_iou is None
    assert result.wwr.mean == 0.0
    nothing = evaluate([], [])
    assert nothing.windows.f1 is None
    assert nothing.wwr.mean is None
    assert evaluate([], blind).wwr_imputed.mean is None


def test_a_facade_without_windows_turns_found_ones_into_false_positives() -> None:
    result = evaluate([facade("a-0", *three_windows())], [facade("a-0")])
    assert result.windows.precision == 0.0
    assert result.windows.recall is None
    assert result.windows.f1 == 0.0


def test_facades_without_common_id_are_paired_by_geometry() -> None:
    truth = [facade("a-0", *three_windows()), facade("a-1", Window(2, 1, 1, 1), place=(30, 0, 0))]
    tilted = Rigid3(
        np.array([[np.cos(0.1), -np.sin(0.1), 0], [np.sin(0.1), np.cos(0.1), 0], [0, 0, 1]])
        @ SOUTH,
        np.array([0.0, -0.3, 0.0]),
    )
    found = [
        facade("wall-3", Window(2, 1, 1, 1), place=(30, 0.5, 0)),
        replace(facade("wall-1", *three_windows()), world_from_facade=tilted),
        facade("wall-0", *three_windows(), place=(0, 4.0, 0)),  # 4 m in front: another wall
        replace(  # looks the other way
            facade("wall-2", *three_windows()),
            world_from_facade=Rigid3(SOUTH @ np.diag([-1.0, 1, -1]), np.array([10.0, 0, 0])),
        ),
    ]
    result = evaluate(found, truth)
    assert [row.found_id for row in result.facades] == ["wall-1", "wall-3"]
    assert result.extra == ("wall-0", "wall-2")
    assert result.windows.f1 == 1.0


@settings(deadline=None)  # the machine may be busy
@given(north_m=st.floats(-3000, 3000), east_m=st.floats(-3000, 3000), height_m=st.floats(-200, 200))
def test_origins_may_differ(north_m: float, east_m: float, height_m: float) -> None:
    here = GeoOrigin(57.7, 11.97, 20.0)
    there = GeoOrigin(*geodetic_from_world([east_m, north_m, height_m], here))
    truth = facade("a-0", *three_windows())
    corners = truth.world_from_facade.apply(np.concatenate([np.zeros((1, 3)), np.eye(3)]))
    moved = world_from_geodetic(geodetic_from_world(corners, here), there)
    axes, _ = np.linalg.qr((moved[1:] - moved[0]).T)
    axes *= np.sign(np.sum(axes * (moved[1:] - moved[0]).T, axis=0))
    found = replace(truth, world_from_facade=Rigid3(axes, moved[0]))
    windows = evaluate([found], [truth], there, here).windows
    assert windows.true_positives == 3
    assert windows.mean_abs_position_error_m == pytest.approx(0.0, abs=1e-5)


def rectangle(
    x0: float, x1: float, z0: float, z1: float, y: float = 0.0
) -> dict[str, str | list[list[float]]]:
    return {
        "type": "Face3D",
        "boundary": [[x0, y, z0], [x1, y, z0], [x1, y, z1], [x0, y, z1]],
    }


def wall_face(
    name: str, z0: float, z1: float, facade_id: str | None = "a-0", **more: object
) -> dict[str, object]:
    return {
        "type": "Face",
        "identifier": name,
        "face_type": "Wall",
        "boundary_condition": {"type": "Outdoors"},
        "geometry": rectangle(2, 12, z0, z1),
        "user_data": {} if facade_id is None else {"facade_id": facade_id},
        **more,
    }


def aperture(
    name: str, box: tuple[float, float, float, float], window_id: str | None = None
) -> dict[str, object]:
    data = {} if window_id is None else {"window_id": window_id}
    return {"type": "Aperture", "identifier": name, "geometry": rectangle(*box), "user_data": data}


def storeys(facade_id: str | None) -> dict[str, object]:
    """Two rooms above one another; a window is split at the slab."""
    ground = wall_face("s0-w", 1, 4, facade_id, apertures=[aperture("p0", (3, 4, 3, 3.98), "w")])
    upper = wall_face(
        "s1-w",
        4,
        7,
        facade_id,
        apertures=[aperture("p1", (3, 4, 4.02, 5), "w"), aperture("q", (6, 8, 5, 6))],
        doors=[
            {
                "type": "Door",
                "identifier": "d",
                "is_glass": True,
                "geometry": rectangle(9, 10, 4.1, 6.1),
            },
            {"type": "Door", "identifier": "e", "geometry": rectangle(10.5, 11.5, 4.1, 6.1)},
        ],
    )
    inner = wall_face("inner", 1, 4, facade_id, boundary_condition={"type": "Surface"})
    floor = {**wall_face("floor", 1, 4), "face_type": "Floor"}
    return {
        "type": "Model",
        "units": "Meters",
        "rooms": [{"faces": [ground, inner, floor]}, {"faces": [upper]}],
    }


@pytest.mark.parametrize("facade_id", ["a-0", None])
def test_walls_of_all_storeys_become_one_facade(facade_id: str | None) -> None:
    origin, facades = facades_from_hbjson(storeys(facade_id))
    assert origin is None
    (wall,) = facades
    assert wall.id == (facade_id or "s0-w")
    assert (wall.width_m, wall.height_m) == pytest.approx((10, 6))
    assert wall.world_from_facade.apply([0, 0, 0]) == pytest.approx([2, 0, 1])
    assert wall.world_from_facade.rotation == pytest.approx(SOUTH)
    boxes = sorted((w.x_m, w.y_m, w.width_m, w.height_m, w.label) for w in wall.windows)
    assert [box[:4] for box in boxes] == [
        pytest.approx((1, 2, 1, 2)),  # joined over the slab
        pytest.approx((4, 4, 2, 1)),
        pytest.approx((7, 3.1, 1, 2)),
    ]
    assert [box[4] for box in boxes] == ["window", "window", "balcony_door"]


def test_walls_apart_stay_apart() -> None:
    far = wall_face("far", 1, 4, None, geometry=rectangle(30, 40, 1, 4))
    behind = wall_face("behind", 1, 4, "a-0", geometry=rectangle(2, 12, 1, 4, y=3.0))
    model = {
        "type": "Model",
        "orphaned_faces": [wall_face("near", 1, 4, None), far, wall_face("front", 1, 4), behind],
    }
    _, facades = facades_from_hbjson(model)
    assert sorted(facade.id for facade in facades) == ["a-0", "a-0#2", "far", "near"]


def test_units_origin_and_missing_walls_of_a_model() -> None:
    model = storeys("a-0")
    model["units"] = "Centimeters"
    model["orphaned_faces"] = [
        wall_face("unseen", 1, 4, "a-1", user_data={"facade_id": "a-1", "si3fp": {"missing": "x"}})
    ]
    place = {"lat_deg": 57.0, "lon_deg": 12.0, "height_m": 3.0}
    model["user_data"] = {"si3fp": {"origin": place}}
    origin, (wall,) = facades_from_hbjson(model)
    assert origin == GeoOrigin(57.0, 12.0, 3.0)
    assert wall.width_m == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"type": "Room"}, "not a honeybee model"),
        ({"units": "Furlongs"}, "Furlongs"),
        ({"orphaned_faces": [wall_face("w", 1, 4, geometry={})]}, "w in the honeybee model"),
        ({"orphaned_faces": [wall_face("w", 1, 1)]}, "no area"),
        ({"orphaned_faces": [wall_face("w", 1, float("nan"))]}, "not finite"),
        ({"user_data": {"si3fp": {"origin": {"lat_deg": 1}}}}, "height_m"),
    ],
)
def test_unusable_models_are_refused_with_a_reason(change: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        facades_from_hbjson({**storeys("a-0"), **change})


def test_a_model_against_itself_is_perfect() -> None:
    _, facades = facades_from_hbjson(storeys("a-0"))
    result = evaluate(facades, facades)
    assert result.windows.f1 == 1.0
    assert result.wwr.mean_absolute == 0.0


def small_model() -> tuple[list[Facade], list[Facade]]:
    """Found and true: false positives, a facade without windows, a missing one, one with balcony.

    | facade | true | found | WWR true, found |
    | a-0, 50 m2 | 3 windows | 2 right, 2 wrong | 0.12, 0.115 |
    | a-1, 50 m2 | none | 1 wrong | 0, 0.02 |
    | a-2, 100 m2 | 1 window | missing | 0.20 |
    | b-0, 50 m2 | balcony door, window | the door | 0.08, 0.04 |
    """
    door = Window(2, 0, 1, 2, "balcony_door")
    truth = [
        facade("a-0", *three_windows()),
        facade("a-1", place=(20, 0, 0)),
        facade("a-2", Window(1, 1, 4, 5), place=(40, 0, 0), height=10.0),
        facade("b-0", door, Window(5, 1, 2, 1), place=(60, 0, 0)),
    ]
    found = [
        facade(
            "a-0",
            Window(1.0, 1.0, 1.0, 1.5),  # IoU 0.75
            Window(4.0, 1.0, 1.0, 2.0),  # exact
            Window(7.5, 1.0, 1.0, 2.0),  # IoU 1/3, 1 m2 shared
            Window(9.0, 4.0, 0.5, 0.5),  # nothing there
        ),
        facade("a-1", Window(2, 3.5, 1, 1), place=(20, 0, 0)),
        facade("b-0", door, place=(60, 0, 0)),
    ]
    return found, truth


def test_every_window_score_by_hand() -> None:
    result = evaluate(*small_model())
    windows = result.windows
    assert (windows.true_positives, windows.false_positives, windows.false_negatives) == (3, 3, 2)
    assert windows.precision == pytest.approx(3 / 6)
    assert windows.recall == pytest.approx(3 / 5)
    assert windows.f1 == pytest.approx(6 / 11)
    assert windows.mean_iou == pytest.approx((0.75 + 1 + 1) / 3)
    assert windows.mean_abs_relative_area_error == pytest.approx(0.25 / 3)
    assert windows.mean_abs_position_error_m == pytest.approx(0.25 / 3)
    assert result.windows_total.recall == pytest.approx(3 / 6)
    assert result.windows_total.f1 == pytest.approx(6 / 12)
    plain = result.without_balconies
    assert plain.windows.f1 == pytest.approx(4 / 8)
    assert plain.windows_total.f1 == pytest.approx(4 / 9)
    assert plain.windows.mean_iou == pytest.approx(0.875)


def test_every_ratio_error_by_hand() -> None:
    result = evaluate(*small_model())
    assert result.wwr.mean == pytest.approx((-0.005 + 0.02 - 0.04) / 3)
    assert result.wwr.mean_absolute == pytest.approx((0.005 + 0.02 + 0.04) / 3)
    assert result.wwr_total.mean == pytest.approx((-0.005 + 0.02 - 0.04 - 0.20) / 4)
    assert result.wwr_total.mean_absolute == pytest.approx((0.005 + 0.02 + 0.04 + 0.20) / 4)
    # Glass in m2: -0.25 + 1 - 2 - 20 on 250 m2 of wall.
    assert result.wwr_total.area_weighted == pytest.approx(-21.25 / 250)
    imputed = (0.115 + 0.02 + 0.04) / 3
    assert result.wwr_imputed.mean == pytest.approx((-0.025 + imputed - 0.20) / 4)
    assert result.without_balconies.wwr.mean == pytest.approx((-0.005 + 0.02) / 2)
    imputed = (0.115 + 0.02) / 2
    assert result.without_balconies.wwr_imputed.mean == pytest.approx((0.015 + imputed - 0.20) / 3)


def test_the_openings_bodies_by_hand() -> None:
    result = evaluate(*small_model())
    # Shared: 1.5 + 2 + 1 on a-0 and 2 on b-0; united: 7.25, 1 and 4, and 20 on the missing one.
    assert result.opening_iou == pytest.approx(6.5 / 12.25)
    assert result.opening_iou_total == pytest.approx(6.5 / 32.25)
    assert result.without_balconies.opening_iou == pytest.approx(4.5 / 8.25)


def test_openings_off_their_plane_share_less_and_twice_the_same_counts_once() -> None:
    truth = [facade("a-0", Window(1, 1, 1, 2))]
    in_front = [facade("a-0", Window(1, 1, 1, 2), place=(0, -0.25, 0))]
    result = evaluate(in_front, truth)
    assert result.windows.mean_iou == pytest.approx(1.0)
    assert result.facades[0].found_offsets_m == pytest.approx((0.25,))
    assert result.opening_iou == pytest.approx(0.5 / 1.5)  # half of 0.5 m deep
    twice = [facade("a-0", Window(1, 1, 1, 2), Window(1, 1, 1, 2))]
    assert evaluate(twice, truth).opening_iou == pytest.approx(1.0)
    assert evaluate([facade("a-0")], [facade("a-0")]).opening_iou is None


def test_bands_of_height_by_hand() -> None:
    low, high = evaluate(*small_model()).by_height
    assert (low.from_m, low.to_m, high.to_m) == (0.0, 3.0, 6.0)
    assert (low.true, low.found, low.true_total) == (5, 4, 5)
    assert (low.right_true, low.right_found) == (3, 3)
    assert low.precision == pytest.approx(3 / 4)
    assert low.recall == low.recall_total == pytest.approx(3 / 5)
    assert (high.true, high.found, high.true_total) == (0, 2, 1)
    assert high.precision == 0.0
    assert high.recall is None
    assert high.recall_total == 0.0
    assert evaluate([], []).by_height == ()


def test_distributions_by_hand() -> None:
    truth = [
        facade("a-0", *(Window(1 + 2 * i, 1, 1, 1) for i in range(4))),
        facade("a-1", place=(20, 0, 0)),
    ]
    shifts = (0.0, 0.1, 0.2, 0.3)
    found = [
        facade("a-0", *(Window(1 + 2 * i + s, 1, 1, 1) for i, s in enumerate(shifts))),
        replace(facade("a-1", place=(20, 0, 0)), width_m=9.0),
    ]
    result = evaluate(found, truth)
    spread = result.position_errors_m
    assert (spread.count, spread.minimum, spread.maximum) == (4, 0.0, pytest.approx(0.3))
    assert (spread.mean, spread.median) == pytest.approx((0.15, 0.15))
    assert (spread.lower_quartile, spread.upper_quartile) == pytest.approx((0.075, 0.225))
    assert spread.percentile_90 == pytest.approx(0.27)
    assert result.window_area_errors.maximum == pytest.approx(0.0)
    assert result.facade_area_errors.count == 2
    assert result.facade_area_errors.maximum == pytest.approx(0.1)
    assert result.facades[1].relative_area_error == pytest.approx(-0.1)
    assert result.wwr_errors.count == 2
    assert evaluate([], truth).position_errors_m.median is None


def test_buildings_are_counted_as_in_the_paper() -> None:
    result = evaluate(*small_model())
    first, second = result.buildings
    assert (first.id, second.id) == ("a", "b")
    assert (first.all.facade_count, first.all.missing_count) == (3, 1)
    assert (first.height_m, first.longest_side_m) == (10.0, 10.0)
    assert second.all.windows.f1 == pytest.approx(2 / 3)
    assert second.without_balconies.facade_count == 0
    assert second.without_balconies.windows.f1 is None
    assert second.without_balconies.wwr_imputed.mean is None
    assert (result.facade_count, result.missing_count) == (4, 1)


def test_buildings_and_balconies_may_be_given() -> None:
    found, truth = small_model()
    names = {wall.id: "home" for wall in truth}
    result = evaluate(found, truth, buildings=names, balcony_facades=["a-0"])
    assert [building.id for building in result.buildings] == ["home"]
    assert [f.facade_id for f in result.facades if f.balconies] == ["a-0"]


def test_coverage_of_the_stated_intervals() -> None:
    found, truth = small_model()
    intervals = [(0.11, 0.13), (0.01, 0.03), None]
    found = [replace(f, wwr_interval=i) for f, i in zip(found, intervals, strict=True)]
    interval = evaluate(found, truth).interval
    assert (interval.facades, interval.covered) == (2, 1)
    assert interval.share == pytest.approx(0.5)
    assert interval.mean_width == pytest.approx(0.02)
    assert evaluate(truth, truth).interval.share is None


def test_who_has_no_partner_and_why() -> None:
    truth = [
        facade("a-0"),
        facade("a-1", place=(30, 0, 0)),
        facade("a-2", *three_windows(), place=(60, 0, 0)),
        facade("a-3", place=(90, 0, 0)),
    ]
    found = [
        facade("x", place=(0.1, 0, 0)),
        facade("y", place=(0.2, 0, 0)),
        facade("a-1", place=(30, -6, 0)),  # the same id, six metres in front
        replace(
            facade("z"), world_from_facade=Rigid3(SOUTH @ np.diag([-1.0, 1, -1]), [70.0, 0, 0])
        ),
    ]
    result = evaluate(found, truth)
    assert result.facades[0].found_id == "x"
    reasons = {(row.model, row.facade_id): row.reason for row in result.unmatched}
    assert list(reasons) == [("truth", "a-1"), ("truth", "a-2"), ("truth", "a-3"),
                             ("found", "y"), ("found", "a-1"), ("found", "z")]  # fmt: skip
    assert "same id lies elsewhere: turned by 0 degrees, 6.0 m" in reasons["truth", "a-1"]
    assert "nearest, z: it faces the other way" in reasons["truth", "a-2"]
    assert "wall there, a-0, is already the partner of x" in reasons["found", "y"]
    assert result.extra == ("y", "a-1", "z")
    assert result.unmatched[1].windows == 3
    assert result.mean_shift_m == pytest.approx((0.1, 0.0, 0.0))


def test_models_of_two_places_are_refused() -> None:
    truth = [facade("a-0", *three_windows())]
    with pytest.raises(InputError, match=r"do not overlap: 4\d\d\.\d m.*500\.0 m east.*not given"):
        evaluate([facade("a-0", *three_windows(), place=(500, 0, 0))], truth)
    here, there = GeoOrigin(57.7, 11.97, 20.0), GeoOrigin(57.8, 11.97, 20.0)
    with pytest.raises(InputError, match=r"11,1\d\d.*57\.80000, 11\.97000, 20\.0 m \(found\)"):
        evaluate(truth, truth, there, here)
