"""Files that others made: data, never more.

Only ordinary files are opened (a pipe would wait for ever), what they hold is taken up to a stated
size, and what is parsed of it raises ValueError for whatever is wrong with it, so that each reader
ends in one sentence. Nothing here needs the numerical libraries.
"""

from __future__ import annotations

import json
import math
import os
import re
import stat
import tomllib
from io import BufferedReader
from pathlib import Path
from typing import Any

from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

TEXT_LIMIT = 1_000_000
# A key of n parts costs n squared, and nobody writes one of more than three.
MOST_PARTS = 20
_LONG_TEXT = re.compile(r'"""|\'\'\'')
_TEXT = re.compile(r""""(?:[^"\\\n]|\\.)*"?|'[^'\n]*'?""")
_BETWEEN = re.compile(r"[\n,=\[\]{}]")
NAME_LIMIT = 200
# Versions that may come; a number beyond them is damage.
NEWEST = 1_000_000
LINES = "\n\t"


def open_file(path: Path) -> BufferedReader:
    """Open an ordinary file for reading.

    Raises
    ------
    FileNotFoundError
        If there is none, or what is there is a folder, a pipe or a device.
    InputError
        If the system does not give it.
    """
    flags = os.O_RDONLY | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
    try:
        # Without blocking: a pipe that nobody writes into would be waited for.
        file = os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError, ValueError) as error:
        raise FileNotFoundError(str(path)) from error
    except OSError as error:
        raise unreadable(error, path) from error
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise FileNotFoundError(str(path))
    return os.fdopen(file, "rb")


def read_file(path: Path, limit: int = TEXT_LIMIT) -> bytes:
    """Return what an ordinary file holds, if that is no more than `limit` bytes.

    Raises
    ------
    FileNotFoundError
        As :func:`open_file`.
    InputError
        If the system does not give it, or it is larger.
    """
    with open_file(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        try:
            data = stream.read(limit + 1) if size <= limit else b""
        except OSError as error:
            raise unreadable(error, path) from error
    if size > limit or len(data) > limit:
        raise InputError(
            tr("the file has more than {n} bytes, which none of its kind has").format(n=limit),
            where=str(path),
            advice=tr("Choose another file"),
        )
    return data


def parse_toml(data: bytes) -> dict[str, Any]:
    """Return the content of a TOML text in UTF-8.

    Raises
    ------
    ValueError
        If it is none, or nobody would write it so.
    """
    text = data.decode("utf-8-sig")
    if _LONG_TEXT.search(text):
        raise ValueError("it holds a text of several lines")
    # What is left between these has no dots but those of one number or of one key.
    for part in _BETWEEN.split(_TEXT.sub("", text)):
        if part.partition("#")[0].count(".") > MOST_PARTS:
            raise ValueError(f"a key has more than {MOST_PARTS} parts")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def parse_json(data: bytes | str) -> Any:
    """Return the content of a JSON text; NaN, infinities and what stands for them are refused.

    Raises
    ------
    ValueError
        If it is none, or nobody would write it so.
    """
    try:
        return json.loads(data, parse_constant=_refused, parse_float=_finite)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def plain_text(value: Any, most: int = 10_000) -> str:
    """Return a value that is a name: a text that can be shown, printed and written to a file.

    Raises
    ------
    ValueError
        If it is no text, is longer than `most` characters, or holds characters that command a
        terminal or that are none.
    """
    text = written_text(value, most)
    if any((c < " " and c not in LINES) or "\x7f" <= c <= "\x9f" for c in text):
        raise ValueError(f"{brief(text)} holds control characters")
    return text


def written_text(value: Any, most: int = 1_000_000) -> str:
    """Return a value that is a text as a person may have pasted it: what was kept is given back.

    Raises
    ------
    ValueError
        If it is no text, is longer than `most` characters, or cannot be written to a file.
    """
    if not isinstance(value, str):
        raise ValueError(f"{brief(value)} is no text")
    if len(value) > most:
        raise ValueError(f"a text has {len(value)} characters")
    value.encode()  # half of a pair of surrogates cannot be written
    return value


def as_text(name: str) -> str:
    """Return a name so that it can be written: what of it is no text is spelt by its codes."""
    return name.encode("utf-8", "backslashreplace").decode()


def is_file_name(name: str) -> bool:
    """Return whether a text names a file in a folder, and nothing outside of it."""
    forbidden = set(name) & {"/", "\\", "\0"}
    return not forbidden and name not in ("", ".", "..") and len(name) <= NAME_LIMIT


def brief(value: Any, most: int = 60) -> str:
    """Return a value as a sentence can name it, however large or deep it is."""
    try:
        text = value if isinstance(value, str) else repr(value)
    except (ValueError, RecursionError):  # a number of thousands of digits, or endless nesting
        return type(value).__name__
    text = ascii(text)[1:-1] if not text.isprintable() else text
    return text if len(text) <= most else f"{text[: most - 3]}..."


def unreadable(error: OSError, path: Path) -> InputError:
    """Return what to raise about a file that the system does not give."""
    return InputError(
        tr("the file cannot be read ({reason})").format(reason=error.strerror or error),
        where=str(path),
        advice=tr("Check its permissions and the disk, or copy it to a folder of your own"),
    )


def _refused(constant: str) -> float:
    raise ValueError(f"{constant} is no number")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{brief(text)} is too large")
    return value
