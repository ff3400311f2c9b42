"""Whatever the disk refuses, of every kind of file: one sentence, and the older one stays whole."""

from __future__ import annotations

import errno
import os
import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from written import KINDS, Written

from gelpolight_core.errors import InputError


def tree(folder: Path) -> dict[str, bytes]:
    """Return the bytes of every file in a folder."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


DATE_BYTES = 32
"""By which a date in a packed file changes its size."""


@contextmanager
def full(size: int) -> Iterator[None]:
    """Let the system refuse what would make a file larger than that."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def refusing(number: int) -> Callable[..., None]:
    """Return what refuses whatever it is asked."""

    def refuse(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    return refuse


def changed_size(kind: Written, folder: Path) -> int:
    """Write the newer file; return its size, of several that of the smallest."""
    before = tree(folder)
    kind.write(folder, 1)
    after = tree(folder)
    return min(len(data) for name, data in after.items() if data != before.get(name))


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_disk_that_is_full_at_any_byte_leaves_the_older_file(
    kind: Written, tmp_path: Path
) -> None:
    tried, real = tmp_path / "tried", tmp_path / "real"
    for folder in (tried, real):
        folder.mkdir()
        kind.write(folder, 0)
    size = changed_size(kind, tried)
    before = tree(real)
    for most in (0, 1, size // 2, max(size - DATE_BYTES, 0)):
        with full(most), pytest.raises(InputError) as refusal:
            kind.write(real, 1)
        assert str(real) in str(refusal.value)
        assert "\n" not in str(refusal.value)
        assert tree(real) == before
    kind.write(real, 1)
    assert tree(real).keys() == tree(tried).keys()


FAULTS = [
    ("fsync", errno.ENOSPC, "full|No space left"),
    ("fsync", errno.EIO, "cannot be written"),
    ("replace", errno.EROFS, "read-only"),
]


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_disk_that_fails_at_the_last_moment_leaves_the_older_file(
    kind: Written, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind.write(tmp_path, 0)
    before = tree(tmp_path)
    for call, number, words in FAULTS:
        with monkeypatch.context() as patch:
            patch.setattr(os, call, refusing(number))
            if call == "replace":
                patch.setattr(os, "link", refusing(number))
            try:
                kind.write(tmp_path, 1)
            except InputError as refusal:
                assert words.split("|")[0] in str(refusal) or words.split("|")[-1] in str(refusal)
                assert tree(tmp_path) == before
            else:
                assert call == "replace"  # what is appended takes the place of nothing
                return
    kind.write(tmp_path, 1)
