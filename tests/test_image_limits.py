"""Panorama images: limits before decoding, damaged files, formats, crops, what is not seen."""

import io
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from si3fp.config import CollectConfig
from si3fp.errors import InputError
from si3fp.sources.images import frame_of, load_panorama, read_header, seen_pixels

LIMIT = CollectConfig().max_pixels


def image_size(path, max_pixels):
    """Size of the full frame as the limits see it: from the header, nothing is decoded."""
    frame = frame_of(read_header(path), path, max_pixels)
    return frame.full_width_px, frame.full_height_px


def textured(width: int, height: int, seed: int = 0) -> NDArray[np.uint8]:
    coarse = np.random.default_rng(seed).integers(40, 220, (8, 16, 3), dtype=np.uint8)
    return np.asarray(Image.fromarray(coarse).resize((width, height), Image.Resampling.BILINEAR))


def jpeg_bytes(pixels: NDArray[np.uint8], *, xmp: str = "", **options: object) -> bytes:
    """A JPEG, with an XMP packet in an APP1 segment of its own."""
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "JPEG", quality=95, **options)
    content = stream.getvalue()
    if not xmp:
        return content
    packet = b"http://ns.adobe.com/xap/1.0/\x00" + xmp.encode()
    return content[:2] + b"\xff\xe1" + struct.pack(">H", len(packet) + 2) + packet + content[2:]


