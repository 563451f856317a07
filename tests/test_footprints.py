"""Footprints from GeoJSON and GeoPackage, and every way in which they can be wrong."""

import builtins
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest
import shapely

from si3fp.errors import InputError, MissingDependencyError
from si3fp.geometry.enu import GeoOrigin, geodetic_from_world
from si3fp.sources.footprints import footprints_in_world, read_footprints

ORIGIN = GeoOrigin(57.71, 11.97, 10.0)
RECTANGLE_M = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 8.0], [0.0, 8.0]])


def ring_of(outline_m: Any) -> list[list[float]]:
    """Closed longitude, latitude ring of world metres at the origin."""
    outline = np.asarray(outline_m, np.float64)
    geodetic = geodetic_from_world(np.c_[outline, np.zeros(len(outline))], ORIGIN)
    ring = geodetic[:, [1, 0]].tolist()
    return [*ring, ring[0]]


def building(outline_m: Any = RECTANGLE_M, **properties: Any) -> dict[str, Any]:
    geometry = {"type": "Polygon", "coordinates": [ring_of(outline_m)]}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def with_geometry(geometry: Any, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": {"id": "a", **properties}}


@pytest.fixture
def written(tmp_path: Path) -> Callable[..., Path]:
    def write(*features: Any, **members: Any) -> Path:
        path = tmp_path / "footprints.geojson"
        collection = {"type": "FeatureCollection", "features": list(features), **members}
        path.write_text(json.dumps(collection), encoding="utf-8")
        return path

    return write


def test_outlines_in_metres_run_counter_clockwise(written: Callable[..., Path]) -> None:
    clockwise = RECTANGLE_M[::-1]
    path = written(building(id="a"), building(clockwise, id="b"))
    first, second = footprints_in_world(read_footprints(path), ORIGIN)
    np.testing.assert_allclose(first.outline_in_world, RECTANGLE_M, atol=1e-5)
    # Turned round, but it still starts at its first corner.
    np.testing.assert_allclose(second.outline_in_world, RECTANGLE_M[[3, 0, 1, 2]], atol=1e-5)


def test_properties_are_read(written: Callable[..., Path]) -> None:
    path = written(
        building(id=7, ground_m=12.5, height_m="14.8", storeys="3", year=1962.0, use=" flats "),
        building(RECTANGLE_M + 50, id="b", height_m=None, storeys="", year=" "),
    )
    first, second = footprints_in_world(read_footprints(path), ORIGIN)
    assert (first.id, first.height_m, first.storeys, first.year, first.use) == (
        "7",
        14.8,
        3,
        1962,
        "flats",
    )
    # In world z; the origin lies at 10 m.
    assert first.ground_m == pytest.approx(2.5, abs=1e-4)
    assert (second.ground_m, second.height_m, second.storeys, second.year, second.use) == (
        None,
        None,
        None,
        None,
        None,
    )


def test_other_spellings_are_mapped(written: Callable[..., Path]) -> None:
    path = written(building(byggnad="x", hojd=9.5, storeys=2))
    record = read_footprints(path, {"id": "byggnad", "height_m": "hojd"})[0]
    assert (record.id, record.height_m, record.storeys) == ("x", 9.5, 2)
    with pytest.raises(InputError, match=r"no property 'HOJD' for height_m; it has byggnad, hojd"):
        read_footprints(path, {"height_m": "HOJD"})
    with pytest.raises(
        InputError, match=r"no footprint property 'hight'; choose from id, ground_m"
    ):
        read_footprints(path, {"hight": "hojd"})


def test_buildings_without_id_are_numbered_from_one(written: Callable[..., Path]) -> None:
    path = written(building(), building(RECTANGLE_M + 50, id=""), building(RECTANGLE_M - 50, id=0))
    assert [r.id for r in read_footprints(path)] == ["building-1", "building-2", "0"]


def test_parts_of_a_multipolygon_become_buildings(written: Callable[..., Path]) -> None:
    parts = [[ring_of(RECTANGLE_M)], [ring_of(RECTANGLE_M + 50)]]
    path = written(
        with_geometry({"type": "MultiPolygon", "coordinates": parts}, storeys=4),
        {**with_geometry({"type": "MultiPolygon", "coordinates": parts[:1]}), "properties": None},
    )
    records = read_footprints(path)
    assert [(r.id, r.storeys) for r in records] == [("a.1", 4), ("a.2", 4), ("building-2", None)]


def test_courtyards_are_counted_and_heights_ignored(written: Callable[..., Path]) -> None:
    outer = [[*position, 3.0] for position in ring_of(RECTANGLE_M)]
    inner = ring_of([[5.0, 2.0], [5.0, 6.0], [15.0, 6.0], [15.0, 2.0]])
    path = written(with_geometry({"type": "Polygon", "coordinates": [outer, inner]}))
    record = read_footprints(path)[0]
    assert record.courtyards == 1
    assert record.outline_deg.shape == (4, 2)


def test_repeated_corners_are_dropped(written: Callable[..., Path]) -> None:
    outline = RECTANGLE_M[[0, 0, 1, 2, 2, 3]]
    footprint = footprints_in_world(read_footprints(written(building(outline))), ORIGIN)[0]
    np.testing.assert_allclose(footprint.outline_in_world, RECTANGLE_M, atol=1e-5)


def test_a_sliver_is_no_building(written: Callable[..., Path]) -> None:
    records = read_footprints(written(building([[0, 0], [20, 0], [10, 0.05]], id="a")))
    with pytest.raises(InputError, match=r"Footprint a: 3 distinct corners around 0\.5 m2 are no"):
        footprints_in_world(records, ORIGIN)


@pytest.mark.parametrize("name", ["EPSG:3006", "urn:ogc:def:crs:EPSG::25833"])
def test_a_declared_crs_is_transformed(written: Callable[..., Path], name: str) -> None:
    feature = building()
    ring = np.array(feature["geometry"]["coordinates"][0])
    to_projected = pyproj.Transformer.from_crs("EPSG:4326", name, always_xy=True)
    projected = np.stack(to_projected.transform(*ring.T), axis=-1).tolist()
    feature["geometry"]["coordinates"] = [projected]
    path = written(feature, crs={"type": "name", "properties": {"name": name}})
    footprint = footprints_in_world(read_footprints(path), ORIGIN)[0]
    np.testing.assert_allclose(footprint.outline_in_world, RECTANGLE_M, atol=1e-3)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("EPSG:99999", r"coordinate system 'EPSG:99999' is not known"),
        ("EPSG:5773", r"'EGM96 height' has no place on Earth"),
        ("EPSG:3006", r"do not fit the declared coordinate system SWEREF99 TM"),
    ],
)
def test_a_crs_that_cannot_be_used_is_refused(
    written: Callable[..., Path], name: str, message: str
) -> None:
    feature = building(id="a")
    if name == "EPSG:3006":
        far = [[1e12, 1e12], [2e12, 1e12], [2e12, 2e12], [1e12, 1e12]]
        feature["geometry"]["coordinates"] = [far]
    path = written(feature, crs={"type": "name", "properties": {"name": name}})
    with pytest.raises(InputError, match=message):
        read_footprints(path)


