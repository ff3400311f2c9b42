"""Files that grow by whole lines: each appended line is flushed to disk immediately."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from gelpolight_core.io.atomic import cannot_write, sync_folder


def append_durably(path: Path, content: bytes) -> None:
    """Append whole lines to a file, created if it does not exist, and flush them to disk.

    If the disk refuses them, the file keeps its old end as far as possible. A line that a crash cut
    off is ended first.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    try:
        is_new = not path.exists()
        # Unbuffered: data left in a buffer would be written again when the file is closed.
        with path.open("a+b", buffering=0) as file:
            size = os.fstat(file.fileno()).st_size
            file.seek(max(size - 1, 0))
            if size and file.read(1) != b"\n":
                content = b"\n" + content
            try:
                _write_all(file.fileno(), content)
            except OSError:
                with contextlib.suppress(OSError):  # the first refusal is reported
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
