"""A table of session.toml that reports every mistake with its key."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.reading import brief, check_version, is_file_name, plain_text

MOST_WHOLE = 2**53
TEXT_LENGTH = 1000


@dataclass(frozen=True, slots=True)
class Table:
    """A table of session.toml, with errors that name the key."""

    content: dict[str, Any]
    name: str
    path: Path

    def _key(self, key: str) -> str:
        return f"[{self.name}] {brief(key)}" if self.name else brief(key)

    def wrong(self, key: str, what: str) -> InputError:
        """Return the error for a key; `what` is ignored if the key is missing."""
        if key not in self.content:
            what = "is missing"
        return InputError(f"{self._key(key)} {what}", self.path, Remedy.CORRECT_ENTRY)

    def text(self, key: str) -> str:
        """Return a text that is not empty."""
        value = self.content.get(key)
        if not isinstance(value, str) or not value.strip():
            raise self.wrong(key, "is not a text")
        try:
            return plain_text(value, TEXT_LENGTH)
        except ValueError as error:
            raise self.wrong(
                key, f"is not plain text of at most {TEXT_LENGTH} characters"
            ) from error

    def whole(self, key: str) -> int:
        """Return a whole number."""
        value = self.content.get(key)
        if type(value) is not int or abs(value) > MOST_WHOLE:
            raise self.wrong(key, "is not a whole number")
        return value

    def check_version(self, form: str, newest: int) -> None:
        """Refuse a file of another format or version, as :func:`.io.reading.check_version`."""
        if self.text("format") != form:
            raise self.wrong("format", f'is not "{form}"')
        try:
            check_version(self.content, form, newest, self.path)
        except ValueError as error:
            raise self.wrong("version", "is unknown") from error

    def number(self, key: str, low: float, high: float, default: float | None = None) -> float:
        """Return a number within a range, or the default if the key is missing."""
        value = self.content.get(key, default)
        good = isinstance(value, int | float) and not isinstance(value, bool)
        if not good or not low <= value <= high:  # type: ignore[operator]
            text = "is {value}, not a number from {low} to {high}"
            raise self.wrong(key, text.format(value=brief(value, 40), low=low, high=high))
        return float(value)  # type: ignore[arg-type]

    def numbers(
        self, key: str, low: float, high: float, *, count: int | None = None
    ) -> tuple[float, ...]:
        """Return a list of numbers within a range, of any length or of `count` numbers."""
        values = self.content.get(key)
        if not isinstance(values, list) or not values or count not in (None, len(values)):
            what = "is not a list" if count is None else "is not a list of {n} numbers"
            raise self.wrong(key, what.format(n=count))
        return tuple(Table({key: v}, self.name, self.path).number(key, low, high) for v in values)

    def table(self, key: str) -> Table:
        """Return a sub-table."""
        value = self.content.get(key)
        if not isinstance(value, dict):
            raise self.wrong(key, "is not a table")
        return Table(value, key, self.path)

    def file_names(self) -> tuple[str, ...]:
        """Return the keys, each of which must be the name of a file in a stage's folder."""
        for key in self.content:
            if not is_file_name(key):
                raise self.wrong(key, "is not the name of an image in the stage's folder")
        return tuple(self.content)

    def no_more(self, *known: str) -> None:
        """Refuse unknown keys."""
        for key in self.content:
            if key not in known:
                raise InputError(
                    f"The key {self._key(key)} is unknown",
                    self.path,
                    Remedy.CORRECT_ENTRY,
                )
