"""Write a recording, frame by frame."""

from __future__ import annotations

import contextlib
import math
import os
import time
from pathlib import Path

import numpy as np

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.image.file import MAX_PIXELS
from gelpolight_core.io.atomic import cannot_write, sync_folder
from gelpolight_core.io.closing import Closing
from gelpolight_core.recording import layout
from gelpolight_core.recording.pixels import pack_pixels
from gelpolight_core.recording.recording import VERSION, RecordingHeader, Rgb

SYNC_S = 2.0


class RecordingWriter(Closing):
    """A recording that is being written; for one thread.

    Parameters
    ----------
    path : Path
        A new file: a recording never replaces an existing file.
    header : RecordingHeader
        Description of the recording.

    Attributes
    ----------
    frames : int
        Number of written frames.
    size_bytes : int
        Their size on the disk.

    Raises
    ------
    InputError
        If the file exists or cannot be created.
    """

    def __init__(self, path: Path, header: RecordingHeader) -> None:
        self.path = path
        head = layout.pack_head(VERSION, header.as_json())
        if len(head) > layout.DESCRIPTION_LIMIT:
            raise ValueError("the description of the recording is too long")
        self._shape: tuple[int, ...] | None = None
        self._bits = 0
        self._last_number: int | None = None
        self._link_at = layout.TIFF_LINK_AT
        self.frames = 0
        # Compile the compression code now if needed, not while frames arrive.
        pack_pixels(np.zeros((1, 1, 3), np.uint8))
        try:
            flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_CLOEXEC", 0)
            self._file: int | None = os.open(path, flags, 0o666)
        except FileExistsError as error:
            raise InputError(
                "A file with this name already exists", path, Remedy.CHOOSE_NAME
            ) from error
        except OSError as error:
            raise cannot_write(error, path) from error
        self.size_bytes = 0
        try:
            self._append(head)
            self._sync()
            sync_folder(path.parent)
        except InputError:
            os.close(self._file)
            path.unlink()
            raise

    def append(self, rgb: Rgb, number: int, time_s: float) -> None:
        """Write a frame; after this call, a crash of the program cannot lose it.

        Parameters
        ----------
        rgb : (rows, columns, 3) uint8 or uint16
            All frames must have the same size and type.
        number : int
            Frame number counted by the source; larger than that of the previous frame.
        time_s : float
            Time of the frame.

        Raises
        ------
        InputError
            If it cannot be written; the recording then ends with the previous frame.
        ValueError
            If the frame is not valid.
        """
        if self._file is None:
            raise ValueError("the recording is closed")
        self._check(rgb, number, time_s)
        block = layout.pack_frame(
            pack_pixels(rgb),
            number=int(number),
            time_s=float(time_s),
            shape=(rgb.shape[0], rgb.shape[1]),
            bits=self._bits,
            offset=self.size_bytes,
        )
        self._append(block.data)
        # Other readers see the frame only from now on.
        self._write(block.directory_at.to_bytes(8, "little"), self._link_at)
        self._link_at = block.link_at
        self._last_number = int(number)
        self.frames += 1
        if time.monotonic() - self._synced_s > SYNC_S:
            self._sync()

    def close(self, last_number: int | None = None) -> None:
        """Mark the recording as complete and flush it to disk; may be called repeatedly.

        Parameters
        ----------
        last_number : int, optional
            Number of the last frame of the source, if that frame was not written.

        Raises
        ------
        InputError
            If the disk is full; the frames are still kept.
        """
        if self._file is None:
            return
        written = -1 if self._last_number is None else self._last_number
        last = written if last_number is None else max(written, last_number)
        try:
            self._write(layout.pack_closing(self.frames, last), layout.CLOSING_AT)
            self._sync()
        finally:
            file, self._file = self._file, None
            os.close(file)

    def _check(self, rgb: Rgb, number: int, time_s: float) -> None:
        if rgb.ndim != 3 or rgb.shape[2] != 3 or not 0 < rgb.shape[0] * rgb.shape[1] <= MAX_PIXELS:
            raise ValueError(f"a frame has the shape (rows, columns, 3), not {rgb.shape}")
        if rgb.dtype not in (np.uint8, np.uint16):
            raise ValueError(f"a frame holds uint8 or uint16, not {rgb.dtype}")
        if self._shape is None:
            self._shape, self._bits = rgb.shape, 8 * rgb.dtype.itemsize
        if rgb.shape != self._shape or 8 * rgb.dtype.itemsize != self._bits:
            raise ValueError(f"a frame of {rgb.shape} {rgb.dtype} does not go with the others")
        if number < 0 or (self._last_number is not None and number <= self._last_number):
            raise ValueError(f"frame {number} does not follow frame {self._last_number}")
        if not math.isfinite(time_s):
            raise ValueError(f"a frame was made at a time, not at {time_s}")

    def _append(self, data: bytes) -> None:
        try:
            self._write(data, self.size_bytes)
        except InputError:
            assert self._file is not None
            # Remove the incomplete frame if possible; if it stays, it does no harm.
            with contextlib.suppress(OSError):
                os.ftruncate(self._file, self.size_bytes)
            raise
        self.size_bytes += len(data)

    def _write(self, data: bytes, offset: int) -> None:
        assert self._file is not None
        view = memoryview(data)
        try:
            while view:
                written = os.pwrite(self._file, view, offset)
                view, offset = view[written:], offset + written
        except OSError as error:
            raise cannot_write(error, self.path) from error

    def _sync(self) -> None:
        assert self._file is not None
        try:
            os.fdatasync(self._file)
        except OSError as error:
            raise cannot_write(error, self.path) from error
        self._synced_s = time.monotonic()
