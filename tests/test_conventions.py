"""Every sentence of docs/conventions.md, with numbers computed by hand."""

from __future__ import annotations

import ast
import base64
import pkgutil
import re
import struct
from pathlib import Path

import numpy as np
import pyproj
import pytest
from PIL import Image as PillowImage

import si3fp
from si3fp.camera2d.placement import place_on_footprints
from si3fp.config import ClusterConfig, MeasureConfig, OrthoConfig, ThermalConfig
from si3fp.errors import InputError
from si3fp.evaluate import evaluate, facades_from_hbjson
from si3fp.geometry.enu import GeoOrigin, geodetic_from_world, world_from_geodetic
from si3fp.geometry.equirect import (
    directions_from_pixels,
    pixels_from_directions,
    world_from_pano_rotation,
)
from si3fp.geometry.facade_grid import FacadeGrid
from si3fp.geometry.pinhole import Pinhole
from si3fp.geometry.planes import Planes
from si3fp.geometry.rigid import Rigid3
from si3fp.geometry.similarity import Similarity3
from si3fp.model import Building, Detections, Facade, Footprint, OrthoImage, Panorama, Window
from si3fp.ortho import rectify
from si3fp.sources.colmap_text import read_colmap_text
from si3fp.sources.footprints import FootprintRecord, footprints_in_world
from si3fp.sources.images import seen_pixels
from si3fp.sources.local import PanoramaRecord, panoramas_in_world
from si3fp.sources.photo_sphere import panorama_frame, photo_sphere_row
from si3fp.sources.plane_map import decode_plane_map
from si3fp.sources.selection import run_origin
from si3fp.streetview.align import Registration, registered
from si3fp.streetview.cluster import cluster_walls
from si3fp.streetview.wall_planes import wall_indices
from si3fp.thermal.archetypes import archetype
from si3fp.thermal.assemble import assemble
from si3fp.windows.fuse import FusedDetections
from si3fp.windows.measure import measure_windows
from si3fp.workspace import Workspace, read_json, read_png, write_png

ROOT = Path(__file__).parents[1]
GOTHENBURG = GeoOrigin(57.70887, 11.97456, 10.0)
HALF, ROOT3_HALF = 0.5, np.sqrt(3) / 2  # sine and cosine of 30 degrees
SOUTH_WALL = Rigid3(  # x east, y up, z south
    np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), np.zeros(3)
)
HOUSE = Footprint(  # edge 0 looks south, 1 east, 2 north, 3 west
    "house", np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]]), 0.0, 6.0
)


def close(got, expected, tolerance=1e-12):
    np.testing.assert_allclose(got, expected, rtol=0, atol=tolerance)


def directions(heading_deg=0.0, pitch_deg=0.0, roll_deg=0.0):
    """World directions of the right side, the lower side and the centre of a panorama's image."""
    return world_from_pano_rotation(heading_deg, pitch_deg, roll_deg).T


def pano_record(height_m: float) -> PanoramaRecord:
    lat, lon, _ = geodetic_from_world([0.0, -10.0, 0.0], GOTHENBURG)
    angles = (0.0, 0.0, 0.0)
    return PanoramaRecord("p", float(lat), float(lon), height_m, *angles, Path("p.jpg"), 64, 32)


def footprint_record(ground_m: float) -> FootprintRecord:
    lat, lon, _ = geodetic_from_world(
        np.column_stack([HOUSE.outline_in_world, np.zeros(4)]), GOTHENBURG
    ).T
    return FootprintRecord("house", np.column_stack([lon, lat]), ground_m=ground_m)


def plane_map(index, planes) -> str:
    raw = np.array(index, np.uint8)
    head = struct.pack("<BHHHB", 8, len(planes), raw.shape[1], raw.shape[0], 8)
    table = b"".join(struct.pack("<4f", *plane) for plane in planes)
    return base64.urlsafe_b64encode(head + raw.tobytes() + table).decode().rstrip("=")


