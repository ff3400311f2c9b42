"""Safe output to the terminal: text from files and devices must not control it."""

from __future__ import annotations

import unicodedata
from typing import TextIO

_LAYOUT = "\n\t"


def escape_control(text: str) -> str:
    """Return a one-line text in which every control character is replaced by its code.

    Parameters
    ----------
    text : str
        From a file, a camera or a person, such as a note.
    """
    return "".join(_spelled(c) for c in text)


def print_safe(
    text: str, *, end: str = "\n", file: TextIO | None = None, flush: bool = False
) -> None:
    """Print a text whose lines and columns come from the program. Control characters are replaced.

    Parameters
    ----------
    text, end, file, flush
        As in :func:`print`.
    """
    safe = "".join(c if c in _LAYOUT else _spelled(c) for c in text)
    print(safe, end=end, file=file, flush=flush)


def _spelled(character: str) -> str:
    """Return a character, or its code.

    The code replaces characters that control the terminal or the writing direction, invisible ones,
    and
    surrogates, which no stream accepts.
    """
    if character.isprintable() or unicodedata.category(character) == "Zs":
        return character
    return character.encode("unicode_escape").decode()