BOW_TIE = [ring_of([[0, 0], [10, 10], [10, 0], [0, 10]])]
SHORT = [ring_of(RECTANGLE_M)[:3]]
NO_AREA = [[[11.0, 57.0], [11.1, 57.0], [11.2, 57.0], [11.0, 57.0]]]
METRES = [[[319180.0, 6399617.0], [319190.0, 6399617.0], [319190.0, 6399627.0]]]
METRES[0].append(METRES[0][0])
NAN = [[[11.0, 57.0], [11.1, float("nan")], [11.1, 57.1], [11.0, 57.0]]]


@pytest.mark.parametrize(
    ("geometry", "message"),
    [
        ({"type": "Polygon", "coordinates": BOW_TIE}, r"Self-intersection\[11\.97.* 57\.71.*\]\. "),
        ({"type": "Polygon", "coordinates": SHORT}, r"a ring needs at least 4 positions"),
        ({"type": "Polygon", "coordinates": NO_AREA}, r"not a simple polygon"),
        ({"type": "Polygon", "coordinates": METRES}, r"\[319180\.0.*another coordinate reference"),
        ({"type": "Polygon", "coordinates": NAN}, r"finite numbers, got \[11\.1, nan\]"),
        ({"type": "Polygon", "coordinates": []}, r"the Polygon is empty or damaged: \[\]"),
        ({"type": "MultiPolygon", "coordinates": []}, r"the MultiPolygon is empty"),
        ({"type": "MultiPolygon", "coordinates": [[]]}, r"the MultiPolygon is empty"),
        ({"type": "Polygon", "coordinates": [[1, 2, 3, 4]]}, r"finite numbers, got 1"),
        ({"type": "Polygon", "coordinates": 3}, r"the Polygon is empty or damaged: 3"),
        ({"type": "Point", "coordinates": [1, 2]}, r"a Polygon or MultiPolygon, got Point"),
        (None, r"a Polygon or MultiPolygon, got no geometry"),
    ],
)
def test_wrong_outlines_name_the_building(
    written: Callable[..., Path], geometry: Any, message: str
) -> None:
    path = written(building(RECTANGLE_M + 50, id="b"), with_geometry(geometry))
    with pytest.raises(InputError, match=rf"footprints\.geojson, feature 1 \(a\): .*{message}"):
        read_footprints(path)