def panorama_before_a_wall(name: str, heading_deg: float, centre_in_world) -> Panorama:
    """A camera that looks straight at a wall 8 m ahead, which is 16 m wide and 4 m high."""
    rows, columns = np.mgrid[:64, :128] + 0.5
    rays = directions_from_pixels(np.stack([columns, rows], axis=-1), 128, 64)
    ahead = rays[..., 2] > 0.5
    hit = rays / np.where(ahead, rays[..., 2], 1.0)[..., None] * 8.0
    on_wall = ahead & (np.abs(hit[..., 0]) < 8.0) & (np.abs(hit[..., 1]) < 2.0)
    world_from_pano = Rigid3(
        world_from_pano_rotation(heading_deg, 0.0, 0.0), np.array(centre_in_world)
    )
    return Panorama(
        name,
        "",
        world_from_pano.inverse(),
        Planes([[0.0, 0.0, 1.0]], [8.0]),
        np.where(on_wall, 0, -1).astype(np.int32),
    )


def measured(box_px, grid, camera_in_facade, config):
    """The window of one detected box that one camera saw."""
    fused = FusedDetections(Detections([box_px], [0.9], ["window"]), (("p",),))
    (window,) = measure_windows(
        fused, Detections([], [], []), grid, {"p": np.array(camera_in_facade)}, config
    )
    return window


def modelled(origin: GeoOrigin, windows, outline, base_z_m=0.0):
    """The thermal model of a house whose edge 0 was seen; 6 m high, two storeys."""
    start, end = outline[0], outline[1]
    along = (end - start) / np.linalg.norm(end - start)
    rotation = np.array([[along[0], 0, along[1]], [along[1], 0, -along[0]], [0, 1, 0]])
    pose = Rigid3(rotation, np.array([*start, base_z_m]))
    facade = Facade("house-0", pose, float(np.linalg.norm(end - start)), 6.0, tuple(windows))
    building = Building("house", origin, outline, base_z_m, 6.0, 2, (facade,), year=1970)
    return assemble([building], {"house": archetype("SE", 1970, 1970)}, ThermalConfig()).hbjson


# Frames


def test_f1_world_is_east_north_up():
    # The radii of curvature of the ellipsoid at 60 degrees north are 6394209 m east-west and
    # 6383453 m north-south: 1e-4 degrees are 5.580 m (times cos 60) and 11.141 m.
    origin = GeoOrigin(60.0, 12.0, 10.0)
    close(world_from_geodetic([60.0, 12.0001, 10.0], origin), [5.580, 0, 0], 1e-3)
    close(world_from_geodetic([60.0001, 12.0, 10.0], origin), [0, 11.141, 0], 1e-3)
    close(world_from_geodetic([60.0, 12.0, 17.0], origin), [0, 0, 7.0], 1e-6)


def test_f2_north_is_true_north():
    # UTM zone 33 has its meridian at 15 degrees east; its grid turns by about
    # (11.97 - 15) * sin(57.7) = -2.56 degrees there.
    utm = pyproj.Transformer.from_crs(4326, 32633, always_xy=True)
    lat, lon, _ = geodetic_from_world([0.0, 100.0, 0.0], GOTHENBURG)
    assert lon == pytest.approx(GOTHENBURG.lon_deg, abs=1e-9)
    start = utm.transform(GOTHENBURG.lon_deg, GOTHENBURG.lat_deg)
    east, north = np.subtract(utm.transform(lon, lat), start)
    assert np.rad2deg(np.arctan2(east, north)) == pytest.approx(2.56, abs=0.02)


def test_f3_pano_is_right_down_forward():
    close(directions_from_pixels([50.0, 25.0], 100, 50), [0, 0, 1])  # centre of the image
    close(directions_from_pixels([75.0, 25.0], 100, 50), [1, 0, 0])  # a quarter to the right
    close(directions_from_pixels([50.0, 50.0], 100, 50), [0, 1, 0])  # lower border


def test_f4_facade_is_right_up_outward():
    camera = panorama_before_a_wall("p", 0.0, [5.0, -8.0, 2.0])  # looks north at the south wall
    (wall,) = cluster_walls([camera], [HOUSE], ClusterConfig()).walls
    close(wall.world_from_facade.apply([0, 0, 0]), [0, 0, 0], 1e-3)
    close(wall.world_from_facade.rotate([1, 0, 0]), [1, 0, 0], 1e-6)  # east is right from the south
    close(wall.world_from_facade.rotate([0, 1, 0]), [0, 0, 1], 1e-6)
    close(wall.world_from_facade.rotate([0, 0, 1]), [0, -1, 0], 1e-6)


