"""The grid of a photo facade, and the rule of what counts as seen."""

from __future__ import annotations

import numpy as np
import pytest
from tests.scenes.flat_wall import PLANE, photo, wall_grid

from si3fp.camera2d.render import count_photos, covered, facade_grid, photo_m_per_px
from si3fp.errors import InputError
from si3fp.model import OrthoImage


def test_the_size_of_a_photo_pixel_on_the_wall_by_hand():
    """Straight ahead at 24 m with a focal length of 500 px: 24 / 502.5 m (geometric mean)."""
    assert photo_m_per_px(photo(6.0, 4.5, 24.0), PLANE) == pytest.approx(24 / 502.5, rel=0.02)
    # At 60 degrees and the same distance the pixel is twice as long.
    oblique = photo(6.0 + 24.0 * np.sin(np.pi / 3), 4.5, 12.0)
    assert photo_m_per_px(oblique, PLANE) == pytest.approx(2 * 24 / 502.5, rel=0.35)


def test_a_photo_that_does_not_show_the_wall_resolves_nothing():
    assert photo_m_per_px(photo(6.0, 4.5, -8.0), PLANE) == np.inf


def test_the_grid_is_as_fine_as_asked_or_as_the_third_best_photo():
    photos = [photo(6.0, 4.5, z, name=str(z)) for z in (5.0, 10.0, 24.0, 80.0)]
    assert facade_grid(PLANE, photos, 0.1).m_per_px == 0.1
    third = facade_grid(PLANE, photos, 0.01).m_per_px
    assert third == pytest.approx(24 / 502.5, abs=0.001)
    assert facade_grid(PLANE, [], 0.02).m_per_px == 0.02


def test_photos_are_counted_pixel_by_pixel():
    grid = wall_grid()
    left = np.zeros((45, 60), bool)
    left[:, :30] = True
    count = count_photos({"a": left, "b": np.ones_like(left)}, grid)
    assert count.shape == (grid.height_px, grid.width_px)
    assert (count[:, : grid.width_px // 2] == 2).all()
    assert (count[:, grid.width_px // 2 :] == 1).all()


def test_what_too_few_photos_saw_is_black_without_depth_and_not_valid():
    seen_by = np.array([[0, 1, 2, 3]], np.uint8)
    full = OrthoImage(
        "radiance",
        np.full((1, 4, 3), 90, np.uint8),
        np.array([[True, True, True, False]]),
        np.full((1, 4), 0.5, np.float32),
        seen_by,
    )
    masked = covered(full, 2)
    np.testing.assert_array_equal(masked.valid, [[False, False, True, False]])
    np.testing.assert_array_equal(masked.rgb[0, :, 0], [0, 0, 90, 0])
    np.testing.assert_array_equal(np.isnan(masked.depth_m), ~masked.valid)
    np.testing.assert_array_equal(masked.seen_by, seen_by)


def test_an_image_without_a_count_cannot_be_judged():
    image = OrthoImage("radiance", np.zeros((1, 4, 3), np.uint8), np.ones((1, 4), bool))
    with pytest.raises(InputError, match="how many photos saw"):
        covered(image, 2)
