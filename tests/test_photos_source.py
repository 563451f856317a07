"""A folder of photos: headers, GPS, turned photos, broken files, and the pixels that come out."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from si3fp.errors import InputError, SourceError
from si3fp.sources import photos as module
from si3fp.sources.images import load_picture, read_header
from si3fp.sources.photos import photo_loader, prepare_upright, read_photo_records

GPS, EXIF = 0x8825, 0x8769
PLACE = {1: "S", 2: (33.0, 51.0, 36.0), 3: "W", 4: (70.0, 30.0, 0.0), 5: b"\x00", 6: 520.5}


def picture(width=64, height=48):
    """Red on the left, blue on the right, the upper half brighter."""
    rgb = np.zeros((height, width, 3), np.uint8)
    rgb[:, : width // 2, 0] = 120
    rgb[:, width // 2 :, 2] = 120
    rgb[: height // 2] += 80
    return rgb


def save(file: Path, rgb=None, orientation=None, gps=None, details=None) -> Path:
    exif = Image.Exif()
    exif[0x010F], exif[0x0110] = "Maker", "Model X"
    if orientation:
        exif[0x0112] = orientation
    if gps is not None:
        exif[GPS] = gps
    exif[EXIF] = {0x920A: 4.2, 0xA405: 26, 0x9003: "2024:05:06 07:08:09", **(details or {})}
    image = Image.fromarray(picture() if rgb is None else rgb)
    image.save(file, quality=95, subsampling=0, exif=exif)
    return file


def truncated(file: Path) -> None:
    content = file.read_bytes()
    file.write_bytes(content[:-40])


@pytest.fixture
def folder(tmp_path):
    photos = tmp_path / "photos"
    photos.mkdir()
    for name in ("b.jpg", "a.jpg", "c.JPEG"):
        save(photos / name)
    return photos


def as_it_is(_, image):
    return image


def test_records_tell_what_the_headers_say(folder):
    save(folder / "d.jpg", orientation=6, gps=PLACE)
    (folder / "notes.txt").write_text("no photo")
    (folder / "._a.jpg").write_bytes(b"left by a Mac")
    (folder / "more").mkdir()
    read = read_photo_records(folder)
    assert [record.id for record in read.records] == ["a.jpg", "b.jpg", "c.JPEG", "d.jpg"]
    assert read.unreadable == {}
    first, *_, last = read.records
    assert (first.width_px, first.height_px, first.orientation) == (64, 48, 1)
    assert (last.width_px, last.height_px, last.orientation) == (48, 64, 6)
    assert (first.camera, first.focal_mm, first.focal_35mm) == ("Maker Model X", 4.2, 26)
    assert first.captured == "2024-05-06"
    assert first.gps is None
    assert last.gps == pytest.approx((-33.86, -70.5, 520.5))


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({6: None}, (-33.86, -70.5, None)),
        ({5: b"\x01"}, (-33.86, -70.5, -520.5)),
        ({9: "V"}, None),  # the receiver had no fix
        ({2: (0.0, 0.0, 0.0), 4: (0.0, 0.0, 0.0)}, None),
        ({2: (97.0, 0.0, 0.0)}, None),
        ({2: None}, None),
        ({1: "N", 3: "E"}, (33.86, 70.5, 520.5)),
    ],
)
def test_gps_that_cannot_be_is_none(folder, changes, expected):
    gps = {tag: value for tag, value in (PLACE | changes).items() if value is not None}
    save(folder / "a.jpg", gps=gps)
    found = read_photo_records(folder).records[0].gps
    assert found == (expected if expected is None else pytest.approx(expected))


def test_unreadable_photos_are_listed_while_three_remain(folder):
    truncated(save(folder / "x.jpg"))
    (folder / "y.png").write_bytes(b"")
    (folder / "z.jpg").write_bytes(b"GIF89a...")
    read = read_photo_records(folder)
    assert [record.id for record in read.records] == ["a.jpg", "b.jpg", "c.JPEG"]
    assert "truncated or damaged" in read.unreadable["x.jpg"]
    assert read.unreadable["y.png"].startswith("is empty")
    assert "neither a JPEG nor a PNG" in read.unreadable["z.jpg"]
    truncated(folder / "a.jpg")
    with pytest.raises(InputError, match=r"holds 2 photos that can be read, 3 are.*a\.jpg: the im"):
        read_photo_records(folder)


def test_a_photo_beyond_the_limit_is_not_decoded(folder):
    with pytest.raises(InputError, match=r"holds 0 photos.*beyond the limit of 3,000 pixels"):
        read_photo_records(folder, max_pixels=3000)


def test_a_panorama_is_no_photo(folder):
    image = Image.fromarray(picture())
    xmp = b'<x GPano:ProjectionType="equirectangular" GPano:PoseHeadingDegrees="3"/>'
    image.save(folder / "p.jpg", xmp=xmp)
    assert "si3fp street" in read_photo_records(folder).unreadable["p.jpg"]


def test_folders_that_hold_no_photos_say_what_they_hold(tmp_path):
    with pytest.raises(InputError, match="There is no folder"):
        read_photo_records(tmp_path / "nowhere")
    file = save(tmp_path / "a.jpg")
    with pytest.raises(InputError, match=r"is a file\. Give the folder"):
        read_photo_records(file)
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(InputError, match=r"holds no JPEG or PNG photo\. Export"):
        read_photo_records(empty)
    for name in ("a.HEIC", "b.heic"):
        (empty / name).touch()
    with pytest.raises(InputError, match=r"photo \(2 x \.heic\)\. Export the photos as JPEG"):
        read_photo_records(empty)


@pytest.mark.parametrize("twin", ["A.JPG", "a.png", "A.jpeg"])
def test_names_that_differ_in_case_or_ending_only_are_refused(folder, twin):
    save(folder / twin)
    if len(list(folder.iterdir())) == 3:
        pytest.skip("this disk does not tell cases apart")
    with pytest.raises(InputError, match=r"(?i)a\.jpe?g and a\.(jpg|png)\. Remove or"):
        read_photo_records(folder)


# Pixels


@pytest.mark.parametrize("orientation", range(1, 9))
def test_turned_photos_come_out_upright(tmp_path, orientation):
    upright = picture()
    # How each orientation stores an upright picture (EXIF 2.3, table 6): row 0 and column 0.
    stored = {
        1: upright, 2: upright[:, ::-1], 3: upright[::-1, ::-1], 4: upright[::-1],
        5: upright.transpose(1, 0, 2), 6: upright.transpose(1, 0, 2)[::-1],
        7: upright.transpose(1, 0, 2)[::-1, ::-1], 8: upright.transpose(1, 0, 2)[:, ::-1],
    }[orientation]  # fmt: skip
    for name in ("a.jpg", "b.jpg", "c.jpg"):
        save(tmp_path / name, stored, orientation)
    records = read_photo_records(tmp_path).records
    assert (records[0].width_px, records[0].height_px) == (64, 48)
    load = photo_loader(records, as_it_is)
    np.testing.assert_allclose(load("b.jpg").astype(int), upright, atol=12)
    prepare_upright(records, tmp_path / "run")
    for record in records:
        prepared = tmp_path / "run" / record.id
        assert read_header(prepared).orientation == 1
        again = load_picture(prepared, 10**6).astype(int)
        sides = np.r_[:28, 36:64]  # the colours of a JPEG run over the border
        np.testing.assert_allclose(again[:, sides], upright[:, sides], atol=12)


def test_upright_photos_are_linked_once_and_strangers_removed(folder, tmp_path):
    save(folder / "d.jpg", orientation=8)
    records = read_photo_records(folder).records
    run = tmp_path / "run"
    prepare_upright(records, run)
    assert (run / "a.jpg").samefile(folder / "a.jpg")
    before = {file.name: file.stat().st_mtime_ns for file in run.iterdir()}
    prepare_upright(records[1:], run)
    after = {file.name: file.stat().st_mtime_ns for file in run.iterdir()}
    assert after == {name: before[name] for name in ("b.jpg", "c.JPEG", "d.jpg")}
    assert (folder / "a.jpg").exists()


def test_a_photo_that_was_replaced_is_prepared_again(folder, tmp_path):
    save(folder / "a.jpg", orientation=3)
    records = read_photo_records(folder).records
    prepare_upright(records, tmp_path / "run")
    save(folder / "a.jpg", np.full((48, 64, 3), 200, np.uint8), orientation=3)
    later = (tmp_path / "run" / "a.jpg").stat().st_mtime + 10
    os.utime(folder / "a.jpg", (later, later))
    prepare_upright(records, tmp_path / "run")
    assert load_picture(tmp_path / "run" / "a.jpg", 10**6).min() > 190


def test_without_links_photos_are_copied(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(module.os, "link", lambda *_: (_ for _ in ()).throw(OSError("no links")))
    prepare_upright(read_photo_records(folder).records, tmp_path / "run")
    assert not (tmp_path / "run" / "a.jpg").samefile(folder / "a.jpg")
    assert (tmp_path / "run" / "a.jpg").read_bytes() == (folder / "a.jpg").read_bytes()


def test_the_photos_themselves_are_never_touched(folder, tmp_path):
    records = read_photo_records(folder).records
    with pytest.raises(InputError, match="in another folder"):
        prepare_upright(records, folder)
    assert len(list(folder.iterdir())) == 3
    (tmp_path / "file").touch()
    with pytest.raises(SourceError, match="Could not write upright photos"):
        prepare_upright(records, tmp_path / "file")


def test_the_loader_undistorts_once_and_keeps_what_fits(folder):
    calls = []

    def halved(photo_id, image):
        calls.append(photo_id)
        return np.ascontiguousarray(cv2.resize(image, (32, 24)))

    records = read_photo_records(folder).records
    load = photo_loader(records, halved, cache_bytes=2 * 32 * 24 * 3)
    assert load("a.jpg").shape == (24, 32, 3)
    load("b.jpg")
    assert load("a.jpg") is load("a.jpg")
    load("c.JPEG")  # b is the one used longest ago
    load("a.jpg")
    assert calls == ["a.jpg", "b.jpg", "c.JPEG"]
    load("b.jpg")
    assert calls == ["a.jpg", "b.jpg", "c.JPEG", "b.jpg"]
    with pytest.raises(ValueError, match="read-only"):
        load("a.jpg")[0, 0] = 0
    with pytest.raises(InputError, match="no photo 'z' among the 3"):
        load("z")


def test_the_loader_serves_several_threads(folder):
    load = photo_loader(read_photo_records(folder).records, as_it_is, cache_bytes=20_000)
    with ThreadPoolExecutor(4) as pool:
        loaded = list(pool.map(load, ["a.jpg", "b.jpg", "c.JPEG"] * 20))
    assert all(np.array_equal(image, loaded[0]) for image in loaded)


def test_a_read_only_photo_can_be_warped(folder):
    image = photo_loader(read_photo_records(folder).records, as_it_is)("a.jpg")
    map_x, map_y = np.meshgrid(np.arange(64, dtype=np.float32), np.arange(48, dtype=np.float32))
    assert np.array_equal(cv2.remap(image, map_x, map_y, cv2.INTER_LINEAR), image)
