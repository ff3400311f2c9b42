"""Read files from unknown sources safely.

Only ordinary files are opened (a pipe would block for ever), their content is read up to a fixed
size, and every fault found while parsing raises ValueError, so that each reader can report it in
one sentence. This module does not need the numerical libraries.
"""

from __future__ import annotations

import json
import math
import os
import re
import stat
import struct
import tomllib
import zipfile
import zlib
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from io import BufferedReader
from pathlib import Path
from typing import Any, TypeVar

from .errors import InputError, Remedy

T = TypeVar("T")
TEXT_LIMIT, OWN_LIMIT = 1_000_000, 4_000_000
# Parsing a key of n parts takes time proportional to n squared; real keys have at most three parts.
MOST_PARTS = 20
_LONG_TEXT = re.compile(r'"""|\'\'\'')
_TEXT = re.compile(r""""(?:[^"\\\n]|\\.)*"?|'[^'\n]*'?""")
_BETWEEN = re.compile(r"[\n,=\[\]{}]")
NAME_LIMIT = 200
# Highest plausible version number; anything above it means a damaged file.
NEWEST = 1_000_000
LINES = "\n\t"
# Limit for the declared size of all arrays: fixed for a small file, this multiple of the packed
# size for a larger one.
DECLARED_LIMIT = 64_000_000
DECLARED_TIMES = 100


def open_file(path: Path) -> BufferedReader:
    """Open an ordinary file for reading.

    Raises
    ------
    FileNotFoundError
        If the file does not exist, or the path is a folder, a pipe or a device.
    InputError
        If the file cannot be read.
    """
    flags = os.O_RDONLY | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
    try:
        # Non-blocking: opening a pipe without a writer would block for ever.
        file = os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError, ValueError) as error:
        raise FileNotFoundError(str(path)) from error
    except OSError as error:
        raise cannot_read(error, path) from error
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise FileNotFoundError(str(path))
    return os.fdopen(file, "rb")


