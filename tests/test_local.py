"""Panoramas from a GeoJSON file and from a folder of Photo Sphere JPEGs."""

import io
import json
import os
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from si3fp.config import CollectConfig
from si3fp.errors import InputError
from si3fp.geometry.enu import GeoOrigin, geodetic_from_world
from si3fp.geometry.equirect import directions_from_pixels
from si3fp.geometry.planes import Planes, ray_plane_distances
from si3fp.sources.footprints import footprints_in_world, read_footprints
from si3fp.sources.images import seen_pixels
from si3fp.sources.local import image_loader, panoramas_in_world, read_panorama_records
from si3fp.sources.plane_map import encode_plane_map
from si3fp.sources.selection import run_origin, select_panoramas

GREY = np.full((32, 64, 3), 128, np.uint8)


def feature(identifier: str = "a", **changes: Any) -> dict[str, Any]:
    """A valid panorama; a change of None removes the property."""
    properties = {
        "id": identifier,
        "image": f"{identifier}.png",
        "heading_deg": 0.0,
        "pitch_deg": 0.0,
        "roll_deg": 0.0,
        "captured": "2021-05",
        "links": ["b"],
        "provider": "own",
        **changes,
    }
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [11.97, 57.71, 12.5]},
        "properties": {name: value for name, value in properties.items() if value is not None},
    }


@pytest.fixture
def street(tmp_path: Path) -> Callable[..., Path]:
    """Writes a panoramas file with these features, and images a.png to c.png beside it."""
    for name in "abc":
        Image.fromarray(GREY).save(tmp_path / f"{name}.png")

    def write(*features: Any, **members: Any) -> Path:
        path = tmp_path / "panoramas.geojson"
        collection = {"type": "FeatureCollection", "features": list(features), **members}
        path.write_text(json.dumps(collection), encoding="utf-8")
        return path

    return write


def test_every_property_is_read(street: Callable[..., Path]) -> None:
    path = street(feature("a", captured="2021-05-03T10:00:00Z"), feature("b", links=None))
    first, second = read_panorama_records(path)
    assert (first.id, first.lat_deg, first.lon_deg, first.height_m) == ("a", 57.71, 11.97, 12.5)
    assert (first.width_px, first.height_px) == (64, 32)
    assert (first.captured, first.links, first.provider) == ("2021-05-03", ("b",), "own")
    assert first.image == path.parent / "a.png"
    assert first.plane_map is None
    assert second.links == ()


def test_heading_zero_is_not_missing(street: Callable[..., Path]) -> None:
    assert read_panorama_records(street(feature(heading_deg=0)))[0].heading_deg == 0.0


def test_absent_optional_properties_and_numeric_ids_are_accepted(
    street: Callable[..., Path],
) -> None:
    bare = feature(image="a.png", captured=None, links=None, provider=None)
    bare["properties"] |= {"id": 7, "captured": None, "depth": None}
    record = read_panorama_records(street(bare))[0]
    assert (record.id, record.captured, record.plane_map) == ("7", "", None)


def test_poses_in_the_world_frame(street: Callable[..., Path]) -> None:
    records = read_panorama_records(street(feature(heading_deg=90.0)))
    panorama = panoramas_in_world(records, GeoOrigin(57.71, 11.97, 10.0))[0]
    np.testing.assert_allclose(panorama.centre_in_world, [0, 0, 2.5], atol=1e-6)
    east = panorama.pano_from_world.inverse().rotate([0.0, 0.0, 1.0])
    np.testing.assert_allclose(east, [1, 0, 0], atol=1e-12)


def test_plane_maps_are_decoded_into_frame_pano(street: Callable[..., Path]) -> None:
    path = street(feature(depth="a.b64"))
    plane_index = np.zeros((4, 8), np.int32)
    text = encode_plane_map(Planes([[0, 0, 1]], [5.0]), plane_index)
    (path.parent / "a.b64").write_text(text)
    panorama = panoramas_in_world(read_panorama_records(path), GeoOrigin(57.71, 11.97, 0.0))[0]
    assert panorama.planes_in_pano is not None
    np.testing.assert_allclose(panorama.planes_in_pano.normals, [[0, 0, 1]])
    np.testing.assert_array_equal(panorama.plane_index, plane_index)


