"""Tiles, decoding and suppression with a detector whose answer is known; the shipped weights."""

import json
from itertools import pairwise

import cv2
import numpy as np
import pytest

from si3fp.errors import InputError
from si3fp.geometry.boxes import iou_matrix
from si3fp.model import Detections, OrthoImage
from si3fp.windows import detect
from si3fp.windows.detect import OnnxDetector, decode


def ortho(rgb):
    return OrthoImage("x", rgb, np.ones(rgb.shape[:2], bool))


class PaintedSession:
    """Stands in for the network: every pure red rectangle is a window of score 0.9."""

    def run(self, names, feeds):
        batch = feeds["image"][0].transpose(1, 2, 0)
        red = np.all(batch == [255.0, 0.0, 0.0], axis=-1).astype(np.uint8)
        height, width = red.shape[0] // 4, red.shape[1] // 4
        scores = np.zeros((1, 2, height, width), np.float32)
        distances = np.ones((1, 4, height, width), np.float32)
        _, _, stats, _ = cv2.connectedComponentsWithStats(red)
        for x, y, w, h, _ in stats[1:]:
            column, row = int((x + w / 2) // 4), int((y + h / 2) // 4)
            centre = np.array([column + 0.5, row + 0.5]) * 4
            scores[0, 0, row, column] = 0.9
            distances[0, :, row, column] = [
                centre[0] - x, centre[1] - y, x + w - centre[0], y + h - centre[1],
            ]  # fmt: skip
        return scores, distances


@pytest.fixture
def painted(monkeypatch):
    detector = OnnxDetector()
    monkeypatch.setattr(detector, "_session", PaintedSession())
    monkeypatch.setattr(detector, "_outputs", ["scores", "distances"])
    return detector


def test_windows_of_a_long_facade_are_found_once_and_in_place(painted):
    # 72 m at 0.04 m per pixel: four tiles side by side.
    rgb = np.zeros((400, 1800, 3), np.uint8)
    boxes = [(x, y, x + 30, y + 40) for x in range(11, 1760, 57) for y in (50, 180, 300)]
    for x0, y0, x1, y1 in boxes:
        rgb[y0:y1, x0:x1] = [255, 0, 0]
    found = painted.detect(ortho(rgb), painted.m_per_px)
    assert len(found) == len(boxes)
    assert np.allclose(sorted(map(tuple, found.boxes_px)), sorted(boxes))


def test_boxes_come_back_exactly_where_the_scaled_image_is_not_whole(painted):
    # 62 x 31 px are 28.2 x 14.1 px of the detector, that is 28 x 14.
    rgb = np.zeros((31, 62, 3), np.uint8)
    rgb[:] = [255, 0, 0]
    (box,) = painted.detect(ortho(rgb), painted.m_per_px / 2.2).boxes_px
    assert np.allclose(box, [0, 0, 62, 31], atol=1e-6)


def test_boxes_come_back_in_the_pixels_of_the_image(painted):
    rgb = np.zeros((400, 600, 3), np.uint8)
    rgb[100:180, 200:260] = [255, 0, 0]
    found = painted.detect(ortho(rgb), painted.m_per_px / 2)  # shrunk by two for the network
    assert np.allclose(found.boxes_px, [[200, 100, 260, 180]], atol=2.1)


def test_pixels_that_were_not_seen_are_black_to_the_network(painted):
    rgb = np.zeros((200, 200, 3), np.uint8)
    rgb[50:90, 50:90] = [255, 0, 0]
    seen = np.ones((200, 200), bool)
    seen[:, :100] = False
    assert len(painted.detect(OrthoImage("x", rgb, seen), painted.m_per_px)) == 0


@pytest.mark.parametrize("length", [1, 31, 640, 1024, 1025, 1344, 1824, 1825, 5000])
def test_every_place_belongs_to_exactly_one_tile(length):
    spans = detect._spans(length)
    centres = np.linspace(0, length, 2001)[:-1]
    assert np.all(sum(span.owns(centres).astype(int) for span in spans) == 1)
    assert spans[0].start == 0
    assert spans[-1].stop == length
    assert all(0 < span.stop - span.start <= detect.TILE_PX for span in spans)
    overlaps = [before.stop - after.start for before, after in pairwise(spans)]
    assert all(overlap >= detect.OVERLAP_PX for overlap in overlaps)


def test_decode_by_hand():
    scores = np.zeros((2, 5, 6), np.float32)
    scores[0, 1, 2], scores[0, 1, 3], scores[1, 4, 5] = 0.8, 0.7, 0.5
    distances = np.tile(np.array([1, 2, 3, 4], np.float32)[:, None, None], (1, 5, 6))
    found = decode(scores, distances, 10 * distances, ("window", "balcony"))
    # Cell (row 1, column 2) is centred at x = 10, y = 6; its weaker neighbour is no maximum.
    assert found.boxes_px.tolist() == [[9, 4, 13, 10], [21, 16, 25, 22]]
    assert found.scores.tolist() == pytest.approx([0.8, 0.5])
    assert found.labels.tolist() == ["window", "balcony"]
    # A Laplace distribution of scale b has the variance 2 b^2.
    assert np.allclose(found.edge_sigma_px**2, 2 * np.array([10.0, 20, 30, 40]) ** 2)
    assert not decode(scores, distances, None, ("window", "balcony")).edge_sigma_px.any()


def test_scores_leave_as_the_probabilities_of_the_calibration(painted, monkeypatch):
    monkeypatch.setattr(painted, "_calibration", {"window": [[0.0, 0.8, 1.0], [0.0, 0.4, 0.6]]})
    rgb = np.zeros((96, 96, 3), np.uint8)
    rgb[20:60, 30:70] = [255, 0, 0]
    assert painted.detect(ortho(rgb), painted.m_per_px).scores == pytest.approx([0.5])


def test_iou_by_hand():
    boxes = np.array([[0.0, 0, 2, 2], [1, 1, 3, 3], [5, 5, 6, 6]])
    assert np.allclose(iou_matrix(boxes, boxes), [[1, 1 / 7, 0], [1 / 7, 1, 0], [0, 0, 1]])


def test_suppression_keeps_the_best_of_each_label():
    boxes = np.array([[0.0, 0, 10, 10], [1, 0, 11, 10], [0, 0, 10, 10], [30, 0, 40, 10]])
    found = Detections(
        boxes, np.array([0.9, 0.8, 0.7, 0.6]), np.array(["window", "window", "balcony", "window"])
    )
    assert detect._not_suppressed(found).tolist() == [0, 2, 3]


def test_shipped_weights_match_their_card_and_say_where_they_come_from():
    detector = OnnxDetector()
    assert detector.labels[0] == "window"
    assert 0 < detector.thresholds["window"] < 1
    blank = ortho(np.full((120, 130, 3), 128, np.uint8))
    assert not (detector.detect(blank, 0.04).scores > detector.thresholds["window"]).any()


def test_damaged_weights_are_refused(tmp_path):
    (tmp_path / "d.onnx").write_bytes(b"not a network")
    (tmp_path / "d.json").write_text(json.dumps({"sha256": "0" * 64}))
    with pytest.raises(InputError, match=r"damaged.*Install si3fp again"):
        OnnxDetector(tmp_path / "d.onnx")


def test_missing_weights_are_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.onnx"):
        OnnxDetector(tmp_path / "none.onnx")