def read_file(path: Path, limit: int = TEXT_LIMIT) -> bytes:
    """Return the content of an ordinary file of at most `limit` bytes.

    Raises
    ------
    FileNotFoundError
        See :func:`open_file`.
    InputError
        If the file cannot be read or is larger.
    """
    with open_file(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        try:
            # Python allocates what is asked for, whatever the size of the file.
            data = stream.read(size + 1) if size <= limit else b""
        except OSError as error:
            raise cannot_read(error, path) from error
    if size > limit or len(data) > limit:
        text = f"The file is larger than {limit} bytes, the limit for files of this kind"
        raise InputError(text, path, Remedy.CHOOSE_FILE)
    return data


@contextmanager
def open_zip(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open a zip archive for reading.

    Raises
    ------
    FileNotFoundError, InputError
        See :func:`open_file`.
    ValueError
        If it is not a zip archive, or is found to be damaged while it is open.
    """
    stream = open_file(path)
    try:
        with stream, zipfile.ZipFile(stream) as archive:
            _refuse_bomb(archive.infolist(), os.fstat(stream.fileno()).st_size)
            yield archive
    except (zipfile.BadZipFile, zlib.error, struct.error, EOFError, OSError, RuntimeError) as error:
        raise ValueError(str(error) or type(error).__name__) from error


def _refuse_bomb(members: Collection[zipfile.ZipInfo], size: int) -> None:
    """Raise ValueError if members declare far more than an archive of this size can contain."""
    for info in members:
        # Other compression methods declare the memory that they need.
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{short_repr(info.filename)} uses an unknown compression method")
    if sum(info.compress_size for info in members) > size:
        raise ValueError("its parts declare more bytes than it has")
    declared = sum(info.file_size for info in members)
    if declared > max(DECLARED_LIMIT, DECLARED_TIMES * size):
        raise ValueError(f"its arrays declare {declared} bytes")


def read_member(archive: zipfile.ZipFile, name: str, limit: int) -> bytes:
    """Read a member whose declared size is within its limit, before memory is allocated."""
    info = archive.getinfo(name)
    if info.file_size > limit:
        raise ValueError(f"{name} declares {info.file_size} bytes")
    with archive.open(info) as stream:
        data = stream.read(info.file_size + 1)
    if len(data) != info.file_size:
        raise ValueError(f"{name} is truncated")
    return data


def parse_toml(data: bytes) -> dict[str, Any]:
    """Return the content of a TOML text in UTF-8.

    Raises
    ------
    ValueError
        If it is not valid TOML, or its structure is implausible.
    """
    text = data.decode("utf-8-sig")
    if _LONG_TEXT.search(text):
        raise ValueError("it contains a multi-line string")
    # Between these separators, dots occur only inside one number or one key.
    for part in _BETWEEN.split(_TEXT.sub("", text)):
        if part.partition("#")[0].count(".") > MOST_PARTS:
            raise ValueError(f"a key has more than {MOST_PARTS} parts")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def read_toml(path: Path, *, missing: InputError | None = None) -> dict[str, Any]:
    """Return the content of a TOML file.

    Parameters
    ----------
    path : Path
        The file.
    missing : InputError, optional
        Raised where there is no such file; by default that the file does not exist.

    Raises
    ------
    InputError
        If the file is missing or is not TOML.
    """
    try:
        return parse_toml(read_file(path))
    except FileNotFoundError as error:
        raise missing or missing_file(path) from error
    except ValueError as error:
        text = f"The file is not valid TOML ({short_repr(str(error), 200)})"
        raise InputError(text, path, Remedy.CORRECT_FILE) from error


def parse_json(data: bytes | str) -> Any:
    """Return the content of a JSON text without NaN and infinite values.

    Raises
    ------
    ValueError
        If it is not valid JSON, or its structure is implausible.
    """
    try:
        return json.loads(data, parse_constant=_refused, parse_float=_finite)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def check_version(content: Any, form: str, newest: int, path: Path) -> None:
    """Refuse the content of a file that has another format or an unknown version.

    Parameters
    ----------
    content : object
        Its keys ``format`` and ``version`` say what it is.
    form : str
        The name of the format.
    newest : int
        The newest version that this program reads; it reads all versions from 1.
    path : Path
        The file, for the error.

    Raises
    ------
    InputError
        If the version is newer.
    ValueError
        If the format is another one, or the version is invalid.
    """
    if not isinstance(content, dict) or content.get("format") != form:
        raise ValueError(f"it is not marked as {form}")
    version = content.get("version")
    if type(version) is not int or not 1 <= version < NEWEST:
        raise ValueError(f"version {short_repr(version)}")
    refuse_newer(version, newest, path)


def refuse_newer(version: int, newest: int, path: Path) -> None:
    """Refuse a file of a newer version than this program reads.

    Raises
    ------
    InputError
        If it is newer.
    """
    if version > newest:
        text = f"The file has version {version}, but this program only reads up to version {newest}"
        raise InputError(text, path, Remedy.UPDATE)


@contextmanager
def invalid_file_guard(found: str, where: Path | str) -> Iterator[None]:
    """Refuse a file whose content turns out to be invalid.

    Parameters
    ----------
    found : str
        The sentence of the error, with a placeholder ``{error}`` for the reason.
    where : Path or str
        The file, or the place in it.

    Raises
    ------
    InputError
        If the content raises one of the errors that wrong keys, types and values raise, or there
        is no such file.
    """
    try:
        yield
    except FileNotFoundError as error:
        raise missing_file(Path(where)) from error
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError) as error:
        reason = short_repr(str(error).partition("\n")[0], 200) or type(error).__name__
        raise InputError(found.format(error=reason), where, Remedy.REPAIR_FILE) from error


def read_program_file(
    path: Path, form: tuple[str, int], parse: Callable[[Any], T], *, found: str
) -> T | None:
    """Return what a JSON file of this program contains, or None without the file.

    Parameters
    ----------
    path : Path
        The file.
    form : (str, int)
        Its format, and the newest version that this program reads.
    parse : callable
        Takes the content; wrong keys, types and values may raise any of their errors.
    found : str
        As in :func:`invalid_file_guard`.

    Raises
    ------
    InputError
        If it cannot be read, is damaged, or has a newer version.
    """
    try:
        data = read_file(path, OWN_LIMIT)
    except FileNotFoundError:
        return None
    with invalid_file_guard(found, path):
        content = parse_json(data)
        check_version(content, *form, path)
        return parse(content)


def plain_text(value: Any, most: int = 10_000) -> str:
    """Return a value that must be a name: text that is safe to show, print and write to a file.

    Raises
    ------
    ValueError
        If it is not text, is longer than `most` characters, or contains control or invalid
        characters.
    """
    text = multiline_text(value, most)
    if any((c < " " and c not in LINES) or "\x7f" <= c <= "\x9f" for c in text):
        raise ValueError(f"{short_repr(text)} contains control characters")
    return text


def multiline_text(value: Any, most: int = 1_000_000) -> str:
    """Return a value that must be text, perhaps with control characters from pasted text.

    Raises
    ------
    ValueError
        If it is not text, is longer than `most` characters, or cannot be written to a file.
    """
    if not isinstance(value, str):
        raise ValueError(f"{short_repr(value)} is not text")
    if len(value) > most:
        raise ValueError(f"a text has {len(value)} characters")
    value.encode()  # a lone surrogate cannot be encoded
    return value


def parse_time(text: str) -> datetime | None:
    """Read an ISO 8601 time. Without a time zone it counts as UTC. Invalid text gives None."""
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        return None
    return time if time.tzinfo is not None else time.replace(tzinfo=UTC)


def escape_undecodable(name: str) -> str:
    """Return a name in writable form, with escape codes for bytes that are not valid text."""
    return name.encode("utf-8", "backslashreplace").decode()


def is_file_name(name: str) -> bool:
    """Return whether a text is a plain file name, without any folder part."""
    forbidden = set(name) & {"/", "\\", "\0"}
    return not forbidden and name not in ("", ".", "..") and len(name) <= NAME_LIMIT


def short_repr(value: Any, most: int = 60) -> str:
    """Return a value in a short printable form for a message."""
    try:
        text = value if isinstance(value, str) else repr(value)
    except (ValueError, RecursionError):  # a number with thousands of digits, or endless nesting
        return type(value).__name__
    text = ascii(text)[1:-1] if not text.isprintable() else text
    return text if len(text) <= most else f"{text[: most - 3]}..."


def missing_file(path: Path) -> InputError:
    """Return the error for a file that does not exist."""
    return InputError("The file does not exist", path, Remedy.CHECK_NAME)


def cannot_read(error: OSError, path: Path) -> InputError:
    """Return the error for a file or folder that the system cannot read."""
    if isinstance(error, PermissionError):
        return InputError("You do not have permission to read this", path, Remedy.MAY_READ)
    text = f"The file cannot be read ({error.strerror or error})"
    return InputError(text, path, Remedy.CHECK_DISK)


def _refused(constant: str) -> float:
    raise ValueError(f"{constant} is not a valid number")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{short_repr(text)} is too large")
    return value
