"""Texts in files, also those that older versions wrote as templates."""

from __future__ import annotations

import re
from typing import Any

from .safe_reading import multiline_text, parse_json

_PLACEHOLDER = re.compile(r"\{(\w+)(?::([^{}]*))?\}")
# Formats of numbers as the program used them. A file could contain one that fills the memory.
_FORMAT = re.compile(r"[+]?\d{0,2},?(\.\d{1,2})?[defg%]?")
_DEEPEST = 6


def text_of_file(value: Any) -> str:
    """Return a text of a file.

    Parameters
    ----------
    value : object
        The text. In files of versions before 1.0: ``{"text": template, "values": {name: value}}``,
        in tables as JSON.

    Raises
    ------
    ValueError
        If the value is not a text.
    """
    if isinstance(value, str) and value.startswith('{"text":'):
        value = parse_json(value)
    return _filled(value, 0) if isinstance(value, dict) else multiline_text(value)


def _filled(value: dict[str, Any], depth: int) -> str:
    """Return a template filled with its values, except placeholders without one."""
    if set(value) != {"text", "values"} or not isinstance(value["values"], dict):
        raise ValueError("a text of an older file has a template and values")
    if depth > _DEEPEST:
        raise ValueError("a text is nested too deeply")

    def fill(match: re.Match[str]) -> str:
        form, part = match[2] or "", value["values"].get(match[1], match[0])
        if isinstance(part, dict):
            return _filled(part, depth + 1)
        plain = isinstance(part, str) or not _FORMAT.fullmatch(form)
        return multiline_text(str(part)) if plain else format(part, form)

    return _PLACEHOLDER.sub(fill, multiline_text(value["text"]))
