"""Files that grow by whole lines: what was appended is on the disk before anything else is done."""

from __future__ import annotations

import os
from pathlib import Path

from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr


def append_durably(path: Path, content: bytes) -> None:
    """Write to the end of a file, made where there is none, and wait until the disk has it.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    try:
        with path.open("ab") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise unwritable(error, path) from error


def unwritable(error: OSError, path: Path) -> InputError:
    """Return what to raise about a file that cannot be added to."""
    return InputError(
        tr("the file cannot be written ({reason})").format(reason=error.strerror or error),
        where=str(path),
        advice=tr("Check the disk and its permissions, then go on where it was left"),
    )
