"""Texts in files are English; the reader sees them in their language where they are whole."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gelpolight_core.errors import InputError
from gelpolight_core.io.texts import text_of_file
from gelpolight_core.translation import (
    Text,
    current_language,
    english,
    joined,
    pattern,
    tr,
    use_language,
)


@pytest.fixture(autouse=True)
def _same_language():
    before = current_language()
    use_language("en")
    yield
    use_language(before)


def left_out() -> str:
    """Return a text with texts among its values."""
    views = [
        pattern("{name} ({reason})", name=name, reason=tr("Too dark")) for name in ("a.png", "b")
    ]
    return tr("Left out: {names}").format(names=joined("; ", views))


def test_a_text_is_shown_in_the_language_of_the_reader():
    kept = english(tr("Views left out"))
    use_language("de")
    assert text_of_file(kept) == tr("Views left out") != "Views left out"


def test_the_language_of_the_writer_leaves_no_trace():
    """Neither in the text, nor in the texts among its values."""
    kept = english(left_out())
    assert kept == left_out()
    use_language("de")
    german = left_out()
    assert german != kept == english(german) == text_of_file(kept)


def test_a_text_of_the_catalogue_that_is_read_and_written_stays_english():
    kept = english(tr("Views left out"))
    use_language("de")
    assert english(text_of_file(kept)) == kept


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
    assert isinstance(shown, Text)


def test_an_error_has_its_english_sentence():
    use_language("de")
    error = InputError(tr("Too dark"), where="balls/a.png", advice=tr("Use a shorter exposure"))
    assert english(error.text) == "balls/a.png: Too dark. Use a shorter exposure."
    assert tr("Use a shorter exposure") in str(error)
