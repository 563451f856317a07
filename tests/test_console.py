"""What a run says on the terminal when it is done."""

from si3fp.report.console import SHOWN_NOTES, summary
from si3fp.workspace import dump_json


def test_doubts_are_said_and_long_lists_are_cut(tmp_path):
    notes = ["The model may be folded.", *(f"photo-{n}.jpg: is blurred." for n in range(9))]
    content = {"missing": [], "buildings": [], "notes": notes}
    (tmp_path / "run.json").write_text(dump_json(content), encoding="utf-8")
    lines = summary(tmp_path).splitlines()
    assert lines[0] == "Note: The model may be folded."
    assert sum(line.startswith("Note: ") for line in lines) == SHOWN_NOTES
    assert f"{len(notes) - SHOWN_NOTES} more notes are in the report" in lines
    assert lines[-1].startswith("report: ")
