"""Texts of files, also the templates of older versions."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gelpolight_core.base.file_texts import text_of_file


def test_texts_of_older_files_are_filled():
    """They hold a template with its values, in tables as JSON."""
    names = {
        "text": "{part0}; {part1}",
        "values": {
            f"part{k}": {"text": "{name} ({reason})", "values": {"name": n, "reason": "Too dark"}}
            for k, n in enumerate(("a.png", "b"))
        },
    }
    old = {"text": "Left out: {names}, {share:.0%}", "values": {"names": names, "share": 0.256}}
    for value in (old, json.dumps(old, separators=(",", ":"))):
        assert text_of_file(value) == "Left out: a.png (Too dark); b (Too dark), 26%"
    assert text_of_file('{"a note": 1}') == '{"a note": 1}'


@pytest.mark.parametrize(
    "template",
    ["{a:>999999999}", "{a.__class__}", "{a[0]}", "{b}", "{", "{a:.99f}", "{a!r}", "{a:{a}}"],
)
def test_a_forged_template_can_neither_fill_the_memory_nor_read_anything(template):
    shown = text_of_file({"text": template, "values": {"a": 1.5}})
    assert len(shown) < 120 and "class '" not in shown


@pytest.mark.parametrize(
    "value",
    [
        1,
        None,
        [],
        {"text": "a"},
        {"text": "a", "values": []},
        {"text": 1, "values": {}},
        {"text": "a", "values": {}, "more": 1},
        '{"text":1}',
        '{"text":',
    ],
)
def test_what_is_no_text_is_refused(value):
    with pytest.raises(ValueError):
        text_of_file(value)


json_values = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False) | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner),
    max_leaves=10,
)


@given(json_values)
def test_any_value_of_a_file_gives_a_text_or_a_value_error(value):
    try:
        shown = text_of_file(value)
    except (ValueError, UnicodeEncodeError):
        return
    assert isinstance(shown, str)
