"""The file of measured distances: what is read, and what is refused."""

from __future__ import annotations

import pytest

from si3fp.errors import InputError
from si3fp.model import KnownDistance
from si3fp.sources.triangle import read_known_distances


def test_the_file_of_a_triangle_is_read(tmp_path):
    path = tmp_path / "triangle.json"
    path.write_text('{"what": "x", "sides_m": [["a.jpg", "b.jpg", 7.412], ["b.jpg", "c.jpg", 3]]}')
    assert read_known_distances(path) == (
        KnownDistance("a.jpg", "b.jpg", 7.412),
        KnownDistance("b.jpg", "c.jpg", 3.0),
    )


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "not readable as JSON"),
        ("[]", "has no list `sides_m`"),
        ('{"sides_m": []}', "has no list `sides_m`"),
        ('{"sides_m": [["a.jpg", "b.jpg"]]}', "side 1 is .*expected two photo names"),
        ('{"sides_m": [["a.jpg", "b.jpg", "7 m"]]}', "side 1 is .*expected two photo names"),
        ('{"sides_m": [["a.jpg", "b.jpg", true]]}', "side 1 is .*expected two photo names"),
        ('{"sides_m": [["a", "b", 1], ["a", "b", NaN]]}', "side 2: .*give the length measured"),
        ('{"sides_m": [["a", "b", 0]]}', "side 1: .*give the length measured"),
        ('{"sides_m": [["a", "a", 1]]}', "side 1: .*two different points"),
    ],
)
def test_a_broken_file_says_which_side_and_what_to_write(tmp_path, content, message):
    path = tmp_path / "triangle.json"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        read_known_distances(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="There is no file"):
        read_known_distances(tmp_path / "none.json")