def test_f5_img_starts_at_the_corner_of_the_first_pixel():
    grid = FacadeGrid(SOUTH_WALL, 100, 50, 0.1)
    close(grid.facade_from_pixels([0.0, 0.0]), [0.0, 5.0])  # upper left corner of the facade
    close(grid.facade_from_pixels([100.0, 50.0]), [10.0, 0.0])
    close(grid.facade_from_pixels([0.5, 0.5]), [0.05, 4.95])  # centre of the first pixel


def test_f6_b_from_a_turns_a_into_b():
    quarter_turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    b_from_a = Rigid3(quarter_turn, np.array([0.0, 0.0, 5.0]))
    c_from_b = Rigid3(np.eye(3), np.array([10.0, 0.0, 0.0]))
    point_in_a = np.array([1.0, 0.0, 0.0])
    point_in_b = b_from_a.apply(point_in_a)
    close(point_in_b, [0, 1, 5])
    c_from_a = c_from_b @ b_from_a
    close(c_from_a.apply(point_in_a), c_from_b.apply(point_in_b))
    close(c_from_a.apply(point_in_a), [10, 1, 5])


def test_f7_outside_is_on_the_right_of_an_edge():
    clockwise = footprint_record(0.0)
    clockwise.outline_deg[:] = clockwise.outline_deg[::-1].copy()
    (footprint,) = footprints_in_world([clockwise], GOTHENBURG)
    x, y = footprint.outline_in_world.T
    assert np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2 == pytest.approx(100, abs=1e-3)
    for start, end in footprint.edges():
        east, north = (end - start) / np.linalg.norm(end - start)
        right = np.array([north, -east])
        inside = footprint.outline_in_world.mean(axis=0)
        assert ((start + end) / 2 - inside) @ right == pytest.approx(5.0, abs=1e-3)


def test_f8_origin_is_the_centroid_of_the_footprints():
    low = np.array([[12.0, 57.0], [12.0002, 57.0], [12.0002, 57.0001], [12.0, 57.0001]])
    high = low + np.array([0.00022, 0.00002])
    footprints = [FootprintRecord("a", low, ground_m=7.5), FootprintRecord("b", high, ground_m=9.0)]
    # Centres at 12.0001 and 12.00032 east, 57.00005 and 57.00007 north: the means, to 1e-5.
    assert run_origin(footprints, []) == GeoOrigin(57.00006, 12.00021, 7.5)


def test_f9_origin_without_footprints_is_below_the_cameras():
    low, high = pano_record(14.0), pano_record(15.0)
    origin = run_origin([], [low, high])
    assert origin.height_m == 11.5
    assert origin.lat_deg == round(low.lat_deg, 5)


def test_f10_cameras_and_ground_share_a_datum():
    (panorama,) = panoramas_in_world([pano_record(13.0)], GOTHENBURG)
    (footprint,) = footprints_in_world([footprint_record(11.0)], GOTHENBURG)
    assert panorama.centre_in_world[2] == pytest.approx(3.0, abs=1e-4)  # 13 - 10
    assert footprint.ground_m == pytest.approx(1.0, abs=1e-4)  # 11 - 10
    # 5 km away the Earth curves 2 m below the world's plane, for the one as for the other.
    far = GeoOrigin(GOTHENBURG.lat_deg - 0.045, GOTHENBURG.lon_deg, GOTHENBURG.height_m)
    (panorama,) = panoramas_in_world([pano_record(13.0)], far)
    (footprint,) = footprints_in_world([footprint_record(11.0)], far)
    assert panorama.centre_in_world[2] - footprint.ground_m == pytest.approx(2.0, abs=0.02)


