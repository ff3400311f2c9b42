"""Files of the workspace: unused names, and copies that are complete or not made at all."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.atomic import NameTakenError, write_atomically
from gelpolight_core.io.reading import open_file


def free_path(path: Path) -> Path:
    """Return `path`, or a similar path with a number if it exists."""
    candidate, number = path, 1
    while candidate.exists():
        number += 1
        candidate = path.with_name(f"{path.stem}-{number}{path.suffix}")
    return candidate


def write_new(wanted: Path, write: Callable[[Path], object]) -> Path:
    """Write a file to an unused path, and return that path.

    Another program may take the same name at this moment: `write` then raises NameTakenError.
    """
    while True:
        target = free_path(wanted)
        try:
            write(target)
        except NameTakenError:
            continue
        return target


def copy_file(source: Path, target: Path, *, new: bool = False) -> None:
    """Copy a file. With `new`, the target must not exist."""
    try:
        stream = open_file(source)
    except OSError as error:
        found = f"The operating system refused it ({error.strerror or error})"
        raise InputError(found, source, Remedy.CHECK_DISK) from error
    with stream:
        write_atomically(target, lambda out: shutil.copyfileobj(stream, out, 1 << 20), new=new)
