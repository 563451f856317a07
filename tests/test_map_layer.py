"""The map layer: coordinates to a centimetre, ids and attributes a GIS can use."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from si3fp.geometry.enu import GeoOrigin, world_from_geodetic
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Building, Facade, Missing, Window
from si3fp.report.map_layer import compass_bearing_deg, footprint_edge, windows_geojson

ORIGIN = GeoOrigin(59.349, 18.072, 12.0)
OUTLINE = np.array([[3.0, -2.0], [23.0, -2.0], [23.0, 8.0], [3.0, 8.0]])


def facing(bearing_deg, corner):
    """A facade frame with its lower left corner in world metres."""
    angle = np.deg2rad(bearing_deg)
    normal = np.array([np.sin(angle), np.cos(angle), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    return Rigid3(np.column_stack([np.cross(up, normal), up, normal]), np.asarray(corner, float))


def facade_of(name="b-0", bearing_deg=180.0, corner=(3.0, -2.0, 0.5)):
    windows = (
        Window(1.0, 0.9, 1.2, 1.5, score=0.87654, views=("p1", "p2")),
        Window(4.0, 0.1, 0.9, 2.2, label="balcony_door", origin="inferred"),
    )
    return Facade(name, facing(bearing_deg, corner), 20.0, 9.0, windows, (0.01, 0.03))


def building_of(facades=None, missing=()):
    return Building(
        id="b",
        origin=ORIGIN,
        footprint_in_world=OUTLINE,
        base_z_m=0.5,
        height_m=9.0,
        storeys=3,
        facades=(facade_of(),) if facades is None else facades,
        missing=missing,
        year=1931,
    )


def world_of(positions):
    """World metres of GeoJSON positions [lon, lat, height]."""
    lon_lat_height = np.asarray(positions, dtype=np.float64)
    return world_from_geodetic(lon_lat_height[..., [1, 0, 2]], ORIGIN)


def by_id(layer):
    return {feature["id"]: feature for feature in layer["features"]}


def test_coordinates_are_right_to_a_centimetre():
    features = by_id(windows_geojson([building_of()], ORIGIN))
    ring = features["footprint/b"]["geometry"]["coordinates"][0]
    assert ring[0] == ring[-1]
    np.testing.assert_allclose(
        world_of(ring[:-1]), np.column_stack([OUTLINE, np.full(4, 0.5)]), atol=0.01
    )
    foot = features["facade/b-0"]["geometry"]["coordinates"]
    np.testing.assert_allclose(world_of(foot), [[3, -2, 0.5], [23, -2, 0.5]], atol=0.01)
    centre = features["window/b-0-w0"]["geometry"]["coordinates"]
    np.testing.assert_allclose(world_of(centre), [4.6, -2.0, 0.5 + 0.9 + 0.75], atol=0.01)


@settings(max_examples=50, deadline=None)
@given(
    east=st.floats(-500, 500),
    north=st.floats(-500, 500),
    up=st.floats(-20, 80),
    bearing_deg=st.floats(0, 360),
)
def test_windows_come_back_from_the_map(east, north, up, bearing_deg):
    facade = facade_of("wall-1", bearing_deg, (east, north, up))
    features = windows_geojson([], ORIGIN, [facade])["features"]
    windows = [feature for feature in features if feature["properties"]["kind"] == "window"]
    for window, feature in zip(facade.windows, windows, strict=True):
        middle = [window.x_m + window.width_m / 2, window.y_m + window.height_m / 2, 0.0]
        expected = facade.world_from_facade.apply(middle)
        np.testing.assert_allclose(
            world_of(feature["geometry"]["coordinates"]), expected, atol=0.01
        )


def test_attributes_of_facade_and_window():
    features = by_id(windows_geojson([building_of()], ORIGIN))
    facade = features["facade/b-0"]["properties"]
    assert facade["found"] is True
    assert facade["building"] == "b"
    assert facade["bearing_deg"] == pytest.approx(180.0)
    assert facade["wwr"] == pytest.approx((1.2 * 1.5 + 0.9 * 2.2) / 180, abs=1e-3)
    assert (facade["wwr_low"], facade["wwr_high"]) == (0.01, 0.03)
    window = features["window/b-0-w0"]["properties"]
    assert window["facade"] == "b-0"
    assert window["area_m2"] == pytest.approx(1.8)
    assert window["sill_height_m"] == 0.9
    assert window["views"] == 2
    assert window["score"] == 0.877
    assert features["window/b-0-w1"]["properties"]["label"] == "balcony_door"
    assert features["window/b-0-w1"]["properties"]["origin"] == "inferred"
    assert features["footprint/b"]["properties"]["year"] == 1931


def test_missing_facades_lie_on_their_footprint_edge():
    missing = (
        Missing("b-1", "coverage", "No camera faces it."),
        Missing("b-x", "align", "No edge in this id."),
    )
    features = by_id(windows_geojson([building_of(missing=missing)], ORIGIN))
    east = features["facade/b-1"]
    np.testing.assert_allclose(
        world_of(east["geometry"]["coordinates"]), [[23, -2, 0.5], [23, 8, 0.5]], atol=0.01
    )
    assert east["properties"]["bearing_deg"] == pytest.approx(90.0)
    assert east["properties"]["found"] is False
    assert east["properties"]["reason"] == "No camera faces it."
    assert features["facade/b-x"]["geometry"] is None


def test_one_geometry_type_and_one_set_of_attributes_per_kind():
    missing = (Missing("b-1", "coverage", "No camera faces it."),)
    layer = windows_geojson([building_of(missing=missing)], ORIGIN, [facade_of("wall-1")])
    kinds = {"footprint": "Polygon", "facade": "LineString", "window": "Point"}
    for kind, geometry in kinds.items():
        mine = [f for f in layer["features"] if f["properties"]["kind"] == kind]
        assert {f["geometry"]["type"] for f in mine} == {geometry}
        assert len({tuple(f["properties"]) for f in mine}) == 1
    assert len(by_id(layer)) == len(layer["features"]), "ids are unique"


def test_layer_is_json_and_the_same_every_time():
    first = json.dumps(windows_geojson([building_of()], ORIGIN), allow_nan=False)
    assert json.dumps(windows_geojson([building_of()], ORIGIN), allow_nan=False) == first
    assert windows_geojson([], ORIGIN) == {"type": "FeatureCollection", "features": []}


def test_building_keeps_its_own_origin():
    elsewhere = GeoOrigin(10.0, 10.0, 0.0)
    assert windows_geojson([building_of()], elsewhere) == windows_geojson([building_of()], ORIGIN)


@pytest.mark.parametrize(
    ("direction", "bearing_deg"), [((0, 1), 0), ((1, 0), 90), ((0, -1), 180), ((-1, 0), 270)]
)
def test_compass_bearing(direction, bearing_deg):
    assert compass_bearing_deg(direction) == pytest.approx(bearing_deg)


@pytest.mark.parametrize(
    ("facade_id", "edge"), [("b-2", 2), ("b-7", None), ("c-2", None), ("b-x", None), ("b", None)]
)
def test_footprint_edge(facade_id, edge):
    assert footprint_edge(facade_id, "b", corners=4) == edge
