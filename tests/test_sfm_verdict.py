"""What is said of a reconstruction, from the numbers that COLMAP's process reports."""

from pathlib import Path

import pytest

from si3fp.camera2d.sfm_verdict import judge
from si3fp.config import SfmConfig

NAMES = [f"photo-{number}.jpg" for number in range(10)]
CONFIG = SfmConfig()


def report(photos=range(10), **more):
    model = {
        "photos": list(photos),
        "points": 5000,
        "error_px": 0.4,
        "neighbours": 40,
        "strangers": [],
        "opposed": [],
        "contradicts_first": False,
    }
    return {
        "features": [2000] * 10,
        "verified": [[a, a + 1, 300] for a in range(9)],
        "models": [model | more],
        "set_aside": [],
        "left_out": [],
    }


def judged(of):
    return judge(NAMES, of, {}, Path("models"), CONFIG)


def test_a_model_that_agrees_with_itself_needs_no_words():
    result = judged(report())
    assert (result.notes, dict(result.lost), result.models[0].doubts) == ((), {}, ())


def test_a_folded_model_is_not_to_be_measured_on():
    result = judged(report(strangers=[[0, 5], [1, 6], [2, 7]]))
    assert result.models[0].doubts == result.notes
    assert "may be folded" in result.notes[0]
    assert "photo-0.jpg and photo-5.jpg" in result.notes[0]


@pytest.mark.parametrize(("strangers", "count"), [([[0, 5], [1, 6]], 10), ([[0, 5]] * 3, 61)])
def test_few_strangers_are_no_fold(strangers, count):
    assert judged(report(strangers=strangers, neighbours=count)).notes == ()


def test_photos_left_out_of_a_fold_are_named_with_what_is_missing():
    result = judged(report(range(7)) | {"left_out": [7, 8, 9]})
    assert "photo-7.jpg to photo-9.jpg (3 photos)" in result.notes[0]
    assert "were left out" in result.notes[0]
    assert set(result.lost) == set(NAMES[7:])
    assert all("looks like another" in why for why in result.lost.values())
