"""Whether a reconstruction agrees with itself, and which photos of a folded one were displaced."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tests.corner import CAMERA, poses

from si3fp.camera2d.coherence import (
    ModelView,
    agreeing_share,
    coherence,
    scales_contradict,
    strays,
)
from si3fp.camera2d.unfold import displaced, follows
from si3fp.config import SfmConfig
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Photo


def two_walks(alike):
    """A model of two walks around different buildings, folded into one.

    Photos 0 to 5 are the first walk, 6 to 11 the second, with the same poses. The buildings share
    ``alike`` of their points.
    """
    rng = np.random.default_rng(0)
    points = np.concatenate(
        [np.insert(rng.uniform(0, (4, 6), (1500, 2)), wall, 0.0, axis=1) for wall in (0, 1)]
    )
    owner = rng.choice(3, len(points), p=[(1 - alike) / 2, (1 - alike) / 2, alike])
    photos, seen = {}, {}
    for walk in (0, 1):
        for number, pose in enumerate(poses(6), start=6 * walk):
            photos[number] = Photo(str(number), CAMERA, pose)
            pixels = CAMERA.project(pose.apply(points))
            inside = ((pixels > 0) & (pixels < [320, 240])).all(axis=1)
            found = rng.random(len(points)) < 0.8  # not every point is found in every photo
            seen[number] = np.flatnonzero(inside & found & np.isin(owner, [walk, 2]))
    return ModelView(photos, points, seen)


def test_a_folded_model_is_noticed():
    folded = coherence(two_walks(alike=0.2), {}, SfmConfig())
    # Each photo and the one at the same place in the other walk show different buildings.
    assert {(n, n + 6) for n in range(6)} <= set(folded.strangers)
    assert all((first < 6) != (second < 6) for first, second in folded.strangers)
    assert folded.neighbours > len(folded.strangers)
    sound = coherence(two_walks(alike=1.0), {}, SfmConfig())
    assert sound.neighbours == folded.neighbours
    assert sound.strangers == ()


def test_the_stretch_of_a_walk_that_was_laid_on_another_is_found():
    """Photos 5 to 11 of 16 lie where 0 to 6 are; those that follow each other share 100 matches."""
    followed = {(n, n + 1): 100 for n in range(15) if n not in (4, 11)} | {(0, 15): 100}
    false = {(n, n + 5): 60 for n in range(5)}
    strangers = [(0, 5), (1, 6), (2, 7), (4, 9)]
    stretch = displaced(range(16), strangers, followed | false)
    assert stretch in (set(range(5, 12)), {*range(5), *range(12, 16)})
    assert displaced(range(16), [], followed) == frozenset()
    # The walk is a ring, and photos that are not in the model leave their numbers.
    numbers = [2 * n + 1 for n in (*range(8, 16), *range(8))]
    turned = {n: numbers[n] for n in range(16)}
    moved = displaced(
        sorted(turned.values()),
        [tuple(sorted((turned[a], turned[b]))) for a, b in strangers],
        {tuple(sorted((turned[a], turned[b]))): m for (a, b), m in (followed | false).items()},
    )
    expected = {turned[n] for n in range(5, 12)}
    assert moved in (expected, {*turned.values()} - expected)


def test_one_stranger_more_is_not_worth_a_cut_through_what_belongs_together():
    """Photos 5 to 11 lie where 0 to 6 are; a van stands before photo 3, a neighbour of 13."""
    followed = {(n, n + 1): 100 for n in range(15) if n not in (4, 11)} | {(0, 15): 100}
    followed |= {(n, n + 5): 40 for n in range(5)}
    strangers = [(0, 5), (1, 6), (2, 7), (4, 9), (3, 13)]
    assert displaced(range(16), strangers, followed) == set(range(5))
    stretch = displaced(range(16), strangers, followed, enough=0.8)
    assert stretch in (set(range(5, 12)), {*range(5), *range(12, 16)})


def test_cameras_far_away_from_all_others_are_strays():
    around = np.array([[np.cos(t), np.sin(t), 0.0] for t in np.linspace(0, 6, 20)])
    assert strays(30 * around, 10.0).tolist() == []
    assert strays(np.vstack([30 * around, [[0, 400.0, 0]], [[0, 250.0, 0]]]), 10.0).tolist() == [20]


def test_matches_are_followed_only_at_distances_that_a_photo_sees():
    """Along a walk, what repeats on a wall lies on the epipolar line of what it is taken for."""
    model = two_walks(alike=1.0)
    cameras = [model.photos[number].cam_from_world for number in (0, 3)]
    points = model.points[model.seen[0]]
    there = [camera.apply(points) for camera in cameras]
    rays = tuple(place / place[:, 2:] for place in there)
    assert follows(rays, (0, 3), model, SfmConfig()).all()
    baseline = (cameras[1] @ cameras[0].inverse()).translation
    shifted = there[1] - 1.5 * baseline  # as if the second photo were farther back on the walk
    wrong = (rays[0], shifted / shifted[:, 2:])
    first, second = model.photos[0], model.photos[3]
    assert agreeing_share(wrong, first, second, SfmConfig()) == 1.0
    assert not follows(wrong, (0, 3), model, SfmConfig()).any()


def test_photos_from_one_place_are_no_measure_for_those_a_step_aside():
    """Three photos from every place share all; what they saw, a step aside shows half of it."""
    model = two_walks(alike=1.0)
    rng = np.random.default_rng(1)
    photos, seen = {}, {}
    for place in range(6):
        found = model.seen[place][rng.random(len(model.seen[place])) < 0.55 / 0.8]
        for number in range(3 * place, 3 * place + 3):
            photos[number], seen[number] = model.photos[place], found
    crowded = ModelView(photos, model.points, seen)
    assert coherence(crowded, {}, SfmConfig()).strangers == ()
    assert coherence(crowded, {}, SfmConfig(same_place=-1.0)).strangers != ()


def test_matches_that_the_model_contradicts_are_noticed():
    model = two_walks(alike=1.0)
    cameras = [model.photos[number].cam_from_world for number in (0, 3)]
    there = [camera.apply(model.points) for camera in cameras]
    rays = tuple(points / points[:, 2:] for points in there)
    assert agreeing_share(rays, model.photos[0], model.photos[3], SfmConfig()) == 1.0
    assert coherence(model, {(0, 3): rays}, SfmConfig()).opposed == ()
    # A facade that repeats: each point matches the one a window above it.
    shifted = cameras[1].apply(np.add(model.points, [0.0, 0.0, 1.5]))
    wrong = (rays[0], shifted / shifted[:, 2:])
    assert agreeing_share(wrong, model.photos[0], model.photos[3], SfmConfig()) < 0.1
    assert coherence(model, {(0, 3): wrong}, SfmConfig()).opposed == ((0, 3),)


def test_models_of_other_shape_contradict_each_other():
    model = two_walks(alike=1.0)

    def moved(change):
        photos = {}
        for number, photo in model.photos.items():
            pose = photo.cam_from_world
            centre = change(photo.centre_in_world)
            photos[number] = replace(
                photo, cam_from_world=Rigid3(pose.rotation, -pose.rotation @ centre)
            )
        return replace(model, photos=photos)

    assert not scales_contradict(model, moved(lambda centre: 3.0 * centre + 1.0))
    assert scales_contradict(model, moved(lambda centre: centre * [1.0, 4.0, 1.0]))
    assert not scales_contradict(model, ModelView({}, np.zeros((0, 3)), {}))
