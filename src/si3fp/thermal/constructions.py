"""Constructions, program and ideal heating of the thermal model as honeybee dictionaries.

Boundary conditions are those that TABULA uses for all countries (data set ``EU.MUH`` of its sheet
Tab.BoundaryCond, multi-unit housing), so that results compare across countries:

- internal gains 3 W/m2, constant, people and appliances together (``phi_int``);
- air change by use 0.4 1/h (``n_air_use``) and by leakage 0.2 1/h (Tab.Const.Infiltration
  "Medium"), of a room height of 2.5 m (``h_room``), constant;
- frames take 30 % of a window (``F_f``), so that its solar transmittance is 0.7 g.

Heating to 21 degC all year (Sveby, user data for dwellings); no cooling.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from si3fp.errors import ThermalModelError
from si3fp.thermal.archetypes import Archetype

HEATING_SETPOINT_C = 21.0  # Sveby, Brukarindata bostäder
COOLING_SETPOINT_C = 100.0  # never reached: no cooling
INTERNAL_GAINS_W_M2 = 3.0  # TABULA EU.MUH phi_int
AIR_CHANGE_USE_PER_H = 0.4  # TABULA EU.MUH n_air_use
AIR_CHANGE_LEAKAGE_PER_H = 0.2  # TABULA Tab.Const.Infiltration "Medium"
REFERENCE_ROOM_HEIGHT_M = 2.5  # TABULA EU.MUH h_room
FRAME_FRACTION = 0.3  # TABULA EU.MUH F_f; g is that of the glazing
OUTDOOR_AIR_M3_S_M2 = (
    (AIR_CHANGE_USE_PER_H + AIR_CHANGE_LEAKAGE_PER_H) * REFERENCE_ROOM_HEIGHT_M / 3600
)

# ISO 6946:2017, table 7: surface resistances inside and outside, m2K/W. TABULA's floor U-values
# leave the soil out, so there is no outside resistance.
SURFACE_RESISTANCES_M2K_W = {"wall": (0.13, 0.04), "roof": (0.10, 0.04), "floor": (0.17, 0.0)}

# ISO 10456:2007, table 3, concrete of high density; inside the insulation.
CONCRETE_W_MK = 2.0
CONCRETE_KG_M3 = 2400.0
CONCRETE_J_KGK = 1000.0
THICKNESS_M = {"wall": 0.15, "roof": 0.20, "floor": 0.20}
SLAB_M = 0.20  # decision: concrete between storeys
MIN_INSULATION_M2K_W = 0.01

PROGRAM = "si3fp residential"
HVAC = "si3fp ideal heating"
ALWAYS_ON, FRACTION = "Always On", "Fractional"  # honeybee's own names: it needs them anyway


def _concrete(
    identifier: str, thickness_m: float, conductivity_w_mk: float = CONCRETE_W_MK
) -> dict[str, Any]:
    return {
        "type": "EnergyMaterial",
        "identifier": identifier,
        "roughness": "MediumRough",
        "thickness": thickness_m,
        "conductivity": conductivity_w_mk,
        "density": CONCRETE_KG_M3,
        "specific_heat": CONCRETE_J_KGK,
        "thermal_absorptance": 0.9,
        "solar_absorptance": 0.6,
        "visible_absorptance": 0.6,
    }


def _opaque(identifier: str, element: str, u_w_m2k: float) -> tuple[str, list[dict[str, Any]]]:
    """Identifier and layers from outside to inside that give a U-value with ISO 6946's surfaces."""
    inside, outside = SURFACE_RESISTANCES_M2K_W[element]
    layers_m2k_w = 1 / u_w_m2k - inside - outside
    if layers_m2k_w < 0.005:
        raise ThermalModelError(
            f"No {element} has a U-value of {u_w_m2k} W/(m2K): its surfaces alone resist more."
        )
    thickness_m = THICKNESS_M[element]
    insulation_m2k_w = layers_m2k_w - thickness_m / CONCRETE_W_MK
    if insulation_m2k_w < MIN_INSULATION_M2K_W:  # uninsulated: all resistance in the mass
        conductivity = thickness_m / layers_m2k_w
        return identifier, [_concrete(f"{identifier} mass", thickness_m, conductivity)]
    insulation = {
        "type": "EnergyMaterialNoMass",
        "identifier": f"{identifier} insulation",
        "roughness": "MediumRough",
        "r_value": insulation_m2k_w,
        "thermal_absorptance": 0.9,
        "solar_absorptance": 0.6,
        "visible_absorptance": 0.6,
    }
    return identifier, [insulation, _concrete(f"concrete {1000 * thickness_m:.0f} mm", thickness_m)]


def solar_heat_gain(archetype: Archetype) -> float:
    """SHGC of a whole window: the glazing's g without the share of the frame."""
    return archetype.g_window * (1 - FRAME_FRACTION)


