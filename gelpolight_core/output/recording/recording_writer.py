"""Write a recording, frame by frame."""

from __future__ import annotations

import contextlib
import json
import math
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import tifffile
from isal import isal_zlib

from gelpolight_core.base.arrays import PixelArray
from gelpolight_core.base.atomic_write import cannot_write, sync_folder
from gelpolight_core.base.closable import Closable
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.image.image_file import MAX_PIXELS

from .recording_format import LAST, RecordingHeader

SYNC_S = 2.0
PACKING = 1
"""Compression level; because of noise, higher levels gain nothing."""


class RecordingWriter(Closable):
    """A recording that is being written, for one thread.

    Parameters
    ----------
    path : Path
        A new file: a recording never replaces an existing file.
    header : RecordingHeader
        Description of the recording, written with its first frame.

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
        self._shape: tuple[int, ...] | None = None
        self._kind: np.dtype[Any] | None = None
        self._description = header.as_json()
        self._last_number = -1
        self.frames = self.size_bytes = 0
        self._file: BinaryIO | None = None
        try:
            self._file = path.open("x+b")
        except FileExistsError as error:
            text = "A file with this name already exists"
            raise InputError(text, path, Remedy.CHOOSE_NAME) from error
        except OSError as error:
            raise cannot_write(error, path) from error
        try:
            with self._writing() as file:
                self._tiff = tifffile.TiffWriter(file, bigtiff=True, byteorder="<")
                self._sync(file)
                sync_folder(path.parent)
        except InputError:
            path.unlink()
            raise

    def append(self, rgb: PixelArray, number: int, time_s: float) -> None:
        """Write a frame, which a crash of the program after this call cannot lose.

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
            If the frame is not valid, or the recording is closed.
        """
        self._check(rgb, number, time_s)
        description = {"number": int(number), "time_s": float(time_s)}
        # The description of the recording is that of its first frame.
        self._description = description if self.frames else self._description | description
        with self._writing() as file:
            self._tiff.write(
                iter((pack_pixels(rgb),)),
                shape=rgb.shape,
                dtype=rgb.dtype,
                photometric="rgb",
                planarconfig="contig",
                compression="zlib",
                predictor=True,
                rowsperstrip=rgb.shape[0],
                description=json.dumps(self._description, allow_nan=False),
                metadata=None,
                software=False,
            )
            self._last_number = int(number)
            self.frames += 1
            self.size_bytes = file.tell()
            if time.monotonic() - self._synced_s > SYNC_S:
                self._sync(file)

    def close(self, last_number: int | None = None) -> None:
        """Mark the recording as complete and flush it to disk, also repeatedly.

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
        with self._writing() as file:
            if self.frames:
                last = max(self._last_number, -1 if last_number is None else last_number)
                self._tiff.overwrite_description(json.dumps(self._description | {LAST: last}))
            self._sync(file)
            self._file = None
            file.close()

    def _check(self, rgb: PixelArray, number: int, time_s: float) -> None:
        if rgb.ndim != 3 or rgb.shape[2] != 3 or not 0 < rgb.shape[0] * rgb.shape[1] <= MAX_PIXELS:
            raise ValueError(f"a frame has the shape (rows, columns, 3), not {rgb.shape}")
        if rgb.dtype not in (np.uint8, np.uint16):
            raise ValueError(f"a frame holds uint8 or uint16, not {rgb.dtype}")
        if self._shape is None:
            self._shape, self._kind = rgb.shape, rgb.dtype
        if (rgb.shape, rgb.dtype) != (self._shape, self._kind):
            raise ValueError(f"a frame of {rgb.shape} {rgb.dtype} does not go with the others")
        if number <= self._last_number:
            raise ValueError(f"frame {number} does not follow frame {self._last_number}")
        if not math.isfinite(time_s):
            raise ValueError(f"a frame was made at a time, not at {time_s}")

    @contextmanager
    def _writing(self) -> Iterator[BinaryIO]:
        """Yield the file for a change, and end the recording where it fails."""
        if self._file is None:
            raise ValueError("the recording is closed")
        file = self._file
        try:
            yield file
        except OSError as error:
            self._file = None
            with contextlib.suppress(OSError):  # it writes the rest of its buffer once more
                file.close()
            raise cannot_write(error, self.path) from error

    def _sync(self, file: BinaryIO) -> None:
        file.flush()
        os.fdatasync(file.fileno())
        self._synced_s = time.monotonic()


def pack_pixels(rgb: PixelArray) -> bytes:
    """Return the compressed differences to the left neighbour.

    Parameters
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        At least one pixel.
    """
    differences = np.empty(rgb.shape, rgb.dtype)
    differences[:, 0] = rgb[:, 0]
    np.subtract(rgb[:, 1:], rgb[:, :-1], out=differences[:, 1:])
    return isal_zlib.compress(differences.reshape(-1).view(np.uint8), PACKING)