def test_images_load_by_id(street: Callable[..., Path]) -> None:
    load = image_loader(read_panorama_records(street(feature())))
    np.testing.assert_array_equal(load("a"), GREY)
    with pytest.raises(InputError, match="no panorama 'x' among the 1 read"):
        load("x")


def test_images_may_lie_beside_the_folder_of_the_file(street: Callable[..., Path]) -> None:
    path = street(feature(image=f"../{Path(street()).parent.name}/a.png"))
    assert read_panorama_records(path)[0].width_px == 64


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"heading_deg": None}, r"`heading_deg` is missing, expected the compass bearing"),
        ({"heading_deg": "north"}, r"`heading_deg` is 'north', expected the compass bearing"),
        ({"heading_deg": float("nan")}, r"`heading_deg` is nan"),
        ({"roll_deg": float("inf")}, r"`roll_deg` is inf, expected degrees from -180 to 180"),
        ({"pitch_deg": 91}, r"`pitch_deg` is 91, expected degrees from -90 to 90"),
        ({"pitch_deg": None}, r"`pitch_deg` is missing, .*\(0 = level\)"),
        ({"captured": "May 2021"}, r"`captured` is 'May 2021', expected a date \"YYYY-MM\""),
        ({"captured": "2021-13"}, r"`captured` is '2021-13'"),
        ({"links": "b"}, r"`links` is 'b', expected a list of ids"),
        ({"image": None}, r"`image` is missing, expected the path of a JPEG or PNG"),
        ({"image": "z.png"}, r"There is no image .*z\.png"),
        ({"image": "https://example.org/a.png"}, r"`image` is 'https.*relative to the file"),
        ({"image": "/etc/a.png"}, r"`image` is '/etc/a\.png'; write a path relative"),
        ({"image": "../../a.png"}, r"`image` is '\.\./\.\./a\.png', which leaves the folder"),
        ({"image": "x/../../../a.png"}, r"which leaves the folder around the file"),
        ({"depth": "a.b64"}, r"no plane map .*a\.b64\. Copy the file, or remove `depth`"),
    ],
)
def test_wrong_properties_name_panorama_field_value_and_expectation(
    street: Callable[..., Path], changes: dict[str, Any], message: str
) -> None:
    path = street(feature("b"), feature("a", **changes))
    with pytest.raises(InputError, match=message) as caught:
        read_panorama_records(path)
    if "no image" not in str(caught.value):
        assert "panoramas.geojson, feature 1 (a)" in str(caught.value)


@pytest.mark.parametrize(
    ("geometry", "message"),
    [
        ({"type": "Point", "coordinates": [11.97, 57.71]}, r"has no height; write \[lon, lat"),
        ({"type": "Point", "coordinates": [319180.0, 6399617.0, 1.0]}, r"WGS 84 \(EPSG:4326\)"),
        (
            {"type": "Point", "coordinates": [float("nan"), 57.71, 1.0]},
            r"finite numbers, got \[nan",
        ),
        ({"type": "Point", "coordinates": [11.97, 57.71, float("nan")]}, r"finite numbers"),
        ({"type": "Point", "coordinates": [11.97, 57.71, 1e6]}, r"`height_m` is 1000000.0"),
        ({"type": "Point", "coordinates": ["11.97", 57.71, 1.0]}, r"finite numbers"),
        ({"type": "Point", "coordinates": []}, r"finite numbers, got \[\]"),
        ({"type": "Point"}, r"finite numbers, got \[\]"),
        ({"type": "LineString", "coordinates": []}, r"a panorama is a Point, got LineString"),
        (None, r"a panorama is a Point, got no geometry"),
    ],
)
def test_wrong_positions_are_refused(
    street: Callable[..., Path], geometry: Any, message: str
) -> None:
    path = street(feature() | {"geometry": geometry})
    with pytest.raises(InputError, match=rf"feature 0 \(a\): .*{message}"):
        read_panorama_records(path)


