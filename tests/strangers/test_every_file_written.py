"""Whatever the disk refuses, of every kind of file: one sentence, and the older one stays whole."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from written import KINDS, Written

from gelpolight_core.base.errors import InputError


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


def changed_size(kind: Written, folder: Path) -> int:
    """Write the newer file; return its size, of several that of the smallest."""
    before = tree(folder)
    kind.write(folder, 1)
    after = tree(folder)
    return min(len(data) for name, data in after.items() if data != before.get(name))


@pytest.mark.function("Fill the disk without losing an older file")
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_disk_that_is_full_at_any_byte_leaves_the_older_file(kind, tmp_path):
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
