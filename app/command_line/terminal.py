"""What goes to the terminal: texts from files and devices must not steer it."""

from __future__ import annotations

import unicodedata
from typing import TextIO

_LAYOUT = "\n\t"


def harmless(text: str) -> str:
    """Return a text of one line in which every character that steers a terminal is spelled out.

    Parameters
    ----------
    text : str
        Of a file, a camera or a person, such as a note.
    """
    return "".join(_spelled(c) for c in text)


def say(text: str, *, end: str = "\n", file: TextIO | None = None, flush: bool = False) -> None:
    """Print a text whose lines and columns are the program's own; all else in it is harmless.

    Parameters
    ----------
    text, end, file, flush
        As of :func:`print`.
    """
    shown = "".join(c if c in _LAYOUT else _spelled(c) for c in text)
    print(shown, end=end, file=file, flush=flush)


def _spelled(character: str) -> str:
    """Return a character, or its code.

    Not printable are those that steer a terminal or turn the direction of writing, those that are
    not seen, and halves of characters, which no stream takes.
    """
    if character.isprintable() or unicodedata.category(character) == "Zs":
        return character
    return character.encode("unicode_escape").decode()
