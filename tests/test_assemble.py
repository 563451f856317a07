"""The thermal model: geometry against hand computation, EnergyPlus's rules, honeybee's schema."""

import json
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from honeybee_schema.model import Model
from hypothesis import given, settings
from hypothesis import strategies as st

from si3fp.config import ThermalConfig
from si3fp.errors import ThermalModelError
from si3fp.geometry.rigid import Rigid3
from si3fp.model import Building, Facade, GeoOrigin, Missing, Window
from si3fp.thermal.archetypes import archetype, countries
from si3fp.thermal.assemble import assemble
from si3fp.thermal.constructions import SURFACE_RESISTANCES_M2K_W, energy_properties

CONFIG = ThermalConfig()
ORIGIN = GeoOrigin(57.7, 11.97, 12.0)
BOX = [(0.0, 0.0), (12.0, 0.0), (12.0, 8.0), (0.0, 8.0)]
ROUNDING_M2 = 1e-4  # vertices are rounded to a micrometre, walls are some 10 m long
SE_1970 = archetype("SE", 1970, 1970)


def edge_frame(start, end, z_m=0.0):
    """Frame of the facade on a footprint edge, outside on its right."""
    x, y = np.subtract(end, start) / np.linalg.norm(np.subtract(end, start))
    return Rigid3(np.array([[x, 0, y], [y, 0, -x], [0, 1, 0]]), np.array([*start, z_m]))


def make_building(windows_by_edge=None, outline=BOX, height_m=6.0, storeys=2, name="b", **fields):
    outline = np.array(outline, dtype=float)
    facades = []
    for index, windows in (windows_by_edge or {}).items():
        start, end = outline[index], outline[(index + 1) % len(outline)]
        facades.append(
            Facade(
                f"{name}-{index}",
                edge_frame(start, end, fields.get("base_z_m", 0.0)),
                float(np.linalg.norm(end - start)),
                height_m,
                tuple(windows),
            )
        )
    fields = {"base_z_m": 0.0, "year": 1970, **fields}
    return Building(
        name, ORIGIN, outline, height_m=height_m, storeys=storeys, facades=tuple(facades), **fields
    )


def build(*buildings, **arguments):
    """The assembled model, valid by honeybee's schema and by EnergyPlus's rules."""
    model = assemble(buildings, {b.id: SE_1970 for b in buildings}, CONFIG, **arguments)
    check(model.hbjson)
    return model


def check(hbjson):
    Model.model_validate(hbjson)
    assert json.loads(json.dumps(hbjson)) == hbjson
    names = []
    for face in all_faces(hbjson):
        names.append(face["identifier"])
        for aperture in face["apertures"]:
            names.append(aperture["identifier"])
        check_openings(face)
    names += [room["identifier"] for room in hbjson["rooms"]]
    assert len({name.lower() for name in names}) == len(names)
    assert all(len(name) <= 100 for name in names)
    conditions = {
        face["identifier"]: face["boundary_condition"].get("boundary_condition_objects")
        for face in all_faces(hbjson)
    }
    for name, objects in conditions.items():
        if objects:
            assert conditions[objects[0]][0] == name
    for room in hbjson["rooms"]:
        check_closed(room)


def check_closed(room):
    """Every edge of a face is used once in each direction: a solid with outward faces."""
    seen = set()
    for face in room["faces"]:
        ring = [tuple(corner) for corner in face["geometry"]["boundary"]]
        for start, end in zip(ring, ring[1:] + ring[:1], strict=True):
            assert (start, end) not in seen
            seen.add((start, end))
    assert all((end, start) in seen for start, end in seen)


