"""Distances measured on site: ``{"sides_m": [["a.jpg", "b.jpg", 7.412], ...]}``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from si3fp.errors import InputError
from si3fp.model import KnownDistance

_EXPECTED = '{"sides_m": [["a.jpg", "b.jpg", 7.412], ...]}'


def read_known_distances(path: Path) -> tuple[KnownDistance, ...]:
    """The distances of a file, between the places from which the named photos were taken.

    A triangle has three sides; any number from one on can be given. Other keys are ignored.

    Raises
    ------
    InputError
        If the file is missing or not of this form, or a distance is not positive and finite.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError as error:
        raise InputError(f"There is no file {path}.") from error
    except (ValueError, RecursionError, OSError) as error:
        raise InputError(f"{path} is not readable as JSON: {error}. Write {_EXPECTED}.") from error
    sides = content.get("sides_m") if isinstance(content, dict) else None
    if not isinstance(sides, list) or not sides:
        raise InputError(f"{path} has no list `sides_m`, got {content!r:.80}. Write {_EXPECTED}.")
    return tuple(_distance(side, f"{path}, side {n}") for n, side in enumerate(sides, start=1))


def _distance(side: Any, where: str) -> KnownDistance:
    match side:
        case [str(start), str(end), int(length) | float(length)] if not isinstance(length, bool):
            try:
                return KnownDistance(start, end, float(length))
            except (InputError, OverflowError) as error:
                raise InputError(f"{where}: {error}") from error
    raise InputError(
        f'{where} is {side!r:.80}; expected two photo names and metres, ["a.jpg", "b.jpg", 7.412].'
    )
