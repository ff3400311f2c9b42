"""Files that grow by whole lines."""

from pathlib import Path

import pytest

from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import append_durably, append_json
from gelpolight_core.io.reading import json_lines


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
    link(tmp_path / "batch.jsonl", theirs)
    with pytest.raises(InputError, match="link"):
        append_json(tmp_path / "batch.jsonl", [{"a": 1}])
    assert theirs.read_text() == "years of work"


def test_a_line_with_any_flipped_bit_is_damaged_and_those_around_it_are_not(tmp_path):
    path = tmp_path / "lines"
    rows = [{"depth_mm": 1.25 + k, "name": "\u00fc"} for k in range(3)]
    path.write_bytes(b'{"depth_mm":0.5}\n')  # of an earlier version
    append_json(path, rows)
    whole = path.read_bytes()
    assert [content for _, content in json_lines(path)] == [{"depth_mm": 0.5}, *rows]
    begin = whole.index(b"\n", whole.index(b"2.25") - 40) + 1
    for place in range(begin, whole.index(b',"crc32', begin)):
        spoilt = bytearray(whole)
        spoilt[place] ^= 1
        path.write_bytes(spoilt)
        found = [content for _, content in json_lines(path)]
        assert found == [{"depth_mm": 0.5}, rows[0], None, rows[2]]
