"""Kernels of the radiance field against the reference, the reference against differences."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from si3fp.camera2d.radiance import arrays, reference
from si3fp.camera2d.radiance.arrays import (
    FEATURES,
    LANES,
    LEVELS,
    MAX_BLOCKS,
    Photos,
    Samples,
)
from si3fp.camera2d.radiance.gradients import train_rays
from si3fp.camera2d.radiance.layout import FieldLayout, new_field
from si3fp.camera2d.radiance.tables import adam, refresh, scatter, visit
from si3fp.config import RadianceConfig

CONFIG = replace(RadianceConfig(), m_per_px=0.05, front_levels=3, margin_m=0.2)
WIDTH_M, HEIGHT_M = 1.0, 0.8
BOUNDS = np.array([0, WIDTH_M, 0, HEIGHT_M, -0.5, 1.7, 0.25], np.float32)
STEPS = np.array([0.12, 0.1], np.float32)
SHAPE = np.array([0.03, 0.02], np.float32)
HUBER = 0.1


def small_case(log_scale=2.0):
    """A random field that hides nothing, two cameras, and a few pixels that look at it."""
    rng = np.random.default_rng(5)
    centres = np.array([[0.2, 0.4, 3.1], [1.1, 0.1, 2.6]])
    layout = FieldLayout.around(WIDTH_M, HEIGHT_M, centres, CONFIG)
    field, network = new_field(layout, CONFIG, rng)
    field.table[:] = rng.normal(0, 0.3, field.table.shape)
    network[:] = rng.normal(0, 0.4, network.shape)
    field.prior[:2] = log_scale * np.array([-1.0, -0.3])
    field.occupied[:] = rng.random(len(field.occupied)) < 0.7
    focal, size = 30.0, (24, 20)
    direction = np.array([[1 / focal, 0, -0.4], [0, -1 / focal, 0.35], [0, 0, -1.0]])
    turned = np.array([[0, 0, -0.2], [0, 0, 0.05], [0, 0, 0]])
    photos = Photos(
        centres.astype(np.float32),
        np.stack([direction, direction + turned]).astype("f4"),
        rng.uniform(0.8, 1.2, (2, 3)).astype(np.float32),
        rng.integers(0, 256, (2 * size[0] * size[1], 3), dtype=np.uint8),
        np.array([0, size[0] * size[1]]),
        np.array([size[0], size[0]]),
    )
    draws = np.stack([[0, 1, 0, 1, 0], [12, 14, 9, 12, 0], [8, 9, 11, 12, 0]], axis=1)
    noise = rng.random((len(draws), 4), dtype=np.float32)
    return SimpleNamespace(
        layout=layout, field=field, network=network, photos=photos, draws=draws, noise=noise
    )


def run_kernels(case):
    room = MAX_BLOCKS * LANES * len(case.draws)
    samples = Samples(
        np.zeros((1, room, 3), np.float32),
        np.zeros((1, LEVELS, room, FEATURES), np.float32),
        np.zeros((1, room), np.int32),
        np.zeros((1, room), np.float32),
        np.zeros((1, 2), np.int64),
    )
    gain = np.zeros((2, 3), np.float32)
    network = np.zeros(len(case.network), np.float32)
    totals = np.zeros(3)
    train_rays(
        case.field,
        case.photos,
        case.draws,
        case.noise,
        BOUNDS,
        STEPS,
        SHAPE,
        np.float32(HUBER),
        0,
        samples,
        gain,
        network,
        totals,
    )
    table = np.zeros_like(case.field.table)
    for level in range(LEVELS):
        scatter(case.field, level, samples, table)
    return SimpleNamespace(table=table, network=network, gain=gain, totals=totals, samples=samples)


def spans_of(ray, offset):
    """Front and slab of a ray that enters the slab through its face, as the kernels see it."""
    wall = -ray[2] / ray[5]
    start, end = ((z - ray[2]) / ray[5] for z in (1.7, -0.5))
    for axis, high in ((0, WIDTH_M + 0.2), (1, HEIGHT_M + 0.2)):
        # The grid of the slab ends with its last whole cell.
        cells = np.floor((high + 0.2) / 0.1) + 1
        sides = sorted((edge - ray[axis]) / ray[3 + axis] for edge in (-0.2, -0.2 + cells * 0.1))
        start, end = max(start, sides[0]), min(end, sides[1])
    near = 0.25 * wall
    front, slab = float(STEPS[0]), float(STEPS[1])
    return (
        (near + offset * front, (1.7 - ray[2]) / ray[5], front),
        (max(start, near) + offset * slab, end, slab),
    )


def run_reference(case, gradients=True):
    """Error, gradients and rays used."""
    total = reference.zero_gradients(case.field)
    gain = np.zeros((2, 3))
    error, used = 0.0, 0
    for (photo, column, row), noise in zip(case.draws, case.noise.astype(float), strict=True):
        ray = reference.photo_ray(case.photos, photo, column, row)
        hit = ray[:2] - ray[2] / ray[5] * ray[3:5]
        if not ((hit > 0) & (hit < (WIDTH_M, HEIGHT_M))).all():
            continue
        used += 1
        at = case.photos.first[photo] + row * case.photos.width[photo] + column
        total.gain[:] = 0
        error += reference.error_of_ray(
            case.field,
            ray,
            spans_of(ray, noise[3]),
            noise[:3],
            case.photos.gain[photo].astype(float),
            case.photos.pixels[at] / 255.0,
            (float(SHAPE[0]), float(SHAPE[1])),
            HUBER,
            total if gradients else None,
        )[0]
        gain[photo] += total.gain
    return error, total, gain, used


def assert_near(actual, expected, share):
    """Differences below a share of the largest value: float32 sums in another order."""
    scale = np.abs(expected).max()
    assert scale > 0
    np.testing.assert_allclose(actual, expected, atol=share * scale)


def check_kernels():
    case = small_case()
    kernels = run_kernels(case)
    _, expected, gain, used = run_reference(case)
    assert 3 <= used < len(case.draws)  # one misses
    assert kernels.totals[1] == used
    assert kernels.totals[2] == 0
    assert_near(kernels.table, expected.table, 1e-3)
    assert_near(kernels.network, expected.network, 1e-3)
    assert_near(kernels.gain, gain, 1e-3)


def test_gradients_of_the_kernels_are_those_of_the_reference():
    check_kernels()


def test_kernels_stay_inside_their_arrays():
    # Without the compiler numpy checks every index.
    script = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); "
    script += "import test_radiance_kernels as t; t.check_kernels()"
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ["table", "network", "gain"])
def test_gradients_of_the_reference_are_differences_of_its_error(name):
    case = small_case(log_scale=1.0)
    # float64 copies, so that a small step does not vanish
    for photo_array in ("gain",):
        case.photos = case.photos._replace(
            **{photo_array: getattr(case.photos, photo_array).astype(np.float64)}
        )
    wide = {k: getattr(case.field, k).astype(float) for k in ("table", "hidden", "density")}
    wide |= {k: getattr(case.field, k).astype(float) for k in ("colour", "output")}
    case.field = case.field._replace(**wide)
    _, gradients, gain, _ = run_reference(case)
    arrays = {
        "table": [(case.field.table, gradients.table)],
        "network": [
            (getattr(case.field, k), getattr(gradients, k))
            for k in ("hidden", "density", "colour", "output")
        ],
        "gain": [(case.photos.gain, gain)],
    }[name]
    for array, gradient in arrays:
        scale = np.abs(gradient).max()
        for index in np.argsort(-np.abs(gradient), axis=None)[[0, 1, 2, 5]]:
            at = np.unravel_index(index, array.shape)
            before, step = array[at], 1e-6
            array[at] = before + step
            above = run_reference(case, gradients=False)[0]
            array[at] = before - step
            below = run_reference(case, gradients=False)[0]
            array[at] = before
            assert (above - below) / (2 * step) == pytest.approx(gradient[at], abs=1e-4 * scale)


def test_samples_of_the_same_ray_lie_a_step_apart_in_occupied_cells():
    case = small_case()
    samples = run_kernels(case).samples
    cells = samples.cell[0, : samples.filled[0, 1]]
    assert (case.field.occupied[cells] == 1).all()
    ray = reference.photo_ray(case.photos, *case.draws[0])
    t, _, _ = reference.march(case.field, ray, spans_of(ray, float(case.noise[0, 3])))
    expected = ray[:3] + t[:, None] * ray[3:]
    kept = samples.position[0, : samples.filled[0, 0]]
    gaps = np.linalg.norm(expected[:, None] - kept[None], axis=2).min(axis=1)
    assert gaps.max() < 1e-4


def test_adam_moves_touched_rows_only_and_clears_the_gradient():
    table, gradient = np.zeros((5, FEATURES), np.float32), np.zeros((5, FEATURES), np.float32)
    moments = np.zeros((5, 2, FEATURES), np.float32)
    gradient[[1, 4]] = [3.0, -2.0, 0.0, 1e-3]
    adam(table, gradient, moments, 0, 4, np.array([0.1, 0.0, 0.0, 1e-12], np.float32))
    np.testing.assert_allclose(table[1], [-0.1, 0.1, 0.0, -0.1], atol=1e-6)
    assert not table[[0, 2, 3, 4]].any()
    assert not gradient[:4].any()
    assert gradient[4].any()


def test_visited_cells_remember_the_densest_sample():
    samples = Samples(
        np.zeros((1, 4, 3), np.float32),
        np.zeros((1, LEVELS, 4, FEATURES), np.float32),
        np.array([[2, 2, 0, 1]], np.int32),
        np.array([[5.0, 1.0, 0.1, 99.0]], np.float32),
        np.array([[0, 3]]),
    )
    value = np.array([2.0, 2.0, 2.0], np.float32)
    visit(samples, value, np.float32(0.5))
    np.testing.assert_allclose(value, [1.0, 2.0, 2.5])


def test_neighbours_of_dense_cells_stay_occupied():
    value = np.zeros(2 + 3 * 4 * 5, np.float32)
    dims = np.array([3, 4, 5])
    dense = 2 + np.ravel_multi_index((1, 2, 0), dims)
    value[dense] = 9.0
    occupied = np.full(len(value), 7, np.uint8)
    refresh(value, 2, dims, np.float32(1.0), occupied)
    cube = occupied[2:].reshape(dims)
    assert set(zip(*map(list, np.nonzero(cube)), strict=True)) == {
        (1, 2, 0), (0, 2, 0), (2, 2, 0), (1, 1, 0), (1, 3, 0), (1, 2, 1)
    }  # fmt: skip
    assert (occupied[:2] == 7).all()


def test_kernels_compile_where_nothing_can_be_cached(monkeypatch):
    def njit(**options):
        if options.get("cache"):
            raise RuntimeError("cannot cache function: no locator available")
        return lambda function: ("compiled", function)

    monkeypatch.setattr(arrays.numba, "njit", njit)
    assert arrays.compiled(abs) == ("compiled", abs)
