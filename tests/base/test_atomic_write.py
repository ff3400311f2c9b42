"""A written file is either complete, or the old file is unchanged."""

import errno
import os
import stat
from collections.abc import Callable
from typing import BinaryIO

import pytest

from gelpolight_core.base.atomic_write import make_folder, refuse_unwritable, write_atomically
from gelpolight_core.base.errors import InputError


def half_then(fault: BaseException) -> Callable[[BinaryIO], None]:
    """Return a writer that fails midway."""

    def writer(file: BinaryIO) -> None:
        file.write(b"half a file")
        file.flush()
        raise fault

    return writer


def test_the_new_file_replaces_the_old_one(tmp_path):
    path = tmp_path / "press.npz"
    write_atomically(path, lambda file: file.write(b"old"))
    write_atomically(path, lambda file: file.write(b"new"))
    assert path.read_bytes() == b"new"
    assert os.listdir(tmp_path) == ["press.npz"]


@pytest.mark.parametrize(
    "fault", [ValueError("a fault of ours"), KeyboardInterrupt(), OSError(errno.ENOSPC, "full")]
)
@pytest.mark.parametrize("old", [b"old", None])
def test_a_writer_that_fails_midway_changes_nothing(tmp_path, fault, old):
    path = tmp_path / "press.npz"
    if old is not None:
        path.write_bytes(old)
    expected = InputError if isinstance(fault, OSError) else type(fault)
    with pytest.raises(expected):
        write_atomically(path, half_then(fault))
    assert (path.read_bytes() if path.exists() else None) == old
    assert os.listdir(tmp_path) == (["press.npz"] if old else [])


def test_a_path_that_cannot_be_written_is_refused_before_the_work(tmp_path):
    """Minutes of calibration are not wasted on a file that cannot be written."""
    (tmp_path / "kept").write_text("old")
    refuse_unwritable(tmp_path / "new")
    refuse_unwritable(tmp_path / "kept")
    assert [p.name for p in tmp_path.iterdir()] == ["kept"]
    assert (tmp_path / "kept").read_text() == "old"
    with pytest.raises(InputError, match="does not exist"):
        refuse_unwritable(tmp_path / "no" / "new")
    with pytest.raises(InputError, match="A folder has the name"):
        refuse_unwritable(tmp_path)
    with pytest.raises(InputError, match="A file has the name"):
        refuse_unwritable(tmp_path / "kept" / "new")


def test_a_missing_folder_and_a_file_with_its_name_are_reported(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="does not exist"):
        write_atomically(tmp_path / "nowhere" / "a.npz", lambda file: None)
    with pytest.raises(InputError, match="of a required folder"):
        write_atomically(tmp_path / "file" / "a.npz", lambda file: None)
    with pytest.raises(InputError, match="of the file"):
        write_atomically(tmp_path / "folder", lambda file: None)
    with pytest.raises(InputError, match="of a required folder"):
        make_folder(tmp_path / "file")
    with pytest.raises(InputError, match="name is too long"):
        make_folder(tmp_path / ("x" * 300))
    assert sorted(os.listdir(tmp_path)) == ["file", "folder"]


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_colleagues_can_read_the_file_as_any_other(tmp_path):
    ordinary, ours = tmp_path / "ordinary", tmp_path / "ours"
    ordinary.write_bytes(b"")
    write_atomically(ours, lambda file: None)
    assert stat.S_IMODE(ours.stat().st_mode) == stat.S_IMODE(ordinary.stat().st_mode)
    ours.chmod(0o640)
    write_atomically(ours, lambda file: None)
    assert stat.S_IMODE(ours.stat().st_mode) == 0o640


@pytest.mark.function(
    "Work in a folder of many people, where a link cannot redirect what is written"
)
@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_a_link_in_a_folder_that_others_can_write_to_is_replaced(tmp_path):
    theirs = tmp_path / "thesis.tex"
    theirs.write_text("years of work")
    (tmp_path / "all").mkdir()
    (tmp_path / "all").chmod(0o777)
    (tmp_path / "all/out.csv").symlink_to(theirs)
    write_atomically(tmp_path / "all/out.csv", lambda file: file.write(b"new"))
    assert theirs.read_text() == "years of work"
    assert (tmp_path / "all/out.csv").read_bytes() == b"new"


@pytest.mark.skipif(os.name != "posix", reason="links of POSIX")
def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "real").write_bytes(b"old")
    (tmp_path / "link").symlink_to(tmp_path / "real")
    write_atomically(tmp_path / "link", lambda file: file.write(b"new"))
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_bytes() == b"new"


def test_a_device_is_never_replaced_by_a_file(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="device"):
        write_atomically(tmp_path / "pipe", lambda file: file.write(b"x"))
    assert (tmp_path / "pipe").is_fifo()
