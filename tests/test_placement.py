"""Walls laid on footprints, against the turn and offset they were made with."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from si3fp.camera2d.placement import place_on_footprints, placement_hypotheses
from si3fp.errors import InputError, ReconstructionError
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Footprint

L_SHAPE = Footprint(
    "l", np.array([[0.0, 0.0], [14.0, 0.0], [14.0, 6.0], [5.0, 6.0], [5.0, 11.0], [0.0, 11.0]])
)
SQUARE = Footprint("square", np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]]))
OBLONG = Footprint("oblong", np.array([[0.0, 0.0], [16.0, 0.0], [16.0, 9.0], [0.0, 9.0]]))


def edges_of(*footprints: Footprint):
    return np.array([edge for footprint in footprints for edge in footprint.edges()])


def world_from_level(heading_deg=77.0, east=120.0, north=-45.0) -> Rigid3:
    c, s = np.cos(np.deg2rad(heading_deg)), np.sin(np.deg2rad(heading_deg))
    rotation = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])  # y points to the heading
    return Rigid3(rotation, np.array([east, north, 0.0]))


def walls_of(edges, pose=None, noise_m=0.0, rng=None):
    """Walls and outward directions in the level frame; every second one end for end."""
    pose = world_from_level() if pose is None else pose
    ends = np.concatenate([edges, np.zeros((*edges.shape[:2], 1))], axis=2)
    walls = pose.inverse().apply(ends)[..., :2]
    along = walls[:, 1] - walls[:, 0]
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
    walls[1::2] = walls[1::2, ::-1]
    if rng is not None:
        walls = walls + rng.normal(0, noise_m, walls.shape)
    return walls, outward


def assert_placed(placement, pose, metres=0.02, degrees=0.1):
    turn = placement.world_from_level.rotation @ pose.rotation.T
    assert np.rad2deg(np.abs(np.arctan2(turn[1, 0], turn[0, 0]))) < degrees
    np.testing.assert_allclose(
        placement.world_from_level.translation, pose.translation, atol=metres
    )


@settings(max_examples=15, deadline=None)
@given(st.floats(0, 359.9), st.floats(-50, 50), st.floats(-50, 50))
def test_an_l_shape_has_one_place(heading_deg, east, north):
    pose = world_from_level(heading_deg, east, north)
    placement = place_on_footprints(*walls_of(edges_of(L_SHAPE), pose), edges_of(L_SHAPE))
    assert_placed(placement, pose, 1e-4, 1e-4)
    assert placement.score == pytest.approx(1.0)
    assert placement.edge_of_wall == (0, 1, 2, 3, 4, 5)
    off_deg = (placement.heading_deg - heading_deg + 180) % 360 - 180
    assert off_deg == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize("missing", range(6))
def test_an_l_shape_with_a_missing_wall_has_one_place(missing):
    seen = np.delete(edges_of(L_SHAPE), missing, axis=0)
    placement = place_on_footprints(*walls_of(seen), edges_of(L_SHAPE))
    assert_placed(placement, world_from_level())
    assert placement.edge_of_wall == tuple(i for i in range(6) if i != missing)


def test_a_wall_seen_in_part_and_a_wall_of_another_building_do_not_mislead():
    edges = edges_of(L_SHAPE)
    seen = edges.copy()
    seen[0, 1] = [8.0, 0.0]
    seen = np.concatenate([seen, [[[20.0, 3.0], [20.0, 7.0]]]])
    placement = place_on_footprints(*walls_of(seen), edges)
    assert_placed(placement, world_from_level())
    assert placement.edge_of_wall == (0, 1, 2, 3, 4, 5, -1)


def test_walls_without_true_ends_are_placed_by_their_lines():
    edges = edges_of(L_SHAPE)
    middle = edges.mean(axis=1, keepdims=True)
    placement = place_on_footprints(*walls_of(middle + 0.7 * (edges - middle)), edges)
    assert_placed(placement, world_from_level(), 1e-4, 1e-4)


def test_walls_that_go_on_past_the_corner_are_placed_by_their_lines():
    edges = edges_of(OBLONG, Footprint("shed", np.array([[30.0, 0.0], [34.0, 0.0], [34.0, 9.0]])))
    seen = edges[:4].copy()
    seen[1, 1] += [0.0, 1.4]  # the sides of balconies beyond the corner
    seen[3, 0] += [0.0, 1.4]
    found = placement_hypotheses(*walls_of(seen), edges)
    assert_placed(found[0], world_from_level(), 1e-4, 1e-4)


def test_a_wall_that_no_other_meets_is_placed_by_its_ends():
    edges = edges_of(OBLONG)
    seen = edges[1:2].copy()
    seen[0, :, 1] += [-0.1, 0.1]
    found = placement_hypotheses(*walls_of(seen), edges[1:2])
    assert_placed(found[0], world_from_level(), 1e-4, 1e-4)


def test_a_square_is_ambiguous_and_its_four_ways_are_listed():
    edges = edges_of(SQUARE)
    walls = walls_of(edges, noise_m=0.05, rng=np.random.default_rng(0))
    with pytest.raises(ReconstructionError, match="in 4 ways") as caught:
        place_on_footprints(*walls, edges)
    message = str(caught.value)
    assert [f"({n}) heading" in message for n in range(1, 6)] == [True] * 4 + [False]
    assert "--origin" in message
    headings = sorted(one.heading_deg for one in placement_hypotheses(*walls, edges)[:4])
    np.testing.assert_allclose(headings, [77, 167, 257, 347], atol=1.0)


def test_an_oblong_is_ambiguous_by_half_a_turn():
    edges = edges_of(OBLONG)
    with pytest.raises(ReconstructionError, match="in 2 ways"):
        place_on_footprints(*walls_of(edges), edges)


def test_the_outside_tells_a_courtyard_from_a_house():
    square = edges_of(SQUARE)[:, ::-1]  # walls around a court look inwards
    walls, outward = walls_of(square)
    with pytest.raises(ReconstructionError, match="do not fit the footprints"):
        place_on_footprints(walls, outward, edges_of(SQUARE))
    fits = placement_hypotheses(walls, -outward, edges_of(SQUARE))
    assert sum(one.score > 0.9 for one in fits) == 4


def test_the_uncertainty_covers_the_noise_of_the_walls():
    rng = np.random.default_rng(11)
    edges, pose = edges_of(L_SHAPE), world_from_level()
    centre_in_level = pose.inverse().apply([*edges.reshape(-1, 2).mean(axis=0), 0.0])
    hits = []
    for _ in range(40):
        placement = place_on_footprints(*walls_of(edges, pose, 0.2, rng), edges, sigma_m=0.2)
        error = placement.world_from_level.apply(centre_in_level) - pose.apply(centre_in_level)
        turn = (placement.heading_deg - 77.0 + 180) % 360 - 180
        hits += (np.abs(error[:2]) <= 1.96 * placement.offset_sigma_m).tolist()
        hits.append(abs(turn) <= 1.96 * placement.heading_sigma_deg)
    assert np.mean(hits) > 0.9  # ends are weighted as twice as bad, so the figure is cautious


def test_one_wall_cannot_tell_where_it_is():
    edges = edges_of(OBLONG)
    walls, outward = walls_of(edges[:1])
    with pytest.raises(ReconstructionError, match="in 2 ways"):
        place_on_footprints(walls, outward, edges)
    short = walls.mean(axis=1, keepdims=True) + 0.4 * (walls - walls.mean(axis=1, keepdims=True))
    with pytest.raises(ReconstructionError, match="in 6 ways"):  # it slides, too
        place_on_footprints(short, outward, edges)


def test_a_wrong_scale_does_not_fit():
    walls, outward = walls_of(edges_of(L_SHAPE))
    with pytest.raises(ReconstructionError, match="Check the scale"):
        place_on_footprints(3 * walls, outward, edges_of(L_SHAPE))


def test_broken_walls_are_refused():
    walls, outward = walls_of(edges_of(L_SHAPE))
    edges = edges_of(L_SHAPE)
    with pytest.raises(InputError, match=r"walls as \(N, 2, 2\)"):
        place_on_footprints(np.zeros((0, 2, 2)), np.zeros((0, 2)), edges)
    with pytest.raises(InputError, match="end of a wall is NaN"):
        place_on_footprints(walls * np.nan, outward, edges)
    with pytest.raises(InputError, match="lies along its wall"):
        place_on_footprints(walls, walls[:, 1] - walls[:, 0], edges)
    with pytest.raises(InputError, match="6 walls need as many"):
        place_on_footprints(walls, outward[:3], edges)
    with pytest.raises(InputError, match=r"edges \[0\] have no length"):
        place_on_footprints(walls, outward, np.concatenate([np.zeros((1, 2, 2)), edges]))
    with pytest.raises(InputError, match="must be positive, got 0"):
        place_on_footprints(walls, outward, edges, sigma_m=0.0)


@pytest.mark.slow
@pytest.mark.skipif("SI3FP_TEST_DATA" not in os.environ, reason="needs SI3FP_TEST_DATA")
def test_the_court_of_the_castle_has_one_place():
    from si3fp.sources.footprints import footprints_in_world, read_footprints
    from si3fp.sources.selection import run_origin

    records = read_footprints(Path(os.environ["SI3FP_TEST_DATA"]) / "castle" / "footprints.geojson")
    footprints = footprints_in_world(records, run_origin(records, []))
    court = edges_of(*footprints)[3::4]  # the edges of the wings that face the court
    walls = walls_of(court, noise_m=0.1, rng=np.random.default_rng(0))
    placement = place_on_footprints(*walls, edges_of(*footprints))
    assert_placed(placement, world_from_level(), 2.0, 0.7)  # the offset's lever is 130 m
    assert placement.edge_of_wall == (3, 7, 11)
