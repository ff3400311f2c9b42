"""Files that grow by whole lines."""

from pathlib import Path

import pytest

from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import append_durably


def test_appended_lines_follow_the_existing_ones(tmp_path):
    path = tmp_path / "notes"
    append_durably(path, b"one\n")
    append_durably(path, b"two\n")
    assert path.read_bytes() == b"one\ntwo\n"


def test_a_file_that_cannot_be_added_to_is_named(tmp_path):
    with pytest.raises(InputError, match="A folder has the name of the file") as refusal:
        append_durably(tmp_path, b"one\n")
    assert refusal.value.where == str(tmp_path)


@pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to])
def test_lines_are_never_added_through_a_link(link, tmp_path):
    theirs = tmp_path / "thesis.tex"
    theirs.write_text("years of work")
    link(tmp_path / "batch.csv", theirs)
    with pytest.raises(InputError, match="link"):
        append_durably(tmp_path / "batch.csv", b"one\n")
    assert theirs.read_text() == "years of work"