def png_announcing(width: int, height: int) -> bytes:
    """A PNG whose header announces a size that its data do not have."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        crc = struct.pack(">I", zlib.crc32(kind + data))
        return struct.pack(">I", len(data)) + kind + data + crc

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", b"") + chunk(b"IEND", b"")


def written(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def test_the_header_gives_the_size(tmp_path: Path) -> None:
    path = written(tmp_path, "a.jpg", jpeg_bytes(textured(256, 128)))
    assert image_size(path, LIMIT) == (256, 128)


def test_pixels_are_rgb_in_file_order(tmp_path: Path) -> None:
    pixels = textured(256, 128)
    loaded = load_panorama(written(tmp_path, "a.jpg", jpeg_bytes(pixels)), LIMIT)
    assert loaded.shape == (128, 256, 3)
    assert loaded.dtype == np.uint8
    # JPEG at quality 95 keeps smooth colours to a few levels.
    assert np.abs(loaded.astype(int) - pixels).mean() < 3
    red = np.zeros((128, 256, 3), np.uint8)
    red[..., 0] = 200
    for name in ("red.jpg", "red.png"):
        Image.fromarray(red).save(tmp_path / name)
        assert load_panorama(tmp_path / name, LIMIT)[64, 128].tolist() == pytest.approx(
            [200, 0, 0], abs=3
        )


def test_a_progressive_jpeg_is_read(tmp_path: Path) -> None:
    path = written(tmp_path, "a.jpg", jpeg_bytes(textured(256, 128), progressive=True))
    assert load_panorama(path, LIMIT).shape == (128, 256, 3)


def test_exif_orientation_is_ignored(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 3  # upside down
    pixels = textured(256, 128)
    path = written(tmp_path, "a.jpg", jpeg_bytes(pixels, exif=exif))
    assert np.abs(load_panorama(path, LIMIT).astype(int) - pixels).mean() < 3


def test_grey_16_bit_palette_and_transparent_pngs_become_rgb8(tmp_path: Path) -> None:
    grey = textured(256, 128)[..., 0]
    Image.fromarray(grey).save(tmp_path / "grey.png")
    Image.fromarray(grey.astype(np.uint16) * 257).save(tmp_path / "grey16.png")
    Image.fromarray(textured(256, 128)).quantize(200).save(tmp_path / "palette.png")
    for name in ("grey.png", "grey16.png"):
        loaded = load_panorama(tmp_path / name, LIMIT)
        np.testing.assert_array_equal(loaded, np.repeat(grey[..., None], 3, axis=-1))
    assert load_panorama(tmp_path / "palette.png", LIMIT).shape == (128, 256, 3)

    rgba = np.dstack([textured(256, 128), np.full((128, 256), 255, np.uint8)])
    rgba[:40, :, 3] = 0
    Image.fromarray(rgba).save(tmp_path / "alpha.png")
    loaded = load_panorama(tmp_path / "alpha.png", LIMIT)
    np.testing.assert_array_equal(loaded[40:], rgba[40:, :, :3])
    assert not loaded[:40].any()


@pytest.mark.parametrize("keep", [0.3, 0.6, 0.99])
@pytest.mark.parametrize("name", ["a.jpg", "a.png", "progressive.jpg"])
def test_a_truncated_image_is_refused(tmp_path: Path, name: str, keep: float) -> None:
    stream = io.BytesIO()
    options = {"progressive": True} if name.startswith("progressive") else {}
    noise = np.random.default_rng(0).integers(0, 255, (128, 256, 3), dtype=np.uint8)
    Image.fromarray(noise).save(stream, name[-3:].replace("jpg", "jpeg"), **options)
    content = stream.getvalue()
    path = written(tmp_path, name, content[: int(len(content) * keep)])
    with pytest.raises(InputError, match=f"{name}.*(truncated or damaged|header cannot be read)"):
        load_panorama(path, LIMIT)


def test_the_end_of_an_embedded_thumbnail_does_not_hide_a_truncation(tmp_path: Path) -> None:
    thumbnail = jpeg_bytes(textured(32, 16))
    content = jpeg_bytes(textured(256, 128))
    segment = b"\xff\xe1" + struct.pack(">H", len(thumbnail) + 8) + b"Exif\x00\x00" + thumbnail
    whole = content[:2] + segment + content[2:]
    assert load_panorama(written(tmp_path, "a.jpg", whole), LIMIT).shape == (128, 256, 3)
    with pytest.raises(InputError, match=r"b\.jpg: the image is truncated"):
        load_panorama(written(tmp_path, "b.jpg", whole[:-300]), LIMIT)


def test_a_file_whose_end_was_never_written_is_refused(tmp_path: Path) -> None:
    content = jpeg_bytes(textured(256, 128))
    half = len(content) // 2
    path = written(tmp_path, "a.jpg", content[:half] + bytes(len(content) - half))
    with pytest.raises(InputError, match=r"a\.jpg: the image is truncated"):
        load_panorama(path, LIMIT)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", r"is empty\. Copy or export the image again"),
        (b"just text", r"neither a JPEG nor a PNG image\. Copy or export"),
        (b"GIF89a" + bytes(100), r"neither a JPEG nor a PNG image"),
        (b"\xff\xd8\xff\xe0\x00\x10JF", r"header cannot be read .* Copy or export"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", r"header cannot be read"),
        (png_announcing(40_000, 20_000), r"40000 x 20000 px is beyond the limit .*Scale it down"),
        (png_announcing(16_386, 8_193), r"16386 x 8193 px is beyond the limit of 134,217,728"),
        (png_announcing(16_384, 8_192), r"truncated or damaged"),
    ],
)
def test_what_is_no_panorama_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = written(tmp_path, "a.jpg", content)
    with pytest.raises(InputError, match=rf"a\.jpg:? .*{message}"):
        load_panorama(path, LIMIT)


def test_a_missing_image_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no image .*nowhere\.jpg"):
        load_panorama(tmp_path / "nowhere.jpg", LIMIT)


def test_the_largest_panorama_of_the_paper_passes_the_header_check(tmp_path: Path) -> None:
    assert image_size(written(tmp_path, "a.png", png_announcing(16_384, 8_192)), LIMIT) == (
        16_384,
        8_192,
    )


def test_an_image_that_is_not_2_to_1_is_refused_with_its_size(tmp_path: Path) -> None:
    path = written(tmp_path, "a.jpg", jpeg_bytes(textured(256, 160)))
    with pytest.raises(InputError, match=r"a\.jpg: .*twice as wide as high, got 256 x 160 px"):
        image_size(path, LIMIT)
    # One pixel of rounding is no error.
    assert image_size(written(tmp_path, "b.png", png_announcing(2049, 1024)), LIMIT)[0] == 2049


CROP = (
    '<rdf:Description xmlns:GPano="http://ns.google.com/photos/1.0/panorama/" '
    'GPano:ProjectionType="equirectangular" GPano:FullPanoWidthPixels="400" '
    'GPano:FullPanoHeightPixels="200" GPano:CroppedAreaImageWidthPixels="{width}" '
    'GPano:CroppedAreaImageHeightPixels="{height}" GPano:CroppedAreaLeftPixels="{left}" '
    'GPano:CroppedAreaTopPixels="{top}"/>'
)


def test_a_cropped_panorama_is_placed_in_the_full_frame(tmp_path: Path) -> None:
    pixels = textured(300, 100)
    xmp = CROP.format(width=300, height=100, left=60, top=40)
    path = written(tmp_path, "a.jpg", jpeg_bytes(pixels, xmp=xmp))
    assert image_size(path, LIMIT) == (400, 200)
    loaded = load_panorama(path, LIMIT)
    assert loaded.shape == (200, 400, 3)
    assert np.abs(loaded[40:140, 60:360].astype(int) - pixels).mean() < 3
    loaded[40:140, 60:360] = 0
    assert not loaded.any()


def test_a_crop_that_was_scaled_after_tagging_is_scaled_too(tmp_path: Path) -> None:
    xmp = CROP.format(width=300, height=100, left=60, top=40)
    path = written(tmp_path, "a.jpg", jpeg_bytes(textured(150, 50), xmp=xmp))
    loaded = load_panorama(path, LIMIT)
    assert loaded.shape == (100, 200, 3)
    assert loaded[20:70, 30:180].min() > 20
    assert not loaded[:19].any()


@pytest.mark.parametrize(
    ("crop", "message"),
    [
        ({"width": 300, "height": 100, "left": 200, "top": 40}, r"leaves the full panorama 400 x"),
        ({"width": 100, "height": 100, "left": 0, "top": 0}, r"speaks of a crop of 100 x 100"),
        ({"width": 300, "height": 100, "left": -5, "top": 0}, r"CroppedAreaLeftPixels is '-5'"),
        ({"width": 0, "height": 100, "left": 0, "top": 0}, r"WidthPixels is '0', expected a whole"),
    ],
)
def test_a_crop_that_does_not_fit_is_refused(
    tmp_path: Path, crop: dict[str, int], message: str
) -> None:
    path = written(tmp_path, "a.jpg", jpeg_bytes(textured(300, 100), xmp=CROP.format(**crop)))
    with pytest.raises(InputError, match=rf"a\.jpg.*{message}"):
        load_panorama(path, LIMIT)


def test_xml_entities_are_not_expanded(tmp_path: Path) -> None:
    bomb = '<!DOCTYPE x [<!ENTITY a "1"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'
    xmp = bomb + "<GPano:PoseHeadingDegrees>&b;&b;</GPano:PoseHeadingDegrees>"
    path = written(tmp_path, "a.jpg", jpeg_bytes(textured(64, 32), xmp=xmp))
    assert read_header(path).gpano == {"PoseHeadingDegrees": "&b;&b;"}


def test_pixels_count_as_seen_unless_black_and_connected_to_the_border() -> None:
    image = np.full((200, 400, 3), 120, np.uint8)
    image[150:] = 0  # nadir: touches the border
    image[60:90, 100:130] = 0  # dark glass inside
    image[:, 380:] = 8  # still near-black
    image[:50, 200:220] = (9, 0, 0)  # one channel above the level
    seen = seen_pixels(image)
    expected = np.ones((200, 400), bool)
    expected[142:] = False
    expected[:, 372:] = False
    np.testing.assert_array_equal(seen, expected)


def test_a_black_image_shows_nothing_and_a_bright_one_everything() -> None:
    assert not seen_pixels(np.zeros((64, 128, 3), np.uint8)).any()
    assert seen_pixels(np.full((64, 128, 3), 9, np.uint8)).all()


READ_LARGEST = """
import resource, sys
from pathlib import Path
from si3fp.sources.images import load_panorama, seen_pixels
image = load_panorama(Path(sys.argv[1]), 16384 * 8192)
assert image.shape == (8192, 16384, 3)
assert not seen_pixels(image)[-1].any()
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="ru_maxrss is in KiB on Linux only")
def test_the_largest_panorama_is_read_within_the_memory_limit(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    pixels = np.full((8192, 16384, 3), 128, np.uint8)
    pixels[8000:] = 0
    Image.fromarray(pixels).save(path, quality=80)
    del pixels
    done = subprocess.run(
        [sys.executable, "-c", READ_LARGEST, str(path)], capture_output=True, check=True, text=True
    )
    assert int(done.stdout) / 2**20 < 2.5  # GiB
