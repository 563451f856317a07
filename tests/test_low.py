"""Rows of low windows, which the detector is sure of at twice the scale only."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from si3fp.model import Detections, OrthoImage
from si3fp.windows.low import detect_with_low, of_low

M_PER_PX = 0.02
IMAGE = OrthoImage("fused", np.zeros((500, 900, 3), np.uint8), np.ones((500, 900), bool))
WINDOWS = [(50 + 150 * n, 300, 110 + 150 * n, 370) for n in range(5)]  # 1.4 m high
CELLARS = [(55 + 150 * n, 460, 105 + 150 * n, 480) for n in range(5)]  # 0.4 m high
Scored = Sequence[tuple[tuple[float, float, float, float], float]]


def detections(boxes: Scored, label: str = "window") -> Detections:
    rows = sorted(boxes, key=lambda each: -each[1])
    return Detections(
        np.array([box for box, _ in rows], float).reshape(-1, 4),
        np.array([score for _, score in rows], float),
        np.array([label] * len(rows), dtype="<U12"),
    )


class TwoScales:
    """Finds one thing at the scale that it is told first and another at twice that."""

    wwr_errors = None

    def __init__(self, first: Scored, second: Scored) -> None:
        self.thresholds = {"window": 0.4, "balcony": 0.3}
        self.found = {M_PER_PX: detections(first), 2 * M_PER_PX: detections(second)}
        self.asked: list[float] = []

    def detect(self, image: OrthoImage, m_per_px: float) -> Detections:
        self.asked.append(m_per_px)
        return self.found[m_per_px]


def with_scores(boxes: Sequence[tuple[float, float, float, float]], score: float) -> Scored:
    return [(box, score) for box in boxes]


def found_by(first: Scored, second: Scored) -> list[tuple[list[float], float]]:
    found = detect_with_low(TwoScales(first, second), IMAGE, M_PER_PX)
    return list(zip(found.boxes_px.tolist(), found.scores.tolist(), strict=True))


def test_a_suspected_row_is_taken_from_the_finer_scale() -> None:
    # At the first scale the boxes reach up to a stain above.
    tall = [(x0, y0 - 15, x1, y1) for x0, y0, x1, y1 in CELLARS]
    first = [*with_scores(WINDOWS, 0.9), *with_scores(tall, 0.1)]
    second = [*with_scores(CELLARS, 0.8), *with_scores(WINDOWS, 0.5)]
    found = found_by(first, second)
    assert [box for box, score in found if score == 0.8] == [list(box) for box in CELLARS]
    assert [box for box, score in found if score == 0.9] == [list(box) for box in WINDOWS]
    assert len(found) == 10  # neither the suspicion nor what is high at the finer scale


@pytest.mark.parametrize(
    ("suspicion", "second"),
    [
        pytest.param(0.02, CELLARS, id="not suspected"),
        pytest.param(0.1, CELLARS[:2], id="no row"),
        pytest.param(
            0.1,
            [CELLARS[0], (205, 420, 255, 440), (355, 380, 405, 400)],
            id="at different heights",
        ),
        pytest.param(
            0.1, [CELLARS[0], (205, 460, 290, 480), (355, 460, 375, 480)], id="of different widths"
        ),
    ],
)
def test_else_the_first_scale_stands(
    suspicion: float, second: list[tuple[float, float, float, float]]
) -> None:
    first = [*with_scores(WINDOWS, 0.9), *with_scores(CELLARS, suspicion)]
    expected = detections(first)
    found = found_by(first, with_scores(second, 0.8))
    assert [box for box, _ in found] == expected.boxes_px.tolist()
    assert [score for _, score in found] == expected.scores.tolist()


def test_nothing_is_sought_twice_where_nothing_low_is_suspected() -> None:
    detector = TwoScales(with_scores(WINDOWS, 0.9), with_scores(CELLARS, 0.9))
    assert len(detect_with_low(detector, IMAGE, M_PER_PX)) == len(WINDOWS)
    assert detector.asked == [M_PER_PX]


def test_a_low_window_is_moved_by_a_tenth_of_its_size_at_most() -> None:
    lever = np.array([0.0, 0.2, 0.0, 1.8])
    low, high = np.array([2.0, 3.0, 8.0, 8.4]), np.array([2.0, 3.0, 8.0, 9.4])
    assert of_low(lever, low, 0.2) * 0.2 == pytest.approx([0.0, 0.04, 0.0, 0.04])
    assert of_low(lever, high, 0.2) is lever
    assert of_low(lever, low, 0.0) is lever
