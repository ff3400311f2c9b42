"""Files that grow by whole lines: what was appended is on the disk before anything else is done."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from gelpolight_core.export.atomic import cannot_write, sync_folder


def append_durably(path: Path, content: bytes) -> None:
    """Write to the end of a file, made where there is none, and wait until the disk has it.

    Where the disk refuses it, the file ends as it did before, as far as the disk lets it.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    try:
        is_new = not path.exists()
        # Unbuffered: what a buffer still holds would be written once more when the file is closed.
        with path.open("ab", buffering=0) as file:
            size = os.fstat(file.fileno()).st_size
            try:
                _write_all(file.fileno(), content)
            except OSError:
                with contextlib.suppress(OSError):  # the first refusal is told
                    os.ftruncate(file.fileno(), size)
                raise
    except OSError as error:
        raise cannot_write(error, path) from error
    if is_new:
        sync_folder(path.parent)


def _write_all(handle: int, content: bytes) -> None:
    view = memoryview(content)
    while view:
        view = view[os.write(handle, view) :]
    os.fsync(handle)
