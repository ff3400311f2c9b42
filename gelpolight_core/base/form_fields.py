"""Fields of frozen dataclasses that :class:`app.widgets.forms.Form` shows. No Qt in here."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import Field, asdict, field, fields
from typing import Any, TypeVar

from .limits import OneOf, Span

StoredT = TypeVar("StoredT")
When = Callable[[Any], bool]
"""Whether the row of a field is shown, from the value of the form."""


def choice(
    default: Any, label: str, choices: Mapping[Any, str], tip: str = "", *, when: When | None = None
) -> Any:
    """Return a field with one of several values, each with its text."""
    metadata = {"label": label, "choices": choices, "tip": tip, "when": when}
    return field(default=default, metadata=metadata)


def several(default: tuple[str, ...], label: str, choices: Mapping[str, str]) -> Any:
    """Return a field with any of several values, each a check box with its text."""
    return field(default=default, metadata={"label": label, "several": choices, "tip": ""})


def number(
    default: float,
    label: str,
    low: float,
    high: float,
    unit: str = "",
    decimals: int = 0,
    *,
    step: float = 1.0,
    tip: str = "",
    none: str = "",
    slider: bool = False,
    beside: str = "",
    when: When | None = None,
) -> Any:
    """Return a field with a number. `none` is the text of the lowest value.

    With words `beside`, it follows them in the row of the field before.
    """
    span = {"span": Span(low, high), "unit": unit, "decimals": decimals, "step": step}
    more = {"label": label, "tip": tip, "none": none, "slider": slider, "when": when}
    return field(default=default, metadata=span | more | {"beside": beside})


def switch(
    default: bool, label: str, text: str, tip: str = "", key: str = "", when: When | None = None
) -> Any:
    """Return a field with yes or no, a check box with a text. The tip names the key."""
    metadata = {"label": label, "text": text, "tip": tip, "key": key, "when": when}
    return field(default=default, metadata=metadata)


def text(
    default: str,
    label: str,
    tip: str = "",
    *,
    example: str = "",
    when: When | None = None,
) -> Any:
    """Return a field with a line of text. The example is shown while it is empty."""
    metadata = {"label": label, "tip": tip, "example": example, "when": when}
    return field(default=default, metadata=metadata)


def folder(default: str, label: str, tip: str = "", *, relative: bool = False) -> Any:
    """Return a field with the absolute path of a folder.

    With `relative`, a name without a path is a folder next to the one before.
    """
    return field(default=default, metadata={"label": label, "tip": tip, "relative": relative})


def to_settings_text(value: Any) -> str:
    """Return the fields of a dataclass as text for the settings file."""
    return json.dumps(asdict(value))


def from_settings_text(kind: type[StoredT], *texts: str) -> StoredT:
    """Return a dataclass from its text, or from several, of which the last one counts.

    What is missing or not possible gets its default.
    """
    kept: dict[str, Any] = {}
    for text in texts:
        with suppress(ValueError, TypeError):
            kept |= dict(json.loads(text))
    parts = (f for f in fields(kind) if f.metadata and is_possible(f, kept.get(f.name)))  # type: ignore[arg-type]
    return kind(**{f.name: kept[f.name] for f in parts})


def is_possible(f: Field[Any], value: object) -> bool:
    """Return whether a field can have a value, which may come from a file."""
    limit = limit_of(f)
    if isinstance(limit, Span):
        return type(value) in (int, float) and limit.holds(value)
    return type(value) is type(f.default) if limit is None else limit.holds(value)


def limit_of(f: Field[Any]) -> Span | OneOf | None:
    """Return what a field can be, or None for any value of its type."""
    return OneOf(*f.metadata["choices"]) if "choices" in f.metadata else f.metadata.get("span")
