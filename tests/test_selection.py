"""Which panoramas a run uses, and where its world begins."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from si3fp.config import CollectConfig
from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin, geodetic_from_world
from si3fp.model import Footprint
from si3fp.sources.footprints import FootprintRecord
from si3fp.sources.local import PanoramaRecord
from si3fp.sources.selection import (
    most_recent_date,
    origin_view,
    run_origin,
    select_panoramas,
    traverse_links,
    within_radius,
)

ORIGIN = GeoOrigin(57.71, 11.97, 10.0)
HOUSE = Footprint("house", np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 8.0], [0.0, 8.0]]))
CONFIG = CollectConfig(min_panoramas=3, max_distance_m=30.0)


def record(
    identifier: str,
    x_m: float = 0.0,
    y_m: float = -10.0,
    captured: str = "2021-05",
    links: tuple[str, ...] = (),
) -> PanoramaRecord:
    lat, lon, height = geodetic_from_world([x_m, y_m, 2.5], ORIGIN)
    image = Path(f"{identifier}.jpg")
    return PanoramaRecord(
        identifier, lat, lon, height, 0.0, 0.0, 0.0, image, 64, 32, None, captured, links
    )


def ids(records: object) -> list[str]:
    return [r.id for r in records]  # type: ignore[attr-defined]


def square(lon: float, lat: float, ground_m: float | None) -> FootprintRecord:
    outline = np.array([[lon, lat], [lon + 2e-4, lat], [lon + 2e-4, lat + 1e-4], [lon, lat + 1e-4]])
    return FootprintRecord(f"{lon}", outline, ground_m=ground_m)


def test_the_origin_is_the_centroid_of_the_footprints_at_the_lowest_ground() -> None:
    footprints = [
        square(11.97, 57.71, 12.0),
        square(11.98, 57.71, 11.0),
        square(11.99, 57.71, None),
    ]
    origin = run_origin(footprints, [record("a")])
    assert (origin.lat_deg, origin.lon_deg, origin.height_m) == (57.71005, 11.9801, 11.0)


def test_the_origin_without_footprints_is_the_centroid_of_the_cameras() -> None:
    records = [replace(record("a"), lat_deg=57.0, lon_deg=11.0, height_m=14.0)]
    records.append(replace(record("b"), lat_deg=57.000021, lon_deg=11.00002, height_m=15.0))
    origin = run_origin([], records)
    assert (origin.lat_deg, origin.lon_deg) == (57.00001, 11.00001)
    assert origin.height_m == 11.5  # 2.5 m below the lowest camera
    with pytest.raises(InputError, match="at least one panorama or footprint"):
        run_origin([], [])


def test_within_radius_is_horizontal_and_keeps_the_order() -> None:
    records = [record("far", 31.0, 0.0), record("near", 29.9, 0.0), record("here", 0.0, 0.0)]
    records.append(replace(record("high", 0.0, 0.0), height_m=500.0))
    kept = within_radius(records, ORIGIN.lat_deg, ORIGIN.lon_deg, 30.0)
    assert ids(kept) == ["near", "here", "high"]


def test_the_origin_view_is_the_most_recent_and_then_the_nearest() -> None:
    records = [
        record("old", captured="2019-01"),
        record("b", captured="2022-08"),
        record("a", captured="2022-08"),
        record("unknown", captured=""),
    ]
    assert origin_view(records, [0.0, 5.0, 6.0, 0.0]).id == "b"
    assert origin_view(records, [0.0, 5.0, 5.0, 0.0]).id == "a"


def test_links_are_traversed_breadth_first_in_either_direction() -> None:
    records = [
        record("a", links=("b", "c", "elsewhere")),
        record("b", links=("d",)),
        record("c"),
        record("d"),
        record("e", links=("c",)),
        record("alone"),
    ]
    assert traverse_links(records, records[0]) == ["a", "b", "c", "d", "e"]
    assert traverse_links(records, records[3]) == ["d", "b", "a", "c", "e"]


def test_the_most_recent_date_with_enough_panoramas_is_kept() -> None:
    records = [record(f"new{i}", captured="2023-01") for i in range(2)]
    records += [record(f"mid{i}", captured="2021-05") for i in range(3)]
    records += [record(f"old{i}", captured="2015-05") for i in range(9)]
    date, kept = most_recent_date(records, 3)
    assert date == "2021-05"
    assert ids(kept) == ["mid0", "mid1", "mid2"]
    date, kept = most_recent_date(records, 10)
    assert date == ""
    assert kept == records


def test_unknown_dates_are_no_date() -> None:
    records = [record(f"{i}", captured="") for i in range(5)]
    assert most_recent_date(records, 3) == ("", records)


def test_panoramas_far_from_every_building_are_left_out_with_a_note() -> None:
    records = [record("a", y_m=-9.0), record("b"), record("c"), record("far", 100.0)]
    selection = select_panoramas(records, [HOUSE], ORIGIN, CONFIG)
    assert ids(selection.records) == ["a", "b", "c"]
    assert selection.by_building == {"house": frozenset("abc")}
    assert selection.notes == (
        "1 of 4 panoramas lie more than 30 m from every footprint and are not used: far.",
    )


def test_distances_count_from_the_outline_not_from_its_corners() -> None:
    wide = Footprint("wide", np.array([[-100.0, 0.0], [100.0, 0.0], [100.0, 8.0], [-100.0, 8.0]]))
    records = [record(f"{i}", 0.0, -28.5 - i) for i in range(3)]
    selection = select_panoramas(records, [wide], ORIGIN, CONFIG)
    assert ids(selection.records) == ["0", "1"]


def test_one_date_per_building_where_it_leaves_enough() -> None:
    new = [record(f"new{i}", captured="2022-08") for i in range(3)]
    old = [record(f"old{i}", captured="2019-01") for i in range(4)]
    selection = select_panoramas([*old, *new], [HOUSE], ORIGIN, CONFIG)
    assert ids(selection.records) == ["new0", "new1", "new2"]
    assert selection.notes == (
        "house: the 3 of 7 panoramas captured 2022-08 are used, the most recent date with at "
        "least 3.",
    )


def test_all_dates_where_none_leaves_enough() -> None:
    records = [record("new", captured="2022-08"), record("old", captured=""), record("mid")]
    selection = select_panoramas(records, [HOUSE], ORIGIN, CONFIG)
    assert len(selection.records) == 3
    assert selection.notes == (
        "house: no single capture date has 3 panoramas; all 3 are used "
        "(2021-05, 2022-08, unknown).",
    )


def test_buildings_choose_their_dates_separately() -> None:
    other = Footprint("other", HOUSE.outline_in_world + np.array([200.0, 0.0]))
    lone = Footprint("lone", HOUSE.outline_in_world + np.array([900.0, 0.0]))
    records = [record(f"new{i}", captured="2022-08") for i in range(3)]
    records += [record(f"old{i}", captured="2019-01") for i in range(3)]
    records += [record(f"there{i}", 200.0, captured="2019-01") for i in range(3)]
    selection = select_panoramas(records, [HOUSE, other, lone], ORIGIN, CONFIG)
    assert selection.by_building == {
        "house": frozenset({"new0", "new1", "new2"}),
        "other": frozenset({"there0", "there1", "there2"}),
        "lone": frozenset(),
    }
    assert len(selection.records) == 6
    assert "lone: no panorama lies within 30 m." in selection.notes


def test_unlinked_panoramas_are_kept_last_with_a_note() -> None:
    records = [
        record("alone", 1.0),
        record("c", 5.0),
        record("b", 3.0, links=("c",)),
        record("a", 0.0, links=("b",), captured="2021-06"),
    ]
    config = replace(CONFIG, min_panoramas=4)
    selection = select_panoramas(records, [HOUSE], ORIGIN, config)
    assert ids(selection.records) == ["a", "b", "c", "alone"]
    assert selection.notes[-1] == (
        "1 of 4 panoramas are not linked to the origin view a; they are used all the same: alone."
    )


def test_links_lead_through_panoramas_that_are_not_used() -> None:
    records = [record("a", links=("far",)), record("far", 200.0, links=("b",)), record("b", 9.0)]
    selection = select_panoramas(records, [HOUSE], ORIGIN, replace(CONFIG, min_panoramas=1))
    assert ids(selection.records) == ["a", "b"]
    assert not any("linked" in note for note in selection.notes)


def test_without_links_all_are_kept_without_a_note() -> None:
    records = [record(name) for name in "cab"]
    selection = select_panoramas(records, [HOUSE], ORIGIN, CONFIG)
    assert sorted(ids(selection.records)) == ["a", "b", "c"]
    assert selection.notes == ()


def test_without_footprints_all_panoramas_count_as_near() -> None:
    records = [record("a"), record("b"), record("far", 5000.0), record("old", captured="2001-01")]
    selection = select_panoramas(records, [], ORIGIN, CONFIG)
    assert sorted(ids(selection.records)) == ["a", "b", "far"]
    assert selection.by_building == {}
    assert "captured 2021-05" in selection.notes[0]


def test_panoramas_of_another_place_are_refused_with_the_distance() -> None:
    with pytest.raises(InputError, match=r"within 30 m of a footprint, the nearest is 4,98\d m"):
        select_panoramas([record("a", 5000.0)], [HOUSE], ORIGIN, CONFIG)
    with pytest.raises(InputError, match="zero panoramas"):
        select_panoramas([], [HOUSE], ORIGIN, CONFIG)