def check_openings(face):
    """Coplanar, strictly inside by the inset, not overlapping, same orientation as the wall."""
    if not face["apertures"]:
        return
    corners = np.array(face["geometry"]["boundary"])
    x_axis = (corners[1] - corners[0]) / np.linalg.norm(corners[1] - corners[0])
    normal = np.cross(x_axis, corners[2] - corners[1])
    normal /= np.linalg.norm(normal)
    y_axis = np.cross(normal, x_axis)
    boxes = []
    for aperture in face["apertures"]:
        points = np.array(aperture["geometry"]["boundary"]) - corners[0]
        assert np.abs(points @ normal).max() < 1e-5
        assert np.cross(points[1] - points[0], points[2] - points[1]) @ normal > 0
        x, y = points @ x_axis, points @ y_axis
        width = (corners[1] - corners[0]) @ x_axis
        height = (corners[2] - corners[1]) @ y_axis
        inset = CONFIG.inset_m - 1e-5
        assert x.min() > inset and x.max() < width - inset
        assert y.min() > inset and y.max() < height - inset
        assert x.max() - x.min() > 0.0999 and y.max() - y.min() > 0.0999
        boxes.append((x.min(), x.max(), y.min(), y.max()))
    for a, b in combinations(boxes, 2):
        wide = min(a[1], b[1]) - max(a[0], b[0])
        high = min(a[3], b[3]) - max(a[2], b[2])
        assert wide < 1e-5 or high < 1e-5


def all_faces(hbjson):
    return [face for room in hbjson["rooms"] for face in room["faces"]] + hbjson["orphaned_faces"]


def walls(model):
    return [face for face in all_faces(model.hbjson) if face["face_type"] == "Wall"]


def apertures(model):
    return [aperture for wall in walls(model) for aperture in wall["apertures"]]


def area_m2(face):
    ring = np.array(face["geometry"]["boundary"])
    total = sum(np.cross(a, b) for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True))
    return float(np.linalg.norm(total)) / 2


def test_areas_of_a_box_are_those_computed_by_hand():
    windows = [Window(1.0, 0.9, 1.4, 1.5), Window(4.0, 4.0, 2.0, 1.2)]
    model = build(make_building({0: windows}))
    assert len(model.hbjson["rooms"]) == 2
    assert sum(map(area_m2, walls(model))) == pytest.approx(2 * (12 + 8) * 6, abs=ROUNDING_M2)
    faces = {face["identifier"]: face for face in all_faces(model.hbjson)}
    assert area_m2(faces["b-s0-floor"]) == pytest.approx(96, abs=ROUNDING_M2)
    assert faces["b-s0-floor"]["boundary_condition"]["type"] == "Ground"
    assert faces["b-s1-ceiling"]["boundary_condition"]["type"] == "Outdoors"
    assert faces["b-s0-ceiling"]["boundary_condition"]["boundary_condition_objects"] == [
        "b-s1-floor",
        "b-s1",
    ]
    glass = sum(map(area_m2, apertures(model)))
    assert glass == pytest.approx(1.4 * 1.5 + 2.0 * 1.2, abs=ROUNDING_M2)
    assert model.notes == ()


def test_a_window_stands_where_the_facade_says():
    model = build(make_building({1: [Window(2.0, 1.0, 1.5, 1.2)]}))
    (aperture,) = apertures(model)
    # Edge 1 runs north along x = 12; seen from outside (east) its left end is the south one.
    expected = [[12, 2, 1], [12, 3.5, 1], [12, 3.5, 2.2], [12, 2, 2.2]]
    np.testing.assert_allclose(aperture["geometry"]["boundary"], expected, atol=1e-6)


def test_walls_face_outwards():
    model = build(make_building())
    for wall in walls(model):
        ring = np.array(wall["geometry"]["boundary"])
        normal = np.cross(ring[1] - ring[0], ring[2] - ring[1])
        assert normal @ (ring.mean(axis=0) - [6, 4, 3]) > 0