@pytest.mark.parametrize(
    ("name", "is_accepted"),
    [
        ("urn:ogc:def:crs:OGC:1.3:CRS84", True),
        ("EPSG:4326", True),
        ("urn:ogc:def:crs:EPSG::4326", True),
        ("urn:ogc:def:crs:EPSG::3006", False),
        ("EPSG:43260", False),
    ],
)
def test_a_declared_crs_must_be_wgs84(
    street: Callable[..., Path], name: str, is_accepted: bool
) -> None:
    path = street(feature(), crs={"type": "name", "properties": {"name": name}})
    if is_accepted:
        assert len(read_panorama_records(path)) == 1
    else:
        with pytest.raises(InputError, match=rf"declares .* '{name}'; .* save it as WGS 84"):
            read_panorama_records(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ('{"type": "FeatureCollection", "features": []}', r"holds zero panoramas"),
        ('{"type": "Feature"}', r"not a GeoJSON FeatureCollection, its type is 'Feature'"),
        ("[1]", r"not a GeoJSON FeatureCollection, its type is 'list'"),
        ('{"type": "FeatureCollection"}', r"not a GeoJSON FeatureCollection"),
        ('{"type": "FeatureCollection", "features": [', r"not a readable GeoJSON file"),
        ("", r"not a readable GeoJSON file"),
        ("\xff", r"not a readable GeoJSON file"),
        ('{"type": "FeatureCollection", "features": [3]}', r"feature 0: not a GeoJSON feature: 3"),
        ('{"type": "FeatureCollection", "features": [{}], "crs": 3}', r"`crs` names no coordinate"),
    ],
)
def test_files_that_are_no_panorama_list_are_refused(
    tmp_path: Path, content: str, message: str
) -> None:
    path = tmp_path / "panoramas.geojson"
    path.write_bytes(content.encode("latin-1"))
    with pytest.raises(InputError, match=rf"panoramas\.geojson.*{message}"):
        read_panorama_records(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"There is no file .*nowhere\.geojson"):
        read_panorama_records(tmp_path / "nowhere.geojson")


def test_duplicate_ids_are_refused(street: Callable[..., Path]) -> None:
    with pytest.raises(InputError, match="id 'a' occurs twice"):
        read_panorama_records(street(feature("a"), feature("b"), feature("a")))


def test_an_image_that_is_no_panorama_stops_the_run_at_once(street: Callable[..., Path]) -> None:
    path = street(feature())
    Image.fromarray(GREY[:20]).save(path.parent / "a.png")
    with pytest.raises(InputError, match=r"a\.png: .* got 64 x 20 px"):
        read_panorama_records(path)


def test_a_damaged_plane_map_names_the_panorama(street: Callable[..., Path]) -> None:
    path = street(feature(depth="a.b64"))
    (path.parent / "a.b64").write_text("CAoAAAI")
    records = read_panorama_records(path)
    with pytest.raises(InputError, match=r"Panorama a, .*a\.b64: the plane map is cut short"):
        panoramas_in_world(records, GeoOrigin(57.71, 11.97, 0.0))
    (path.parent / "a.b64").unlink()
    with pytest.raises(InputError, match=r"Could not read the plane map .*a\.b64: No such file"):
        panoramas_in_world(records, GeoOrigin(57.71, 11.97, 0.0))


GPS = {1: "S", 2: (33.0, 51.0, 30.0), 3: "W", 4: (70.0, 30.0, 36.0), 5: b"\x00", 6: 17.25}
POSE = 'GPano:PoseHeadingDegrees="0.0" GPano:PosePitchDegrees="-1.5" GPano:PoseRollDegrees="2"'


