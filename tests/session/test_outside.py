"""Changes by other programs to the files of an open session are detected before they are lost."""

import os

import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.session.file_hashes import FileSnapshots


@pytest.fixture
def path(tmp_path):
    """Return a file with content."""
    path = tmp_path / "session.toml"
    path.write_text("a = 1")
    return path


def test_a_changed_or_removed_file_is_reported_and_not_overwritten(path):
    files = FileSnapshots([path])
    files.refuse_changed(path)
    for change in (lambda: path.write_text("a = 22"), path.unlink):
        change()
        with pytest.raises(InputError, match="repeat your change"):
            files.refuse_changed(path)


def test_a_change_of_the_same_length_is_reported(path):
    files = FileSnapshots([path])
    path.write_text("a = 2")
    os.utime(path, ns=(1, 1))
    with pytest.raises(InputError, match="Another program"):
        files.refuse_changed(path)


def test_what_was_written_here_is_known(path):
    files = FileSnapshots([path])
    path.write_text("a = 22")
    files.take(path)
    files.refuse_changed(path)
