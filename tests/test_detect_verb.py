"""`si3fp detect`: known windows, scales that it must find, files that it must not touch."""

import io
import json
import os
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image as PilImage
from PIL import ImageOps

from si3fp import cli
from si3fp.model import Detections, OrthoImage
from si3fp.report.figures import BOX_COLOURS
from si3fp.sources.images import load_picture
from si3fp.steps import pictures
from si3fp.windows import scale
from si3fp.windows.detect import OnnxDetector
from si3fp.windows.scale import estimate_m_per_px

RED, BLUE, WALL = (255, 0, 0), (0, 0, 255), (120, 120, 120)


class PaintedDetector:
    """Red rectangles are windows, blue ones balconies; the surer, the nearer to 1.4 m in height."""

    name, sha256, m_per_px = "painted", "0" * 64, 0.04
    thresholds = {"window": 0.5, "balcony": 0.3}  # noqa: RUF012

    def detect(self, image, m_per_px):
        boxes, scores, labels = [], [], []
        for label, colour in (("window", RED), ("balcony", BLUE)):
            painted = np.all(image.rgb == colour, axis=-1).astype(np.uint8)
            for x, y, w, h, _ in cv2.connectedComponentsWithStats(painted)[2][1:]:
                boxes.append([x, y, x + w, y + h])
                scores.append(0.9 * np.exp(-0.5 * np.log(h * m_per_px / 1.4) ** 2 / 0.5**2))
                labels.append(label)
        return Detections(np.array(boxes), np.array(scores), np.array(labels, np.str_))


@pytest.fixture
def si3fp(monkeypatch, capsys):
    monkeypatch.setattr(pictures, "OnnxDetector", PaintedDetector)

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["si3fp", "detect", *map(str, words)])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return run


def wall(*boxes, size=(300, 200), colour=RED):
    rgb = np.full((size[1], size[0], 3), WALL, np.uint8)
    for x0, y0, x1, y1 in boxes:
        rgb[y0:y1, x0:x1] = colour
    return rgb


WINDOWS = [(20, 30, 50, 65), (80, 30, 110, 65), (140, 30, 170, 65)]


def save(path, rgb):
    PilImage.fromarray(rgb).save(path)
    return path


@pytest.fixture
def house(tmp_path):
    return save(tmp_path / "house.png", wall(*WINDOWS))


def test_the_file_says_what_was_found_where(si3fp, house, tmp_path):
    code, out, err = si3fp(house, "-o", tmp_path / "found.json", "--m-per-px", "0.04")
    assert code == 0, err
    assert out == f"{house}: window 3 at 0.04 m per pixel\n"
    written = json.loads((tmp_path / "found.json").read_text())
    (entry,) = written["images"]
    assert entry.pop("scores") == [0.9] * 3
    assert entry == {
        "file": house.as_posix(),
        "width": 300,
        "height": 200,
        "m_per_px": 0.04,
        "m_per_px_estimated": False,
        "boxes_px": [list(map(float, box)) for box in WINDOWS],
        "labels": ["window"] * 3,
    }
    assert written["schema"] == "si3fp/pictures/1"
    assert written["config"]["detector"]["name"] == "painted"
    assert list(written["inputs"]) == [house.as_posix()]
    assert written["missing"] == []


def test_every_label_has_its_own_threshold(si3fp, tmp_path):
    # 1.4 m times exp(0.5) is one deviation off: 0.9 * exp(-0.5) = 0.55 is a window; two
    # deviations are 0.12. At 1.5 deviations, 0.29 is no balcony; at 1.4, 0.34 is one but no window.
    height = {0: 35, 1: round(35 * np.exp(0.5)), 1.4: round(35 * np.exp(0.7))}
    rgb = wall(*[(20 + 40 * i, 10, 50 + 40 * i, 10 + h) for i, h in enumerate(height.values())])
    rgb[120 : 120 + height[1.4], 20:50] = BLUE
    save(tmp_path / "a.png", rgb)
    si3fp(tmp_path / "a.png", "-o", tmp_path / "f.json", "--m-per-px", "0.04")
    (entry,) = json.loads((tmp_path / "f.json").read_text())["images"]
    assert entry["labels"] == ["window", "window", "balcony"]
    assert entry["boxes_px"][2][:2] == [20, 120]