def test_a_self_intersection_says_what_to_do(written: Callable[..., Path]) -> None:
    path = written(with_geometry({"type": "Polygon", "coordinates": BOW_TIE}))
    with pytest.raises(InputError, match="Repair it, for example with 'Fix geometries' in QGIS"):
        read_footprints(path)


@pytest.mark.parametrize(
    ("properties", "message"),
    [
        ({"height_m": "tall"}, r"`height_m` is 'tall', expected a height above the ground"),
        ({"height_m": -3}, r"`height_m` is -3"),
        ({"height_m": float("nan")}, r"`height_m` is nan"),
        ({"storeys": -1}, r"`storeys` is -1, expected a whole number, or nothing"),
        ({"storeys": 2.5}, r"`storeys` is 2\.5"),
        ({"year": "old"}, r"`year` is 'old', expected a year"),
        ({"year": 62}, r"`year` is 62"),
        ({"ground_m": "x"}, r"`ground_m` is 'x', expected the height of the ground"),
        ({"use": ["flats"]}, r"`use` is \['flats'\], expected a word"),
        ({"height_m": "x", "year": "y"}, r"`height_m` is 'x', .*; `year` is 'y'"),
    ],
)
def test_wrong_properties_name_building_field_and_value(
    written: Callable[..., Path], properties: dict[str, Any], message: str
) -> None:
    path = written(building(id="a", **properties))
    with pytest.raises(InputError, match=rf"feature 0 \(a\): .*{message}"):
        read_footprints(path)


def test_duplicate_ids_and_empty_files_are_refused(written: Callable[..., Path]) -> None:
    with pytest.raises(InputError, match="id 'a' occurs twice; give every building its own"):
        read_footprints(written(building(id="a"), building(RECTANGLE_M + 50, id="a")))
    with pytest.raises(InputError, match="holds zero footprints"):
        read_footprints(written())


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nowhere.geojson", r"no file .*nowhere\.geojson"),
        ("a.shp", r"read from \.geojson and \.gpkg files, not from \.shp"),
        ("empty.geojson", r"not a readable GeoJSON file"),
    ],
)
def test_files_that_hold_no_footprints_are_refused(tmp_path: Path, name: str, message: str) -> None:
    (tmp_path / "empty.geojson").touch()
    (tmp_path / "a.shp").touch()
    with pytest.raises(InputError, match=message):
        read_footprints(tmp_path / name)


