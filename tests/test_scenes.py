"""The synthetic street is what it says: poses, planes, windows and pictures agree."""

from __future__ import annotations

import numpy as np
import pytest
from tests.scenes import Street, make_street

from si3fp.geometry.equirect import directions_from_pixels, pixels_from_directions
from si3fp.geometry.planes import ray_plane_distances


@pytest.fixture(scope="module")
def street() -> Street:
    return make_street(seed=1, size="tiny")


def test_a_street_has_images_planes_and_truth(street: Street) -> None:
    assert [panorama.id for panorama in street.noisy] == ["pano-00", "pano-01", "pano-02"]
    assert all(image.shape == (512, 1024, 3) for image in street.images.values())
    front = street.truth[0]
    assert front.id == "house-a-0"
    assert len(front.windows) == 5
    assert 0.05 < front.wwr < 0.4
    assert [facade.wwr for facade in street.truth[1:]] == [0.0, 0.0]


def test_the_same_seed_gives_the_same_pixels(street: Street) -> None:
    again = make_street(seed=1, size="tiny")
    for name, image in street.images.items():
        assert np.array_equal(image, again.images[name])


def test_plane_maps_place_the_front_wall_where_the_truth_says(street: Street) -> None:
    front = street.truth[0]
    for panorama in street.exact:
        assert panorama.planes_in_pano is not None
        assert panorama.plane_index is not None
        centre_in_pano = panorama.pano_from_world.apply(front.centre_in_world)
        height, width = panorama.plane_index.shape
        x, y = pixels_from_directions(centre_in_pano, width, height).astype(int)
        plane = panorama.plane_index[y, x]
        distance = ray_plane_distances(
            np.zeros(3),
            directions_from_pixels([x + 0.5, y + 0.5], width, height),
            panorama.planes_in_pano.normals[plane],
            panorama.planes_in_pano.offsets_m[plane],
        )
        # One cell of the plane map spans 0.7 degrees: 0.12 m at 9.7 m.
        assert distance == pytest.approx(np.linalg.norm(centre_in_pano), abs=0.15)
        assert panorama.planes_in_pano.offsets_m.min() > 0


def test_windows_are_darker_than_their_surrounds_where_the_truth_says(street: Street) -> None:
    front = street.truth[0]
    for panorama in street.exact:
        image = street.images[panorama.id].astype(float)
        for window in front.windows:
            # A little below the middle: not on the transom, half a casement off the mullion.
            places = {
                "pane": (0.25, 0.4),
                "surround": (-0.07 / window.width_m, 0.4),
            }
            value = {}
            for name, (across, up) in places.items():
                depth = -0.10 if name == "pane" else 0.0
                point = [
                    window.x_m + across * window.width_m,
                    window.y_m + up * window.height_m,
                    depth,
                ]
                in_pano = panorama.pano_from_world.apply(front.world_from_facade.apply(point))
                x, y = pixels_from_directions(in_pano, 1024, 512).astype(int)
                value[name] = image[y, x].mean()
            assert value["pane"] < value["surround"] - 10


def test_noise_stays_within_what_is_promised(street: Street) -> None:
    for exact, noisy in zip(street.exact, street.noisy, strict=True):
        shift = np.linalg.norm(exact.centre_in_world - noisy.centre_in_world)
        assert 0.0999 < shift < 0.1501
        turn = exact.pano_from_world.rotation @ noisy.pano_from_world.rotation.T
        angle_deg = np.rad2deg(np.arccos((np.trace(turn) - 1) / 2))
        assert 0.15 < angle_deg < 0.32