def test_the_same_pictures_give_the_same_bytes(si3fp, house, tmp_path):
    for name in ("a.json", "b.json"):
        assert si3fp(house, "-o", tmp_path / name)[0] == 0
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("height_px", [9, 21, 60, 120])
def test_the_scale_is_found_where_windows_are_as_high_as_usual(si3fp, tmp_path, height_px):
    step = 2 * height_px
    boxes = [(x, y, x + height_px, y + height_px)
             for x in range(step, 6 * step, step) for y in (step, 2 * step)]  # fmt: skip
    file = save(tmp_path / "a.png", wall(*boxes, size=(7 * step, 4 * step)))
    code, out, err = si3fp(file, "-o", tmp_path / "f.json")
    assert code == 0, err
    assert "(estimated)" in out
    (entry,) = json.loads((tmp_path / "f.json").read_text())["images"]
    assert entry["m_per_px"] == pytest.approx(1.4 / height_px, rel=0.005)
    assert entry["m_per_px_estimated"]
    assert len(entry["boxes_px"]) == len(boxes)


def test_the_estimated_scale_given_back_finds_the_same(si3fp, house, tmp_path):
    si3fp(house, "-o", tmp_path / "a.json")
    (first,) = json.loads((tmp_path / "a.json").read_text())["images"]
    si3fp(house, "-o", tmp_path / "b.json", "--m-per-px", first["m_per_px"])
    (second,) = json.loads((tmp_path / "b.json").read_text())["images"]
    assert second == {**first, "m_per_px_estimated": False}


def test_many_small_things_do_not_pass_for_windows():
    # Letters on a sign would be windows if the picture were enlarged nine times: 16 uncertain
    # ones, beside six windows of the right size.
    class Letters(PaintedDetector):
        def detect(self, image, m_per_px):
            found = super().detect(image, m_per_px)
            small = np.diff(found.boxes_px[:, 1::2])[:, 0] < 10
            return Detections(
                found.boxes_px, np.where(small, 0.7, 1.0) * found.scores, found.labels
            )

    windows = [(x, y, x + 30, y + 45) for x in (20, 100, 180) for y in (20, 120)]
    letters = [(20 + 12 * i, 190, 25 + 12 * i, 195) for i in range(16)]
    rgb = wall(*windows, *letters, size=(260, 220))
    image = OrthoImage("sign", rgb, np.ones(rgb.shape[:2], bool))
    assert estimate_m_per_px(image, Letters()) == pytest.approx(1.4 / 45, rel=0.005)


@given(st.integers(1, 20_000), st.integers(1, 6_000))
def test_the_ladder_stays_within_what_pictures_show(height_px, width_px):
    rungs = scale._ladder(height_px, width_px)
    assert 1 <= len(rungs) <= 16
    assert np.allclose(np.diff(np.log(rungs)), np.log(scale.LADDER))
    assert rungs[-1] <= scale.COARSEST_M_PER_PX * (1 + 1e-9)
    assert height_px * width_px * rungs[-1] ** 2 <= scale.LARGEST_AREA_M2 * (1 + 1e-9)


@pytest.mark.parametrize("size", [(1, 1), (31, 3), (400, 9), (64, 64)])
def test_a_picture_without_windows_is_empty_and_noted(si3fp, tmp_path, size):
    file = save(tmp_path / "a.png", wall(size=size))
    code, out, err = si3fp(file, "-o", tmp_path / "f.json", "--overlay", tmp_path / "drawn")
    assert (code, out) == (0, "")
    assert f"{file}: no windows at any scale" in err
    (entry,) = json.loads((tmp_path / "f.json").read_text())["images"]
    assert [entry[key] for key in ("boxes_px", "scores", "labels")] == [[], [], []]
    assert entry["m_per_px"] is None
    assert load_picture(tmp_path / "drawn" / "a.png", 10**7).shape[0] > 0


