"""The synthetic street is what it says: poses, planes, windows and pictures agree."""

from __future__ import annotations

import json
from pathlib import Path

import honeybee_schema.model as honeybee
import numpy as np
import pytest
from tests.scenes import Street, make_street, write_street
from tests.scenes.photos import make_photos, write_photos

from si3fp.evaluate import evaluate, facades_from_hbjson
from si3fp.geometry.equirect import directions_from_pixels, pixels_from_directions
from si3fp.geometry.planes import ray_plane_distances
from si3fp.sources.colmap_text import read_colmap_text
from si3fp.sources.footprints import footprints_in_world, read_footprints
from si3fp.sources.local import image_loader, panoramas_in_world, read_panorama_records


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


@pytest.fixture(scope="module")
def folder(street: Street, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("street")
    write_street(street, path)
    return path


def test_the_files_hold_the_noisy_panoramas_and_the_footprints(
    street: Street, folder: Path
) -> None:
    panoramas = panoramas_in_world(
        read_panorama_records(folder / "panoramas.geojson"), street.origin
    )
    for written, noisy in zip(panoramas, street.noisy, strict=True):
        assert written.id == noisy.id
        assert written.links == noisy.links
        assert written.centre_in_world == pytest.approx(noisy.centre_in_world, abs=1e-3)
        turn = written.pano_from_world.rotation @ noisy.pano_from_world.rotation.T
        assert turn == pytest.approx(np.eye(3), abs=1e-5)
        assert written.planes_in_pano is not None
        assert noisy.planes_in_pano is not None
        assert written.planes_in_pano.normals == pytest.approx(
            noisy.planes_in_pano.normals, abs=1e-6
        )
        assert written.planes_in_pano.offsets_m == pytest.approx(noisy.planes_in_pano.offsets_m)
        assert np.array_equal(written.plane_index, noisy.plane_index)
    (footprint,) = footprints_in_world(
        read_footprints(folder / "footprints.geojson"), street.origin
    )
    (true,) = street.footprints
    assert footprint.outline_in_world == pytest.approx(true.outline_in_world, abs=1e-3)
    assert footprint.ground_m == pytest.approx(0.0, abs=1e-4)
    assert footprint.height_m == pytest.approx(true.height_m)


def test_the_images_are_those_that_were_rendered(street: Street, folder: Path) -> None:
    load = image_loader(read_panorama_records(folder / "panoramas.geojson"))
    for name, image in street.images.items():
        difference = np.abs(load(name).astype(float) - image)
        assert difference.mean() < 5  # JPEG


def test_the_true_model_is_a_valid_honeybee_model_of_the_same_facades(
    street: Street, folder: Path
) -> None:
    model = json.loads((folder / "truth.hbjson").read_text())
    honeybee.Model.model_validate(model)
    origin, facades = facades_from_hbjson(model)
    assert origin == street.origin
    result = evaluate(facades, street.truth)
    assert result.windows_total.f1 == 1.0
    assert result.windows_total.mean_abs_position_error_m == pytest.approx(0.0, abs=1e-5)
    assert result.wwr_total.mean_absolute == pytest.approx(0.0, abs=1e-5)


def test_photos_and_their_files_agree(tmp_path: Path) -> None:
    house = make_photos()
    write_photos(house, tmp_path)
    model = read_colmap_text(tmp_path / "cameras")
    assert [photo.id for photo in model.photos] == list(house.images)
    seen = 0
    for photo, exact in zip(model.photos, house.photos, strict=True):
        np.testing.assert_allclose(photo.centre_in_world, exact.centre_in_world, atol=1e-9)
        mine = [photo.id in ids for ids in model.points.photo_ids]
        pixels = photo.camera.project(
            photo.cam_from_world.apply(model.points.points_in_world[mine])
        )
        assert (pixels > -2).all()  # points are a centimetre off
        assert (pixels < [642, 482]).all()
        # Points have the colour that the photo shows there, shaded and haze aside.
        x, y = pixels.astype(int).clip(0, [639, 479]).T
        shown = house.images[photo.id][y, x].astype(float)
        true = model.points.rgb[mine].astype(float)
        assert np.corrcoef(shown.ravel(), true.ravel())[0, 1] > 0.8
        seen += len(pixels)
    assert seen > 5000
