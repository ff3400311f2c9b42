"""Allowed values of numbers and texts in files, forms and settings, without numerical libraries."""

from __future__ import annotations

from typing import Any, NamedTuple

from .safe_reading import is_file_name, plain_text


class Span(NamedTuple):
    """The allowed range of a number."""

    low: float
    high: float

    def holds(self, value: Any) -> bool:
        """Return whether a number is within it."""
        return bool(self.low <= value <= self.high)

    def __str__(self) -> str:
        """Return it as a part of a sentence."""
        return f"a number from {self.low:.12g} to {self.high:.12g}"


class OneOf:
    """What a text or a whole number can be: one of several values."""

    def __init__(self, *choices: str | int) -> None:
        self.choices = choices

    def holds(self, value: Any) -> bool:
        """Return whether a value is one of them."""
        return value in self.choices

    def __str__(self) -> str:
        """Return it as a part of a sentence."""
        return f"one of {', '.join(map(str, self.choices))}"


class Words(NamedTuple):
    """What a line of text can be: without control characters, and not too long."""

    most: int = 1000
    may_be_empty: bool = False

    def holds(self, value: str) -> bool:
        """Return whether a text is one."""
        try:
            return bool(plain_text(value, self.most).strip()) or self.may_be_empty
        except ValueError:
            return False

    def __str__(self) -> str:
        """Return it as a part of a sentence."""
        return f"plain text of at most {self.most} characters"


class FileName:
    """What a text can be: the name of a file, without a folder."""

    def holds(self, value: str) -> bool:
        """Return whether a text is one."""
        return is_file_name(value)

    def __str__(self) -> str:
        """Return it as a part of a sentence."""
        return "the name of a file in the folder"
