"""Plane maps: the byte layout, the frame, and every way in which one can be broken."""

import base64
import struct

import numpy as np
import pytest

from si3fp.errors import InputError
from si3fp.geometry.equirect import directions_from_pixels
from si3fp.geometry.planes import Planes, ray_plane_distances
from si3fp.sources.plane_map import decode_plane_map, encode_plane_map, pano_from_plane_frame

ZERO = (0.0, 0.0, 0.0, 0.0)
WALL = (0.0, 1.0, 0.0, 8.0)  # 8 m straight ahead: plane frame y is forward
GROUND = (0.0, 0.0, -1.0, 2.5)  # 2.5 m below: plane frame z is up


def plane_map_text(
    index: list[list[int]],
    planes: list[tuple[float, ...]],
    *,
    header: tuple[int, int] = (8, 8),
    count: int | None = None,
) -> str:
    """A plane map written by hand, independent of the encoder."""
    raw = np.array(index, np.uint8)
    content = struct.pack(
        "<BHHHB", header[0], len(planes) if count is None else count, *raw.shape[::-1], header[1]
    )
    content += raw.tobytes() + b"".join(struct.pack("<4f", *plane) for plane in planes)
    return base64.urlsafe_b64encode(content).decode().rstrip("=")


def test_planes_and_indices_of_a_map_written_by_hand() -> None:
    text = plane_map_text([[0, 1], [2, 2]], [ZERO, WALL, GROUND])
    planes, plane_index = decode_plane_map(text, "map")
    assert plane_index.tolist() == [[-1, 0], [1, 1]]
    assert plane_index.dtype == np.int32
    # Frame pano: x right, y down, z forward.
    np.testing.assert_allclose(planes.normals, [[0, 0, 1], [0, 1, 0]])
    np.testing.assert_allclose(planes.offsets_m, [8.0, 2.5])


def test_the_plane_frame_is_x_right_y_forward_z_up() -> None:
    axes = pano_from_plane_frame(np.eye(3))
    np.testing.assert_allclose(axes, [[1, 0, 0], [0, 0, 1], [0, -1, 0]])


def test_rays_of_a_planes_own_pixels_meet_it_in_front() -> None:
    planes, _ = decode_plane_map(plane_map_text([[0]], [ZERO, WALL, GROUND]), "map")
    ahead, down = directions_from_pixels([[256.0, 128.0], [256.0, 250.0]], 512, 256)
    assert ray_plane_distances(np.zeros(3), ahead, planes.normals[0], 8.0) == pytest.approx(8.0)
    assert ray_plane_distances(np.zeros(3), down, planes.normals[1], 2.5) > 2.5


def test_bytes_padding_and_line_ends_are_accepted() -> None:
    text = plane_map_text([[0, 1, 1]], [ZERO, WALL])
    padded = text + "=" * (-len(text) % 4) + "\r\n"
    for variant in (text.encode(), padded, padded.encode()):
        assert decode_plane_map(variant, "map")[1].tolist() == [[-1, 0, 0]]


def test_other_sizes_than_512_x_256_are_accepted() -> None:
    planes, plane_index = decode_plane_map(
        encode_plane_map(Planes([[0, 0, 1]], [3.0]), np.zeros((100, 300), np.int32)), "map"
    )
    assert plane_index.shape == (100, 300)
    assert len(planes) == 1


def test_planes_without_a_normal_are_dropped_and_the_others_move_up() -> None:
    text = plane_map_text([[0, 1, 2, 3]], [ZERO, WALL, ZERO, GROUND])
    planes, plane_index = decode_plane_map(text, "map")
    assert len(planes) == 2
    assert plane_index.tolist() == [[-1, 0, -1, 1]]


def test_255_planes_are_carried_and_256_refused() -> None:
    normals = np.tile([0.0, 0.0, 1.0], (256, 1))
    full = Planes(normals[:255], np.arange(255.0))
    plane_index = np.arange(-1, 255, dtype=np.int32).reshape(16, 16)
    planes, decoded = decode_plane_map(encode_plane_map(full, plane_index), "map")
    assert len(planes) == 255
    np.testing.assert_array_equal(decoded, plane_index)
    with pytest.raises(InputError, match="at most 255 planes, got 256; keep the largest"):
        encode_plane_map(Planes(normals, np.arange(256.0)), plane_index)
    with pytest.raises(InputError, match=r"announces 257 planes; .* at most 255 others"):
        decode_plane_map(plane_map_text([[0]], [ZERO] + [WALL] * 256), "map")


WHOLE = plane_map_text([[0, 1], [2, 2]], [ZERO, WALL, GROUND])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (WHOLE[:-8], r"cut short: 54 bytes, but 2 x 2 pixels and 3 planes make 60"),
        (WHOLE[:6], r"cut short: 4 bytes, its header alone has 8"),
        ("", r"cut short: 0 bytes"),
        (WHOLE + "AAAA", r"too long: 63 bytes"),
        ("no base64!", r"not URL-safe base64"),
        ("ä", r"not URL-safe base64"),
        (b"\xff\xfe", r"not URL-safe base64"),
        (plane_map_text([[0]], [ZERO], header=(9, 8)), r"header size 9 and offset 8, expected 8"),
        (plane_map_text([[0]], [ZERO], header=(8, 0)), r"header size 8 and offset 0, expected 8"),
        (plane_map_text([[0, 7]], [ZERO, WALL]), r"shows plane 7, but the map holds 2"),
        (plane_map_text([[0]], [], count=0), r"announces 0 planes"),
        (plane_map_text([[]], [ZERO]), r"no pixels \(0 x 1\)"),
        (plane_map_text([[1]], [ZERO, (0.0, np.nan, 0.0, 1.0)]), r"plane 1 contains NaN"),
        (plane_map_text([[1]], [ZERO, (0.0, 1.0, 0.0, np.inf)]), r"plane 1 contains NaN or inf"),
        (plane_map_text([[1]], [ZERO, WALL, (0.0, 2.0, 0.0, 1.0)]), r"plane 2 has length 2"),
        (plane_map_text([[1]], [ZERO, (0.0, 1.0, 0.0, -8.0)]), r"plane 1 lies at distance -8"),
    ],
)
def test_broken_maps_say_what_is_wrong_and_what_to_do(text: str | bytes, message: str) -> None:
    with pytest.raises(InputError, match=rf"^street/a\.b64: .*{message}") as caught:
        decode_plane_map(text, "street/a.b64")
    assert "Export or download the plane map again" in str(caught.value)


@pytest.mark.parametrize(
    ("planes", "plane_index", "message"),
    [
        (Planes([[0, 0, 1]], [-1.0]), np.zeros((2, 2), np.int32), r"distances >= 0, got -1"),
        (Planes([[0, 0, 1]], [1.0]), np.ones((2, 2), np.int32), r"runs from 1 to 1, .* 1 planes"),
        (Planes([[0, 0, 1]], [1.0]), np.full((2, 2), -2, np.int32), r"runs from -2"),
        (Planes([[0, 0, 1]], [1.0]), np.zeros((0, 2), np.int32), r"not empty, got \(0, 2\)"),
    ],
)
def test_what_the_format_cannot_hold_is_refused(
    planes: Planes, plane_index: np.ndarray, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        encode_plane_map(planes, plane_index)
