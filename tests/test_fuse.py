"""Algorithm 6 by hand, and what views and fused image say together."""

import numpy as np
import pytest

from si3fp.config import FusionConfig
from si3fp.model import Detections, OrthoImage
from si3fp.windows.fuse import combine, fuse_views, views_that_saw

PAPER = FusionConfig()


def found(*rows, label="window"):
    boxes = np.array([row[:4] for row in rows], float)
    return Detections(boxes, np.array([row[4] for row in rows]), np.array([label] * len(rows)))


def view(name, valid=None):
    seen = np.ones((100, 200), bool) if valid is None else valid
    return OrthoImage(name, np.zeros((100, 200, 3), np.uint8), seen)


def test_median_box_and_mean_root_score():
    fused = fuse_views(
        {
            "a": found((10, 10, 30, 40, 0.81)),
            "b": found((12, 10, 32, 40, 0.49)),
            "c": found((11, 14, 31, 40, 0.25)),
        },
        PAPER,
    )
    assert fused.detections.boxes_px.tolist() == [[11, 10, 31, 40]]
    assert fused.detections.scores == pytest.approx([(0.9 + 0.7 + 0.5) / 3])
    assert fused.views == (("a", "b", "c"),)


def test_scatter_between_views_averages_out_and_what_they_share_does_not():
    def known(*row):
        return Detections([row], [0.8], ["window"], np.full((1, 4), 3.0))

    views = {str(x): known(10 + x, 10, 30, 40) for x in (-1, 0, 1, 0)}
    views |= {name + "b": found for name, found in views.items()}
    fused = fuse_views(views, PAPER)
    scatter = np.median([1, 0, 1, 1, 0, 1]) * 1.4826
    assert fused.detections.edge_sigma_px[0] == pytest.approx(
        [np.sqrt(9 - scatter**2 + np.pi / 2 * scatter**2 / 6), 3, 3, 3]
    )


def test_views_that_agree_tell_nothing_of_how_right_they_are():
    views = {"a": found((10, 10, 30, 40, 0.8)), "b": found((12, 10, 30, 40, 0.8))}
    assert not fuse_views(views, PAPER).detections.edge_sigma_px.any()


def test_two_boxes_of_one_view_are_not_two_views():
    pair = found((10, 10, 30, 40, 0.9), (11, 10, 31, 40, 0.8))
    assert len(fuse_views({"a": pair}, PAPER).detections) == 0
    assert len(fuse_views({"a": pair, "b": found((10, 10, 30, 40, 0.3))}, PAPER).detections) == 1


def test_low_scores_do_not_vote():
    views = {"a": found((10, 10, 30, 40, 0.9)), "b": found((10, 10, 30, 40, 0.19))}
    assert len(fuse_views(views, PAPER).detections) == 0


def test_the_papers_second_threshold_can_never_reject():
    # Two scores at the first threshold merge to sqrt(0.2) = 0.447 > 0.4.
    views = {"a": found((10, 10, 30, 40, 0.2)), "b": found((10, 10, 30, 40, 0.2))}
    assert fuse_views(views, PAPER).detections.scores == pytest.approx([0.2**0.5])


def test_mean_score_over_all_views_that_saw_the_place_rejects():
    views = {"a": found((10, 10, 30, 40, 0.5)), "b": found((10, 10, 30, 40, 0.5))}
    seen = {name: np.ones((100, 200), bool) for name in "abcdef"}
    strict = FusionConfig(min_mean_score=0.3)
    assert len(fuse_views(views, strict, seen).detections) == 0  # 1.0 / 6 views
    two = {name: seen[name] for name in "ab"}
    assert len(fuse_views(views, strict, two).detections) == 1


def test_labels_do_not_mix():
    views = {"a": found((0, 0, 9, 9, 0.9)), "b": found((0, 0, 9, 9, 0.9), label="balcony")}
    assert len(fuse_views(views, PAPER).detections) == 0


def test_neighbours_do_not_chain_into_one():
    # Each overlaps with the next by more than 0.3, the first and the last do not overlap.
    views = {
        "a": found((0, 0, 10, 10, 0.9), (10, 0, 20, 10, 0.9)),
        "b": found((1, 0, 11, 10, 0.8), (11, 0, 21, 10, 0.8)),
    }
    assert len(fuse_views(views, PAPER).detections) == 2


def test_nothing_in_nothing_out():
    empty = Detections(np.zeros((0, 4)), np.zeros(0), np.zeros(0, str))
    assert len(fuse_views({}, PAPER).detections) == 0
    assert len(fuse_views({"a": empty}, PAPER).detections) == 0


def test_order_of_the_views_does_not_matter():
    a, b = found((10, 10, 30, 40, 0.9)), found((12, 11, 30, 42, 0.8), (60, 10, 80, 40, 0.7))
    c = found((61, 10, 81, 41, 0.6))
    first = fuse_views({"a": a, "b": b, "c": c}, PAPER)
    second = fuse_views({"c": c, "b": b, "a": a}, PAPER)
    assert np.array_equal(first.detections.boxes_px, second.detections.boxes_px)
    assert first.views == second.views


def test_only_views_that_saw_most_of_a_box_count():
    half = np.ones((100, 200), bool)
    half[:, :20] = False
    assert views_that_saw(np.array([10.0, 10, 30, 40]), [view("a"), view("b", half)]) == ("a",)


def agreed(*rows):
    views = {"a": found(*rows), "b": found(*rows)}
    return fuse_views(views, PAPER)


def test_both_sources_make_one_window():
    both = combine(
        agreed((10, 10, 30, 40, 0.5)),
        found((11, 10, 31, 41, 0.6)),
        [view("a"), view("b")],
        PAPER,
    )
    assert len(both.detections) == 1
    assert both.views == (("a", "b"),)
    assert both.detections.scores[0] == pytest.approx(0.6)


def test_sides_are_those_of_the_views_unless_they_saw_another_box():
    views = [view("a"), view("b")]
    rows = agreed((10, 10, 30, 40, 0.5))
    close = combine(rows, found((11, 10, 31, 41, 0.6)), views, PAPER)
    assert close.detections.boxes_px.tolist() == [[10, 10, 30, 40]]
    double = combine(rows, found((10, 10, 50, 40, 0.6)), views, PAPER)
    assert double.detections.boxes_px.tolist() == [[10, 10, 50, 40]]


def test_what_the_fused_image_alone_shows_keeps_its_score_and_names_who_saw_the_place():
    alone = combine(
        fuse_views({}, PAPER), found((10, 10, 30, 40, 0.35)), [view("a"), view("b")], PAPER
    )
    assert alone.detections.scores.tolist() == [0.35]
    assert alone.views == (("a", "b"),)


def test_the_views_alone_score_by_the_share_of_those_that_saw_the_place():
    rows = agreed((10, 10, 30, 40, 0.5))
    few = combine(rows, found(), [view("a"), view("b")], PAPER)
    many = combine(rows, found(), [view(name) for name in "abcdef"], PAPER)
    assert few.detections.scores == pytest.approx([0.5])
    assert many.detections.scores == pytest.approx([0.5 / 3])


def test_weak_boxes_are_kept_but_confirmed_by_nobody():
    views = [view("a"), view("b")]
    both = combine(agreed((10, 10, 30, 40, 0.9)), found((10, 10, 30, 40, 0.1)), views, PAPER)
    assert both.detections.scores == pytest.approx([0.9, 0.1])
