"""C.1, the capture check: rendered views of painted walls whose faults and overlaps are known."""

from __future__ import annotations

import json
import os
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from si3fp import cli
from si3fp.camera2d.advice import span
from si3fp.camera2d.capture import judge
from si3fp.camera2d.facts import PhotoFacts
from si3fp.camera2d.overlap import (
    Overlap,
    WeakLink,
    candidate_pairs,
    components,
    features_of,
    find_overlaps,
    weak_links,
)
from si3fp.camera2d.quality import blur_px, clipped_shares
from si3fp.config import CaptureConfig
from si3fp.errors import InputError
from si3fp.sources.images import load_picture, read_header
from si3fp.steps import check_photos

WIDTH, HEIGHT = 900, 640
CONFIG = CaptureConfig(good_pixels=500_000, match_side_px=640, max_features=500)  # for speed


def painted_wall(seed: int, width: int = 2600, height: int = 900) -> np.ndarray:
    """Overlapping rectangles of all sizes and tones: sharp edges in both directions."""
    rng = np.random.default_rng(seed)
    wall = np.full((height, width), 128, np.uint8)
    for size in (200, 80, 30, 12):
        for _ in range(4 * width * height // size**2 // 8):
            x, y = rng.integers(0, width), rng.integers(0, height)
            w, h = rng.integers(size // 3, size, 2)
            wall[y : y + h, x : x + w] = rng.integers(30, 225)
    return wall


def view(wall: np.ndarray, x: float, turn: float = 0.0) -> np.ndarray:
    """A photo of the wall whose left edge is at x; ``turn`` in px shortens its right side."""
    on_wall = np.float32([[x, 50], [x + WIDTH, 50], [x + WIDTH, 50 + HEIGHT], [x, 50 + HEIGHT]])
    here = np.float32([[0, 0], [WIDTH, turn], [WIDTH, HEIGHT - turn], [0, HEIGHT]])
    homography = cv2.getPerspectiveTransform(on_wall, here)
    return cv2.warpPerspective(
        wall, homography, (WIDTH, HEIGHT), flags=cv2.INTER_AREA, borderMode=cv2.BORDER_REFLECT
    )


def save(folder: Path, name: str, grey: np.ndarray, **options: object) -> Path:
    folder.mkdir(exist_ok=True)
    Image.fromarray(grey).convert("RGB").save(folder / name, quality=92, **options)
    return folder / name


@pytest.fixture(scope="module")
def wall():
    return painted_wall(1)


@pytest.fixture(scope="module")
def round_of_six(tmp_path_factory, wall):
    """Six good photos, each repeating three quarters of the one before."""
    folder = tmp_path_factory.mktemp("six")
    for number in range(6):
        save(folder, f"{number}.jpg", view(wall, 220 * number, turn=10 * (number % 3)))
    return folder


@pytest.fixture
def photos(round_of_six, tmp_path):
    return Path(shutil.copytree(round_of_six, tmp_path / "photos"))


def ratings(check):
    return {photo.name: photo.rating for photo in check.verdict.photos}


def reasons(check, name):
    return " ".join(next(p for p in check.verdict.photos if p.name == name).reasons)


def grey_of(path):
    return np.asarray(Image.open(path).convert("L"))


# Measures on one photo


@pytest.mark.parametrize("sigma_px", [1.5, 2.0, 3.0, 5.0])
def test_blur_is_measured_in_pixels(wall, sigma_px):
    blurred = cv2.GaussianBlur(view(wall, 0), (0, 0), sigma_px)
    # Edges nearer to each other than the blur is wide make it look smaller or larger.
    assert blur_px(blurred) == pytest.approx(sigma_px, rel=0.3)


def test_blur_does_not_depend_on_contrast(wall):
    blurred = cv2.GaussianBlur(view(wall, 0), (0, 0), 2)
    faint = (100 + 0.4 * (blurred.astype(float) - 100)).astype(np.uint8)
    assert blur_px(faint) == pytest.approx(blur_px(blurred), abs=0.2)


@pytest.mark.parametrize("direction", ["x", "y", "diagonal"])
def test_motion_in_one_direction_is_blur(wall, direction):
    kernel = np.zeros((15, 15), np.float32)
    kernel[{"x": (7, slice(None)), "y": (slice(None), 7), "diagonal": np.diag_indices(15)}[direction]] = 1 / 15  # noqa: E501  # fmt: skip
    sharp = view(wall, 0)
    assert blur_px(sharp) < 0.6
    assert blur_px(cv2.filter2D(sharp, -1, kernel)) > 1.8


def test_a_photo_without_edges_is_as_blurred_as_can_be():
    assert blur_px(np.full((100, 100), 90, np.uint8)) == 20


def test_clipped_shares_leave_out_the_sky():
    grey = np.full((100, 100), 128, np.uint8)
    grey[:40] = 255  # sky
    grey[60:75, 10:30] = 255  # 300 of 6000
    grey[80:86, 10:20] = 0  # 60 of 6000
    assert clipped_shares(grey) == (pytest.approx(0.01), pytest.approx(0.05))
    grey[:80] = 255
    assert clipped_shares(grey)[1] > 0.7  # mostly white is no sky


# The overlap graph


def links(*pairs):
    return [Overlap(a, b, 50, 0.4, 0.2) for a, b in pairs]


def test_components_are_the_groups_that_hang_together():
    assert components(6, links((0, 1), (1, 2), (4, 5))) == [(0, 1, 2), (4, 5), (3,)]
    assert components(0, []) == []


def test_a_photo_that_alone_connects_two_groups_is_a_weak_link():
    bow_tie = links((0, 1), (0, 2), (1, 2), (2, 3), (2, 4), (3, 4), (3, 5), (4, 5))
    assert weak_links(6, bow_tie) == [WeakLink(2, (0, 1))]
    assert weak_links(4, links((0, 1), (1, 2), (2, 3), (0, 3))) == []
    # The end of a chain is a photo with few neighbours, not a group.
    assert weak_links(3, links((0, 1), (1, 2))) == []


def test_overlaps_tell_how_far_the_picture_moved(wall):
    config = CaptureConfig()
    places = [0, 90, 450, 1700]
    features = [features_of(view(wall, x), config) for x in places]
    found = {(pair.first, pair.second): pair for pair in find_overlaps(features, config)}
    assert set(found) == {(0, 1), (0, 2), (1, 2)}
    for (first, second), pair in found.items():
        shift = (places[second] - places[first]) / WIDTH
        assert pair.moved == pytest.approx(shift, abs=0.002)  # of the width: 2 px
        assert pair.share == pytest.approx(1 - shift, abs=0.12)  # one column of cells


def test_among_many_photos_the_pairs_that_overlap_are_candidates(wall):
    config = replace(CaptureConfig(), all_pairs_up_to=4, best_partners=2, followers=1)
    order = [0, 850, 1700, 100, 950, 1600]  # every photo's partner is three photos later
    features = [features_of(view(wall, x), config) for x in order]
    pairs = candidate_pairs(features, config)
    assert len(pairs) < 15
    assert {(0, 3), (1, 4), (2, 5)} <= set(pairs)


# The judgement


def fact(name, **changes):
    good = PhotoFacts(name, name, 3000, 2000, "Maker M", 24.0, None, True, 0.5, 0.0, 0.0)
    return replace(good, **changes)


def judged(facts, pairs=None):
    everything = [(a, b) for b in range(len(facts)) for a in range(b)]
    return judge(facts, links(*(everything if pairs is None else pairs)), {}, CaptureConfig())


def test_blur_counts_against_photos_of_the_same_camera_and_size():
    soft = [fact(f"s{n}", camera="Soft", blur_px=2.0) for n in range(3)]
    sharp = [fact(f"t{n}") for n in range(3)]
    assert {photo.rating for photo in judged([*soft, *sharp]).photos} == {"ok"}
    worse = judged([*sharp, fact("u", blur_px=2.0)])
    assert [photo.name for photo in worse.photos if photo.rating == "retake"] == ["u"]
    assert worse.ready


def test_sharpened_photos_are_no_measure_for_plain_ones():
    sharpened = [fact(f"s{n}", blur_px=0.0) for n in range(5)]
    assert {photo.rating for photo in judged([*sharpened, fact("t", blur_px=0.7)]).photos} == {"ok"}


def test_one_photo_at_another_zoom_is_named_and_turned_ones_are_not():
    facts = [fact(str(n)) for n in range(4)]
    facts += [fact("turned", width_px=2000, height_px=3000), fact("zoomed", focal_mm=70.0)]
    verdict = judged(facts)
    assert [photo.name for photo in verdict.photos if photo.rating != "ok"] == ["zoomed"]
    assert "70 mm" in verdict.photos[-1].reasons[0]
    assert any("1 upright and 5 lying" in note for note in verdict.notes)


def test_missing_focal_length_and_positions_are_notes():
    facts = [fact(str(n), focal_mm=None, has_gps=False) for n in range(4)]
    verdict = judged(facts)
    assert verdict.ready
    assert all(photo.rating == "ok" for photo in verdict.photos)
    assert any("4 of 4 photos do not tell their focal length" in note for note in verdict.notes)
    assert any("0 of 4 photos tell their position" in note for note in verdict.notes)


def test_where_photos_are_missing():
    facts = [fact(f"{n}.jpg") for n in range(7)]
    verdict = judged(facts, [(0, 1), (1, 2), (0, 2), (3, 4), (4, 5), (3, 5)])
    assert not verdict.ready
    assert verdict.groups == (
        ("0.jpg", "1.jpg", "2.jpg"), ("3.jpg", "4.jpg", "5.jpg"), ("6.jpg",),
    )  # fmt: skip
    assert any("on the way from 2.jpg to 3.jpg" in line for line in verdict.to_do)
    assert verdict.photos[-1].rating == "retake"
    assert "nothing that another photo shows" in verdict.photos[-1].reasons[0]


def test_a_good_photo_that_repeats_a_blurred_one_is_ok():
    facts = [fact("blurred", blur_px=3.0), *(fact(f"good {n}") for n in range(4))]
    twins = [Overlap(a, b, 50, 0.9, 0.002 if a == 0 else 0.2) for b in range(5) for a in range(b)]
    verdict = judge(facts, twins, {}, CaptureConfig())
    assert [photo.rating for photo in verdict.photos] == ["retake", "ok", "ok", "ok", "ok"]


def test_a_photo_to_retake_connects_nothing():
    facts = [fact("a"), fact("b"), fact("c", white=0.5), fact("d"), fact("e")]
    verdict = judged(facts, [(0, 1), (0, 2), (1, 2), (2, 3), (2, 4), (3, 4)])
    assert verdict.groups == (("a", "b"), ("d", "e"))
    assert not verdict.ready


def test_a_weak_link_and_a_chain_are_told():
    bow_tie = [(0, 1), (0, 2), (1, 2), (2, 3), (2, 4), (3, 4), (3, 5), (4, 5)]
    verdict = judged([fact(name) for name in "abcdef"], bow_tie)
    assert verdict.ready
    assert verdict.weak == (("c", ("a", "b")),)
    assert any(line.startswith("c alone connects a to b (2 photos)") for line in verdict.to_do)
    chain = judged([fact(f"{n:02}") for n in range(12)], [(n, n + 1) for n in range(11)])
    assert any("chain: 02 to 09 (8 photos)" in line for line in chain.to_do)


def test_span_joins_runs():
    assert span(["a", "b", "c", "d"], [3]) == "d (1 photo)"


# Whole folders


def test_good_photos_are_ready_and_the_file_is_the_same_each_time(round_of_six, tmp_path):
    said = []
    results = [
        check_photos(
            round_of_six, tmp_path / name, config=CONFIG,
            progress=lambda step, done, total: said.append((step, done, total)),
        )
        for name in ("first.json", "second.json")
    ]  # fmt: skip
    assert set(ratings(results[0]).values()) == {"ok"}
    assert results[0].verdict.ready
    assert (tmp_path / "first.json").read_bytes() == (tmp_path / "second.json").read_bytes()
    held = json.loads((tmp_path / "first.json").read_text())
    assert held["schema"].startswith("si3fp/capture/")
    assert len(held["inputs"]) == 6
    assert {("photos", 6, 6), ("overlap", 15, 15)} <= set(said)


def test_bad_photos_are_named_and_good_ones_are_not(photos):
    blurred = cv2.GaussianBlur(grey_of(photos / "2.jpg"), (0, 0), 2.5)
    save(photos, "blurred.jpg", blurred)
    bright = np.clip(grey_of(photos / "3.jpg").astype(int) * 3 // 2 + 60, 0, 255).astype(np.uint8)
    save(photos, "bright.jpg", bright)
    content = (photos / "4.jpg").read_bytes()
    (photos / "cut.jpg").write_bytes(content[: len(content) // 2])
    save(photos, "tiny.jpg", cv2.resize(grey_of(photos / "1.jpg"), None, fx=0.4, fy=0.4))
    check = check_photos(photos, config=CONFIG)
    by_name = ratings(check)
    assert {name for name, rating in by_name.items() if rating == "retake"} == {
        "blurred.jpg", "bright.jpg", "cut.jpg", "tiny.jpg",
    }  # fmt: skip
    assert {by_name[f"{n}.jpg"] for n in range(6)} == {"ok"}
    assert "blurred by 2." in reasons(check, "blurred.jpg").replace("edges by", "blurred by")
    assert "overexposed" in reasons(check, "bright.jpg")
    assert "truncated" in reasons(check, "cut.jpg")
    assert "360 x 256 px" in reasons(check, "tiny.jpg")
    assert check.verdict.ready
    assert "10 photos (6 ok, 0 to check, 4 to retake): ready, without" in check.summary


def test_repeated_photos_are_named(photos, wall):
    shutil.copy(photos / "5.jpg", photos / "copy.jpg")
    save(photos, "near.jpg", view(wall, 3))
    check = check_photos(photos, config=CONFIG)
    assert {name for name, rating in ratings(check).items() if rating != "ok"} == {
        "copy.jpg", "near.jpg",
    }  # fmt: skip
    assert "repeats 5.jpg (the same file)" in reasons(check, "copy.jpg")
    assert "repeats 0.jpg (the picture moved by 0.3%" in reasons(check, "near.jpg")


def test_two_walls_are_two_groups(photos, monkeypatch, capsys, tmp_path):
    other = painted_wall(2)
    for number in range(3):
        save(photos, f"other-{number}.jpg", view(other, 150 * number))
    out = tmp_path / "check.json"
    words = ["si3fp", "photos", "--check", str(photos), "-o", str(out)]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert stop.value.code == 3
    printed = capsys.readouterr().out
    assert "2 groups that show nothing in common" in printed
    assert "group 2: other-0.jpg to other-2.jpg (3 photos)" in printed
    assert "on the way from 5.jpg to other-0.jpg" in printed
    assert printed.splitlines()[-1].endswith("NOT ready")
    held = json.loads(out.read_text())
    assert held["ready"] is False
    assert [len(group) for group in held["groups"]] == [6, 3]


def test_what_cannot_be_checked(tmp_path, photos):
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no JPEG or PNG"):
        check_photos(tmp_path / "empty")
    with pytest.raises(InputError, match="is not a folder"):
        check_photos(tmp_path / "nowhere")
    foreign = tmp_path / "notes.json"
    foreign.write_text("{}")
    with pytest.raises(InputError, match="never replaced"):
        check_photos(photos, foreign, overwrite=True)


def test_unreadable_photos_alone_are_an_answer(tmp_path):
    (tmp_path / "a.jpg").write_bytes(b"")
    check = check_photos(tmp_path)
    assert ratings(check) == {"a.jpg": "retake"}
    assert not check.verdict.ready


# What the image reader tells


def test_focal_length_camera_and_orientation_are_read(tmp_path):
    exif = Image.Exif()
    exif[0x010F], exif[0x0110], exif[0x0112] = "Maker", "M 1", 6
    exif.get_ifd(0x8769)[0x920A] = 4.5
    exif.get_ifd(0x8769)[0xA405] = 26
    path = save(tmp_path, "turned.jpg", painted_wall(3, 1000, 600), exif=exif)
    header = read_header(path)
    assert (header.camera, header.focal_mm, header.focal_35mm) == ("Maker M 1", 4.5, 26.0)
    # Half size, still at least 400 px, and turned upright.
    assert load_picture(path, 10**7, least_side_px=400).shape == (500, 300, 3)
    plain = read_header(save(tmp_path, "plain.jpg", painted_wall(3, 200, 100)))
    assert (plain.camera, plain.focal_mm, plain.focal_35mm) == ("", None, None)


def test_a_reduced_picture_shows_the_same(tmp_path):
    path = save(tmp_path, "odd.jpg", cv2.GaussianBlur(painted_wall(4, 1003, 601), (0, 0), 4))
    full, reduced = load_picture(path, 10**7), load_picture(path, 10**7, least_side_px=500)
    assert reduced.shape == (301, 502, 3)
    small = cv2.resize(full, (502, 301), interpolation=cv2.INTER_AREA)
    assert np.abs(small.astype(int) - reduced).mean() < 2  # grey levels


# Real photos


@pytest.mark.slow
@pytest.mark.skipif(
    "SI3FP_TEST_DATA" not in os.environ,
    reason="needs SI3FP_TEST_DATA, the folder with the castle photos",
)
def test_castle_is_ready_and_a_blurred_photo_is_found(tmp_path):
    folder = Path(os.environ["SI3FP_TEST_DATA"]) / "castle" / "photos"
    for path in folder.glob("*.jpg"):
        shutil.copy(path, tmp_path)
    pixels = np.asarray(Image.open(folder / "0012.jpg"))
    moved = np.full((1, 11), 1 / 11, np.float32)
    Image.fromarray(cv2.filter2D(pixels, -1, moved)).save(tmp_path / "0030.jpg", quality=90)
    check = check_photos(tmp_path)
    by_name = ratings(check)
    assert by_name.pop("0030.jpg") == "retake"
    assert set(by_name.values()) == {"ok"}
    assert check.verdict.ready
    assert len(check.verdict.groups[0]) == 30
    assert check.verdict.weak == ()