def write_geopackage(path: Path, crs: str | None, *, layer: str = "buildings") -> None:
    pyogrio = pytest.importorskip("pyogrio", reason="needs the extra `geo`")
    outline = np.array(ring_of(RECTANGLE_M))
    if crs not in {None, "EPSG:4326"}:
        to_crs = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True)
        outline = np.stack(to_crs.transform(*outline.T), axis=-1)
    shapes = [shapely.Polygon(outline), shapely.Polygon(outline + np.array([1e-3, 0.0]))]
    pyogrio.raw.write(
        path,
        np.array([shapely.to_wkb(shape) for shape in shapes]),
        field_data=[
            np.array(["a", None], object),
            np.array([14.5, np.nan]),
            np.array([3, 4], np.int32),
        ],
        fields=["id", "height_m", "storeys"],
        geometry_type="Polygon",
        crs=crs,
        layer=layer,
        driver="GPKG",
        append=path.exists(),
    )


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:3006"])
def test_a_geopackage_is_read_in_its_own_crs(tmp_path: Path, crs: str) -> None:
    path = tmp_path / "a.gpkg"
    write_geopackage(path, crs)
    records = read_footprints(path)
    assert [(r.id, r.height_m, r.storeys) for r in records] == [
        ("a", 14.5, 3),
        ("building-2", None, 4),
    ]
    outline = footprints_in_world(records, ORIGIN)[0].outline_in_world
    np.testing.assert_allclose(outline, RECTANGLE_M, atol=1e-3)


@pytest.mark.filterwarnings("ignore:'crs' was not provided")
def test_a_geopackage_without_crs_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.gpkg"
    write_geopackage(path, None)
    with pytest.raises(InputError, match=r"a\.gpkg.*coordinate system|a\.gpkg: the coordinate"):
        read_footprints(path)


def test_a_geopackage_with_several_layers_or_damage_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.gpkg"
    write_geopackage(path, "EPSG:4326")
    write_geopackage(path, "EPSG:4326", layer="trees")
    with pytest.raises(InputError, match=r"holds 2 layers with geometries \(buildings, trees\)"):
        read_footprints(path)
    (tmp_path / "b.gpkg").write_bytes(path.read_bytes()[:3000])
    with pytest.raises(InputError, match=r"b\.gpkg is not a readable GeoPackage"):
        read_footprints(tmp_path / "b.gpkg")
    with pytest.raises(InputError, match=r"no file .*c\.gpkg"):
        read_footprints(tmp_path / "c.gpkg")


def test_a_geopackage_without_pyogrio_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import_ = builtins.__import__

    def refuse(name: str, *rest: Any) -> Any:
        if name == "pyogrio":
            raise ImportError(name)
        return import_(name, *rest)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(MissingDependencyError, match=r"si3fp\[geo\]"):
        read_footprints(tmp_path / "a.gpkg")


@pytest.mark.parametrize("name", ["height_m", "storeys", "year"])
@pytest.mark.parametrize("unknown", [0, "0", " ", None])
def test_zero_is_how_registers_say_unknown(tmp_path, name, unknown):
    ring = [[8.0, 49.0], [8.001, 49.0], [8.001, 49.001], [8.0, 49.001], [8.0, 49.0]]
    feature = {
        "type": "Feature",
        "geometry": {"type": "Polygon", "coordinates": [ring]},
        "properties": {"id": "a", "ground_m": 0, name: unknown},
    }
    path = tmp_path / "footprints.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    (record,) = read_footprints(path)
    assert getattr(record, name) is None
    assert record.ground_m == 0
