"""Files of a run: written in one step, named safely, and errors that say what to do."""

from __future__ import annotations

import errno
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import si3fp
from si3fp.errors import InputError, SourceError
from si3fp.workspace import (
    Workspace,
    dump_json,
    key_of,
    read_array,
    read_json,
    read_png,
    safe_name,
    sha256_of,
    write_array,
    write_bytes,
    write_png,
    write_text,
)


def files_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def break_writing(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    """Let every write stop half-way, as a full disk does."""
    write = Path.write_bytes

    def stop_half_way(self: Path, content: bytes) -> int:
        write(self, content[: len(content) // 2])
        raise OSError(number, "No space left on device" if number == errno.ENOSPC else "I/O error")

    monkeypatch.setattr(Path, "write_bytes", stop_half_way)


def test_folders_are_made_and_nothing_else_is_left(tmp_path):
    write_text(tmp_path / "a" / "b" / "c.txt", "Fönster")
    assert (tmp_path / "a/b/c.txt").read_text(encoding="utf-8") == "Fönster"
    assert files_in(tmp_path / "a" / "b") == ["c.txt"]


def test_an_error_while_writing_leaves_the_old_file(tmp_path, monkeypatch):
    file = tmp_path / "facade.json"
    write_text(file, "old")
    break_writing(monkeypatch, errno.EIO)
    with pytest.raises(SourceError):
        write_text(file, "new content")
    assert file.read_text() == "old"
    assert files_in(tmp_path) == ["facade.json"]


def test_an_error_that_is_no_disk_error_leaves_the_old_file_too(tmp_path, monkeypatch):
    file = tmp_path / "facade.json"
    write_text(file, "old")

    def interrupt(self: Path, content: bytes) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "write_bytes", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_text(file, "new")
    assert file.read_text() == "old"
    assert files_in(tmp_path) == ["facade.json"]


def test_a_full_disk_is_said_with_the_file_and_what_to_do(tmp_path, monkeypatch):
    break_writing(monkeypatch, errno.ENOSPC)
    file = tmp_path / "run" / "model.hbjson"
    with pytest.raises(SourceError) as caught:
        write_bytes(file, b"content")
    message = str(caught.value)
    assert message.startswith(f"Could not write {file}: No space left on device.")
    assert "Free space or choose another folder" in message
    assert files_in(tmp_path / "run") == []


def test_a_folder_that_cannot_be_made_is_said(tmp_path):
    (tmp_path / "run").write_text("a file, no folder")
    with pytest.raises(SourceError, match=r"Could not write .*run\.json"):
        write_text(tmp_path / "run" / "run.json", "{}")


@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3), (5, 7, 4)])
def test_images_come_back_as_they_were_written(tmp_path, shape):
    image = np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)
    write_png(tmp_path / "image.png", image)
    np.testing.assert_array_equal(read_png(tmp_path / "image.png"), image)


def test_images_are_read_without_handing_cv2_a_path(tmp_path, monkeypatch):
    """On Windows cv2 cannot open the paths that Python can, such as ``Hausübersicht``."""
    image = np.arange(60, dtype=np.uint8).reshape(4, 5, 3)
    write_png(tmp_path / "Hausübersicht" / "image.png", image)
    monkeypatch.delattr("cv2.imread")
    np.testing.assert_array_equal(read_png(tmp_path / "Hausübersicht" / "image.png"), image)


def test_an_image_that_cannot_be_read_is_said(tmp_path):
    with pytest.raises(SourceError, match="delete it and run the same command again"):
        read_png(tmp_path / "none.png")
    (tmp_path / "empty.png").touch()
    with pytest.raises(SourceError, match="delete it and run the same command again"):
        read_png(tmp_path / "empty.png")
    (tmp_path / "image.png").write_bytes(b"\x89PNG")
    with pytest.raises(SourceError, match="delete it and run the same command again"):
        read_png(tmp_path / "image.png")


def test_arrays_come_back_as_they_were_written(tmp_path):
    array = np.array([[1.5, np.nan], [-2.0, 3.0]], np.float32)
    write_array(tmp_path / "array.npy", array)
    np.testing.assert_array_equal(read_array(tmp_path / "array.npy"), array)


def test_json_holds_plain_numbers_and_no_nan():
    assert json.loads(dump_json({"a": np.float32(0.5), "b": np.arange(2)})) == {
        "a": 0.5,
        "b": [0, 1],
    }
    with pytest.raises(ValueError, match="not JSON compliant"):
        dump_json({"a": float("nan")})
    with pytest.raises(TypeError, match=r"Cannot write \w*Path as JSON"):
        dump_json({"a": Path("x")})


def test_json_that_is_missing_or_cut_short_is_said(tmp_path):
    with pytest.raises(InputError, match=r"There is no file .*none\.json"):
        read_json(tmp_path / "none.json")
    (tmp_path / "half.json").write_text('{"a": [1, 2')
    with pytest.raises(InputError, match=r"half\.json is not a readable JSON file"):
        read_json(tmp_path / "half.json")


def test_every_json_says_its_schema_and_version_first(tmp_path):
    workspace = Workspace(tmp_path)
    workspace.write_json(workspace.run_json, "run", {"notes": []})
    assert list(read_json(workspace.run_json).items()) == [
        ("schema", "si3fp/run/1"),
        ("si3fp_version", si3fp.__version__),
        ("notes", []),
    ]


def test_the_hash_of_a_file(tmp_path):
    (tmp_path / "abc").write_bytes(b"abc")
    # FIPS 180-2, appendix B.1.
    assert sha256_of(tmp_path / "abc") == (
        "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    )
    with pytest.raises(InputError, match=r"Could not read .*none"):
        sha256_of(tmp_path / "none")


def test_a_key_depends_on_every_part_but_not_on_the_order_of_names():
    assert key_of({"a": 1, "b": 2}, "x") == key_of({"b": 2, "a": 1}, "x")
    assert len({key_of({"a": 1}, "x"), key_of({"a": 2}, "x"), key_of({"a": 1}, "y")}) == 3


def test_clearing_removes_what_a_run_writes_and_nothing_else(tmp_path):
    workspace = Workspace(tmp_path)
    for file in (
        workspace.run_json,
        workspace.model,
        workspace.report,
        workspace.key,
        workspace.facade("b-0", "facade.json"),
        workspace.building("b"),
        tmp_path / "my notes.txt",
    ):
        write_text(file, "{}")
    workspace.clear()
    assert files_in(tmp_path) == ["my notes.txt"]


def test_finished_facades_are_those_with_a_facade_json(tmp_path):
    workspace = Workspace(tmp_path)
    assert workspace.facade_ids() == []
    for name in ("house/1-2", "b-0"):
        workspace.write_json(workspace.facade(name, "facade.json"), "facade", {"id": name})
    write_text(workspace.facade("half-written", "ortho.png"), "")
    assert workspace.facade_ids() == ["b-0", "house/1-2"]


@pytest.mark.parametrize("name", ["b-0", "wing.a-12", "Ab_9"])
def test_plain_ids_are_their_own_file_names(name):
    assert safe_name(name) == name


@given(st.text(max_size=200))
def test_a_safe_name_is_one_short_visible_part_of_a_path(name):
    safe = safe_name(name)
    assert 0 < len(safe.encode()) <= 100
    assert Path(safe).parts == (safe,)
    assert not safe.startswith(".")
    assert safe.isascii()


@given(st.text(max_size=30), st.text(max_size=30))
def test_different_ids_get_different_names(one, other):
    assert (safe_name(one) == safe_name(other)) == (one == other)
