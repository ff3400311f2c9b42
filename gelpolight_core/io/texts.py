"""Texts in files: a template and its values, so that each reader sees them in their language.

A text without values is stored as its English template. A text with values is stored as
``{"text": template, "values": {name: value}}``. A text that is not from the program, such as a
note, is stored as it is.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from numbers import Integral, Real
from typing import Any

from gelpolight_core.io.reading import parse_json, written_text
from gelpolight_core.translation import Text, translated

Stored = str | dict[str, Any]

_PLACEHOLDER = re.compile(r"\{(\w+)(?::([^{}]*))?\}")
# Formats of numbers as the program uses them. A file could contain one that fills the memory.
_FORMAT = re.compile(r"[+]?\d{0,2},?(\.\d{1,2})?[defg%]?")
_MOST_VALUES, _DEEPEST = 10_000, 6


def stored(text: str) -> Stored:
    """Return a text as it is stored.

    Parameters
    ----------
    text : str
        From :func:`~gelpolight_core.translation.tr`, or any other text.
    """
    if not isinstance(text, Text):
        return text
    if not text.values:
        return text.template
    return {"text": text.template, "values": {k: _plain(v) for k, v in text.values.items()}}


def restored(value: Any) -> str:
    """Return a stored text in the user's language.

    Raises
    ------
    ValueError
        If the value is not a stored text.
    """
    return _restored(value, 0)


def as_line(text: str) -> str:
    """Return a text as it is stored in a column of a table: its template, or JSON with values."""
    kept = stored(text)
    return kept if isinstance(kept, str) else json.dumps(kept, separators=(",", ":"))


def from_line(line: str) -> str:
    """Return the text of :func:`as_line`, in the user's language.

    Raises
    ------
    ValueError
        If the line looks like a stored text with values, but is not one.
    """
    return restored(parse_json(line) if line.startswith('{"text":') else line)


def _restored(value: Any, depth: int) -> str:
    if isinstance(value, str):
        template = written_text(value)
        return Text(translated(template), template)
    if not isinstance(value, dict) or set(value) != {"text", "values"} or depth > _DEEPEST:
        raise ValueError("a stored text has a template and values")
    template, given = written_text(value["text"]), value["values"]
    if not isinstance(given, dict) or len(given) > _MOST_VALUES:
        raise ValueError("the values of a stored text have names")
    values = {written_text(name): _value(part, depth) for name, part in given.items()}
    return Text(_filled(translated(template), values), template, values)


def _value(value: Any, depth: int) -> Any:
    if isinstance(value, bool) or not isinstance(value, str | int | float | dict):
        raise ValueError("a value of a stored text is a number or a text")
    return value if isinstance(value, int | float) else _restored(value, depth + 1)


def _filled(template: str, values: Mapping[str, Any]) -> str:
    """Fill the placeholders; one without a value, or with an unknown format, stays simple."""

    def fill(match: re.Match[str]) -> str:
        name, form = match.group(1), match.group(2) or ""
        if name not in values:
            return match.group(0)
        value = values[name]
        if isinstance(value, str) or not _FORMAT.fullmatch(form):
            return str(value)
        return format(int(value) if form.endswith("d") else value, form)

    return _PLACEHOLDER.sub(fill, template)


def _plain(value: Any) -> Any:
    if isinstance(value, str):
        return stored(value)
    if isinstance(value, Integral) and not isinstance(value, bool):
        return int(value)
    if isinstance(value, Real) and math.isfinite(value):
        return float(value)
    return str(value)
