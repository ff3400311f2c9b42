"""A file to be written gets the ending of its kind, and replaces no other one unasked."""

import pytest
from PySide6.QtWidgets import QFileDialog

from app.program.file_dialogs import ask_save

MAPS = "Maps (*.tif *.npy);;Points (*.csv)"


@pytest.mark.parametrize(
    ("name", "pattern", "saved"),
    [
        ("out", "Points (*.csv)", "out.csv"),
        ("out", "", "out.tif"),
        ("out.NPY", "Points (*.csv)", "out.NPY"),
        ("step 2.5 mm", "Points (*.csv)", "step 2.5 mm.csv"),
    ],
)
def test_a_name_without_an_ending_gets_that_of_the_chosen_kind(
    context, tmp_path, monkeypatch, name, pattern, saved
):
    answer = str(tmp_path / name), pattern
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: answer)
    assert ask_save(None, context.settings, "table", "Save", "x", MAPS) == tmp_path / saved


def test_a_file_that_exists_under_the_completed_name_is_proposed_again(
    context, tmp_path, monkeypatch
):
    (tmp_path / "out.csv").touch()
    proposed = []

    def choose(_parent, _title, file, _patterns):
        proposed.append(file)
        return (str(tmp_path / "out") if len(proposed) == 1 else ""), "Points (*.csv)"

    monkeypatch.setattr(QFileDialog, "getSaveFileName", choose)
    assert ask_save(None, context.settings, "table", "Save", "x.csv", MAPS) is None
    assert proposed[1] == str(tmp_path / "out.csv")
