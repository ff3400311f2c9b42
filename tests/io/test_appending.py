"""Files that grow by whole lines."""

from __future__ import annotations

from pathlib import Path

import pytest

from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import append_durably


def test_appended_lines_follow_the_existing_ones(tmp_path: Path) -> None:
    path = tmp_path / "notes"
    append_durably(path, b"one\n")
    append_durably(path, b"two\n")
    assert path.read_bytes() == b"one\ntwo\n"


def test_a_file_that_cannot_be_added_to_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="A folder has the name of the file") as refusal:
        append_durably(tmp_path, b"one\n")
    assert refusal.value.where == str(tmp_path)