def photo_sphere(
    path: Path,
    *,
    xmp: str = POSE,
    gps: dict[int, Any] | None = None,
    width: int = 64,
    taken: str = "2021:05:03 10:00:00",
) -> None:
    """A JPEG with EXIF GPS and an XMP packet."""
    exif = Image.Exif()
    exif[0x8825] = GPS if gps is None else gps
    exif[0x8769] = {0x9003: taken}
    stream = io.BytesIO()
    pixels = np.full((32, width, 3), 128, np.uint8)
    Image.fromarray(pixels).save(stream, "JPEG", exif=exif)
    content = stream.getvalue()
    packet = b"http://ns.adobe.com/xap/1.0/\x00<rdf:Description " + xmp.encode() + b"/>"
    segment = b"\xff\xe1" + struct.pack(">H", len(packet) + 2) + packet
    path.write_bytes(content[:2] + segment + content[2:])


def test_a_folder_of_photo_spheres_is_read(tmp_path: Path) -> None:
    photo_sphere(tmp_path / "b.JPG", gps=GPS | {1: "N", 3: "E", 5: b"\x01"})
    photo_sphere(tmp_path / "a.jpg")
    (tmp_path / "notes.txt").write_text("ignored")
    first, second = read_panorama_records(tmp_path)
    assert (first.id, second.id) == ("a", "b")
    assert first.lat_deg == pytest.approx(-33.858333, abs=1e-6)
    assert first.lon_deg == pytest.approx(-70.51, abs=1e-6)
    assert first.height_m == pytest.approx(17.25)
    assert second.lat_deg > 0
    assert second.lon_deg > 0
    assert second.height_m == pytest.approx(-17.25)  # below sea level
    assert (first.heading_deg, first.pitch_deg, first.roll_deg) == (0.0, -1.5, 2.0)
    assert first.captured == "2021-05-03"
    panorama = panoramas_in_world([first], GeoOrigin(-33.858, -70.51, 0.0))[0]
    assert panorama.planes_in_pano is None


@pytest.mark.parametrize("taken", ["    :  :     :  :  ", "0000:00:00 00:00:00", ""])
def test_a_photo_sphere_without_a_set_clock_has_no_date(tmp_path: Path, taken: str) -> None:
    photo_sphere(tmp_path / "a.jpg", taken=taken)
    assert read_panorama_records(tmp_path)[0].captured == ""


