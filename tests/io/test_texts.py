"""Texts in files are read in the language of the reader, not in that of the writer."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gelpolight_core.errors import InputError
from gelpolight_core.io.texts import as_line, from_line, restored, stored
from gelpolight_core.translation import Text, current_language, joined, pattern, tr, use_language


@pytest.fixture(autouse=True)
def _same_language() -> Iterator[None]:
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


def test_a_text_is_shown_in_the_language_of_the_reader() -> None:
    plain = json.loads(json.dumps(stored(tr("Views left out"))))
    filled = json.loads(json.dumps(stored(tr("Reprojection error"))))
    use_language("de")
    assert restored(plain) == tr("Views left out") != "Views left out"
    assert restored(filled) == tr("Reprojection error")


def test_values_and_the_texts_among_them_are_translated_too() -> None:
    kept = json.loads(json.dumps(stored(left_out())))
    assert restored(kept) == left_out()
    use_language("de")
    german = left_out()
    assert restored(kept) == german and german != str(restored(kept["text"]))
    assert json.loads(json.dumps(stored(german))) == kept  # the writer's language leaves no trace


def test_a_line_of_a_table_holds_text_with_and_without_values() -> None:
    assert as_line("typed by a person") == "typed by a person"
    assert from_line(as_line(left_out())) == left_out()
    assert from_line('{"a note": 1}') == '{"a note": 1}'
    with pytest.raises(ValueError):
        from_line('{"text": 1}')


@pytest.mark.parametrize(
    "template",
    ["{a:>999999999}", "{a.__class__}", "{a[0]}", "{b}", "{", "{a:.99f}", "{a!r}", "{a:{a}}"],
)
def test_a_forged_template_can_neither_fill_the_memory_nor_read_anything(template: str) -> None:
    shown = restored({"text": template, "values": {"a": 1.5}})
    assert len(shown) < 120 and "class '" not in shown


@pytest.mark.parametrize(
    "value",
    [1, None, [], {"text": "a"}, {"text": "a", "values": []}, {"text": "a", "values": {"b": True}},
     {"text": "a", "values": {"b": None}}, {"text": "a", "values": {}, "more": 1}],
)  # fmt: skip
def test_what_is_no_text_is_refused(value: object) -> None:
    with pytest.raises(ValueError):
        restored(value)


json_values = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False) | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner),
    max_leaves=10,
)


@given(json_values)
def test_any_value_of_a_file_gives_a_text_or_a_value_error(value: object) -> None:
    try:
        shown = restored(value)
    except (ValueError, UnicodeEncodeError):
        return
    assert isinstance(shown, Text)


def test_an_error_can_be_shown_in_another_language_later() -> None:
    error = InputError(tr("Too dark"), where="balls/a.png", advice=tr("Use a shorter exposure"))
    kept = stored(error.text)
    assert restored(kept) == str(error)
    use_language("de")
    assert tr("Use a shorter exposure") in restored(kept)