def test_the_shipped_weights_take_pictures_of_any_size():
    for size in ((1, 1), (700, 2)):
        found, m_per_px = pictures.detect_on_picture(wall(size=size), OnnxDetector(), None)
        assert len(found) == 0
        assert m_per_px is None


def test_bad_pictures_do_not_cost_the_others(si3fp, house, tmp_path):
    (tmp_path / "text.jpg").write_text("hello")
    cut = tmp_path / "cut.png"
    cut.write_bytes(house.read_bytes()[:-40])
    files = [tmp_path / "text.jpg", house, cut, tmp_path / "none.png"]
    code, out, err = si3fp(*files, "-o", tmp_path / "f.json", "--overlay", tmp_path / "drawn")
    assert code == 3
    assert "house.png: window 3" in out
    for bad in (files[0], cut, files[3]):
        assert any(line.startswith("Error: ") and str(bad) in line for line in err.splitlines())
    written = json.loads((tmp_path / "f.json").read_text())
    assert [entry["file"] for entry in written["images"]] == [house.as_posix()]
    assert [row["file"] for row in written["missing"]] == [
        f.as_posix() for f in files if f != house
    ]
    assert [p.name for p in (tmp_path / "drawn").iterdir()] == ["house.png"]


def test_only_bad_pictures_are_an_error_and_write_nothing(si3fp, tmp_path):
    (tmp_path / "a.jpg").write_text("hello")
    code, out, err = si3fp(tmp_path / "a.jpg", "-o", tmp_path / "f.json")
    assert (code, out) == (1, "")
    assert "neither a JPEG nor a PNG" in err
    assert not (tmp_path / "f.json").exists()


def test_a_picture_too_large_is_refused_by_its_header(tmp_path):
    file = save(tmp_path / "a.png", wall(size=(101, 100)))
    with pytest.raises(ValueError, match="101 x 100 px is beyond the limit of 10,000"):
        load_picture(file, 10_000)


def test_a_scale_that_would_make_the_picture_huge_is_refused(si3fp, tmp_path):
    file = save(tmp_path / "a.png", wall(size=(3000, 2500)))
    code, _, err = si3fp(file, "-o", tmp_path / "f.json", "--m-per-px", "0.2")
    assert code == 1
    assert "600 x 500 m" in err


def test_a_folder_stands_for_its_pictures_and_no_picture_counts_twice(si3fp, tmp_path):
    folder = tmp_path / "photos"
    folder.mkdir()
    for name in ("b.png", "a.JPG"):
        save(folder / name, wall(*WINDOWS))
    (folder / "notes.txt").write_text("no picture")
    si3fp(folder / "b.png", folder, "-o", tmp_path / "f.json", "--m-per-px", "0.04")
    written = json.loads((tmp_path / "f.json").read_text())
    assert [Path(entry["file"]).name for entry in written["images"]] == ["b.png", "a.JPG"]
    (tmp_path / "empty").mkdir()
    code, _, err = si3fp(tmp_path / "empty", "-o", tmp_path / "g.json")
    assert code == 1
    assert "holds no JPEG or PNG" in err


def test_an_earlier_result_is_replaced_only_on_request_and_other_files_never(
    si3fp, house, tmp_path
):
    out = tmp_path / "f.json"
    assert si3fp(house, "-o", out)[0] == 0
    code, _, err = si3fp(house, "-o", out)
    assert code == 1
    assert "--overwrite" in err
    assert si3fp(house, "-o", out, "--overwrite")[0] == 0
    for other in (house, save(tmp_path / "other.jpg", wall())):
        before = other.read_bytes()
        code, _, err = si3fp(house, "-o", other, "--overwrite")
        assert code == 1
        assert "never replaced" in err
        assert other.read_bytes() == before
    assert si3fp(house, "-o", tmp_path)[0] == 1