def test_gpano_elements_and_a_crop_are_read(tmp_path: Path) -> None:
    crop = (
        "><GPano:PoseHeadingDegrees>350.5</GPano:PoseHeadingDegrees>"
        "<GPano:FullPanoWidthPixels>80</GPano:FullPanoWidthPixels>"
        "<GPano:FullPanoHeightPixels>40</GPano:FullPanoHeightPixels>"
        "<GPano:CroppedAreaImageWidthPixels>64</GPano:CroppedAreaImageWidthPixels>"
        "<GPano:CroppedAreaImageHeightPixels>32</GPano:CroppedAreaImageHeightPixels>"
        "<GPano:CroppedAreaLeftPixels>8</GPano:CroppedAreaLeftPixels>"
        "<GPano:CroppedAreaTopPixels>4</GPano:CroppedAreaTopPixels><x"
    )
    photo_sphere(tmp_path / "a.jpg", xmp=crop)
    records = read_panorama_records(tmp_path)
    assert records[0].heading_deg == 350.5
    assert (records[0].width_px, records[0].height_px) == (80, 40)
    assert image_loader(records)("a").shape == (40, 80, 3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"xmp": ""}, r"no Photo Sphere heading \(XMP GPano:PoseHeadingDegrees\)"),
        ({"xmp": POSE.replace('"0.0"', '"north"')}, r"`heading_deg` is 'north'"),
        ({"xmp": POSE.replace("-1.5", "95")}, r"`pitch_deg` is '95', expected degrees from -90"),
        ({"xmp": POSE + ' GPano:ProjectionType="cylindrical"'}, r"projection is 'cylindrical'"),
        ({"gps": {}}, r"no latitude in the EXIF GPS data"),
        ({"gps": {k: GPS[k] for k in (1, 2, 3, 4)}}, r"no altitude in the EXIF GPS data"),
        ({"gps": GPS | {2: (95.0, 0.0, 0.0)}}, r"`lat_deg` is -95\.0, expected a latitude"),
        ({"gps": GPS | {2: (95.0, 0.0)}}, r"`lat_deg` is nan, expected a latitude"),
        ({"width": 90}, r"got 90 x 32 px"),
    ],
)
def test_photo_spheres_with_wrong_metadata_are_refused(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    photo_sphere(tmp_path / "a.jpg", **changes)
    with pytest.raises(InputError, match=rf"a\.jpg.*{message}"):
        read_panorama_records(tmp_path)


def test_a_folder_without_panoramas_is_refused(street: Callable[..., Path]) -> None:
    folder = street(feature()).parent
    with pytest.raises(InputError, match=r"zero JPEG panoramas; did you mean .*panoramas\.geojson"):
        read_panorama_records(folder)


def test_two_files_of_one_stem_are_refused(tmp_path: Path) -> None:
    photo_sphere(tmp_path / "a.jpg")
    photo_sphere(tmp_path / "a.jpeg")
    with pytest.raises(InputError, match="id 'a' occurs twice"):
        read_panorama_records(tmp_path)


@pytest.mark.slow
@pytest.mark.skipif("SI3FP_TEST_DATA" not in os.environ, reason="SI3FP_TEST_DATA is not set")
def test_the_castle_street() -> None:
    castle = Path(os.environ["SI3FP_TEST_DATA"]) / "castle"
    records = read_panorama_records(castle / "street" / "panoramas.geojson")
    footprint_records = read_footprints(castle / "footprints.geojson")
    origin = run_origin(footprint_records, records)
    footprints = footprints_in_world(footprint_records, origin)
    selection = select_panoramas(records, footprints, origin, CollectConfig())
    assert len(records) == len(selection.records) == 30
    assert [footprint.id for footprint in footprints] == ["wing-a", "wing-b", "wing-c"]
    assert selection.notes == ()
    assert origin.height_m == pytest.approx(121.1)

    panoramas = panoramas_in_world(selection.records, origin)
    for record, panorama in zip(selection.records, panoramas, strict=True):
        back = geodetic_from_world(panorama.centre_in_world, origin)
        np.testing.assert_allclose(back[:2], [record.lat_deg, record.lon_deg], atol=1e-9)
        planes, plane_index = panorama.planes_in_pano, panorama.plane_index
        assert planes is not None
        assert plane_index is not None
        height, width = plane_index.shape
        assert (width, height) == (512, 256)
        for plane, (normal, offset) in enumerate(
            zip(planes.normals, planes.offsets_m, strict=True)
        ):
            rows, columns = np.nonzero(plane_index == plane)
            rays = directions_from_pixels(np.stack([columns, rows], -1) + 0.5, width, height)
            distances = ray_plane_distances(np.zeros(3), rays, normal, offset)
            # In front of the camera: never parallel, never behind.
            assert np.isfinite(distances).mean() > 0.99
            points = panorama.pano_from_world.inverse().apply(rays * distances[:, None])
            normal_in_world = panorama.pano_from_world.inverse().rotate(normal)
            if abs(normal_in_world[2]) > 0.9:
                # The court lies below the camera, within a metre of the footprints' ground.
                assert abs(np.nanmedian(points[:, 2])) < 1.0
                assert panorama.centre_in_world[2] > 1.0

    seen = seen_pixels(image_loader(selection.records)(records[0].id))
    assert seen.shape == (4096, 8192)
    assert 0.01 < seen.mean() < 0.1  # a photo of about 65 x 48 degrees on the sphere