def _construction_set(archetype: Archetype) -> tuple[dict[str, Any], list[tuple[str, list[Any]]]]:
    name = archetype.name
    wall = _opaque(f"{name} wall", "wall", archetype.u_wall_w_m2k)
    roof = _opaque(f"{name} roof", "roof", archetype.u_roof_w_m2k)
    floor = _opaque(f"{name} floor", "floor", archetype.u_floor_w_m2k)
    party = "party wall", [_concrete(f"concrete {1000 * THICKNESS_M['wall']:.0f} mm", 0.15)]
    slab = "slab", [_concrete(f"concrete {1000 * SLAB_M:.0f} mm", SLAB_M)]
    window = (
        f"{name} window",
        [
            {
                "type": "EnergyWindowMaterialSimpleGlazSys",
                "identifier": f"{name} glazing and frame",
                "u_factor": archetype.u_window_w_m2k,
                "shgc": solar_heat_gain(archetype),
                "vt": solar_heat_gain(archetype),
            }
        ],
    )
    construction_set = {
        "type": "ConstructionSetAbridged",
        "identifier": name,
        "wall_set": {
            "type": "WallConstructionSetAbridged",
            "exterior_construction": wall[0],
            "interior_construction": party[0],
        },
        "floor_set": {
            "type": "FloorConstructionSetAbridged",
            "ground_construction": floor[0],
            "interior_construction": slab[0],
        },
        "roof_ceiling_set": {
            "type": "RoofCeilingConstructionSetAbridged",
            "exterior_construction": roof[0],
            "interior_construction": slab[0],
        },
        "aperture_set": {
            "type": "ApertureConstructionSetAbridged",
            "window_construction": window[0],
        },
    }
    return construction_set, [wall, roof, floor, party, slab, window]


def _constant_schedule(identifier: str, limit: str, value: float) -> dict[str, Any]:
    return {
        "type": "ScheduleRulesetAbridged",
        "identifier": identifier,
        "day_schedules": [
            {
                "type": "ScheduleDay",
                "identifier": f"{identifier} day",
                "values": [value],
                "times": [[0, 0]],
            }
        ],
        "default_day_schedule": f"{identifier} day",
        "schedule_type_limit": limit,
    }


def energy_properties(archetypes: Iterable[Archetype]) -> dict[str, Any]:
    """``ModelEnergyProperties`` that all rooms share, with one construction set per archetype.

    Raises
    ------
    ThermalModelError
        If a U-value cannot be built.
    """
    by_name = {archetype.name: archetype for archetype in archetypes}
    construction_sets = []
    constructions: dict[str, list[dict[str, Any]]] = {}
    for name in sorted(by_name):
        construction_set, parts = _construction_set(by_name[name])
        construction_sets.append(construction_set)
        constructions.update(parts)
    materials = {
        layer["identifier"]: layer for layers in constructions.values() for layer in layers
    }
    return {
        "type": "ModelEnergyProperties",
        "construction_sets": construction_sets,
        "constructions": [
            {
                "type": "WindowConstructionAbridged"
                if layers[0]["type"] == "EnergyWindowMaterialSimpleGlazSys"
                else "OpaqueConstructionAbridged",
                "identifier": identifier,
                "materials": [layer["identifier"] for layer in layers],
            }
            for identifier, layers in sorted(constructions.items())
        ],
        "materials": [materials[identifier] for identifier in sorted(materials)],
        "hvacs": [
            {
                "type": "IdealAirSystemAbridged",
                "identifier": HVAC,
                "economizer_type": "NoEconomizer",
                "heating_limit": {"type": "NoLimit"},
                "cooling_limit": 0,
            }
        ],
        "program_types": [_program()],
        "schedules": [
            _constant_schedule(ALWAYS_ON, FRACTION, 1.0),
            _constant_schedule("si3fp heating", "si3fp temperature", HEATING_SETPOINT_C),
            _constant_schedule("si3fp cooling", "si3fp temperature", COOLING_SETPOINT_C),
        ],
        "schedule_type_limits": [
            {
                "type": "ScheduleTypeLimit",
                "identifier": FRACTION,
                "lower_limit": 0,
                "upper_limit": 1,
                "numeric_type": "Continuous",
                "unit_type": "Dimensionless",
            },
            {
                "type": "ScheduleTypeLimit",
                "identifier": "si3fp temperature",
                "lower_limit": -273.15,
                "numeric_type": "Continuous",
                "unit_type": "Temperature",
            },
        ],
    }


def _program() -> dict[str, Any]:
    return {
        "type": "ProgramTypeAbridged",
        "identifier": PROGRAM,
        "electric_equipment": {
            "type": "ElectricEquipmentAbridged",
            "identifier": "si3fp internal gains",
            "watts_per_area": INTERNAL_GAINS_W_M2,
            "schedule": ALWAYS_ON,
            "radiant_fraction": 0.5,
            "latent_fraction": 0,
            "lost_fraction": 0,
        },
        "ventilation": {
            "type": "VentilationAbridged",
            "identifier": "si3fp air change by use and leakage",
            "flow_per_area": OUTDOOR_AIR_M3_S_M2,
        },
        "setpoint": {
            "type": "SetpointAbridged",
            "identifier": "si3fp setpoint",
            "heating_schedule": "si3fp heating",
            "cooling_schedule": "si3fp cooling",
        },
    }
