"""Turning a model whose north is unknown."""

from __future__ import annotations

from typing import Any

import numpy as np

from si3fp.thermal.hbjson import DECIMALS, Json


def north_is_known(hbjson: Json) -> bool:
    """Whether the y axis of a model points north; models of other tools are taken to say so."""
    written = (hbjson.get("user_data") or {}).get("si3fp") or {}
    return bool(written.get("north_known", True))


def turned(hbjson: Json, north_deg: float) -> Json:
    """The model with its y axis, up to now of unknown direction, at a compass bearing.

    Parameters
    ----------
    hbjson
        A honeybee model; all its faces are turned about the world's z axis.
    north_deg
        Compass bearing of the model's y axis, clockwise from north.
    """
    angle = np.deg2rad(north_deg)
    # Clockwise seen from above: y (north) goes to (sin, cos).
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    result: Json = _turned(hbjson, turn)
    user_data = dict(result.get("user_data") or {})
    user_data["si3fp"] = {
        **(user_data.get("si3fp") or {}),
        "north_known": True,
        "turned_by_deg": float(north_deg),
    }
    return {**result, "user_data": user_data}


def _turned(value: Any, turn: Any) -> Any:
    if isinstance(value, dict):
        if value.get("type") == "Face3D":
            return _turned_face(value, turn)
        return {key: _turned(item, turn) for key, item in value.items()}
    if isinstance(value, list):
        return [_turned(item, turn) for item in value]
    return value


def _turned_face(face: Json, turn: Any) -> Json:
    """A polygon with its holes; a stated plane is left out, because the corners imply it."""
    face = {key: item for key, item in face.items() if key != "plane"}
    face["boundary"] = _turned_ring(face["boundary"], turn)
    if face.get("holes"):
        face["holes"] = [_turned_ring(ring, turn) for ring in face["holes"]]
    return face


def _turned_ring(ring: list[list[float]], turn: Any) -> list[list[float]]:
    corners = np.asarray(ring, dtype=np.float64)
    corners[:, :2] = corners[:, :2] @ turn.T
    rounded: list[list[float]] = (corners.round(DECIMALS) + 0.0).tolist()
    return rounded
