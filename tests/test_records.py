"""Records of the domain types: what a run writes and reads again."""

from __future__ import annotations

import json

import numpy as np
import pytest

from si3fp.geometry.equirect import world_from_pano_rotation
from si3fp.model import Detections, Facade, GeoOrigin, Missing, Rigid3, Window
from si3fp.records import (
    detections_record,
    facade_from_records,
    facade_record,
    missing_record,
    place_record,
    window_record,
)

ORIGIN = GeoOrigin(57.70887, 11.97456, 12.5)
WINDOWS = (
    Window(
        1.25,
        0.8,
        1.2,
        1.5,
        score=0.875,
        views=("p1", "p2"),
        edge_sigma_m=(0.01, 0.02, 0.03, 0.04),
        recess_m=0.12,
        correction_m=(0.0, 0.001, 0.0, 0.02),
        evidence="seen in 2 views",
    ),
    Window(4.0, 0.0, 1.0, 2.25, label="balcony_door", origin="reviewed"),
)
POSE = Rigid3(world_from_pano_rotation(33.0, 0.0, 0.0), np.array([10.5, -3.25, 1.0]))
FACADE = Facade("house-3", POSE, 12.34, 9.5, WINDOWS, (0.2, 0.3))


def through_json(record):
    return json.loads(json.dumps(record))


def written_and_read(facade):
    windows = {"windows": [window_record(window) for window in facade.windows]}
    return facade_from_records(through_json(facade_record(facade, ORIGIN)), through_json(windows))


def test_a_facade_comes_back_as_it_was_written():
    back = written_and_read(FACADE)
    assert back.windows == FACADE.windows
    assert (back.id, back.width_m, back.height_m) == ("house-3", 12.34, 9.5)
    assert back.wwr_interval == (0.2, 0.3)
    np.testing.assert_allclose(back.world_from_facade.rotation, POSE.rotation, atol=1e-12)
    np.testing.assert_allclose(back.world_from_facade.translation, POSE.translation, atol=1e-6)


def test_a_facade_without_windows_and_interval_comes_back():
    back = written_and_read(Facade("wall-1", POSE, 5.0, 4.0))
    assert back.windows == ()
    assert back.wwr_interval is None


def test_writing_twice_changes_nothing_more():
    once = written_and_read(
        Facade("f", POSE, 12.345678, 9.87654321, (Window(1.23456789, 0.1, 1 / 3, 2 / 3),))
    )
    twice = written_and_read(once)
    assert once.windows == twice.windows
    assert (once.width_m, once.height_m) == (twice.width_m, twice.height_m)
    assert once.windows[0].x_m == pytest.approx(1.23456789, abs=0.5e-4)  # rounded to 0.1 mm


def test_a_facade_record_says_its_ratio_and_its_centre_on_earth():
    record = facade_record(Facade("f", Rigid3(np.eye(3), np.zeros(3)), 2e-3, 9.0), ORIGIN)
    assert record["wwr"] == 0.0
    assert record["origin"] == {"lat_deg": 57.70887, "lon_deg": 11.97456, "height_m": 12.5}
    centre = record["centre"]
    assert (centre["lat_deg"], centre["lon_deg"]) == pytest.approx((57.70887, 11.97456), abs=1e-4)


def test_a_place_above_the_origin_is_higher_and_nothing_else():
    assert place_record(np.array([0.0, 0.0, 7.5]), ORIGIN) == {
        "lat_deg": 57.70887,
        "lon_deg": 11.97456,
        "height_m": 20.0,
    }


def test_detections_are_rounded_to_hundredths_of_a_pixel():
    found = Detections([[1.2345, 2.0, 30.5, 40.999]], [0.123456], ["window"])
    assert detections_record(found) == {
        "boxes_px": [[1.23, 2.0, 30.5, 41.0]],
        "scores": [0.1235],
        "labels": ["window"],
    }


def test_a_missing_facade_keeps_its_reason():
    assert missing_record(Missing("f-1", "align", "no match")) == {
        "facade_id": "f-1",
        "step": "align",
        "reason": "no match",
    }