def test_f11_cam_is_right_down_forward():
    camera = Pinhole(100.0, 100.0, 320.0, 240.0, 640, 480)
    close(camera.project([0.0, 0.0, 5.0]), [320.0, 240.0])  # forward: the principal point
    close(camera.project([1.0, 0.0, 5.0]), [340.0, 240.0])  # right in the picture
    close(camera.project([0.0, 1.0, 5.0]), [320.0, 260.0])  # low in the picture
    assert np.isnan(camera.project([[0.0, 0.0, -5.0], [1.0, 1.0, 0.0]])).all()


def test_f12_a_similarity_scales_then_moves():
    quarter_turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    b_from_a = Similarity3(2.0, quarter_turn, np.array([10.0, 0.0, 0.0]))
    close(b_from_a.apply([1.0, 0.0, 3.0]), [10.0, 2.0, 6.0])
    cam_from_b = b_from_a.cam_from_b(Rigid3(np.eye(3), np.zeros(3)))
    close(cam_from_b.inverse().translation, [10.0, 0.0, 0.0])  # the origin of a, where it stood
    close(cam_from_b.apply([10.0, 2.0, 6.0]), [2.0, 0.0, 6.0])
    camera = Pinhole(100.0, 100.0, 320.0, 240.0, 640, 480)
    close(camera.project([2.0, 0.0, 6.0]), camera.project([1.0, 0.0, 3.0]))


def test_f13_colmap_poses_are_cam_from_world(tmp_path):
    (tmp_path / "cameras.txt").write_text("1 SIMPLE_PINHOLE 640 480 100 320 240\n")
    # 60 degrees about x, w first: y (down) turns towards z (forward).
    (tmp_path / "images.txt").write_text("1 0.8660254038 0.5 0 0 1 2 3 1 a.jpg\n\n")
    (photo,) = read_colmap_text(tmp_path).photos
    expected = [1.0, 2.0 + HALF, 3.0 + ROOT3_HALF]
    close(photo.cam_from_world.apply([0.0, 1.0, 0.0]), expected, 1e-9)


# Pixels


def test_p1_resampling_counts_from_pixel_corners():
    grid = FacadeGrid(SOUTH_WALL, 40, 40, 0.1)
    rgb = np.zeros((40, 40, 3), np.uint8)
    rgb[8:12, 4:8] = 200  # from x = 4 to 8 and y = 8 to 12: the middle is (6, 10)
    view = OrthoImage("p", rgb, np.ones((40, 40), bool))
    twice = np.diag([2.0, 2.0, 1.0])
    moved = registered(view, Registration("p", True, "", "similarity", twice), grid).rgb[..., 0]
    rows, columns = np.mgrid[:40, :40] + 0.5
    middle = [(moved * columns).sum() / moved.sum(), (moved * rows).sum() / moved.sum()]
    close(middle, [12.0, 20.0], 0.02)  # half a pixel of a wrong centre would be 0.5


def test_p2_equirectangular_pixels_are_angles():
    # x / W = 7/12 is yaw 30 degrees, y / H = 1/3 pitch 30 degrees.
    ray = [ROOT3_HALF * HALF, -HALF, ROOT3_HALF * ROOT3_HALF]
    close(directions_from_pixels([700.0, 200.0], 1200, 600), ray)
    close(pixels_from_directions(ray, 1200, 600), [700.0, 200.0], 1e-9)


def test_p3_a_panorama_is_twice_as_wide_as_high():
    assert panorama_frame({}, 8192, 4096, "a.jpg").full_width_px == 8192
    with pytest.raises(InputError, match=r"a\.jpg: .* twice as wide as high, got 8192 x 4000"):
        panorama_frame({}, 8192, 4000, "a.jpg")


def test_p4_facade_metres_count_from_the_bottom():
    grid = FacadeGrid(SOUTH_WALL, 500, 300, 0.02)
    close(grid.facade_from_pixels([100.0, 250.0]), [2.0, 1.0])  # (300 - 250) * 0.02
    close(grid.pixels_from_facade([2.0, 1.0]), [100.0, 250.0])


def test_p5_boxes_are_half_open():
    part = FacadeGrid(SOUTH_WALL, 500, 300, 0.02).cropped(10, 20, 30, 60)
    assert (part.width_px, part.height_px) == (20, 40)
    grid = FacadeGrid(SOUTH_WALL, 500, 300, 0.02)
    window = measured([10.0, 20.0, 60.5, 120.0], grid, [5, 3, 1e9], MeasureConfig())
    assert (window.width_m, window.height_m) == pytest.approx((1.01, 2.0))  # 50.5 and 100 px


