"""The domain types refuse what they cannot mean, and say so."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from si3fp.errors import InputError
from si3fp.model import (
    Building,
    Detections,
    Facade,
    FacadeGrid,
    FacadeViews,
    Footprint,
    GeoOrigin,
    OrthoImage,
    Panorama,
    Planes,
    Rigid3,
    Window,
)

HERE = Rigid3(np.eye(3), np.zeros(3))
ORIGIN = GeoOrigin(57.7, 11.97, 0.0)
SQUARE = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
ONE_PLANE = Planes([[0.0, 0.0, 1.0]], [5.0])


def image(height=4, width=6, **layers) -> OrthoImage:
    valid = layers.pop("valid", np.ones((height, width), bool))
    return OrthoImage("p1", np.zeros((height, width, 3), np.uint8), valid, **layers)


def test_a_panorama_knows_where_it_stands():
    pano_from_world = Rigid3(np.eye(3), np.array([3.0, 4.0, 5.0])).inverse()
    np.testing.assert_allclose(Panorama("p", "", pano_from_world).centre_in_world, [3, 4, 5])


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"id": ""}, "needs an id"),
        ({"planes_in_pano": ONE_PLANE}, "p: planes and plane index come together"),
        ({"plane_index": np.zeros((2, 4), np.int32)}, "p: planes and plane index come together"),
        (
            {"planes_in_pano": ONE_PLANE, "plane_index": np.zeros(8, np.int32)},
            "p: the plane index is 2-D",
        ),
        (
            {"planes_in_pano": ONE_PLANE, "plane_index": np.ones((2, 4), np.int32)},
            "p: plane index 1 but 1 planes",
        ),
    ],
)
def test_panoramas_without_id_or_with_half_a_plane_map_are_refused(fields, message):
    with pytest.raises(InputError, match=message):
        Panorama(**{"id": "p", "captured": "", "pano_from_world": HERE, **fields})


@pytest.mark.parametrize(
    "rgb", [np.zeros((4, 6), np.uint8), np.zeros((4, 6, 4), np.uint8), np.zeros((4, 6, 3))]
)
def test_an_orthographic_image_is_rgb_of_bytes(rgb):
    with pytest.raises(InputError, match="p1: rgb must be"):
        OrthoImage("p1", rgb, np.ones((4, 6), bool))


@pytest.mark.parametrize(
    ("name", "layer"),
    [
        ("valid", np.ones((6, 4), bool)),
        ("depth_m", np.zeros((4, 5), np.float32)),
        ("seen_by", np.zeros((3, 6), np.uint8)),
    ],
)
def test_layers_of_another_size_than_the_image_are_refused(name, layer):
    with pytest.raises(InputError, match=f"p1: {name} and rgb differ in size"):
        image(**{name: layer})


def test_views_have_the_size_of_their_grid():
    grid = FacadeGrid(HERE, 6, 4, 0.02)
    assert FacadeViews("b-0", grid, (image(), image())).views[1].source == "p1"
    with pytest.raises(InputError, match=r"Facade b-0: view p1 is \(5, 6\), the grid \(4, 6\)"):
        FacadeViews("b-0", grid, (image(), image(height=5)))


def test_detections_are_parallel_arrays():
    found = Detections([[0, 0, 2, 3], [5, 5, 6, 7]], [0.9, 0.4], ["window", "balcony"])
    assert len(found) == 2
    assert found.select(found.scores > 0.5).labels.tolist() == ["window"]
    assert found.select(np.array([1, 0])).scores.tolist() == [0.4, 0.9]
    assert len(Detections([], [], [])) == 0
    with pytest.raises(InputError, match="1 boxes, 2 scores, 1 labels"):
        Detections([[0, 0, 2, 3]], [0.9, 0.4], ["window"])


@pytest.mark.parametrize(
    "place", [(np.nan, 0, 1, 1), (0, np.inf, 1, 1), (0, 0, 0, 1), (0, 0, 1, -1), (0, 0, 1, np.nan)]
)
def test_a_window_needs_a_place_and_a_size(place):
    with pytest.raises(InputError, match="finite position and a positive size"):
        Window(*place)


def test_the_window_to_wall_ratio_is_over_the_gross_area():
    windows = (Window(1, 1, 1.0, 2.0), Window(4, 0, 1.0, 2.0, label="balcony_door"))
    facade = Facade("b-0", HERE, 10.0, 4.0, windows)
    assert facade.wwr == pytest.approx(4.0 / 40.0)
    np.testing.assert_allclose(facade.centre_in_world, [5.0, 2.0, 0.0])


def test_a_facade_without_area_is_refused():
    with pytest.raises(InputError, match=r"Facade b-0 has no area: 10\.0 x 0\.0 m"):
        Facade("b-0", HERE, 10.0, 0.0)


@pytest.mark.parametrize(
    ("outline", "message"),
    [
        (SQUARE[:2], r"at least 3 corners, got \(2, 2\)"),
        (np.zeros((4, 3)), r"at least 3 corners, got \(4, 3\)"),
        (SQUARE[::-1], "counter-clockwise, area -100.0"),
        (np.where(SQUARE == 10, np.nan, SQUARE), "Footprint f contains NaN"),
    ],
)
def test_what_is_no_outline_is_refused(outline, message):
    with pytest.raises(InputError, match=message):
        Footprint("f", outline)


def test_a_building_stands_above_the_ground():
    with pytest.raises(InputError, match="Building b: height must be positive"):
        Building("b", ORIGIN, SQUARE, 0.0, height_m=0.0, storeys=1)
    with pytest.raises(InputError, match="Building b: needs at least one storey"):
        Building("b", ORIGIN, SQUARE, 0.0, height_m=6.0, storeys=0)


def test_the_types_cannot_be_changed():
    facade = Facade("b-0", HERE, 10.0, 4.0)
    with pytest.raises(FrozenInstanceError):
        facade.width_m = 11.0
