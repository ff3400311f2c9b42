"""Files that grow by whole lines."""

from pathlib import Path

import pytest

from gelpolight_core.base.atomic_write import append_with_fsync
from gelpolight_core.base.errors import InputError


def test_appended_lines_follow_the_existing_ones(tmp_path):
    path = tmp_path / "notes"
    append_with_fsync(path, b"one\n")
    append_with_fsync(path, b"two\n")
    assert path.read_bytes() == b"one\ntwo\n"


def test_a_file_that_cannot_be_added_to_is_named(tmp_path):
    with pytest.raises(InputError, match="A folder has the name of the file") as refusal:
        append_with_fsync(tmp_path, b"one\n")
    assert refusal.value.where == str(tmp_path)


@pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to])
def test_lines_are_never_added_through_a_link(link, tmp_path):
    theirs = tmp_path / "thesis.tex"
    theirs.write_text("years of work")
    link(tmp_path / "batch.csv", theirs)
    with pytest.raises(InputError, match="link"):
        append_with_fsync(tmp_path / "batch.csv", b"one\n")
    assert theirs.read_text() == "years of work"