def test_p6_arrays_are_rows_of_columns():
    grid = FacadeGrid.covering(SOUTH_WALL, 10.0, 4.0, 0.1)  # width, height
    assert (grid.width_px, grid.height_px) == (100, 40)
    looking_on = Rigid3(world_from_pano_rotation(0.0, 0.0, 0.0), np.array([5.0, -8.0, 2.0]))
    panorama = Panorama("p", "", looking_on.inverse())
    view = np.zeros((64, 128, 3), np.uint8)
    view[:, 64:] = 255  # the right half of the panorama: the east
    ortho = rectify(panorama, view, np.ones((64, 128), bool), grid, OrthoConfig())
    assert ortho.rgb.shape == (40, 100, 3)
    assert ortho.rgb[20, 25].tolist() == [0, 0, 0]
    assert ortho.rgb[20, 75].tolist() == [255, 255, 255]


def test_p7_images_are_rgb(tmp_path):
    red = np.zeros((4, 6, 3), np.uint8)
    red[..., 0] = 255
    write_png(tmp_path / "red.png", red)
    with PillowImage.open(tmp_path / "red.png") as stored:
        assert stored.mode == "RGB"
        assert stored.getpixel((0, 0)) == (255, 0, 0)
    assert read_png(tmp_path / "red.png")[0, 0].tolist() == [255, 0, 0]


def test_p8_black_at_the_border_was_not_seen():
    image = np.full((60, 120, 3), 120, np.uint8)
    image[:20] = 8  # touches the border
    image[40:45, 50:60] = 0  # dark glass
    seen = seen_pixels(image)
    assert not seen[27].any()  # 20 rows and 8 more
    assert seen[28].all()
    assert seen[42, 55]


def test_p9_pinhole_pixels_count_from_the_corner():
    camera = Pinhole(1000.0, 900.0, 320.0, 240.0, 640, 480)
    close(camera.project([0.2, -0.1, 2.0]), [420.0, 195.0])
    # Pixels of a camera that looks straight at a 640 x 480 m sheet, 1 m to a pixel: its upper left
    # square metre has its centre half a metre from both edges.
    sheet = Pinhole(100.0, 100.0, 320.0, 240.0, 640, 480)
    close(sheet.project([-320.0, -240.0, 100.0]), [0.0, 0.0])
    close(sheet.project([-319.5, -239.5, 100.0]), [0.5, 0.5])


def test_p10_pinhole_rays_have_unit_depth():
    camera = Pinhole(1000.0, 900.0, 320.0, 240.0, 640, 480)
    close(camera.unproject([420.0, 195.0]), [0.1, -0.05, 1.0])
    close(2.0 * camera.unproject([420.0, 195.0]), [0.2, -0.1, 2.0])


# Angles


def test_a1_heading_is_clockwise_from_north():
    close(directions(heading_deg=0.0)[2], [0, 1, 0])
    close(directions(heading_deg=90.0)[2], [1, 0, 0])
    close(directions(heading_deg=210.0)[2], [-HALF, -ROOT3_HALF, 0])


def test_a2_pitch_is_up():
    close(directions(pitch_deg=30.0)[2], [0, ROOT3_HALF, HALF])


def test_a3_roll_is_right_side_down():
    close(directions(roll_deg=30.0)[0], [ROOT3_HALF, 0, -HALF])


def test_a4_heading_then_pitch_then_roll():
    right, down, forward = directions(90.0, 30.0, 30.0)
    # Looking east and 30 degrees up, right is south and down is (sin 30, 0, -cos 30); the roll
    # turns these two in their own plane.
    unrolled_down = np.array([HALF, 0, -ROOT3_HALF])
    south = np.array([0, -1, 0])
    close(forward, [ROOT3_HALF, 0, HALF])
    close(right, ROOT3_HALF * south + HALF * unrolled_down)
    close(down, ROOT3_HALF * unrolled_down - HALF * south)


