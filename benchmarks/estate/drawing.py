"""How plans are drawn: by generators named after what they draw, rounded to a millimetre.

So a spec and a seed give one plan everywhere.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")


def rng_of(seed: int, *names: object) -> np.random.Generator:
    """A generator of its own for every named thing: adding one thing leaves the others alone."""
    text = "/".join([str(seed), *(str(name) for name in names)])
    return np.random.default_rng(int.from_bytes(hashlib.sha256(text.encode()).digest()[:16], "big"))


def millimetres(value: float) -> float:
    """The length rounded to a millimetre."""
    return round(float(value), 3)


def pick(rng: np.random.Generator, choices: Sequence[T]) -> T:
    """One of them, all equally likely."""
    return choices[int(rng.integers(len(choices)))]


def between(rng: np.random.Generator, low: float, high: float, step: float = 0.05) -> float:
    """A length between two, on steps of the trade's grid."""
    steps = round((high - low) / step)
    return millimetres(low + step * int(rng.integers(steps + 1)))