def test_overlays_show_boxes_on_the_picture(si3fp, house, tmp_path):
    si3fp(house, "-o", tmp_path / "f.json", "--overlay", tmp_path / "drawn")
    drawn = load_picture(tmp_path / "drawn" / "house.png", 10**7)
    larger = drawn.shape[1] / 300  # small pictures are enlarged
    assert drawn.shape[1] == 1000
    assert drawn.shape[0] > 200 * larger  # a key stands below
    across = drawn[round(55 * larger), round(50 * larger) - 2 : round(50 * larger) + 3]
    # A thin line between two pixels keeps most of its colour in one of them.
    line = np.abs(across - np.array(BOX_COLOURS["window"])).max(axis=1)
    assert line.min() < 100 < line[[0, -1]].min()
    assert drawn[round(150 * larger), round(250 * larger)].tolist() == list(WALL)


def test_overlays_of_one_name_do_not_replace_each_other(si3fp, tmp_path):
    files = []
    for place in ("one", "two", "three"):
        (tmp_path / place).mkdir()
        files.append(save(tmp_path / place / ("A.png" if place == "two" else "a.png"), wall()))
    si3fp(*files, "-o", tmp_path / "f.json", "--overlay", tmp_path / "drawn")
    assert sorted(p.name for p in (tmp_path / "drawn").iterdir()) == ["A-2.png", "a-3.png", "a.png"]


def test_overlays_replace_no_picture(si3fp, house, tmp_path):
    code, _, err = si3fp(house, "-o", tmp_path / "f.json", "--overlay", tmp_path, "--overwrite")
    assert code == 1
    assert "holds the pictures themselves" in err
    (tmp_path / "drawn").mkdir()
    (tmp_path / "drawn" / "house.png").write_text("precious")
    words = (house, "-o", tmp_path / "f.json", "--overlay", tmp_path / "drawn")
    code, _, err = si3fp(*words)
    assert code == 1
    assert "--overwrite" in err
    assert not (tmp_path / "f.json").exists()
    assert si3fp(*words, "--overwrite")[0] == 0
    assert si3fp(house, "-o", tmp_path / "g.json", "--overlay", house)[0] == 1


@pytest.mark.parametrize("words", [[], ["-o", "f.json"], ["a.png"],
                                   ["a.png", "-o", "f.json", "--m-per-px", "3"]])  # fmt: skip
def test_wrong_usage_is_two(si3fp, words):
    assert si3fp(*words)[0] == 2


@pytest.mark.parametrize("orientation", range(1, 9))
def test_pictures_are_turned_as_their_camera_says(tmp_path, orientation):
    coarse = np.random.default_rng(0).integers(0, 255, (3, 4, 3), dtype=np.uint8)
    picture = PilImage.fromarray(np.kron(coarse, np.ones((16, 16, 1), np.uint8)))
    exif = PilImage.Exif()
    exif[0x0112] = orientation
    stream = io.BytesIO()
    picture.save(stream, "JPEG", quality=95, exif=exif)
    (tmp_path / "a.jpg").write_bytes(stream.getvalue())
    with PilImage.open(tmp_path / "a.jpg") as stored:
        truth = np.asarray(ImageOps.exif_transpose(stored).convert("RGB"), int)
    loaded = load_picture(tmp_path / "a.jpg", 10**6)
    assert loaded.shape == truth.shape
    assert np.abs(loaded - truth).mean() < 3  # two decoders


@pytest.mark.slow
def test_scales_of_real_facades_are_found():
    folder = os.environ.get("SI3FP_TEST_DATA")
    if not folder:
        pytest.skip("SI3FP_TEST_DATA names no folder with real data")
    data = Path(folder) / "spb-facades"
    document = json.loads((data / "annotations.coco.json").read_text())
    factors = []
    for image in document["images"][::60]:
        heights = [a["bbox"][3] for a in document["annotations"] if a["image_id"] == image["id"]]
        rgb = load_picture(data / image["file_name"], 10**8)
        _, m_per_px = pictures.detect_on_picture(rgb, OnnxDetector(), None)
        factors.append(m_per_px * np.median(heights) / 1.4)
    # A third off either way is what the detector bears without loss.
    assert np.median(np.abs(np.log(factors))) < np.log(4 / 3)
