"""The settings file, and the values that it keeps, without Qt: the commands read it, too."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import Field, fields
from pathlib import Path
from typing import Any, TypeVar

import platformdirs

from gelpolight_core.base.form_fields import is_possible
from gelpolight_core.base.safe_reading import read_file

APPLICATION = "gelpolight"
MOST_BYTES = 10_000_000
StoredT = TypeVar("StoredT")


def settings_file() -> Path:
    """Return the INI file of the user."""
    return platformdirs.user_config_path(APPLICATION) / "desktop.ini"


def read_stored_settings(kind: type[StoredT], stored: Callable[[str], object]) -> StoredT:
    """Return kept values. One that is missing or not possible gets its default."""
    values = {f.name: _value(str(stored(f.name)), f) for f in fields(kind)}  # type: ignore[arg-type]
    return kind(**{name: value for name, value in values.items() if value is not None})


def read_settings_section(kind: type[StoredT], section: str) -> StoredT:
    """Return the values of a section of the user's file, as Qt reads them.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    try:
        text = read_file(settings_file(), MOST_BYTES).decode(errors="replace")
    except FileNotFoundError:
        return kind()
    sections = re.findall(rf"^\[{section}\]$(.*?)(?=^\[|\Z)", text, re.MULTILINE | re.DOTALL)
    values = dict(re.findall(r"^(\w+)=(.*)$", "".join(sections), re.MULTILINE))
    return read_stored_settings(kind, lambda name: values.get(name, ""))


def _value(text: str, f: Field[Any]) -> str | float | None:
    """Return a kept value of a field, or None if it is not possible."""
    value: str | float | None = text
    if isinstance(f.default, bool):
        value = {"yes": True, "no": False}.get(text)
    elif isinstance(f.default, float):
        with suppress(ValueError):
            value = float(text)
    return value if is_possible(f, value) else None