def test_a_facade_some_centimetres_and_tenths_of_a_degree_off_keeps_its_windows():
    building = make_building({0: [Window(3.0, 1.0, 1.4, 1.4)]})
    facade = building.facades[0]
    turn = np.deg2rad(0.4)
    about_up = np.array(
        [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
    )
    moved = Facade(
        facade.id,
        Rigid3(
            about_up @ facade.world_from_facade.rotation,
            facade.world_from_facade.translation - np.array([0.0, 0.07, 0.0]),
        ),
        facade.width_m,
        facade.height_m,
        facade.windows,
    )
    model = build(
        Building("b", ORIGIN, building.footprint_in_world, 0.0, 6.0, 2, facades=(moved,), year=1970)
    )
    (aperture,) = apertures(model)
    ring = np.array(aperture["geometry"]["boundary"])
    np.testing.assert_allclose(ring[:, 1], 0.0, atol=1e-6)  # on the footprint edge y = 0
    assert ring[0][0] == pytest.approx(3.0, abs=0.001)
    assert area_m2(aperture) == pytest.approx(1.96, rel=1e-4)  # cosine of 0.4 degrees
    assert model.notes == ()


def test_a_shift_beyond_30_centimetres_is_noted():
    building = make_building({0: [Window(3.0, 1.0, 1.4, 1.4)]})
    facade = building.facades[0]
    start = facade.world_from_facade.translation - np.array([0.0, 0.45, 0.0])
    pose = Rigid3(facade.world_from_facade.rotation, start)
    shifted = Facade(facade.id, pose, 12.0, 6.0, facade.windows)
    model = build(
        Building("b", ORIGIN, building.footprint_in_world, 0.0, 6.0, 2, facades=(shifted,))
    )
    assert len(apertures(model)) == 1
    assert any("moved by up to 0.45 m" in note for note in model.notes)


def test_a_facade_turned_away_from_its_edge_loses_its_windows():
    building = make_building({0: [Window(3.0, 1.0, 1.4, 1.4)]})
    pose = edge_frame((0, 0), (0, 8))
    turned = Facade("b-0", pose, 8.0, 6.0, building.facades[0].windows)
    model = build(
        Building("b", ORIGIN, building.footprint_in_world, 0.0, 6.0, 2, facades=(turned,))
    )
    assert not apertures(model)
    assert any("turned by 90 degrees" in note for note in model.notes)


def test_a_window_across_a_slab_is_split_and_shares_its_id():
    model = build(make_building({0: [Window(2.0, 2.0, 1.0, 2.0)]}))
    lower, upper = apertures(model)
    assert lower["user_data"]["window_id"] == upper["user_data"]["window_id"] == "b-0-w0"
    assert lower["identifier"] != upper["identifier"]
    heights = [np.ptp(np.array(a["geometry"]["boundary"])[:, 2]) for a in (lower, upper)]
    np.testing.assert_allclose(heights, [0.98, 0.98], atol=1e-6)  # 2 cm to the slab on each side
    assert any("split by slabs into 2 parts (-0.04 m2)" in note for note in model.notes)


def test_a_sliver_beyond_a_slab_is_cut_off_and_noted():
    model = build(make_building({0: [Window(2.0, 1.0, 1.0, 2.05)]}))
    (aperture,) = apertures(model)
    assert area_m2(aperture) == pytest.approx(1.98, abs=ROUNDING_M2)
    assert any("cut at a slab" in note and "-0.07 m2" in note for note in model.notes)


def test_overlapping_windows_meet_in_the_middle():
    model = build(make_building({0: [Window(1.0, 1.0, 1.2, 1.2), Window(2.0, 1.0, 1.2, 1.2)]}))
    first, second = (np.array(a["geometry"]["boundary"]) for a in apertures(model))
    assert first[:, 0].max() == pytest.approx(2.1) == second[:, 0].min()
    assert any("overlap of 0.20 x 1.20 m" in note for note in model.notes)


def test_windows_above_one_another_are_separated_vertically():
    model = build(make_building({0: [Window(1.0, 1.1, 1.2, 1.0), Window(1.0, 0.3, 1.2, 1.0)]}))
    upper, lower = (np.array(a["geometry"]["boundary"]) for a in apertures(model))
    assert upper[:, 2].min() == pytest.approx(1.2) == lower[:, 2].max()


def test_the_weaker_of_two_windows_at_one_place_goes():
    twins = [Window(1.0, 1.0, 1.2, 1.2, score=0.5), Window(1.1, 1.0, 1.2, 1.2, score=0.9)]
    model = build(make_building({0: twins}))
    (aperture,) = apertures(model)
    assert aperture["user_data"]["score"] == 0.9
    assert any("b-0-w0: dropped" in note for note in model.notes)


def test_touching_windows_are_left_alone():
    model = build(make_building({0: [Window(1.0, 1.0, 1.0, 1.0), Window(2.0, 1.0, 1.0, 1.0)]}))
    assert len(apertures(model)) == 2
    assert model.notes == ()


def test_a_window_as_large_as_the_wall_leaves_a_rim():
    model = build(make_building({0: [Window(0.0, 0.0, 12.0, 3.0)]}, height_m=3.0, storeys=1))
    (aperture,) = apertures(model)
    assert area_m2(aperture) == pytest.approx(11.96 * 2.96, abs=ROUNDING_M2)
    assert any("clipped to its wall" in note for note in model.notes)


def test_a_window_outside_its_wall_is_dropped_and_noted():
    outside = [Window(13.0, 1.0, 1.0, 1.0), Window(2.0, 7.0, 1.0, 1.0)]
    model = build(make_building({0: outside}))
    assert not apertures(model)
    assert sum("entirely outside its wall" in note for note in model.notes) == 2


def test_a_window_half_outside_is_clipped():
    model = build(make_building({0: [Window(-0.5, 1.0, 1.5, 1.0)]}))
    (aperture,) = apertures(model)
    assert area_m2(aperture) == pytest.approx(0.98, abs=ROUNDING_M2)


def test_a_concave_footprint_has_walls_on_all_edges():
    outline = [(0, 0), (10, 0), (10, 4), (4, 4), (4, 9), (0, 9)]
    model = build(make_building({3: [Window(1.0, 1.0, 1.0, 1.0)]}, outline=outline))
    assert len(walls(model)) == 2 * 6
    floors = [face for face in all_faces(model.hbjson) if face["identifier"] == "b-s0-floor"]
    assert area_m2(floors[0]) == pytest.approx(10 * 4 + 4 * 5, abs=ROUNDING_M2)
    (aperture,) = apertures(model)
    np.testing.assert_allclose(np.array(aperture["geometry"]["boundary"])[:, 0], 4.0, atol=1e-6)


def test_duplicate_corners_lose_their_wall_and_the_others_keep_their_edge_index():
    outline = [(0, 0), (0.002, 0), (12, 0), (12, 8), (12, 8), (0, 8), (0, 0.003)]
    window = {3: [Window(1, 1, 1, 1)], 4: [Window(2.0, 1.0, 1.0, 1.0)]}
    model = build(
        make_building(outline=outline),
        make_building({4: window[4]}, outline=np.add(outline, [30, 0]), name="c"),
    )
    ids = [wall["user_data"]["facade_id"] for wall in model.hbjson["rooms"][0]["faces"][1:-1]]
    assert ids == ["b-1", "b-2", "b-4", "b-5"]
    (aperture,) = apertures(model)
    assert aperture["user_data"]["facade_id"] == "c-4"
    assert sum("no wall, the edge is shorter" in note for note in model.notes) == 6


def test_windows_of_a_vanished_edge_are_noted():
    outline = [(0, 0), (12, 0), (12, 8), (0, 8), (0, 0.003)]
    building = make_building(outline=outline)
    facade = Facade("b-4", edge_frame((0, 1), (0, 0)), 1.0, 6.0, (Window(0.1, 1.0, 0.5, 0.5),))
    model = build(
        Building("b", ORIGIN, building.footprint_in_world, 0.0, 6.0, 2, facades=(facade,))
    )
    assert any("b-4: its 1 windows are dropped" in note for note in model.notes)


def test_collinear_corners_stay_as_each_side_has_its_facade():
    outline = [(0, 0), (5, 0), (12, 0), (12, 8), (0, 8)]
    model = build(make_building({1: [Window(0.5, 1.0, 1.0, 1.0)]}, outline=outline))
    (aperture,) = apertures(model)
    assert aperture["geometry"]["boundary"][0][0] == pytest.approx(5.5)


def test_a_party_wall_is_adiabatic_up_to_the_lower_roof():
    low = make_building(
        outline=[(12.1, 0), (20, 0), (20, 8), (12.1, 8)], height_m=3.0, storeys=1, name="low"
    )
    model = build(make_building(), low)
    conditions = {wall["identifier"]: wall["boundary_condition"]["type"] for wall in walls(model)}
    assert conditions["b-s0-w1"] == "Adiabatic"
    assert conditions["b-s1-w1"] == "Outdoors"
    assert conditions["low-s0-w3"] == "Adiabatic"
    assert sum(kind == "Adiabatic" for kind in conditions.values()) == 2
    assert any(note == "b-1: party wall, adiabatic in the storeys 0." for note in model.notes)


@pytest.mark.parametrize(
    ("outline", "expected"),
    [
        ([(12.25, 0), (20, 0), (20, 8), (12.25, 8)], "Adiabatic"),
        ([(12.35, 0), (20, 0), (20, 8), (12.35, 8)], "Outdoors"),  # a gap of 0.35 m
        ([(12, 0), (20, 0), (20, 7.1), (12, 7.1)], "Outdoors"),  # covers 89 %
        ([(12, 0), (20, 0), (20, 7.3), (12, 7.3)], "Adiabatic"),  # covers 91 %
        ([(11.8, -2), (20, -2), (20, 9), (11.8, 9)], "Adiabatic"),  # overlaps by 0.2 m
    ],
)
def test_party_walls_need_ninety_percent_within_thirty_centimetres(outline, expected):
    neighbour = make_building(outline=outline, name="n")
    model = build(make_building(), neighbours=[neighbour])
    conditions = {wall["identifier"]: wall["boundary_condition"]["type"] for wall in walls(model)}
    assert conditions["b-s0-w1"] == conditions["b-s1-w1"] == expected
    assert len(model.hbjson["rooms"]) == 2  # a neighbour casts no room


def test_two_neighbours_together_cover_a_wall():
    first = make_building(outline=[(12, 0), (20, 0), (20, 4), (12, 4)], name="n")
    second = make_building(outline=[(12, 4), (20, 4), (20, 8), (12, 8)], name="m")
    model = build(make_building(), neighbours=[first, second])
    conditions = {wall["identifier"]: wall["boundary_condition"]["type"] for wall in walls(model)}
    assert conditions["b-s0-w1"] == "Adiabatic"


def test_a_party_wall_with_windows_stays_outdoors():
    neighbour = make_building(outline=[(12, 0), (20, 0), (20, 8), (12, 8)], name="n")
    model = build(make_building({1: [Window(1.0, 1.0, 1.0, 1.0)]}), neighbours=[neighbour])
    conditions = {wall["identifier"]: wall["boundary_condition"]["type"] for wall in walls(model)}
    assert conditions["b-s0-w1"] == "Outdoors"
    assert conditions["b-s1-w1"] == "Adiabatic"
    assert any("windows were found; the storeys 0 stay outdoors" in note for note in model.notes)


def test_walls_and_apertures_carry_where_they_come_from():
    window = Window(
        1.0,
        1.0,
        1.0,
        2.0,
        label="balcony_door",
        score=0.7,
        views=("p1", "p2"),
        edge_sigma_m=(0.01, 0.02, 0.03, 0.04),
        recess_m=0.1,
        evidence="seen in 2 views",
    )
    building = make_building({0: [window]}, missing=(Missing("b-2", "align", "one view only"),))
    model = build(building)
    by_facade = {wall["user_data"]["facade_id"]: wall["user_data"] for wall in walls(model)}
    assert by_facade["b-0"] == {"facade_id": "b-0"}
    assert by_facade["b-2"]["si3fp"]["missing"] == "align: one view only"
    assert "no facade was found" in by_facade["b-1"]["si3fp"]["missing"]
    (aperture,) = apertures(model)
    assert aperture["user_data"] == {
        "window_id": "b-0-w0",
        "facade_id": "b-0",
        "label": "balcony_door",
        "score": 0.7,
        "views": ["p1", "p2"],
        "origin": "detected",
        "evidence": "seen in 2 views",
        "recess_m": 0.1,
        "edge_sigma_m": [0.01, 0.02, 0.03, 0.04],
    }
    own = model.hbjson["user_data"]["si3fp"]
    assert own["origin"] == {"lat_deg": 57.7, "lon_deg": 11.97, "height_m": 12.0}
    assert own["buildings"][0]["year"] == 1970
    assert own["buildings"][0]["archetype"]["period"] == [1961, 1975]
    assert own["notes"] == list(model.notes)
    assert {room["user_data"]["building_id"] for room in model.hbjson["rooms"]} == {"b"}


def test_assumptions_of_the_archetype_are_notes_of_the_model():
    building = make_building()
    model = assemble([building], {"b": archetype("SE", None, 1970)}, CONFIG)
    assert any("1970 is assumed" in note for note in model.notes)


def test_facades_without_a_building_become_faces_without_a_room():
    loose = Facade(
        "wall-0", edge_frame((0, 0), (3, 4), 2.0), 5.0, 4.0, (Window(4.5, 1.0, 1.0, 1.0),)
    )
    model = build(loose_facades=[loose], origin=ORIGIN)
    (face,) = model.hbjson["orphaned_faces"]
    assert not model.hbjson["rooms"]
    assert area_m2(face) == pytest.approx(20.0, abs=ROUNDING_M2)
    assert area_m2(face["apertures"][0]) == pytest.approx(0.48, abs=ROUNDING_M2)
    assert face["user_data"]["facade_id"] == "wall-0"
    assert any("clipped" in note for note in model.notes)


def test_any_building_id_gives_valid_unique_names():
    far = [np.add(BOX, [100 * k, 0]) for k in range(4)]
    names = ["Østergade 5 ", "ostergade_5", "OSTERGADE_5", "x" * 150]
    buildings = [
        make_building({0: [Window(1, 1, 1, 1)]}, outline=outline, name=name)
        for name, outline in zip(names, far, strict=True)
    ]
    model = build(*buildings)
    assert [b["id"] for b in model.hbjson["user_data"]["si3fp"]["buildings"]] == names


def test_the_same_input_gives_the_same_model():
    def once():
        return json.dumps(build(make_building({0: [Window(1.0, 1.0, 1.2, 1.2)]})).hbjson)

    assert once() == once()


@pytest.mark.parametrize(
    ("outline", "message"),
    [
        ([(0, 0), (10, 0), (0, 8), (10, 8), (-5, 4)], "not a simple polygon"),
        ([(0, 0), (0.001, 0), (0.001, 0.001), (0, 0.001)], "corners farther apart"),
        ([(0, 0), (0.5, 0), (0.5, 0.5)], "at least 1.0 m2"),
    ],
)
def test_an_impossible_footprint_is_refused_by_name(outline, message):
    with pytest.raises(ThermalModelError, match=rf"Building b.*{message}"):
        build(make_building(outline=outline))


def test_inconsistent_input_is_refused():
    building = make_building()
    with pytest.raises(ThermalModelError, match="no archetype"):
        assemble([building], {}, CONFIG)
    with pytest.raises(ThermalModelError, match="needs a building or facade"):
        assemble([], {}, CONFIG, origin=ORIGIN)
    with pytest.raises(ThermalModelError, match="id 'b'"):
        build(building, building)
    for name in ("b-9", "b-x", "other-0"):
        facade = Facade(name, edge_frame((0, 0), (12, 0)), 12.0, 6.0)
        odd = Building("b", ORIGIN, np.array(BOX), 0.0, 6.0, 2, facades=(facade,))
        with pytest.raises(ThermalModelError, match=name):
            build(odd)
    elsewhere = Building("c", GeoOrigin(0, 0, 0), np.array(BOX) + 50, 0.0, 6.0, 2)
    with pytest.raises(ThermalModelError, match="one origin"):
        build(building, elsewhere)


def resistance_m2k_w(layer):
    if layer["type"] == "EnergyMaterialNoMass":
        return layer["r_value"]
    return layer["thickness"] / layer["conductivity"]


@pytest.mark.parametrize("country", countries())
def test_u_values_recomputed_from_the_layers_are_the_archetypes(country):
    for year in (1900, 1935, 1955, 1970, 1985, 2000, 2020):
        wanted = archetype(country, year, 1970)
        energy = energy_properties([wanted])
        layers = {layer["identifier"]: layer for layer in energy["materials"]}
        made = {
            c["identifier"]: [layers[m] for m in c["materials"]] for c in energy["constructions"]
        }
        (rules,) = energy["construction_sets"]
        for element, name in (
            ("wall", rules["wall_set"]["exterior_construction"]),
            ("roof", rules["roof_ceiling_set"]["exterior_construction"]),
            ("floor", rules["floor_set"]["ground_construction"]),
        ):
            total = sum(SURFACE_RESISTANCES_M2K_W[element]) + sum(map(resistance_m2k_w, made[name]))
            assert 1 / total == pytest.approx(getattr(wanted, f"u_{element}_w_m2k"), rel=1e-9)
            assert made[name][-1]["type"] == "EnergyMaterial"  # mass inside the insulation
        (glazing,) = made[rules["aperture_set"]["window_construction"]]
        assert glazing["u_factor"] == wanted.u_window_w_m2k
        assert glazing["shgc"] == pytest.approx(0.7 * wanted.g_window)  # 30 % frame


def test_buildings_of_one_period_share_their_constructions():
    first, second = make_building(), make_building(outline=np.add(BOX, [50, 0]), name="c")
    model = assemble(
        [first, second], {"b": SE_1970, "c": archetype("SE", None, 1970)}, CONFIG
    ).hbjson
    check(model)
    energy = model["properties"]["energy"]
    assert [rules["identifier"] for rules in energy["construction_sets"]] == ["SE-1961-1975"]


window = st.builds(
    Window,
    x_m=st.floats(-2, 13),
    y_m=st.floats(-2, 10),
    width_m=st.floats(0.05, 6),
    height_m=st.floats(0.05, 6),
    score=st.floats(0, 1),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(window, max_size=12), st.integers(1, 4))
def test_random_windows_always_give_valid_openings(windows, storeys):
    model = build(make_building({0: windows}, height_m=8.0, storeys=storeys))
    total = sum(map(area_m2, apertures(model)))
    assert total <= sum(w.area_m2 for w in windows) + ROUNDING_M2


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0.05, 0.4), st.floats(0.3, 1.5)), min_size=1, max_size=8),
    st.floats(0.05, 1.0),
    st.floats(0.5, 1.8),
)
def test_windows_that_need_no_repair_keep_their_area(gaps_and_widths, sill_m, height_m):
    windows, x = [], 0.0
    for gap, width in gaps_and_widths:
        windows += [Window(x + gap, y + sill_m, width, height_m) for y in (0.0, 3.0)]
        x += gap + width
    outline = [(0, 0), (x + 0.1, 0), (x + 0.1, 8), (0, 8)]
    model = build(make_building({0: windows}, outline=outline))
    assert model.notes == ()
    assert len(apertures(model)) == len(windows)
    assert sum(map(area_m2, apertures(model))) == pytest.approx(
        sum(w.area_m2 for w in windows), abs=ROUNDING_M2
    )


def test_storeys_lie_on_one_another():
    model = build(make_building(height_m=10.0, storeys=3, base_z_m=4.2))
    tops = [room["faces"][-1]["geometry"]["boundary"][0][2] for room in model.hbjson["rooms"]]
    feet = [room["faces"][0]["geometry"]["boundary"][0][2] for room in model.hbjson["rooms"]]
    assert feet[0] == pytest.approx(4.2)
    assert tops[-1] == pytest.approx(14.2)
    assert tops[:-1] == feet[1:]


def test_walls_state_the_interval_of_their_facade():
    building = make_building({0: [Window(1.0, 1.0, 1.0, 1.0)]})
    (facade,) = building.facades
    model = build(replace(building, facades=(replace(facade, wwr_interval=(0.02, 0.2)),)))
    stated = {
        wall["user_data"]["facade_id"]: wall["user_data"].get("wwr_interval")
        for wall in walls(model)
    }
    assert stated.pop("b-0") == [0.02, 0.2]
    assert set(stated.values()) == {None}
