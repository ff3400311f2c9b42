"""Two programs on one batch."""

import getpass
from pathlib import Path

import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.file_lock import FILE, RunLock


def test_a_second_program_gets_the_name_of_the_first(tmp_path):
    with RunLock(tmp_path), pytest.raises(InputError) as refusal:
        RunLock(tmp_path)
    assert getpass.getuser() in str(refusal.value)
    assert str(tmp_path) in str(refusal.value)


def test_a_run_that_was_left_can_be_written_by_another(tmp_path):
    first = RunLock(tmp_path)
    first.release()
    first.release()
    RunLock(tmp_path).release()


@pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to])
def test_a_link_in_place_of_the_lock_destroys_nothing(link, tmp_path):
    """Somebody else may write to the folder, too."""
    theirs = tmp_path / "thesis.tex"
    theirs.write_text("years of work")
    link(tmp_path / FILE, theirs)
    with pytest.raises(InputError, match="link"):
        RunLock(tmp_path)
    assert theirs.read_text() == "years of work"


def test_a_system_that_knows_no_users_has_runs_too(tmp_path, monkeypatch):
    """As in a container that is run under a bare number."""

    def nobody() -> str:
        raise KeyError("getpwuid(): uid not found: 1234")

    monkeypatch.setattr(getpass, "getuser", nobody)
    with RunLock(tmp_path), pytest.raises(InputError, match="process"):
        RunLock(tmp_path)
