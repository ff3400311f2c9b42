"""Read a recording: random access to frames, with checks."""

from __future__ import annotations

import math
import os
import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.image.file import MAX_PIXELS
from gelpolight_core.io.closing import Closing
from gelpolight_core.io.reading import missing_file, open_file, parse_json, refuse_newer, unreadable
from gelpolight_core.recording import layout
from gelpolight_core.recording.layout import FrameMark
from gelpolight_core.recording.pixels import strip_rows, unpack_strip
from gelpolight_core.recording.recording import VERSION, RecordedFrame, RecordingHeader, Rgb

SEARCH_BYTES = 1 << 20


class Recording(Closing):
    """A recording file, open for reading; any thread may read.

    Attributes
    ----------
    path : Path
        The file.
    header : RecordingHeader
        Description of the recording.
    numbers : (N,) int64
        Frame number counted by the source.
    times_s : (N,) float64
        Time of each frame, on the source's clock.
    size : (int, int)
        Width and height in pixels; (0, 0) without frames.
    bits : int
        8 or 16; 0 without frames.
    lost : int
        Number of missing frames between the first and the last.
    truncated : bool
        Whether the end is missing or a part cannot be read, because the file is truncated or
        damaged or the recording program was stopped.
    """

    def __init__(self, path: Path, file: int) -> None:
        self.path = path
        self._file: int | None = file
        size = os.fstat(file).st_size
        self.header, begin = _read_header(path, file, size)
        self._marks = _find_frames(file, begin, size)
        closing = layout.unpack_closing(os.pread(file, layout.CLOSING.size, layout.CLOSING_AT))
        self.numbers: NDArray[np.int64] = np.array([m.number for m in self._marks], np.int64)
        self.times_s: NDArray[np.float64] = np.array([m.time_s for m in self._marks])
        first = self._marks[0] if self._marks else None
        self.size = (0, 0) if first is None else (first.columns, first.rows)
        self.bits = 0 if first is None else first.bits
        self.truncated = closing is None or closing[0] != len(self._marks)
        last = max(closing[1] if closing else 0, self._marks[-1].number if self._marks else 0)
        made = 0 if first is None else last - first.number + 1
        self.lost = made - len(self._marks)

    @classmethod
    def open(cls, path: Path) -> Recording:
        """Open a recording.

        Raises
        ------
        InputError
            If the file does not exist, is not a recording, has a newer version, or its header is
            damaged.
        """
        try:
            with open_file(path) as stream:
                file = os.dup(stream.fileno())
        except FileNotFoundError as error:
            raise missing_file(path) from error
        try:
            return cls(path, file)
        except OSError as error:
            os.close(file)
            raise unreadable(error, path) from error
        except BaseException:
            os.close(file)
            raise

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self._marks)

    @property
    def duration_s(self) -> float:
        """Time from the first frame to the last."""
        return float(self.times_s[-1] - self.times_s[0]) if len(self) else 0.0

    def frame(self, index: int) -> RecordedFrame:
        """Return a frame exactly as written.

        Raises
        ------
        InputError
            If it is damaged or cannot be read.
        IndexError
            If the index is out of range.
        """
        if self._file is None:
            raise ValueError("the recording is closed")
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        mark = self._marks[index]
        shape = (mark.rows, mark.columns, 3)
        rgb: Rgb = np.empty(shape, np.uint8) if mark.bits == 8 else np.empty(shape, np.uint16)
        rows = strip_rows(mark.rows, len(mark.strips))
        for strip, part in zip(mark.strips, rows, strict=True):
            try:
                data = os.pread(self._file, strip.size, strip.offset)
            except OSError as error:
                raise unreadable(error, self.path) from error
            if zlib.crc32(data) != strip.crc or not unpack_strip(data, rgb[part]):
                raise InputError(f"Frame {index} is damaged", self.path, Remedy.COPY_AGAIN)
        return RecordedFrame(rgb, mark.number, mark.time_s)

    def close(self) -> None:
        """Close the file; may be called repeatedly."""
        if self._file is not None:
            os.close(self._file)
            self._file = None


def is_recording(path: Path) -> bool:
    """Return whether a file starts like a recording, whatever its name and state."""
    try:
        with open_file(path) as stream:
            head = stream.read(layout.CLOSING_AT)
    except (OSError, InputError):
        return False
    return head[layout.HEAD_AT :].startswith(layout.MAGIC)


def _read_header(path: Path, file: int, size: int) -> tuple[RecordingHeader, int]:
    """Return the description of the recording, and the position of the first frame."""
    head = os.pread(file, layout.DESCRIPTION_AT, 0)
    if len(head) < layout.DESCRIPTION_AT or head[layout.HEAD_AT :][:8] != layout.MAGIC:
        raise InputError("The file is not a recording", path, Remedy.CHOOSE_FILE)
    _, version, length, crc = layout.HEAD.unpack_from(head, layout.HEAD_AT)
    refuse_newer(version, VERSION, path)
    end = layout.DESCRIPTION_AT + length
    if length <= layout.DESCRIPTION_LIMIT and end <= size:
        text = os.pread(file, length, layout.DESCRIPTION_AT)
        if zlib.crc32(struct.pack("<II", version, length) + text) == crc:
            try:
                return RecordingHeader.from_json(parse_json(text)), layout.padded(end)
            except ValueError:
                pass  # just as damaged as with a wrong checksum
    raise InputError("The header of the recording is damaged", path, Remedy.COPY_AGAIN)


def _find_frames(file: int, begin: int, size: int) -> list[FrameMark]:
    """Return the marks of all complete frames in the file, in order."""
    marks: list[FrameMark] = []
    offset = begin
    while offset < size:
        mark = layout.unpack_mark(os.pread(file, layout.MARK_LIMIT, offset))
        if mark is not None and _fits(mark, offset, size, marks):
            marks.append(mark)
            offset += mark.size
        else:
            offset = _next_magic(file, offset + 8, size)
    return marks


def _next_magic(file: int, offset: int, size: int) -> int:
    """Return the possible start of the next frame after damage; `size` if there is none."""
    overlap = len(layout.FRAME_MAGIC) - 1
    while offset + overlap < size:
        # Not memory-mapped: if the file shrank meanwhile, the program would crash.
        part = os.pread(file, SEARCH_BYTES, offset)
        found = part.find(layout.FRAME_MAGIC)
        if found >= 0:
            return offset + found
        if len(part) <= overlap:
            break
        offset += len(part) - overlap
    return size


def _fits(mark: FrameMark, offset: int, size: int, before: list[FrameMark]) -> bool:
    """Return whether a mark is plausible: inside the file, and like the frames before it."""
    end = offset + mark.size
    inside = end <= size and all(
        offset < strip.offset and strip.offset + strip.size <= end for strip in mark.strips
    )
    # The last strip may be shorter; an incompressible strip is slightly larger than its data.
    plain = mark.rows_per_strip * mark.columns * 3 * mark.bits // 8 if mark.strips else 0
    inside = inside and all(strip.size <= plain + plain // 8 + 4096 for strip in mark.strips)
    shaped = (
        mark.bits in (8, 16)
        and 0 < mark.rows * mark.columns <= MAX_PIXELS
        and len(strip_rows(mark.rows, len(mark.strips))) == len(mark.strips)
    )
    alike = not before or (
        (mark.rows, mark.columns, mark.bits) == (before[0].rows, before[0].columns, before[0].bits)
        and mark.number > before[-1].number
    )
    return inside and shaped and alike and math.isfinite(mark.time_s)