def test_a5_photo_sphere_angles_have_the_same_signs():
    tags = {"PoseHeadingDegrees": "90", "PosePitchDegrees": "10", "PoseRollDegrees": "-5"}
    gps = {1: "N", 2: (57.0, 30.0, 0.0), 3: "E", 4: (12.0, 0.0, 0.0), 5: b"\x00", 6: 20.0}
    row = photo_sphere_row(tags, gps, "2024:05:01 10:00:00", "a.jpg")
    got = [float(row[name]) for name in ("heading_deg", "pitch_deg", "roll_deg")]
    assert got == [90.0, 10.0, -5.0]


def test_a6_angles_are_named_in_degrees():
    angle = re.compile(r"(^|_)(heading|pitch|roll|yaw|lat|lon|bearing|obliqueness|angle)$|_rad$")
    wrong = []
    for path in sorted((ROOT / "src").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.arg] if isinstance(node, ast.arg) else []
            if isinstance(node, ast.ClassDef):
                fields = [line.target for line in node.body if isinstance(line, ast.AnnAssign)]
                names = [field.id for field in fields if isinstance(field, ast.Name)]
            # click names the arguments of a verb after its options --lat and --lon.
            verb = path.name == "cli.py"
            wrong += [f"{path.name}: {name}" for name in names if angle.search(name) and not verb]
    assert wrong == []


def test_a7_the_heading_of_a_placement_is_that_of_its_y_axis():
    corners = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 3.0], [4.0, 3.0], [4.0, 6.0], [0.0, 6.0]])
    edges = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    along = edges[:, 1] - edges[:, 0]
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
    # On the map the building is turned clockwise by 90 degrees: y of the walls points east.
    turned = np.stack([edges[..., 1], -edges[..., 0]], axis=-1)
    placement = place_on_footprints(edges, outward, turned)
    close(placement.heading_deg, 90.0, 1e-6)
    close(placement.world_from_level.rotate([0.0, 1.0, 0.0]), [1.0, 0.0, 0.0], 1e-6)


# Planes


def test_n1_offsets_keep_their_sign():
    plane_in_pano = Planes([[0.0, 0.0, 1.0]], [8.0])  # 8 m ahead
    world_from_pano = Rigid3(world_from_pano_rotation(0, 0, 0), np.array([0.0, -20.0, 2.0]))
    in_world = plane_in_pano.transformed(world_from_pano)
    close(in_world.normals, [[0, 1, 0]])  # still northwards, away from the camera
    close(in_world.offsets_m, [-12.0])  # the wall is at y = -20 + 8


def test_n2_outward_is_minus_the_normal():
    camera = panorama_before_a_wall("p", 90.0, [-8.0, 5.0, 2.0])  # looks east at the west wall
    assert camera.planes_in_pano is not None
    normal = camera.planes_in_pano.transformed(camera.pano_from_world.inverse()).normals[0]
    close(normal, [1, 0, 0])
    (wall,) = cluster_walls([camera], [HOUSE], ClusterConfig()).walls
    assert wall.facade_id == "house-3"
    close(wall.world_from_facade.rotation[:, 2], [-1, 0, 0], 1e-6)
    behind = plane_map([[1]], [(0, 0, 0, 0), (0, 1, 0, -8.0)])
    with pytest.raises(InputError, match="must be >= 0"):
        decode_plane_map(behind, "map")


def test_n3_plane_maps_are_in_image_order():
    planes = [(0, 0, 0, 0), (0, -1, 0, 5.0), (0, 0, 1, 3.0)]  # behind the camera, above it
    decoded, index = decode_plane_map(plane_map([[2, 2, 2, 2], [1, 0, 0, 1]], planes), "map")
    assert index.tolist() == [[1, 1, 1, 1], [0, -1, -1, 0]]
    first_column = directions_from_pixels([0.0, 1.0], 4, 2)  # yaw -180
    top_row = directions_from_pixels([2.0, 0.0], 4, 2)
    close(first_column, decoded.normals[0])
    close(top_row, decoded.normals[1])


def test_n4_plane_maps_are_right_forward_up():
    axes = [(0, 0, 0, 0), (1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1)]
    decoded, _ = decode_plane_map(plane_map([[0]], axes), "map")
    close(decoded.normals, [[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # right, forward, up in `pano`


def test_n5_plane_zero_is_no_plane():
    decoded, index = decode_plane_map(plane_map([[0, 1]], [(0, 0, 0, 0), (0, 1, 0, 8.0)]), "map")
    assert len(decoded) == 1
    assert index.tolist() == [[-1, 0]]


def test_n6_steep_normals_are_no_walls():
    limit_deg = 30.0  # sin 30 degrees = 0.5
    slopes = np.deg2rad([limit_deg - 1, limit_deg + 1])
    normals = np.stack([np.zeros(2), -np.sin(slopes), np.cos(slopes)], axis=-1)
    level = Rigid3(world_from_pano_rotation(0, 0, 0), np.zeros(3))
    panorama = Panorama(
        "p", "", level.inverse(), Planes(normals, [5.0, 5.0]), np.zeros((1, 1), np.int32)
    )
    assert wall_indices(panorama, ClusterConfig().horizontal_normal).tolist() == [0]


# Facades and windows


def test_w1_facade_ids_name_the_footprint_edge():
    camera = panorama_before_a_wall("p", 270.0, [18.0, 5.0, 2.0])  # looks west at the east wall
    clusters = cluster_walls([camera], [HOUSE], ClusterConfig())
    assert [wall.facade_id for wall in clusters.walls] == ["house-1"]
    assert [row.facade_id for row in clusters.missing] == ["house-0", "house-2", "house-3"]


def test_w2_walls_without_footprint_count_by_bearing():
    cameras = [  # the walls look where the cameras come from: west, east, south
        panorama_before_a_wall("to the east", 90.0, [100.0, 0.0, 2.0]),
        panorama_before_a_wall("to the west", 270.0, [0.0, 100.0, 2.0]),
        panorama_before_a_wall("to the north", 0.0, [-100.0, 0.0, 2.0]),
    ]
    walls = cluster_walls(cameras, [], ClusterConfig()).walls
    assert [wall.facade_id for wall in walls] == ["wall-0", "wall-1", "wall-2"]
    outward = [wall.world_from_facade.rotation[:2, 2] for wall in walls]
    close(outward, [[1, 0], [0, -1], [-1, 0]], 1e-6)  # bearings 90, 180, 270


def test_w3_windows_count_from_the_lower_left():
    grid = FacadeGrid(SOUTH_WALL, 500, 300, 0.02)
    window = measured([100.0, 50.0, 150.0, 150.0], grid, [5, 3, 1e9], MeasureConfig())
    assert (window.x_m, window.y_m) == pytest.approx((2.0, 3.0))  # (300 - 150) * 0.02
    corner = Facade("f", grid.world_from_facade, 10.0, 6.0, (window,)).world_from_facade
    close(corner.apply([window.x_m, window.y_m, 0.0]), [2.0, 0.0, 3.0], 1e-9)


def test_w4_edges_are_left_right_bottom_top():
    grid = FacadeGrid(SOUTH_WALL, 500, 300, 0.02)
    # A camera 10 m before the middle of a window of 2 x 2 m whose lower edge it looks along.
    window = measured([200.0, 100.0, 300.0, 200.0], grid, [5.0, 2.0, 10.0], MeasureConfig())
    left, right, bottom, top = window.correction_m
    recess_m = MeasureConfig().assumed_recess_m
    assert -left == pytest.approx(recess_m * 1.0 / 10.0, abs=1e-4)
    assert right == pytest.approx(recess_m * 1.0 / 10.0, abs=1e-4)
    assert bottom == 0.0
    assert top == pytest.approx(recess_m * 2.0 / 10.0, abs=1e-4)


def test_w5_corrections_were_added():
    grid = FacadeGrid(SOUTH_WALL, 500, 300, 0.02)
    box, camera = [200.0, 100.0, 300.0, 200.0], [5.0, 3.0, 10.0]
    window = measured(box, grid, camera, MeasureConfig())
    left, right, bottom, top = window.correction_m
    assert max(left, bottom) < 0 < min(right, top)
    assert window.x_m == pytest.approx(4.0 + left, abs=1e-4)
    assert window.x_m + window.width_m == pytest.approx(6.0 + right, abs=1e-4)
    assert window.y_m == pytest.approx(2.0 + bottom, abs=1e-4)
    assert window.y_m + window.height_m == pytest.approx(4.0 + top, abs=1e-4)


def test_w6_ratio_is_over_the_gross_area():
    windows = (Window(1.0, 1.0, 2.0, 1.5), Window(5.0, 0.0, 1.0, 2.0, label="balcony_door"))
    assert Facade("f", SOUTH_WALL, 10.0, 5.0, windows).wwr == pytest.approx(5.0 / 50.0)


def test_w7_parts_of_a_window_share_its_id():
    across_the_slab = Window(2.0, 2.0, 1.0, 2.0)  # the slab is at 3 m
    model = modelled(GOTHENBURG, [across_the_slab], HOUSE.outline_in_world)
    faces = [face for room in model["rooms"] for face in room["faces"]]
    walls = [face for face in faces if face["face_type"] == "Wall"]
    assert {wall["user_data"]["facade_id"] for wall in walls} == {f"house-{i}" for i in range(4)}
    parts = [part for wall in walls for part in wall.get("apertures") or []]
    assert len(parts) == 2
    assert len({part["user_data"]["window_id"] for part in parts}) == 1


def test_w8_models_of_two_origins_are_compared_in_one_world():
    windows = [Window(2.0, 1.0, 1.0, 1.2), Window(6.0, 1.0, 1.0, 1.2)]
    other = GeoOrigin(57.70887, 11.97456 + 0.001, 7.0)  # some 60 m east and 3 m lower
    shift = world_from_geodetic([57.70887, 11.97456, 10.0], other)
    here = modelled(GOTHENBURG, windows, HOUSE.outline_in_world)
    there = modelled(other, windows, HOUSE.outline_in_world + shift[:2], float(shift[2]))
    assert there["user_data"]["si3fp"]["origin"]["lon_deg"] == pytest.approx(11.97556)
    found_origin, found = facades_from_hbjson(here)
    true_origin, true = facades_from_hbjson(there)
    result = evaluate(found, true, found_origin, true_origin)
    assert result.windows_total.f1 == pytest.approx(1.0)
    assert result.windows_total.mean_abs_position_error_m == pytest.approx(0.0, abs=2e-3)


def test_w9_json_says_schema_and_version(tmp_path):
    workspace = Workspace(tmp_path)
    workspace.write_json(workspace.run_json, "run", {"seconds": {}})
    head = list(read_json(workspace.run_json).items())[:2]
    assert head == [("schema", "si3fp/run/1"), ("si3fp_version", si3fp.__version__)]


# The page itself


def test_every_sentence_has_a_test_and_every_test_a_sentence():
    page = (ROOT / "docs" / "conventions.md").read_text(encoding="utf-8")
    items = re.findall(r"^- \*\*(\w+)\*\* (.*?)(?=^- |^## |\Z)", page, re.MULTILINE | re.DOTALL)
    assert len(items) == len(re.findall(r"^- ", page, re.MULTILINE)), "an item without a number"
    named = []
    for number, text in items:
        sentence, *tests = re.split(r"`(test_\w+)`", text.strip())
        assert sentence.strip().endswith("."), f"{number} is no sentence"
        assert len(tests) == 2, f"{number} must name one test behind its sentence"
        assert tests[0].startswith(f"test_{number.lower()}_"), f"{number} names {tests[0]}"
        named.append(tests[0])
    numbered = re.compile(r"test_[a-z]\d+_")
    written = [name for name in globals() if numbered.match(name)]
    assert named == written


def test_the_nomenclature_names_what_exists():
    page = (ROOT / "docs" / "nomenclature.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1:-1] for line in page.splitlines() if line.startswith("|")][2:]
    assert len(rows) > 40
    for symbol, _, _, where in rows:
        place = where.strip().strip("`")
        try:
            pkgutil.resolve_name(f"si3fp.{place}")
        except (AttributeError, ImportError):
            pytest.fail(f"{symbol.strip()}: there is no si3fp.{place}")
